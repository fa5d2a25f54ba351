"""The smoothness of a step of a load path: equations 4 and 5 of the paper."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ccfem.arrays import FloatArray

__all__ = ["Criterion", "coefficient"]


def coefficient(
    value: ArrayLike, limit: float, k: float = 1.0, eta: float = 1.0, epsilon: float = 0.1
) -> FloatArray:
    """Coefficient of one property of a step: ``gamma(z) = z / limit (k eta - eps) / k + eps``.

    Equation 4 of the paper. It is epsilon at 0 and grows by ``eta - epsilon / k`` to the limit, so
    that ``k = epsilon / eta`` makes a property not count.

    Parameters
    ----------
    value : array
        Angle alpha or beta, or distance d of a step.
    limit : float
        In the same unit.
    k, eta, epsilon : float
        Amplification, and the paper's two arbitrary constants.
    """
    return np.asarray(value) / limit * (k * eta - epsilon) / k + epsilon


@dataclass(frozen=True)
class Criterion:
    """What makes a step of a load path a good one.

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

        Parameters
        ----------
        turn, misalignment : arrays, degrees
        distance : array, mm
        """
        return (
            coefficient(turn, self.turn)
            * coefficient(misalignment, self.misalignment)
            * coefficient(distance, self.distance)
        )
