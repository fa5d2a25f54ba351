"""How the stiffness of a plate falls when all its fibre turns: f(theta) through solved angles."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from ccfem.base.arrays import FloatArray, freeze, read_only
from ccfem.base.errors import InputError
from ccfem.judging.evaluation.sensitivity import acute

ANGLES = (0.0, 5.0, *(10.0 * n for n in range(1, 10)))
"""Angles, degrees, at which the plate is solved (equation 1 of the paper, and 0)."""


@dataclass(frozen=True)
class Sensitivity:
    """f(theta) = min S / S(theta) through the strain energies of turned fibre.

    Equation 2 of the paper prints the reciprocal; its figures and the range 0 to 1
    stated in table 2 are those of this form.

    Attributes
    ----------
    angles : (k,) array, degrees
        Rising, from 0 to 90.
    energies : (k,) array, N mm
        Strain energy S with the fibre of every cell turned by that angle.
    """

    angles: FloatArray
    energies: FloatArray

    def __post_init__(self) -> None:
        freeze(self, angles=float, energies=float)
        if self.angles.shape != self.energies.shape or not (np.diff(self.angles) > 0.0).all():
            raise InputError(
                "a sensitivity curve needs rising angles with an energy each; got "
                f"{self.angles.tolist()} and {self.energies.shape[0]} energies"
            )
        if self.angles[0] != 0.0 or self.angles[-1] != 90.0 or not self.energies.min() > 0.0:
            raise InputError(
                "a sensitivity curve runs from 0 to 90 degrees with energies above 0; got "
                f"{self.angles[0]:g} to {self.angles[-1]:g} and {self.energies.min():g} N mm"
            )

    @cached_property
    def values(self) -> FloatArray:
        """Curve f at `angles`, in (0, 1]."""
        return read_only(self.energies.min() / self.energies)

    @cached_property
    def _curve(self) -> PchipInterpolator:
        # Mirrored at both ends, where the curve of an orthotropic sheet is level.
        angles, values = np.radians(self.angles), self.values
        before, after = -angles[1:3][::-1], np.pi - angles[-3:-1][::-1]
        return PchipInterpolator(
            np.concatenate([before, angles, after]),
            np.concatenate([values[1:3][::-1], values, values[-3:-1][::-1]]),
        )

    def __call__(self, angle: FloatArray) -> FloatArray:
        """Curve f at any angle (...,), radians, by monotone cubic interpolation (PCHIP)."""
        return np.asarray(self._curve(np.minimum(acute(angle), 0.5 * np.pi)))
