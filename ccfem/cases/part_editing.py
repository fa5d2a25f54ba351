"""Edits of a part file as text: from one text to the next, comments and the rest kept as they are.

Each edit is made twice: on the plain values, which says what must come out, and on the text with
its comments, which must then read as these values.
"""

import copy
import re
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from os.path import relpath
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import AoT, InlineTable

from ccfem.base.errors import InputError
from ccfem.base.toml import toml_of
from ccfem.body.files.deck import check_included
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.cases.inspection.face_choice import face_rule, patch_name
from ccfem.cases.part_draft import PartDraft

Keys = Sequence[str | int]
"""Where a value stands: names of tables, and places in lists."""
Change = Callable[[Any], None]
"""Changes a content in place: a dict, or a document of tomlkit."""

_HEAVY = re.compile(r">\s*([^<>]+?):/")
"""File of the numbers of an XDMF mesh, in front of their place in it."""


@dataclass(frozen=True)
class History:
    """Texts of a part file, one after the other, and which of them is shown."""

    texts: tuple[str, ...]  # at least one
    place: int = 0  # of the text that is shown
    field: str = ""  # field whose value was changed last: to change it again is the same step

    @property
    def text(self) -> str:
        """The text that is shown."""
        return self.texts[self.place]

    def after(self, text: str, field: str = "") -> "History":
        """Add a text; what was undone is forgotten."""
        if text == self.text:
            return self
        again = bool(field) and field == self.field and self.place > 0
        kept = self.texts[: self.place + (0 if again else 1)]
        return History((*kept, text), len(kept), field)

    def moved(self, steps: int) -> "History":
        """Go back by a number below 0, or forth again."""
        place = min(max(self.place + steps, 0), len(self.texts) - 1)
        return replace(self, place=place, field="")


def content_of(text: str) -> dict[str, Any]:
    """Content of a part file."""
    return toml_of(text, "the part file")


def draft_of(text: str) -> PartDraft:
    """Return what a part file says, as far as it reads."""
    return PartDraft(content_of(text))


def edited(text: str, change: Change) -> str:
    """Text of a part file after a change, which keeps its comments.

    Raises
    ------
    InputError
        Where the text is laid out so that it would read as something else.
    """
    wanted, document = content_of(text), tomlkit.parse(text)
    try:
        change(wanted)
        change(document)
        after = tomlkit.dumps(document)
        right = tomllib.loads(after) == wanted
    except (tomlkit.exceptions.TOMLKitError, AttributeError, LookupError, TypeError, ValueError):
        right = False
    if not right:
        raise InputError(
            "the part file is laid out so that this cannot be changed here: change it in an editor"
        )
    return after


def valued(keys: Keys, value: Any) -> Change:
    """Set a value, and the tables in which it stands; None removes it, and a table left empty."""

    def change(content: Any) -> None:
        at = content
        for key in keys[:-1]:
            if isinstance(key, str) and key not in at:
                if value is None:
                    return
                at[key] = _like(content, {}, isinstance(at, InlineTable))
            at = at[key]
        if value is not None:
            inline = isinstance(at, InlineTable)
            at[keys[-1]] = _like(content, value, inline)
            if _is_text(content) and isinstance(value, Mapping) and not inline:
                at[keys[-1]].add(tomlkit.nl())
        elif keys[-1] in at:
            del at[keys[-1]]
            if len(keys) > 1 and not len(at):
                valued(keys[:-1], None)(content)

    return change


def appended(keys: Keys, table: Mapping[str, Any]) -> Change:
    """Add a table to a list of tables, ``[[supports]]`` or ``[[loads.NAME]]``."""

    def change(content: Any) -> None:
        at = content
        for key in keys[:-1]:
            if key not in at:
                at[key] = tomlkit.table(is_super_table=True) if _is_text(content) else {}
            at = at[key]
        last = keys[-1]
        if last not in at:
            listed = tomlkit.array() if isinstance(at, InlineTable) else tomlkit.aot()
            at[last] = listed if _is_text(content) else []
        at[last].append(_like(content, table, inline=not isinstance(at[last], AoT)))
        if isinstance(at[last], AoT):
            at[last][-1].add(tomlkit.nl())

    return change


def removed(keys: Keys) -> Change:
    """Remove a table from a list of tables, the list with the last one, and patches used no more.

    A patch that the part file names nowhere else goes with it.
    """

    def change(content: Any) -> None:
        *outer, last, place = keys
        at = content
        for key in outer:
            at = at[key]
        table = at[last][place]
        names = [table.get("patch"), *(table.get("patches") or ())]
        del at[last][place]
        if not len(at[last]):
            del at[last]
            if outer and not len(at):
                del content[outer[0]]
        for name in filter(None, names):
            rest = {key: value for key, value in content.items() if key != "patches"}
            if name in content.get("patches", {}) and not _names(rest, name):
                del content["patches"][name]
                if not len(content["patches"]):
                    del content["patches"]

    return change


def _names(value: Any, name: str) -> bool:
    """Whether a text stands anywhere among the values."""
    if isinstance(value, Mapping):
        return any(_names(entry, name) for entry in value.values())
    if isinstance(value, list):
        return any(_names(entry, name) for entry in value)
    return bool(value == name)


def _is_text(content: Any) -> bool:
    return isinstance(content, tomlkit.TOMLDocument)


def _like(content: Any, value: Any, inline: bool = False) -> Any:
    """Value as the content holds it: plain, or as tomlkit writes it."""
    if not _is_text(content):
        return copy.deepcopy(value)
    if not isinstance(value, Mapping):
        return tomlkit.item(value)
    table: Any = tomlkit.inline_table() if inline else tomlkit.table()
    for key, entry in value.items():
        table.add(key, _like(content, entry, inline=True))
    return table


# The files that a part file names.


def check_files(text: str, home: Path, allowed: Sequence[Path]) -> None:
    """Refuse a part file that has a file read outside the folders that are allowed.

    Parameters
    ----------
    home : Path
        Folder that its paths are relative to.
    allowed : sequence of Path
        The first is where the part is run: the folder of layers is relative to that.
    """
    draft = draft_of(text)
    for name in draft.files.values():
        check_body(home / name, allowed)
    slicing = draft.content.get("slicing")
    layers = slicing.get("folder") if isinstance(slicing, Mapping) else None
    if isinstance(layers, str):
        check_inside(allowed[0] / layers, allowed)


def check_body(path: Path, allowed: Sequence[Path]) -> None:
    """Refuse a file outside the folders that are allowed, and one that has others read there."""
    real = check_inside(path, allowed)
    if not real.is_file():
        return
    if real.suffix.lower() == ".inp":
        check_included(real, lambda other: check_inside(other, allowed))
    elif real.suffix.lower() == ".xdmf":
        for name in _HEAVY.findall(real.read_text(encoding="utf-8", errors="replace")):
            check_inside(real.parent / name, allowed)


def check_inside(path: Path, allowed: Sequence[Path]) -> Path:
    """Return a path with its links followed where it lies in one of the folders."""
    try:
        real = path.resolve()
    except (OSError, ValueError, RuntimeError):
        raise InputError(f"{str(path)!r} is no path: correct it") from None
    if not any(real.is_relative_to(folder.resolve()) for folder in allowed):
        raise InputError(
            f"{path} lies outside {', '.join(map(str, allowed))}: start ccfem open in a folder "
            "that holds it"
        )
    return real


def rebased(text: str, home: Path, to: Path) -> str:
    """Text of a part file whose relative paths start from another folder."""
    for keys, name in draft_of(text).files.items():
        if not Path(name).is_absolute() and home.resolve() != to.resolve():
            path = relpath((home / name).resolve(), to.resolve()).replace("\\", "/")
            text = edited(text, valued(keys, path))
    return text


# Faces, as a patch of the part file.


def patch_of(text: str, listing: BodyFaces, numbers: Collection[int]) -> tuple[str, str]:
    """Text with a patch for faces, and its name: one that is there already, or a new one.

    The name says what the faces are, not what is done to them.
    """
    if not numbers:
        raise InputError("no face is chosen: click one, or choose it from the list")
    rule, known = face_rule(listing, numbers), draft_of(text).patches
    tables = [table for table in known.values() if isinstance(table, Mapping)]
    # All rules for faces of a part have one feature angle.
    rule |= next(({"angle": table["angle"]} for table in tables if "angle" in table), {})
    for name, table in known.items():
        if table == rule:
            return text, name
    stem, name, count = patch_name(listing, numbers, rule.get("normal")), "", 1
    while not name or name in known:
        name, count = f"{stem}_{count}" if count > 1 else stem, count + 1
    return edited(text, valued(("patches", name), rule)), name
