"""Consistent signs for a field of lines along a minimum spanning tree [Chen et al. 2021, Eq. 1]."""

import numpy as np
from numba import njit

from ccfem.base.arrays import BoolArray, FloatArray, IntArray


def orient(
    direction: FloatArray, pairs: IntArray, confidence: FloatArray | None = None
) -> FloatArray:
    """Flip vectors so that neighbours point the same way wherever possible.

    Signs are propagated along the minimum spanning tree of the weights ``1 - |v_i . v_j|``. Edges
    are taken in the order of their weight. The trees are joined by union-find, which stores the
    sign of every element relative to its root, so that no graph is traversed.

    Parameters
    ----------
    direction : (k, 2) or (k, 3) array
        Unit vectors.
    pairs : (e, 2) int array
        Neighbouring elements.
    confidence : (k,) array in [0, 1], optional
        Weights become ``1 - min(c_i, c_j) |v_i . v_j|``. If a field of lines cannot be oriented
        consistently, it flips across a cut. In a smooth field only the confidence tells where that
        cut does no harm.

    Returns
    -------
    (k, 2) or (k, 3) array
        `direction` or its opposite, element by element. Each connected component keeps the sign
        of its first element.
    """
    product = np.einsum("ij,ij->i", direction[pairs[:, 0]], direction[pairs[:, 1]])
    alike = np.abs(product)
    if confidence is not None:
        alike = np.minimum(confidence[pairs[:, 0]], confidence[pairs[:, 1]]) * alike
    order = np.argsort(1.0 - alike, kind="stable")
    return direction * _signs(len(direction), pairs[order], product[order] < 0.0)[:, None]


@njit(cache=True, nogil=True)
def _signs(count: int, pairs: IntArray, opposite: BoolArray) -> FloatArray:
    parent = np.arange(count)
    parity = np.zeros(count, np.bool_)  # relative to the parent
    root_of_pair = np.empty(2, np.int64)
    odd = np.empty(2, np.bool_)
    for e in range(len(pairs)):
        for side in range(2):
            element = pairs[e, side]
            turned = False
            while parent[element] != element:
                above = parent[element]
                parity[element] ^= parity[above] and parent[above] != above
                parent[element] = parent[above]
                turned ^= parity[element]
                element = parent[element]
            root_of_pair[side] = element
            odd[side] = turned
        a, b = root_of_pair[0], root_of_pair[1]
        if a != b:
            # The smaller index stays the root: the first element keeps its sign.
            if b < a:
                a, b = b, a
            parent[b] = a
            parity[b] = odd[0] ^ odd[1] ^ opposite[e]
    sign = np.ones(count)
    for start in range(count):
        element = start
        turned = False
        while parent[element] != element:
            turned ^= parity[element]
            element = parent[element]
        if turned:
            sign[start] = -1.0
    return sign
