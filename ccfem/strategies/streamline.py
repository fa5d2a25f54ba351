"""Evenly spaced streamlines of the principal stress, unchanged: for comparison.

Wang et al. 2021 show three strategies beside their own; this is one of them, after V. S.
Papapetrou, C. Patel, A. Y. Tamijani, Stiffness-based optimization framework for the topology and
fiber paths of continuous fiber composites, Composites Part B 183 (2020) 107681.
The lines are those of B. Jobard, W. Lefer, Creating evenly-spaced streamlines of arbitrary density,
Visualization in Scientific Computing '97, Springer (1997) 43.
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import check_fields, check_number
from ccfem.base.compiled import compiled
from ccfem.base.errors import InputError
from ccfem.base.tensor import in_plane, strongest_in_plane
from ccfem.geometry.section_grid import SectionGrid, contains, section_grid
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.paths.fields.streamlines import LineField, direction_at, line_field, streamline_step
from ccfem.paths.planning import Amount
from ccfem.paths.planning.infill import SPACING, check_fill, long_enough
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress

_LEAST = 0.995
"""Least distance between lines, in fibre widths. At exactly one width rounding would end lines that
run side by side."""
_TOLERANCE = 2e-3
"""Error, in fibre widths, up to which points of a streamline are left out."""


@dataclass(frozen=True)
class Streamline:
    """Streamlines of the in-plane principal stress of largest absolute value.

    Lines end where they converge, and new ones begin where they diverge. Nothing joins them, and
    joints where the direction jumps stay open. Lines too short for the cutter are dropped.

    Attributes
    ----------
    spacing : float, default 1
        Distance from existing lines at which new lines begin, in fibre widths, at least 1.
    closest : float, default 0.5
        Distance at which lines end, in spacings; never less than a fibre width.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    """

    spacing: float = 1.0
    closest: float = 0.5
    minimum_length: float | None = None

    amount: ClassVar[Amount] = SPACING
    in_plane: ClassVar[bool] = True
    by_layer: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_fill(self)
        check_fields(self, "closest", at_least=0.1, at_most=0.95, unit="spacings")

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        width = machine.fibre_width
        least = machine.shortest_strand if self.minimum_length is None else self.minimum_length
        lines = evenly_spaced_streamlines(
            layer.plane.points,
            layer.triangles,
            in_plane(stress.nodal, layer.plane.frame),
            shapely.buffer(layer.plane.polygon, -0.5 * width),
            self.spacing * width,
            max(self.closest, _LEAST / self.spacing),
            least,
        )
        smooth = shapely.simplify([shapely.LineString(line) for line in lines], _TOLERANCE * width)
        paths = Toolpaths.from_plane([shapely.get_coordinates(line) for line in smooth], layer)
        return long_enough(paths, self.minimum_length, machine)


# Streamlines of the principal stress, evenly spaced.
#
# B. Jobard, W. Lefer, Creating evenly-spaced streamlines of arbitrary density, Visualization in
# Scientific Computing '97, Springer (1997) 43.


_STEP = 0.1
"""Step along a streamline, in separations."""
_EVENLY_LEAST = 0.03
"""As `least` of `streamlines`: below it rounding decides where a line goes."""
_SLACK = 1e-3
"""Share of the separation by which a new line may be too near, for rounding and finite steps."""
_MOST_POINTS = 20_000_000


def evenly_spaced_streamlines(
    points: FloatArray,
    triangles: IntArray,
    plane_stress: FloatArray,
    region: Region,
    separation: float,
    closest: float = 0.5,
    least_length: float = 0.0,
) -> list[FloatArray]:
    """Lines, a distance apart, along the principal stress of largest absolute value.

    The first line goes through the most stressed triangle. Others begin `separation` away from the
    points of existing lines, in the order of the lines. A line ends where it comes nearer than
    `closest` separations to another line or to itself, where it leaves the region, and where the
    stress has no direction. When no line is left to begin beside, the next one begins in the most
    stressed triangle that is a separation away from all lines. So separate parts of the region and
    of the field are reached too; the paper does not treat these.

    Parameters
    ----------
    points, triangles, plane_stress
        As in `streamlines`.
    region : shapely (Multi)Polygon, mm
        Lines stay in it.
    separation : float, mm
        Distance from existing lines at which new ones begin (d_sep), > 0.
    closest : float in (0, 1), default 0.5
        Least distance between lines, in separations (d_test / d_sep).
    least_length : float, mm, default 0
        Shorter lines are not laid and block no other line; never below one separation.

    Returns
    -------
    list of (m, 2) arrays, mm
        In the order in which they were found, in steps of a tenth of the separation. A line that
        returns to its start is closed: its last point is its first.
    """
    check_number("separation of streamlines", separation, above=0.0, unit="mm")
    check_number("closest", closest, above=0.0, below=1.0)
    if shapely.is_empty(region) or not len(triangles):
        return []
    middles = points[triangles].mean(axis=1)
    sizes = np.abs(strongest_in_plane(plane_stress)[0])
    seeds = np.argsort(-sizes[triangles].mean(axis=1), kind="stable")
    seeds = seeds[shapely.contains_xy(region, middles[seeds])]
    step = _STEP * separation
    room = 8.0 * float(region.area) / (closest * separation * step) + 1e5
    if room > _MOST_POINTS:
        raise InputError(
            f"a separation of {separation} mm gives too many streamlines on {region.area:.0f} "
            "mm^2: choose a larger one"
        )
    grid = section_grid(region, 2.0 * separation)
    section = _Section(
        line_field(points, triangles, plane_stress, _EVENLY_LEAST),
        grid,
        np.asarray(region.centroid.coords[0]),
        float(separation),
        closest * separation,
        step,
        float(max(least_length, separation)),
    )
    placed = _empty(grid, separation, int(room))
    traced, spans, closed = _lay(section, placed, middles[seeds], seeds)
    lines = []
    for (start, turn, end), ring in zip(spans, closed, strict=True):
        ahead, back = traced[start:turn], traced[turn:end]
        lines.append(np.concatenate([ahead, ahead[:1]] if ring else [back[::-1], ahead]))
    return lines


class _Section(NamedTuple):
    """Where lines run, and how far apart, mm.

    They keep `closest` from each other, begin `separation` apart, have points a `step` apart and
    are no shorter than `least`; `centre` (2,) says which way those from triangles run first.
    """

    field: LineField
    grid: SectionGrid
    centre: FloatArray
    separation: float
    closest: float
    step: float
    least: float


class _Placed(NamedTuple):
    """Points of lines, sorted into the cells of a grid.

    For each point: place `spot` (p, 2), unit direction `way` (p, 2), triangle `home`, arc length
    `along` from the seed (negative behind it), `line`, and the previous point in the same cell,
    `following`; `head` (nx, ny) is the last point of each cell.
    """

    spot: FloatArray
    way: FloatArray
    home: IntArray
    along: FloatArray
    line: IntArray
    following: IntArray
    head: IntArray
    origin: FloatArray
    cell: float


def _empty(grid: SectionGrid, cell: float, room: int) -> _Placed:
    extent = np.array(grid.room.shape) * grid.cell
    nx, ny = (np.floor(extent / cell) + 1).astype(int)
    return _Placed(
        np.empty((room, 2)),
        np.empty((room, 2)),
        np.empty(room, np.int64),
        np.empty(room),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.full((nx, ny), -1),
        grid.origin,
        cell,
    )


@compiled
def _lay(
    section: _Section, placed: _Placed, seeds: FloatArray, homes: IntArray
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Points of all lines, their (start, turn, end) among these, and whether each is closed.

    From start to turn the points run ahead of the seed, from turn to end back from it. Ahead is the
    direction of the line beside which a line begins, or else away from the centre, so that the
    order of lines does not depend on the orientation of the part.
    """
    _, grid, centre, apart, _, step, least = section
    way = np.zeros(2)
    spans = np.empty((len(placed.line) // 4, 3), np.int64)
    closed = np.zeros(len(spans), np.bool_)
    # Literals as arguments would have signatures of their own, compiled besides those of numbers.
    lines, count, no_line = np.int64(0), np.int64(0), np.int64(-1)
    looked = tried = 0
    while looked < 2 * count or tried < len(seeds):
        if looked < 2 * count:
            # On both sides of the points of lines.
            p, side = looked // 2, 1.0 - 2.0 * (looked % 2)
            x = placed.spot[p, 0] - side * apart * placed.way[p, 1]
            y = placed.spot[p, 1] + side * apart * placed.way[p, 0]
            home = placed.home[p]
            way[0], way[1] = placed.way[p, 0], placed.way[p, 1]
            looked += 1
        else:
            x, y = seeds[tried, 0], seeds[tried, 1]
            home = homes[tried]
            way[0], way[1] = x - centre[0], y - centre[1]
            tried += 1
        homing = lines < 0  # never
        taken = _crowded(placed, x, y, no_line, 0.0, apart * (1.0 - _SLACK), homing)
        if taken or not contains(grid, x, y):
            continue
        turn, end, ring = _trace(section, placed, count, lines, (x, y), way, home)
        if (end - count) * step < least:
            _take_back(placed, count, end)
            continue
        spans[lines, 0], spans[lines, 1], spans[lines, 2] = count, turn, end
        closed[lines] = ring
        lines += 1
        count = end
    return placed.spot[:count], spans[:lines], closed[:lines]


@compiled
def _trace(
    section: _Section,
    placed: _Placed,
    first: int,
    number: int,
    seed: tuple[float, float],
    way: FloatArray,
    home: int,
) -> tuple[int, int, bool]:
    """Add points of a line from its seed ahead and back; return both ends, and if it is closed.

    The numbers of the points start at `first`; ahead is roughly along `way`.
    """
    field, grid, _, _, closest, step, _ = section
    x0, y0 = seed
    dx, dy, home, fine = direction_at(field, home, x0, y0, -1.0, way)
    count = first
    if not fine:
        return count, count, False
    way[0], way[1] = dx, dy
    _add(placed, count, seed, way, home, 0.0, number)
    count += 1
    turn = count
    for sense in (1.0, -1.0):
        x, y, cell, along = x0, y0, home, 0.0
        way[0], way[1] = sense * dx, sense * dy
        while count < len(placed.line):
            x, y, cell, fine = streamline_step(field, cell, x, y, step, way)
            along += sense * step
            if not fine or not contains(grid, x, y):
                break
            # Back at the seed from behind: the line is closed.
            ahead = (x0 - x) * way[0] + (y0 - y) * way[1]
            aside = abs((x0 - x) * way[1] - (y0 - y) * way[0])
            homing = abs(along) > 4.0 * closest and aside < 0.2 * closest
            homing = homing and -step < ahead < 2.0 * closest
            if homing and ahead <= 0.5 * step and sense > 0.0:
                return count, count, True
            if _crowded(placed, x, y, number, along, closest, homing):
                break
            _add(placed, count, (x, y), way, cell, along, number)
            count += 1
        if sense > 0.0:
            turn = count
    return turn, count, False


@compiled
def _cell(placed: _Placed, x: float, y: float) -> tuple[int, int]:
    return int((x - placed.origin[0]) / placed.cell), int((y - placed.origin[1]) / placed.cell)


@compiled
def _add(
    placed: _Placed,
    p: int,
    spot: tuple[float, float],
    way: FloatArray,
    home: int,
    along: float,
    number: int,
) -> None:
    placed.spot[p, 0], placed.spot[p, 1] = spot
    placed.way[p, 0], placed.way[p, 1] = way[0], way[1]
    placed.home[p], placed.along[p], placed.line[p] = home, along, number
    i, j = _cell(placed, spot[0], spot[1])
    placed.following[p] = placed.head[i, j]
    placed.head[i, j] = p


@compiled
def _take_back(placed: _Placed, first: int, end: int) -> None:
    """Remove the points that were added last."""
    for p in range(end - 1, first - 1, -1):
        i, j = _cell(placed, placed.spot[p, 0], placed.spot[p, 1])
        placed.head[i, j] = placed.following[p]


@compiled
def _crowded(
    placed: _Placed, x: float, y: float, number: int, along: float, limit: float, homing: bool
) -> bool:
    """Whether a point of another line, or of another stretch of this one, is nearer than a limit.

    The stretch round the seed does not count for a line that returns to it. Line -1 has no points
    yet.
    """
    i, j = _cell(placed, x, y)
    nx, ny = placed.head.shape
    for a in range(max(i - 1, 0), min(i + 2, nx)):
        for b in range(max(j - 1, 0), min(j + 2, ny)):
            q = placed.head[a, b]
            while q >= 0:
                same = placed.line[q] == number
                beside = same and abs(placed.along[q] - along) < 2.0 * limit
                begun = same and homing and abs(placed.along[q]) < 4.0 * limit
                if not beside and not begun:
                    dx, dy = placed.spot[q, 0] - x, placed.spot[q, 1] - y
                    if dx * dx + dy * dy < limit * limit:
                        return True
                q = placed.following[q]
    return False
