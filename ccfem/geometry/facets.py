"""Facets and edges by their nodes, whatever the order of these: pairs, places, unique edges."""

import numpy as np
from numba import njit

from ccfem.base.arrays import BoolArray, IntArray

_FEW = 16
"""Node numbers to a pair of nodes, up to which all of them are counted."""


def facet_keys(*tables: IntArray) -> list[IntArray]:
    """Give facets one integer each, the same for the same nodes in any order.

    Parameters
    ----------
    *tables : (k_i, c) int arrays
        Nodes of facets, from 0.

    Returns
    -------
    list of (k_i,) int arrays
        Ascending as the sorted nodes do. They are comparable among the tables of one call only:
        where node numbers are so large that a product of them would not fit, the keys of the first
        columns are ranked in between.
    """
    nodes = np.sort(np.concatenate(tables).astype(np.int64), axis=1)
    count = int(nodes.max(initial=0)) + 1
    key = nodes[:, 0]
    for column in nodes.T[1:]:
        if int(key.max(initial=0)) >= np.iinfo(np.int64).max // count:
            _, key = np.unique(key, return_inverse=True)
        key = key * count + column
    return np.split(key, np.cumsum([len(table) for table in tables])[:-1])


def paired(facets: IntArray) -> tuple[IntArray, IntArray]:
    """Find the facets (k, c) that coincide with another one, and those that stand alone.

    Returns
    -------
    pairs : (f, 2) int array
        Rows of `facets` with the same nodes, the smaller row first.
    single : (s,) int array
        The other rows, ascending.
    """
    (key,) = facet_keys(facets)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order]) == 0)
    single = np.ones(len(order), dtype=bool)
    single[first] = single[first + 1] = False
    return np.stack([order[first], order[first + 1]], axis=1), np.sort(order[single])


def positions(facets: IntArray, among: IntArray) -> IntArray:
    """Row (k,) of each facet (k, c) in another table (m, c), -1 where it is not there."""
    wanted, known = facet_keys(facets, among)
    known, row = np.unique(known, return_index=True)
    at = np.searchsorted(known, wanted)
    found = np.append(known, -1)[at] == wanted
    return np.where(found, np.append(row, -1)[at], -1)


def are_among(facets: IntArray, others: IntArray) -> BoolArray:
    """Whether each facet (k, c) is in another table (m, c)."""
    wanted, known = facet_keys(facets, others)
    return np.isin(wanted, known)


def unique_edges(ends: IntArray) -> tuple[IntArray, IntArray]:
    """Edges (e, 2) that pairs of nodes (k, 2) stand for, and the edge (k,) of each pair.

    The edges ascend, and so do the nodes of each.
    """
    low, high = np.minimum(*ends.T), np.maximum(*ends.T)
    nodes = int(high.max(initial=-1)) + 1
    if nodes > _FEW * (len(ends) + 1):
        known, number = np.unique(np.concatenate([low, high]), return_inverse=True)
        edges, edge = _numbered(number[: len(ends)], number[len(ends) :], len(known))
        return known[edges], edge
    edges, edge = _numbered(low, high, nodes)
    return edges.astype(ends.dtype, copy=False), edge


@njit(cache=True, nogil=True)
def _sorted(values, order, most):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Sort an order by values below a number; equal ones stay as they come."""
    start = np.zeros(most + 1, np.int64)
    for k in range(len(values)):
        start[values[k] + 1] += 1
    for i in range(most):
        start[i + 1] += start[i]
    result = np.empty(len(order), np.int64)
    for k in order:
        result[start[values[k]]] = k
        start[values[k]] += 1
    return result


@njit(cache=True, nogil=True)
def _numbered(low, high, nodes):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Edges in ascending order, and the edge of each pair."""
    order = _sorted(low, _sorted(high, np.arange(len(low)), nodes), nodes)
    edges, edge, count = np.empty((len(low), 2), np.int64), np.empty(len(low), np.int64), 0
    for k in order:
        if count == 0 or edges[count - 1, 0] != low[k] or edges[count - 1, 1] != high[k]:
            edges[count, 0], edges[count, 1] = low[k], high[k]
            count += 1
        edge[k] = count - 1
    return edges[:count].copy(), edge
