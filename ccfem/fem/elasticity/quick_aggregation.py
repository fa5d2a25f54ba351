"""Smoothed aggregation with a fast set-up and little memory."""

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray
from ccfem.fem.elasticity.aggregation import aggregates
from ccfem.fem.elasticity.conjugate_gradient import highest_eigenvalue
from ccfem.fem.elasticity.direct import Apply
from ccfem.fem.elasticity.galerkin import Prolongation, galerkin, smoothed
from ccfem.fem.elasticity.gauss_seidel import GaussSeidel

_STRENGTH = 0.02
"""Size of a block above which it is a strong connection."""

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

    Besides the matrix it stores half of it in single precision for the sweeps. The stiffness of the
    groups has full double precision, so that the cycle stays positive definite on slender parts.

    Parameters
    ----------
    matrix : bsr_array (3n, 3n) with 3x3 blocks
    near_kernel : (3n, 6) array
        Rigid motions.
    """
    # Compiled once, for indices of one kind.
    own = (
        matrix.data,
        matrix.indices.astype(np.int32, copy=False),
        matrix.indptr.astype(np.int32, copy=False),
    )
    matrix = sp.bsr_array(own, shape=matrix.shape)
    motions = near_kernel.reshape(-1, 3, 6)
    levels: list[tuple[GaussSeidel, Prolongation]] = []
    while (nodes := len(motions)) > _COARSEST:
        sweeps = GaussSeidel(matrix, single=not levels)
        groups = aggregates(matrix, motions, _STRENGTH)
        if not 0 < len(groups.near_kernel) < _SLOW * nodes:
            break
        highest = highest_eigenvalue(matrix, sweeps.jacobi)
        prolong = smoothed(matrix, sweeps.inverse, groups, _DAMPING / highest)
        levels.append((sweeps, prolong))
        matrix, motions = galerkin(matrix, prolong), groups.near_kernel
    cycle = _coarsest(matrix)
    for sweeps, prolong in reversed(levels):
        cycle = _cycle(sweeps, prolong, cycle)
    return cycle


def _cycle(sweeps: GaussSeidel, prolong: Prolongation, coarse: Apply) -> Apply:
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
    # Singular where a group is too small, or too straight, for six rigid motions.
    inverse = np.linalg.pinv(matrix.toarray(), rcond=1e-12, hermitian=True)
    return lambda rhs: np.einsum("ij,j->i", inverse, rhs)
