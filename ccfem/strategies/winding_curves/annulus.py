"""The field that winds: low on the holes and the curves that join them, 1 on the outer border."""

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.paths.fields.layer_elements import Surface, positive_definite

_NEAR = 0.3
"""Least distance between triangles that is used, over the median one."""


def annulus_field(
    surface: Surface,
    tension: FloatArray,
    isotropy: float,
    smoothness: float,
    fixed: IntArray,
    values: FloatArray,
) -> FloatArray:
    """Solve for the field whose level lines run along the tension, round the holes.

    Minimises ``sum_f A_f [grad s . (T_f + isotropy) grad s] + smoothness J(s)`` with given values
    on the holes, on the curves that join them and on the outer border; J is `gradient_jumps`. No
    level line ends inside, and none closes without going round the low region.

    Parameters
    ----------
    surface : Surface
        In space.
    tension : (t, 3, 3) array
        ``w t t^T`` with the direction t of the tension and its weight w.
    isotropy : float > 0
        Small values follow the tension closely, large ones give even spacing.
    smoothness : float >= 0, mm^2
        Weight of bends of the level lines.
    fixed : (k,) int array
        Points whose values are given.
    values : (k,) array

    Returns
    -------
    (n,) array
    """
    frames = surface.frames
    metric = np.einsum("tki,tij,tlj->tkl", frames, tension, frames) + isotropy * np.eye(2)
    matrix = surface.energy(surface.areas[:, None, None] * metric).tocsr()
    if smoothness > 0.0:
        matrix = matrix + smoothness * gradient_jumps(surface)
    field = np.zeros(len(surface.points))
    field[fixed] = values
    free = matrix.diagonal() > 0.0
    free[fixed] = False
    inside = np.flatnonzero(free)
    if len(inside):
        rows = sp.csr_array(matrix[inside])
        field[inside] = positive_definite(rows[:, inside]).solve(-(rows @ field))
    return field


def gradient_jumps(surface: Surface) -> sp.csr_array:
    """Matrix (n, n) of the form ``sum_e l/h (change of ds/dn)^2`` over the inner edges.

    l is the length of an edge and h the distance between the middles of its two triangles. The
    derivative is normal to the edge, with both triangles laid flat.
    """
    triangles, pairs, n = surface.triangles, surface.neighbours, len(surface.points)
    one, other = triangles[pairs[:, 0]], triangles[pairs[:, 1]]
    shared = (one[:, :, None] == other[:, None, :]).any(axis=2)
    ends = one[shared].reshape(-1, 2)
    edge = surface.points[ends[:, 1]] - surface.points[ends[:, 0]]
    length = np.linalg.norm(edge, axis=1)
    edge = edge / np.maximum(length, 1e-300)[:, None]
    middle = surface.points[triangles].mean(axis=1)
    apart = np.linalg.norm(middle[pairs[:, 0]] - middle[pairs[:, 1]], axis=1)
    apart = np.maximum(apart, _NEAR * np.median(apart)) if len(apart) else apart
    gradients = np.einsum("tid,tdk->tik", surface.gradients, surface.frames)
    normal = np.cross(surface.frames[:, 0], surface.frames[:, 1])
    weight = np.sqrt(length / apart)[:, None]
    sides = [
        weight * np.einsum("fik,fk->fi", gradients[side], np.cross(edge, normal[side]))
        for side in pairs.T
    ]
    row = np.tile(np.repeat(np.arange(len(pairs)), 3), 2)
    column = np.concatenate([one.ravel(), other.ravel()])
    value = np.concatenate([sides[0].ravel(), -sides[1].ravel()])
    jump = sp.coo_array((value, (row, column)), shape=(len(pairs), n)).tocsr()
    return sp.csr_array(jump.T @ jump)
