"""Numbers of nodes with which neighbours are close: the same ones on every machine."""

import numpy as np
from numba import njit

from ccfem.base.arrays import IntArray


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


@njit(cache=True, nogil=True)
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
