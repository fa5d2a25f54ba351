"""What strands are worth at given strains, and the forces that draw them to where they are more.

To first order the compliance of a part falls by ``EA E`` where a stretched piece of fibre d of
length L is laid, with

    E = q^2 / L^3,  q = max(d . eps d, 0).

With the displacement of the part in equilibrium this is also what the compliance falls by when the
piece moves: the displacement's own change is of second order.
"""

from typing import NamedTuple

import numpy as np

from ccfem.arrays import FloatArray, IntArray
from ccfem.strand_moves.local_strain import StrainThere

__all__ = ["Worth", "worth_of"]


class Worth(NamedTuple):
    """What the pieces of strands are worth.

    Attributes
    ----------
    value : (s,) array, mm
        E of each piece.
    force : (P, 2) array
        Gradient of ``sum(E - price L)`` with respect to the points.
    """

    value: FloatArray
    force: FloatArray


def worth_of(points: FloatArray, starts: IntArray, there: StrainThere, price: float) -> Worth:
    """Find what pieces of strands are worth.

    Parameters
    ----------
    points : (P, 2) array, mm
        Of polylines.
    starts : (s,) int array
        Points that start a piece, which ends at the next one.
    there : StrainThere
        At the middles of the pieces.
    price : float
        Of a mm of fibre.
    """
    step = points[starts + 1] - points[starts]
    length = np.maximum(np.linalg.norm(step, axis=1), 1e-12)
    e1, e2, e12 = there.value.T
    strained = np.stack(
        [e1 * step[:, 0] + 0.5 * e12 * step[:, 1], 0.5 * e12 * step[:, 0] + e2 * step[:, 1]], 1
    )
    q = np.maximum((step * strained).sum(axis=1), 0.0)
    along = (4.0 * q / length**3)[:, None] * strained
    along -= (3.0 * q**2 / length**5 + price / length)[:, None] * step
    kinds = np.stack([step[:, 0] ** 2, step[:, 1] ** 2, step[:, 0] * step[:, 1]], axis=1)
    whole = (2.0 * q / length**3)[:, None] * np.einsum("si,sij->sj", kinds, there.slope)
    force = np.zeros_like(points)
    force[starts] += 0.5 * whole - along
    force[starts + 1] += 0.5 * whole + along
    return Worth(q**2 / length**3, force)
