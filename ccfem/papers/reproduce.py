"""Papers by name, and their figures and tables made again."""

import importlib
import importlib.util
import os
import pkgutil
from functools import cache
from pathlib import Path

from ccfem.checks import check_known
from ccfem.errors import InputError
from ccfem.io.result_folder import whole_folder
from ccfem.io.whole import whole_file
from ccfem.papers.contents import Contents

__all__ = ["named_papers", "reproduce"]


@cache
def named_papers() -> dict[str, Contents]:
    """Every paper that is built: the packages here that hold a module `contents`."""
    package = importlib.import_module("ccfem.papers")
    found = {}
    for info in pkgutil.iter_modules(package.__path__):
        name = f"ccfem.papers.{info.name}.contents"
        if info.ispkg and importlib.util.find_spec(name) is not None:
            found[info.name] = importlib.import_module(name).CONTENTS
    return found


def reproduce(paper: str, part: str = "", folder: str | Path | None = None) -> Path:
    """Make a paper's figures and tables again.

    Parameters
    ----------
    paper : str
        Its name, as ``"wang_2021"``.
    part : str, default all
        A table or figure, as ``"table2"`` or ``"figure8"``, or ``"claims"``.
    folder : path, default ``results/PAPER``
        Where the files go; those of the same names are replaced.

    Returns
    -------
    Path
        The file that was written, or the folder of all.

    Raises
    ------
    InputError
        For an unknown paper or part, the known ones listed; where the authors' data is needed and
        not named.
    """
    check_known("paper", paper, sorted(named_papers()))
    contents = named_papers()[paper]
    if part:
        check_known(f"part of {paper}", part, contents.parts)
    if contents.needs and not os.environ.get(contents.needs):
        raise InputError(
            f"{paper} needs the authors' data; expected the environment variable {contents.needs} "
            "to name their folder: set it"
        )
    into = Path("results") / paper if folder is None else Path(folder)
    if not part:
        with whole_folder(into, (), force=True) as files:
            contents.whole(files)
        return into
    into.mkdir(parents=True, exist_ok=True)
    study = cache(contents.run)
    if part in contents.tables:
        text = contents.tables[part](study)
        path = into / f"{part}.md"
        with whole_file(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        return path
    return _drawn(contents, int(part.removeprefix("figure")), study(), into)


def _drawn(contents: Contents, number: int, study: object, folder: Path) -> Path:
    """Draw the figures of a number; the path of the last one."""
    from ccfem.plot.canvas import save

    path = folder
    for name, figure in contents.figures(study).items():
        if name.startswith(f"figure_{number:02}"):
            path = folder / f"{name}.png"
            save(figure, path)
    return path
