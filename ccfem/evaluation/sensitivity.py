"""How stiffness falls when the fibre turns away from the stress: the curve f(theta)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from ccfem.arrays import FloatArray, freeze, read_only
from ccfem.errors import InputError
from ccfem.materials import Material

__all__ = ["ANGLES", "Curve", "OffAxis", "Sensitivity", "acute", "plane_compliance"]

ANGLES = (0.0, 5.0, *(10.0 * n for n in range(1, 10)))
"""Angles, degrees, at which the plate is solved (Plocher et al. 2022, eq. 1, and 0)."""

Curve = Callable[[FloatArray], FloatArray]


def acute(angle: FloatArray) -> FloatArray:
    """Angle between lines, radians in [0, pi/2], of any angle (...,), radians."""
    turned = np.abs(angle) % np.pi
    return np.minimum(turned, np.pi - turned)


def plane_compliance(material: Material) -> FloatArray:
    """Compliance (3, 3), 1/MPa, of a sheet in plane stress, fibre along axis 1."""
    wanted = np.array([0, 1, 5])
    return np.linalg.inv(material.stiffness)[np.ix_(wanted, wanted)]


@dataclass(frozen=True)
class Sensitivity:
    """f(theta) = min S / S(theta) through the strain energies of turned fibre.

    Equation 2 of Plocher et al. (2022) prints the reciprocal; its figures and the range 0 to 1
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


@dataclass(frozen=True)
class OffAxis:
    """f(theta) of a sheet under uniform tension: the compliance at its best over that at theta.

    Attributes
    ----------
    material : Material
    """

    material: Material

    @cached_property
    def _compliance(self) -> FloatArray:
        return read_only(plane_compliance(self.material))

    def compliance(self, angle: FloatArray) -> FloatArray:
        """Strain along a unit stress at `angle` (...,), radians, to the fibre, 1/MPa.

        Jones, Mechanics of Composite Materials (1999), eq. 2.97.
        """
        s = self._compliance
        c2, s2 = np.cos(angle) ** 2, np.sin(angle) ** 2
        return s[0, 0] * c2 * c2 + s[1, 1] * s2 * s2 + (2.0 * s[0, 1] + s[2, 2]) * c2 * s2

    @cached_property
    def least(self) -> float:
        """Least compliance over all angles, 1/MPa.

        In x = sin^2 theta the compliance is a parabola: its vertex, or an end.
        """
        s = self._compliance
        cross = 2.0 * s[0, 1] + s[2, 2]
        bend = s[0, 0] + s[1, 1] - cross
        places = [0.0, 1.0]
        if bend > 0.0:
            places.append(float(np.clip((2.0 * s[0, 0] - cross) / (2.0 * bend), 0.0, 1.0)))
        return float(self.compliance(np.arcsin(np.sqrt(np.array(places)))).min())

    def __call__(self, angle: FloatArray) -> FloatArray:
        """Curve f at any angle (...,), radians, in (0, 1]."""
        return self.least / self.compliance(angle)
