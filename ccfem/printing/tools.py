"""What each tool needs before and after it lays something: heat, fan, its first filament, a cut."""

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import along_line, line_length, points_along
from ccfem.machine.machine import Machine
from ccfem.printing.laid_layer import COORDINATE_DIGITS
from ccfem.printing.moves import (
    CUT,
    FAN,
    HEAT,
    HEAT_BED,
    LAYER,
    PATH_END,
    PATH_START,
    STANDBY,
    TOOL,
    WAIT,
    WORK,
)
from ccfem.printing.recorder import Recorder
from ccfem.printing.strand_speed import strand_speeds


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
    """Begin a layer: from a height on, nozzle and bed get less hot, and the fan of the tool runs.

    Parameters
    ----------
    recorder : Recorder
    number : int
    top, below : float, mm
        Tops of this layer and of the one below it.
    machine : Machine
    """
    recorder.layer = number
    recorder.note(LAYER, number)
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
    process, profile = machine.process, machine.gcode
    if old >= 0:
        recorder.rise(recorder.top + process.tool_lift)
        if old == 0 and process.tool_retract > recorder.drawn_back:
            recorder.feed(recorder.drawn_back - process.tool_retract, profile.retract_speed)
            recorder.drawn_back = process.tool_retract
        cool = machine.fibre_standby if old else machine.matrix_standby
        recorder.note(STANDBY, cool, old)
    recorder.tool = tool
    recorder.note(TOOL)
    recorder.note(WORK, _working(tool, top, machine))
    recorder.note(FAN, _fan(tool, top, machine))
    return True


def lay_matrix(
    recorder: Recorder,
    line: FloatArray,
    normals: FloatArray,
    heights: FloatArray,
    what: str,
    machine: Machine,
    speed: float,
) -> None:
    """Lay a line (n, 3) of matrix, so high (n - 1,) on each of its steps, and leave it."""
    profile, width = machine.gcode, machine.matrix_width
    recorder.travel(line[0], normals[0])
    if recorder.drawn_back:
        recorder.feed(recorder.drawn_back, profile.retract_speed)
        recorder.drawn_back = 0.0
    feed = width * heights / matrix_area(machine)
    speeds = np.full(len(heights), speed)
    recorder.lay(line, normals, speeds, feed, width, heights, what)
    if profile.retract:
        recorder.feed(-profile.retract, profile.retract_speed)
        recorder.drawn_back = profile.retract
    recorder.retreat()


def lay_strand(
    recorder: Recorder, line: FloatArray, normals: FloatArray, height: float, machine: Machine
) -> None:
    """Feed, lay, cut and lay to its end a strand (n, 3), and leave it."""
    process, profile = machine.process, machine.gcode
    positions, speeds, cut_at = strand_speeds(line, machine)
    along = along_line(line)
    points = points_along(line, along, positions).round(COORDINATE_DIGITS)
    across = points_along(normals, along, positions)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    cut = int(np.abs(positions - cut_at).argmin())
    room = max(machine.fibre_width * height - machine.filament_area, 0.0)
    round_it = machine.coextrusion * room / matrix_area(machine)
    total = float(positions[-1])
    recorder.travel(points[0], across[0])
    recorder.note(PATH_START, total)
    tail = line_length(points[cut:])
    if machine.tail > 0.0:
        recorder.feed(tail + process.restart_extra, profile.feed_speed)
    if process.start_wait:
        recorder.note(WAIT, process.start_wait)
    steps, width = np.ones(len(speeds)), machine.fibre_width
    for part, name, feed in (
        (slice(0, cut), "fibre", process.feed_ratio),
        (slice(cut, None), "tail", 0.0),
    ):
        if name == "tail":
            recorder.note(CUT, machine.cut_wait)
        ends = slice(part.start, len(points) if part.stop is None else part.stop + 1)
        count = len(speeds[part])
        if count:
            recorder.lay(
                points[ends],
                across[ends],
                speeds[part],
                feed * steps[part],
                width,
                np.full(count, height),
                name,
                np.full(count, round_it),
            )
    recorder.note(PATH_END, total)
    if process.ironing_length > 0.0:
        _iron(recorder, points, across, positions, machine)
    recorder.retreat(process.strand_lift)


def _iron(
    recorder: Recorder,
    points: FloatArray,
    normals: FloatArray,
    positions: FloatArray,
    machine: Machine,
) -> None:
    """Go back over the end of a strand without feeding."""
    start = max(float(positions[-1]) - machine.process.ironing_length, 0.0)
    back = np.append(positions[positions > start + 1e-3][::-1], start)
    line = points_along(points, positions, back).round(COORDINATE_DIGITS)
    across = points_along(normals, positions, back)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    speeds = np.full(len(back) - 1, machine.process.finish_speed)
    recorder.lay(line, across, speeds, 0.0 * speeds, 0.0, 0.0 * speeds, "travel")
