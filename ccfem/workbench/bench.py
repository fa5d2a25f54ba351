"""What is on the bench: a part file as text with its history, and the body that it is of.

Nothing is read outside the folder where the workbench was started, and nothing written outside
``results/`` there.
"""

import functools
import itertools
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ccfem.base.checks import check_known
from ccfem.base.errors import InputError, SolveError
from ccfem.base.whole import existing_file, text_of, whole_file
from ccfem.body.files.formats import suffixes
from ccfem.body.files.mesh_file import write_mesh
from ccfem.body.files.surface import is_surface
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.meshing.cad import is_cad
from ccfem.cases.inspection import Check, check
from ccfem.cases.inspection.beginning import empty_part, faces_in_mm
from ccfem.cases.part_draft import PartDraft
from ccfem.cases.part_editing import (
    Change,
    History,
    check_body,
    check_files,
    check_inside,
    content_of,
    draft_of,
    edited,
    rebased,
    valued,
)
from ccfem.cases.part_file import faces_of_content, part_case
from ccfem.cases.part_writing import part_text
from ccfem.cases.reading import create_case, named_cases
from ccfem.cases.stored import data_folder

UPLOADS = "uploads"
"""Folder in ``results/`` for files that were uploaded."""
_LISTED = 100
"""Files that are offered."""


Said = tuple[tuple[str, str], ...]
"""What a check says: kind and line of each."""


@dataclass(frozen=True)
class Opened:
    """What was opened."""

    stem: str  # name of the part file, without ``.toml``
    home: Path  # folder that paths in the text start from
    file: Path | None  # the part file that was opened; None for a body
    text: str  # the part file as it was opened


class Bench:
    """A folder, and the part that is being worked on.

    Parameters
    ----------
    folder : Path
        What lies in it may be read.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self.results = self.folder / "results"
        self.opened: Opened | None = None
        self.history = History(("",))
        self._saved: Path | None = None
        self._listing: tuple[Any, BodyFaces] | None = None

    @property
    def text(self) -> str:
        """The part file that is shown."""
        return self.history.text

    @property
    def content(self) -> Mapping[str, Any]:
        """What it says."""
        return self.draft.content

    @property
    def draft(self) -> PartDraft:
        """What it says, as far as it reads."""
        return draft_of(self.text)

    @property
    def _there(self) -> Opened:
        if self.opened is None:
            raise InputError("there is no part: open one under “Part file”")
        return self.opened

    # Opening.

    def offered(self) -> list[str]:
        """Files of the folder that can be opened, and earlier part files of the workbench."""
        bodies = [path for path in sorted(self.folder.iterdir()) if _is_body(path)]
        tables = [*sorted(self.folder.glob("*.toml")), *sorted(self.results.glob("*.toml"))]
        there = [path for path in tables if path.exists()]
        bodies += [path for path in there if _names_body(path, path.stat().st_mtime_ns)]
        return [path.relative_to(self.folder).as_posix() for path in bodies[:_LISTED]]

    def open(self, what: str | os.PathLike[str]) -> None:
        """Open a body, a part file or a case by name; on an error what was on the bench stays."""
        name = os.fspath(what)
        if not Path(name).suffix and not {"/", "\\"} & set(name):
            check_known("case", name, named_cases(), "or name a file")
            name = str(self._write_case(name))
        path = check_inside(self.folder / name, [self.folder])
        shown = path.relative_to(self.folder)
        if path.suffix == ".toml":
            text = text_of(path, "part file")
            listing = self._faces(text, path.parent)
            opened = Opened(path.stem, path.parent, path, text)
        elif _is_body(path):
            check_body(existing_file(path, "the body"), [self.folder])
            listing, doubt = faces_in_mm(path)
            text = empty_part(shown, listing, doubt)
            stem = re.sub(r"[^\w-]+", "_", path.stem) or "part"
            opened = Opened(stem, self.folder, None, text)
        else:
            raise InputError(
                f"{shown} is no body and no part file: name a STEP, STL or mesh file, a part file "
                "(.toml) or a case"
            )
        self.opened, self.history = opened, History((text,))
        self._saved, self._listing = None, (draft_of(text).body, listing)

    def _write_case(self, name: str) -> Path:
        """Part file of a case in ``results``, with its mesh."""
        shipped = data_folder() / f"{name}.toml"
        if shipped.exists():
            text = shipped.read_text(encoding="utf-8")
            for keys, file in draft_of(text).files.items():
                self._write(self.results / Path(file).name, (shipped.parent / file).read_bytes())
                text = edited(text, valued(keys, Path(file).name))
        else:
            case = create_case(name)
            text = part_text(case, f"{name}.vtu")
            self.make(self.results)
            write_mesh(case.problem.mesh, self.results / f"{name}.vtu")
        path = self._free(self.results / f"{name}.toml", text.encode())
        self._write(path, text.encode())
        return path

    def upload(self, name: str, content: bytes) -> str:
        """Keep a file that was uploaded; returns what opens it."""
        plain = re.sub(r"[^\w.-]+", "_", Path(name.replace("\\", "/")).name).lstrip(".")
        if not plain or not (_is_body(Path(plain)) or plain.endswith(".toml")):
            raise InputError(
                f"{name} is no body and no part file: upload a STEP, STL or mesh file, or a .toml"
            )
        path = self._free(self.results / UPLOADS / plain, content)
        self._write(path, content)
        return path.relative_to(self.folder).as_posix()

    # Faces.

    @property
    def listing(self) -> BodyFaces:
        """Faces of the body of the part file that is shown."""
        body = self.draft.body
        if self._listing is None or self._listing[0] != body:
            self._listing = (body, self._faces(self.text, self._there.home))
        return self._listing[1]

    def _faces(self, text: str, home: Path) -> BodyFaces:
        check_files(text, home, [self.folder])
        draft = draft_of(text)
        return faces_of_content(draft.content, home, draft.feature_angle)

    # Editing.

    def edit(self, change: Change | str, field: str = "") -> None:
        """Change the part file and save it in ``results``; on an error nothing is changed.

        A text takes the place of the part file.
        """
        text = change if isinstance(change, str) else edited(self.text, change)
        self._show(self.history.after(text, field))

    def step(self, steps: int) -> None:
        """Undo steps, below 0, or redo them."""
        self._show(self.history.moved(steps))

    def _show(self, history: History) -> None:
        before, self.history = self.history, history
        if history.text != before.text:
            try:
                self._save()
            except (InputError, OSError):
                self.history = before
                raise

    def _save(self) -> None:
        if self._saved is None:
            place = self.results / f"{self._there.stem}.toml"
            self._saved = self._free(place, self.text.encode())
        self._write(self._saved, self._kept_text.encode())

    @property
    def _kept_text(self) -> str:
        """The text that is shown, as it is kept in ``results``."""
        return rebased(self.text, self._there.home, self.results)

    def _free(self, place: Path, content: bytes) -> Path:
        """Return a place in ``results``, or that with a number, where nothing else is replaced."""
        mine = None if self.opened is None else self.opened.file
        places = (place.with_stem(f"{place.stem}-{count}") for count in itertools.count(2))
        return next(
            path
            for path in itertools.chain([place], places)
            if path == mine or not path.exists() or path.read_bytes() == content
        )

    def make(self, folder: Path) -> None:
        """Make a folder, ``results`` or one in it."""
        check_inside(self.results, [self.folder])
        check_inside(folder, [self.results])
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"{folder} cannot be made ({error.strerror}): move what is in its place, or start "
                "ccfem open in a folder that you may write to"
            ) from None

    def _write(self, path: Path, content: bytes) -> None:
        """Write a file in ``results``."""
        self.make(path.parent)
        with whole_file(path) as temporary:
            temporary.write_bytes(content)

    # Checking and running.

    def part_file(self) -> Path:
        """File that holds what is shown: the one that was opened, or the one in ``results``."""
        opened = self._there
        if opened.file is not None and self.text == opened.text:
            return opened.file
        if self._saved is None:
            self._save()
        assert self._saved is not None
        return self._saved

    def is_of(self, text: str) -> bool:
        """Whether a text, as a run has read it, is the part file that is shown."""
        return text in (self.text, self._kept_text)

    def part_argument(self) -> str:
        """Name of that file from the folder, as a command takes it."""
        return self._argument(self.part_file())

    def _argument(self, path: Path) -> str:
        name = path.relative_to(self.folder).as_posix()
        return f"./{name}" if name.startswith("-") else name

    def result(self, ending: str) -> str:
        """Name of a file or a folder of results, as a command takes it: in ``results`` alone."""
        check_inside(self.results, [self.folder])
        return self._argument(check_inside(self.results / f"{self.name}{ending}", [self.results]))

    @property
    def name(self) -> str:
        """Name of the part, which the folder of its results has."""
        return str(self.content.get("name") or self.part_file().stem)

    def other_part(self, name: str) -> str:
        """Name of a part file that is printed beside this one, from the folder."""
        path = check_inside(self.folder / name, [self.folder])
        check_files(text_of(path, "part file"), path.parent, [self.folder])
        return self._argument(path)

    def check(self, text: str) -> tuple[Check | None, Said]:
        """Check a text as ``ccfem check`` does: what is known of it, and the lines to be said."""
        opened = self._there
        try:
            check_files(text, opened.home, [self.folder])
            case = part_case(content_of(text), opened.home / f"{opened.stem}.toml")
            checked = check(case)
        except (InputError, SolveError) as error:
            mistakes = getattr(error, "mistakes", (str(error),))
            return None, tuple(("mistake", line) for line in mistakes)
        except Exception as error:  # a check that fails ends no other
            return None, (("mistake", f"{type(error).__name__}: {error}"),)
        lines = checked.faults | {"warning": checked.warnings, "known": checked.facts}
        return checked, tuple(
            (kind, line) for kind, sentences in lines.items() for line in sentences
        )


def _is_body(path: Path) -> bool:
    return is_surface(path) or is_cad(path) or path.suffix.lower() in suffixes()


@functools.cache
def _names_body(path: Path, _: int) -> bool:
    """Whether a TOML file, as it was at some time, names a body."""
    try:
        content = content_of(text_of(path, "part file"))
    except (InputError, OSError):
        return False
    return bool(content.keys() & {"mesh", "surface", "planform"})
