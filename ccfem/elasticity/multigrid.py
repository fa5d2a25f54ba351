"""Multigrid preconditioners: smoothed aggregation, and two levels for quadratic cells."""

from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray
from ccfem.elasticity.direct import Apply
from ccfem.elasticity.supports import rigid_modes

__all__ = ["smoothed_aggregation"]


def smoothed_aggregation(matrix: sp.bsr_array, points: FloatArray) -> Apply:
    """One V-cycle of smoothed aggregation with rigid-body modes and energy-smoothed prolongation.

    Vanek, Mandel and Brezina, Computing 56 (1996) 179-196; Olson, Schroder and Tuminaro, SIAM J.
    Sci. Comput. 33 (2011) 966-991.
    """
    import pyamg

    size = float(np.ptp(points, axis=0).max())
    near_kernel = rigid_modes((points - points.mean(axis=0)) / size)
    sweeps = {name: ("block_gauss_seidel", {"sweep": name}) for name in ("forward", "backward")}
    levels: Any = pyamg.smoothed_aggregation_solver(
        sp.bsr_matrix(matrix),
        B=near_kernel,
        strength=("symmetric", {"theta": 0.08}),
        smooth=("energy", {"krylov": "cg", "maxiter": 4, "degree": 1}),
        improve_candidates=None,
        presmoother=sweeps["forward"],
        postsmoother=sweeps["backward"],
        max_coarse=300,
        coarse_solver="splu",
    )
    return levels.aspreconditioner(cycle="V").matvec
