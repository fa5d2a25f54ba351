"""Strengths of fibre, matrix and the bond between layers."""

from dataclasses import dataclass

from ccfem.base.errors import InputError
from ccfem.fem.materials import Material
from ccfem.judging.virtual_testing.strand import Strand


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
