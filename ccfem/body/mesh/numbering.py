"""Numbers of nodes with which factors stay sparse: the same ones on every machine."""

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, repeated
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
    order = np.empty(len(first), dtype=np.int64)
    _breadth_first(start, neighbour, degree, first, order, np.zeros(len(first), dtype=bool))
    return order[::-1]


@compiled
def _breadth_first(
    start: IntArray,
    neighbour: IntArray,
    degree: IntArray,
    first: IntArray,
    order: IntArray,
    seen: BoolArray,
) -> None:
    """Order nodes in layers of neighbours; those that each node adds by rising degree."""
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
    # All pieces of one size after the other: their nodes, and where they and their numbers begin.
    nodes = np.arange(len(points))
    first, begin = np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64)
    piece_of, in_first = np.full(len(points), -1), np.zeros(len(points), dtype=bool)
    while len(nodes):
        size = np.diff(first, append=len(nodes))
        piece, nth = repeated(size)
        small = size[piece] <= _PIECE
        order[(begin[piece] + nth)[small]] = nodes[small]
        nodes, begin = nodes[~small], begin[size > _PIECE]
        size = size[size > _PIECE]
        if not len(nodes):
            break
        piece, nth = repeated(size)
        place, first = points[nodes], np.cumsum(size) - size
        box = np.maximum.reduceat(place, first) - np.minimum.reduceat(place, first)
        along = place[np.arange(len(nodes)), box.argmax(axis=1)[piece]]
        nodes = nodes[np.lexsort((along, piece))]
        half = nth < (size // 2)[piece]
        piece_of[:] = -1
        piece_of[nodes], in_first[nodes] = piece, half
        high = nodes[~half]
        of, number = repeated(start[high + 1] - start[high])
        other = neighbour[start[high][of] + number]
        across = in_first[other] & (piece_of[other] == piece[~half][of])
        parting = np.zeros(len(nodes), dtype=bool)
        parting[~half] = np.bincount(of, across, len(high)) > 0
        # What parts the halves of a piece takes its last numbers.
        count = np.bincount(piece[parting], minlength=len(size))
        of, number = repeated(count)
        order[(begin + size - count)[of] + number] = nodes[parting]
        parts = np.stack([size // 2, size - size // 2 - count], axis=1)
        begin = np.stack([begin, begin + size // 2], axis=1).ravel()
        nodes, first = nodes[~parting], np.cumsum(parts) - parts.ravel()
    return order
