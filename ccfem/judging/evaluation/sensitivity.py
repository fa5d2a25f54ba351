"""How stiffness falls when the fibre turns away from the stress: the curve f(theta)."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ccfem.base.arrays import FloatArray, read_only
from ccfem.fem.materials import Material


def acute(angle: FloatArray) -> FloatArray:
    """Angle between lines, radians in [0, pi/2], of any angle (...,), radians."""
    turned = np.abs(angle) % np.pi
    return np.minimum(turned, np.pi - turned)


def plane_compliance(material: Material) -> FloatArray:
    """Compliance (3, 3), 1/MPa, of a sheet in plane stress, fibre along axis 1."""
    wanted = np.array([0, 1, 5])
    return np.linalg.inv(material.stiffness)[np.ix_(wanted, wanted)]


def strand_lamina(matrix: Material, share: float) -> Material:
    """Matrix with parallel strands along its axis 1, as the virtual test sees them.

    Strands are bars: they add stiffness along themselves alone.

    Parameters
    ----------
    share : float >= 0
        EA of a strand over Young's modulus of the matrix along axis 1, in mm^2, over the section
        that a strand has to itself.
    """
    stiffness = matrix.stiffness.copy()
    stiffness[0, 0] += share / plane_compliance(matrix)[0, 0]
    return replace(matrix, name=f"{matrix.name} with strands", stiffness=stiffness)


@dataclass(frozen=True)
class OffAxis:
    """f(theta) of a sheet under uniform tension: the compliance at its best over that at theta."""

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
