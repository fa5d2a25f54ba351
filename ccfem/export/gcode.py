"""G-code of a whole part: matrix by tool 0, fibre by tool 1 with its cuts, moves between them.

Conventions of the file: mm and mm/min; X, Y, Z absolute, E relative (M83). G1 lays material, G0
only travels. E of the matrix is length of filament, so that a line has the volume of its length,
its width and the height that it lays (`ccfem.export.matrix_flow`). E of the fibre is length of
fibre: before a path, the distance from the cutter to the nozzle (G1 with E alone), then the
distance that the nozzle moves. The cut comes that first distance before the end of the path; the
rest is dragged out and laid by G1 without E. In all, exactly the length of the path is fed.
"""

from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.export.print_plan import COORDINATE_DIGITS, PrintPlan
from ccfem.geometry.polylines import arc_lengths, line_length, point_at, subdivide
from ccfem.io.whole import whole_file
from ccfem.linking.print_speed import step_speeds
from ccfem.machine.machine import Machine
from ccfem.toolpaths import FIBRE, KINDS, MATRIX

__all__ = ["gcode", "write_gcode"]

_TOOLS = {MATRIX: 0, FIBRE: 1}

_FEED_DIGITS = 5
"""Decimals of E, mm."""

_SAME = 1e-3
"""A path is cut at one of its points where that is within this distance, mm, of the right place."""


def write_gcode(path: str | Path, plan: PrintPlan, machine: Machine) -> None:
    """Write the G-code of a part, whole or not at all.

    Parameters
    ----------
    path : str or Path
    plan : PrintPlan
    machine : Machine
        The one that the plan was made for.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_text(gcode(plan, machine), encoding="utf-8", newline="\n")


def gcode(plan: PrintPlan, machine: Machine) -> str:
    """G-code of a part, as `write_gcode` writes it."""
    program = _Program(machine)
    paths, speeds = plan.paths, step_speeds(plan.paths, machine)
    layer = -1
    for k, (start, end) in enumerate(pairwise(paths.offsets.tolist())):
        if paths.layer[k] != layer:
            layer = int(paths.layer[k])
            program.begin_layer(layer, plan.top[layer], plan.thickness[layer], int(paths.kind[k]))
        line, speed = paths.points[start:end, :2], speeds[start : end - 1]
        if paths.kind[k] == FIBRE:
            program.lay_fibre(line, speed)
        else:
            program.lay_matrix(line, speed, plan.laid[start : end - 1])
    program.lines += machine.gcode.fill(machine.gcode.end, program.values)
    fibre = paths.of_kind(FIBRE)
    head = [
        f"; ccfem {version('ccfem')}",
        "; mm, mm/min; X Y Z absolute, E relative; T0 matrix, T1 fibre (E in mm of fibre)",
        f"; {len(plan.top)} layers, {plan.top.max():g} mm high",
        f"; {fibre.lengths.sum():.1f} mm of fibre in {len(fibre)} paths, each cut "
        f"{machine.tail:g} mm before its end",
        f"; {program.seconds:.0f} s, without heating, tool changes and acceleration",
    ]
    return "\n".join([*head, *program.lines]) + "\n"


class _Program:
    """Lines of the file so far, with the state of the printer after them."""

    def __init__(self, machine: Machine) -> None:
        self.machine, self.profile = machine, machine.gcode
        self.values: dict[str, float] = {
            "bed_temperature": machine.bed_temperature,
            "matrix_temperature": machine.matrix_temperature,
            "fibre_temperature": machine.fibre_temperature,
            "wait": 1000.0 * machine.cut_wait,
            "tool": 0,
        }
        self.lines = self.profile.fill(self.profile.start, self.values)
        self.seconds = 0.0
        self._tool: int | None = None
        self._top = self._height = 0.0
        self._feed = ""
        self._place: FloatArray | None = None
        self._retracted = False

    def begin_layer(self, number: int, top: float, thickness: float, kind: int) -> None:
        """Rise above the layer, and select the tool that lays it."""
        self._top = float(top)
        self.lines += [
            f";LAYER:{number}",
            f";TYPE:{KINDS[kind].upper()}",
            f";Z:{top:.3f}",
            f";HEIGHT:{thickness:.4f}",
        ]
        self._rise_to(self._top + self.profile.lift)
        tool = _TOOLS[kind]
        if tool != self._tool:
            self.lines += self.profile.fill(self.profile.tool, {**self.values, "tool": tool})
            self._tool, self._feed = tool, ""

    def lay_matrix(self, line: FloatArray, speeds: FloatArray, heights: FloatArray) -> None:
        """Lay a line (n, 2) of matrix, so high on each of its steps."""
        profile, machine = self.profile, self.machine
        self._travel(line[0])
        if self._retracted:
            self._extrude(profile.retract, profile.retract_speed)
        area = 0.25 * np.pi * machine.matrix_diameter**2
        self._lay(line, speeds, machine.matrix_width * heights / area)
        self._extrude(-profile.retract, profile.retract_speed)
        self._retracted = True
        self._rise_to(self._top + self.profile.lift)

    def lay_fibre(self, line: FloatArray, speeds: FloatArray) -> None:
        """Feed, lay, cut and lay to its end a path (n, 2) of fibre."""
        total = line_length(line)
        line, speeds, cut = _with_point_at(line, speeds, total - self.machine.tail)
        self._travel(line[0])
        self._extrude(line_length(line[cut:]), self.profile.feed_speed)
        self._lay(line[: cut + 1], speeds[:cut], np.ones(cut))
        self.lines += self.profile.fill(self.profile.cut, self.values)
        self._feed = ""
        self.seconds += self.machine.cut_wait
        self._lay(line[cut:], speeds[cut:], np.zeros(len(line) - 1 - cut))
        self._rise_to(self._top + self.profile.lift)

    def _lay(self, line: FloatArray, speeds: FloatArray, feed: FloatArray) -> None:
        """Move along a line (n, 2) from its start, feeding so much per mm of each step."""
        fed_at_all = len(feed) > 0 and feed.max() > 0.0
        if fed_at_all:
            whole = np.array([0, len(line)])
            line, _, step = subdivide(line, whole, self.profile.longest_feed / float(feed.max()))
            speeds, feed = speeds[step[:-1]], feed[step[:-1]]
        steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
        self.seconds += float((steps / speeds).sum())
        # Rounded in sum, so that no feed is lost however short the steps are.
        fed = np.diff(np.append(0.0, np.cumsum(feed * steps)).round(_FEED_DIGITS))
        for (x, y), e, speed in zip(line[1:].tolist(), fed.tolist(), speeds.tolist(), strict=True):
            extrusion = f" E{e:.{_FEED_DIGITS}f}" if fed_at_all else ""
            self.lines.append(f"G1 X{x:.3f} Y{y:.3f}{extrusion}{self._at(speed)}")
        self._place = line[-1]

    def _extrude(self, length: float, speed: float) -> None:
        """Feed filament without moving."""
        count = int(np.ceil(abs(length) / self.profile.longest_feed - 1e-9))
        for part in np.diff(np.linspace(0.0, length, count + 1).round(_FEED_DIGITS)).tolist():
            self.lines.append(f"G1 E{part:.{_FEED_DIGITS}f}{self._at(speed)}")
        self.seconds += abs(length) / speed

    def _travel(self, place: FloatArray) -> None:
        """Go to a place (2,) above the layer, and down to it."""
        speed = self.machine.travel_speed
        if self._place is not None:
            self.seconds += float(np.linalg.norm(place - self._place)) / speed
        self.lines.append(f"G0 X{place[0]:.3f} Y{place[1]:.3f}{self._at(speed)}")
        self._place = place
        self._rise_to(self._top)

    def _rise_to(self, height: float) -> None:
        """Go up or down to a height; nothing where the nozzle is there."""
        if height != self._height:
            speed = self.profile.lift_speed
            self.lines.append(f"G0 Z{height:.3f}{self._at(speed)}")
            self.seconds += abs(height - self._height) / speed
            self._height = height

    def _at(self, speed: float) -> str:
        """Feed rate of a move, where it differs from that of the move before."""
        feed = f" F{60.0 * speed:.6g}"
        said, self._feed = self._feed, feed
        return "" if feed == said else feed


def _with_point_at(
    line: FloatArray, speeds: FloatArray, position: float
) -> tuple[FloatArray, FloatArray, int]:
    """Line (n, 2) and speeds of its steps with a point at an arc length, and that point's index."""
    along = arc_lengths(line, np.array([0, len(line)]))
    nearest = int(np.abs(along - position).argmin())
    if abs(along[nearest] - position) <= _SAME or position < 0.0:
        return line, speeds, nearest
    step = int(np.searchsorted(along, position)) - 1
    point = point_at(line, position).round(COORDINATE_DIGITS)
    return np.insert(line, step + 1, point, axis=0), np.insert(speeds, step, speeds[step]), step + 1
