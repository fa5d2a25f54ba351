"""The tab for loads and supports: faces that are chosen, what may act on them, and what does."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.workbench.guard import escaped
from ccfem.workbench.part_edits import (
    appended,
    coplanar,
    edited,
    like_holes,
    patch_of,
    removed,
    valued,
)
from ccfem.workbench.tab import Tabbed

_NO_FACE = "choose a face"
_LISTED = 200
"""Faces that can be chosen from the list; smaller ones by clicking."""
_KINDS = {
    "pull or push (force)": "force",
    "bearing of a pin": "bearing",
    "pressure": "pressure",
    "weight of the whole part": "gravity",
}
_FORCE = 100.0
"""Force, N, that is proposed."""


@dataclass(frozen=True)
class Entry:
    """A load or a support of the part file.

    Attributes
    ----------
    keys : tuple
        Where it stands: ("supports", 0) or ("loads", name, 0).
    table : mapping
        What it says.
    """

    keys: tuple[str | int, ...]
    table: Mapping[str, Any]

    @property
    def title(self) -> str:
        """One line."""
        patch = self.table.get("patch") or self.table.get("patches") or ""
        on = f" on {patch}" if patch else ""
        if self.keys[0] == "supports":
            kind = str(self.table.get("kind", "held"))
            return f"{_SUPPORTS.get(kind, kind)}{on}"
        return f"{self.keys[1]}: {self.table.get('kind', 'load')}{on}"


_SUPPORTS = {"held": "Hold", "sliding": "Roll"}


def vector_of(table: Mapping[str, Any]) -> FloatArray | None:
    """Vector of a load, (3,); None where it has none."""
    try:
        vector = np.array(table.get("vector"), dtype=float)
    except (TypeError, ValueError):
        return None
    return vector if vector.shape == (3,) else None


class LoadsTab:
    """Chosen faces, buttons for what acts on them, and a list of what does."""

    def __init__(self, page: Tabbed) -> None:
        self.page, gui = page, page.server.gui
        self._said = gui.add_html("")
        self._faces = gui.add_dropdown(
            "Face", [_NO_FACE], hint="Or click it in the picture; with Shift one more."
        )
        self._faces.on_update(page.on_value(self._choose))
        more = gui.add_button_group("Choose", ["Same radius", "Same plane", "None"])
        more.on_click(page.on_value(self._choose_more))
        holds = gui.add_button_group("Support", ["Hold", "Roll"])
        holds.on_click(page.on_value(self._support))
        with gui.add_folder("Load"):
            self.kind = gui.add_dropdown("Kind", list(_KINDS))
            self.kind.on_update(page.on(self._show_kind))
            self.vector = gui.add_vector3("Force, N", (0.0, 0.0, _FORCE), step=1.0)
            self.pressure = gui.add_number("Pressure, MPa", 0.1, step=0.1, visible=False)
            self.case = gui.add_text("Load case", "load")
            gui.add_button("Add load").on_click(page.on(self._load))
        self._list = gui.add_folder("In the part", visible=False)
        self._shown: list[Any] = []
        self._fields: dict[tuple[str | int, ...], Any] = {}
        self._titles: list[str] = []

    def entries(self) -> list[Entry]:
        """Supports and loads of the part file, as far as they read."""
        content, found = self.page.bench.content, []
        supports, cases = content.get("supports"), content.get("loads")
        for k, table in enumerate(supports if isinstance(supports, list) else ()):
            found.append(Entry(("supports", k), table))
        for name, tables in (cases if isinstance(cases, Mapping) else {}).items():
            for k, table in enumerate(tables if isinstance(tables, list) else ()):
                found.append(Entry(("loads", name, k), table))
        return [entry for entry in found if isinstance(entry.table, Mapping)]

    # Faces.

    def list_faces(self) -> None:
        """Offer the faces of the body that is shown."""
        listing = self.page.bench.listing
        pairs = zip(listing.numbers, listing.faces, strict=True)
        largest = sorted(pairs, key=lambda pair: -pair[1].area)[:_LISTED]
        named = [f"{k}: {face.shape}" for k, face in sorted(largest, key=lambda pair: pair[0])]
        self._faces.options = (_NO_FACE, *named)
        self._faces.value = _NO_FACE

    def _choose(self, name: str) -> None:
        if name != _NO_FACE:
            self._faces.value = _NO_FACE
            self.page.choose(int(name.partition(":")[0]), True)

    def _choose_more(self, how: str) -> None:
        page, listing = self.page, self.page.bench.listing
        alike = {"Same radius": like_holes, "Same plane": coplanar}.get(how)
        if alike is None:
            page.choose_all([])
        else:
            page.choose_all(sorted({k for n in page.chosen for k in alike(listing, n)}))

    def show_chosen(self) -> None:
        """Say which faces are chosen, and propose a force along their normal."""
        page = self.page
        if not page.chosen:
            self._said.content = '<p class="ccfem">Click a face; with Shift one more.</p>'
            return
        faces = [page.bench.listing.face(number) for number in page.chosen]
        area = sum(face.area for face in faces)
        items = "".join(
            f"<li>{escaped(f'face {k}: {face.shape}')}</li>"
            for k, face in list(zip(page.chosen, faces, strict=True))[:6]
        )
        items += f"<li>and {len(faces) - 6} more</li>" if len(faces) > 6 else ""
        several = "faces" if len(faces) > 1 else "face"
        head = f"{len(faces)} {several}, {area:.4g} mm²"
        self._said.content = f'<div class="ccfem"><b>{head}</b><ul>{items}</ul></div>'
        if len(faces) == 1 and faces[0].kind == "plane":
            x, y, z = (round(_FORCE * float(c), 2) + 0.0 for c in faces[0].direction)
            self.vector.value = (x, y, z)
        if all(face.kind == "cylinder" for face in faces) and self.kind.value != "pressure":
            self.kind.value = "bearing of a pin"
        elif self.kind.value == "bearing of a pin":
            self.kind.value = "pull or push (force)"

    # What acts.

    def _support(self, how: str) -> None:
        page = self.page
        text, patch = patch_of(page.bench.text, page.bench.listing, page.chosen)
        table = {"patch": patch} if how == "Hold" else {"kind": "sliding", "patch": patch}
        page.chosen = []
        page.edit(edited(text, appended(("supports",), table)))

    def _load(self) -> None:
        page, kind = self.page, _KINDS[self.kind.value]
        text, table = page.bench.text, dict[str, Any](kind=kind)
        if kind != "gravity":
            text, table["patch"] = patch_of(text, page.bench.listing, page.chosen)
        if kind == "pressure":
            table["magnitude"] = float(self.pressure.value)
        elif kind != "gravity":
            table["vector"] = [float(x) for x in self.vector.value]
        name = self.case.value.strip() or "load"
        page.chosen = []
        page.edit(edited(text, appended(("loads", name), table)))

    def _show_kind(self) -> None:
        kind = _KINDS[self.kind.value]
        self.pressure.visible = kind == "pressure"
        self.vector.visible = kind in ("force", "bearing")

    # What is there.

    def show(self) -> None:
        """List the supports and loads; what is being typed in stays where it is."""
        if self.page.bench.opened is None:
            self._said.content = ""
            return
        self.show_chosen()
        entries = self.entries()
        titles = [f"{entry.keys} {entry.title}" for entry in entries]
        if titles != self._titles:
            self._titles = titles
            for handle in self._shown:
                handle.remove()
            self._shown, self._fields = [], {}
            with self._list:
                for entry in entries:
                    self._add(entry)
            self._list.visible = bool(entries)
        for entry in entries:
            field = self._fields.get(entry.keys)
            if field is not None:
                value = vector_of(entry.table)
                field.value = entry.table["magnitude"] if value is None else tuple(value.tolist())

    def _add(self, entry: Entry) -> None:
        page, gui = self.page, self.page.server.gui
        folder = gui.add_folder(entry.title)
        self._shown.append(folder)
        with folder:
            magnitude, vector = entry.table.get("magnitude"), vector_of(entry.table)
            if vector is not None and entry.keys[0] == "loads":
                unit = {"force": ", N", "bearing": ", N", "point": ", N"}.get(
                    str(entry.table.get("kind")), ""
                )
                x, y, z = vector.tolist()
                field: Any = gui.add_vector3(f"Vector{unit}", (x, y, z), step=1.0)
                field.on_update(page.on_value(self._change, entry.keys, "vector"))
                self._fields[entry.keys] = field
            elif isinstance(magnitude, int | float):
                field = gui.add_number("Pressure, MPa", float(magnitude), step=0.1)
                field.on_update(page.on_value(self._change, entry.keys, "magnitude"))
                self._fields[entry.keys] = field
            remove = gui.add_button("Remove", color="gray", hint=entry.title)
            remove.on_click(page.on(page.edit, removed(entry.keys)))

    def _change(self, keys: Sequence[str | int], key: str, value: Any) -> None:
        plain = [float(x) for x in value] if isinstance(value, tuple) else float(value)
        self.page.edit(valued((*keys, key), plain), f"{keys} {key}")
