"""All actions of a machine from the first line to the last: a table, one row a move or event.

Arcs stand in place of chains of short straight moves, for firmware that knows G2 and G3.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, in_brief, shared_rows
from ccfem.machine.gcode_profile import GcodeProfile
from ccfem.machine.machine import Machine
from ccfem.printing.laid_layer import COORDINATE_DIGITS

EVENTS = (
    *("travel", "lay", "feed", "cut", "tool", "standby", "preheat", "heat", "work"),
    *("heat bed", "fan", "wait", "layer", "start", "end", "pause"),
)
"""Kinds of rows: moves first, then events during which the nozzle stands still."""
TRAVEL, LAY, FEED, CUT, TOOL, STANDBY, PREHEAT, HEAT, WORK = range(9)
HEAT_BED, FAN, WAIT, LAYER, PATH_START, PATH_END, PAUSE = range(9, 16)

ROLES = ("travel", "contour", "infill", "fibre", "tail", "block", "skirt", "pad", "short", "sparse")
"""Roles of laid lines: "tail" is fibre after its cut, "short" replaces strands too short to cut.

"infill" is solid, and "sparse" is not."""


def role(name: str) -> int:
    """Find the index of a role by its name."""
    return ROLES.index(name)


def is_any(event: IntArray, *kinds: int) -> BoolArray:
    """Mask (n,) of rows that are of some kinds, without scratch of eight bytes a row."""
    mask = np.zeros(len(event), dtype=bool)
    for kind in kinds:
        mask |= event == kind
    return mask


@dataclass(frozen=True)
class Arcs:
    """Arcs that stand for chains of moves, in their order.

    Attributes
    ----------
    first, last : (k,) int arrays
        Rows of `Moves` from where the arc begins to where it ends, both included.
    centre : (k, 2) array, mm
        Rounded to 0.001 mm.
    sweep : (k,) array, radians
        Angle that it passes, counter-clockwise from above; 0 for a straight line.
    """

    first: IntArray
    last: IntArray
    centre: FloatArray
    sweep: FloatArray

    def __post_init__(self) -> None:
        freeze(self, first=int, last=int, centre=float, sweep=float)


KINDS: dict[str, DTypeLike] = {
    **dict.fromkeys(("event", "tool", "role"), np.int8),
    **dict.fromkeys(("layer", "strand"), np.int32),
    **dict.fromkeys(("place", "normal", "feed", "beside", "speed"), float),
    **dict.fromkeys(("width", "height", "amount"), float),
}
"""Kind of each column of `Moves`."""


@dataclass(frozen=True)
class Moves:
    """Moves and events of a print, in their order.

    Attributes
    ----------
    event : (n,) int array
        Index into `EVENTS`.
    place, normal : (n, 3) arrays, mm
        Position of the nozzle at the end of a row, rounded to 0.001 mm, and direction of its head.
    tool : (n,) int array
        0 for matrix, 1 for fibre; for an event of a tool, that tool.
    feed, beside : (n,) arrays, mm
        Filament that the row feeds: matrix by tool 0, fibre by tool 1; and matrix that the fibre
        head feeds with it.
    speed : (n,) array, mm/s
        Of moves, and of feeds without a move.
    width, height : (n,) arrays, mm
        Of the line that a move lays.
    amount : (n,) array
        Of an event: degrees Celsius, share of a fan, seconds, number of a layer or a path's length.
    role : (n,) int array
        Index into `ROLES`.
    layer : (n,) int array
    strand : (n,) int array
        Number of the strand that is laid; -1 for other rows, and for strands beside the part.
    arcs : Arcs, optional
        Chains of rows that firmware goes along as arcs.
    """

    event: IntArray
    place: FloatArray
    normal: FloatArray
    tool: IntArray
    feed: FloatArray
    beside: FloatArray
    speed: FloatArray
    width: FloatArray
    height: FloatArray
    amount: FloatArray
    role: IntArray
    layer: IntArray
    strand: IntArray
    arcs: Arcs | None = None

    __repr__ = in_brief

    def __post_init__(self) -> None:
        for name, kind in KINDS.items():
            object.__setattr__(self, name, shared_rows(getattr(self, name), kind))

    def __len__(self) -> int:
        return len(self.event)

    @property
    def start(self) -> FloatArray:
        """Where the nozzle is before each row, (n, 3)."""
        return np.concatenate([self.place[:1], self.place[:-1]])

    @property
    def length(self) -> FloatArray:
        """Distance that the nozzle moves in each row, (n,), mm."""
        return np.asarray(np.linalg.norm(self.place - self.start, axis=1))

    @property
    def in_part(self) -> BoolArray:
        """Rows that lay something of the part itself, (n,): no block, skirt or pad."""
        names = ("contour", "infill", "sparse", "fibre", "tail", "short")
        roles = [role(name) for name in names]
        beside = np.isin(self.role, [role("fibre"), role("tail")]) & (self.strand < 0)
        return (self.event == LAY) & np.isin(self.role, roles) & ~beside


# Arcs in place of chains of moves.


_LONGER = 1e-3
"""Share by which an arc may be longer than the moves that it replaces."""
_LEAST, _COMPACT = 3, 2
"""Moves that an arc replaces at least, as it is written in the space of two; in a compact file,
where it is written in less."""
_SPEEDS = 1e-2
"""Share by which the speeds of these moves may differ: the arc has the least of them."""
_LARGEST = 1000.0
"""Largest radius, mm: flatter arcs lose their way in the rounding of firmware."""
_SWEEP = np.radians(350.0)
"""Largest angle: one that ends where it starts would not be told from none."""


def with_arcs(moves: Moves, machine: Machine) -> Moves:
    """Find the arcs that stand for chains of moves; what is fed grows with the length.

    An arc begins and ends where the chain does, and is nowhere farther from it than
    `GcodeProfile.arc_tolerance`. It replaces level moves that lay the same line of matrix or fibre,
    at one speed to a hundredth, and is at most 0.1 % longer than they are. From each move on it is
    made as long as it can be. In a compact file a straight line may be such an arc, of no angle.
    """
    starts = moves.start[:, :2]
    laying = (moves.event == LAY) & (moves.place[:, 2] == moves.start[:, 2])
    about = (moves.tool, moves.role, moves.width, moves.height, moves.strand, moves.layer)
    same = laying[1:] & laying[:-1]
    for column in about:
        same &= column[1:] == column[:-1]
    # Chains: rows from `begins` to `ends`, both included.
    chain = np.flatnonzero(np.append(laying[:1], laying[1:] & ~same))
    ends = np.append(same, False)
    last = np.flatnonzero(laying & ~ends)
    arcs_of_chains: list[tuple[int, int, float, float, float]] = []
    for begin, end in zip(chain.tolist(), last.tolist(), strict=True):
        if end == begin:
            continue
        rows = slice(begin, end + 1)
        points = np.concatenate([starts[begin : begin + 1], moves.place[rows, :2]])
        arcs_of_chains += [
            (begin + arc.first, begin + arc.last, *arc.circle)
            for arc in _chain_arcs(points, moves.speed[rows], moves.feed[rows], machine.gcode)
        ]
    if not arcs_of_chains:
        return moves
    table = np.array(arcs_of_chains)
    arcs = Arcs(table[:, 0], table[:, 1], table[:, 2:4], table[:, 4])
    return _fed_along(moves, arcs)


def _fed_along(moves: Moves, arcs: Arcs) -> Moves:
    """Let moves feed for the length of their arcs, at one speed along each."""
    feed, beside, speed = moves.feed.copy(), moves.beside.copy(), moves.speed.copy()
    length, starts = moves.length, moves.start[:, :2]
    for first, last, centre, sweep in zip(
        arcs.first.tolist(), arcs.last.tolist(), arcs.centre, arcs.sweep.tolist(), strict=True
    ):
        rows = slice(first, last + 1)
        way = np.linalg.norm(starts[first] - (centre if sweep else moves.place[last, :2]))
        longer = float(way) * (abs(sweep) or 1.0) / float(length[rows].sum())
        feed[rows] *= longer
        beside[rows] *= longer
        speed[rows] = speed[rows].min()
    return replace(moves, feed=feed, beside=beside, speed=speed, arcs=arcs)


class _ChainArc(NamedTuple):
    """First and last move of an arc in a chain, its centre, mm, and its angle, radians."""

    first: int
    last: int
    circle: tuple[float, float, float]


def _chain_arcs(
    points: FloatArray, speeds: FloatArray, feed: FloatArray, profile: GcodeProfile
) -> list[_ChainArc]:
    """Arcs in a chain of moves between points (n, 2), each as long as it can be."""
    count, fed = len(speeds), np.append(0.0, np.cumsum(feed))
    least = _COMPACT if profile.compact else _LEAST
    if count < least:
        return []
    window = np.arange(count - least + 1)[:, None]
    firsts = points[window + np.arange(least + 1)], speeds[window + np.arange(least)]
    starts = np.flatnonzero(_fitted(*firsts, profile)[0])

    def fitted(first: int, moves: int) -> _ChainArc | None:
        """Arc of so many moves from one on; None where they are on none."""
        if first + moves > count or fed[first + moves] - fed[first] > profile.longest_feed:
            return None
        span = points[None, first : first + moves + 1], speeds[None, first : first + moves]
        good, circles = _fitted(*span, profile)
        x, y, sweep = circles[0].tolist()
        return _ChainArc(first, first + moves - 1, (x, y, sweep)) if good[0] else None

    arcs: list[_ChainArc] = []
    free = 0
    for start in starts.tolist():
        arc = fitted(start, least) if start >= free else None
        if arc is None:
            continue
        # Twice as many moves as long as they fit, then by halves between the last two numbers.
        fit, most = least, 2 * least
        while (longer := fitted(start, most)) is not None:
            arc, fit, most = longer, most, 2 * most
        while most - fit > 1:
            middle = (fit + most) // 2
            if (longer := fitted(start, middle)) is None:
                most = middle
            else:
                arc, fit = longer, middle
        arcs.append(arc)
        free = start + fit
    return arcs


def _fitted(
    points: FloatArray, speeds: FloatArray, profile: GcodeProfile
) -> tuple[BoolArray, FloatArray]:
    """Circles through the first and last of rows of points (m, k, 2), nearest to those between.

    Returns whether the arc may stand for the moves between them, (m,), and its centre and angle,
    (m, 3), which are zeros for a straight line.
    """
    tolerance = profile.arc_tolerance
    first, last = points[:, 0], points[:, -1]
    chord = last - first
    size = np.linalg.norm(chord, axis=1)
    along = chord / np.maximum(size, 1e-9)[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    middle = 0.5 * (first + last)
    off = points - middle[:, None]
    u, v = np.einsum("mki,mi->mk", off, along), np.einsum("mki,mi->mk", off, across)
    # Points at the distance of the ends from a centre on the perpendicular of the chord:
    # u^2 + v^2 - 2 v h = (size / 2)^2, for h by least squares.
    excess = u**2 + v**2 - (0.5 * size[:, None]) ** 2
    height = (v * excess).sum(axis=1) / np.maximum(2.0 * (v**2).sum(axis=1), 1e-12)
    centre = (middle + height[:, None] * across).round(COORDINATE_DIGITS)
    ray = points - centre[:, None]
    radius = np.linalg.norm(ray[:, 0], axis=1)
    halves = 0.5 * (ray[:, 1:] + ray[:, :-1])
    apart = [np.abs(np.linalg.norm(x, axis=2) - radius[:, None]).max(axis=1) for x in (ray, halves)]
    turn = np.arctan2(
        ray[:, :-1, 0] * ray[:, 1:, 1] - ray[:, :-1, 1] * ray[:, 1:, 0],
        np.einsum("mki,mki->mk", ray[:, :-1], ray[:, 1:]),
    )
    sweep = turn.sum(axis=1)
    length = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    good = (np.maximum(*apart) <= tolerance) & (radius <= _LARGEST) & (size > 1e-3)
    good &= (np.sign(turn) == np.sign(sweep)[:, None]).all(axis=1) & (np.abs(sweep) <= _SWEEP)
    good &= np.abs(radius * np.abs(sweep) / np.maximum(length, 1e-9) - 1.0) <= _LONGER
    circles = np.column_stack([centre, sweep])
    if profile.compact:
        straight = (np.abs(v).max(axis=1) <= tolerance) & (length <= (1.0 + _LONGER) * size)
        straight &= (np.diff(u, axis=1) > 0.0).all(axis=1)
        good, circles[straight] = good | straight, 0.0
    good &= speeds.max(axis=1) <= (1.0 + _SPEEDS) * speeds.min(axis=1)
    return good, circles
