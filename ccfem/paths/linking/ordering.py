"""Order in which items with several ends are visited so that the links between them cost least.

A cluster is visited once: it is entered at one of its terminals and left at another. A strand is a
cluster of two terminals; a group of strands that are laid together is a cluster of all their ends.
The order of the clusters and their terminals are found together. For few clusters, dynamic
programming over sets of clusters gives the optimum (M. Held, R. M. Karp, A dynamic programming
approach to sequencing problems, Journal of SIAM 10 (1962) 196). Otherwise stretches of the order
are exchanged (2-opt, Or-opt), each order being evaluated with its best terminals, found by dynamic
programming along it: only the part that an exchange changes is recomputed.
"""

from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.base.errors import InputError

_EXACT = 12
"""Maximum number of clusters for which the order is optimal."""
_BLOCK = 3
"""Maximum number of clusters that Or-opt moves at once."""
_MANY = 50
"""Number of clusters above which fewer rounds are made."""
_MOST_WORK = 5e7
"""Rounds times the cube of the number of clusters, about what a round costs: no more rounds are
made. Up to about a hundred clusters need less."""


class Clusters(NamedTuple):
    """Items with terminals, each to be visited once.

    Attributes
    ----------
    links : (t, t) array
        Cost >= 0 from leaving at a terminal to entering at another, of another cluster.
    visit : (t, t) array
        Cost >= 0 of entering a cluster at one terminal and leaving it at another; inf where that is
        impossible.
    offsets : (p + 1,) int array
        Cluster c has the terminals ``offsets[c]`` up to ``offsets[c + 1]``.
    first, last : int
        Terminals at which the whole way starts and ends; -1 for any.
    """

    links: FloatArray
    visit: FloatArray
    offsets: IntArray
    first: int = -1
    last: int = -1


def strands(links: FloatArray, first: int = -1, last: int = -1) -> Clusters:
    """Strands as clusters: terminals 2k and 2k + 1 are the ends of strand k; visits are free."""
    ends = np.arange(len(links))
    visit = np.full(links.shape, np.inf)
    visit[ends, ends ^ 1] = 0.0
    offsets = np.arange(0, len(links) + 1, 2)
    return Clusters(np.ascontiguousarray(links, dtype=np.float64), visit, offsets, first, last)


def order_clusters(clusters: Clusters, exact: int = _EXACT, rounds: int = 30) -> IntArray:
    """Order of clusters, and the terminals at which each is entered and left.

    Parameters
    ----------
    exact : int, default 12
        Up to this many clusters the order is optimal; the work is 2^p t^2.
    rounds : int, default 30
        Rounds of the search above that (`improved_order`); fewer for more than fifty clusters.

    Returns
    -------
    (p, 2) int array
        Terminals entered and left, in order.
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


@compiled
def _costs_of_sets(clusters: Clusters) -> FloatArray:
    """Least cost of having visited a set of clusters and left at one of its terminals, (2^p, t)."""
    links, visit, offsets, first, _ = clusters
    count, terminals = len(offsets) - 1, len(links)
    best = np.full((1 << count, terminals), np.inf)
    entry = np.empty(terminals)
    # Held and Karp: a set of clusters is a number, and larger sets come after those that they hold.
    for done in range((1 << count) - 1):
        for c in range(count):
            if done >> c & 1:
                continue
            for a in range(offsets[c], offsets[c + 1]):
                entry[a] = np.inf
                if done == 0:
                    entry[a] = 0.0 if first < 0 or first == a else np.inf
                    continue
                # Entered from the best exit of any cluster before.
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
        nodes = np.arange(offsets[cluster[left]], offsets[cluster[left] + 1])
        done &= ~(1 << int(cluster[left]))
        if not done:
            way.append((first if first >= 0 else int(nodes[np.argmin(visit[nodes, left])]), left))
            return np.array(way[::-1])
        through = best[done][:, None] + links[:, nodes] + visit[nodes, left]
        t, a = np.unravel_index(int(np.argmin(through)), through.shape)
        way.append((int(nodes[a]), left))
        left = int(t)


# Exchanges of stretches.


def improved_order(order: IntArray, clusters: Clusters, rounds: int) -> IntArray:
    """Terminals (p, 2) entered and left, in an order no worse than the given one (p,).

    Each round perturbs the best order and makes exchanges until none helps. The number of rounds
    follows from that of the clusters: the same input gives the same order on every machine.
    """
    best, count = order.copy(), len(order)
    least = _exchange(best, clusters)
    random = np.random.default_rng(0)
    fixed, free = int(clusters.first >= 0), count - int(clusters.last >= 0)
    wanted = round(rounds * min(1.0, (_MANY / count) ** 2))
    for _ in range(min(wanted, max(1, round(_MOST_WORK / count**3)))):
        # Swap two neighbouring stretches: exchanges of single stretches do not undo that.
        i, j, k = np.sort(random.integers(fixed, free + 1, 3))
        trial = np.concatenate([best[:i], best[j:k], best[i:j], best[k:]])
        cost = _exchange(trial, clusters)
        if cost < least - 1e-9 * abs(least):
            best, least = trial, cost
    if not np.isfinite(least):
        raise InputError("there is no way through all clusters: some visit must be possible")
    return _best_terminals(best, clusters)


def greedy_order(clusters: Clusters) -> IntArray:
    """Order (p,) in which the next cluster is always the one that is cheapest to reach."""
    links, visit, offsets, first, last = clusters
    cluster = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    free = np.ones(len(links), dtype=bool)
    final = cluster[last] if last >= 0 else -1
    free[cluster == final] = False
    value = np.where(cluster == (cluster[first] if first >= 0 else cluster[free][0]), 0.0, np.inf)
    order: list[int] = []
    while free.any():
        chosen = int(cluster[np.flatnonzero(free)[np.argmin(value[free])]])
        order.append(chosen)
        members = cluster == chosen
        free[members] = False
        leave = (value[members][:, None] + visit[np.ix_(members, members)]).min(axis=0)
        value = (leave[:, None] + links[members]).min(axis=0)
    return np.array([*order, final] if last >= 0 else order, dtype=np.int64)


@compiled
def _step(
    value: FloatArray, c: int, d: int, clusters: Clusters, entry: FloatArray, out: FloatArray
) -> float:
    """Write costs of leaving cluster d to `out`, given those of leaving c; return the least."""
    links, visit, offsets, _, _ = clusters
    least = np.inf
    for a in range(offsets[d], offsets[d + 1]):
        entry[a] = np.inf
        for t in range(offsets[c], offsets[c + 1]):
            entry[a] = min(entry[a], value[t] + links[t, a])
    for b in range(offsets[d], offsets[d + 1]):
        cost = np.inf
        for a in range(offsets[d], offsets[d + 1]):
            cost = min(cost, entry[a] + visit[a, b])
        out[b] = cost
        least = min(least, cost)
    return least


@compiled
def _begin(c: int, clusters: Clusters, out: FloatArray) -> float:
    """Write costs of leaving the first cluster c of a way to `out`; return the least."""
    _, visit, offsets, first, _ = clusters
    least = np.inf
    for b in range(offsets[c], offsets[c + 1]):
        out[b] = np.inf
        for a in range(offsets[c], offsets[c + 1]):
            if first < 0 or first == a:
                out[b] = min(out[b], visit[a, b])
        least = min(least, out[b])
    return least


@compiled
def _table(order: IntArray, clusters: Clusters, ahead: FloatArray, behind: FloatArray) -> float:
    """Fill tables of costs: from the start to leaving each cluster, from entering it to the end."""
    links, visit, offsets, first, last = clusters
    entry = np.empty(len(links))
    _begin(order[0], clusters, ahead)
    for k in range(1, len(order)):
        _step(ahead, order[k - 1], order[k], clusters, entry, ahead)
    # Backwards: what is left from entering a cluster, by what is left from leaving it.
    for k in range(len(order) - 1, -1, -1):
        c = order[k]
        for b in range(offsets[c], offsets[c + 1]):
            entry[b] = 0.0 if last < 0 or last == b else np.inf
            if k < len(order) - 1:
                entry[b] = np.inf
                d = order[k + 1]
                for a in range(offsets[d], offsets[d + 1]):
                    entry[b] = min(entry[b], links[b, a] + behind[a])
        for a in range(offsets[c], offsets[c + 1]):
            behind[a] = np.inf
            for b in range(offsets[c], offsets[c + 1]):
                behind[a] = min(behind[a], visit[a, b] + entry[b])
    c = order[0]
    least = np.inf
    for a in range(offsets[c], offsets[c + 1]):
        if first < 0 or first == a:
            least = min(least, behind[a])
    return least


@compiled
def _rearranged(window: IntArray, variant: int, out: IntArray) -> bool:
    """Fill `out` with the window reversed, or with a block moved from one of its ends to the other.

    Variant 0 reverses. Then, for 1 to 3 clusters: a block from the front, from the back, each as it
    is or reversed. Returns whether the variant is a new one for a window of this size.
    """
    size = len(window)
    if variant == 0:
        for k in range(size):
            out[k] = window[size - 1 - k]
        return True
    block, way = (variant - 1) // 4 + 1, (variant - 1) % 4
    if block >= size or (block == 1 and way > 1):
        return False
    # Where the block and the rest come from, and where they go.
    block_from, block_to = (0, size - block) if way % 2 == 0 else (size - block, 0)
    rest_from, rest_to = (block, 0) if way % 2 == 0 else (0, block)
    for k in range(size - block):
        out[rest_to + k] = window[rest_from + k]
    for k in range(block):
        out[block_to + k] = window[block_from + (k if way < 2 else block - 1 - k)]
    return True


class _Costs(NamedTuple):
    """Costs by terminal (t,): from the start to leaving it, from entering it to the end; and room.

    `value` and `entry` are the costs of leaving and of entering along a part that is tried.
    """

    ahead: FloatArray
    behind: FloatArray
    value: FloatArray
    entry: FloatArray


@compiled
def _exchange(order: IntArray, clusters: Clusters) -> float:
    """Rearrange windows of `order`, in place, until no rearrangement helps; the cost."""
    count = len(clusters.links)
    costs = _Costs(np.empty(count), np.empty(count), np.empty(count), np.empty(count))
    least = _table(order, clusters, costs.ahead, costs.behind)
    trial = np.empty_like(order)
    lowest, highest = int(clusters.first >= 0), len(order) - int(clusters.last >= 0)
    helped = True
    while helped:
        helped = False
        # Every window, in every rearrangement; the first that helps is taken at once.
        for i in range(lowest, highest):
            for j in range(i + 2, highest + 1):
                for variant in range(1 + 4 * _BLOCK):
                    part = trial[: j - i]
                    if not _rearranged(order[i:j], variant, part):
                        continue
                    limit = least * (1.0 - 1e-9)
                    cost = _cost_with(part, i, order, clusters, costs, limit)
                    if cost < limit:
                        for k in range(j - i):
                            order[i + k] = part[k]
                        least = _table(order, clusters, costs.ahead, costs.behind)
                        helped = True
    return least


@compiled
def _cost_with(
    part: IntArray, i: int, order: IntArray, clusters: Clusters, costs: _Costs, limit: float
) -> float:
    """Cost of the way with `part` from position i on; inf once it cannot be below the limit."""
    links, _, offsets, _, _ = clusters
    ahead, behind, value, entry = costs
    j = i + len(part)
    rest = 0.0
    if j < len(order):
        rest = np.inf
        for a in range(offsets[order[j]], offsets[order[j] + 1]):
            rest = min(rest, behind[a])
    if i == 0:
        cost = _begin(part[0], clusters, value)
    else:
        cost = _step(ahead, order[i - 1], part[0], clusters, entry, value)
    for k in range(1, len(part)):
        if cost + rest >= limit:
            return np.inf
        cost = _step(value, part[k - 1], part[k], clusters, entry, value)
    if j == len(order):
        return cost
    c, d = part[-1], order[j]
    cost = np.inf
    for t in range(offsets[c], offsets[c + 1]):
        for a in range(offsets[d], offsets[d + 1]):
            cost = min(cost, value[t] + links[t, a] + behind[a])
    return cost


def _best_terminals(order: IntArray, clusters: Clusters) -> IntArray:
    """Terminals entered and left on the best way through clusters in a given order."""
    links, visit, offsets, first, last = clusters
    ahead, behind = np.full(len(links), np.inf), np.empty(len(links))
    _table(order, clusters, ahead, behind)
    way: list[tuple[int, int]] = []
    value = np.where(np.arange(len(links)) == first, 0.0, np.inf if first >= 0 else 0.0)
    for k, c in enumerate(order):
        span = slice(offsets[c], offsets[c + 1])
        entered = int(offsets[c] + np.argmin(value[span] + behind[span]))
        rest = np.where(np.arange(len(links)) == last, 0.0, np.inf if last >= 0 else 0.0)
        if k + 1 < len(order):
            following = slice(offsets[order[k + 1]], offsets[order[k + 1] + 1])
            rest = (links[:, following] + behind[following]).min(axis=1)
        left = int(offsets[c] + np.argmin(visit[entered, span] + rest[span]))
        way.append((entered, left))
        value = links[left]
    return np.array(way)
