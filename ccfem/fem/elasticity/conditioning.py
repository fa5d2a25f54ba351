"""Causes of ill-conditioned equations of a part, and their cures."""

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.body.mesh.check import about_slivers
from ccfem.fem.elasticity.problem import Problem

_NEARLY_INCOMPRESSIBLE = 500.0
"""Bulk over shear modulus above which there is a remark: Poisson's ratio 0.499."""
_CONTRAST = 1e5
"""Largest over least stiffness of the cells above which there is a remark."""


def incompressibility(stiffness: FloatArray) -> float:
    """Bulk modulus over the least shear modulus, as the maximum over all cells.

    Parameters
    ----------
    stiffness : (6, 6) or (m, 6, 6) array, MPa

    Returns
    -------
    float
        ``2 (1 + nu) / (3 (1 - 2 nu))`` of an isotropic material: 2.2 at nu 0.3, 9.7 at 0.45.
    """
    compliance = np.linalg.inv(stiffness.reshape(-1, 6, 6))
    bulk = 1.0 / compliance[:, :3, :3].sum(axis=(1, 2))
    shear = 1.0 / np.linalg.eigvalsh(compliance)[:, -1]  # of the softest change of shape
    return float((bulk / shear).max())


def stiffness_contrast(stiffness: FloatArray, density: FloatArray | None) -> float:
    """Largest over least stiffness of the cells."""
    size = np.trace(stiffness.reshape(-1, 6, 6), axis1=1, axis2=2)
    size = size if density is None else size * density
    return float(size.max() / size.min())


def about_conditioning(problem: Problem) -> str:
    """Say what makes the equations of a problem ill-conditioned, each with its cure."""
    warnings, stiffness = [about_slivers(problem.mesh)], problem.cell_stiffness
    bulk = incompressibility(stiffness)
    if bulk > _NEARLY_INCOMPRESSIBLE:
        warnings.append(
            f"the material is nearly incompressible, {bulk:.2g} times as stiff in volume as in "
            "shape: take a Poisson's ratio of 0.49 or less, or a direct backend"
        )
    contrast = stiffness_contrast(stiffness, problem.density)
    if contrast > _CONTRAST:
        warnings.append(
            f"the stiffest cell is {contrast:.2g} times as stiff as the softest: raise the least "
            "density or stiffness"
        )
    warnings = [text for text in warnings if text]
    return "; ".join(warnings) or (
        "no single cell is to blame: the part is slender, or held at very little; hold it wider, "
        "or take a direct backend"
    )
