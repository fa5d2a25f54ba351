"""Pieces of the border of a plate: straight stretches, and round holes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.patches import Bounded
from ccfem.fem.plates import PlaneMesh

NEAR = 1e-6
"""How far a node may lie from the line that it is on, mm."""


@dataclass(frozen=True)
class Stretch:
    """A straight stretch of the border of a plate, between two points (x, y), mm."""

    start: tuple[float, float]
    end: tuple[float, float]

    def edges(self, mesh: PlaneMesh) -> IntArray:
        """Boundary edges (k, 2) of a plane mesh with their middles on it."""
        middles = mesh.points[mesh.boundary].mean(axis=1)
        return mesh.boundary[self._holds(middles)]

    def __call__(self, mesh: Bounded) -> IntArray:
        """Walls (k, 3) of an extruded plate with all their nodes on it."""
        _, normal = mesh.facet_areas(mesh.boundary)
        walls = mesh.boundary[np.abs(normal[:, 2]) < 0.5]
        chosen = self._holds(mesh.points[walls][..., :2]).all(axis=1)
        if not chosen.any():
            raise InputError(f"no wall of the part lies between {self.start} and {self.end} mm")
        return walls[chosen]

    def _holds(self, points: FloatArray) -> BoolArray:
        line = shapely.LineString([self.start, self.end])
        return np.asarray(shapely.dwithin(shapely.points(points), line, NEAR))


@dataclass(frozen=True)
class Hole:
    """A round hole.

    Attributes
    ----------
    x, y, radius : float, mm
    rim : float, mm
        Width of the ring about it that the optimisation keeps solid.
    """

    x: float
    y: float
    radius: float
    rim: float = 0.0

    def disc(self, more: float = 0.0) -> Any:
        """Area of the hole, wider by `more`, mm: a shapely Polygon."""
        return shapely.Point(self.x, self.y).buffer(self.radius + more, quad_segs=32)
