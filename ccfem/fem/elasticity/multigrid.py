"""Multigrid preconditioners: smoothed aggregation, and two levels for quadratic cells."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import Float32Array, FloatArray, Int32Array, IntArray
from ccfem.base.compiled import compiled
from ccfem.fem.elasticity.conjugate_gradient import highest_eigenvalue
from ccfem.fem.elasticity.direct import Apply
from ccfem.fem.elasticity.gauss_seidel import ClusterSweeps, GaussSeidel, rows_of
from ccfem.fem.elasticity.held import rigid_modes

# Aggregates of nodes, and the rigid motions of each: the coarse space of smoothed aggregation.
#
# Vanek, Mandel and Brezina, Computing 56 (1996) 179-196, section 5.


_DEPENDENT = 1e-10
"""Relative length below which an orthogonalised motion counts as dependent on those before it."""


class Aggregates(NamedTuple):
    """Groups of nodes that move as rigid bodies.

    Attributes
    ----------
    of_node : (n,) int array
        Group of each node; -1 for a node with no strong connection.
    motions : (n, d, 6) array
        Motions of each node as part of its group, orthonormal over the group; zero where a group is
        too small, or too straight, for all six.
    near_kernel : (c, 6, 6) array
        The given motions, expressed by those of each group.
    """

    of_node: IntArray
    motions: FloatArray
    near_kernel: FloatArray


def aggregates(matrix: sp.bsr_array, near_kernel: FloatArray, strength: float) -> Aggregates:
    """Group the nodes of a matrix.

    Parameters
    ----------
    matrix : bsr_array (d n, d n) with d x d blocks
    near_kernel : (n, d, 6) array
        Motions of little energy.
    strength : float
        Size of a block, over the geometric mean of the sizes of its diagonal blocks, above which it
        is a strong connection.
    """
    start, column = _strong(matrix, strength)
    of_node, count = _grouped(start, column)
    motions = np.zeros(near_kernel.shape)
    coarse = np.zeros((count, 6, 6))
    _orthonormal(of_node, near_kernel, motions, coarse)
    return Aggregates(of_node, motions, coarse)


def _strong(matrix: sp.bsr_array, strength: float) -> tuple[Int32Array, Int32Array]:
    """Strong connections of each node with others."""
    indices, data = matrix.indices, matrix.data
    row = rows_of(matrix)
    # Squared size of the blocks. Strong: above the strength times the mean of both diagonals.
    size = np.einsum("spq,spq->s", data, data)
    diagonal = np.zeros(len(matrix.indptr) - 1)
    diagonal[row[indices == row]] = size[indices == row]
    least = strength**4 * diagonal[row] * diagonal[indices]
    strong = (indices != row) & (size * size >= least) & (size > 0.0)
    start = np.concatenate([[0], np.cumsum(np.bincount(row[strong], minlength=len(diagonal)))])
    return start.astype(np.int32), indices[strong]


@compiled
def _grouped(start: Int32Array, column: Int32Array) -> tuple[Int32Array, int]:
    """Group of each node, and their number."""
    n, count = start.size - 1, 0
    result = np.full(n, -1, np.int32)
    # First, nodes with all their neighbours, if none of them belongs to a group yet.
    for i in range(n):
        alone = result[i] < 0 and start[i + 1] > start[i]
        for s in range(start[i], start[i + 1]):
            alone = alone and result[column[s]] < 0
        if alone:
            result[i] = count
            for s in range(start[i], start[i + 1]):
                result[column[s]] = count
            count += 1
    # The others join a group beside them,
    joined = result.copy()
    for i in range(n):
        if result[i] < 0:
            for s in range(start[i], start[i + 1]):
                if result[column[s]] >= 0:
                    joined[i] = result[column[s]]
                    break
    # and the remaining nodes form groups of their own.
    for i in range(n):
        if joined[i] < 0 and start[i + 1] > start[i]:
            joined[i] = count
            for s in range(start[i], start[i + 1]):
                if joined[column[s]] < 0:
                    joined[column[s]] = count
            count += 1
    return joined, count


@compiled
def _orthonormal(
    of_node: Int32Array, near_kernel: FloatArray, motions: FloatArray, coarse: FloatArray
) -> None:
    """Factorise the near kernel of each group into orthonormal columns and a 6x6 triangle.

    By the modified method of Gram and Schmidt, twice.
    """
    n, d, count = near_kernel.shape[0], near_kernel.shape[1], len(coarse)
    start = np.zeros(count + 1, np.int32)
    for i in range(n):
        if of_node[i] >= 0:
            start[of_node[i] + 1] += 1
    for k in range(1, start.size):
        start[k] += start[k - 1]
    member, place = np.empty(start[count], np.int32), start.copy()
    for i in range(n):
        k = of_node[i]
        if k >= 0:
            member[place[k]] = i
            place[k] += 1
            for p in range(d):
                for c in range(6):
                    motions[i, p, c] = near_kernel[i, p, c]
    # Gram and Schmidt, twice, which keeps columns orthogonal; what is left of a dependent one is 0.
    for k in range(count):
        first, last = start[k], start[k + 1]
        for c in range(6):
            before = _product(motions, member, first, last, c, c)
            for _ in range(2):
                for b in range(c):
                    along = _product(motions, member, first, last, b, c)
                    coarse[k, b, c] += along
                    for e in range(first, last):
                        for p in range(d):
                            motions[member[e], p, c] -= along * motions[member[e], p, b]
            after = _product(motions, member, first, last, c, c)
            length = np.sqrt(after) if after > _DEPENDENT**2 * before else 0.0
            coarse[k, c, c] = length
            for e in range(first, last):
                for p in range(d):
                    motions[member[e], p, c] *= 1.0 / length if length > 0.0 else 0.0


@compiled
def _product(
    motions: FloatArray, member: Int32Array, first: int, last: int, b: int, c: int
) -> float:
    """Inner product of two columns over a group."""
    total = 0.0
    for e in range(first, last):
        for p in range(motions.shape[1]):
            total += motions[member[e], p, b] * motions[member[e], p, c]
    return total


# The coarse space of smoothed aggregation, and the stiffness within it.


_CONTRACT = {"contract"}


class Prolongation(NamedTuple):
    """Interpolation from the motions of groups to those of their nodes.

    Blocks (b, d, 6) in single precision are used both for it and its transpose, so that they match
    exactly; `indices` are the groups that move a node.
    """

    indptr: Int32Array
    indices: Int32Array
    blocks: Float32Array
    groups: int

    def restrict(self, forces: FloatArray) -> FloatArray:
        """Restrict forces (d n,) to the motions (6 c,) of the groups."""
        result = np.zeros((self.groups, 6))
        _restrict(self.indptr, self.indices, self.blocks, self._nodes(forces), result)
        return result.reshape(-1)

    def add(self, motions: FloatArray, x: FloatArray) -> None:
        """Add the nodal motions due to the groups' motions (6 c,) to x (d n,), in place."""
        nodes = self._nodes(x)
        _prolong(self.indptr, self.indices, self.blocks, motions.reshape(-1, 6), nodes)

    def _nodes(self, values: FloatArray) -> FloatArray:
        return values.reshape(-1, self.blocks.shape[1])


def smoothed(
    matrix: sp.bsr_array, inverse: FloatArray, groups: Aggregates, damping: float
) -> Prolongation:
    """Motions T of groups after one damped Jacobi step: ``(I - damping D^-1 A) T``.

    A has d x d blocks, and `inverse` (n, d, d) those of D^-1.
    """
    of_node, motions = groups.of_node, groups.motions
    count = len(groups.near_kernel)
    indptr, indices = _neighbour_groups(matrix.indptr, matrix.indices, of_node, count)
    blocks = np.empty((len(indices), motions.shape[1], 6), dtype=np.float32)
    prolong = Prolongation(indptr, indices, blocks, count)
    rows = _Rows(matrix.indptr, matrix.indices, matrix.data)
    _smooth(rows, inverse, of_node, motions, float(damping), prolong)
    return prolong


def galerkin(matrix: sp.bsr_array, prolong: Prolongation) -> sp.bsr_array:
    """Stiffness (6 c, 6 c) of the groups: ``P^T A P``, of a matrix with d x d blocks."""
    rows, count = _Rows(matrix.indptr, matrix.indices, matrix.data), prolong.groups
    indptr, indices = _met(matrix, prolong)
    coarse = _Rows(indptr, indices, np.zeros((len(indices), 6, 6)))
    _project(rows, prolong, coarse)
    _reflect(*coarse)
    shape = (6 * count, 6 * count)
    return sp.bsr_array((coarse.data, indices, indptr), shape=shape)


class _Rows(NamedTuple):
    """A sparse matrix of blocks ``data[k]`` (k, d, d), row by row, for compiled functions."""

    indptr: Int32Array
    indices: Int32Array
    data: FloatArray


@compiled
def _restrict(
    indptr: Int32Array,
    indices: Int32Array,
    blocks: Float32Array,
    forces: FloatArray,
    result: FloatArray,
) -> None:
    d = blocks.shape[1]
    for i in range(indptr.size - 1):
        for s in range(indptr[i], indptr[i + 1]):
            m, y = blocks[s], result[indices[s]]
            for p in range(d):
                for c in range(6):
                    y[c] += m[p, c] * forces[i, p]


@compiled(fastmath={"contract", "reassoc"})
def _prolong(
    indptr: Int32Array,
    indices: Int32Array,
    blocks: Float32Array,
    motions: FloatArray,
    x: FloatArray,
) -> None:
    d = blocks.shape[1]
    for i in range(indptr.size - 1):
        for s in range(indptr[i], indptr[i + 1]):
            m, y = blocks[s], motions[indices[s]]
            for p in range(d):
                total = 0.0
                for c in range(6):
                    total += m[p, c] * y[c]
                x[i, p] += total


@compiled
def _neighbour_groups(
    indptr: Int32Array, indices: Int32Array, of_node: Int32Array, count: int
) -> tuple[Int32Array, Int32Array]:
    """Find the groups of the neighbours of each node."""
    n = indptr.size - 1
    seen = np.full(count, -1, np.int32)
    start, result = np.zeros(n + 1, np.int32), np.empty(indices.size, np.int32)
    place = 0
    for i in range(n):
        for s in range(indptr[i], indptr[i + 1]):
            k = of_node[indices[s]]
            if k >= 0 and seen[k] != i:
                seen[k] = i
                result[place] = k
                place += 1
        start[i + 1] = place
    return start, result[:place].copy()


@compiled(fastmath=_CONTRACT)
def _smooth(
    rows: _Rows,
    inverse: FloatArray,
    of_node: IntArray,
    motions: FloatArray,
    damping: float,
    prolong: Prolongation,
) -> None:
    """Write the blocks of ``(I - damping D^-1 A) T``, whose pattern is known."""
    indptr, indices, data = rows
    start, column, blocks, groups = prolong
    place = np.zeros(groups, np.int32)
    d, most = data.shape[1], 1
    for i in range(start.size - 1):
        most = max(most, start[i + 1] - start[i])
    sums = np.empty((most, d, 6))
    for i in range(start.size - 1):
        first = start[i]
        for s in range(first, start[i + 1]):
            place[column[s]] = s - first
            _set_to_zero(sums[s - first])
        # A T: the forces on node i where each group around it moves.
        for s in range(indptr[i], indptr[i + 1]):
            j = indices[s]
            if of_node[j] >= 0:
                _add(data[s], motions[j], sums[place[of_node[j]]])
        for s in range(first, start[i + 1]):
            total = sums[s - first]
            for p in range(d):
                for c in range(6):
                    value = 0.0
                    for q in range(d):
                        value += inverse[i, p, q] * total[q, c]
                    value *= -damping
                    if column[s] == of_node[i]:
                        value += motions[i, p, c]
                    blocks[s, p, c] = value


@compiled
def _set_to_zero(values: FloatArray) -> None:
    for p in range(values.shape[0]):
        for c in range(6):
            values[p, c] = 0.0


@compiled(fastmath=_CONTRACT)
def _add(a: FloatArray, b: FloatArray, total: FloatArray) -> None:
    """Add the product of a (r, d) and b (d, 6) to total (r, 6), a row at a time in registers."""
    for p in range(a.shape[0]):
        u, v, w = total[p, 0], total[p, 1], total[p, 2]
        x, y, z = total[p, 3], total[p, 4], total[p, 5]
        for q in range(a.shape[1]):
            f = a[p, q]
            u += f * b[q, 0]
            v += f * b[q, 1]
            w += f * b[q, 2]
            x += f * b[q, 3]
            y += f * b[q, 4]
            z += f * b[q, 5]
        total[p, 0], total[p, 1], total[p, 2] = u, v, w
        total[p, 3], total[p, 4], total[p, 5] = x, y, z


def _met(matrix: sp.bsr_array, prolong: Prolongation) -> tuple[Int32Array, Int32Array]:
    """Pattern of ``P^T A P``, ascending in its rows."""
    count = len(matrix.indptr) - 1
    nodes, groups = (
        sp.csr_array((np.ones(len(indices), dtype=bool), indices, indptr), (count, columns))
        for indptr, indices, columns in (
            (matrix.indptr, matrix.indices, count),
            (prolong.indptr, prolong.indices, prolong.groups),
        )
    )
    met = groups.T.tocsr() @ (nodes @ groups)
    met.sort_indices()
    return met.indptr, met.indices


@compiled(fastmath=_CONTRACT)
def _project(rows: _Rows, prolong: Prolongation, coarse: _Rows) -> None:
    """Add the blocks of ``P^T A P`` up to the diagonal to a matrix of zeros with its pattern."""
    indptr, indices, data = rows
    start, column, blocks, count = prolong
    first, other, result = coarse
    most = 0
    for k in range(count):
        most = max(most, first[k + 1] - first[k])
    # All groups met by the neighbours of a node are among those met by its own groups.
    images, groups = np.empty((most, data.shape[1], 6)), np.empty(most, np.int32)
    place = np.full(count, -1, np.int32)
    for i in range(start.size - 1):
        met = 0
        if start[i] == start[i + 1]:
            continue
        # Row i of A P.
        for s in range(indptr[i], indptr[i + 1]):
            j = indices[s]
            for t in range(start[j], start[j + 1]):
                k = column[t]
                if place[k] < 0:
                    place[k], groups[met] = met, k
                    _set_to_zero(images[met])
                    met += 1
                _add(data[s], blocks[t], images[place[k]])
        # P^T times that row of A P, into the blocks of the groups of node i.
        for t in range(start[i], start[i + 1]):
            row, left = column[t], blocks[t].T
            for e in range(met):
                k = groups[e]
                if k > row:
                    continue
                low, high = first[row], first[row + 1] - 1
                while low < high:
                    middle = (low + high) // 2
                    if other[middle] < k:
                        low = middle + 1
                    else:
                        high = middle
                _add(left, images[e], result[low])
        for e in range(met):
            place[groups[e]] = -1


@compiled
def _reflect(first: Int32Array, other: Int32Array, result: FloatArray) -> None:
    """Copy what is below the diagonal to above it."""
    place = np.empty(first.size - 1, np.int32)
    for i in range(first.size - 1):
        for s in range(first[i], first[i + 1]):
            j = other[s]
            if j == i:
                place[i] = s + 1
                break
            # Rows come in order, and so do the columns of row j beyond its diagonal.
            target = result[place[j]]
            for p in range(6):
                for c in range(6):
                    target[c, p] = result[s, p, c]
            place[j] += 1


# Cycles over aggregates: with a fast set-up and little memory, and by pyamg, smoothed with care.


_STRENGTH_QUICK = 0.02
"""Size of a block above which it is a strong connection, where one Jacobi step smooths."""

_DAMPING = 4.0 / 3.0
"""Jacobi step, times the highest eigenvalue of ``D^-1 A`` (Vanek, Mandel and Brezina, 1996)."""

_COARSEST = 50
"""Number of groups below which a level is inverted."""

_LARGEST_INVERSE = 500
"""Number of groups above which a level that does not coarsen is only swept."""

_SLOW = 0.8
"""Share of the nodes remaining above which a level does not coarsen."""


def quick_aggregation(matrix: sp.bsr_array, near_kernel: FloatArray) -> Apply:
    """One V-cycle of smoothed aggregation with a damped Jacobi step to smooth the prolongation.

    Besides the matrix (3n, 3n) of 3x3 blocks it stores half of it in single precision for the
    sweeps. The stiffness of the groups has full double precision, so that the cycle stays positive
    definite on slender parts. The near kernel (3n, 6) are rigid motions.
    """
    # Compiled once, for indices of one kind.
    level = (
        matrix.data,
        matrix.indices.astype(np.int32, copy=False),
        matrix.indptr.astype(np.int32, copy=False),
    )
    matrix = sp.bsr_array(level, shape=matrix.shape)
    motions = near_kernel.reshape(-1, 3, 6)
    levels: list[tuple[GaussSeidel, Prolongation]] = []
    while (nodes := len(motions)) > _COARSEST:
        sweeps = GaussSeidel(matrix, single=not levels)
        groups = aggregates(matrix, motions, _STRENGTH_QUICK)
        if not 0 < len(groups.near_kernel) < _SLOW * nodes:
            break
        highest = highest_eigenvalue(matrix, sweeps.jacobi)
        prolong = smoothed(matrix, sweeps.inverse, groups, _DAMPING / highest)
        levels.append((sweeps, prolong))
        matrix, motions = galerkin(matrix, prolong), groups.near_kernel
    cycle = _coarsest(matrix)
    for sweeps, prolong in reversed(levels):
        cycle = _group_cycle(sweeps, prolong, cycle)
    return cycle


def _group_cycle(sweeps: GaussSeidel, prolong: Prolongation, coarse: Apply) -> Apply:
    """Sweep forward, correct by the groups, sweep backward."""

    def apply(rhs: FloatArray) -> FloatArray:
        x, residual = sweeps.forward(rhs)
        prolong.add(coarse(prolong.restrict(residual)), x)
        return sweeps.backward(rhs, x)

    return apply


def _coarsest(matrix: sp.bsr_array) -> Apply:
    """Invert a matrix, or sweep over one that is too large for it."""
    if len(matrix.indptr) - 1 > _LARGEST_INVERSE:
        sweeps = GaussSeidel(matrix)
        return lambda rhs: sweeps.backward(rhs, sweeps.forward(rhs)[0])
    return _inverted(matrix)


def _inverted(matrix: sp.bsr_array) -> Apply:
    """Inverse; singular where a group is too small, or too straight, for six rigid motions."""
    inverse = np.linalg.pinv(matrix.toarray(), rcond=1e-12, hermitian=True)
    return lambda rhs: np.einsum("ij,j->i", inverse, rhs)


_STRENGTH, _STRENGTH_BELOW_QUADRATIC = 0.08, 0.04
"""Size of a block above which it is a strong connection. Below quadratic cells the lower one takes
fewer iterations on the Shell of Chen et al. 2021 (`benchmarks/speed/shell.py` prints them), and
about as many on sheets, arches and beams one to three cells high."""

_ENERGY = ("energy", {"krylov": "cg", "maxiter": 4, "degree": 1})
"""Smoothing of the prolongation."""


_FIRM = 0.55
"""Size of a block above which nodes of quadratic cells are solved for together. On the Shell .45 to
.85 take 44 to 64 iterations, single nodes more than 70 (measured)."""


@dataclass(frozen=True)
class Coarse:
    """Linear displacements as a subspace (3n, 3c) of those of a quadratic mesh, and nodes (c,)."""

    prolong: sp.bsr_array
    nodes: IntArray


def _cycle(
    smoother: GaussSeidel | ClusterSweeps, prolong: Any, restrict: Any, coarse: Apply
) -> Apply:
    """Sweep forward, correct in the coarse space, sweep backward: a symmetric cycle."""

    def apply(rhs: FloatArray) -> FloatArray:
        x, residual = smoother.forward(rhs)
        x += prolong @ coarse(restrict @ residual)
        return smoother.backward(rhs, x)

    return apply


def _twice(levels: Any, cycle: Apply) -> Apply:
    """Two cycles instead of one, unless the first level is inverted anyway."""
    if len(levels) == 1:
        return cycle

    def apply(rhs: FloatArray) -> FloatArray:
        x = cycle(rhs)
        return x + cycle(rhs - levels[0].A @ x)

    return apply


def _coarser(levels: Any, thorough: bool) -> Apply:
    """Cycle over the levels of a pyamg hierarchy, the last one inverted: V-cycle, or W-cycle."""
    level = levels[0]
    if len(levels) == 1:
        return _inverted(level.A)
    # Singular where an aggregate is too small, or too straight, for six rigid modes.
    smoother = GaussSeidel(sp.bsr_array(level.A), singular=True)
    cycle = _cycle(smoother, level.P, level.P.T, _coarser(levels[1:], thorough))
    return _twice(levels, cycle) if thorough else cycle


def smoothed_aggregation(
    matrix: sp.bsr_array, points: FloatArray, frugal: bool = False, thorough: bool = False
) -> Apply:
    """One cycle of smoothed aggregation with rigid-body modes.

    Vanek, Mandel and Brezina, Computing 56 (1996) 179-196; Olson, Schroder and Tuminaro, SIAM J.
    Sci. Comput. 33 (2011) 966-991.

    Parameters
    ----------
    matrix : bsr_array (3n, 3n) with 3x3 blocks
    points : (n, 3) array, mm; or (3n, 6) rigid motions
    frugal : bool, default False
        Whether a single damped Jacobi step smooths the prolongation (`quick_aggregation`); by
        default four steps reduce its energy. The set-up is several times as fast and needs less
        memory, but thin parts need up to twice the iterations.
    thorough : bool, default False
        Whether to use a W-cycle below the first level, as below quadratic cells. It keeps its
        convergence rate where a V-cycle loses it: on parts that are thin, curved and finely meshed.
    """
    near_kernel = points
    if points.shape[1] == 3:
        size = float(np.ptp(points, axis=0).max())
        near_kernel = rigid_modes((points - points.mean(axis=0)) / size)
    if frugal and not thorough:
        return quick_aggregation(matrix, near_kernel)
    import pyamg

    levels = pyamg.smoothed_aggregation_solver(
        sp.bsr_matrix(matrix),
        B=near_kernel,
        strength=("symmetric", {"theta": _STRENGTH_BELOW_QUADRATIC if thorough else _STRENGTH}),
        smooth=_ENERGY,
        improve_candidates=None,
        presmoother=None,
        postsmoother=None,
        max_coarse=_COARSEST,
        coarse_solver=None,
    ).levels
    if len(levels) == 1:
        return _inverted(levels[0].A)
    prolong = levels[0].P
    finest = GaussSeidel(matrix, single=True)
    return _cycle(finest, prolong, prolong.T, _coarser(levels[1:], thorough))


def two_level(matrix: sp.bsr_array, points: FloatArray, parents: IntArray | Coarse) -> Apply:
    """One cycle over a quadratic mesh and the linear displacements on the same cells.

    It combines block Gauss-Seidel on the quadratic displacement, over clusters of nodes that hold
    each other firmly, with a cycle of smoothed aggregation on the linear one, whose matrix is the
    Galerkin product. That cycle takes an eighth of the work.

    Parameters
    ----------
    matrix : bsr_array (3n, 3n) with 3x3 blocks
    points : (n, 3) array, mm; or (3n, 6) rigid motions
    parents : (n, 2) int array, or Coarse
        Rows of the two corners whose midpoint each node is (twice its own row for a corner), -1
        for a corner without a row; or the linear displacements, if the rows do not define them.
    """
    rough = parents if isinstance(parents, Coarse) else _from_corners(parents)
    prolong = rough.prolong
    along = None
    if points.shape[1] == 3:
        coarse_points = points[rough.nodes]
        along = points[:, np.ptp(points, axis=0).argmax()]
    else:
        coarse_points = points.reshape(-1, 3, 6)[rough.nodes].reshape(-1, 6)
    coarse = (prolong.T.tobsr() @ (matrix @ prolong)).tobsr((3, 3))
    coarse.sort_indices()
    below = smoothed_aggregation(coarse, coarse_points, thorough=True)
    of_node, _ = _grouped(*_strong(matrix, _FIRM))
    finest = ClusterSweeps(matrix, of_node, along)
    if parents is rough:
        return _cycle(finest, prolong.tocsr(), prolong.T.tocsr(), below)
    shape = len(points), len(coarse_points)
    weights = sp.csr_array((prolong.data[:, 0, 0], prolong.indices, prolong.indptr), shape)
    return _cycle(finest, _Weights(weights), _Weights(weights.T.tocsr()), below)


class _Weights(NamedTuple):
    """Weights of nodes, the same for their three components; ``@`` applies them to those."""

    values: sp.csr_array

    def __matmul__(self, x: FloatArray) -> FloatArray:
        return np.asarray(self.values @ x.reshape(-1, 3)).reshape(-1)


def _from_corners(parents: IntArray) -> Coarse:
    """Linear displacements of the corners: a midpoint takes the mean of its two."""
    n = len(parents)
    nodes = np.flatnonzero(parents[:, 0] == np.arange(n))
    place = np.zeros(n, dtype=np.int64)
    place[nodes] = np.arange(len(nodes))
    rows, columns = np.repeat(np.arange(n), 2), parents.reshape(-1)
    kept = columns >= 0
    weights = sp.csr_array(
        (np.full(int(kept.sum()), 0.5), (rows[kept], place[columns[kept]])), shape=(n, len(nodes))
    )
    blocks = weights.data[:, None, None] * np.eye(3)
    prolong = sp.bsr_array(
        (blocks, weights.indices, weights.indptr), shape=3 * np.array(weights.shape)
    )
    return Coarse(prolong, nodes)
