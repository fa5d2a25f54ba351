"""Structured tetrahedral meshes of boxes, and of anything a box maps to."""

from itertools import permutations

import numpy as np

from ccfem.base.arrays import IntArray
from ccfem.base.checks import check_number
from ccfem.body.mesh.tet_mesh import TetMesh

_SIDES = ("x_min", "x_max", "y_min", "y_max", "z_min", "z_max")


def _kuhn_cells() -> IntArray:
    """Six tetrahedra of the unit cube by its corners (x + 2 y + 4 z), positively oriented."""
    cells = []
    for order in permutations((1, 2, 4)):
        corners = [0, order[0], order[0] + order[1], 7]
        axes = [int(np.log2(step)) for step in order]
        if np.linalg.det(np.eye(3)[axes]) < 0.0:
            corners[1], corners[2] = corners[2], corners[1]
        cells.append(corners)
    return np.array(cells)


def box_mesh(
    size: tuple[float, float, float],
    divisions: tuple[int, int, int],
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    alternating: bool = False,
) -> TetMesh:
    """Mesh of a box: every brick of a regular grid in six tetrahedra round its diagonal (Kuhn).

    Map its points (``dataclasses.replace(mesh, points=...)``) for other shapes.

    Parameters
    ----------
    size : tuple of 3 floats, mm
    divisions : tuple of 3 ints
        Bricks along x, y, z.
    origin : tuple of 3 floats, mm
        The corner of smallest coordinates.
    alternating : bool, default False
        Mirror every other brick along each axis, so that no diagonal is preferred: with an even
        number of bricks the mesh is its own mirror image.

    Returns
    -------
    TetMesh
        Linear; cells brick by brick, six each, bricks and nodes numbered along x first; patches
        x_min, x_max, y_min, y_max, z_min, z_max.
    """
    for length, count in zip(size, divisions, strict=True):
        check_number("size of a box", length, above=0.0, unit="mm")
        check_number("divisions of a box", count, at_least=1)
    nx, ny, nz = divisions
    axes = [o + s * np.arange(d + 1) / d for o, s, d in zip(origin, size, divisions, strict=True)]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    numbers = np.arange(len(points)).reshape(nz + 1, ny + 1, nx + 1)
    corner = numbers[:-1, :-1, :-1].reshape(-1)
    step = np.array([0, 1, nx + 1, nx + 2])
    offsets = np.concatenate([step, step + (nx + 1) * (ny + 1)])
    local = np.broadcast_to(_kuhn_cells(), (len(corner), 6, 4))
    if alternating:
        up, back, right = np.meshgrid(*(np.arange(d) % 2 for d in divisions[::-1]), indexing="ij")
        mirrored = (right + 2 * back + 4 * up).reshape(-1, 1, 1)
        odd = ((right + back + up) % 2 == 1).reshape(-1)
        local = local ^ mirrored
        local[odd] = local[odd][:, :, [0, 2, 1, 3]]
    cells = (corner[:, None, None] + offsets[local]).reshape(-1, 4)
    mesh = TetMesh(points, cells)
    place = np.stack(np.unravel_index(np.arange(len(points)), numbers.shape)[::-1], axis=1)
    facets = place[mesh.boundary]
    patches = {}
    for k, name in enumerate(_SIDES):
        axis, level = k // 2, (k % 2) * divisions[k // 2]
        patches[name] = mesh.boundary[(facets[:, :, axis] == level).all(axis=1)]
    return mesh.with_patches(patches)
