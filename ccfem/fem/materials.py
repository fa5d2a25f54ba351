"""Materials: stiffness, strengths, and where the numbers come from."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, freeze
from ccfem.base.checks import (
    EXPANSION,
    MASS_DENSITY,
    MODULUS,
    STRENGTH,
    Range,
    check_fields,
    check_known,
    check_number,
)
from ccfem.base.errors import InputError
from ccfem.base.toml import read_toml


@dataclass(frozen=True)
class Material:
    """A linear elastic material.

    Attributes
    ----------
    stiffness : (6, 6) array, MPa
        In material axes (fibre along axis 1), Voigt order of `ccfem.base.tensor`.
    tensile_strength, compressive_strength : float or None, MPa
        Along axis 1.
    source : str
        Where the numbers come from, and which of them are assumed.
    mass_density : float or None, g/cm^3
    expansion : tuple of 3 floats or None, 1/K
        Thermal strain along axes 1, 2 and 3.
    interlayer_tensile : float or None, MPa
        Strength of the bond between printed layers, normal to them: that of a bar printed upright,
        over its gross area.
    interlayer_shear : float or None, MPa
        The same for shear along the layers; if None, `interlayer_tensile` is used. A bar with
        layers at 45 degrees that fails at s gives it: ``1 / shear^2 = 4 / s^2 - 1 / tensile^2``.
    """

    name: str
    stiffness: FloatArray
    tensile_strength: float | None = None
    compressive_strength: float | None = None
    source: str = ""
    mass_density: float | None = None
    expansion: tuple[float, float, float] | None = None
    interlayer_tensile: float | None = None
    interlayer_shear: float | None = None

    def __repr__(self) -> str:
        modulus = 1.0 / np.linalg.inv(self.stiffness)[0, 0]
        return f"Material {self.name}: {modulus:.4g} MPa along axis 1"

    def __post_init__(self) -> None:
        freeze(self, stiffness=float)
        check_fields(self, "tensile_strength", "compressive_strength", above=0.0, unit="MPa")
        check_fields(self, "interlayer_tensile", "interlayer_shear", above=0.0, unit="MPa")
        if self.interlayer_shear is not None and self.interlayer_tensile is None:
            raise InputError(
                f"material '{self.name}': interlayer_shear needs interlayer_tensile beside it; got "
                f"{self.interlayer_shear:g} MPa alone: give both"
            )
        stiffness = self.stiffness
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
        if self.mass_density is not None and not 0.0 < self.mass_density < np.inf:
            raise InputError(
                f"material '{self.name}': mass density must be above 0 g/cm^3; got "
                f"{self.mass_density}: give it as 1.24"
            )
        if self.expansion is not None and not np.isfinite(self.expansion).all():
            raise InputError(
                f"material '{self.name}': expansion must be finite numbers, 1/K; got "
                f"{self.expansion}: give it as 7e-5"
            )
        for what, value, sizes in self.sizes:
            sizes.check(f"{what} of material '{self.name}'", value)

    @property
    def sizes(self) -> tuple[tuple[str, float, Range], ...]:
        """Each number of the material: what it is, its value, and the range that it should have.

        Of several moduli, and of several expansions, the least and the largest.
        """
        moduli = 1.0 / np.diag(np.linalg.inv(self.stiffness))[:3]
        expansion = np.unique(self.expansion or ())
        constants = [
            ("modulus", float(x), MODULUS) for x in np.unique([moduli.min(), moduli.max()])
        ]
        constants += [
            ("expansion", float(x), EXPANSION) for x in expansion[[0, -1][: len(expansion)]]
        ]
        optional = (
            ("tensile strength", self.tensile_strength, STRENGTH),
            ("compressive strength", self.compressive_strength, STRENGTH),
            ("strength between layers", self.interlayer_tensile, STRENGTH),
            ("shear strength between layers", self.interlayer_shear, STRENGTH),
            ("mass density", self.mass_density, MASS_DENSITY),
        )
        constants += [(what, x, sizes) for what, x, sizes in optional if x is not None]
        return tuple(constants)


def isotropic(
    modulus: float,
    poisson: float,
    name: str = "isotropic",
    tensile_strength: float | None = None,
    compressive_strength: float | None = None,
    source: str = "",
    mass_density: float | None = None,
    expansion: float | None = None,
    interlayer_tensile: float | None = None,
    interlayer_shear: float | None = None,
) -> Material:
    """Isotropic material from Young's modulus, MPa, and Poisson's ratio in (-1, 0.5).

    Mass density in g/cm^3, expansion by heat in 1/K; strengths, MPa, as those of `Material`.
    """
    check_number(f"modulus of material '{name}'", modulus, above=0.0, unit="MPa")
    check_number(f"poisson of material '{name}'", poisson, above=-1.0, below=0.5)
    lame = modulus * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    shear = modulus / (2.0 * (1.0 + poisson))
    stiffness = np.diag([2.0 * shear] * 3 + [shear] * 3)
    stiffness[:3, :3] += lame
    heat = None if expansion is None else (expansion, expansion, expansion)
    return Material(
        name,
        stiffness,
        tensile_strength,
        compressive_strength,
        source,
        mass_density,
        heat,
        interlayer_tensile,
        interlayer_shear,
    )


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
    mass_density: float | None = None,
    expansion_fibre: float | None = None,
    expansion_transverse: float | None = None,
    interlayer_tensile: float | None = None,
    interlayer_shear: float | None = None,
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
    mass_density : float, g/cm^3, optional
    expansion_fibre, expansion_transverse : float, 1/K, optional
        Both or none.
    interlayer_tensile, interlayer_shear : float, MPa, optional
        Strengths of the bond between layers: see `Material`.
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
    if (expansion_fibre is None) != (expansion_transverse is None):
        raise InputError(f"material '{name}': expansion along and across the fibre go together")
    heat = None
    if expansion_fibre is not None and expansion_transverse is not None:
        heat = (expansion_fibre, expansion_transverse, expansion_transverse)
    return Material(
        name,
        stiffness,
        tensile_strength,
        compressive_strength,
        source,
        mass_density,
        heat,
        interlayer_tensile,
        interlayer_shear,
    )


def plane_stress(
    modulus_fibre: float, modulus_transverse: float, poisson_fibre: float, shear_fibre: float
) -> FloatArray:
    """Reduced stiffness of a thin sheet with the fibre along axis 1.

    Parameters
    ----------
    modulus_fibre, modulus_transverse, shear_fibre : float, MPa
        E1, E2 and G12.
    poisson_fibre : float
        nu12, with ``|nu12| < sqrt(E1 / E2)``.

    Returns
    -------
    (3, 3) array, MPa
        Q with ``[s11, s22, s12] = Q @ [e11, e22, 2 e12]`` (Jones, Mechanics of Composite
        Materials, 1999, eq. 2.66).
    """
    e1, e2, nu = modulus_fibre, modulus_transverse, poisson_fibre
    if not (min(e1, e2, shear_fibre) > 0.0 and nu * nu < e1 / e2):
        raise InputError(
            f"plane stress: expected positive moduli and nu12^2 < E1/E2; got E1 {e1}, E2 {e2}, "
            f"G12 {shear_fibre}, nu12 {nu}"
        )
    rest = 1.0 - nu * nu * e2 / e1
    q12 = nu * e2 / rest
    return np.array([[e1 / rest, q12, 0.0], [q12, e2 / rest, 0.0], [0.0, 0.0, shear_fibre]])


@cache
def _table() -> Mapping[str, Mapping[str, Any]]:
    """Arguments of `isotropic` or `transversely_isotropic` by name of the material."""
    return read_toml(Path(__file__).with_name("materials.toml"), "table of materials")


def material_names() -> tuple[str, ...]:
    """Names of the materials of the table."""
    return tuple(sorted([*_table(), "printed_pla"]))


def named_material(name: str) -> Material:
    """Material of the table; its `source` says which of its numbers are assumed."""
    check_known("material", name, material_names())
    if name == "printed_pla":
        return printed_pla()  # as in the cases that come with ccfem
    values = _table()[name]
    return (isotropic if "modulus" in values else transversely_isotropic)(name=name, **values)


def printed_pla() -> Material:
    """PLA+ with the modulus taken for the parts of Chen et al. 2021: 3500 MPa, nu 0.35.

    Both are assumed, as for a dense print; the strengths are those of ``pla_plus`` in the table.
    """
    table = named_material("pla_plus")
    return isotropic(
        3500.0,
        0.35,
        "PLA+",
        table.tensile_strength,
        table.compressive_strength,
        f"assumed: modulus and Poisson's ratio; strengths: {table.source}",
        interlayer_tensile=table.interlayer_tensile,
        interlayer_shear=table.interlayer_shear,
    )
