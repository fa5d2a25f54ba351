"""The tab for how a part is printed: machine, material, cells, layers, build direction, fibre."""

from collections.abc import Callable, Mapping
from typing import Any

from ccfem.base.errors import InputError
from ccfem.fem.materials import material_names
from ccfem.machine.named_machines import machine_about, machine_names
from ccfem.workbench.guard import escaped
from ccfem.workbench.part_edits import Change, appended, edited, patch_of, valued
from ccfem.workbench.tab import Field, Tabbed

_COUNT = 12
"""Layers that a part has which says nothing of them."""
_STANDARD, _WRITTEN = "standard", "as the part file has it"
_DIRECTIONS = ("z", "-z", "x", "-x", "y", "-y")


class PrintTab:
    """What differs from a standard print; a value that the page cannot show stays as it is."""

    def __init__(self, page: Tabbed) -> None:
        self.page, gui = page, page.server.gui
        machines, materials = (_STANDARD, *machine_names()), (*material_names(), _WRITTEN)
        self.machine = self._field(gui.add_dropdown("Machine", machines), self._machine)
        self._about = gui.add_html("")
        material = gui.add_dropdown("Material", materials)
        self.material = self._field(material, lambda name: self._choice("material", name))
        build = gui.add_dropdown("Build direction", (*_DIRECTIONS, _WRITTEN))
        self.build = self._field(build, lambda name: self._choice("build", name))
        layers = gui.add_number("Layers of fibre", _COUNT, min=1, step=1)
        self.layers = self._field(layers, self._layers)
        cells = gui.add_number("Edge of cells, mm", 2.0, min=0.01, step=0.1)
        self.cells = self._field(cells, self._cells)
        with gui.add_folder("Fibre only near chosen faces", expand_by_default=False):
            self.within = Field(page, gui.add_number("Within, mm", 6.0, min=0.1, step=0.5))
            near = gui.add_button_group("Fibre", ["Near the chosen faces", "Everywhere"])
            near.on_click(page.on_value(self._near))
        self._said = gui.add_html("")

    def _field(self, handle: Any, change: Callable[[Any], Change]) -> Field:
        """Field whose value makes a change of the part file."""
        edit = self.page.edit
        return Field(self.page, handle, lambda value: edit(change(value), handle.label))

    def _machine(self, name: str) -> Change:
        if name != _STANDARD:
            return valued(("machine", "profile"), name)
        machine = self.page.bench.content.get("machine")
        if isinstance(machine, Mapping) and set(machine) <= {"profile"}:
            return valued(("machine",), None)
        return valued(("machine", "profile"), None)

    def _choice(self, key: str, value: str) -> Change:
        if value == _WRITTEN:
            raise InputError(f"the part file has a {key} of the list: choose another")
        return valued((key,), value)

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
        self.machine.put(profile if known else _STANDARD)
        about = machine_about(profile) if known and profile != _STANDARD else ""
        self._about.content = f'<p class="ccfem small">{escaped(about)}</p>'
        for field, key, default in (
            (self.material, "material", _WRITTEN),
            (self.build, "build", "z"),
        ):
            value = content.get(key, default)
            field.put(value if value in field.handle.options else _WRITTEN)
        count = content.get("layers")
        self.layers.put(count if isinstance(count, int) else _COUNT)
        planform = content.get("planform")
        edge = (planform if isinstance(planform, Mapping) else content).get("edge_length")
        self.cells.handle.visible = isinstance(edge, int | float)
        if isinstance(edge, int | float):
            self.cells.put(float(edge))
        fibre = content.get("fibre")
        regions = fibre.get("regions", []) if isinstance(fibre, Mapping) else []
        near = [r.get("patch") for r in regions if isinstance(r, Mapping) and "patch" in r]
        said = "Fibre lies everywhere." if not fibre else "Fibre lies where the part file says."
        if near:
            said = f"Fibre lies near {', '.join(map(str, near))}."
        self._said.content = f'<p class="ccfem">{escaped(said)}</p>'
