"""Walls of a mesh with one cell across, found along rays from the surface into the part."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.body.mesh.tet_mesh import TetMesh

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
    """Find walls with one cell across.

    A ray from the middle of each boundary facet goes straight into the part. Where it comes out
    at a face that lies opposite, without a node near it halfway, one cell lies across.

    Returns
    -------
    CoarseWall, or None where all walls have more, but for a patch of the surface.
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
