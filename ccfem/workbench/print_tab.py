"""The tab for how a part is printed: machine, material, cells, layers, build direction, fibre."""

from collections.abc import Mapping
from typing import Any

from ccfem.base.errors import InputError
from ccfem.fem.materials import material_names
from ccfem.machine.named_machines import machine_about, machine_names
from ccfem.workbench.guard import escaped
from ccfem.workbench.part_edits import Change, appended, edited, patch_of, valued
from ccfem.workbench.tab import Tabbed

_COUNT = 12
"""Layers that a part has which says nothing of them."""
_STANDARD, _WRITTEN = "standard", "as the part file has it"
_DIRECTIONS = ("z", "-z", "x", "-x", "y", "-y")


class PrintTab:
    """What differs from a standard print; a value that the page cannot show stays as it is."""

    def __init__(self, page: Tabbed) -> None:
        self.page, gui = page, page.server.gui
        self.machine = gui.add_dropdown("Machine", (_STANDARD, *machine_names()))
        self._about = gui.add_html("")
        self.material = gui.add_dropdown("Material", (*material_names(), _WRITTEN))
        self.build = gui.add_dropdown("Build direction", (*_DIRECTIONS, _WRITTEN))
        self.layers = gui.add_number("Layers of fibre", _COUNT, min=1, step=1)
        self.cells = gui.add_number("Edge of cells, mm", 2.0, min=0.01, step=0.1)
        for field, change in (
            (self.machine, self._machine),
            (self.material, self._choice("material")),
            (self.build, self._choice("build")),
            (self.layers, self._layers),
            (self.cells, self._cells),
        ):
            field.on_update(page.on_value(self._edit, change))
        with gui.add_folder("Fibre only near chosen faces", expand_by_default=False):
            self.within = gui.add_number("Within, mm", 6.0, min=0.1, step=0.5)
            near = gui.add_button_group("Fibre", ["Near the chosen faces", "Everywhere"])
            near.on_click(page.on_value(self._near))
        self._said = gui.add_html("")

    def _edit(self, change: Any, value: Any) -> None:
        made = change(value)
        if made is not None:
            self.page.edit(made, f"print {change}")

    def _machine(self, name: str) -> Change:
        if name != _STANDARD:
            return valued(("machine", "profile"), name)
        machine = self.page.bench.content.get("machine")
        if isinstance(machine, Mapping) and set(machine) <= {"profile"}:
            return valued(("machine",), None)
        return valued(("machine", "profile"), None)

    def _choice(self, key: str) -> Any:
        return lambda value: None if value == _WRITTEN else valued((key,), value)

    def _layers(self, count: int) -> Change:
        other = [key for key in ("heights", "slicing") if key in self.page.bench.content]
        if other:
            raise InputError(
                f"the part file gives its layers by {other[0]}: change it there, or take it out"
            )
        return valued(("layers",), int(count))

    def _cells(self, length: float) -> Change:
        content = self.page.bench.content
        if "planform" in content:
            return valued(("planform", "edge_length"), float(length))
        if "surface" not in content:
            raise InputError("the part has the cells of its mesh file: only a body can be meshed")
        return valued(("edge_length",), float(length))

    def _near(self, where: str) -> None:
        page = self.page
        if where == "Everywhere":
            page.edit(valued(("fibre",), None))
            return
        text, patch = patch_of(page.bench.text, page.bench.listing, page.chosen)
        region = {"rule": "patch", "patch": patch, "within": float(self.within.value)}
        page.edit(edited(text, appended(("fibre", "regions"), region)))

    def show(self) -> None:
        """Show what the part file says."""
        content = self.page.bench.content
        machine = content.get("machine")
        profile = machine.get("profile", _STANDARD) if isinstance(machine, Mapping) else _STANDARD
        known = profile in (_STANDARD, *machine_names())
        self.machine.value = profile if known else _STANDARD
        about = machine_about(profile) if known and profile != _STANDARD else ""
        self._about.content = f'<p class="ccfem small">{escaped(about)}</p>'
        for field, key, default in (
            (self.material, "material", _WRITTEN),
            (self.build, "build", "z"),
        ):
            value = content.get(key, default)
            field.value = value if value in field.options else _WRITTEN
        if isinstance(content.get("layers"), int):
            self.layers.value = content["layers"]
        planform = content.get("planform")
        edge = (planform if isinstance(planform, Mapping) else content).get("edge_length")
        self.cells.visible = isinstance(edge, int | float)
        if isinstance(edge, int | float):
            self.cells.value = float(edge)
        fibre = content.get("fibre")
        regions = fibre.get("regions", []) if isinstance(fibre, Mapping) else []
        near = [r.get("patch") for r in regions if isinstance(r, Mapping) and "patch" in r]
        said = "Fibre lies everywhere." if not fibre else "Fibre lies where the part file says."
        if near:
            said = f"Fibre lies near {', '.join(map(str, near))}."
        self._said.content = f'<p class="ccfem">{escaped(said)}</p>'
