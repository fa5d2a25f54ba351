"""What one strand of fibre is worth: its axial stiffness and its strength."""

from dataclasses import dataclass

from ccfem.base.checks import check_fields

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
        check_fields(self, "rho", above=0.0, unit="mm^2")
        check_fields(self, "strength", above=0.0, unit="N")

    def stiffness(self, modulus: float) -> float:
        """EA, N, in a matrix with Young's modulus `modulus`, MPa."""
        return self.rho * modulus
