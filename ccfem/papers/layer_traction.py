"""Traction of an averaged stress on the layers of a part, as the bond between them is judged."""

from collections.abc import Sequence

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.fem.elasticity.ball import BALL, ball_averages
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.judging.virtual_testing.failure_laws.interlayer import layer_normals
from ccfem.slicing.layers.layer import Layer


def layer_traction(
    stress: StressField, layers: Sequence[Layer], cells: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Traction at the middle of some cells (k,), MPa.

    Returns
    -------
    opening, sliding : (k,) arrays
        Across the layers, positive where it opens them, and the size of that along them.
    """
    mesh = stress.mesh
    centre = mesh.points[mesh.corners].mean(axis=1)
    values = stress.stress.reshape(-1, 9)
    tensor = ball_averages(centre, values, mesh.volumes, cells, BALL).reshape(-1, 3, 3)
    normal = layer_normals(layers, centre[cells])
    traction = np.einsum("mij,mj->mi", tensor, normal)
    opening = np.einsum("mi,mi->m", traction, normal)
    return opening, np.linalg.norm(traction - opening[:, None] * normal, axis=1)
