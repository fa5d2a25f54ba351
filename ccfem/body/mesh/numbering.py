"""Numbers of nodes with which factors stay sparse: the same ones on every machine."""

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, repeated
from ccfem.base.compiled import compiled


def reverse_cuthill_mckee(start: IntArray, neighbour: IntArray) -> IntArray:
    """Order of nodes in which neighbours are close.

    Reverse Cuthill-McKee (George and Liu, Computer Solution of Large Sparse Positive Definite
    Systems, 1981, chapter 4). Among nodes with equally many neighbours the first comes first.
    SciPy's function of this name starts at any of those that have the fewest: its sort is not
    stable, so that the processor decides, and with the numbers the cells of a mesh may change.

    Parameters
    ----------
    start : (n + 1,) int array
        Where the neighbours of each node begin, as in a symmetric matrix of sparse rows.
    neighbour : int array
        Neighbours of all nodes, one node after the other.

    Returns
    -------
    (n,) int array
        Old numbers in new order.
    """
    degree = np.diff(start)
    first = np.argsort(degree, kind="stable")
    order: IntArray = _breadth_first(start, neighbour, degree, first)
    return order[::-1]


@compiled
def _breadth_first(
    start: IntArray, neighbour: IntArray, degree: IntArray, first: IntArray
) -> IntArray:
    """Nodes in layers of neighbours; those that each node adds by rising degree."""
    order = np.empty(len(first), np.int64)
    seen = np.zeros(len(first), np.bool_)
    count = done = 0
    for seed in first:
        if seen[seed]:
            continue
        seen[seed] = True
        order[count] = seed
        count += 1
        while done < count:
            node = order[done]
            done += 1
            begin = count
            for place in range(start[node], start[node + 1]):
                other = neighbour[place]
                if seen[other]:
                    continue
                seen[other] = True
                k = count
                while k > begin and degree[order[k - 1]] > degree[other]:
                    order[k] = order[k - 1]
                    k -= 1
                order[k] = other
                count += 1
    return order


_PIECE = 20
"""Nodes of a piece that is not cut further."""


def nested_dissection(points: FloatArray, start: IntArray, neighbour: IntArray) -> IntArray:
    """Order (n,), as of `reverse_cuthill_mckee`, in which halves come before what parts them.

    The nodes at points (n, d), mm, are halved across the longest side of their box; those of the
    second half that have neighbours in the first one come last, and both halves are ordered
    likewise (George, SIAM Journal on Numerical Analysis 10 (1973) 345). Minimum degree fills a
    factor less, but takes seconds on tens of thousands of nodes of a regular mesh, which all have
    the same degree.
    """
    order = np.empty(len(points), dtype=np.int64)
    first_half = np.zeros(len(points), dtype=bool)
    left = [(np.arange(len(points)), 0)]
    while left:
        nodes, begin = left.pop()
        end = begin + len(nodes)
        if len(nodes) <= _PIECE:
            order[begin:end] = nodes
            continue
        axis = np.ptp(points[nodes], axis=0).argmax()
        nodes = nodes[np.argsort(points[nodes, axis], kind="stable")]
        low, high = np.split(nodes, [len(nodes) // 2])
        first_half[low] = True
        of, nth = repeated(start[high + 1] - start[high])
        across = first_half[neighbour[start[high][of] + nth]]
        parting = np.bincount(of, across, len(high)) > 0
        first_half[low] = False
        order[end - int(parting.sum()) : end] = high[parting]
        left += [(low, begin), (high[~parting], begin + len(low))]
    return order
