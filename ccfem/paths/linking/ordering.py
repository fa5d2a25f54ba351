"""Order in which items with several ends are visited so that the links between them cost least.

A cluster is visited once: it is entered at one of its terminals and left at another. A strand is a
cluster of two terminals; a group of strands that are laid together is a cluster of all their ends.
The order of the clusters and their terminals are found together. For few clusters, dynamic
programming over sets of clusters gives the optimum (M. Held, R. M. Karp, A dynamic programming
approach to sequencing problems, Journal of SIAM 10 (1962) 196). Otherwise stretches of the order
are exchanged (2-opt, Or-opt), each order being evaluated with its best terminals.
"""

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.paths.linking.exchanges import Clusters, greedy_order, improved_order, strands

_EXACT = 12
"""Maximum number of clusters for which the order is optimal."""


def order_clusters(clusters: Clusters, exact: int = _EXACT, rounds: int = 30) -> IntArray:
    """Order of clusters, and the terminals at which each is entered and left.

    Parameters
    ----------
    clusters : Clusters
    exact : int, default 12
        Up to this many clusters the order is optimal; the work is 2^p t^2.
    rounds : int, default 30
        Rounds of the search above that (`improved_order`); fewer for more than fifty clusters.

    Returns
    -------
    (p, 2) int array
        Terminals entered and left, in order.

    Raises
    ------
    InputError
        For arrays that do not fit together, or where no way exists.
    """
    links, visit = (np.ascontiguousarray(cost, dtype=np.float64) for cost in clusters[:2])
    offsets = np.ascontiguousarray(clusters.offsets, dtype=np.int64)
    count = len(offsets) - 1
    size = (int(offsets[-1]), int(offsets[-1]))
    if links.shape != size or visit.shape != size or not (np.diff(offsets) > 0).all():
        raise InputError(
            f"links and visit must have the shape {size} of the terminals in offsets, and every "
            f"cluster a terminal; got {links.shape} and {visit.shape}"
        )
    if count == 0:
        return np.zeros((0, 2), dtype=np.int64)
    clusters = Clusters(links, visit, offsets, clusters.first, clusters.last)
    if count <= exact:
        return _traced(_costs_of_sets(clusters), clusters)
    return improved_order(greedy_order(clusters), clusters, rounds)


def costs_between_ends(links: FloatArray) -> FloatArray:
    """Least cost of laying all strands of a group from one of their ends to another.

    Parameters
    ----------
    links : (2k, 2k) array
        Cost of the link between each two ends, the same both ways; strand i has the ends 2i and
        2i + 1.

    Returns
    -------
    (2k, 2k) array
        inf where the strands cannot be laid that way, as from an end to itself. For more than 12
        strands only pairs of ends that a search finds to be good have a finite cost.
    """
    if len(links) <= 2 * _EXACT:
        every = range(len(links))
        return np.stack([_costs_of_sets(strands(links, first))[-1] for first in every])
    table = np.full(links.shape, np.inf)
    starts = [-1]
    while starts:
        way = order_clusters(strands(links, starts.pop(0)), rounds=5)
        a, b = int(way[0, 0]), int(way[-1, 1])
        cost = float(links[way[:-1, 1], way[1:, 0]].sum())
        if not np.isfinite(table).any():
            starts = [a ^ 1, b, b ^ 1]
        table[a, b] = table[b, a] = min(cost, table[a, b])
    return table


@njit(cache=True, nogil=True)
def _costs_of_sets(clusters):  # type: ignore[no-untyped-def]
    """Least cost of having visited a set of clusters and left at one of its terminals, (2^p, t)."""
    links, visit, offsets, first, _ = clusters
    count, terminals = len(offsets) - 1, len(links)
    best = np.full((1 << count, terminals), np.inf)
    entry = np.empty(terminals)
    for done in range((1 << count) - 1):
        for c in range(count):
            if done >> c & 1:
                continue
            for a in range(offsets[c], offsets[c + 1]):
                entry[a] = np.inf
                if done == 0:
                    entry[a] = 0.0 if first < 0 or first == a else np.inf
                    continue
                for d in range(count):
                    if done >> d & 1:
                        for t in range(offsets[d], offsets[d + 1]):
                            entry[a] = min(entry[a], best[done, t] + links[t, a])
            more = done | 1 << c
            for a in range(offsets[c], offsets[c + 1]):
                if entry[a] < np.inf:
                    for b in range(offsets[c], offsets[c + 1]):
                        best[more, b] = min(best[more, b], entry[a] + visit[a, b])
    return best


def _traced(best: FloatArray, clusters: Clusters) -> IntArray:
    """Terminals entered and left on the best way, read from the costs of sets backwards."""
    links, visit, offsets, first, last = clusters
    cluster = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    done = len(best) - 1
    left = last if last >= 0 else int(np.argmin(best[done]))
    if not np.isfinite(best[done, left]):
        raise InputError("there is no way through all clusters: some visit must be possible")
    way: list[tuple[int, int]] = []
    while True:
        own = np.arange(offsets[cluster[left]], offsets[cluster[left] + 1])
        done &= ~(1 << int(cluster[left]))
        if not done:
            way.append((first if first >= 0 else int(own[np.argmin(visit[own, left])]), left))
            return np.array(way[::-1])
        through = best[done][:, None] + links[:, own] + visit[own, left]
        t, a = np.unravel_index(int(np.argmin(through)), through.shape)
        way.append((int(own[a]), left))
        left = int(t)
