"""Tracing lines through tetrahedra along a direction field, one from the centre of each seed."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, read_only
from ccfem.base.compiled import compiled
from ccfem.base.parallel import in_threads, processors
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity import cell_gradients

LONGEST = 100.0
"""Longest half of a line, in mean edge lengths (Fang et al. 2024, section 2.2)."""
_STEEP = 0.37
"""Share of the steepest slope from which a corner decides a line's sense. Cells of regular meshes
have slopes in simple ratios, so any value that is none of them serves."""
_MOST = 2000
"""Cells that a half of a line crosses at most."""

Part = TypeVar("Part")


@dataclass(frozen=True)
class Traced:
    """What lines met on their way, one line a seed.

    Attributes
    ----------
    seeds : (s,) int array
        Cells from whose centres the lines start, in both senses.
    touched : (s,) int array
        Bit k is set where the line crosses a cell of region k.
    length : (s,) array, mm
    ends : (s, 2) int array
        Why the two halves end: index into `ENDS`.
    """

    seeds: IntArray
    touched: IntArray
    length: FloatArray
    ends: IntArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "length", read_only(self.length))
        for name in ("seeds", "touched", "ends"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.int64))


@dataclass(frozen=True)
class Tracer:
    """A direction field on a mesh, ready for tracing.

    A line runs straight in each cell along its direction, which is a line without a sign: of the
    two senses it takes the one that turns it less. Where that points back out of the cell, the line
    slides along the face, or takes the other sense where the two fields are nearly square. It ends
    at the boundary, in a cell that it has crossed before, and when it is too long.

    Attributes
    ----------
    direction : (m, 3) array
        Unit vectors; zero where there is none.
    longest : float, mm
        Of each half of a line.
    """

    mesh: TetMesh
    direction: FloatArray
    longest: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", read_only(self.direction))

    @classmethod
    def of(cls, mesh: TetMesh, direction: FloatArray, longest: float | None = None) -> "Tracer":
        """Prepare a field; `longest` is 100 mean edge lengths unless given."""
        return cls(mesh, direction, LONGEST * mean_edge(mesh) if longest is None else longest)

    @cached_property
    def _order(self) -> IntArray:
        """Cells, (m,), in an order in which neighbours lie near each other.

        A line then finds most cells in the processor's cache: three times as quick (measured).
        """
        return _along_curve(self.mesh.centres)

    @cached_property
    def _place_of_cell(self) -> IntArray:
        """Place of each cell, (m,), in that order."""
        return np.argsort(self._order, kind="stable")

    @cached_property
    def _field(self) -> "_Field":
        """The field as the walk reads it."""
        mesh, order = self.mesh, self._order
        across, gradient = mesh.across[order], cell_gradients(mesh)[order]
        # Of two halves that meet, the first walked goes on: its sense follows the cell's corners,
        # so that it turns with the part. An eigenvector's sign does not.
        slope = np.einsum("mcd,md->mc", gradient, self.direction[order])
        steep = np.abs(slope) > _STEEP * np.abs(slope).max(axis=1, keepdims=True)
        decides = np.take_along_axis(slope, steep.argmax(axis=1)[:, None], axis=1)
        return _Field(
            self.direction[order] * np.where(decides < 0.0, -1.0, 1.0),
            np.where(across >= 0, self._place_of_cell[across], -1),
            mesh.points[mesh.corners[order]].mean(axis=1),
            gradient,
            float(self.longest),
        )

    def survey(self, seeds: IntArray, touching: IntArray) -> Traced:
        """Trace from the cells `seeds` (s,), and see which regions each line touches.

        Bit k of `touching` (m,) is set in the cells of region k, of at most 62.
        """
        order = np.argsort(self._place_of_cell[seeds], kind="stable")
        start, touching = self._place_of_cell[seeds][order], touching[self._order].astype(np.int64)
        mask, length = np.zeros(len(start), dtype=np.int64), np.zeros(len(start))
        ends = np.zeros((len(start), 2), dtype=np.int64)
        field = self._field

        def part(a: int, b: int) -> None:
            _survey(start[a:b], field, touching, mask[a:b], length[a:b], ends[a:b])

        _in_parts(part, len(start))
        back = np.argsort(order, kind="stable")
        return Traced(seeds, mask[back], length[back], ends[back])

    def crossings(self, seeds: IntArray) -> IntArray:
        """Count the lines from the seeds that cross each cell, (m,)."""
        start = np.sort(self._place_of_cell[seeds])
        field = self._field

        def part(a: int, b: int) -> IntArray:
            count = np.zeros(len(self.direction), dtype=np.int64)
            _count_crossings(start[a:b], field, count)
            return count

        count = np.sum(_in_parts(part, len(start)), axis=0, dtype=np.int64)
        return np.asarray(count)[self._place_of_cell]

    def lines(self, seeds: IntArray) -> list[FloatArray]:
        """Lines from the seeds as (n_i, 3) arrays, mm."""
        stamp = np.full(len(self.direction), -1, dtype=np.int64)
        return [_collect(int(k), self._field, stamp) for k in self._place_of_cell[seeds]]


def mean_edge(mesh: TetMesh) -> float:
    """Mean length of the edges of the cells, mm."""
    ends = mesh.points[mesh.corners[:, mesh.edges]]
    return float(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).mean())


def _along_curve(points: FloatArray) -> IntArray:
    """Order of points (n, 3) along the curve of Morton (1966)."""
    scaled = (points - points.min(axis=0)) / max(float(np.ptp(points, axis=0).max()), 1e-300)
    box = (scaled * 1023.0).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((box[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _in_parts(part: Callable[[int, int], Part], count: int) -> list[Part]:
    """Do a range of work in as many parts as there are processors, in order."""
    bounds = np.linspace(0, count, processors() + 1).astype(int).tolist()
    return in_threads(part, bounds[:-1], bounds[1:], most=None)


def trace(mesh: TetMesh, direction: FloatArray, seeds: IntArray) -> list[FloatArray]:
    """Trace lines (n_i, 3), mm, along a direction field from the centres of seeds (s,), both ways.

    Directions (m, 3) are unit vectors per cell, lines without a sign.
    """
    return Tracer.of(mesh, direction).lines(seeds)


# Walking along a direction field that is constant in each tetrahedron.


ENDS = ("boundary", "loop", "too long", "too many cells", "no direction")
BOUNDARY, LOOP, TOO_LONG, TOO_MANY, NO_DIRECTION = range(5)
"""Why a line ends."""

_TURNED = 0.2
"""Cosine below which a field that points back out of a cell is taken the other way round; above
it the line slides along the face."""
_STUCK = 1e-6
"""Share of the direction that must run along the face for the line to slide."""

_Vector = tuple[float, float, float]


class _Field(NamedTuple):
    """A direction field as the compiled walk reads it, its m cells along the curve.

    `direction` (m, 3), `centre` (m, 3) in mm, and for the corners of each cell the cell across from
    them, `across` (m, 4), -1 for none, and the `gradient` (m, 4, 3) of their barycentric
    coordinates, 1/mm; `longest` half of a line in mm.
    """

    direction: FloatArray
    across: IntArray
    centre: FloatArray
    gradient: FloatArray
    longest: float


class _Half(NamedTuple):
    """Room for half of a line: number of the last line in each cell, cells entered, points."""

    stamp: IntArray
    cells: IntArray
    points: FloatArray


@compiled
def _half(stamp: IntArray) -> _Half:
    return _Half(stamp, np.empty(_MOST + 1, np.int64), np.empty((_MOST + 2, 3)))


@compiled
def _dot(a: _Vector, b: _Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _gradient_of(gradient: FloatArray, cell: int, corner: int) -> _Vector:
    return gradient[cell, corner, 0], gradient[cell, corner, 1], gradient[cell, corner, 2]


# The two that follow are inlined into the walk: a tenth of its time (measured).
@compiled(inline="always")
def _heading(
    direction: FloatArray, gradient: FloatArray, cell: int, entry: int, before: _Vector
) -> _Vector:
    """Direction of a line in a cell that it enters across from a corner; zero where it has none."""
    x, y, z = direction[cell, 0], direction[cell, 1], direction[cell, 2]
    along = _dot((x, y, z), before)
    # Directions have no sign: of the two senses, that which turns the line less.
    if along < 0.0:
        x, y, z, along = -x, -y, -z, -along
    if entry < 0:
        return x, y, z
    g = _gradient_of(gradient, cell, entry)
    inward = _dot(g, (x, y, z))
    if inward > 0.0:
        return x, y, z
    # The sense points back out: the other one where both are nearly square to the line, else the
    # projection onto the face that it came through.
    if along < _TURNED:
        return -x, -y, -z
    share = inward / _dot(g, g)
    x, y, z = x - share * g[0], y - share * g[1], z - share * g[2]
    size = np.sqrt(_dot((x, y, z), (x, y, z)))
    if size < _STUCK:
        return 0.0, 0.0, 0.0
    return x / size, y / size, z / size


@compiled(inline="always")
def _exit(
    centre: FloatArray, gradient: FloatArray, cell: int, entry: int, at: _Vector, way: _Vector
) -> tuple[int, float]:
    """Corner across from which a line leaves a cell, and the length to there.

    Barycentric coordinates are 1/4 at the centre and fall linearly; the first to reach 0 decides.
    """
    off = at[0] - centre[cell, 0], at[1] - centre[cell, 1], at[2] - centre[cell, 2]
    leaving, step = -1, np.inf
    for corner in range(4):
        if corner == entry:
            continue
        g = _gradient_of(gradient, cell, corner)
        fall = -_dot(g, way)
        if fall > 0.0:
            length = max(0.25 + _dot(g, off), 0.0) / fall
            if length < step:
                leaving, step = corner, length
    return leaving, step


@compiled
def _walk(seed: int, sense: float, field: _Field, mark: int, half: _Half) -> tuple[int, float, int]:
    """Walk from the centre of a cell in one sense.

    Writes the cells entered, the seed first, and the points at which they are entered, the centre
    first and the last point after them; marks the cells. Returns the number of cells, the length
    and the reason of the end.
    """
    stamp, cells, points = half
    direction, across, centre, gradient, longest = field
    x, y, z = centre[seed, 0], centre[seed, 1], centre[seed, 2]
    way = sense * direction[seed, 0], sense * direction[seed, 1], sense * direction[seed, 2]
    cell, entry, number, length = seed, -1, 0, 0.0
    points[0, 0], points[0, 1], points[0, 2] = x, y, z
    while True:
        stamp[cell] = mark
        cells[number] = cell
        number += 1
        way = _heading(direction, gradient, cell, entry, way)
        step = 0.0
        if way != (0.0, 0.0, 0.0):
            leaving, step = _exit(centre, gradient, cell, entry, (x, y, z), way)
        x, y, z = x + step * way[0], y + step * way[1], z + step * way[2]
        length += step
        points[number, 0], points[number, 1], points[number, 2] = x, y, z
        if way == (0.0, 0.0, 0.0):
            return number, length, NO_DIRECTION
        if length > longest:
            return number, length, TOO_LONG
        following = across[cell, leaving]
        if following < 0:
            return number, length, BOUNDARY
        if stamp[following] == mark:
            return number, length, LOOP
        if number >= _MOST:
            return number, length, TOO_MANY
        entry = 0
        while across[following, entry] != cell:
            entry += 1
        cell = following


@compiled
def _survey(
    seeds: IntArray, field: _Field, touching: IntArray,
    mask: IntArray, length: FloatArray, ends: IntArray,
) -> None:  # fmt: skip
    """Trace from the seeds; write which regions each line touches, its length and its two ends."""
    half = _half(np.full(len(field.direction), -1, np.int64))
    for s in range(len(seeds)):
        for side in range(2):
            number, size, end = _walk(seeds[s], 1.0 - 2.0 * side, field, s, half)
            length[s] += size
            ends[s, side] = end
            for k in range(number):
                mask[s] |= touching[half.cells[k]]


@compiled
def _count_crossings(seeds: IntArray, field: _Field, count: IntArray) -> None:
    """Add one to each cell that a line from one of the seeds crosses."""
    half = _half(np.full(len(field.direction), -1, np.int64))
    for s in range(len(seeds)):
        for side in range(2):
            number, _, _ = _walk(seeds[s], 1.0 - 2.0 * side, field, s, half)
            # The second half begins in the cell of the first.
            for k in range(side, number):
                count[half.cells[k]] += 1


@compiled
def _collect(seed: int, field: _Field, stamp: IntArray) -> FloatArray:
    """Trace one line; return its points from end to end."""
    forth, back = _half(stamp), _half(stamp)
    n, _, _ = _walk(seed, 1.0, field, seed, forth)
    m, _, _ = _walk(seed, -1.0, field, seed, back)
    line = np.empty((m + n + 1, 3))
    for k in range(m + 1):
        line[k] = back.points[m - k]
    for k in range(1, n + 1):
        line[m + k] = forth.points[k]
    return line
