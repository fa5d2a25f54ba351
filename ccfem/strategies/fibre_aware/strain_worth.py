"""Worth of fibre as a function of its strain."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, freeze, in_brief
from ccfem.judging.virtual_testing.near_failure import POWER


@dataclass(frozen=True)
class StrainWorth:
    """Worth of a mm of stretched fibre by its strain e under one load case.

    It is ``squared e^2 + mixed e a - peak (e / most)^16``, where a is the strain in an adjoint
    displacement. The first term is the worth for the stiffness. For the load at first failure, the
    second says how far the fibre relieves the places that fail first, and the third how near to
    failure it is itself. Fibre that is not stretched is worth nothing.

    Attributes
    ----------
    displacement : (n, 3) array, mm
    adjoint : (n, 3) array, mm, optional
        None where only the squared strain counts.
    most : float
        The largest strain of the fibre.
    """

    squared: float
    displacement: FloatArray
    mixed: float = 0.0
    adjoint: FloatArray | None = None
    peak: float = 0.0
    most: float = 1.0

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, displacement=float, adjoint=float)

    def value(self, strain: FloatArray, adjoint: FloatArray) -> FloatArray:
        """Value (s,) of pieces of fibre, per mm, at strains (s,) of both displacements."""
        stretch = np.maximum(strain, 0.0)
        at_peak = self.peak * (stretch / self.most) ** POWER
        return np.asarray(self.squared * stretch**2 + self.mixed * stretch * adjoint - at_peak)
