"""What is wrong with a mesh, the mesh mended as far as that is safe, and walls too coarse."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.checks import FARTHEST
from ccfem.base.errors import InputError
from ccfem.body.mesh.curved_cells import unfolded
from ccfem.body.mesh.patches import match_boundary
from ccfem.body.mesh.tet_mesh import FREE, TetMesh
from ccfem.geometry.facets import are_among, connected, facet_keys, signed_volumes

_FLAT = 1e-12
"""Volume over the cube of the longest edge, at and below which a cell counts as flat."""
_SLIVER = 100.0
"""Longest edge over height from which a cell makes the equations ill-conditioned."""
_TURNED = {4: [0, 2, 1, 3], 10: [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]}
"""Order of nodes that turns a cell inside out (corners 1 and 2 swapped)."""


@dataclass(frozen=True)
class MeshReport:
    """What `check_mesh` found, and what it did about it.

    Attributes
    ----------
    nodes, cells : int
        Left in the mesh.
    turned : int
        Cells that were inside out: turned.
    flat, repeated : int
        Cells without volume, and cells that repeat another: taken out.
    unused : int
        Nodes that no cell uses: taken out.
    moved : int
        Mid-side nodes of cells that their curved sides fold: moved to the middle of their edge.
    farthest : float, mm
        The longest of these moves.
    dropped : int
        Facets of patches that are not on the boundary: taken out.
    empty : tuple of str
        Patches that have no facet on the boundary: left as they are.
    coincident : int
        Nodes that lie on another one: merged where asked for.
    merged : bool
        Whether they were merged.
    hanging : int
        Nodes on a facet or a side of another cell without being a node of it: the part is not
        joined there.
    components : int
        Separate pieces of the mesh: left as they are.
    diagonal : float, mm
        Of the bounding box.
    aspect : float
        Longest edge over least height of the cells, median.
    """

    nodes: int
    cells: int
    turned: int = 0
    flat: int = 0
    repeated: int = 0
    unused: int = 0
    moved: int = 0
    farthest: float = 0.0
    dropped: int = 0
    empty: tuple[str, ...] = ()
    coincident: int = 0
    merged: bool = False
    hanging: int = 0
    components: int = 1
    diagonal: float = 0.0
    aspect: float = 0.0

    @property
    def findings(self) -> tuple[str, ...]:
        """One line for each thing worth knowing; empty for a sound mesh."""
        together = "merged" if self.merged else "left apart (merge them to join the pieces)"
        lines = (
            (self.turned, f"{self.turned} cells were inside out: turned"),
            (self.flat, f"{self.flat} cells had no volume: taken out"),
            (self.repeated, f"{self.repeated} cells repeated another: taken out"),
            (self.unused, f"{self.unused} nodes belonged to no cell: taken out"),
            (
                self.moved,
                f"{self.moved} mid-side nodes of folded cells moved to the middle of their edge, "
                f"by up to {self.farthest:.3g} mm: mesh curved walls finer where that is too far",
            ),
            (self.dropped, f"{self.dropped} patch facets were not on the boundary: left out"),
            (self.empty, f"patches without a facet on the boundary: {', '.join(self.empty)}"),
            (self.coincident, f"{self.coincident} nodes lie on another one: {together}"),
            (
                self.hanging,
                f"{self.hanging} nodes hang on a facet of another cell that they are no corner of: "
                "the part is not joined there",
            ),
            (self.components > 1, f"the mesh falls into {self.components} separate pieces"),
            (
                self.aspect > _SLIVER,
                f"most cells are some {self.aspect:.3g} times as long as high: check that all "
                "lengths are in mm",
            ),
        )
        return tuple(text for wanted, text in lines if wanted)


def check_mesh(mesh: TetMesh, merge: bool = False) -> tuple[TetMesh, MeshReport]:
    """Mend a mesh and say what was found.

    Cells are turned to positive volume; flat and repeated cells, unused nodes and patch facets
    inside the part are taken out; sides of quadratic cells may be curved, but those of cells that
    fold are made straight. Separate pieces stay.

    Parameters
    ----------
    merge : bool, default False
        Merge nodes that lie on each other (to 1e-9 of the diagonal). By default they are only
        counted: they may be a cut that is meant.

    Returns
    -------
    mesh : TetMesh
        The same object when there was nothing to mend.
    report : MeshReport

    Raises
    ------
    InputError
        For an invalid mesh: a coordinate of a used node is not finite, all cells are flat, cells
        overlap, or pieces to be merged have meshes that do not match.
    """
    used = np.zeros(len(mesh.points), dtype=bool)
    used[mesh.cells] = True
    check_coordinates(mesh.points, used)
    diagonal = float(np.linalg.norm(np.ptp(mesh.points[used], axis=0)))
    leader, coincident = _leaders(mesh.points, used, diagonal)
    merged = merge and coincident > 0
    cells = leader[mesh.cells] if merged else np.array(mesh.cells)
    keep, flat, repeated, turned = _sort_out(mesh.points, cells)
    cells[turned] = cells[turned][:, _TURNED[cells.shape[1]]]
    points, moved, farthest = _unfolded(mesh.points, cells[keep])
    changed = merged or moved > 0 or bool(turned.any()) or not keep.all()
    mended = TetMesh(points, cells[keep], walls=mesh.walls) if changed else mesh
    _check_faces(mended)
    hanging = hanging_nodes(mended)
    if merged and len(hanging):
        at = ", ".join(f"{x:.4g}" for x in mended.points[hanging[0]])
        raise InputError(
            f"the pieces cannot be joined: {len(hanging)} nodes hang on a facet of another cell "
            f"that they are no corner of, the first at ({at}) mm: mesh the pieces together, or "
            "leave them apart"
        )
    groups = {name: leader[f] if merged else f for name, f in _checked_patches(mesh).items()}
    patches, dropped = _patches(mended, groups, cells[~keep][:, :4])
    empty = tuple(sorted(name for name, facets in patches.items() if not len(facets)))
    still = np.zeros(len(points), dtype=bool)
    still[mended.cells] = True
    report = MeshReport(
        nodes=int(still.sum()),
        cells=int(keep.sum()),
        turned=int((turned & keep).sum()),
        flat=flat,
        repeated=repeated,
        unused=int((~used).sum()),
        moved=moved,
        farthest=farthest,
        dropped=dropped,
        empty=empty,
        coincident=coincident,
        merged=merged,
        hanging=len(hanging),
        components=_components(mended.corners, len(points)),
        diagonal=diagonal,
        aspect=float(np.median(mended.aspects)),
    )
    if not changed and still.all() and not dropped:
        return mesh, report
    number = np.cumsum(still) - 1
    named = {name: number[facets] for name, facets in patches.items()}
    return TetMesh(points[still], number[mended.cells], named, mesh.axes, mesh.walls), report


def about_slivers(mesh: TetMesh) -> str:
    """Say how flat the flattest cell is, with the cure; empty where none is very flat."""
    worst = int(mesh.aspects.argmax())
    if not mesh.aspects[worst] > _SLIVER:
        return ""
    at = ", ".join(f"{x:.4g}" for x in mesh.points[mesh.corners[worst]].mean(axis=0))
    return (
        f"the flattest cell, at ({at}) mm, is {mesh.aspects[worst]:.3g} times as long as high: "
        "check that all lengths are in mm, or mesh the part with cells of more even shape"
    )


def check_coordinates(points: FloatArray, used: BoolArray) -> None:
    """Refuse used nodes whose coordinates are not finite, or those of another scale."""
    wrong = np.flatnonzero(used & ~np.isfinite(points).all(axis=1))
    if len(wrong):
        raise InputError(
            f"mesh coordinates must be finite; {len(wrong)} nodes have NaN or infinity, the first "
            f"is node {wrong[0]} (from 0): repair the file"
        )
    far = np.flatnonzero(used & (np.abs(points) > FARTHEST).any(axis=1))
    if len(far):
        raise InputError(
            f"mesh coordinates must lie within {FARTHEST:g} mm; {len(far)} nodes lie farther, the "
            f"first is node {far[0]} (from 0): repair the file, or correct its scale"
        )


def _leaders(points: FloatArray, used: BoolArray, diagonal: float) -> tuple[IntArray, int]:
    """For each node the one that stands for all those on its spot; the number of others."""
    nodes = np.flatnonzero(used)
    grid = np.round(points[nodes] / max(1e-9 * diagonal, 1e-300)) + 0.0
    order = np.lexsort(grid.T)
    same = np.concatenate([[False], (np.diff(grid[order], axis=0) == 0).all(axis=1)])
    heads = np.maximum.accumulate(np.where(same, 0, np.arange(len(order))))
    leader = np.arange(len(points))
    leader[nodes[order]] = nodes[order][heads]
    return leader, int(same.sum())


def _checked_patches(mesh: TetMesh) -> Mapping[str, IntArray]:
    """Patches of the mesh, once their node numbers are known to be right."""
    for name, facets in mesh.patches.items():
        if facets.shape != (len(facets), 3) or not (
            not len(facets) or (facets.min() >= 0 and facets.max() < len(mesh.points))
        ):
            raise InputError(
                f"patch '{name}' must hold facets (k, 3) of nodes 0 to {len(mesh.points) - 1}; "
                f"got shape {facets.shape}: check the file"
            )
    return mesh.patches


def _sort_out(points: FloatArray, cells: IntArray) -> tuple[BoolArray, int, int, BoolArray]:
    """Cells to keep, numbers of flat and of repeated ones, and which are inside out."""
    corner = points[cells[:, :4]]
    edges = corner[:, TetMesh.edges[:, 1]] - corner[:, TetMesh.edges[:, 0]]
    longest = np.sqrt(np.einsum("ijk,ijk->ij", edges, edges).max(axis=1))
    volumes = signed_volumes(points, cells[:, :4])
    flat = np.abs(volumes) <= _FLAT * longest**3
    if flat.all():
        raise InputError(
            f"all {len(cells)} cells of the mesh are flat (no volume): mesh a solid body, not a "
            "surface"
        )
    nodes = np.sort(cells[:, :4], axis=1)
    order = np.lexsort(nodes.T)
    again = np.concatenate([[False], (np.diff(nodes[order], axis=0) == 0).all(axis=1)])
    repeated = np.zeros(len(cells), dtype=bool)
    repeated[order] = again
    repeated &= ~flat
    return ~flat & ~repeated, int(flat.sum()), int(repeated.sum()), volumes < 0.0


def _unfolded(points: FloatArray, cells: IntArray) -> tuple[FloatArray, int, float]:
    """Points with the middles of folded cells on their chords; how many moved, and how far."""
    if cells.shape[1] == 4:
        return points, 0, 0.0
    mended = unfolded(points, cells, np.unique(cells[:, 4:]))
    gap = np.linalg.norm(mended - points, axis=1)
    moved = int(np.count_nonzero(gap))
    return (mended, moved, float(gap.max())) if moved else (points, 0, 0.0)


def _check_faces(mesh: TetMesh) -> None:
    """Raise when more than two cells share a face, or two on one side of it."""
    crowded = np.flatnonzero(mesh.partners < FREE)
    if not len(crowded):
        return
    faces = mesh.corners[crowded[:, None] // 4, TetMesh.faces[crowded % 4]]
    at = ", ".join(f"{x:.4g}" for x in mesh.points[faces[0]].mean(axis=0))
    count = len(np.unique(facet_keys(faces)[0]))
    raise InputError(
        f"{count} faces of the mesh belong to more than two cells, or "
        f"to two on one side of them, the first at ({at}) mm: cells overlap, mesh the part again"
    )


def _components(corners: IntArray, nodes: int) -> int:
    """Count the pieces that hang together through nodes."""
    piece = connected(corners[:, [[0, 1], [0, 2], [0, 3]]].reshape(-1, 2), nodes)
    return len(np.unique(piece[corners[:, 0]]))


def _patches(
    mended: TetMesh, groups: Mapping[str, IntArray], removed: IntArray
) -> tuple[dict[str, IntArray], int]:
    """Patches on the boundary of the mended mesh, and the number of facets dropped.

    Where a flat cell on the boundary was taken out, the faces under it take over its patches.
    """
    patches, dropped = {}, 0
    for name, facets in groups.items():
        kept = match_boundary(mended, facets)
        lost = len(facets) - len(kept)
        if lost and len(removed):
            faces = removed[:, TetMesh.faces].reshape(-1, 3)
            carries = are_among(faces, facets).reshape(-1, 4).any(axis=1)
            both = np.concatenate([facets, faces[np.repeat(carries, 4)]])
            kept = match_boundary(mended, both)
            lost = max(len(facets) - len(kept), 0)
        patches[name] = kept
        dropped += lost
    return patches, dropped


# Nodes that lie on a facet of a cell without being a node of it, so that nothing joins them.


_TOUCH = 1e-6
"""Distance from a facet, over its longest side, within which a node lies on it."""


def hanging_nodes(mesh: TetMesh) -> IntArray:
    """Nodes of the boundary (k,) that hang on a boundary facet, inside it or on one of its sides.

    In a mesh whose cells meet face to face there are none, unless pieces touch that are meant to be
    apart. Nodes that lie on a corner of the facet are no hanging ones, but coincident. Of a
    quadratic mesh the corners are looked at; its middles follow them.
    """
    facets = mesh.boundary
    nodes = np.unique(facets)
    corners = mesh.points[facets]
    centre = corners.mean(axis=1)
    reach = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    tree = cKDTree(mesh.points[nodes])
    near = tree.query_ball_point(centre, (1.0 + _TOUCH) * reach, return_sorted=False)
    facet = np.repeat(np.arange(len(facets)), [len(near_nodes) for near_nodes in near])
    node = nodes[np.concatenate([np.asarray(near_nodes, dtype=np.int64) for near_nodes in near])]
    other = (facets[facet] != node[:, None]).all(axis=1)
    facet, node = facet[other], node[other]
    return np.unique(node[_lies_on(mesh.points[node], *np.moveaxis(corners[facet], 1, 0))])


def _lies_on(
    points: FloatArray, first: FloatArray, second: FloatArray, third: FloatArray
) -> BoolArray:
    """Whether each point (k, 3) lies on its triangle, and not on a corner of it."""
    e, f, g = second - first, third - first, points - first
    ee, ff, ef = _dot(e, e), _dot(f, f), _dot(e, f)
    ge, gf = _dot(g, e), _dot(g, f)
    size = np.maximum(np.maximum(ee, ff), ee + ff - 2.0 * ef)
    area = ee * ff - ef * ef
    proper = area > 1e-12 * size * size
    area = np.where(proper, area, 1.0)
    s, t = (ff * ge - ef * gf) / area, (ee * gf - ef * ge) / area
    weights = np.stack([1.0 - s - t, s, t])
    off = g - s[:, None] * e - t[:, None] * f
    inside = (weights.min(axis=0) >= -_TOUCH) & (weights.max(axis=0) <= 1.0 - _TOUCH)
    return proper & inside & (_dot(off, off) <= _TOUCH**2 * size)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.einsum("ij,ij->i", a, b)


# A body so small or large that its coordinates look like those of another unit.


_SMALL = 1.0
"""Diagonal, mm, below which lengths look like metres: a strand is about as wide."""
_INCHES = 10.0
"""Diagonal, mm, below which lengths may be inches: no part with fibre is so small."""
_LARGE = 1e4
"""Diagonal, mm, above which lengths may be micrometres."""


def in_metres(points: FloatArray) -> str:
    """Say that the lengths of a body look like metres, and the cure; nothing where they do not.

    Parameters
    ----------
    points : (n, 3) array, mm

    Examples
    --------
    >>> in_metres([[0.0, 0.0, 0.0], [0.03, 0.04, 0.0]])
    'the body is only 0.05 mm across: if it is in metres, set scale = 1000 (or --scale 1000)'
    >>> in_metres([[0.0, 0.0, 0.0], [30.0, 40.0, 0.0]])
    ''
    """
    across = float(np.linalg.norm(np.ptp(points, axis=0)))
    if across >= _SMALL:
        return ""
    return (
        f"the body is only {across:.3g} mm across: if it is in metres, "
        "set scale = 1000 (or --scale 1000)"
    )


def about_size(points: FloatArray) -> str:
    """Say that the lengths of a body may be in another unit, and the cure; nothing otherwise.

    Parameters
    ----------
    points : (n, 3) array, mm

    Examples
    --------
    >>> about_size([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    'the body is only 5 mm across: if it is in inches, set scale = 25.4 (or --scale 25.4)'
    >>> about_size([[0.0, 0.0, 0.0], [3e4, 4e4, 0.0]])
    'the body is 5e+04 mm across: if it is in micrometres, set scale = 0.001 (or --scale 0.001)'
    """
    across = float(np.linalg.norm(np.ptp(points, axis=0)))
    if across > _LARGE:
        return (
            f"the body is {across:.3g} mm across: if it is in micrometres, "
            "set scale = 0.001 (or --scale 0.001)"
        )
    if _SMALL <= across < _INCHES:
        return (
            f"the body is only {across:.3g} mm across: if it is in inches, "
            "set scale = 25.4 (or --scale 25.4)"
        )
    return in_metres(points)


# Walls with one cell across, found along rays from the surface into the part.


_STEPS = 12
"""Cells that a ray is followed through: more than three are not those of one layer."""
_MIDDLE = 0.15
"""Share of the thickness from either face beyond which a node lies within the wall."""
_FACING = np.cos(np.radians(25.0))
"""Cosine of the angle up to which two faces are those of one wall."""
_SHARE, _SQUARES = 0.02, 4.0
"""Least area of a wall: as a share of the surface, and over the square of its thickness."""


@dataclass(frozen=True)
class CoarseWall:
    """Walls with one cell across.

    Attributes
    ----------
    thickness : float, mm
        Median by area.
    edge : float, mm
        Longest edge of their cells, likewise.
    share : float
        Of the surface of the part that is theirs.
    place : (3,) array, mm
        A point on one of median thickness.
    """

    thickness: float
    edge: float
    share: float
    place: FloatArray

    def __post_init__(self) -> None:
        freeze(self, place=float)


def coarse_wall(mesh: TetMesh) -> CoarseWall | None:
    """Find walls with one cell across; None where all have more, but for a patch of the surface.

    A ray from the middle of each boundary facet goes straight into the part. Where it comes out at
    a face that lies opposite, without a node near it halfway, one cell lies across.
    """
    facets = np.flatnonzero(mesh.partners < 0)
    area, normal = mesh.facet_areas(mesh.facets[facets])
    ray, thickness = _rays_across(mesh, facets, normal)
    single = area[ray]
    if not len(ray) or single.sum() < _SHARE * area.sum():
        return None
    middle = _median(thickness, single)
    if single.sum() < _SQUARES * thickness[middle] ** 2:
        return None
    cells = mesh.points[mesh.corners[facets[ray] // 4]]
    ends = cells[:, mesh.edges]
    edge = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=1)
    return CoarseWall(
        thickness=float(thickness[middle]),
        edge=float(edge[_median(edge, single)]),
        share=float(single.sum() / area.sum()),
        place=mesh.points[mesh.facets[facets[ray[middle]]]].mean(axis=0),
    )


def _median(values: FloatArray, weights: FloatArray) -> int:
    """Index of the weighted median of values (k,)."""
    order = np.argsort(values, kind="stable")
    return int(order[np.searchsorted(np.cumsum(weights[order]), 0.5 * weights.sum())])


def _rays_across(
    mesh: TetMesh, facets: IntArray, normal: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Rays (k,), as rows of the boundary facets, with one cell across; the thickness there, mm."""
    points, corners = mesh.points, mesh.corners
    outside = np.zeros(len(points), dtype=bool)
    outside[mesh.facets[facets]] = True
    layer: BoolArray = np.asarray(outside[corners].all(axis=1))  # may reach from face to face
    ray = np.flatnonzero(layer[facets // 4])
    cell, entry = facets[ray] // 4, facets[ray] % 4
    start = points[mesh.facets[facets]].mean(axis=1)
    depth = np.zeros(len(ray))
    levels: list[tuple[IntArray, FloatArray]] = []
    ended, thickness, last = [], [], []
    for _ in range(_STEPS):
        corner, along = points[corners[cell]], -normal[ray]
        levels.append((ray, np.einsum("rci,ri->rc", corner - start[ray][:, None], along)))
        # Barycentric coordinates fall along the ray; the first that is used up is the way out.
        frame = np.linalg.inv(np.swapaxes(corner[:, 1:] - corner[:, :1], 1, 2))
        here = start[ray] + depth[:, None] * along
        value = np.einsum("rij,rj->ri", frame, here - corner[:, 0])
        slope = np.einsum("rij,rj->ri", frame, along)
        value = np.column_stack([1.0 - value.sum(axis=1), value])
        slope = np.column_stack([-slope.sum(axis=1), slope])
        left = np.full(slope.shape, np.inf)
        np.divide(value, -slope, out=left, where=slope < 0.0)
        rows = np.arange(len(ray))
        left[rows, entry] = np.inf
        way = left.argmin(axis=1)
        depth = depth + np.maximum(left[rows, way], 0.0)
        behind = mesh.partners[4 * cell + way]
        out: BoolArray = np.asarray(behind < 0)
        ended.append(ray[out])
        thickness.append(depth[out])
        last.append((4 * cell + way)[out])
        on = ~out
        on[on] = layer[behind[on] // 4]
        ray, depth, cell, entry = ray[on], depth[on], behind[on] // 4, behind[on] % 4
        if not len(ray):
            break
    across, thick = np.concatenate(ended), np.concatenate(thickness)
    _, opposite = mesh.facet_areas(mesh.facets[np.concatenate(last)])
    facing = np.einsum("ki,ki->k", normal[across], opposite) < -_FACING
    span = np.full(len(facets), np.nan)
    span[across[facing]] = thick[facing]
    for rays, level in levels:
        with np.errstate(invalid="ignore"):
            share = level / span[rays][:, None]
            between = ((share > _MIDDLE) & (share < 1.0 - _MIDDLE)).any(axis=1)
        span[rays[between]] = np.nan
    single = np.flatnonzero(np.isfinite(span))
    return single, span[single]
