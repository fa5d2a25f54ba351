"""Strands in the mesh: every fibre path cut where it passes from one cell to the next."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, in_brief
from ccfem.base.compiled import compiled
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.geometry.locate import Buckets, bucket
from ccfem.geometry.polylines import starts_segment
from ccfem.judging.virtual_testing.strand_room import StrandParts, room_of, strand_parts
from ccfem.machine.machine import Machine
from ccfem.paths.planning import GivenPaths, Strategy
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer


@dataclass(frozen=True)
class Strands:
    """Straight pieces of fibre, each inside one cell, in the order of the paths.

    A piece that lies on a face or an edge belongs to all cells round it in equal shares: it comes
    once a cell, with its length divided by their number, so that lengths add up.

    Attributes
    ----------
    cell : (s,) int array
        Cell of the mesh that holds each piece.
    length : (s,) array, mm
    tangent : (s, 3) array
        Unit vectors along the path.
    path : (s,) int array
        Index of the path in the toolpaths.
    arc : (s,) array, mm
        Arc length of the path at the middle of the piece.
    middle : (s, 3) array, mm
    outside : float, mm
        Length of fibre, links left out, that lies outside the mesh and carries nothing.
    share : (s,) array in [0, 1]
        How much of its stiffness each piece lends: fibre on other fibre, outside the part and in
        folds lends nothing (`ccfem.judging.virtual_testing.strand_room`).
    """

    cell: IntArray
    length: FloatArray
    tangent: FloatArray
    path: IntArray
    arc: FloatArray
    middle: FloatArray
    outside: float
    share: FloatArray

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, cell=int, path=int, length=float, tangent=float)
        freeze(self, arc=float, middle=float, share=float)

    def __len__(self) -> int:
        return len(self.cell)

    def __getstate__(self) -> dict[str, object]:
        """State for another process, which applies the pieces to its mesh anew."""
        return {name: value for name, value in vars(self).items() if name != "bars"}

    @classmethod
    def none(cls) -> "Strands":
        """Return no fibre at all."""
        none, points, numbers = np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
        return cls(numbers, none, points, numbers, none, points, 0.0, none)

    @property
    def total(self) -> float:
        """Length of fibre inside the mesh, mm."""
        return float(self.length.sum())


_STORED = 2**18
"""Pieces of fibre up to which paths store them: some 200 bytes each, with what bars need."""


def whole_strands(toolpaths: Toolpaths, mesh: TetMesh) -> Strands:
    """Cut fibre paths of which all counts in full, as `cut_strands` does.

    The paths store what was cut for the last mesh, if that is not much: plans are tested against
    one another again and again.
    """
    known: tuple[TetMesh, Strands] | None = toolpaths.__dict__.get("strands")
    if known is not None and known[0] is mesh:
        return known[1]
    strands = cut_strands(toolpaths, mesh)
    if len(strands) <= _STORED:
        toolpaths.__dict__["strands"] = mesh, strands
    return strands


def cut_strands(
    toolpaths: Toolpaths,
    mesh: TetMesh,
    most_outside: float = 0.01,
    machine: Machine | None = None,
    layers: Sequence[Layer] = (),
    crosses: bool = True,
    parts: StrandParts | None = None,
) -> Strands:
    """Cut the fibre paths at the faces of the cells.

    Parameters
    ----------
    toolpaths : Toolpaths
        Fibre paths are cut, other kinds left out. Links outside the mesh are left out too: beyond
        the part they are cut off, and over a void nothing embeds them.
    mesh : TetMesh
        Quadratic cells are taken as straight-sided.
    most_outside : float in [0, 1], default 0.01
        Share of the fibre length, links left out, that may lie outside the mesh.
    machine : Machine, optional
        Its strands need room: those of about the same direction that lie nearer than its fibre
        width share it; and what is folded by its least radius carries nothing. Default: every
        strand counts in full, wherever it lies.
    layers : sequence of Layer
        That the paths lie on: width outside them carries nothing. Default: all width is inside.
    crosses : bool, default True
        Whether strands carry where they lie across other strands: those of strategies that plan so.
    parts : StrandParts, optional
        Of these paths, machine and layers, if they are known already.

    Returns
    -------
    Strands
        Their lengths add up to the length of the paths inside the mesh; relative error below
        1e-9, also for paths along faces, along edges and through nodes.

    Raises
    ------
    InputError
        When there is no fibre, or none but links outside the mesh; or when more of it than allowed
        lies outside.
    """
    fibre = np.repeat(toolpaths.kind == FIBRE, np.diff(toolpaths.offsets))
    first_point = np.flatnonzero(fibre & starts_segment(toolpaths.offsets))
    path = np.searchsorted(toolpaths.offsets, first_point, side="right") - 1
    start = toolpaths.points.take(first_point, axis=0)
    step = toolpaths.points.take(first_point + 1, axis=0) - start
    length = np.linalg.norm(step, axis=1)
    if not length.sum() > 0.0:
        raise InputError(
            f"the virtual test needs fibre; got {len(toolpaths)} paths and 0 mm of fibre: "
            "lower the least amount that the strategy lays, or test the unreinforced part"
        )
    cut = cut_steps(start, step, length, mesh)
    outside = _length_outside(cut, length, toolpaths.link[first_point], most_outside)
    # Arc length of the path at the start of each step, then at the ends of each piece.
    before = np.cumsum(length) - length
    before -= before[np.searchsorted(path, path)]
    size = length[cut.step]
    first, last = (before[cut.step] + at * size for at in (cut.begin, cut.end))
    lent = np.ones(len(cut.step))
    if machine is not None:
        parts = strand_parts(toolpaths, machine, layers) if parts is None else parts
        lent = room_of(toolpaths, path[cut.step], first, last, parts, crosses)
    middle = 0.5 * (cut.begin + cut.end)
    unit = step / np.maximum(length, 1e-300)[:, None]
    return Strands(
        cell=cut.cell,
        length=(cut.end - cut.begin) * size * cut.share,
        tangent=unit.take(cut.step, axis=0),
        path=path[cut.step],
        arc=before[cut.step] + middle * size,
        middle=start.take(cut.step, axis=0) + middle[:, None] * step.take(cut.step, axis=0),
        outside=outside,
        share=lent,
    )


def _length_outside(
    cut: "CutSteps", length: FloatArray, link: BoolArray, most_outside: float
) -> float:
    """Length of steps, links left out, that lies outside the mesh, mm; an error for too much."""
    strands = np.where(link, 0.0, length)
    if not len(cut.step) and not strands.any():
        raise InputError(
            f"the virtual test needs fibre inside the mesh; got only {length.sum():.4g} mm of "
            "links outside it: lay strands, or mark as links only fibre that joins them"
        )
    inside = float(((cut.end - cut.begin) * strands[cut.step] * cut.share).sum())
    outside = max(float(strands.sum()) - inside, 0.0)
    if outside > most_outside * strands.sum():
        raise InputError(
            f"fibre must lie inside the mesh; {outside:.4g} mm of {strands.sum():.4g} mm lie "
            f"outside ({100 * outside / strands.sum():.3g} %, allowed {100 * most_outside:g} %): "
            "give paths and mesh in the same frame and unit"
        )
    return outside


def carrying_strands(
    toolpaths: Toolpaths,
    strategy: Strategy,
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    parts: StrandParts | None = None,
) -> Strands:
    """Strands of a strategy in a mesh, with what of them carries, as a comparison tests them.

    Parameters
    ----------
    toolpaths : Toolpaths
        Strands as they are printed (`ccfem.paths.splitting.printed_strands`).
    parts : StrandParts, optional
        As of `cut_strands`.
    """
    # Nobody knows whether those who planned given paths planned for the height of crossings.
    given = isinstance(strategy, GivenPaths)
    crosses = not given and bool(getattr(strategy, "crosses", False))
    return cut_strands(
        toolpaths, mesh, machine=machine, layers=layers, crosses=crosses, parts=parts
    )


# Means over a length of fibre, which depend little on the cells.


AVERAGING_LENGTH = 5.0
"""Length, mm, over which the force in a strand is averaged where it is held against its strength.

The strain jumps from cell to cell, so the highest force of all pieces is one cell's. From linear to
quadratic cells on one mesh of edges of 2 to 2.7 mm, with the published paths of Loop and pulled
Shell (Chen et al. 2021), it falls by 7 to 23 %; its mean over 2 mm changes by 1 to 11 %, and over 5
mm by 0 to 3 %. That is two edges, and as long as a strand needs to take up its force from the
matrix: 106 N over 2.2 mm of circumference at a pull-out strength of 10 to 20 MPa."""


@dataclass(frozen=True)
class Windows:
    """Stretches of equal length along strands, each from or to an end of a piece.

    Values that are constant in each piece have their largest mean over such a length in one of
    them. Lengths are counted in fibre that carries (`Strands.share`). Shorter paths count whole.
    """

    strands: Strands
    length: float = AVERAGING_LENGTH  # mm

    __repr__ = in_brief

    @cached_property
    def _reached(self) -> FloatArray:
        """Carrying length (s + 1,) up to the ends of the pieces, path after path."""
        weight = self.strands.length * self.strands.share
        return np.concatenate([[0.0], np.cumsum(weight)])

    @cached_property
    def bounds(self) -> FloatArray:
        """First and last carrying length (2 s, 2) of the windows, mm."""
        path, reached = self.strands.path, self._reached
        first = reached[np.searchsorted(path, path)]
        last = reached[np.searchsorted(path, path, side="right")]
        size = np.minimum(self.length, last - first)
        starts = (np.clip(at, first, last - size) for at in (reached[:-1], reached[1:] - size))
        start = np.concatenate(list(starts))
        return np.column_stack([start, start + np.tile(size, 2)])

    def means(self, values: FloatArray) -> FloatArray:
        """Mean (2 s,) over each window of a value (s,) of the pieces; 0 where nothing carries."""
        reached = self._reached
        total = np.concatenate([[0.0], np.cumsum(values * np.diff(reached))])
        first, last = self.bounds.T
        sums = np.interp(last, reached, total) - np.interp(first, reached, total)
        size = last - first
        return np.asarray(np.divide(sums, size, out=np.zeros_like(sums), where=size > 0.0))

    def overlap(self, window: int) -> tuple[IntArray, FloatArray]:
        """Pieces that a window covers, and the share of each that it covers."""
        first, last = self.bounds[window]
        low = int(np.searchsorted(self._reached, first, side="right")) - 1
        high = int(np.searchsorted(self._reached, last, side="left"))
        ends = np.clip(self._reached[low : high + 1], first, last)
        size = np.diff(self._reached[low : high + 1])
        share = np.divide(np.diff(ends), size, out=np.zeros_like(size), where=size > 0.0)
        return np.arange(low, high), share

    def highest(self, values: FloatArray) -> tuple[float, FloatArray]:
        """Largest mean of a value (s,) of the pieces, and the middle (3,) of its window."""
        means = self.means(values)
        window = int(means.argmax())
        return float(means[window]), self.middle(window)

    def middle(self, window: int) -> FloatArray:
        """Middle (3,) of a window, to within half a piece."""
        at = np.searchsorted(self._reached, self.bounds[window].mean(), side="right") - 1
        return self.strands.middle[min(at, len(self.strands) - 1)]


# Straight steps in the mesh, cut where they pass from one cell to the next.


_TOUCH = 1e-9
"""Barycentric distance within which a piece counts as lying on a face."""

_CLEAR = 1e-4
"""Barycentric distance from edges above which a step is followed from cell to cell: no other cells
touch it there."""

_SLIVER = 1e-12
"""Share of a step below which a piece is dropped."""


class CutSteps(NamedTuple):
    """Pieces of steps, each in one cell, in the order of the steps."""

    # (s,): step that each piece belongs to, and cell that holds the piece
    step: IntArray
    cell: IntArray
    # (s,) in [0, 1]: shares of the step at the ends of the piece
    begin: FloatArray
    end: FloatArray
    # (s,): 1 over the number of cells that hold the piece; it is listed once for each of them
    share: FloatArray


def cut_steps(start: FloatArray, step: FloatArray, length: FloatArray, mesh: TetMesh) -> CutSteps:
    """Cut steps at the faces of the cells.

    Parameters
    ----------
    start, step : (k, 3) arrays, mm
        Cutting is fastest where each step starts at the end of the one before.
    length : (k,) array, mm
        Of the steps.
    mesh : TetMesh
        Quadratic cells are taken as straight-sided.
    """
    tables = _tables(mesh)
    room = 4 * len(start) + 1024
    while True:
        whole, real = np.empty((room, 2), dtype=np.int64), np.empty((room, 3))
        count = _cut_at_faces(start, step, length, tables, whole, real)
        if count <= room:
            return CutSteps(*whole[:count].T, *real[:count].T)
        room = count


class _Tables(NamedTuple):
    """A mesh as steps are cut in it; its cells are numbered from 0 to m.

    `origin` (m, 3) are the first corners, `gradient` (m, 3, 3) those of the barycentric coordinates
    of the others, 1/mm, `across` (m, 4) the cells across from the corners, and `grid` has the cells
    by the boxes that each may touch.
    """

    origin: FloatArray
    gradient: FloatArray
    across: IntArray
    grid: Buckets


def _tables(mesh: TetMesh) -> _Tables:
    """Return the tables of a mesh that `_cut_at_faces` uses; the mesh stores them."""
    known = mesh.__dict__
    if "cut_tables" not in known:
        across = np.ascontiguousarray(mesh.across)
        known["cut_tables"] = _Tables(*_barycentric(mesh), across, _grid(mesh))
    tables: _Tables = known["cut_tables"]
    return tables


def _barycentric(mesh: TetMesh) -> tuple[FloatArray, FloatArray]:
    """First corner (m, 3) and gradients (m, 3, 3) of the other corners' barycentric coordinates."""
    corners = mesh.points[mesh.corners]
    a, b, c = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0)
    cross = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    return corners[:, 0].copy(), cross / np.einsum("ij,ij->i", a, cross[:, 0])[:, None, None]


def _grid(mesh: TetMesh) -> Buckets:
    """Cells of the mesh by the boxes of a regular grid that each may touch."""
    corners = mesh.points[mesh.corners]
    low, high = corners.min(axis=1), corners.max(axis=1)
    extent = np.prod(mesh.bounds[1] - mesh.bounds[0])
    # The second keeps the number of boxes near that of the cells in parts that are mostly empty.
    spacing = max(float(np.mean(high - low)), float(np.cbrt(extent / (4 * len(low)))))
    margin = 1e-6 * spacing
    return bucket(low - 2.0 * margin, high + margin, spacing)


@compiled
def _cut_at_faces(
    start: FloatArray,
    step: FloatArray,
    length: FloatArray,
    tables: _Tables,
    whole: IntArray,
    real: FloatArray,
) -> int:  # pragma: no cover
    """Write the pieces and return their number, which may exceed the room given.

    `whole` takes segment and cell; `real` takes begin, end (parameters in [0, 1]) and share. A step
    is followed from cell to cell where it keeps clear of edges; elsewhere all cells near it are
    tested.
    """
    # Of a plain constant, what takes it would be compiled once more.
    count, last = np.int64(0), np.int64(-1)
    met = np.empty(len(tables.origin), dtype=np.int64)
    ends = np.empty(2 * len(tables.origin) + 1)
    point, leap, middle = np.empty(3), np.empty(3), np.empty(3)
    for s in range(len(start)):
        # Parts no longer than a box of the grid, which then has few cells to test.
        steps = int(np.ceil(length[s] / tables.grid.cell))
        for part in range(steps):
            t0, t1 = part / steps, (part + 1) / steps
            for i in range(3):
                point[i] = start[s, i] + t0 * step[s, i]
                leap[i] = (t1 - t0) * step[s, i]
            passed = 0
            if last >= 0:
                passed = _walk(point, leap, last, tables, met, ends)
            u0 = 0.0
            for e in range(passed):
                begin, end = t0 + u0 * (t1 - t0), t0 + ends[e] * (t1 - t0)
                u0, last = ends[e], met[e]
                count = _write(whole, real, count, s, last, begin, end)
            if passed:
                continue
            number, size = _touching(point, leap, tables, met, ends)
            u0 = 0.0
            for e in range(size):
                u1 = ends[e]
                if u1 - u0 < _SLIVER:
                    continue
                # The piece up to here belongs, in equal shares, to all cells that hold its middle.
                for i in range(3):
                    middle[i] = point[i] + 0.5 * (u0 + u1) * leap[i]
                number = _complete(middle, tables, met, number)
                sharing = 0
                for f in range(number):
                    if _least_coordinate(middle, tables.origin, tables.gradient, met[f]) >= -_TOUCH:
                        met[sharing], met[f] = met[f], met[sharing]
                        sharing += 1
                begin, end = t0 + u0 * (t1 - t0), t0 + u1 * (t1 - t0)
                u0 = u1
                if sharing == 1:
                    last = met[0]
                    count = _write(whole, real, count, s, last, begin, end)
                    continue
                for f in range(sharing):
                    if count < len(whole):
                        whole[count, 0], whole[count, 1] = s, met[f]
                        real[count, 0], real[count, 1] = begin, end
                        real[count, 2] = 1.0 / sharing
                    count += 1
    return int(count)


@compiled
def _write(
    whole: IntArray, real: FloatArray, count: int, segment: int, cell: int, begin: float, end: float
) -> int:  # pragma: no cover
    """Write a piece inside a cell, or make the last one longer; return the number of pieces."""
    old = min(count, len(whole)) - 1
    if (
        old >= 0 and real[old, 1] == begin and real[old, 2] == 1.0
        and whole[old, 0] == segment and whole[old, 1] == cell
    ):  # fmt: skip
        real[old, 1] = end
        return count
    if count < len(whole):
        whole[count, 0], whole[count, 1] = segment, cell
        real[count, 0], real[count, 1], real[count, 2] = begin, end, 1.0
    return count + 1


@compiled
def _walk(
    point: FloatArray, step: FloatArray, cell: int, tables: _Tables, met: IntArray, ends: FloatArray
) -> int:  # pragma: no cover
    """Write the cells that a step passes, and where it leaves each; return the number of cells.

    The number is 0 where the step comes near an edge, runs along a face, or leaves the mesh.
    """
    origin, gradient, across, _ = tables
    value, slope = np.empty(4), np.empty(4)  # of the barycentric coordinates, the first one last
    number, here = 0, 0.0
    for _ in range(len(met)):
        # Barycentric coordinates along the step: value + u slope.
        value[3], slope[3] = 1.0, 0.0
        for i in range(3):
            a, b = 0.0, 0.0
            for j in range(3):
                a += gradient[cell, i, j] * (point[j] - origin[cell, j])
                b += gradient[cell, i, j] * step[j]
            value[i], slope[i] = a, b
            value[3] -= a
            slope[3] -= b
        # The step is inside where none of them is negative; one that falls to 0 is left across.
        begin, end, leaves = 0.0, 1.0, -1
        for i in range(4):
            if slope[i] > 0.0:
                begin = max(begin, -value[i] / slope[i])
            elif slope[i] < 0.0 and -value[i] / slope[i] < end:
                end, leaves = -value[i] / slope[i], i
        if abs(begin - here) > _SLIVER:
            return 0
        # Two coordinates near 0 at an end: it is near an edge, where other cells touch too.
        counts = end - here >= _SLIVER
        near, off = 0, 0
        for i in range(4):
            first = value[i] + here * slope[i]
            final = value[i] + end * slope[i]
            near += first < _CLEAR
            off += final < _CLEAR
            if first < -_CLEAR or (counts and 0.5 * (first + final) < 10.0 * _TOUCH):
                return 0
        if near > 1 or (counts and off > 1):
            return 0
        if counts:
            if number:
                ends[number - 1] = min(here, begin)
            met[number], ends[number] = cell, end
            number += 1
            here = end
        if leaves < 0 or 1.0 - end < _SLIVER:
            return number
        cell = across[cell, (leaves + 1) % 4]
        if cell < 0:
            return 0
    return 0


@compiled
def _least_coordinate(
    point: FloatArray, origin: FloatArray, gradient: FloatArray, cell: int
) -> float:  # pragma: no cover
    """Smallest barycentric coordinate of a point."""
    rest, least = 1.0, 1.0
    for i in range(3):
        v = 0.0
        for j in range(3):
            v += gradient[cell, i, j] * (point[j] - origin[cell, j])
        rest -= v
        least = min(least, v)
    return min(least, rest)


@compiled
def _complete(
    point: FloatArray, tables: _Tables, met: IntArray, number: int
) -> int:  # pragma: no cover
    """Add the cells that hold a point where rounding hid all of them; return the new number."""
    origin, gradient, _, grid = tables
    for f in range(number):
        if _least_coordinate(point, origin, gradient, met[f]) >= -_TOUCH:
            return number
    box = 0
    for i in range(3):
        at = int(np.floor((point[i] - grid.origin[i]) / grid.cell))
        if at < 0 or at >= grid.shape[i]:
            return number
        box = box * grid.shape[i] + at
    for c in range(grid.starts[box + 1] - 1, grid.starts[box] - 1, -1):
        if _least_coordinate(point, origin, gradient, grid.items[c]) >= -_TOUCH:
            met[number] = grid.items[c]
            number += 1
    return number


@compiled
def _touching(
    point: FloatArray, step: FloatArray, tables: _Tables, met: IntArray, ends: FloatArray
) -> tuple[int, int]:  # pragma: no cover
    """Cells that a step touches, and the sorted parameters of entry and exit, with 1."""
    origin, gradient, _, grid = tables
    corner, spacing, shape, offsets, candidates = grid
    low = np.empty(3, dtype=np.int64)
    high = np.empty(3, dtype=np.int64)
    for i in range(3):
        a = (point[i] - corner[i]) / spacing
        b = a + step[i] / spacing
        low[i] = max(int(np.floor(min(a, b))), 0)
        high[i] = min(int(np.floor(max(a, b))) + 1, shape[i])
    number, size = 0, 1
    ends[0] = 1.0
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            for k in range(low[2], high[2]):
                box = (i * shape[1] + j) * shape[2] + k
                for c in range(offsets[box + 1] - 1, offsets[box] - 1, -1):
                    cell = candidates[c]
                    u0, u1 = _inside(point, step, origin, gradient, cell)
                    known = u1 - u0 < _SLIVER
                    for f in range(number):
                        known = known or met[f] == cell
                    if known:
                        continue
                    met[number] = cell
                    number += 1
                    # Insertion keeps the parameters sorted: there are few.
                    for u in (u0, u1):
                        at = size
                        while at > 0 and ends[at - 1] > u:
                            ends[at] = ends[at - 1]
                            at -= 1
                        ends[at] = u
                        size += 1
    return number, size


@compiled
def _inside(
    point: FloatArray, step: FloatArray, origin: FloatArray, gradient: FloatArray, cell: int
) -> tuple[float, float]:  # pragma: no cover
    """Interval of parameters in [0, 1] within which a step is inside a cell."""
    u0, u1, rest, change = 0.0, 1.0, 1.0, 0.0
    for i in range(4):
        if i < 3:
            a, slope = 0.0, 0.0
            for j in range(3):
                a += gradient[cell, i, j] * (point[j] - origin[cell, j])
                slope += gradient[cell, i, j] * step[j]
            rest -= a
            change -= slope
        else:
            a, slope = rest, change
        # Barycentric coordinate at both ends: outside all along, on the face all along, or crossing
        # it.
        b = a + slope
        if a < -_TOUCH and b < -_TOUCH:
            return 1.0, 0.0
        if abs(a) <= _TOUCH and abs(b) <= _TOUCH:
            continue
        if slope > 0.0:
            u0 = max(u0, -a / slope)
        elif slope < 0.0:
            u1 = min(u1, -a / slope)
    return u0, u1
