"""Layers that part: when the bond between them gives way, and what a cell keeps after that.

The stress of the matrix is averaged over a ball, as in `ccfem.judging.virtual_testing.failure_laws.
interlayer`, so that the size of the cells matters little (averaging over a length: Whitney and
Nuismer, J. Composite Materials 8, 1974, 253-265). Where the traction of that mean on the layer
reaches the strength of the bond, the layers of the cell part: it then carries stress within its
layers alone.
"""

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.tensor import from_voigt
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity.zone import BALL, ball_averages
from ccfem.judging.virtual_testing.failure_laws import interlayer
from ccfem.judging.virtual_testing.strand import Limits

_LEFT = 1e-3
"""Share that parted layers keep of what they carried across: no part falls to pieces."""


def parting_factors(
    mesh: TetMesh,
    stress: FloatArray,
    limits: Limits,
    normal: FloatArray,
    judged: IntArray,
    most: float = np.inf,
) -> FloatArray:
    """Factors (m,) on a load at which the layers of each cell part; infinite above `most`.

    Parameters
    ----------
    stress : (m, 6) array, MPa
        Of the matrix, in Voigt order.
    limits : Limits
        With strengths of the bond; without them nothing parts.
    normal : (m, 3) array
        Unit normals of the layers in the cells.
    judged : (k,) int array
        Cells whose layers may part.
    """
    factors = np.full(len(stress), np.inf)
    tensor = from_voigt(stress)
    alone = interlayer.index(tensor, limits, normal)
    if alone is None:
        return factors
    # The index is convex: a mean over a ball never exceeds the largest in it.
    hot = alone >= 1.0 / most
    if not hot.any():
        return factors
    centres = mesh.centres
    if not hot.all():
        away, _ = cKDTree(centres[hot]).query(centres[judged], distance_upper_bound=1.001 * BALL)
        judged = judged[np.isfinite(away)]
    mean = ball_averages(centres, tensor.reshape(-1, 9), mesh.volumes, judged, BALL)
    index = interlayer.index(mean.reshape(-1, 3, 3), limits, normal[judged])
    with np.errstate(divide="ignore"):
        factors[judged] = 1.0 / np.asarray(index)
    return np.where(factors <= most, factors, np.inf)


def parted_stiffness(stiffness: FloatArray, normal: FloatArray) -> FloatArray:
    """Stiffness (k, 6, 6) of cells without traction on their layers, but for a thousandth of it.

    Parameters
    ----------
    stiffness : (6, 6) or (k, 6, 6) array, MPa
    normal : (k, 3) array
    """
    x, y, z = normal.T
    none = np.zeros_like(x)
    # Traction (3,) on the layer is this times stress; its transpose makes strain of an opening.
    rows = [[x, none, none, none, z, y], [none, y, none, z, none, x], [none, none, z, y, x, none]]
    on = np.moveaxis(np.array(rows), 2, 0)
    across = stiffness @ on.transpose(0, 2, 1)
    lost = across @ np.linalg.solve(on @ across, across.transpose(0, 2, 1))
    return np.asarray(stiffness - (1.0 - _LEFT) * lost)
