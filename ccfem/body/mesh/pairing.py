"""Which facets of which tetrahedra lie on each other."""

import numpy as np

from ccfem.base.arrays import IntArray
from ccfem.geometry.facets import facet_keys

FREE, CROWDED, FOLDED = -1, -2, -3
"""A facet without a partner; one that more than two cells have; one with both cells on one side."""


def pair_facets(corners: IntArray, faces: IntArray) -> IntArray:
    """Partner of every facet: the facet of the neighbouring cell that has the same nodes.

    Parameters
    ----------
    corners : (m, 4) int array
        Positively oriented cells.
    faces : (4, 3) int array
        Corners of the facet opposite to each corner, outward.

    Returns
    -------
    (4 m,) int array
        ``4 * cell + facet`` of the partner; `FREE` on the boundary; `CROWDED` where more than two
        cells have the facet; `FOLDED` where two cells that have it lie on the same side of it.
    """
    facets = corners[:, faces].reshape(-1, 3)
    (key,) = facet_keys(facets)
    order = np.argsort(key, kind="stable")
    alike = np.diff(key[order]) == 0
    one, other = order[:-1][alike], order[1:][alike]
    # Cells on either side of a facet list its nodes in opposite senses.
    a, b, c = facets.T
    odd = (a > b) ^ (b > c) ^ (a > c)
    folded = odd[one] == odd[other]
    partner = np.full(len(facets), FREE)
    partner[one] = np.where(folded, FOLDED, other)
    partner[other] = np.where(folded, FOLDED, one)
    crowd = np.flatnonzero(alike[:-1] & alike[1:])
    partner[order[crowd[:, None] + np.arange(3)]] = CROWDED
    return partner
