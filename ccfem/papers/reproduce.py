"""Papers by name, and their figures and tables made again."""

import hashlib
import importlib
import importlib.util
import json
import os
import pkgutil
from collections.abc import Callable
from functools import cache
from importlib import metadata, resources
from pathlib import Path
from typing import Any

from ccfem.base.checks import check_known
from ccfem.base.errors import InputError
from ccfem.base.progress import Progress, silent
from ccfem.base.result_folder import whole_folder
from ccfem.base.whole import whole_file
from ccfem.papers.contents import Contents

KEPT = "kept.json"
"""File beside the tables and figures of a paper that says what they were made of."""
_DATA = ("CCFEM_CHEN2021", "CCFEM_FANG2024", "CCFEM_ZHANG2025")
"""Environment variables that name data of authors."""


@cache
def named_papers() -> dict[str, Contents]:
    """Every paper that is built: the packages here that hold a module `contents`."""
    package = importlib.import_module("ccfem.papers")
    papers = {}
    for info in pkgutil.iter_modules(package.__path__):
        name = f"ccfem.papers.{info.name}.contents"
        if info.ispkg and importlib.util.find_spec(name) is not None:
            papers[info.name] = importlib.import_module(name).CONTENTS
    return papers


def reproduce(
    paper: str, part: str = "", folder: str | Path | None = None, progress: Progress = silent
) -> Path:
    """Make a paper's figures and tables again.

    A part alone runs no more of the study than it needs, and is kept: asked for again it is there
    at once, unless the code, the libraries or the authors' data have changed.

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
            contents.whole(files, progress)
        return into
    into.mkdir(parents=True, exist_ok=True)
    inputs = _inputs()
    kept = _kept(into, part, inputs)
    if kept:
        progress(f"{part} is kept from an earlier run", 1.0)
        return kept[-1]
    study = cache(lambda: contents.run(progress))
    written = _written(contents, part, study, into, progress)
    _keep(into, part, inputs, written)
    return written[-1]


def _written(
    contents: Contents, part: str, study: Callable[[], Any], into: Path, progress: Progress
) -> list[Path]:
    """Write a table, or the figures of a number; their files."""
    if part in contents.tables:
        text = contents.tables[part](study)
        path = into / f"{part}.md"
        with whole_file(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        return [path]
    from ccfem.comparison.plot.canvas import save

    drawn = contents.figures(study(), int(part.removeprefix("figure")))
    written = []
    for name, figure in drawn.items():
        progress(f"writing {name}.png", 1.0)
        written.append(into / f"{name}.png")
        save(figure, written[-1])
    return written


def _inputs() -> str:
    """Digest of all that a part follows from: code, libraries, data of the authors."""
    digest = hashlib.sha256()
    roots = [Path(str(resources.files("ccfem")))]
    roots += [Path(os.environ[name]) for name in _DATA if os.environ.get(name)]
    for root in roots:
        for file in sorted(root.rglob("*")):
            if file.is_file() and file.suffix not in (".pyc", ".nbi", ".nbc"):
                digest.update(f"{file.relative_to(root)}\0".encode())
                digest.update(hashlib.sha256(file.read_bytes()).digest())
    for library in ("numpy", "scipy", "shapely", "matplotlib"):
        digest.update(f"{library} {metadata.version(library)}\0".encode())
    return digest.hexdigest()


def _record(folder: Path) -> dict[str, Any]:
    """Read what is kept in a folder: by part, its inputs and the digests of its files."""
    try:
        record = json.loads((folder / KEPT).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return record if isinstance(record, dict) else {}


def _kept(folder: Path, part: str, inputs: str) -> list[Path]:
    """Files of a part that follow from these inputs and are as they were written; else none."""
    entry = _record(folder).get(part)
    if not isinstance(entry, dict) or entry.get("inputs") != inputs:
        return []
    digests = entry.get("files")
    if not isinstance(digests, dict):
        return []
    files = [folder / Path(name).name for name in digests]
    same = all(
        file.is_file() and _digest(file) == digest
        for file, digest in zip(files, digests.values(), strict=True)
    )
    return files if same else []


def _keep(folder: Path, part: str, inputs: str, files: list[Path]) -> None:
    """Note what a part was made of."""
    entry = {"inputs": inputs, "files": {file.name: _digest(file) for file in files}}
    with whole_file(folder / KEPT) as temporary:
        text = json.dumps({**_record(folder), part: entry}, indent=1)
        temporary.write_text(text, encoding="utf-8")


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()
