"""From a plan to all actions of the machine: one sequence for every file that is written."""

import hashlib
from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.errors import InputError
from ccfem.base.parallel import repeating
from ccfem.geometry.polylines import along_line, extent, line_length, points_along, turning_angles
from ccfem.machine.machine import Machine
from ccfem.machine.speeds import step_curvatures, table_speeds
from ccfem.paths.toolpaths import FIBRE, SUPPORT
from ccfem.printing.beside import Beside, beside
from ccfem.printing.duration import durations
from ccfem.printing.laid_layer import COORDINATE_DIGITS
from ccfem.printing.moves import (
    CUT,
    FAN,
    FEED,
    HEAT,
    HEAT_BED,
    LAY,
    PATH_END,
    PATH_START,
    PAUSE,
    PREHEAT,
    STANDBY,
    TOOL,
    TRAVEL,
    WAIT,
    WORK,
    Moves,
    is_any,
    with_arcs,
)
from ccfem.printing.print_plan import PrintPlan
from ccfem.printing.recorder import Recorder, Steps, steps_along

_UP = np.array([0.0, 0.0, 1.0])


def part_moves(plan: PrintPlan, machine: Machine) -> Moves:
    """Turn the plan of a print into moves of the machine that it was made for.

    Layer by layer: tool changes with their lifts and temperatures, first filament on a block beside
    the part and on a bar, the skirt, lines of matrix, strands with their cuts, pauses. Of a plan
    whose file begins above the lowest layer, the rest of what is laid, at its place.

    Raises
    ------
    InputError
        Where a nozzle would leave the bed.
    """
    recorder, paths = Recorder(machine), plan.paths
    sites, lowest = _sites(plan, machine), plan.lowest
    numbers = np.unique(paths.layer).tolist()
    below = dict(zip(numbers, [0.0, *(float(plan.top[k]) for k in numbers[:-1])], strict=True))
    for number in [k for k in numbers if k < plan.first]:
        for stack, site in enumerate(sites):
            mine = paths.kind[(paths.layer == number) & (plan.stack == stack)]
            if len(mine):
                site.printed(float(plan.top[number]), mine == FIBRE)
    numbers = [k for k in numbers if k >= plan.first]

    def at_height(lines: "Sequence[Steps | StrandSteps]", k: int) -> "list[Steps | StrandSteps]":
        first = paths.offsets[int((paths.layer == numbers[k]).argmax())]
        return [line.at(float(paths.points[first, 2])) for line in lines]

    digests = [_what(plan, number, lowest) for number in numbers]
    prepared = repeating(lambda k: _prepared(plan, numbers[k], lowest, machine), digests, at_height)
    for number, lines in zip(numbers, prepared, strict=True):
        top, thickness = float(plan.top[number]), float(plan.thickness[number])
        begin_layer(recorder, number, top, below[number], machine)
        if number in plan.pauses:
            _pause(recorder, number, machine)
        mine = paths.layer == number
        on_bed, stacks = lowest[mine].tolist(), plan.stack[mine].tolist()
        for line, first, stack in zip(lines, on_bed, stacks, strict=True):
            site, tool = sites[stack], int(isinstance(line, StrandSteps))
            changed = change_tool(recorder, tool, top, machine)
            if isinstance(line, StrandSteps):
                site.first_strand(recorder, top, thickness, machine)
                recorder.strand += 1
                lay_strand(recorder, line, machine)
                continue
            if changed or site.height < top:
                site.prime(recorder, top, first, changed, machine)
            lay_line(recorder, line, machine)
    # Away from the part, before the end of the file moves the carriage home.
    recorder.rise(recorder.top + machine.process.tool_lift)
    recorder.insert(PREHEAT, *_preheats(recorder.seen(), machine))
    moves = recorder.moves()
    if machine.gcode.arcs and not machine.kinematics.letters:
        moves = with_arcs(moves, machine)
    _check_bed(moves, machine)
    return moves


def _sites(plan: PrintPlan, machine: Machine) -> "list[_Site]":
    """Blocks of all stacks; the skirt goes with the first, and the bar with the first fibre."""
    around, paths = beside(plan, machine), plan.paths
    fibre = np.flatnonzero(paths.kind == FIBRE)
    with_bar = int(plan.stack[fibre[:1]].max(initial=-1))
    tilted = np.flatnonzero(paths.normals[:, 2] <= 1.0 - 1e-9)
    curved = plan.stack[np.searchsorted(paths.offsets, tilted, side="right") - 1]
    sites = []
    for stack, block in enumerate(around.blocks):
        own = Beside(() if stack else around.skirt, (block,))
        if stack == with_bar:
            own = replace(own, bar=around.bar, strand=around.strand)
        highest = plan.thickness[paths.layer[plan.stack == stack]].max(initial=0.0)
        sites.append(_Site(own, float(highest) if stack in curved else None))
    return sites


def _prepared(
    plan: PrintPlan, number: int, lowest: BoolArray, machine: Machine
) -> "list[Steps | StrandSteps]":
    """Find the moves along the paths of a layer, in their order; `lowest` are slower ones."""
    paths, lines = plan.paths, list[Steps | StrandSteps]()
    thickness = float(plan.thickness[number])
    for k in np.flatnonzero(paths.layer == number).tolist():
        start, end = int(paths.offsets[k]), int(paths.offsets[k + 1])
        line, normals = paths.points[start:end], paths.normals[start:end]
        if paths.kind[k] == FIBRE:
            lines.append(strand_steps(line, normals, thickness, machine))
            continue
        what = "short" if plan.short[k] else "contour" if paths.closed[k] else "infill"
        what = "pad" if paths.kind[k] == SUPPORT else "sparse" if plan.sparse[k] else what
        heights, room = plan.laid[start : end - 1], float(plan.room[k])
        speed = _speed(bool(lowest[k]), machine)
        lines.append(matrix_steps(line, normals, heights, what, machine, speed, room))
    return lines


def _what(plan: PrintPlan, number: int, lowest: BoolArray) -> Hashable:
    """Digest of all on a layer that its moves follow from, but for its height if it is flat."""
    paths, mine = plan.paths, np.flatnonzero(plan.paths.layer == number)
    rows = slice(mine[0], mine[-1] + 1)
    ends = paths.offsets[mine[0] : mine[-1] + 2]
    points = slice(ends[0], ends[-1])
    places, normals = paths.points[points], paths.normals[points]
    if len(mine) != rows.stop - rows.start or np.ptp(places[:, 2]) or (normals[:, 2] != 1.0).any():
        return number
    digest = hashlib.sha256(plan.thickness[number].tobytes())
    about = (paths.kind, paths.closed, plan.short, plan.sparse, plan.room, lowest)
    columns = (
        places[:, :2],
        ends - ends[0],
        plan.laid[points],
        *(column[rows] for column in about),
    )
    for column in columns:
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.digest()


def _pause(recorder: Recorder, number: int, machine: Machine) -> None:
    """Halt before a layer, with the carriage parked above all that is printed."""
    height = recorder.top + machine.process.tool_lift
    recorder.rise(height)
    _draw_back(recorder, machine)
    park = np.array([*machine.gcode.park, height])
    shift = np.array(machine.gcode.offset[:2]) if recorder.tool == 1 else np.zeros(2)
    recorder.travel(park + np.append(shift, 0.0), _UP)
    recorder.note(PAUSE, number)


def _speed(on_bed: bool, machine: Machine) -> float:
    """Speed of matrix on the bed or above it."""
    slower = machine.process.first_layer_speed if on_bed else 1.0
    return machine.matrix_speed * slower


class _Site:
    """Present height of block and bar; beside curved layers the height of their own layers."""

    def __init__(self, around: Beside, highest: float | None) -> None:
        self.around, self.height, self.bar = around, 0.0, 0.0
        self.strand, self.highest = around.strand, highest

    def printed(self, top: float, fibre: BoolArray) -> None:
        """Pass a layer that is printed already, with block and bar; mask of its strands."""
        if not fibre.all():
            self.height = max(self.height, top)
            self.bar = self.bar if self.strand is None else self.height
        if fibre.any():
            self.strand = None

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
        speed = _speed(first, machine)

        def lay(line: FloatArray, what: str, high: float) -> None:
            points = np.column_stack([line, np.full(len(line), top)])
            normals = np.tile(_UP, (len(line), 1))
            heights = np.full(len(line) - 1, high)
            steps = matrix_steps(points, normals, heights, what, machine, speed)
            lay_line(recorder, steps, machine)

        volume = 0.0
        for k, line in enumerate(self.around.blocks[0]):
            if k >= 2 and (volume >= process.prime_volume or not changed):
                break
            lay(line, "block", height)
            length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
            volume += length * machine.matrix_width * height
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
        steps = strand_steps(points, np.tile(_UP, (2, 1)), thickness, machine)
        lay_strand(recorder, steps, machine)


def _check_bed(moves: Moves, machine: Machine) -> None:
    """Check that both nozzles stay over the bed, and below its height."""
    profile = machine.gcode
    moving = is_any(moves.event, TRAVEL, LAY, FEED)
    least, most = np.full(3, np.inf), np.full(3, -np.inf)
    for fibre in (False, True):
        rows = moving & ((moves.tool == 1) == fibre)
        if not rows.any():
            continue
        # Z of an offset is set by firmware or file; the carriage itself stays in X and Y.
        shift = np.append(profile.offset[:2], 0.0) * fibre
        low, high = extent(moves.place, among=rows)
        least, most = np.minimum(least, low - shift), np.maximum(most, high - shift)
    bed = np.array(profile.bed)
    if (least < 0.0).any() or (most > bed).any():
        size = most - least
        raise InputError(
            f"with skirt, block, lifts and the offset of the nozzles the print needs {size[0]:.4g} "
            f"x {size[1]:.4g} x {most[2]:.4g} mm, but the printer has {bed[0]:g} x "
            f"{bed[1]:g} x {bed[2]:g} mm: turn the part, or set process.prime = 'none' and "
            "process.skirt_loops = 0"
        )


# Preheating of a waiting tool, so that the print does not wait for it.


def _preheats(moves: Moves, machine: Machine) -> tuple[list[int], list[float], list[int]]:
    """Rows before which a tool is preheated, its temperature, and the tool.

    There is one for each change back to a tool that was set to standby: the last row that starts at
    least the heating time, (work - standby) over the rate, ahead of the change; or right after the
    change away if that is later.
    """
    end = durations(moves, machine, heating=False)
    np.cumsum(end, out=end)  # in place: those of large prints fill memory
    rate = (machine.matrix_heating, machine.fibre_heating)
    places, values, tools = [], [], []
    for tool in (0, 1):
        waits = np.flatnonzero((moves.event == STANDBY) & (moves.tool == tool))
        works = np.flatnonzero((moves.event == WORK) & (moves.tool == tool))
        for k in works.tolist():
            before = waits[waits < k]
            if not len(before):
                # Before its first use; the start of the file waits for the heat of T0.
                waiting = machine.fibre_standby if tool else machine.matrix_temperature + 1e3
                standby, first = waiting, 0
            else:
                standby, first = float(moves.amount[before[-1]]), int(before[-1])
            need = max(float(moves.amount[k]) - standby, 0.0) / rate[tool]
            at = int(np.searchsorted(end[:-1], (end[k - 1] if k else 0.0) - need, side="right"))
            # Behind the change away: standby, selection and wait of the other tool, and its fan.
            behind = first + 4 if len(before) else 1
            at = max(at, behind)
            if need > 0.0 and at < k:
                places.append(at)
                values.append(float(moves.amount[k]))
                tools.append(tool)
    return places, values, tools


# What each tool needs before and after it lays something: heat, fan, its first filament, a cut.


def matrix_area(machine: Machine) -> float:
    """Section of the matrix filament, mm^2."""
    return float(0.25 * np.pi * machine.matrix_diameter**2)


def _working(tool: int, top: float, machine: Machine) -> float:
    """Temperature of a tool while it lays a layer with this top, degrees Celsius."""
    if tool:
        return machine.fibre_temperature
    warm = top <= machine.process.warm_height
    return machine.matrix_temperature + warm * machine.process.warm_matrix


def _fan(tool: int, top: float, machine: Machine) -> float:
    process = machine.process
    share = process.fibre_fan if tool else process.matrix_fan
    return 0.0 if top <= process.warm_height else share


def begin_layer(
    recorder: Recorder, number: int, top: float, below: float, machine: Machine
) -> None:
    """Begin a layer between two heights, mm.

    From a height on, nozzle and bed get less hot, and the fan of the tool runs.
    """
    recorder.begin_layer(number)
    warm = machine.process.warm_height
    if below <= warm < top and below > 0.0:
        if machine.process.warm_bed:
            recorder.note(HEAT_BED, machine.bed_temperature)
        if recorder.tool == 0 and machine.process.warm_matrix:
            recorder.note(HEAT, machine.matrix_temperature)
        if recorder.tool >= 0:
            recorder.note(FAN, _fan(recorder.tool, top, machine))
    recorder.top = max(recorder.top, below)


def change_tool(recorder: Recorder, tool: int, top: float, machine: Machine) -> bool:
    """Select a tool for a layer with this top; False where it is there.

    The nozzle rises, matrix is drawn back, the old tool cools while the new one is waited for.
    """
    old = recorder.tool
    if tool == old:
        return False
    process = machine.process
    if old >= 0:
        recorder.rise(recorder.top + process.tool_lift)
        _draw_back(recorder, machine)
        cool = machine.fibre_standby if old else machine.matrix_standby
        recorder.note(STANDBY, cool, old)
    recorder.tool = tool
    recorder.note(TOOL)
    recorder.note(WORK, _working(tool, top, machine))
    recorder.note(FAN, _fan(tool, top, machine))
    return True


def _draw_back(recorder: Recorder, machine: Machine) -> None:
    """Draw matrix back as far as a tool that waits needs."""
    process, speed = machine.process, machine.gcode.retract_speed
    if recorder.tool == 0 and process.tool_retract > recorder.drawn_back:
        recorder.feed(recorder.drawn_back - process.tool_retract, speed)
        recorder.drawn_back = process.tool_retract
    if recorder.tool == 1 and machine.coextrusion:
        recorder.draw_back_beside(max(process.tool_fibre_retract, recorder.beside_back), speed)


def line_sizes(heights: FloatArray, room: float, machine: Machine) -> tuple[FloatArray, FloatArray]:
    """Width and height, mm, of a line of matrix of a given section on each of its steps.

    A line is as wide as its room, over the width of the machine's lines. Where it would then be
    higher than its shape allows, the same section, `heights` (n,) at that width, is wider: what
    stands beside it presses it into the room.
    """
    section = machine.matrix_width * heights
    width = np.maximum(room * machine.matrix_width, np.sqrt(section / machine.line_shape))
    return width, section / width


def matrix_steps(
    line: FloatArray,
    normals: FloatArray,
    heights: FloatArray,
    what: str,
    machine: Machine,
    speed: float,
    room: float = 1.0,
) -> Steps:
    """Find the moves along a line (n, 3) of matrix, so high (n - 1,) on each of its steps.

    Heights and `room` are those of `line_sizes`; where a height is 0 nothing is laid.
    """
    width, heights = line_sizes(heights, room, machine)
    feed = width * heights / matrix_area(machine)
    speeds = np.where(heights > 0.0, speed, machine.travel_speed)
    return steps_along(line, normals, speeds, feed, width, heights, what, machine)


def lay_line(recorder: Recorder, steps: Steps, machine: Machine) -> None:
    """Go to a line of matrix, lay it, and leave it."""
    profile = machine.gcode
    recorder.travel(steps.start, steps.normal)
    if recorder.drawn_back:
        recorder.feed(recorder.drawn_back, profile.retract_speed)
        recorder.drawn_back = 0.0
    recorder.lay(steps)
    if profile.retract:
        recorder.feed(-profile.retract, profile.retract_speed)
        recorder.drawn_back = profile.retract
    recorder.retreat()


class StrandSteps(NamedTuple):
    """Moves along a strand: `laid` before its cut, `dragged` behind it, and `ironed`.

    `total` and `tail`, mm, are its length and what lies between its cut and its end.
    """

    start: FloatArray
    normal: FloatArray
    total: float
    tail: float
    laid: Steps | None
    dragged: Steps | None
    ironed: Steps | None

    def at(self, height: float) -> "StrandSteps":
        """Move alike at another height, mm."""
        parts = (part and part.at(height) for part in (self.laid, self.dragged, self.ironed))
        laid, dragged, ironed = parts
        start = np.append(self.start[:2], height)
        return self._replace(start=start, laid=laid, dragged=dragged, ironed=ironed)


def strand_steps(
    line: FloatArray, normals: FloatArray, height: float, machine: Machine
) -> StrandSteps:
    """Find the moves along a strand (n, 3)."""
    process = machine.process
    positions, speeds, cut_at = strand_speeds(line, machine)
    along = along_line(line)
    points = points_along(line, along, positions).round(COORDINATE_DIGITS)
    across = _unit_normals(normals, along, positions)
    cut = int(np.abs(positions - cut_at).argmin())
    room = max(machine.fibre_width * height - machine.filament_area, 0.0)
    round_it = machine.coextrusion * room / matrix_area(machine)

    def along_part(first: int, last: int, name: str, feed: float) -> Steps | None:
        count = last - first
        if not count:
            return None
        where, ends = speeds[first:last], slice(first, last + 1)
        full = np.ones(count)
        sizes = (machine.fibre_width * full, height * full)
        about = (feed * full, *sizes, name, machine, round_it * full)
        return steps_along(points[ends], across[ends], where, *about)

    return StrandSteps(
        points[0],
        across[0],
        float(positions[-1]),
        line_length(points[cut:]),
        along_part(0, cut, "fibre", process.feed_ratio),
        along_part(cut, len(speeds), "tail", 0.0),
        _ironed(points, across, positions, machine) if process.ironing_length > 0.0 else None,
    )


def _unit_normals(normals: FloatArray, along: FloatArray, positions: FloatArray) -> FloatArray:
    """Return unit normals at positions on a strand whose points have these normals."""
    across = points_along(normals, along, positions)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return across


def lay_strand(recorder: Recorder, strand: StrandSteps, machine: Machine) -> None:
    """Feed, lay, cut and lay to its end a strand, and leave it."""
    process, profile = machine.process, machine.gcode
    recorder.travel(strand.start, strand.normal)
    recorder.draw_back_beside(0.0, profile.retract_speed)
    recorder.note(PATH_START, strand.total)
    if machine.tail > 0.0:
        recorder.feed(strand.tail + process.restart_extra, profile.feed_speed)
    if process.start_wait:
        recorder.note(WAIT, process.start_wait)
    if strand.laid is not None:
        recorder.lay(strand.laid)
    recorder.note(CUT, machine.cut_wait)
    if strand.dragged is not None:
        recorder.lay(strand.dragged)
    recorder.note(PATH_END, strand.total)
    if strand.ironed is not None:
        recorder.lay(strand.ironed)
    if machine.coextrusion:
        recorder.draw_back_beside(profile.fibre_retract, profile.retract_speed)
    recorder.retreat(process.strand_lift)


def _ironed(
    points: FloatArray, normals: FloatArray, positions: FloatArray, machine: Machine
) -> Steps:
    """Find the moves back over the end of a strand, without feeding."""
    start = max(float(positions[-1]) - machine.process.ironing_length, 0.0)
    back = np.append(positions[positions > start + 1e-3][::-1], start)
    line = points_along(points, positions, back).round(COORDINATE_DIGITS)
    across = _unit_normals(normals, positions, back)
    speeds = np.full(len(back) - 1, machine.process.finish_speed)
    nothing = 0.0 * speeds
    return steps_along(line, across, speeds, nothing, nothing, nothing, "travel", machine)


# Speed along a strand: slow at its start, in tight turns and corners, and behind its cut.


_REACH = 2.0
"""Least length over which curvature is taken, in fibre widths; that of `ccfem.paths.linking`."""
_PIECES = 5
"""Pieces of the ramp from the start speed to the normal one."""
_RATIO = 1.25
"""Ratio of neighbouring speeds of strands in a compact file. Our choice."""
_SAME = 1e-3
_NEAR = 0.02
"""Places where the speed changes are moved to points of the strand that are nearer than this, mm:
rounded to 0.001 mm, a shorter step would turn anywhere."""


def strand_speeds(line: FloatArray, machine: Machine) -> tuple[FloatArray, FloatArray, float]:
    """Points of a strand, the speed of each of its steps, and where it is cut.

    Parameters
    ----------
    line : (n, 2) or (n, 3) array, mm
        At least as long as `Machine.tail`.

    Returns
    -------
    positions : (m,) array, mm
        Arc lengths, from 0 to the length of the line: its points and those where the speed changes.
    speeds : (m - 1,) array, mm/s
    cut : float, mm
        One of the positions, `Machine.tail` before the end.
    """
    process, along = machine.process, along_line(line)
    total = float(along[-1])
    cut = max(total - machine.tail, 0.0)
    normal, corners = _normal_speeds(line, machine)
    ramp = process.start_length + np.linspace(0.0, process.ramp_length, _PIECES + 1)
    breaks = [cut, *ramp.tolist()]
    for corner in along[corners].tolist():
        breaks += [corner - process.corner_length, corner + process.corner_length]
    positions = _joined(along, np.array(breaks))
    middle = 0.5 * (positions[1:] + positions[:-1])
    step = np.clip(np.searchsorted(along, middle) - 1, 0, len(normal) - 1)
    speeds = np.minimum(normal[step], machine.process.speed_limit or np.inf)
    if machine.speeds is None:
        bend = _bend_at(line, along, middle, _REACH * machine.fibre_width)
        speeds = np.minimum(speeds, _speed_of(bend, machine))
    slow = np.minimum(process.start_speed, speeds)
    if process.start_length > 0.0:
        behind = positions[:-1] - process.start_length
        share = np.clip(behind / max(process.ramp_length, _SAME), 0.0, 1.0)
        speeds = slow + np.where(behind < -_SAME, 0.0, share) * (speeds - slow)
    for corner in along[corners].tolist():
        reach = process.corner_length - _SAME
        near = (positions[:-1] < corner + reach) & (positions[1:] > corner - reach)
        speeds[near] = slow[near]
    tail = middle > cut
    speeds[tail] = np.minimum(speeds[tail], process.finish_speed)
    return positions, _stepped(speeds) if machine.gcode.compact else speeds, cut


def _stepped(speeds: FloatArray) -> FloatArray:
    """Speeds on a scale of few, whole mm/min: each is the next lower one, mm/s."""
    scale = _RATIO ** np.floor(np.log(60.0 * speeds) / np.log(_RATIO) + 1e-9)
    return np.asarray(np.ceil(scale) / 60.0)


def _normal_speeds(line: FloatArray, machine: Machine) -> tuple[FloatArray, BoolArray]:
    """Speed of each step by the table, or by the radius of turns; points that are corners."""
    process, ends = machine.process, np.array([0, len(line)])
    turn = np.degrees(turning_angles(line, ends, np.zeros(1, dtype=bool)))
    corner = turn > process.corner_angle
    reach = _REACH * machine.fibre_width
    if machine.speeds is not None:
        return table_speeds(line, ends, machine.speeds, reach)[:-1], corner
    return _speed_of(step_curvatures(line, ends, corner, reach), machine), corner


def _speed_of(bend: FloatArray, machine: Machine) -> FloatArray:
    """Speed by curvature, 1/mm, where there is no table."""
    process = machine.process
    slow, fast = min(process.start_speed, machine.fibre_speed), machine.fibre_speed
    with np.errstate(divide="ignore"):
        radius = 1.0 / bend
    least, most = machine.minimum_radius, process.bend_radius
    if most <= least:
        share = (radius >= least).astype(np.float64)
    else:
        share = np.clip((np.minimum(radius, most) - least) / (most - least), 0.0, 1.0)
    return np.asarray(slow + share * (fast - slow))


def _bend_at(line: FloatArray, along: FloatArray, at: FloatArray, reach: float) -> FloatArray:
    """Curvature of the circle through places on a line and those a reach before and behind."""
    a, b, c = (
        points_along(line, along, np.clip(at + off, 0.0, along[-1])) for off in (-reach, 0.0, reach)
    )
    u, v = b - a, c - b
    sizes = [np.linalg.norm(side, axis=1) for side in (u, v, c - a)]
    dot = np.einsum("ij,ij->i", u, v)
    across = np.sqrt(np.maximum((sizes[0] * sizes[1]) ** 2 - dot**2, 0.0))
    return np.asarray(2.0 * across / np.maximum(sizes[0] * sizes[1] * sizes[2], 1e-12))


def _joined(along: FloatArray, breaks: FloatArray) -> FloatArray:
    """Positions of points and breaks, none nearer to another than 0.02 mm."""
    total = along[-1]
    inner = breaks[(breaks > _SAME) & (breaks < total - _SAME)]
    near = np.searchsorted(along, inner)
    gap = np.minimum(inner - along[near - 1], along[np.minimum(near, len(along) - 1)] - inner)
    inner = np.sort(inner[gap > _NEAR])
    if len(inner):
        inner = inner[np.append(True, np.diff(inner) > _NEAR)]
    return np.sort(np.concatenate([along, inner]))
