"""Multigrid preconditioners: smoothed aggregation, and two levels for quadratic cells."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.fem.elasticity.direct import Apply
from ccfem.fem.elasticity.gauss_seidel import GaussSeidel
from ccfem.fem.elasticity.held import rigid_modes
from ccfem.fem.elasticity.quick_aggregation import quick_aggregation

_COARSEST = 50
"""Number of aggregates below which a level is inverted."""


_STRENGTH, _STRENGTH_BELOW_QUADRATIC = 0.08, 0.04
"""Size of a block above which it is a strong connection. Below quadratic cells the lower one takes
fewer iterations on the Shell of Chen et al. 2021 (`benchmarks/speed/shell.py` prints them), and
about as many on sheets, arches and beams one to three cells high."""

_ENERGY = ("energy", {"krylov": "cg", "maxiter": 4, "degree": 1})
"""Smoothing of the prolongation."""


@dataclass(frozen=True)
class Coarse:
    """Linear displacements as a subspace of those of a quadratic mesh.

    Attributes
    ----------
    prolong : bsr_array (3n, 3c)
        From linear displacements to all displacements.
    nodes : (c,) int array
        Rows of the nodes of the linear displacements.
    """

    prolong: sp.bsr_array
    nodes: IntArray


def _cycle(smoother: GaussSeidel, prolong: Any, restrict: Any, coarse: Apply) -> Apply:
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
        # Singular for the same reason as blocks of other levels, below.
        inverse = np.linalg.pinv(level.A.toarray(), rcond=1e-12, hermitian=True)
        return lambda rhs: np.einsum("ij,j->i", inverse, rhs)
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
        Whether to use a W-cycle, as below quadratic cells. It keeps its convergence rate where a
        V-cycle loses it: on parts that are thin, curved and finely meshed.
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
    if thorough or len(levels) == 1:
        return _coarser(levels, thorough)
    prolong = levels[0].P
    finest = GaussSeidel(matrix, single=True)
    return _cycle(finest, prolong, prolong.T, _coarser(levels[1:], thorough))


def two_level(matrix: sp.bsr_array, points: FloatArray, parents: IntArray | Coarse) -> Apply:
    """One cycle over a quadratic mesh and the linear displacements on the same cells.

    It combines block Gauss-Seidel on the quadratic displacement with a W-cycle of smoothed
    aggregation on the linear one, whose matrix is the Galerkin product. The W-cycle takes an eighth
    of the work.

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
    if points.shape[1] == 3:
        coarse_points = points[rough.nodes]
    else:
        coarse_points = points.reshape(-1, 3, 6)[rough.nodes].reshape(-1, 6)
    coarse = (prolong.T.tobsr() @ (matrix @ prolong)).tobsr((3, 3))
    coarse.sort_indices()
    below = smoothed_aggregation(coarse, coarse_points, thorough=True)
    prolong, finest = prolong.tocsr(), GaussSeidel(matrix, single=True)
    return _cycle(finest, prolong, prolong.T.tocsr(), below)


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
