"""Notes down what a machine does, knowing where its nozzle stands."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.row_blocks import RowBlocks
from ccfem.geometry.polylines import subdivide
from ccfem.geometry.shapes import bends
from ccfem.machine.machine import Machine
from ccfem.printing.laid_layer import COORDINATE_DIGITS
from ccfem.printing.moves import FEED, KINDS, LAY, LAYER, TRAVEL, Moves, role

_SAME = 1e-9
_STRAIGHT = 1.5 * 10.0**-COORDINATE_DIGITS
"""Distance from a straight line, mm, within which rounded points lie on it."""
_COMPACT = 0.01
"""The same in a compact file. Our choice."""
_BLOCKS = 500
"""Blocks of rows that are kept as such: many small ones leave holes in memory."""
_COLUMNS: dict[str, int | slice] = {
    "event": 0,
    "place": slice(1, 4),
    "normal": slice(4, 7),
    **{name: 7 + k for k, name in enumerate(("tool", "feed", "beside", "speed", "width"))},
    **{name: 12 + k for k, name in enumerate(("height", "amount", "role", "layer", "strand"))},
}
"""Columns of `Moves`: where they stand in a row."""
_POSE = ("place", "normal")
_LEVEL = 0.1
"""Cosine of the tilt below which a head's own axis leads too far aside to leave along it."""


def feed_digits(machine: Machine) -> int:
    """Decimals of what is fed, mm."""
    return 3 if machine.gcode.compact else 5


class Steps(NamedTuple):
    """Moves along a line, whatever the machine did before.

    `rows` (n, 17) are those of `Moves` but for tool, layer and strand; `start` and `normal` (3,)
    where the line begins, and `top`, mm, its highest point.
    """

    rows: FloatArray
    start: FloatArray
    normal: FloatArray
    top: float

    def at(self, height: float) -> "Steps":
        """Move alike at another height, mm."""
        rows = self.rows.copy()
        rows[:, 3] = height
        return Steps(rows, np.append(self.start[:2], height), self.normal, height)


def steps_along(
    line: FloatArray,
    normals: FloatArray,
    speeds: FloatArray,
    feed: FloatArray,
    widths: FloatArray,
    heights: FloatArray,
    what: str,
    machine: Machine,
    beside: FloatArray | None = None,
) -> Steps:
    """Find the moves along a line (n, 3), feeding so much per mm of each of its steps (n - 1,).

    Steps on one straight line that are laid alike are one move, as far as firmware can feed.
    """
    begin, up = line[0], normals[0]
    alike = [speeds, feed, widths, heights, *([] if beside is None else [beside])]
    off = _COMPACT if machine.gcode.compact else _STRAIGHT
    kept = _ends_of_moves(line, normals, np.column_stack(alike), off)
    line, normals, index = line[kept], normals[kept], kept[:-1]
    if len(index) and feed.max() > 0.0:
        ends, longest = np.array([0, len(line)]), machine.gcode.longest_feed
        line, _, step = subdivide(line, ends, longest / float(feed.max()))
        line = line.round(COORDINATE_DIGITS)
        normals, index = normals[step], index[step[:-1]]
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    # Rounded in sum, so that no feed is lost however short the steps are.
    digits = feed_digits(machine)
    fed = np.diff(np.append(0.0, np.cumsum(feed[index] * steps)).round(digits))
    with_it = np.zeros(len(fed)) if beside is None else beside[index] * steps
    with_it = np.diff(np.append(0.0, np.cumsum(with_it)).round(digits))
    moved = np.flatnonzero(steps > 0.0)
    at = index[moved]
    columns = {
        "place": line[moved + 1],
        "normal": normals[moved + 1],
        "feed": fed[moved],
        "beside": with_it[moved],
        "speed": speeds[at],
        "width": widths[at],
        "height": heights[at],
    }
    rows = np.zeros((len(moved), 17))
    rows[:, _COLUMNS["event"]], rows[:, _COLUMNS["role"]] = LAY, role(what)
    for name, values in columns.items():
        rows[:, _COLUMNS[name]] = values
    if what == "sparse":
        bare = heights[at] == 0.0
        rows[bare, _COLUMNS["event"]], rows[bare, _COLUMNS["role"]] = TRAVEL, role("travel")
        rows[bare, _COLUMNS["width"]] = rows[bare, _COLUMNS["height"]] = 0.0
    return Steps(rows, begin, up, float(line[:, 2].max()))


class Recorder:
    """Rows of `Moves` so far, and the state of the machine after them."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.rows: list[tuple[float, ...]] = []
        self.blocks: list[FloatArray] = []
        shapes = {name: (3,) if isinstance(at, slice) else () for name, at in _COLUMNS.items()}
        self.columns = {name: RowBlocks(KINDS[name], *shape) for name, shape in shapes.items()}
        self.place: FloatArray | None = None
        self.normal = np.array([0.0, 0.0, 1.0])
        self.tool = -1
        self.top = 0.0
        self.layer = 0
        self.strand = -1
        self.drawn_back = 0.0
        self.beside_back = 0.0
        self._begun = True

    def note(self, event: int, value: float = 0.0, tool: int | None = None) -> None:
        """Note what happens where the nozzle stands."""
        self._row(event, tool=self.tool if tool is None else tool, value=value)

    def feed(self, length: float, speed: float, beside: float = 0.0) -> None:
        """Feed filament without moving, in steps that the firmware takes."""
        count = int(np.ceil(abs(length) / self.machine.gcode.longest_feed - 1e-9))
        steps = np.diff(np.linspace(0.0, length, count + 1).round(feed_digits(self.machine)))
        for part in steps.tolist():
            self._row(FEED, feed=part, beside=beside * part / length, speed=speed)

    def draw_back_beside(self, length: float, speed: float) -> None:
        """Draw the fibre head's own matrix back by a length in all, mm; 0 brings it forward."""
        if length != self.beside_back:
            self._row(FEED, feed=0.0, beside=self.beside_back - length, speed=speed)
            self.beside_back = length

    def travel(self, place: FloatArray, normal: FloatArray) -> None:
        """Go above all that is printed to a place, and down to it.

        A tilted head leaves and comes along its own axis: there it meets nothing that it did not
        meet where it lays. Above, its lower side clears what is printed too.
        """
        lift, axis = self.machine.gcode.lift, self._axis(normal)
        low = self._dip(axis)
        if self.place is not None:
            low = max(low, self._dip(self._axis(self.normal)))
            level = max(self.top + lift, float(place[2]) + lift) + low
            self._leave(max(level, float(self.place[2])))
            level = float(self.place[2])
        else:
            level = max(self.top, float(place[2])) + lift + low
        above = self._along(place, axis, level)
        self._to(np.append(above[:2], level), normal, across=True)
        if axis[2] < 1.0 - _SAME:
            self._to(above, normal)
        self._to(place, normal)

    def _axis(self, normal: FloatArray) -> FloatArray:
        """Direction that the head stands in."""
        upright = self.machine.kinematics.kind == "three_axes"
        return np.array([0.0, 0.0, 1.0]) if upright else normal

    def _dip(self, axis: FloatArray) -> float:
        """How far the side of a tilted head reaches below its tip, mm."""
        half = np.radians(self.machine.head_angle)
        tilt = float(np.arctan2(np.hypot(axis[0], axis[1]), axis[2]))
        down = -np.cos(min(tilt + half, np.pi))
        return max(float(self.machine.head_length / np.cos(half) * down), 0.0)

    def _along(self, place: FloatArray, axis: FloatArray, level: float) -> FloatArray:
        """Place on the axis from here at a level, or as far as the head is long."""
        most = max(self.machine.head_length, self.machine.gcode.lift)
        far = (level - float(place[2])) / float(axis[2]) if axis[2] > _LEVEL else most
        return np.asarray(place + np.clip(far, 0.0, most) * axis)

    def _leave(self, level: float) -> None:
        """Go up to a level, along the head's axis first."""
        assert self.place is not None
        axis = self._axis(self.normal)
        if axis[2] < 1.0 - _SAME:
            self._to(self._along(self.place, axis, level), self.normal)
        self._to(np.append(self.place[:2], level), self.normal)

    def retreat(self, more: float = 0.0) -> None:
        """Leave what was laid, along the normal."""
        assert self.place is not None
        far = self.machine.gcode.lift + more
        self._to(self.place + far * self._axis(self.normal), self.normal)

    def rise(self, height: float) -> None:
        """Go up to a height, if the nozzle is below it."""
        if self.place is not None and self.place[2] < height:
            self._leave(height)

    def lay(self, steps: Steps) -> None:
        """Move along a line from its start."""
        rows = steps.rows
        if len(rows):
            rows[:, _COLUMNS["tool"]] = self.tool
            rows[:, _COLUMNS["layer"]] = self.layer
            rows[:, _COLUMNS["strand"]] = self.strand
            if self._begun:
                self._flush()
            else:
                self._split()
                self._begun = True
            self.blocks.append(rows)
            self.place, self.normal = (rows[-1, _COLUMNS[name]].copy() for name in _POSE)
        self.top = max(self.top, steps.top)

    def _to(self, place: FloatArray, normal: FloatArray, across: bool = False) -> None:
        """Travel straight to a place."""
        place = place.round(COORDINATE_DIGITS) + 0.0
        if self.place is not None and np.abs(place - self.place).max() < _SAME:
            self.normal = normal
            return
        self.place, self.normal = place, normal
        machine = self.machine
        self._row(TRAVEL, speed=machine.travel_speed if across else machine.gcode.lift_speed)

    def _row(
        self,
        event: int,
        tool: int | None = None,
        feed: float = 0.0,
        beside: float = 0.0,
        speed: float = 0.0,
        width: float = 0.0,
        height: float = 0.0,
        value: float = 0.0,
        what: int = 0,
    ) -> None:
        place = np.zeros(3) if self.place is None else self.place
        number = self.tool if tool is None else tool
        state = (self.layer, self.strand)
        lines = (number, feed, beside, speed, width, height, value, what)
        self.rows.append((event, *place, *self.normal, *lines, *state))

    def _flush(self) -> None:
        if self.rows:
            self.blocks.append(np.array(self.rows))
            self.rows = []
        if len(self.blocks) > _BLOCKS:
            self._split()

    def begin_layer(self, number: int) -> None:
        """Note that a layer begins.

        What it lays is in blocks of its own, which others may repeat; so is the way to there, which
        depends on the layer below.
        """
        self.layer = number
        self._split()
        self.note(LAYER, number)
        self._split()
        self._begun = False

    def _split(self) -> None:
        """Keep the columns of the blocks so far, each as small as `Moves` has it."""
        if self.rows:
            self.blocks.append(np.array(self.rows))
            self.rows = []
        table = np.concatenate([np.zeros((0, 17)), *self.blocks])
        self.blocks = []
        # Only strands have numbers, not the matrix between them.
        strand = _COLUMNS["strand"]
        table[:, strand] = np.where(table[:, _COLUMNS["tool"]] == 1.0, table[:, strand], -1.0)
        for name, place in _COLUMNS.items():
            self.columns[name].append(table[:, place].astype(KINDS[name]))

    def seen(self) -> Moves:
        """All that was noted so far: to be forgotten before more is."""
        self._split()
        columns: dict[str, Any] = dict(self.columns)
        return Moves(**columns)

    def insert(
        self, event: int, places: Sequence[int], values: Sequence[float], tools: Sequence[int]
    ) -> None:
        """Insert events before rows: they happen where the row before ends."""
        if not len(places):
            return
        order = np.argsort(places, kind="stable")
        at = np.array(places, dtype=np.int64)[order]
        given = {"event": [event] * len(at), "amount": values, "tool": tools}
        for name, column in self.columns.items():
            rows = column[np.maximum(at - 1, 0)]
            if name not in ("place", "normal", "layer", "strand"):
                rows = np.zeros_like(rows)
            if name in given:
                rows = np.array(given[name])[order]
            column.insert(at.tolist(), rows)

    def moves(self) -> Moves:
        """All that was noted; nothing is noted after it."""
        self._split()
        columns: dict[str, Any] = {name: column.rows() for name, column in self.columns.items()}
        return Moves(**columns)


def _ends_of_moves(
    line: FloatArray, normals: FloatArray, alike: FloatArray, off: float
) -> IntArray:
    """Points of a line (n, 3) where a move ends: its bends, and where values (n - 1, k) change.

    Lines that are not level keep all points: the head turns along them.
    """
    if len(line) < 2 or (normals[:, 2] < 1.0 - _SAME).any() or np.ptp(line[:, 2]) > 0.0:
        return np.arange(len(line))
    changes = np.flatnonzero((alike[1:] != alike[:-1]).any(axis=1)) + 1
    return bends(line[:, :2], changes, off)
