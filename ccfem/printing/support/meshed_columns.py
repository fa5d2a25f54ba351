"""The space below a part, between what hangs over and the part below it, or the bed, as columns.

H. Kipping, T. Schueppstuhl, Load-oriented nonplanar additive manufacturing method for optimized
continuous carbon fiber parts, Materials 16 (2023) 998, section 2.5, shift the cells that look down
to the bed and fill what they pass. Columns are that, and are exact on parts that stand on parts:
upright ones on a grid, or tetrahedra that share the faces of the part's cells where it hangs over.

Every hanging facet is the top of an upright column of tetrahedra, down to the bed or to the part
below. Columns are cut by the nodes on their three lines, always next to the highest one, so that
neighbours meet in whole faces, however many nodes each line has: the mesh conforms by construction,
and no mesher is asked. It does not conform to a part that it stands on: there the columns end on
the part at their lines alone, and cells that reach into the part are left out. Nor do columns that
come down beside a wall meet those below the wall in the same nodes: layers may be a little off
there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.locate import locate
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.printing.support.overhang import hanging_facets, overhang
from ccfem.slicing.layers.layer import plane_frame

# Upright columns on a square grid.


_OFF = 0.381966
"""Where columns stand between lines of the grid: off the corners and edges of parts."""
_MOST = 5e7
"""Crossings above which a pitch is taken for a mistake of units."""


@dataclass(frozen=True)
class SupportColumns:
    """Support as upright columns on a square grid.

    Attributes
    ----------
    place : (k, 2) array, mm
        Axes of the columns, across the build direction.
    low, high : (k,) arrays, mm
        Ends along the build direction.
    on_part : (k,) bool array
        Columns that stand on the part, not on the bed.
    pitch : float, mm
        Distance of the columns.
    contact : float, mm^2
        Area of the part that rests on them.
    """

    place: FloatArray
    low: FloatArray
    high: FloatArray
    on_part: BoolArray
    pitch: float
    contact: float

    def __post_init__(self) -> None:
        freeze(self, place=float, low=float, high=float, on_part=bool)

    def __repr__(self) -> str:
        return f"SupportColumns: {self.volume:.4g} mm^3, {self.contact:.4g} mm^2 of the part on it"

    @property
    def volume(self) -> float:
        """Volume of all columns, mm^3."""
        return float((self.high - self.low).sum()) * self.pitch**2

    @property
    def standing(self) -> float:
        """Area on which columns stand on the part, mm^2, seen along the build direction."""
        return float(self.on_part.sum()) * self.pitch**2


def support_columns(
    mesh: TetMesh,
    build: Sequence[float] = (0.0, 0.0, 1.0),
    angle: float = 0.0,
    lift: float = 0.0,
    pitch: float = 0.25,
) -> SupportColumns:
    """Find the space below a part that has to be filled while it is printed.

    Parameters
    ----------
    build : sequence of 3 floats, default z
        Build direction.
    angle : float in [0, 90), degrees, default 0
        Faces that lean over by more than this, from upright, need support: with 0 all that look
        down, as for layers that continue below the part; flat layers carry about 45 themselves.
    lift : float >= 0, mm, default 0
        Height of the lowest point of the part above the bed.
    pitch : float > 0, mm, default 0.25
        Distance of the columns.
    """
    check_number("angle", angle, at_least=0.0, below=90.0, unit="degrees")
    check_number("lift", lift, at_least=0.0, unit="mm")
    check_number("pitch", pitch, above=0.0, unit="mm")
    frame = plane_frame(tuple(build))
    turned = mesh.points @ frame.T
    bed = float(turned[np.unique(mesh.corners), 2].min()) - lift
    area, _, hanging = hanging_facets(mesh, frame, bed, angle, 1e-3 * pitch, 1e-9)
    grid = np.floor(turned[:, :2].min(axis=0) / pitch)
    facet, column, height = _crossings(turned[mesh.boundary], grid, pitch)
    order = np.lexsort((height, column[:, 1], column[:, 0]))
    facet, column, height = facet[order], column[order], height[order]
    above_part = np.zeros(len(facet), dtype=bool)
    above_part[1:] = (column[1:] == column[:-1]).all(axis=1)
    low = np.where(above_part, np.roll(height, 1), bed)
    filled = hanging[facet] & (height > low)
    place = (grid + column[filled] + _OFF) * pitch
    return SupportColumns(
        place, low[filled], height[filled], above_part[filled], pitch, float(area[hanging].sum())
    )


def _crossings(
    corners: FloatArray, grid: FloatArray, pitch: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Facet, column (c, 2) and height where columns pass through facets (f, 3, 3)."""
    flat = corners[:, :, :2] / pitch - grid - _OFF
    first = np.ceil(flat.min(axis=1)).astype(np.int64)
    count = np.maximum(np.floor(flat.max(axis=1)).astype(np.int64) - first + 1, 0)
    total = count.prod(axis=1)
    if total.sum() > _MOST:
        raise InputError(
            f"a pitch of {pitch:g} mm would make {float(total.sum()):.1g} columns on this part: "
            "give a larger pitch"
        )
    facet = np.repeat(np.arange(len(corners)), total)
    number = np.arange(len(facet)) - np.repeat(np.cumsum(total) - total, total)
    column = first[facet] + np.stack(np.divmod(number, np.maximum(count[facet, 1], 1)), axis=1)
    a, b, c = (flat[facet, k] for k in range(3))
    u, v, w = b - a, c - a, column - a
    twice = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    safe = np.where(twice == 0.0, 1.0, twice)
    second = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / safe
    third = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / safe
    inside = (twice != 0.0) & (second >= 0.0) & (third >= 0.0) & (second + third <= 1.0)
    facet, second, third = facet[inside], second[inside], third[inside]
    z = corners[facet, :, 2]
    height = z[:, 0] + second * (z[:, 1] - z[:, 0]) + third * (z[:, 2] - z[:, 0])
    return facet, column[inside], height


# Tetrahedra that share the faces of the part.


_INWARD = 1e-3
"""Share of the way to the middle of its hanging facets at which a line is looked along: just inside
the border of what hangs over, where it is told a hole's bottom from the open air."""
_STEEPEST = 0.02
"""Cosine to the build direction up to which facets count as upright."""
_FEWEST = 4
"""Cells of a column, but where it is lower than one cell."""
_GROWTH = 1.5
"""Height of a cell over that of the one above: the field is the smoother the farther down."""


@dataclass(frozen=True)
class ColumnMesh:
    """The space below a part.

    Attributes
    ----------
    mesh : TetMesh
        Its patches are "part", the faces that it shares with the part above, and "bed".
    node : (n,) int array
        Node of the part that each node is; -1 for those that are none.
    below : (n, 4) int array
        Corners of the cell of the part that each node stands on; -1 where it does not.
    share : (n, 4) array
        Share of each of these corners.
    on_bed : (n,) bool array
    contact : float, mm^2
        Area of the part that rests on it.
    standing : float, mm^2
        Area on which it stands on the part, seen along the build direction.
    up : (3,) array
        Build direction, of length 1.
    """

    mesh: TetMesh
    node: IntArray
    below: IntArray
    share: FloatArray
    on_bed: BoolArray
    contact: float
    standing: float
    up: FloatArray

    def __post_init__(self) -> None:
        freeze(self, node=int, below=int, share=float, on_bed=bool, up=float)

    def __repr__(self) -> str:
        return (
            f"ColumnMesh: {len(self.mesh.cells)} cells, {self.volume:.4g} mm^3, {self.contact:.4g} "
            "mm^2 of the part on it"
        )

    @property
    def volume(self) -> float:
        """Volume, mm^3."""
        return float(self.mesh.volumes.sum())


def column_mesh(
    mesh: TetMesh,
    build: Sequence[float] = (0.0, 0.0, 1.0),
    angle: float = 0.0,
    lift: float = 0.0,
    size: float | None = None,
    within: Region | None = None,
) -> ColumnMesh:
    """Mesh the space below a part that has to be filled while it is printed.

    Parameters
    ----------
    build : sequence of 3 floats, default z
        Build direction.
    angle : float, degrees, default 0
        Faces that lean over by more than this, from upright, need support.
    lift : float, mm, default 0
        Height of the lowest point of the part above the bed.
    size : float, mm, optional
        Height of the highest cells of a column, each below half as high again; by default the mean
        length of the sides of the facets above.
    within : (Multi)Polygon, mm, optional
        Seen along the build direction, in the frame of `ccfem.slicing.layers.layer.plane_frame`:
        only below facets whose middle lies in it.

    Raises
    ------
    InputError
        For an angle outside 0 to 90 degrees, a lift below 0 or a size that is not above 0; where
        nothing hangs over.
    """
    check_number("angle", angle, at_least=0.0, below=90.0, unit="degrees")
    check_number("lift", lift, at_least=0.0, unit="mm")
    frame = plane_frame(tuple(build))
    turned = mesh.points @ frame.T
    bed = float(turned[np.unique(mesh.corners), 2].min()) - lift
    reach = 1e-6 * float(np.ptp(turned, axis=0).max())
    area, lean, hanging = hanging_facets(mesh, frame, bed, angle, reach, _STEEPEST)
    if within is not None:
        hanging &= shapely.contains_xy(within, turned[mesh.boundary].mean(axis=1)[:, :2])
    if not hanging.any():
        raise InputError(
            f"no surface of the part overhangs by more than {angle:g} degrees: it needs no support"
        )
    facets = mesh.boundary[hanging]
    top, facets = np.unique(facets, return_inverse=True)
    facets = facets.reshape(-1, 3)
    head = turned[top]
    edges = head[facets] - head[np.roll(facets, 1, axis=1)]
    height = float(np.linalg.norm(edges, axis=2).mean()) if size is None else size
    check_number("size", height, above=0.0, unit="mm")
    foot, rests = _feet(head, facets, turned[mesh.boundary[lean > 0.0]], bed, reach)
    points, cells, line, low = _columns(head, foot, facets, height)
    inside = locate(turned, mesh.corners, points[cells].mean(axis=1))[0] >= 0
    cells = cells[~inside]
    below, share = _below(turned, mesh, points, low & rests[line], reach)
    on_bed = low & ~rests[line]
    node = np.full(len(points), -1)
    node[: len(top)] = top
    columns = _with_patches(points @ frame, cells, facets, on_bed)
    flat = points[facets][:, :, :2]
    u, v = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    shadow = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    standing = float(shadow @ rests[facets].mean(axis=1))
    contact = float(area[hanging].sum())
    return ColumnMesh(columns, node, below, share, on_bed, contact, standing, frame[2])


def propped_space(mesh: TetMesh, build: Sequence[float], machine: Machine) -> ColumnMesh | None:
    """Mesh the space that support below flat layers fills in a print; None where they need none.

    It stands below what `overhang` finds, as in `ccfem.printing.print_plan.plan_print`; there, it
    also keeps `support_gap` and `support_clearance` from the part.
    """
    hanging = overhang(mesh, build, machine)
    if hanging is None:
        return None
    return column_mesh(mesh, build, machine.limits.overhang, within=hanging.region)


def _feet(
    head: FloatArray, facets: IntArray, rising: FloatArray, bed: float, reach: float
) -> tuple[FloatArray, BoolArray]:
    """Height at which the line down from each node ends, and whether it ends on the part.

    `rising` are the corners (f, 3, 3) of the facets that look up. A node no higher than `reach`
    stands there itself, as one that rounding holds above the bed: its cells would have no volume.
    """
    count = np.bincount(facets.ravel(), minlength=len(head))
    middle = head[facets].mean(axis=1)
    mean = np.stack(
        [np.bincount(facets.ravel(), np.repeat(middle[:, d], 3), len(head)) for d in range(3)], 1
    )
    seen = head + _INWARD * (mean / count[:, None] - head)
    tree = shapely.STRtree(shapely.polygons(rising[:, :, :2]))
    line, facet = tree.query(shapely.points(seen[:, :2]), predicate="intersects")
    a, b, c = np.moveaxis(rising[facet], 1, 0)
    u, v, w = b - a, c - a, seen[line] - a
    twice = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    twice = np.where(np.abs(twice) > 0.0, twice, np.inf)
    z = (
        a[:, 2]
        + (
            (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) * u[:, 2]
            + (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) * v[:, 2]
        )
        / twice
    )
    under = np.isfinite(z) & (z < seen[line, 2])
    foot = np.full(len(head), bed)
    np.maximum.at(foot, line[under], z[under])
    rests = foot > bed
    return np.where(foot < head[:, 2] - reach, foot, head[:, 2]), rests


def _columns(
    head: FloatArray, foot: FloatArray, facets: IntArray, height: float
) -> tuple[FloatArray, IntArray, IntArray, BoolArray]:
    """Points, cells, line of each point, and whether a point is the lowest of its line."""
    drop = head[:, 2] - foot
    # Cells of height, growth * height ... add up to height * (growth^n - 1) / (growth - 1).
    reached = np.log1p((_GROWTH - 1.0) * drop / height) / np.log(_GROWTH)
    fewest = np.minimum(np.ceil(_FEWEST * drop / height), _FEWEST)
    count = np.maximum(np.ceil(reached - 1e-9), fewest).astype(np.int64)
    first = len(head) + np.cumsum(count) - count
    lines = np.arange(len(head))
    line = np.concatenate([lines, np.repeat(lines, count)])
    number = np.zeros(len(line))
    number[len(head) :] = np.arange(len(head), len(line)) - first[line[len(head) :]] + 1.0
    points, low = head[line].copy(), number == count[line]
    passed = (_GROWTH**number - 1.0) / np.maximum(_GROWTH ** count[line] - 1.0, _GROWTH - 1.0)
    points[:, 2] = np.where(low, foot[line], head[line, 2] - drop[line] * passed)
    # Every node of a facet's lines but the heads, from the highest down, makes one cell with the
    # nodes that its lines have reached by then.
    here = count[facets]
    rows = np.repeat(np.arange(len(facets)), here.sum(axis=1))
    corner = np.repeat(np.tile(np.arange(3), len(facets)), here.ravel())
    start = np.repeat(np.cumsum(here.ravel()) - here.ravel(), here.ravel())
    node = np.repeat(first[facets].ravel(), here.ravel()) + np.arange(len(corner)) - start
    order = np.lexsort((line[node], -points[node, 2], rows))
    corner, node = corner[order], node[order]
    begin = np.cumsum(here.sum(axis=1)) - here.sum(axis=1)
    cells = np.empty((len(node), 4), dtype=np.int64)
    for k in range(3):
        mine = corner == k
        before = np.append(np.cumsum(mine) - mine, mine.sum())
        been = before[:-1] - before[begin][rows]
        of = facets[rows, k]
        cells[:, k] = np.where(been > 0, first[of] + been - 1, of)
    cells[:, 3] = node
    return points, cells, line, np.asarray(low)


def _below(
    turned: FloatArray, mesh: TetMesh, points: FloatArray, on_part: BoolArray, reach: float
) -> tuple[IntArray, FloatArray]:
    """Corners of the part's cells on which nodes stand, and their shares."""
    below = np.full((len(points), 4), -1)
    share = np.zeros((len(points), 4))
    cell, weight = locate(turned, mesh.corners, points[on_part], reach=1e3 * reach)
    rows = np.flatnonzero(on_part)[cell >= 0]
    below[rows], share[rows] = mesh.corners[cell[cell >= 0]], weight[cell >= 0]
    return below, share


def _with_patches(
    points: FloatArray, cells: IntArray, facets: IntArray, on_bed: BoolArray
) -> TetMesh:
    bare = TetMesh(points, cells)
    border = bare.boundary
    bed = border[on_bed[border].all(axis=1)]
    return TetMesh(points, cells, {"part": facets, "bed": bed})
