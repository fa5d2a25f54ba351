"""Block Gauss-Seidel sweeps over symmetric matrices stored as one triangle, compiled.

The blocks below the diagonal determine those above it. A sweep uses each block of row i twice: to
gather the contributions of earlier rows to row i, and to scatter those of row i back. It reads half
as much memory as a sweep over whole rows.
"""

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import Float32Array, FloatArray, Int32Array, IntArray
from ccfem.base.compiled import compiled
from ccfem.base.parallel import in_threads

_CONTRACT = {"contract"}
"""Products and sums may be fused."""


_SINGULAR = 1e-12
"""Share of the largest eigenvalue of a block below which one counts as zero."""


def rows_of(matrix: sp.bsr_array) -> Int32Array:
    """Row of each block."""
    return np.repeat(np.arange(len(matrix.indptr) - 1, dtype=np.int32), np.diff(matrix.indptr))


@compiled(fastmath=_CONTRACT)
def _three(
    start: Int32Array,
    column: Int32Array,
    low: Float32Array,
    inverse: FloatArray,
    rest: FloatArray,
    x: FloatArray,
    backward: bool,
) -> None:
    """Sweep over 3x3 blocks.

    Forward, from ``x = 0`` and ``rest = 0``, with the right-hand side in x: `rest` becomes the
    residual ``-U x``, U the strict upper triangle. Backward `rest` is the right-hand side, which
    loses ``U x`` on the way.
    """
    n = start.size - 1
    for row in range(n):
        i = n - 1 - row if backward else row
        f = rest[i] if backward else x[i]
        a, b, c = f[0], f[1], f[2]
        for s in range(start[i], start[i + 1]):
            m, y = low[s], x[column[s]]
            u, v, w = y[0], y[1], y[2]
            a -= m[0, 0] * u + m[0, 1] * v + m[0, 2] * w
            b -= m[1, 0] * u + m[1, 1] * v + m[1, 2] * w
            c -= m[2, 0] * u + m[2, 1] * v + m[2, 2] * w
        m = inverse[i]
        u = m[0, 0] * a + m[0, 1] * b + m[0, 2] * c
        v = m[1, 0] * a + m[1, 1] * b + m[1, 2] * c
        w = m[2, 0] * a + m[2, 1] * b + m[2, 2] * c
        x[i, 0], x[i, 1], x[i, 2] = u, v, w
        # The transpose of the same blocks is the strict upper triangle: the residual follows at
        # once.
        for s in range(start[i], start[i + 1]):
            m, y = low[s], rest[column[s]]
            y[0] -= m[0, 0] * u + m[1, 0] * v + m[2, 0] * w
            y[1] -= m[0, 1] * u + m[1, 1] * v + m[2, 1] * w
            y[2] -= m[0, 2] * u + m[1, 2] * v + m[2, 2] * w


@compiled(fastmath=_CONTRACT)
def _six(
    start: Int32Array,
    column: Int32Array,
    low: FloatArray,
    inverse: FloatArray,
    rest: FloatArray,
    x: FloatArray,
    backward: bool,
) -> None:
    """Do the same over 6x6 blocks."""
    n, f, u = start.size - 1, np.empty(6), np.empty(6)
    for row in range(n):
        i = n - 1 - row if backward else row
        for p in range(6):
            f[p] = rest[i, p] if backward else x[i, p]
        for s in range(start[i], start[i + 1]):
            m, y = low[s], x[column[s]]
            for p in range(6):
                total = f[p]
                for q in range(6):
                    total -= m[p, q] * y[q]
                f[p] = total
        m = inverse[i]
        for p in range(6):
            total = 0.0
            for q in range(6):
                total += m[p, q] * f[q]
            u[p] = total
            x[i, p] = total
        for s in range(start[i], start[i + 1]):
            m, y = low[s], rest[column[s]]
            for p in range(6):
                for q in range(6):
                    y[q] -= m[p, q] * u[p]


class _Sweeps(ABC):
    """Sweeps forward and backward round a coarse correction, over nodes of d components."""

    size: int

    def forward(self, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sweep forward from zero: the approximation (d n,) and the residual (d n,) it leaves."""
        x, residual = rhs.copy(), np.zeros_like(rhs)
        self._run(self._by_node(residual), self._by_node(x), False)
        return x, residual

    def backward(self, rhs: FloatArray, x: FloatArray) -> FloatArray:
        """Sweep backward over the approximation x (d n,), in place, and return it."""
        self._run(self._by_node(rhs.copy()), self._by_node(x), True)
        return x

    def _by_node(self, values: FloatArray) -> FloatArray:
        return values.reshape(-1, self.size)

    @abstractmethod
    def _run(self, rest: FloatArray, x: FloatArray, backward: bool) -> None: ...


class GaussSeidel(_Sweeps):
    """Symmetric block Gauss-Seidel round a coarse correction.

    Parameters
    ----------
    matrix : bsr_array (d n, d n) with d x d blocks, d 3 or 6
        Symmetric, a positive definite block on each diagonal; components without any stiffness
        stay zero.
    single : bool, default False
        Whether to store the off-diagonal blocks in single precision.
    singular : bool, default False
        Whether diagonal blocks may be singular: their pseudoinverses are then used.
    """

    def __init__(self, matrix: sp.bsr_array, single: bool = False, singular: bool = False) -> None:
        # The blocks below the diagonal, and those on it.
        row, column, count = rows_of(matrix), matrix.indices, len(matrix.indptr) - 1
        below, diagonal = column < row, matrix.data[column == row]
        in_rows = np.bincount(row[below], minlength=count)
        start = np.concatenate([[0], np.cumsum(in_rows)]).astype(np.uint32)
        column = column[below].astype(np.uint32)
        low = matrix.data[below].astype(np.float32 if single else np.float64, copy=False)
        nothing = np.einsum("npp->np", diagonal) == 0.0
        np.einsum("npp->np", diagonal)[nothing] = 1.0
        self.inverse: FloatArray = (
            np.linalg.pinv(diagonal, rcond=_SINGULAR, hermitian=True)
            if singular
            else np.linalg.inv(diagonal)
        )
        self._arguments: tuple[Any, ...] = (start, column, low, self.inverse)
        self.size = low.shape[1]
        self._sweep = _three if self.size == 3 else _six

    def jacobi(self, rhs: FloatArray) -> FloatArray:
        """Product (d n,) with the inverse of the diagonal blocks."""
        return np.einsum("npq,nq->np", self.inverse, self._by_node(rhs)).reshape(-1)

    def _run(self, rest: FloatArray, x: FloatArray, backward: bool) -> None:
        self._sweep(*self._arguments, rest, x, backward)


# Sweeps over clusters of nodes.
#
# Nodes of a short edge, or of a flat cell, hold each other so firmly that a sweep over one node at
# a time barely moves them. They are solved for together. Clusters of two halves of a part that do
# not meet are swept side by side, before those that part them.


class _Stored(NamedTuple):
    """What a sweep over clusters reads: nodes, cluster by cluster, and what precedes them."""

    node: Int32Array  # (n,): in the order of the sweep
    bounds: Int32Array  # (k + 1,): first node of each cluster
    start: Int32Array  # (n + 1,): first block of each node with one of an earlier cluster
    column: Int32Array  # (b,): that node
    low: Float32Array  # (b, 3, 3)
    place: Int32Array  # (k,): first entry of the inverse of each cluster
    inverse: FloatArray  # inverses of the stiffness of the clusters, one after the other


@compiled(fastmath=_CONTRACT)
def _sweep_clusters(
    stored: _Stored, first: int, last: int, rest: FloatArray, x: FloatArray, backward: bool
) -> None:
    """Sweep over the clusters from `first` to before `last`, otherwise as `_three`."""
    node, bounds, start, column, low, place, inverse = stored
    most = 0
    for k in range(first, last):
        most = max(most, bounds[k + 1] - bounds[k])
    f = np.empty(3 * most)
    for cluster in range(first, last):
        k = first + last - 1 - cluster if backward else cluster
        begin, end = bounds[k], bounds[k + 1]
        for p in range(begin, end):
            i = node[p]
            g = rest[i] if backward else x[i]
            a, b, c = g[0], g[1], g[2]
            for s in range(start[p], start[p + 1]):
                m, y = low[s], x[column[s]]
                u, v, w = y[0], y[1], y[2]
                a -= m[0, 0] * u + m[0, 1] * v + m[0, 2] * w
                b -= m[1, 0] * u + m[1, 1] * v + m[1, 2] * w
                c -= m[2, 0] * u + m[2, 1] * v + m[2, 2] * w
            q = 3 * (p - begin)
            f[q], f[q + 1], f[q + 2] = a, b, c
        size, at = 3 * (end - begin), place[k]
        for p in range(begin, end):
            i = node[p]
            u, v, w = 0.0, 0.0, 0.0
            for q in range(size):
                u += inverse[at + q] * f[q]
                v += inverse[at + size + q] * f[q]
                w += inverse[at + 2 * size + q] * f[q]
            at += 3 * size
            x[i, 0], x[i, 1], x[i, 2] = u, v, w
            for s in range(start[p], start[p + 1]):
                m, y = low[s], rest[column[s]]
                y[0] -= m[0, 0] * u + m[1, 0] * v + m[2, 0] * w
                y[1] -= m[0, 1] * u + m[1, 1] * v + m[2, 1] * w
                y[2] -= m[0, 2] * u + m[1, 2] * v + m[2, 2] * w


_MANY_NODES = 20_000
"""Nodes from which on both halves are swept at once: fewer take no longer than to begin that."""


class ClusterSweeps(_Sweeps):
    """Block Gauss-Seidel over clusters of nodes, in single precision off their diagonal.

    Parameters
    ----------
    matrix : bsr_array (3n, 3n) with 3x3 blocks
        Symmetric positive definite.
    of_node : (n,) int array
        Cluster of each node; -1 for a node by itself.
    along : (n,) array, optional
        Where nodes are along an axis: clusters on either side of the median, as far as they do not
        meet, are swept side by side. Default: one after the other.
    """

    size = 3

    def __init__(
        self, matrix: sp.bsr_array, of_node: IntArray, along: FloatArray | None = None
    ) -> None:
        row, column, n = rows_of(matrix), matrix.indices, len(of_node)
        # A cluster is known by its first node.
        leader, several = np.arange(n), of_node >= 0
        _, first, cluster = np.unique(of_node[several], return_index=True, return_inverse=True)
        leader[several] = leader[several][first][cluster]
        # Clusters of the first half, of the second, and those of it that meet the first.
        part = np.zeros(n, dtype=np.int8)
        if along is not None:
            part[(along > np.median(along))[leader]] = 1
            part[np.isin(leader, leader[row[part[row] > part[column]]])] = 2
        node = np.lexsort((leader, part))
        begins = np.diff(leader[node], prepend=-1) != 0
        bounds = np.append(np.flatnonzero(begins), n)
        cluster, place = np.empty(n, dtype=np.int32), np.empty(n, dtype=np.int32)
        cluster[node], place[node] = np.cumsum(begins) - 1, np.arange(n)
        self._spans = np.searchsorted(part[node[bounds[:-1]]], np.arange(4)).tolist()
        # Blocks with nodes of earlier clusters, in the order of the sweep.
        before = np.flatnonzero(cluster[column] < cluster[row])
        before = before[np.argsort(place[row[before]], kind="stable")]
        start = np.append(0, np.cumsum(np.bincount(place[row[before]], minlength=n)))
        low = matrix.data.astype(np.float32)[before]
        within = cluster[column] == cluster[row]
        nodes = (place[row[within]], place[column[within]])
        inverse = _inverses(*nodes, matrix.data[within], bounds)
        order = [some.astype(np.int32) for some in (node, bounds, start, column[before])]
        begin, entries = inverse
        self._stored = _Stored(
            order[0], order[1], order[2], order[3], low, begin.astype(np.int32), entries
        )

    def _run(self, rest: FloatArray, x: FloatArray, backward: bool) -> None:
        def sweep(first: int, last: int) -> None:
            _sweep_clusters(self._stored, first, last, rest, x, backward)

        begin, middle, meeting, end = self._spans
        if backward:
            sweep(meeting, end)
        # These do not meet, so that neither needs nor changes what the other does.
        most = 2 if len(x) >= _MANY_NODES else 1
        in_threads(sweep, [begin, middle], [middle, meeting], most=most)
        if not backward:
            sweep(meeting, end)


def _inverses(
    row: Int32Array, column: Int32Array, blocks: FloatArray, bounds: IntArray
) -> tuple[IntArray, FloatArray]:
    """First entry of the inverse of each cluster, and the entries, from blocks within clusters."""
    size = 3 * np.diff(bounds)
    begin = np.append(0, np.cumsum(size * size))
    result = np.zeros(begin[-1])
    cluster = np.searchsorted(bounds, row, side="right") - 1
    width = size[cluster]
    at = begin[cluster] + 3 * ((row - bounds[cluster]) * width + column - bounds[cluster])
    result[at[:, None, None] + np.arange(3)[:, None] * width[:, None, None] + np.arange(3)] = blocks
    # All clusters of one size at once.
    for one in np.unique(size):
        entries = begin[:-1][size == one, None] + np.arange(one * one)
        dense = result[entries].reshape(-1, one, one)
        result[entries] = np.linalg.inv(dense).reshape(entries.shape)
    return begin, result
