"""From a plan to all actions of the machine: one sequence for every file that is written."""

from dataclasses import replace

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, SUPPORT
from ccfem.printing.beside import Beside, beside
from ccfem.printing.laid_layer import COORDINATE_DIGITS
from ccfem.printing.moves import FEED, LAY, TRAVEL, Moves
from ccfem.printing.preheating import preheated
from ccfem.printing.print_plan import PrintPlan
from ccfem.printing.recorder import Recorder
from ccfem.printing.tools import begin_layer, change_tool, lay_matrix, lay_strand

_UP = np.array([0.0, 0.0, 1.0])


def part_moves(plan: PrintPlan, machine: Machine) -> Moves:
    """Turn the plan of a part into moves.

    Layer by layer: tool changes with their lifts and temperatures, first filament on a block beside
    the part and on a bar, the skirt, lines of matrix, strands with their cuts.

    Parameters
    ----------
    plan : PrintPlan
    machine : Machine
        The machine that the plan was made for.

    Raises
    ------
    InputError
        Where a nozzle would leave the bed.
    """
    flat = bool((plan.paths.normals[:, 2] > 1.0 - 1e-9).all())
    recorder = Recorder(machine)
    paths, site = plan.paths, _Site(beside(plan, machine), None if flat else plan.thickness.max())
    below = 0.0
    for number in np.unique(paths.layer).tolist():
        top, thickness = float(plan.top[number]), float(plan.thickness[number])
        begin_layer(recorder, number, top, below, machine)
        for k in np.flatnonzero(paths.layer == number).tolist():
            start, end = int(paths.offsets[k]), int(paths.offsets[k + 1])
            line, normals = paths.points[start:end], paths.normals[start:end]
            tool = int(paths.kind[k] == FIBRE)
            changed = change_tool(recorder, tool, top, machine)
            if tool == 0 and (changed or site.height < top):
                site.prime(recorder, top, below == 0.0, changed, machine)
            if tool:
                site.first_strand(recorder, top, thickness, machine)
            if tool:
                recorder.strand += 1
                lay_strand(recorder, line, normals, thickness, machine)
            else:
                what = "short" if plan.short[k] else "contour" if paths.closed[k] else "infill"
                what = "pad" if paths.kind[k] == SUPPORT else what
                speed = _speed(below, machine)
                heights = plan.laid[start : end - 1]
                lay_matrix(recorder, line, normals, heights, what, machine, speed)
        below = top
    # Away from the part, before the end of the file moves the carriage home.
    recorder.rise(recorder.top + machine.process.tool_lift)
    moves = preheated(_numbered(recorder.moves()), machine)
    _check_bed(moves, machine)
    return moves


def _speed(below: float, machine: Machine) -> float:
    """Speed of matrix on a layer that lies on this height."""
    slower = machine.process.first_layer_speed if below == 0.0 else 1.0
    return machine.matrix_speed * slower


def _numbered(moves: Moves) -> Moves:
    """Give numbers to strands only, not to the matrix between them."""
    return replace(moves, strand=np.where(moves.tool == 1, moves.strand, -1))


class _Site:
    """Present height of block and bar; beside curved layers the height of their own layers."""

    def __init__(self, around: Beside, highest: float | None) -> None:
        self.around, self.height, self.bar = around, 0.0, 0.0
        self.strand, self.highest = around.strand, highest

    def prime(
        self, recorder: Recorder, top: float, first: bool, changed: bool, machine: Machine
    ) -> None:
        """Lay block and bar up to a top; the skirt with their first layer.

        Tops of curved layers do not grow evenly. Beside them this takes several layers of the
        block, or one more after a tool change even if the top is reached.
        """
        levels = np.array([top])
        if self.highest is not None:
            top = max(top, self.height + changed * self.highest)
            count = int(np.ceil((top - self.height) / self.highest - 1e-6))
            levels = np.linspace(self.height, top, count + 1)[1:]
        for level in levels.round(COORDINATE_DIGITS).tolist():
            self._layer(recorder, level, first and self.height == 0.0, changed, machine)

    def _layer(
        self, recorder: Recorder, top: float, first: bool, changed: bool, machine: Machine
    ) -> None:
        """Lay one layer of block and bar."""
        height, process = top - self.height, machine.process
        self.height = top
        if height <= 0.0:
            return
        speed = _speed(0.0 if first else 1.0, machine)

        def lay(line: FloatArray, what: str, high: float) -> None:
            points = np.column_stack([line, np.full(len(line), top)])
            normals = np.tile(_UP, (len(line), 1))
            heights = np.full(len(line) - 1, high)
            lay_matrix(recorder, points, normals, heights, what, machine, speed)

        laid = 0.0
        for k, line in enumerate(self.around.block):
            if k >= 2 and (laid >= process.prime_volume or not changed):
                break
            lay(line, "block", height)
            length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
            laid += length * machine.matrix_width * height
        if first:
            for line in self.around.skirt:
                lay(line, "skirt", height)
        if self.strand is not None:
            for line in self.around.bar:
                lay(line, "block", top - self.bar)
            self.bar = top

    def first_strand(
        self, recorder: Recorder, top: float, thickness: float, machine: Machine
    ) -> None:
        """Lay the first strand on the bar, before any of the part."""
        if self.strand is None:
            return
        level = top if self.highest is None else self.bar + machine.strand_height
        points = np.column_stack([self.strand, np.full(2, level)])
        self.strand = None
        lay_strand(recorder, points, np.tile(_UP, (2, 1)), thickness, machine)


def _check_bed(moves: Moves, machine: Machine) -> None:
    """Check that both nozzles stay over the bed, and below its height."""
    profile = machine.gcode
    moving = np.isin(moves.event, [TRAVEL, LAY, FEED])
    place = moves.place - np.where(moves.tool[:, None] == 1, profile.offset, 0.0)
    # Z of an offset is set by the firmware or the file; the carriage itself stays in X and Y.
    place = np.column_stack([place[moving, :2], moves.place[moving, 2]])
    bed = np.array(profile.bed)
    if (place.min(axis=0) < 0.0).any() or (place.max(axis=0) > bed).any():
        size = np.ptp(place, axis=0)
        raise InputError(
            f"with skirt, block, lifts and the offset of the nozzles the print needs {size[0]:.4g} "
            f"x {size[1]:.4g} x {place[:, 2].max():.4g} mm, but the printer has {bed[0]:g} x "
            f"{bed[1]:g} x {bed[2]:g} mm: turn the part, or set process.prime = 'none' and "
            "process.skirt_loops = 0"
        )
