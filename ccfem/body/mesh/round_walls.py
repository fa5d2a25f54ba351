"""True round walls of a part, cylinders, cones and spheres, which a mesh follows by chords only."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, freeze

_STEPS = 5
"""Newton steps onto a wall: each doubles the digits."""
_ACROSS = 0.95
"""Squared cosine between the normals of two surfaces from which they have no line in common."""
_FACING = 0.5
"""Least cosine between the normal of a wall and that of a facet on it: a chord's is nearly 1."""
_SLACK = 1e-3
"""Distance of nodes from the wall that they lie on, in radii, beside what is known of it."""


@dataclass(frozen=True)
class RoundWall:
    """A cylinder, a cone or a sphere that part of a boundary lies on.

    Attributes
    ----------
    centre : (3,) array, mm
        A point of the axis of a cylinder or a cone; the centre of a sphere.
    direction : (3,) array
        Of length 1, along the axis; zero for a sphere.
    radius : float, mm
        At the centre.
    slope : float
        Growth of the radius along the direction: 0 but for a cone.
    hollow : bool
        Whether it is the wall of a hole, with the part outside of it.
    tolerance : float, mm
        Distance within which nodes lie on it.
    low, high : float, mm
        Where it begins and ends along its direction, from the centre.
    area : float, mm^2
        Of the part of the boundary that lies on it.
    start : (3,) array, mm, optional
        A place on it where the points of sections begin, so that they turn with the part.
    """

    centre: FloatArray
    direction: FloatArray
    radius: float
    slope: float = 0.0
    hollow: bool = False
    tolerance: float = 0.0
    low: float = -np.inf
    high: float = np.inf
    area: float = 0.0
    start: FloatArray | None = None

    def __post_init__(self) -> None:
        freeze(self, centre=float, direction=float, start=float)

    @classmethod
    def from_row(cls, row: FloatArray) -> "RoundWall":
        """Wall of a `row`."""
        slope, radius, hollow, *rest = row[6:].tolist()
        return cls(row[:3], row[3:6], radius, slope, bool(hollow), *rest)

    @property
    def row(self) -> FloatArray:
        """The wall as numbers, (13,)."""
        rest = (
            self.slope,
            self.radius,
            self.hollow,
            self.tolerance,
            self.low,
            self.high,
            self.area,
        )
        return np.array([*self.centre, *self.direction, *rest])

    def distances(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distances (k,), mm, of places (k, 3) from the wall, and unit normals (k, 3).

        Both point away from the axis or the centre, whichever side the part is on.
        """
        arm = places - self.centre
        height = arm @ self.direction
        arm -= np.outer(height, self.direction)
        away = np.linalg.norm(arm, axis=1)
        radial = arm / np.maximum(away, 1e-300)[:, None]
        steep = np.hypot(1.0, self.slope)
        distance = (away - self.radius - self.slope * height) / steep
        return distance, (radial - self.slope * self.direction) / steep

    def normals_at(self, places: FloatArray) -> FloatArray:
        """Return normals (k, 3) out of the part at places (k, 3), mm, on the wall or near it."""
        _, normal = self.distances(places)
        return -normal if self.hollow else normal

    def near(self, places: FloatArray, chords: float = 0.0) -> np.ndarray:
        """Whether places (k, 3), mm, lie on the wall, or on chords up to a distance off it, mm."""
        distance, _ = self.distances(places)
        height = (places - self.centre) @ self.direction
        slack = max(self.tolerance, chords) + _SLACK * self.radius
        within = (height >= self.low - slack) & (height <= self.high + slack)
        return within & (np.abs(distance) <= slack)

    def has(self, corners: FloatArray, normals: FloatArray) -> np.ndarray:
        """Whether facets with corners (k, 3, 3) and outward normals (k, 3) lie on the wall."""
        near = self.near(corners.reshape(-1, 3)).reshape(-1, 3).all(axis=1)
        exact = self.normals_at(corners.mean(axis=1))
        return near & (np.einsum("ki,ki->k", exact, normals) > _FACING)


def moved_onto(
    walls: Sequence[RoundWall],
    first: IntArray,
    places: FloatArray,
    second: IntArray | None = None,
    planes: FloatArray | None = None,
) -> FloatArray:
    """Move places the shortest way onto round walls, along another surface if need be.

    Parameters
    ----------
    first : (k,) int array
        The wall of each place.
    places : (k, 3) array, mm
    second : (k,) int array, optional
        Another wall that they come to lie on too; -1 for none.
    planes : (k, 3) array, optional
        Without a second wall, unit normals of the planes that they stay in; zero for none.

    Returns
    -------
    (k, 3) array, mm
        Where the two surfaces touch rather than cross, the place on the first.
    """
    result = places.copy()
    second = np.full(len(places), -1) if second is None else second
    planes = np.zeros(places.shape) if planes is None else planes
    for _ in range(_STEPS):
        gap, normal = _distances(walls, first, result)
        other, across = _distances(walls, second, result)
        alone = second < 0
        across[alone] = planes[alone]
        other[alone] = np.einsum("ki,ki->k", result - places, planes)[alone]
        # The least step x n + y m that closes both gaps: two equations in x and y.
        cosine = np.einsum("ki,ki->k", normal, across)
        both = (cosine**2 < _ACROSS) & (across != 0.0).any(axis=1)
        cosine = np.where(both, cosine, 0.0)
        x = np.where(both, cosine * other - gap, -gap) / (1.0 - cosine**2)
        y = np.where(both, cosine * gap - other, 0.0) / (1.0 - cosine**2)
        result += x[:, None] * normal + y[:, None] * across
    return result


def _distances(
    walls: Sequence[RoundWall], which: IntArray, places: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Distances and normals of places, each from its own wall; zero where that is -1."""
    distance, normal = np.zeros(len(places)), np.zeros(places.shape)
    for k in np.unique(which[which >= 0]).tolist():
        rows = which == k
        distance[rows], normal[rows] = walls[k].distances(places[rows])
    return distance, normal


def walls_of_facets(
    walls: Sequence[RoundWall], corners: FloatArray, normals: FloatArray
) -> IntArray:
    """Wall (k,) that each facet lies on, -1 for none; the nearest of several.

    Facets have corners (k, 3, 3), mm, and outward normals (k, 3).
    """
    result = np.full(len(corners), -1)
    least = np.full(len(corners), np.inf)
    for k, wall in enumerate(walls):
        rows = np.flatnonzero(wall.has(corners, normals))
        distance, _ = wall.distances(corners[rows].reshape(-1, 3))
        gap = np.abs(distance).reshape(-1, 3).max(axis=1)
        nearer = gap < least[rows]
        result[rows[nearer]], least[rows[nearer]] = k, gap[nearer]
    return result
