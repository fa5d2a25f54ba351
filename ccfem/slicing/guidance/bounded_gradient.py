"""Fields whose layers stay within a range of thickness, and rise, in every cell.

The field nearest to a given one, under bounds on the gradient in each cell, is found by the
alternating direction method of multipliers (Boyd et al., Foundations and Trends in Machine Learning
3 (2011) 1). The equations stay the same, so each step costs one solve with known factors.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray

_WEIGHTS = (1.0, 5.0, 30.0)
"""Weights of the bounds against the target: low first, for the nearest field, then high, to meet
the bounds."""
_STEPS = 40
"""Most steps with each weight."""
_INSIDE = 0.02
"""Share of a bound by which the aim lies inside it."""


@dataclass(frozen=True)
class Bounds:
    """Bounds of the size of a gradient, and a unit vector (3,) along which it must not fall."""

    least: float
    most: float
    up: FloatArray

    def outside(self, gradient: FloatArray) -> BoolArray:
        """Mask of the gradients (m, 3) that are outside the bounds."""
        size = np.linalg.norm(gradient, axis=1)
        falling = gradient @ self.up < 0.0
        return np.asarray((size < self.least) | (size > self.most) | falling)

    def nearest(self, gradient: FloatArray) -> FloatArray:
        """Nearest gradients (m, 3) within the bounds, slightly inside them."""
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
    """Find the field nearest to a target whose gradient is within bounds.

    Parameters
    ----------
    target : (m, 3) array
        Wanted gradient in the cells.
    solve : callable
        Returns the field whose gradient is nearest to a target.
    enough : callable, optional
        Whether a field is good enough; by default if it is within the bounds in every cell.

    Returns
    -------
    Field
        Within the bounds, or as near as it came in the last step.
    """
    field = solve(target)
    lag, before = np.zeros_like(target), _WEIGHTS[0]
    for weight in np.repeat(_WEIGHTS, _STEPS).tolist():
        if enough(field) if enough else not bounds.outside(field.gradient).any():
            break
        lag, before = lag * (before / weight), weight
        within = bounds.nearest(field.gradient + lag)
        lag = lag + field.gradient - within
        field = solve((target + weight * (within - lag)) / (1.0 + weight))
    return field
