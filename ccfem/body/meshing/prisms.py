"""Prismatic parts: a triangulated planform, extruded and cut into tetrahedra."""

import numpy as np
import shapely
from scipy.sparse import coo_array

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.body.mesh.numbering import reverse_cuthill_mckee
from ccfem.body.mesh.round_walls import RoundWall
from ccfem.body.mesh.smooth_faces import round_walls, smooth_faces
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing.planform import triangulate

_MOST = 2e7
"""Number of cells above which a length is taken for a mistake of units."""

_SPLIT = np.array([[0, 1, 2, 5], [0, 1, 4, 5], [0, 3, 4, 5]])
"""Tetrahedra of a prism (bottom 0 1 2, top 3 4 5): side diagonals rise with the order."""


def extrude(
    polygon: shapely.Polygon,
    height: float,
    edge_length: float,
    layers: int | None = None,
    keep: FloatArray | None = None,
) -> TetMesh:
    """Mesh a prism on a planform in the x-y plane.

    Parameters
    ----------
    polygon : shapely Polygon, mm
        With or without holes.
    height : float, mm
        The part reaches from z = 0 to `height`.
    edge_length : float, mm
        Target edge length; shorter where the outline turns sharply (`triangulate`).
    layers : int, optional
        Layers of prisms over the height; by default as many as make them about `edge_length` high.
    keep : (k, 2) array, mm, optional
        Points on the outline that become points of the mesh.

    Returns
    -------
    TetMesh
        Linear, without patches. Each prism is cut into three tetrahedra. The diagonals on its
        sides follow a random order of the planform's points (with a fixed seed), reversed in
        every other layer, so that they favour no direction.
    """
    check_number("height", height, above=0.0, unit="mm")
    if layers is not None:
        check_number("layers of cells", layers, at_least=1)
    plane, triangles = triangulate(polygon, edge_length, keep)
    plane, triangles = _numbered_along(plane, triangles)
    count = layers or max(1, round(height / edge_length))
    expected = 3.0 * len(triangles) * count
    if expected > _MOST:
        raise InputError(
            f"a height of {height:g} mm in cells of {edge_length:g} mm would make about "
            f"{expected:.1g} cells: choose a longer edge length"
        )
    levels = count + 1
    points = np.empty((len(plane), levels, 3))
    points[:, :, :2] = plane[:, None]
    points[:, :, 2] = np.linspace(0.0, height, levels)
    rank = np.random.default_rng(0).permutation(len(plane))
    rising = np.take_along_axis(
        triangles, np.argsort(rank[triangles], axis=1, kind="stable"), axis=1
    )
    ordered = np.stack([rising[:, :: 1 - 2 * (level % 2)] for level in range(count)], axis=1)
    lower = ordered * levels + np.arange(count)[:, None]
    cells = np.concatenate([lower, lower + 1], axis=2)[:, :, _SPLIT].reshape(-1, 4)
    inside_out = TetMesh(points.reshape(-1, 3), cells).volumes < 0.0
    cells[inside_out] = cells[inside_out][:, [0, 2, 1, 3]]
    return TetMesh(points.reshape(-1, 3), cells, walls=_outline_walls(polygon, height))


def _outline_walls(polygon: shapely.Polygon, height: float) -> tuple[RoundWall, ...]:
    """Round walls of the prism on an outline as it was given, not as its mesh has it."""
    corners: list[FloatArray] = []
    triangles: list[IntArray] = []
    for ring in shapely.get_rings(shapely.orient_polygons(polygon)):
        low = np.pad(shapely.get_coordinates(ring)[:-1], ((0, 0), (0, 1)))
        start, here = sum(len(known) for known in corners), np.arange(len(low))
        after = np.roll(here, -1)
        above, after_above = here + len(low), after + len(low)
        corners += [low, low + np.array([0.0, 0.0, height])]
        triangles.append(start + np.stack([here, after, after_above], axis=1))
        triangles.append(start + np.stack([here, after_above, above], axis=1))
    points, sides = np.concatenate(corners), np.concatenate(triangles)
    return round_walls(points, sides, smooth_faces(points, sides))


def _numbered_along(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Points numbered so that neighbours have close numbers, triangles by their points."""
    n = len(points)
    ends = triangles[:, [0, 1, 2]].ravel(), triangles[:, [1, 2, 0]].ravel()
    graph = coo_array((np.ones(len(ends[0])), ends), shape=(n, n)).tocsr()
    graph = (graph + graph.T).tocsr()
    order = reverse_cuthill_mckee(graph.indptr, graph.indices)
    number = np.empty(n, dtype=np.int64)
    number[order] = np.arange(n)
    triangles = number[triangles]
    return points[order], triangles[np.argsort(triangles.min(axis=1), kind="stable")]
