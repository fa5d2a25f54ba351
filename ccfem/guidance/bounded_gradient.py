"""Fields whose layers keep within a range of thickness in every cell, and rise in every cell.

The nearest field to a given one under bounds of the gradient in each cell, by the alternating
direction method of multipliers (Boyd et al., Foundations and Trends in Machine Learning 3 (2011)
1): the equations stay the same, so that a step costs one solve with known factors.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from ccfem.arrays import BoolArray, FloatArray

__all__ = ["Bounds", "bounded"]

_WEIGHTS = (1.0, 5.0, 30.0)
"""Of the bounds against the target: low at first, for the nearest field, then high to get there."""
_STEPS = 40
"""Most steps with each."""
_INSIDE = 0.02
"""Share of a bound by which the aim lies within it."""


@dataclass(frozen=True)
class Bounds:
    """Bounds of a gradient.

    Attributes
    ----------
    least, most : float
        Of its length.
    up : (3,) array
        Unit vector along which it may not fall.
    """

    least: float
    most: float
    up: FloatArray

    def outside(self, gradient: FloatArray) -> BoolArray:
        """Which gradients (m, 3) do not lie within."""
        size = np.linalg.norm(gradient, axis=1)
        falling = gradient @ self.up < 0.0
        return np.asarray((size < self.least) | (size > self.most) | falling)

    def nearest(self, gradient: FloatArray) -> FloatArray:
        """Gradients (m, 3) within the bounds, and a little off them."""
        along = gradient @ self.up
        floor = _INSIDE * self.least
        rise = np.maximum(floor - along, 0.0)
        lifted = gradient + rise[:, None] * self.up
        size = np.linalg.norm(lifted, axis=1)
        low, high = (1.0 + _INSIDE) * self.least, (1.0 - _INSIDE) * self.most
        return np.asarray(lifted * (np.clip(size, low, high) / size)[:, None])


class _Field(Protocol):
    """A field on a mesh."""

    @property
    def gradient(self) -> FloatArray:
        """In the cells, (m, 3)."""
        ...


F = TypeVar("F", bound=_Field)


def bounded(
    target: FloatArray,
    bounds: Bounds,
    solve: Callable[[FloatArray], F],
    enough: Callable[[F], bool] | None = None,
) -> F:
    """Find the field near to a target whose gradient is within bounds.

    Parameters
    ----------
    target : (m, 3) array
        Gradient in the cells that is aimed at.
    bounds : Bounds
    solve : callable
        Returns the field whose gradient is nearest to a target.
    enough : callable, optional
        Whether a field will do; by default one that is within the bounds in every cell.

    Returns
    -------
    Field
        Within the bounds, or after the last step as near as it came.
    """
    found = solve(target)
    lag, before = np.zeros_like(target), _WEIGHTS[0]
    for weight in np.repeat(_WEIGHTS, _STEPS).tolist():
        if enough(found) if enough else not bounds.outside(found.gradient).any():
            break
        lag, before = lag * (before / weight), weight
        within = bounds.nearest(found.gradient + lag)
        lag = lag + found.gradient - within
        found = solve((target + weight * (within - lag)) / (1.0 + weight))
    return found
