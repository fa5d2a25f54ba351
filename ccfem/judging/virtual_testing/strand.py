"""What one strand of fibre is worth, axial stiffness and strength, and what it is held in."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, freeze
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.fem.materials import Material

RHO = 4.0
"""Default of EA/E, mm^2: axial stiffness of a strand over Young's modulus of the matrix."""

RHO_SPAN = (2.0, 6.0)
"""Span of EA/E, mm^2, within which printed parts are expected without a calibration print."""

STRENGTH = 105.0
"""Axial force, N, averaged over 5 mm, at which a strand breaks.

It is the highest that published prints carried: at the measured breaking loads of Chen et al. 2021,
with EA/E = 4 mm^2, 104 N in the Loop and 105 N in the pulled Shell (the authors' paths), and 99 N
in the Shell's zigzag. The others stayed below, as parts do in which something else fails first: 65
N in the Loop's zigzag, whose layers came apart, 41 and 56 N in the Shell that was pushed. A data
sheet's 800 MPa times 0.1075 mm^2 is 86 N. Between solids expect 15 % more or less."""


@dataclass(frozen=True)
class Strand:
    """Axial stiffness and strength of one strand.

    Attributes
    ----------
    rho : float, mm^2, default 4
        EA/E with the modulus E of the matrix; stiffness ratios depend on it alone.
    strength : float, N, default 105
        Axial force, averaged over 5 mm, that breaks the strand; None where it is not known.
    """

    rho: float = RHO
    strength: float | None = STRENGTH

    def __post_init__(self) -> None:
        check_fields(self, "rho", above=0.0, unit="mm^2")
        check_fields(self, "strength", above=0.0, unit="N")

    def stiffness(self, modulus: float) -> float:
        """EA, N, in a matrix with Young's modulus `modulus`, MPa."""
        return self.rho * modulus


# Strengths of fibre, matrix and the bond between layers, and what a law of failure returns.


@dataclass(frozen=True)
class Limits:
    """Strengths of a part with fibre.

    Attributes
    ----------
    fibre : float, N
        Axial force that breaks a strand.
    matrix : float, MPa
        Von Mises stress at failure.
    bond : (float, float), MPa, optional
        Strength of the bond across the layers and in their plane; None where it is not known.
    """

    fibre: float
    matrix: float
    bond: tuple[float, float] | None = None

    @classmethod
    def of(
        cls, material: Material, strand: Strand | None = None, matrix_strength: float | None = None
    ) -> "Limits":
        """Strengths of a material with strands in it; `matrix_strength` overrides its own.

        Raises
        ------
        InputError
            When the strength of matrix or fibre is missing.
        """
        fibre = (Strand() if strand is None else strand).strength
        if fibre is None:
            raise InputError(
                "first-failure load needs the strength of a strand, N; the fibre material has "
                "none: give tensile_strength (MPa), or Strand(strength=...)"
            )
        matrix = material.tensile_strength if matrix_strength is None else matrix_strength
        if matrix is None:
            raise InputError(
                "first-failure load needs the strength of the matrix, MPa; material "
                f"'{material.name}' has none: give tensile_strength, or calibrate it on a test of "
                "the unreinforced part"
            )
        across, along = material.interlayer_tensile, material.interlayer_shear
        bond = None if across is None else (across, across if along is None else along)
        return cls(fibre, matrix, bond)


@dataclass(frozen=True)
class Failure:
    """Where a law of failure says that a part fails first, and at which load.

    Attributes
    ----------
    load : float, N
        Infinite where it never fails; NaN where that was not judged.
    where : (3,) array, mm
        NaN where it was not judged.
    note : str
        Why it was not judged, or what is doubtful about it; else empty.
    values : mapping of str to value
        Further fields of `FirstFailure` that the law sets.
    """

    load: float = np.nan
    where: FloatArray = field(default_factory=lambda: np.full(3, np.nan))
    note: str = ""
    values: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        freeze(self, where=float, values=dict)
