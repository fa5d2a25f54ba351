"""Edits of a part file as text: from one text to the next, comments and the rest kept as they are.

Each edit is made twice: on the plain values, which says what must come out, and on the text with
its comments, which must then read as these values. Undo is the text before.
"""

import copy
import json
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from os.path import relpath
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import AoT

from ccfem.base.errors import InputError
from ccfem.body.files.surface import is_surface
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.face_rules import Faces, Holes
from ccfem.body.mesh.smooth_faces import direction_text
from ccfem.body.meshing.cad import is_cad
from ccfem.cases.inspection.beginning import usual_edge_length

Keys = Sequence[str | int]
"""Where a value stands: names of tables, and places in lists."""
Change = Callable[[Any], None]
"""Changes a content in place: a dict, or a document of tomlkit."""

_HEAD = "# Made with ccfem open. Lengths in mm, forces in N, stresses in MPa."


def content_of(text: str) -> dict[str, Any]:
    """Content of a part file.

    Raises
    ------
    InputError
        Where the text is not TOML.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"the part file is not TOML: {error}: correct this line") from None


def edited(text: str, change: Change) -> str:
    """Text of a part file after a change, which keeps its comments.

    Raises
    ------
    InputError
        Where the text is laid out so that it would read as something else.
    """
    wanted = content_of(text)
    change(wanted)
    document = tomlkit.parse(text)
    try:
        change(document)
        after = tomlkit.dumps(document)
        right = tomllib.loads(after) == wanted
    except (tomlkit.exceptions.TOMLKitError, tomllib.TOMLDecodeError, AttributeError, TypeError):
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
                at[key] = _like(content, {})
            at = at[key]
        if value is not None:
            at[keys[-1]] = _like(content, value)
            if _is_text(content) and isinstance(value, Mapping):
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
            at[last] = tomlkit.aot() if _is_text(content) else []
        at[last].append(_like(content, table, inline=not isinstance(at[last], AoT)))

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
        for name in names:
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


# What a part file begins with, and the files that it names.


def begun(body: str, listing: BodyFaces) -> str:
    """Text of a part file for a body: nothing is held and nothing loaded yet."""
    lines = [_HEAD, ""]
    if is_surface(body) or is_cad(body):
        edge = usual_edge_length(listing)
        lines += [f"surface = {json.dumps(body)}", f"edge_length = {edge:.3g}  # of the cells"]
    else:
        lines.append(f"mesh = {json.dumps(body)}")
    if listing.doubt:
        lines.append("scale = 1000  # the lengths of the file look like metres")
    return "\n".join([*lines, 'material = "pla"', ""])


def files_in(content: Mapping[str, Any]) -> dict[tuple[str | int, ...], str]:
    """Files that a part file names, by where they stand in it."""
    named: dict[tuple[str | int, ...], Any] = {
        (key,): content.get(key) for key in ("mesh", "surface")
    }
    fibre = content.get("fibre")
    regions = fibre.get("regions") if isinstance(fibre, Mapping) else None
    for k, region in enumerate(regions if isinstance(regions, list) else ()):
        if isinstance(region, Mapping):
            named["fibre", "regions", k, "file"] = region.get("file")
    return {keys: name for keys, name in named.items() if isinstance(name, str)}


def check_files(text: str, home: Path, allowed: Collection[Path]) -> None:
    """Refuse a part file that names a file outside the folders that are allowed.

    Parameters
    ----------
    home : Path
        Folder that its paths are relative to.

    Raises
    ------
    InputError
    """
    for name in files_in(content_of(text)).values():
        check_inside(home / name, allowed)


def check_inside(path: Path, allowed: Collection[Path]) -> Path:
    """Return a path with its links followed where it lies in one of the folders.

    Raises
    ------
    InputError
        Where it does not.
    """
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
    for keys, name in files_in(content_of(text)).items():
        if not Path(name).is_absolute() and home.resolve() != to.resolve():
            path = relpath((home / name).resolve(), to.resolve()).replace("\\", "/")
            text = edited(text, valued(keys, path))
    return text


# Faces that are chosen, as a rule with a name.


def patch_of(text: str, listing: BodyFaces, numbers: Collection[int]) -> tuple[str, str]:
    """Text with a patch for faces, and its name: one that is there already, or a new one.

    The name says what the faces are, not what is done to them.

    Raises
    ------
    InputError
        Where no face is chosen.
    """
    if not numbers:
        raise InputError("no face is chosen: click one, or choose it from the list")
    rule, known = rule_of(listing, numbers), content_of(text).get("patches", {})
    # All rules for faces of a part have one feature angle.
    rule |= next(({"angle": table["angle"]} for table in known.values() if "angle" in table), {})
    for name, table in known.items():
        if table == rule:
            return text, name
    stem, name, count = _stem(listing, numbers, rule), "", 1
    while not name or name in known:
        name, count = f"{stem}_{count}" if count > 1 else stem, count + 1
    return edited(text, valued(("patches", name), rule)), name


def rule_of(listing: BodyFaces, numbers: Collection[int]) -> dict[str, Any]:
    """Table of the rule that chooses faces: all holes of a radius, else their places."""
    wanted, radius = sorted(numbers), listing.face(min(numbers)).radius
    if len(wanted) > 1 and wanted == like_holes(listing, wanted[0]):
        return {"rule": "holes", "radius": float(f"{radius:.3g}")}
    places = [listing.place(number) for number in wanted]
    points = [list(place["at"]) for place in places]
    place: dict[str, Any] = {"at": points[0] if len(points) == 1 else points}
    for keys in (("normal",), ("axis", "radius")):
        those = [[written(place.get(key)) for key in keys] for place in places]
        if None not in those[0] and all(entry == those[0] for entry in those):
            place |= dict(zip(keys, those[0], strict=True))
    try:
        right = sorted(Faces(**place).numbers_on(listing)) == wanted
    except InputError:
        right = False
    return {"rule": "face", **(place if right else {"number": wanted})}


def written(value: Any) -> Any:
    """Radius or direction of a face as a part file has it."""
    if value is None or isinstance(value, float):
        return value
    text = direction_text(value)
    return json.loads(text) if text.startswith("[") else text


def like_holes(listing: BodyFaces, number: int) -> list[int]:
    """Numbers of the walls of all holes of the radius of a face; itself alone where it is none."""
    face = listing.face(number)
    if face.kind != "cylinder" or not face.hollow:
        return [number]
    chosen = {id(wall) for wall in Holes(float(f"{face.radius:.3g}")).walls(listing.faces)}
    pairs = zip(listing.numbers, listing.faces, strict=True)
    return sorted(k for k, wall in pairs if id(wall) in chosen)


def coplanar(listing: BodyFaces, number: int) -> list[int]:
    """Numbers of the planes at the height of a plane that face the same way, itself included."""
    plane, reach = listing.face(number), 1e-3 * listing.size
    if plane.kind != "plane":
        return [number]
    return sorted(
        k
        for k, face in zip(listing.numbers, listing.faces, strict=True)
        if face.kind == "plane"
        and face.direction @ plane.direction > 1.0 - 1e-4
        and abs((face.centre - plane.centre) @ plane.direction) <= reach
    )


def _stem(listing: BodyFaces, numbers: Collection[int], rule: Mapping[str, Any]) -> str:
    """Name for faces, by their kind and size or direction."""
    faces = [listing.face(number) for number in numbers]
    kinds = {face.kind for face in faces}
    several = "s" if len(faces) > 1 else ""
    if kinds == {"cylinder"} and len({f"{face.radius:.3g}" for face in faces}) == 1:
        what = "hole" if all(face.hollow for face in faces) else "round"
        return f"{what}{several}_r{faces[0].radius:.3g}".replace(".", "_")
    if kinds == {"plane"} and isinstance(rule.get("normal"), str):
        return f"plane{several}_{rule['normal'].replace('-', 'minus_')}"
    return "face" + several if kinds != {"plane"} else "plane" + several


@dataclass(frozen=True)
class History:
    """Texts of a part file, one after the other, and which of them is shown.

    Attributes
    ----------
    texts : tuple of str
        At least one.
    place : int
        Of the text that is shown.
    field : str
        Field whose value was changed last: to change it again is the same step.
    """

    texts: tuple[str, ...]
    place: int = 0
    field: str = ""

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
