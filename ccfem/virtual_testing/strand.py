"""What one strand of fibre is worth: its axial stiffness and its strength."""

from dataclasses import dataclass

import numpy as np

from ccfem.checks import check_fields, check_number
from ccfem.machine.machine import Machine
from ccfem.materials import Material

__all__ = ["RHO", "RHO_SPAN", "Strand"]

RHO = 4.0
"""Default of EA/E, mm^2: axial stiffness of a strand over Young's modulus of the matrix."""

RHO_SPAN = (2.0, 6.0)
"""Span of EA/E, mm^2, within which printed parts are expected without a calibration print."""


@dataclass(frozen=True)
class Strand:
    """Axial stiffness and strength of one strand.

    Attributes
    ----------
    rho : float, mm^2, default 4
        EA/E with the modulus E of the matrix; stiffness ratios depend on it alone.
    axial_stiffness : float, N, optional
        EA; given, it goes before `rho`.
    strength : float, N, default 86
        Axial force that breaks the strand: 800 MPa times 0.1075 mm^2, a data sheet's value for
        carbon tow. None where it is not known.
    """

    rho: float = RHO
    axial_stiffness: float | None = None
    strength: float | None = 86.0

    def __post_init__(self) -> None:
        check_fields(self, "rho", above=0.0, unit="mm^2")
        check_fields(self, "axial_stiffness", "strength", above=0.0, unit="N")

    @classmethod
    def of(cls, material: Material, machine: Machine) -> "Strand":
        """Strand of a fibre material with the cross-section of a machine's filament.

        EA is the modulus along the fibre times `Machine.filament_area`; the strength is missing
        where the material has no tensile strength.
        """
        area = machine.filament_area
        check_number("machine.filament_area for a virtual test", area, above=0.0, unit="mm^2")
        modulus = 1.0 / np.linalg.inv(material.stiffness)[0, 0]
        tensile = material.tensile_strength
        return cls(
            axial_stiffness=float(modulus * area),
            strength=None if tensile is None else tensile * area,
        )

    def stiffness(self, modulus: float) -> float:
        """EA, N, in a matrix with Young's modulus `modulus`, MPa."""
        return self.rho * modulus if self.axial_stiffness is None else self.axial_stiffness
