"""The field that winds: 0 on the holes and the curves that join them, 1 on the outer border."""

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray, IntArray
from ccfem.fields.layer_elements import Surface, positive_definite

__all__ = ["annulus_field"]


def annulus_field(
    surface: Surface,
    tension: FloatArray,
    weight: FloatArray,
    inner: IntArray,
    outer: IntArray,
    isotropy: float,
) -> FloatArray:
    """Solve for the field whose level lines run along the tension, round the holes.

    Minimises ``sum_f A_f [w_f (t_f . grad s)^2 + isotropy |grad s|^2]`` with s = 0 at the inner
    points and s = 1 at the outer ones: no level line ends inside, and none closes on itself without
    going round what is inner.

    Parameters
    ----------
    surface : Surface
        In space.
    tension : (t, 3) array
        Unit vectors along the triangles; lines without a sign.
    weight : (t,) array
        Of the tension.
    inner, outer : int arrays
        Points.
    isotropy : float > 0
        The smaller, the closer to the tension; the larger, the more even.

    Returns
    -------
    (n,) array in [0, 1]
    """
    local = np.einsum("td,tkd->tk", tension, surface.frames)
    metric = weight[:, None, None] * local[:, :, None] * local[:, None, :]
    metric = surface.areas[:, None, None] * (metric + isotropy * np.eye(2))
    matrix = surface.energy(metric).tocsr()
    values = np.zeros(len(surface.points))
    values[outer] = 1.0
    free = np.ones(len(values), dtype=bool)
    free[inner] = free[outer] = False
    free &= matrix.diagonal() > 0.0
    inside = np.flatnonzero(free)
    if len(inside):
        known = matrix @ values
        rows = sp.csc_array(matrix[inside][:, inside])
        values[inside] = positive_definite(rows).solve(-known[inside])
    return values
