"""A square to print and to measure: where the fibre lies on it corrects the values of a machine.

Four strands run along the edges of a small plate of matrix, and stay open to the eye. What they are
off, a caliper and scales tell: the offset of the nozzles, the distance from the cutter to the
nozzle, how much fibre a start needs, and how much matrix is fed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.printing.print_plan import PrintPlan, plan_print
from ccfem.slicing.slicers.planar import Planar

ACROSS, ALONG = 5.0, 15.0
"""Distance of the strands' middles from the edge beside them, and of their ends from the others."""

_BASE = 2.0
"""Height of the matrix below the strands, mm."""
_LONGER = 8.0
"""What the strands are longer than the shortest, mm."""
_PLAUSIBLE = 10.0
"""Distance, mm, by which a strand may lie off its place; more is a mistake in measuring."""
_FLOW = (0.5, 2.0)
"""Range of the matrix that was fed over what was to be fed; beyond is a mistake in weighing."""


@dataclass(frozen=True)
class CalibrationSquare:
    """The print of a square, and where its strands ought to lie.

    Attributes
    ----------
    plan : PrintPlan
    machine : Machine
        That it was planned for: `Process.cover` is 0, so that the strands stay open.
    side : float, mm
    rightwards : bool
        Whether the strand at the front is laid from the left to the right.
    mass : float, g
        Of the square alone.
    """

    plan: PrintPlan
    machine: Machine
    side: float
    rightwards: bool
    mass: float

    @property
    def form(self) -> str:
        """What to measure, a line each."""
        start, end = ("left", "right") if self.rightwards else ("right", "left")
        across, along = f"{ACROSS:g} mm", f"{ALONG:g} mm"
        return "\n".join(
            [
                f"Square of {self.side:g} mm. Seen from the front of the printer, from the middle "
                "of each strand to its edge:",
                f"  front  strand at the front, to the front edge: {across}",
                f"  back   strand at the back, to the back edge: {across}",
                f"  left   strand on the left, to the left edge: {across}",
                f"  right  strand on the right, to the right edge: {across}",
                f"of the strand at the front, laid from {start} to {end}:",
                f"  start  from its {start} end to the {start} edge: {along}",
                f"  end    from its {end} end to the {end} edge: {along}",
                f"  mass   of the square alone: {self.mass:.2f} g",
            ]
        )


def calibration_square(machine: Machine) -> CalibrationSquare:
    """Plan the square for a machine.

    Raises
    ------
    InputError
        Where it does not fit on the bed, or the machine cannot print it.
    """
    machine = replace(machine, process=replace(machine.process, cover=0.0))
    length = machine.shortest_strand + _LONGER
    side, high = length + 2.0 * ALONG, _BASE + machine.strand_height
    mesh = box_mesh((side, side, high), (1, 1, 1))
    layers = Planar(heights=(_BASE + 0.5 * machine.strand_height,)).cut(mesh)
    near, far, first, last = ACROSS, side - ACROSS, ALONG, side - ALONG
    lines = [
        [[first, near], [last, near]],
        [[first, far], [last, far]],
        [[near, first], [near, last]],
        [[far, first], [far, last]],
    ]
    strands = Toolpaths.from_plane([np.array(line) for line in lines], layers[0])
    plan = plan_print(strands, layers, mesh, machine)
    return CalibrationSquare(
        plan, machine, side, _rightwards(plan), _mass(plan, machine, 4.0 * length)
    )


def _rightwards(plan: PrintPlan) -> bool:
    """Whether the strand with the least Y is laid along +X."""
    fibre = plan.paths.of_kind(FIBRE)
    front = min(fibre, key=lambda path: float(path[:, 1].mean()))
    return bool(front[-1, 0] > front[0, 0])


def _mass(plan: PrintPlan, machine: Machine, length: float) -> float:
    """Mass of matrix and fibre of the plan, g."""
    matrix = plan.volume(machine) - machine.strand_area * length
    return 1e-3 * machine.matrix_density * matrix + machine.fibre_mass_per_length * length


@dataclass(frozen=True)
class Measured:
    """What was measured on a printed square, as `CalibrationSquare.form` asks for it.

    Attributes
    ----------
    front, back, left, right : float, mm
        From the middle of each strand to the edge beside it.
    start, end : float, mm
        From the ends of the strand at the front to the edges before and behind it.
    mass : float, g, optional
        Of the square alone; the feed of the matrix stays as it is without it.
    """

    front: float
    back: float
    left: float
    right: float
    start: float
    end: float
    mass: float | None = None

    @classmethod
    def of(cls, values: Mapping[str, float]) -> "Measured":
        """Take named values."""
        names = [field.name for field in fields(cls)]
        for name in values:
            if name not in names:
                raise InputError(f"no measure named {name!r}; there are: {', '.join(names)}")
        missing = [name for name in names if name not in values and name != "mass"]
        if missing:
            raise InputError(
                f"the measures of the square are {', '.join(names)}; {', '.join(missing)} is "
                "missing: measure it"
            )
        for name, value in values.items():
            if name == "mass":
                check_number(name, value, above=0.0, unit="g")
                continue
            check_number(name, value, unit="mm")
            wanted = ALONG if name in ("start", "end") else ACROSS
            if abs(value - wanted) > _PLAUSIBLE:
                raise InputError(
                    f"{name} must be about {wanted:g} mm, by up to {_PLAUSIBLE:g} off; got "
                    f"{value:g}: measure it again, in mm"
                )
        return cls(**values)


def corrections(machine: Machine, measured: Measured) -> dict[str, float]:
    """How far the strands and the feed of a machine are off.

    Returns
    -------
    dict
        ``x`` and ``y``, mm, by which fibre lies too far to the right and to the back; ``start`` and
        ``end``, mm, by which a strand begins and ends too late; ``flow``, matrix that is fed over
        what was to be fed.
    """
    square = calibration_square(machine)
    x = 0.5 * (measured.left - measured.right)
    y = 0.5 * (measured.front - measured.back)
    along = x if square.rightwards else -x
    values = {
        "x": x,
        "y": y,
        "start": measured.start - ALONG - along,
        "end": ALONG - along - measured.end,
        "flow": 1.0,
    }
    if measured.mass is not None:
        fibre = 4.0 * machine.fibre_mass_per_length * (machine.shortest_strand + _LONGER)
        values["flow"] = (measured.mass - fibre) / (square.mass - fibre)
        if not _FLOW[0] < values["flow"] < _FLOW[1]:
            raise InputError(
                f"mass must be about {square.mass:.1f} g; got {measured.mass:g}: weigh the square "
                "alone, in g"
            )
    return values


def corrected(machine: Machine, measured: Measured) -> Machine:
    """Machine with the values that the square tells.

    Fibre that lies aside moves the offset of its nozzle; a late start feeds more before a strand; a
    late end means that the cutter is farther from the nozzle; and matrix in excess that its
    filament is thicker.
    """
    off = corrections(machine, measured)
    a, b, c = machine.gcode.offset
    place = (round(a + off["x"], 3), round(b + off["y"], 3), c)
    tail = round(machine.tail + off["end"], 3)
    extra = round(max(machine.process.restart_extra + off["start"], 0.0), 3)
    return replace(
        machine,
        gcode=replace(machine.gcode, offset=place),
        process=replace(machine.process, restart_extra=extra),
        cutter_distance=tail,
        minimum_length=max(machine.minimum_length, tail),
        matrix_diameter=round(machine.matrix_diameter * float(np.sqrt(off["flow"])), 4),
    )
