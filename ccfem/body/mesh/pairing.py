"""Which facets of which tetrahedra lie on each other."""

import numpy as np
from numba import njit

from ccfem.base.arrays import IntArray, seen_only

FREE, CROWDED, FOLDED = -1, -2, -3
"""A facet without a partner; one that more than two cells have; one with both cells on one side."""


def pair_facets(corners: IntArray, faces: IntArray, nodes: int) -> IntArray:
    """Partner of every facet: the facet of the neighbouring cell that has the same nodes.

    Parameters
    ----------
    corners : (m, 4) int array
        Positively oriented cells.
    faces : (4, 3) int array
        Corners of the facet opposite to each corner, outward.
    nodes : int
        Number of nodes.

    Returns
    -------
    (4 m,) int array
        ``4 * cell + facet`` of the partner; `FREE` on the boundary; `CROWDED` where more than two
        cells have the facet; `FOLDED` where two cells that have it lie on the same side of it.
    """
    corners = seen_only(np.asarray(corners, dtype=np.int64))
    partner = np.full(4 * len(corners), FREE, dtype=np.int64)
    start = np.zeros(nodes + 2, dtype=np.int64)
    order = np.empty(4 * len(corners), dtype=np.int64)
    _pair(corners, seen_only(faces), start, order, partner)
    return partner


@njit(cache=True)
def _sorted_nodes(corners, faces, facet):  # type: ignore[no-untyped-def]
    """Nodes of a facet in ascending order, and whether that turns it round."""
    cell, k = facet // 4, facet % 4
    a, b, c = corners[cell, faces[k, 0]], corners[cell, faces[k, 1]], corners[cell, faces[k, 2]]
    odd = False
    if a > b:
        a, b, odd = b, a, not odd
    if b > c:
        b, c, odd = c, b, not odd
    if a > b:
        a, b, odd = b, a, not odd
    return a, b, c, odd


@njit(cache=True)
def _pair(corners, faces, start, order, partner):  # type: ignore[no-untyped-def]
    """Sort the facets into buckets by their lowest node, and pair them within each."""
    count = 4 * len(corners)
    for facet in range(count):
        start[_sorted_nodes(corners, faces, facet)[0] + 2] += 1
    for node in range(2, len(start)):
        start[node] += start[node - 1]
    for facet in range(count):
        lowest = _sorted_nodes(corners, faces, facet)[0]
        order[start[lowest + 1]] = facet
        start[lowest + 1] += 1
    for node in range(len(start) - 2):
        for at in range(start[node], start[node + 1]):
            facet = order[at]
            _, b, c, odd = _sorted_nodes(corners, faces, facet)
            for other in order[start[node] : at]:
                _, p, q, turned = _sorted_nodes(corners, faces, other)
                if p != b or q != c:
                    continue
                if partner[other] != -1 or partner[facet] != -1:
                    partner[facet] = -2
                    if partner[other] >= 0:
                        partner[partner[other]] = -2
                    partner[other] = -2
                elif odd == turned:
                    partner[facet] = partner[other] = -3
                else:
                    partner[facet], partner[other] = other, facet
