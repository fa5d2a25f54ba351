"""The tab for how a part is printed: machine, material, layers, fibre, plastic, its bed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, get_args, get_type_hints

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.cases.inspection.face_choice import direction_value
from ccfem.cases.part_editing import appended, edited, patch_of, valued
from ccfem.fem.materials import material_names
from ccfem.machine import Machine
from ccfem.machine.named_machines import machine_about, machine_names
from ccfem.paths.plastic import Plastic
from ccfem.printing.bed_layout import axis_and_angle
from ccfem.workbench.guard import escaped
from ccfem.workbench.tab import Field, Tabbed, lines_of

_STANDARD, _WRITTEN = "standard", "as the part file has it"
_LARGE = 1e15
"""Beyond what numbers can be shown digit by digit."""
_PRINTED = ("cannot be planned", "not printable")
"""Kinds of lines of the check that are of the print."""
_SPARSE = ("density", "skins", "fibre_skins")
"""What a solid part has nothing of."""


@dataclass(frozen=True)
class Row:
    """A row of the panel for a value of the part file."""

    keys: tuple[str, ...]  # where the value stands: a key, or a table and its key
    label: str
    default: Any  # what is so where it does not stand there; its type is that of the field
    options: tuple[str, ...] = ()  # what can be chosen
    # step and least value of a number
    step: float = 1.0
    least: float | None = 0.0
    hint: str = ""
    # From the part file's value to that of the field; None where the field cannot show it.
    read: Callable[[Any], Any] | None = None
    # From the field's value to that of the part file.
    write: Callable[[Any], Any] = lambda value: value
    always: bool = True  # whether the row is there where the part file has no such value

    def add(self, gui: Any) -> Any:
        """Add the row to the panel; returns the handle of viser."""
        if self.options:
            return gui.add_dropdown(self.label, self.options, initial_value=self.default)
        if isinstance(self.default, str):
            return gui.add_text(self.label, self.default, hint=self.hint)
        if isinstance(self.default, tuple):
            return gui.add_vector2(self.label, self.default, step=self.step)
        # Of a whole number, too: viser would take 3.5 for 35.
        bounds = {"min": self.least, "step": self.step, "hint": self.hint or None}
        return gui.add_number(self.label, float(self.default), **bounds)

    def shown(self, value: Any) -> Any:
        """Value of the field for that of the part file; None where the field cannot show it."""
        if self.read is not None:
            return self.read(value)
        if self.options:
            other = _WRITTEN if _WRITTEN in self.options else None
            return value if value in self.options else other
        if isinstance(self.default, tuple):
            numbers = isinstance(value, list) and all(isinstance(x, int | float) for x in value)
            return tuple(map(float, value)) if numbers and len(value) == 2 else None
        if not isinstance(value, int | float) or not abs(value) < _LARGE:
            return None
        whole = float(value).is_integer()
        return float(value) if whole or isinstance(self.default, float) else None

    def written(self, value: Any) -> Any:
        """Value of the part file for that of the field."""
        if type(self.default) is not int:
            return self.write(value)
        if not float(value).is_integer():
            raise InputError(f"{self.label} must be a whole number; got {value:g}: round it")
        return int(value)


def _rows() -> dict[str, tuple[Row, ...]]:
    """Rows of the panel by the folder that they stand in; one without a name is always open."""
    edge = "Edge of cells, mm"
    number = "Their number, as 4, or how many along X and Y, as 2x3."
    around = "Counter-clockwise."
    return {
        "": (
            Row(("machine", "profile"), "Machine", _STANDARD,
                (_STANDARD, *machine_names(), _WRITTEN)),
            Row(("material",), "Material", _WRITTEN, (*material_names(), _WRITTEN)),
            Row(("build",), "Build direction", "z", ("z", "-z", "x", "-x", "y", "-y", _WRITTEN)),
            Row(("layers",), "Layers of fibre", 12, least=1),
            Row(("edge_length",), edge, 2.0, step=0.1, least=0.01, always=False),
            Row(("planform", "edge_length"), edge, 2.0, step=0.1, least=0.01, always=False),
        ),
        "Plastic": tuple(map(_plastic_row, fields(Plastic))),
        "On the bed": (
            Row(("bed", "turn"), "Turn about z, °", 0.0, step=15.0, least=None, hint=around,
                read=_turn_of, write=lambda angle: f"z={angle:.12g}"),
            Row(("bed", "centre"), "Centre, mm", _middle_of_bed(Machine()), write=list),
            Row(("bed", "copies"), "Copies", "1", hint=number,
                read=lambda given: str(given) if isinstance(given, int | str) else None,
                write=lambda text: int(text) if text.isdecimal() else text or None),
        ),
    }  # fmt: skip


def _plastic_row(field: Any) -> Row:
    value, label = field.default, field.name.replace("_", " ").capitalize()
    options = get_args(get_type_hints(Plastic)[field.name]) if isinstance(value, str) else ()
    step = 0.05 if isinstance(value, float) else 1.0
    return Row(("plastic", field.name), label, value, options, step)


class PrintTab:
    """What differs from a standard print; a value that the page cannot show stays as it is."""

    def __init__(self, page: Tabbed) -> None:
        self.page, gui = page, page.server.gui
        self.fields: dict[Row, Field] = {}
        rows = _rows()
        self._add(rows.pop(""))
        self._about = gui.add_html("")
        down = gui.add_button("Chosen face on the bed", hint="Or drag the arrow at the bed.")
        down.on_click(page.on(self._lay_on_face))
        with gui.add_folder("Fibre in regions alone", expand_by_default=False):
            self.within = Field(page, gui.add_number("Within, mm", 6.0, min=0.1, step=0.5))
            near = gui.add_button_group("Fibre", ["Near faces", "In a box", "Everywhere"])
            near.on_click(page.on(self._regions, value=True))
        self._fibre_said = gui.add_html("")
        for title, inputs in rows.items():
            with gui.add_folder(title, expand_by_default=False):
                self._add(inputs)
        self._said = gui.add_html("")
        self._lines = gui.add_html("")

    def _add(self, rows: tuple[Row, ...]) -> None:
        for row in rows:
            handle, change = row.add(self.page.server.gui), partial(self._change, row)
            self.fields[row] = Field(self.page, handle, change)

    def field(self, *keys: str) -> Field:
        """Field of a value of the part file."""
        return next(field for row, field in self.fields.items() if row.keys == keys)

    def _change(self, row: Row, value: Any) -> None:
        if value == _WRITTEN:
            raise InputError(f"the part file has a {row.keys[-1]} of the list: choose another")
        other = [key for key in ("heights", "slicing") if key in self.page.bench.content]
        if row.keys == ("layers",) and other:
            raise InputError(
                f"the part file gives its layers by {other[0]}: change it there, or take it out"
            )
        usual = len(row.keys) > 1 and row.always and value == self._default(row)
        self.page.edit(valued(row.keys, None if usual else row.written(value)), row.label)

    def _default(self, row: Row) -> Any:
        """Return what is so without the value; the place is the middle of the machine's bed."""
        if row.keys != ("bed", "centre") or self.page.checked is None:
            return row.default
        return _middle_of_bed(self.page.checked.case.machine)

    def _lay_on_face(self) -> None:
        faces = [self.page.bench.listing.face(number) for number in self.page.chosen]
        if len(faces) != 1 or faces[0].kind != "plane":
            raise InputError("choose one plane face that the part is to stand on")
        self.lay(-faces[0].direction)

    def lay(self, up: FloatArray) -> None:
        """Have the part built along a direction."""
        if not self.field("bed", "turn").handle.visible:
            raise InputError("the part file turns the part about x or y: take bed.turn out there")
        self.page.edit(valued(("build",), direction_value(up)))

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
        hidden = "; ".join(filter(None, (self._show(row) for row in self.fields)))
        solid = self.field("plastic", "infill").value == "solid"
        for key in _SPARSE:
            self.field("plastic", key).handle.visible &= not solid
        profile = self.field("machine", "profile").value
        about = machine_about(profile) if profile in machine_names() else ""
        case = None if self.page.checked is None else self.page.checked.case
        where = None if case is None else case.fibre
        fibre = "Fibre lies everywhere." if where is None else f"Fibre lies {where.about()}."
        kept = f"As the part file has it: {hidden}" if hidden else ""
        for handle, text in ((self._about, about), (self._fibre_said, fibre), (self._said, kept)):
            handle.content = f'<p class="ccfem">{escaped(text)}</p>' if text else ""
        lines = tuple(line for line in self.page.said if line[0] in _PRINTED)
        self._lines.content = f'<div class="ccfem">{lines_of(lines)}</div>'

    def _show(self, row: Row) -> str:
        """Show one value; what it is, in words, where its field cannot."""
        table: Any = self.page.bench.content
        for key in row.keys[:-1]:
            table = table.get(key, {})
        value = table.get(row.keys[-1]) if isinstance(table, Mapping) else None
        shown = self._default(row) if value is None else row.shown(value)
        field = self.fields[row]
        field.handle.visible = shown is not None and (row.always or value is not None)
        if shown is None:
            return f"{'.'.join(row.keys)} = {value}"
        field.put(shown)
        return ""


def _middle_of_bed(machine: Machine) -> tuple[float, ...]:
    return tuple(0.5 * size for size in machine.gcode.bed[:2])


def _turn_of(value: object) -> float | None:
    """Turn about the vertical, degrees; None where there are others."""
    text = value[0] if isinstance(value, list) and len(value) == 1 else value
    try:
        axis, angle = axis_and_angle(str(text))
    except InputError:
        return None
    return angle if axis == "z" else None
