"""One layer of prisms on a planform, symmetric where the planform is."""

from typing import Any

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing.planform import triangulate
from ccfem.geometry.symmetry import mirror_image, mirrors_of


def sheet_mesh(
    planform: Any, low: float, high: float, edge_length: float, keep: FloatArray
) -> tuple[TetMesh, IntArray]:
    """Mesh a planform by one layer of prisms, each cut into three tetrahedra.

    Parameters
    ----------
    planform : shapely Polygon, mm
    low, high : float, mm
        Along z.
    edge_length : float, mm
    keep : (k, 2) array, mm
        Points on the outline that become points of the mesh.

    Returns
    -------
    mesh : TetMesh
        Without patches; its own mirror image wherever the planform is.
    prism : (m,) int array
        Prism of each cell.
    """
    mirrors = mirrors_of(planform)
    left, bottom, right, top = planform.bounds
    middle = np.array([0.5 * (left + right), 0.5 * (bottom + top)])
    part = shapely.box(
        left,
        bottom,
        middle[0] if 0 in mirrors else right,
        middle[1] if 1 in mirrors else top,
    )
    quarter = shapely.intersection(planform, part) if mirrors else planform
    if quarter.geom_type != "Polygon":
        mirrors, quarter = (), planform
    folded = keep.copy()
    for axis in mirrors:
        folded[:, axis] = middle[axis] - np.abs(folded[:, axis] - middle[axis])
    points, triangles = triangulate(quarter, edge_length, folded)
    rank = np.arange(len(points))
    for axis in mirrors:
        points, triangles, rank = _mirrored(points, triangles, rank, planform, axis)
    n = len(points)
    # The diagonal on a side rises from the end of the higher rank: mirror images match.
    rising = np.take_along_axis(
        triangles, np.argsort(rank[triangles], axis=1, kind="stable"), axis=1
    )
    prism = np.concatenate([rising, rising + n], axis=1)
    cells = prism[:, [[0, 1, 2, 5], [0, 1, 4, 5], [0, 3, 4, 5]]].reshape(-1, 4)
    levels = np.repeat([low, high], n)
    points = np.column_stack([np.tile(points, (2, 1)), levels])
    inside_out = TetMesh(points, cells).volumes < 0.0
    cells[inside_out] = cells[inside_out][:, [0, 2, 1, 3]]
    return TetMesh(points, cells), np.repeat(np.arange(len(triangles)), 3)


def _mirrored(
    points: FloatArray, triangles: IntArray, rank: IntArray, planform: Any, axis: int
) -> tuple[FloatArray, IntArray, IntArray]:
    """Mesh with its mirror image beside it; points on the mirror are shared."""
    image = mirror_image(points, planform, axis)
    size = float(np.ptp(points, axis=0).max())
    away, nearest = cKDTree(points).query(image)
    shared = away <= 1e-9 * size
    number = np.where(shared, nearest, len(points) + np.cumsum(~shared) - 1)
    every = np.concatenate([points, image[~shared]])
    both = np.concatenate([triangles, number[triangles[:, [0, 2, 1]]]])
    return every, both, np.concatenate([rank, rank[~shared]])
