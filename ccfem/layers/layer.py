"""A layer: the triangulated surface on which a strategy plans its paths."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely

from ccfem.arrays import FloatArray, IntArray, freeze, read_only
from ccfem.geometry.shapes import Region
from ccfem.mesh.measures import signed_areas

__all__ = ["Layer"]


@dataclass(frozen=True)
class Layer:
    """A layer of the part. A flat layer is just a layer.

    Attributes
    ----------
    points : (n, 3) array, mm
        In the frame of the mesh.
    triangles : (t, 3) int array
        Counter-clockwise seen against `frame[2]`.
    cell : (t,) int array
        Tetrahedron that each triangle was cut from.
    nodes : (n, 2) int array
        Ends of the mesh edge that each point lies on (twice the same node where it is one).
    weights : (n,) array in [0, 1]
        ``points = (1 - weights) * mesh.points[nodes[:, 0]] + weights * mesh.points[nodes[:, 1]]``.
    loops : tuple of (k,) int arrays
        Boundary loops as point indices, material on the left, first point not repeated.
    patches : mapping of name to (k, 2) int arrays
        Boundary edges (point indices) that lie on each named patch of the mesh.
    frame : (3, 3) array
        Rows: the two in-plane unit vectors and the normal (build direction), right-handed.
    height : float, mm
        ``points @ frame[2]`` of a flat layer.
    index : int
        Position in the stack, 0 at the bottom.
    thickness : float, mm
        Share of the part's height that this layer stands for.
    """

    points: FloatArray
    triangles: IntArray
    cell: IntArray
    nodes: IntArray
    weights: FloatArray
    loops: tuple[IntArray, ...]
    frame: FloatArray
    height: float
    index: int
    thickness: float
    patches: Mapping[str, IntArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        freeze(self, points=float, triangles=int, cell=int, nodes=int, weights=float, frame=float)
        object.__setattr__(self, "loops", tuple(read_only(x, np.int64) for x in self.loops))

    def interpolate(self, nodal: FloatArray) -> FloatArray:
        """Values at the layer's points, (n, ...), of a field given at the mesh nodes."""
        w = self.weights.reshape((-1,) + (1,) * (nodal.ndim - 1))
        return (1.0 - w) * nodal[self.nodes[:, 0]] + w * nodal[self.nodes[:, 1]]

    def to_plane(self, points: FloatArray) -> FloatArray:
        """Plane coordinates (..., 2) of points (..., 3), mm."""
        return points @ self.frame[:2].T

    def to_space(self, plane: FloatArray) -> FloatArray:
        """Points (..., 3) of plane coordinates (..., 2) on a flat layer, mm."""
        return plane @ self.frame[:2] + self.height * self.frame[2]

    @cached_property
    def plane_points(self) -> FloatArray:
        """Plane coordinates of the layer's points, (n, 2), mm."""
        return read_only(self.to_plane(self.points))

    @cached_property
    def areas(self) -> FloatArray:
        """Area of each triangle, (t,), mm^2."""
        return read_only(signed_areas(self.plane_points, self.triangles))

    @cached_property
    def polygon(self) -> Region:
        """Section of a flat layer in plane coordinates: a valid (Multi)Polygon with holes, mm."""
        rings = [shapely.Polygon(self.plane_points[loop]) for loop in self.loops if len(loop) > 2]
        outer = [ring for ring in rings if ring.exterior.is_ccw]
        holes = [ring for ring in rings if not ring.exterior.is_ccw]
        section = shapely.union_all([shapely.make_valid(ring) for ring in outer])
        if holes:
            section = section.difference(shapely.union_all([shapely.make_valid(h) for h in holes]))
        return section
