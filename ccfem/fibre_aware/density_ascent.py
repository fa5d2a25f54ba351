"""Search for the density of fibre, of given total length, that makes a part stiffest.

The compliance is convex in the densities, and its derivative is proportional to the squared strain
along each direction. The optimality criterion multiplies each density by a power of the strain
(mirror ascent) and then scales all densities so that the length is met. Each step continues the
last one, as in Nesterov's method; this momentum restarts where the part gets softer. Without it
hundreds of solves would be needed.
"""

from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray, freeze

__all__ = ["DensityAscent"]

_EXPONENT = 1.4
"""Exponent of the strain in the optimality criterion. 1 is exact where the stress in the fibre is
given; where its strain is given, larger ones converge faster. From 2 on densities oscillate."""

_MOST_MOMENTUM = 0.9

_TRACE = 1e-9
"""Least density in each direction as a share of the largest: a density of 0 would stay 0."""

_BISECTIONS = 60


@dataclass(frozen=True)
class DensityAscent:
    """Densities of fibre in cells and directions during the search for the optimum.

    Attributes
    ----------
    volume : (m,) array, mm^3
        Of the cells.
    most : (m,) array, mm/mm^3
        Largest density of each cell, all directions together.
    length : float, mm
        Of fibre, at most what the cells can hold.
    density : (m, k) array, mm/mm^3
    stepped : (m, k) array, optional
        The density that the last step would have ended at without momentum.
    steps : int
        Number of steps since the momentum began.
    merit : float
        Merit of the last density; larger is better.
    """

    volume: FloatArray
    most: FloatArray
    length: float
    density: FloatArray
    stepped: FloatArray | None = None
    steps: int = 0
    merit: float = -np.inf

    def __post_init__(self) -> None:
        freeze(self, volume=float, most=float, density=float, stepped=float)

    @classmethod
    def even(
        cls, volume: FloatArray, most: FloatArray, length: float, directions: int
    ) -> "DensityAscent":
        """Start with the same share of its room in every cell, equally in all directions."""
        share = length / float(volume @ most) / directions
        return cls(volume, most, length, np.repeat(share * most[:, None], directions, axis=1))

    def step(self, stretch: FloatArray, merit: float) -> "DensityAscent":
        """Return the densities after a step.

        Parameters
        ----------
        stretch : (m, k) array
            Strain along each direction at the present density, not negative.
        merit : float
        Merit of the present density, which grows with the stiffness.
        """
        steps = self.steps + 1 if merit >= self.merit else 1
        power = (stretch / (float(stretch.max()) or 1.0)) ** _EXPONENT
        stepped = self._fitted(self.density * power)
        density, momentum = stepped, min((steps - 1.0) / (steps + 2.0), _MOST_MOMENTUM)
        if self.stepped is not None and momentum > 0.0:
            density = self._fitted(stepped * (stepped / self.stepped) ** momentum)
        return DensityAscent(self.volume, self.most, self.length, density, stepped, steps, merit)

    def _fitted(self, weight: FloatArray) -> FloatArray:
        """Densities proportional to weights (m, k), with the given length and within the room."""
        total = weight.sum(axis=1)
        low, high = 1e-12, 1e12
        for _ in range(_BISECTIONS):
            middle = float(np.sqrt(low * high))
            laid = float(self.volume @ np.minimum(self.most, total / middle))
            low, high = (middle, high) if laid > self.length else (low, middle)
        scale = np.minimum(self.most, total / high) / np.maximum(total, 1e-300)
        return np.maximum(weight * scale[:, None], _TRACE * self.most[:, None])
