"""The tab for loads and supports: faces that are chosen, what may act on them, and what does."""

import re
from collections.abc import Sequence
from functools import partial
from typing import Any

from ccfem.base.errors import InputError
from ccfem.cases.inspection.acting import Entry, Name, entries
from ccfem.cases.inspection.face_choice import coplanar, like_holes, proposed_load
from ccfem.cases.part_editing import appended, edited, patch_of, removed, valued
from ccfem.workbench.bench import Said
from ccfem.workbench.guard import escaped
from ccfem.workbench.tab import Choice, Field, Tabbed, lines_of

_LISTED = 200
"""Faces that can be chosen from the list; smaller ones by clicking."""
_KINDS = {
    "pull or push (force)": "force",
    "bearing of a pin": "bearing",
    "pressure": "pressure",
    "weight of the whole part": "gravity",
}
_BY_FACE = ("pull or push (force)", "bearing of a pin")
"""Kind that is proposed for other faces, and for round ones."""
_FORCE = 100.0
"""Force, N, that is proposed."""


class LoadsTab:
    """Chosen faces, buttons for what acts on them, and a list of what does."""

    def __init__(self, page: Tabbed) -> None:
        self.page, gui = page, page.server.gui
        self._said = gui.add_html("")
        hint = "Or click it in the picture; with Shift one more."
        self._faces = Choice(page, "Face", "choose a face", self._choose, hint)
        more = gui.add_button_group("Choose", ["Same radius", "Same plane", "None"])
        more.on_click(page.on(self._choose_more, value=True))
        holds = gui.add_button_group("Support", ["Hold", "Roll"])
        holds.on_click(page.on(self._support, value=True))
        with gui.add_folder("Load"):
            self.kind = Field(page, gui.add_dropdown("Kind", list(_KINDS)), self._show_kind)
            self.vector = Field(page, gui.add_vector3("Force, N", (0.0, 0.0, _FORCE), step=1.0))
            pressure = gui.add_number("Pressure, MPa", 0.1, step=0.1, visible=False)
            self.pressure = Field(page, pressure)
            self.case = Field(page, gui.add_text("Load case", "load"))
            gui.add_button("Add load").on_click(page.on(self._load))
        self._list = gui.add_folder("In the part", visible=False)
        with self._list:
            self._cases = gui.add_tab_group()
        self._tabs: dict[str, Any] = {}
        self._rows: dict[Name, tuple[Any, Field | None, Any]] = {}

    def entry(self, name: Name) -> Entry:
        """Support or load of a name, wherever it stands by now."""
        entry = entries(self.page.bench.draft).get(name)
        if entry is None:
            raise InputError(f"{name[0]} is not in the part any more: add it again")
        return entry

    # Faces.

    def list_faces(self) -> None:
        """Offer the faces of the body that is shown."""
        listing = self.page.bench.listing
        pairs = zip(listing.numbers, listing.faces, strict=True)
        largest = sorted(pairs, key=lambda pair: -pair[1].area)[:_LISTED]
        by_number = sorted(largest, key=lambda pair: pair[0])
        self._faces.offer(f"{k}: {face.shape}" for k, face in by_number)

    def _choose(self, name: str) -> None:
        self.choose(int(name.partition(":")[0]), True)

    def _choose_more(self, how: str) -> None:
        alike = {"Same radius": like_holes, "Same plane": coplanar}.get(how)
        chosen, listing = self.page.chosen, self.page.bench.listing
        self.choose_all(sorted({k for n in chosen for k in alike(listing, n)}) if alike else [])

    def choose(self, number: int, more: bool) -> None:
        """Choose a face, or with `more` one more; one that is chosen is left out again."""
        before = self.page.chosen
        if not more:
            self.choose_all([] if before == [number] else [number])
        elif number in before:
            self.choose_all([k for k in before if k != number])
        else:
            self.choose_all([*before, number])

    def choose_all(self, numbers: Sequence[int]) -> None:
        """Choose these faces."""
        self.page.chosen = list(numbers)
        self.page.paint()
        self.show_chosen()
        self.propose()

    def show_chosen(self) -> None:
        """Say which faces are chosen."""
        page = self.page
        if not page.chosen:
            self._said.content = '<p class="ccfem">Click a face; with Shift one more.</p>'
            return
        faces = [page.bench.listing.face(number) for number in page.chosen]
        area = sum(face.area for face in faces)
        named = [f"face {k}: {face.shape}" for k, face in zip(page.chosen, faces, strict=True)]
        named[6:] = [f"and {len(faces) - 6} more"] if len(faces) > 6 else []
        items = "".join(f"<li>{escaped(name)}</li>" for name in named)
        head = f"{len(faces)} face{'s' * (len(faces) > 1)}, {area:.4g} mm²"
        self._said.content = f'<div class="ccfem"><b>{head}</b><ul>{items}</ul></div>'

    def propose(self) -> None:
        """Propose a load for faces that were just chosen, where nothing else was typed."""
        if not self.page.chosen:
            return
        kind, along = proposed_load(self.page.bench.listing, self.page.chosen)
        if along is not None:
            x, y, z = (round(_FORCE * float(c), 2) + 0.0 for c in along)
            self.vector.propose((x, y, z))
        if self.kind.value in _BY_FACE:
            self.kind.propose(_BY_FACE[kind == "bearing"])

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
        self.kind.typed = self.vector.typed = False  # the next choice proposes again

    def _show_kind(self, title: str) -> None:
        kind = _KINDS[title]
        self.pressure.handle.visible = kind == "pressure"
        self.vector.handle.visible = kind in ("force", "bearing")

    # What is there.

    def show(self) -> None:
        """List the supports and loads; what is being typed in stays where it is."""
        if self.page.bench.opened is None:
            self._said.content = ""
            return
        self.show_chosen()
        listed = entries(self.page.bench.draft)
        for name in self._rows.keys() - listed.keys():
            self._drop(name)
        for place, (name, entry) in enumerate(listed.items()):
            if name not in self._rows:
                if entry.case not in self._tabs:
                    self._tabs[entry.case] = self._cases.add_tab(entry.case)
                with self._tabs[entry.case]:
                    self._rows[name] = self._row(name, entry)
            folder, field, said = self._rows[name]
            folder.order = place
            if field is not None:
                field.put(entry.amount)
            said.content = lines_of(self._lines_about(entry))
        for case in self._tabs.keys() - {entry.case for entry in listed.values()}:
            self._tabs.pop(case).remove()
        self._list.visible = bool(listed)

    def _lines_about(self, entry: Entry) -> Said:
        """Lines of the check that name what an entry acts on, or its load case."""
        patch, named = entry.table.get("patch"), re.escape(f"load case '{entry.case}'")
        named = rf"\b{re.escape(patch)}\b" if isinstance(patch, str) else named
        return tuple(line for line in self.page.said if re.search(named, line[1]))

    def _drop(self, name: Name) -> None:
        folder, field, _ = self._rows.pop(name)
        folder.remove()
        if field is not None:
            self.page.fields.remove(field)

    def _row(self, name: Name, entry: Entry) -> tuple[Any, Field | None, Any]:
        page, gui = self.page, self.page.server.gui
        field, folder = None, gui.add_folder(entry.title)
        with folder:
            if entry.amount is not None:
                several = isinstance(entry.amount, tuple)
                add, step = (gui.add_vector3, 1.0) if several else (gui.add_number, 0.1)
                label = ", ".join(filter(None, (entry.key.capitalize(), entry.unit)))
                handle = add(label, entry.amount, step=step)
                field = Field(page, handle, partial(self._change, name))
            line = gui.add_html("")
            remove = gui.add_button("Remove", color="gray", hint=entry.title)
            remove.on_click(page.on(self._remove, name, folder))
        return folder, field, line

    def _remove(self, name: Name, folder: Any) -> None:
        if name in self._rows and self._rows[name][0] is folder:  # else it was clicked twice
            keys = self.entry(name).keys
            self._drop(name)
            self.page.edit(removed(keys))

    def _change(self, name: Name, value: Any) -> None:
        entry, plain = self.entry(name), list(value) if isinstance(value, tuple) else float(value)
        self.page.edit(valued((*entry.keys, entry.key), plain), f"{name}")
