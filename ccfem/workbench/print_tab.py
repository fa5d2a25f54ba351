"""The tab for how a part is printed: machine, material, layers, fibre, plastic, its bed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, get_args, get_type_hints

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.fem.materials import material_names
from ccfem.machine import Machine
from ccfem.machine.named_machines import machine_about, machine_names
from ccfem.paths.plastic import Plastic
from ccfem.printing.bed_layout import axis_and_angle
from ccfem.workbench.guard import escaped
from ccfem.workbench.part_edits import appended, edited, patch_of, valued, written
from ccfem.workbench.tab import Field, Tabbed

_COUNT = 12
"""Layers that a part has which says nothing of them."""
_STANDARD, _WRITTEN = "standard", "as the part file has it"
_DIRECTIONS = ("z", "-z", "x", "-x", "y", "-y")
_SPARSE = ("density", "skins", "fibre_skins")
"""What a solid part has nothing of."""


@dataclass(frozen=True)
class Setting:
    """A value of the part file, and the field that shows it.

    Attributes
    ----------
    keys : tuple of str
        Where it stands: a key, or a table and its key.
    field : Field
    default
        What is so where it does not stand there.
    read : callable
        From the part file's value to that of the field; None where the field cannot show it.
    """

    keys: tuple[str, ...]
    field: Field
    default: Any
    read: Callable[[Any], Any]


class PrintTab:
    """What differs from a standard print; a value that the page cannot show stays as it is."""

    def __init__(self, page: Tabbed) -> None:
        self.page, gui = page, page.server.gui
        self.settings: dict[str, Setting] = {}
        machines, materials = (_STANDARD, *machine_names(), _WRITTEN), material_names()
        self._choice("Machine", machines, ("machine", "profile"))
        self._about = gui.add_html("")
        self._choice("Material", (*materials, _WRITTEN), ("material",), _WRITTEN)
        self._choice("Build direction", (*_DIRECTIONS, _WRITTEN), ("build",))
        down = gui.add_button("Chosen face on the bed", hint="Or drag the arrow at the bed.")
        down.on_click(page.on(self._lay_on_face))
        layers = gui.add_number("Layers of fibre", _COUNT, min=1, step=1)
        self._setting(layers, ("layers",), write=self._layers)
        cells = gui.add_number("Edge of cells, mm", 2.0, min=0.01, step=0.1)
        self.cells = Field(page, cells, self._cells)
        with gui.add_folder("Fibre in regions alone", expand_by_default=False):
            self.within = Field(page, gui.add_number("Within, mm", 6.0, min=0.1, step=0.5))
            near = gui.add_button_group("Fibre", ["Near faces", "In a box", "Everywhere"])
            near.on_click(page.on_value(self._regions))
        self._fibre_said = gui.add_html("")
        with gui.add_folder("Plastic", expand_by_default=False):
            self._add_plastic()
        with gui.add_folder("On the bed", expand_by_default=False):
            turn = gui.add_number("Turn about z, °", 0.0, step=15.0, hint="Counter-clockwise.")
            self._setting(turn, ("bed", "turn"), _turn_of, lambda angle: f"z={angle:.12g}")
            middle = gui.add_vector2("Centre, mm", Machine().gcode.bed[:2], step=1.0)
            self._setting(middle, ("bed", "centre"), _pair_of, list)
            hint = "Their number, as 4, or how many along X and Y, as 2x3."
            copies = gui.add_text("Copies", "1", hint=hint)
            self._setting(
                copies,
                ("bed", "copies"),
                lambda given: str(given) if isinstance(given, int | str) else None,
                lambda text: int(text) if text.isdecimal() else text,
            )
        self._said = gui.add_html("")

    def _add_plastic(self) -> None:
        gui, hints = self.page.server.gui, get_type_hints(Plastic)
        for field in fields(Plastic):
            key, value = field.name, field.default
            label = key.replace("_", " ").capitalize()
            if isinstance(value, str):
                self._choice(label, get_args(hints[key]), ("plastic", key), value)
            else:
                step = 0.05 if isinstance(value, float) else 1
                self._setting(gui.add_number(label, value, min=0, step=step), ("plastic", key))

    # From field to part file, and back.

    def _choice(
        self,
        label: str,
        options: tuple[str, ...],
        keys: tuple[str, ...],
        default: str = "",
    ) -> None:
        handle = self.page.server.gui.add_dropdown(
            label, options, initial_value=default or options[0]
        )
        other = _WRITTEN if _WRITTEN in options else None
        self._setting(handle, keys, lambda value: value if value in options else other)

    def _setting(
        self,
        handle: Any,
        keys: tuple[str, ...],
        read: Callable[[Any], Any] | None = None,
        write: Callable[[Any], Any] = lambda value: value,
    ) -> None:
        default, name = handle.value, keys[-1]

        def change(value: Any) -> None:
            if value == _WRITTEN:
                raise InputError(f"the part file has a {name} of the list: choose another")
            usual = len(keys) > 1 and value == self.settings[name].default
            self.page.edit(valued(keys, None if usual else write(value)), handle.label)

        field = Field(self.page, handle, change)
        self.settings[name] = Setting(keys, field, default, read or _like(default))

    def _lay_on_face(self) -> None:
        faces = [self.page.bench.listing.face(number) for number in self.page.chosen]
        if len(faces) != 1 or faces[0].kind != "plane":
            raise InputError("choose one plane face that the part is to stand on")
        self.lay(-faces[0].direction)

    def lay(self, up: FloatArray) -> None:
        """Have the part built along a direction."""
        if not self.settings["turn"].field.handle.visible:
            raise InputError("the part file turns the part about x or y: take bed.turn out there")
        self.page.edit(valued(("build",), written(up)))

    def _layers(self, count: int) -> int:
        other = [key for key in ("heights", "slicing") if key in self.page.bench.content]
        if other:
            raise InputError(
                f"the part file gives its layers by {other[0]}: change it there, or take it out"
            )
        return count

    def _cells(self, length: float) -> None:
        content = self.page.bench.content
        outer = ("planform",) if "planform" in content else ()
        if not outer and "surface" not in content:
            raise InputError("the part has the cells of its mesh file: only a body can be meshed")
        self.page.edit(valued((*outer, "edge_length"), length), "cells")

    def _regions(self, where: str) -> None:
        page, text = self.page, self.page.bench.text
        if where == "Everywhere":
            page.edit(valued(("fibre",), None))
            return
        if where == "Near faces":
            text, patch = patch_of(text, page.bench.listing, page.chosen)
            region = {"rule": "patch", "patch": patch, "within": self.within.value}
        else:  # the lower half, to be dragged
            low, high = page.bench.listing.points.min(axis=0), page.bench.listing.points.max(axis=0)
            high[2] = 0.5 * (low[2] + high[2])
            lower, upper = low.round(3).tolist(), high.round(3).tolist()
            region = {"rule": "box", "lower": lower, "upper": upper}
        page.edit(edited(text, appended(("fibre", "regions"), region)))

    def show(self) -> None:
        """Show what the part file says; what no field can show is named."""
        page, content = self.page, self.page.bench.content
        machine = page.checked.case.machine if page.checked is not None else Machine()
        middle = tuple(0.5 * size for size in machine.gcode.bed[:2])
        self.settings["centre"] = replace(self.settings["centre"], default=middle)
        hidden = [text for text in map(self._show, self.settings.values()) if text]
        for key in _SPARSE:
            field = self.settings[key].field.handle
            field.visible = field.visible and self.settings["infill"].field.value != "solid"
        profile = self.settings["profile"].field.value
        about = machine_about(profile) if profile in machine_names() else ""
        self._about.content = f'<p class="ccfem small">{escaped(about)}</p>'
        planform = content.get("planform")
        edge = (planform if isinstance(planform, Mapping) else content).get("edge_length")
        self.cells.handle.visible = isinstance(edge, int | float)
        if isinstance(edge, int | float):
            self.cells.put(float(edge))
        said = _fibre_lies(content.get("fibre"))
        self._fibre_said.content = f'<p class="ccfem">{escaped(said)}</p>'
        kept = "As the part file has it: " + "; ".join(hidden) if hidden else ""
        self._said.content = f'<p class="ccfem">{escaped(kept)}</p>'

    def _show(self, setting: Setting) -> str:
        """Show one setting; what it is, in words, where its field cannot."""
        table: Any = self.page.bench.content
        for key in setting.keys[:-1]:
            table = table.get(key, {})
        value = table.get(setting.keys[-1]) if isinstance(table, Mapping) else None
        shown = setting.default if value is None else setting.read(value)
        setting.field.handle.visible = shown is not None
        if shown is None:
            return f"{'.'.join(setting.keys)} = {value}"
        setting.field.put(shown)
        return ""


def _fibre_lies(fibre: object) -> str:
    if not fibre:
        return "Fibre lies everywhere."
    regions = fibre.get("regions") if isinstance(fibre, Mapping) and len(fibre) == 1 else None
    words = []
    for region in regions if isinstance(regions, list) else ():
        near = isinstance(region, Mapping) and region.keys() == {"rule", "patch", "within"}
        box = isinstance(region, Mapping) and region.keys() == {"rule", "lower", "upper"}
        words.append(f"near {region['patch']}" if near else "in a box" if box else "")
    if not all(words) or not words:
        return "Fibre lies where the part file says."
    return f"Fibre lies {' and '.join(words)}."


def _like(default: float) -> Callable[[object], float | None]:
    """Read a number of a kind, whole or not; None for anything else."""
    kind = type(default)
    return lambda x: kind(x) if isinstance(x, int | float) and kind(x) == x else None


def _pair_of(value: object) -> tuple[float, ...] | None:
    if isinstance(value, list) and [isinstance(x, int | float) for x in value] == [True, True]:
        return float(value[0]), float(value[1])
    return None


def _turn_of(value: object) -> float | None:
    """Turn about the vertical, degrees; None where there are others."""
    text = value[0] if isinstance(value, list) and len(value) == 1 else value
    try:
        axis, angle = axis_and_angle(str(text))
    except InputError:
        return None
    return angle if axis == "z" else None
