"""The smoothness of a step of a load path: equations 4 and 5 of the paper."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray

_EPSILON = 0.1
"""Coefficient of a property that is 0, an arbitrary constant of the paper. Its two others, the
amplification k and eta, are 1."""


@dataclass(frozen=True)
class Criterion:
    """Criterion for a good step of a load path.

    Attributes
    ----------
    turn : float, degrees
        Limit of the angle alpha between one step and the next.
    misalignment : float, degrees
        Limit of the angle beta between a step and the stress.
    distance : float, mm
        Limit of the length d of a step.
    """

    turn: float = 75.0
    misalignment: float = 60.0
    distance: float = 3.0

    def __call__(self, turn: ArrayLike, misalignment: ArrayLike, distance: ArrayLike) -> FloatArray:
        """Smoothness of steps, the smaller the better: equation 5, the product over all properties.

        Each property contributes its coefficient (equation 4): 0.1 at 0, and 1 at the limit.

        Parameters
        ----------
        turn, misalignment : arrays, degrees
        distance : array, mm
        """
        return (
            _coefficient(turn, self.turn)
            * _coefficient(misalignment, self.misalignment)
            * _coefficient(distance, self.distance)
        )


def _coefficient(value: ArrayLike, limit: float) -> FloatArray:
    return np.asarray(value) / limit * (1.0 - _EPSILON) + _EPSILON
