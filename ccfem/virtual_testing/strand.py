"""What one strand of fibre is worth: its axial stiffness and its strength."""

from dataclasses import dataclass

import numpy as np

from ccfem.errors import InputError

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
    strength : float, N, default 86
        Axial force that breaks the strand: 800 MPa times 0.1075 mm^2, a data sheet's value for
        carbon tow. None where it is not known.
    """

    rho: float = RHO
    strength: float | None = 86.0

    def __post_init__(self) -> None:
        for name in ("rho", "strength"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.inf:
                raise InputError(f"strand.{name} must be a finite number > 0; got {value}")

    def stiffness(self, modulus: float) -> float:
        """EA, N, in a matrix with Young's modulus `modulus`, MPa."""
        return self.rho * modulus
