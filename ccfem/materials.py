"""Materials: stiffness, strengths, and where the numbers come from."""

from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray, read_only
from ccfem.errors import InputError

__all__ = ["Material", "isotropic", "transversely_isotropic"]


@dataclass(frozen=True)
class Material:
    """A linear elastic material.

    Attributes
    ----------
    name : str
    stiffness : (6, 6) array, MPa
        In material axes (fibre along axis 1), Voigt order of `ccfem.tensor`.
    tensile_strength, compressive_strength : float or None, MPa
        Along axis 1.
    source : str
        Where the numbers come from, and which of them are assumed.
    """

    name: str
    stiffness: FloatArray
    tensile_strength: float | None = None
    compressive_strength: float | None = None
    source: str = ""

    def __post_init__(self) -> None:
        stiffness = read_only(self.stiffness)
        object.__setattr__(self, "stiffness", stiffness)
        if stiffness.shape != (6, 6) or not np.allclose(stiffness, stiffness.T, rtol=1e-9):
            raise InputError(
                f"material '{self.name}': stiffness must be a symmetric (6, 6) matrix in MPa; "
                f"got shape {stiffness.shape}"
            )
        if not np.isfinite(stiffness).all() or np.linalg.eigvalsh(stiffness).min() <= 0.0:
            raise InputError(
                f"material '{self.name}': stiffness must be finite and positive definite; check "
                "the moduli and Poisson's ratios"
            )


def isotropic(
    modulus: float,
    poisson: float,
    name: str = "isotropic",
    tensile_strength: float | None = None,
    compressive_strength: float | None = None,
    source: str = "",
) -> Material:
    """Isotropic material from Young's modulus, MPa, and Poisson's ratio in (-1, 0.5)."""
    if not modulus > 0.0 or not -1.0 < poisson < 0.5:
        raise InputError(
            f"material '{name}': expected modulus > 0 MPa and -1 < poisson < 0.5; got "
            f"{modulus} and {poisson}"
        )
    lame = modulus * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    shear = modulus / (2.0 * (1.0 + poisson))
    stiffness = np.diag([2.0 * shear] * 3 + [shear] * 3)
    stiffness[:3, :3] += lame
    return Material(name, stiffness, tensile_strength, compressive_strength, source)


def transversely_isotropic(
    modulus_fibre: float,
    modulus_transverse: float,
    poisson_fibre: float,
    shear_fibre: float,
    poisson_transverse: float = 0.45,
    name: str = "transversely isotropic",
    tensile_strength: float | None = None,
    compressive_strength: float | None = None,
    source: str = "",
) -> Material:
    """Transversely isotropic material with the fibre along axis 1, moduli in MPa.

    Parameters
    ----------
    modulus_fibre, modulus_transverse, shear_fibre : float, MPa
        E1, E2 = E3 and G12 = G13.
    poisson_fibre : float
        nu12 = nu13, with ``|nu12| < sqrt(E1 / E2)``.
    poisson_transverse : float, default 0.45
        nu23; unidirectional polymer composites have 0.35 to 0.5.
    """
    e1, e2, nu, nu23 = modulus_fibre, modulus_transverse, poisson_fibre, poisson_transverse
    if not (min(e1, e2, shear_fibre) > 0.0 and -1.0 < nu23 < 1.0 - 2.0 * nu * nu * e2 / e1):
        raise InputError(
            f"material '{name}': expected positive moduli and -1 < nu23 < 1 - 2 nu12^2 E2/E1 = "
            f"{1.0 - 2.0 * nu * nu * e2 / e1 if e1 else float('nan'):.3f}; got E1 {e1}, E2 {e2}, "
            f"G12 {shear_fibre}, nu12 {nu}, nu23 {nu23}"
        )
    compliance = np.diag(
        [1 / e1, 1 / e2, 1 / e2, 2 * (1 + nu23) / e2, 1 / shear_fibre, 1 / shear_fibre]
    )
    compliance[0, 1:3] = compliance[1:3, 0] = -nu / e1
    compliance[1, 2] = compliance[2, 1] = -nu23 / e2
    stiffness = np.linalg.inv(compliance)
    stiffness = 0.5 * (stiffness + stiffness.T)
    return Material(name, stiffness, tensile_strength, compressive_strength, source)
