"""The plane of a flat layer: its frame and height, and coordinates in it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, freeze
from ccfem.base.errors import InputError


@dataclass(frozen=True)
class Plane:
    """A plane normal to a build direction.

    Attributes
    ----------
    frame : (3, 3) array
        Rows: the two in-plane unit vectors and the normal (build direction), right-handed.
    height : float, mm
        ``points @ frame[2]`` of all points of the plane.
    """

    frame: FloatArray
    height: float

    def __post_init__(self) -> None:
        freeze(self, frame=float)

    def project(self, points: FloatArray) -> FloatArray:
        """Plane coordinates (..., 2) of points (..., 3), mm."""
        return points @ self.frame[:2].T

    def to_space(self, coordinates: FloatArray) -> FloatArray:
        """Points (..., 3) of plane coordinates (..., 2), mm."""
        return coordinates @ self.frame[:2] + self.height * self.frame[2]


def plane_frame(direction: Sequence[float]) -> FloatArray:
    """Right-handed frame of the planes normal to a build direction.

    Parameters
    ----------
    direction : sequence of 3 floats
        Build direction; need not be of unit length.

    Returns
    -------
    (3, 3) array
        Rows: two in-plane unit vectors and the unit normal. Along z they are x, y, z; along y
        x, -z, y (the tool frame of Chen et al. 2021); along x y, z, x.
    """
    normal = np.asarray(direction, dtype=np.float64)
    length = float(np.linalg.norm(normal)) if normal.shape == (3,) else 0.0
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(f"build direction must be three numbers, not all 0; got {direction}")
    normal = normal / length
    axis = int(np.argmax(np.abs(normal)))
    first = np.array([1.0, 0.0, 0.0]) if axis != 0 else np.array([0.0, 1.0, 0.0])
    first -= (first @ normal) * normal
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first), normal])
