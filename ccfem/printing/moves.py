"""All actions of a machine from the first line to the last: a table, one row a move or event."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, in_brief, shared_rows

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
