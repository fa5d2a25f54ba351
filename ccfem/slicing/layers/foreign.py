"""A layer from a surface made by another program."""

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.locate import locate
from ccfem.geometry.nearest_on_triangles import nearest_on_triangles
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.level_cut import border_edges, chain

_ON_PATCH = 0.6
"""Distance, mm, of both ends of a border edge from a patch up to which the edge lies on it."""


def layer_from_surface(
    mesh: TetMesh,
    points: FloatArray,
    triangles: IntArray,
    index: int,
    thickness: float,
    tolerance: float = 1.0,
) -> Layer:
    """Make a curved layer from a surface in a part.

    Parameters
    ----------
    mesh : TetMesh
        The part, whose stress the layer takes.
    points : (n, 3) array, mm
    triangles : (t, 3) int array
        Consistently oriented, counter-clockwise seen from the side on which material is added.
    index : int
        Position in the stack.
    thickness : float, mm
    tolerance : float, mm, default 1
        Largest distance by which points may lie outside the part.

    Raises
    ------
    InputError
        When more than 1 % of the points lie farther outside the part.
    """
    used, triangles = np.unique(triangles, return_inverse=True)
    points, triangles = points[used], triangles.reshape(-1, 3)
    holder, weights = locate(mesh.points, mesh.corners, points, tolerance)
    outside = holder < 0
    if outside.mean() > 0.01:
        raise InputError(
            f"{100 * outside.mean():.0f} % of the points of layer {index} lie more than "
            f"{tolerance:g} mm outside the part: is it in mm, and in the frame of the mesh?"
        )
    kept = ~outside[triangles].any(axis=1)
    used, triangles = np.unique(triangles[kept], return_inverse=True)
    points, triangles = points[used], triangles.reshape(-1, 3)
    holder, weights = holder[used], weights[used]
    middle = points[triangles].mean(axis=1)
    cell, _ = locate(mesh.points, mesh.corners, middle, tolerance)
    cell = np.where(cell < 0, holder[triangles[:, 0]], cell)
    border = border_edges(triangles, len(points))
    patches = {}
    for name, facets in mesh.patches.items():
        ends = nearest_on_triangles(mesh.points, facets, points[border.ravel()]).distance
        patches[name] = border[(ends.reshape(-1, 2) <= _ON_PATCH).all(axis=1)]
    return Layer(
        points=points,
        triangles=triangles,
        cell=cell,
        nodes=mesh.corners[holder],
        weights=weights,
        loops=chain(border),
        index=index,
        thickness=thickness,
        patches=patches,
    )
