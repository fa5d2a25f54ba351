"""Shapes that say where fibre may lie, and their sections with the plane of a layer."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_fields
from ccfem.body.files.surface import Surface
from ccfem.body.mesh.cell_rules import check_box
from ccfem.body.mesh.patches import Vector, unit_vector
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.shapes import Region
from ccfem.slicing.layers.plane import Plane

_ARC = 16
"""Pieces of a quarter of a circle."""
_CUTS = 12
"""Sections of a patch over and below a layer, each; the reach is short by at most .3 %."""
_DIGITS = 6
"""Decimals of the ends of sections, mm, so that they meet."""
_ALONG = 1e-6
"""Sine of the angle below which an axis lies in a plane, or a normal across it."""


class Shape(Protocol):
    """A body that a layer cuts."""

    def section(self, plane: Plane, mesh: TetMesh, reach: float) -> Region:
        """Section with a plane, in its coordinates, mm; true within `reach` of the origin."""
        ...


@dataclass(frozen=True)
class InBox:
    """A box along the axes of the mesh.

    Attributes
    ----------
    lower, upper : tuple of 3 floats, mm
        Opposite corners; infinite where the box has no end.
    """

    lower: Vector
    upper: Vector

    def __post_init__(self) -> None:
        check_box(self.lower, self.upper)

    def section(self, plane: Plane, mesh: TetMesh, reach: float) -> Region:
        """Section with a plane, in its coordinates."""
        shape: Region = shapely.box(-reach, -reach, reach, reach)
        for axis in range(3):
            slope, offset = plane.frame[:2, axis], plane.height * float(plane.frame[2, axis])
            for sign, bound in ((1.0, self.lower[axis]), (-1.0, self.upper[axis])):
                if np.isfinite(bound):
                    shape = _half(shape, sign * slope, sign * (bound - offset), reach)
        return shape


@dataclass(frozen=True)
class InCylinder:
    """A cylinder without ends.

    Attributes
    ----------
    point : tuple of 3 floats, mm
        A point on the axis.
    axis : str or tuple of 3 floats
        Direction of the axis.
    radius : float, mm
        Above 0.
    """

    point: Vector
    axis: str | Vector
    radius: float

    def __post_init__(self) -> None:
        unit_vector(self.axis, "cylinder axis")
        check_fields(self, "radius", above=0.0, unit="mm")

    def section(self, plane: Plane, mesh: TetMesh, reach: float) -> Region:
        """Section with a plane, in its coordinates."""
        axis = unit_vector(self.axis, "cylinder axis")
        across = np.linalg.svd(axis[None])[2][1:]
        slope = across @ plane.frame[:2].T
        start = across @ (plane.height * plane.frame[2] - np.asarray(self.point))
        if abs(float(axis @ plane.frame[2])) > _ALONG:
            circle = shapely.Point(0.0, 0.0).buffer(self.radius, quad_segs=_ARC)
            inverse = np.linalg.inv(slope)
            shape: Region = shapely.transform(circle, lambda at: (at - start) @ inverse.T)
            return shape
        # The axis lies along the plane, whose section is a strip: how high above it is fixed.
        over = plane.frame[2] @ (plane.height * plane.frame[2] - np.asarray(self.point))
        if abs(float(over)) >= self.radius:
            return shapely.Polygon()
        half = float(np.sqrt(self.radius**2 - over**2))
        side = np.cross(plane.frame[2], axis)
        way, middle = plane.frame[:2] @ side, float(np.asarray(self.point) @ side)
        strip: Region = shapely.box(-reach, -reach, reach, reach)
        strip = _half(strip, way, middle - half, reach)
        return _half(strip, -way, -middle - half, reach)


@dataclass(frozen=True)
class NearPatch:
    """All that lies near a patch of the mesh: round a hole, or under a face.

    Attributes
    ----------
    within : float, mm
        Largest distance from the patch, above 0.
    """

    patch: str
    within: float

    def __post_init__(self) -> None:
        check_fields(self, "within", above=0.0, unit="mm")

    def section(self, plane: Plane, mesh: TetMesh, reach: float) -> Region:
        """Section with a plane, in its coordinates."""
        facets = mesh.points[mesh.patch(self.patch)[:, :3]]
        corners = plane.project(facets)
        level = facets @ plane.frame[2] - plane.height
        shapes = []
        flat = np.ptp(level, axis=1) < 10.0**-_DIGITS
        low = flat & (np.abs(level[:, 0]) < self.within)
        for at in np.unique(level[low, 0].round(_DIGITS)).tolist():
            faces = shapely.polygons(corners[low & (np.abs(level[:, 0] - at) < 10.0**-_DIGITS)])
            far = float(np.sqrt(max(self.within**2 - at**2, 0.0)))
            shapes.append(shapely.buffer(shapely.union_all(faces), far, quad_segs=_ARC))
        for at in (self.within * np.sin(0.5 * np.pi * np.arange(-_CUTS, _CUTS + 1) / _CUTS))[1:-1]:
            ends = _section_edges(corners, level - float(at))
            if len(ends):
                far = float(np.sqrt(self.within**2 - at**2))
                lines = shapely.multilinestrings(shapely.linestrings(ends))
                shapes.append(shapely.buffer(lines, far, quad_segs=_ARC))
        return shapely.union_all(shapes)


@dataclass(frozen=True)
class InBody:
    """The inside of a closed surface.

    Attributes
    ----------
    surface : Surface
        In the frame of the mesh.
    name : str
        Of its file.
    """

    surface: Surface = field(repr=False)
    name: str = ""

    def section(self, plane: Plane, mesh: TetMesh, reach: float) -> Region:
        """Section with a plane, in its coordinates."""
        corners = self.surface.points[self.surface.triangles]
        ends = _section_edges(plane.project(corners), corners @ plane.frame[2] - plane.height)
        if not len(ends):
            return shapely.Polygon()
        ends = ends.round(_DIGITS)
        ends = ends[(ends[:, 0] != ends[:, 1]).any(axis=1)]
        return shapely.make_valid(shapely.build_area(shapely.union_all(shapely.linestrings(ends))))


def _half(region: Region, slope: FloatArray, least: float, reach: float) -> Region:
    """Part of a region where slope . x is at least a value."""
    steep = float(np.linalg.norm(slope))
    if steep < _ALONG:
        return region if least <= 0.0 else shapely.Polygon()
    way = np.asarray(slope) / steep
    side, start = np.array([-way[1], way[0]]), least / steep * way
    far = 4.0 * reach + abs(least) / steep
    ring = [start - far * side, start + far * side]
    ring += [start + far * (side + way), start + far * (way - side)]
    return shapely.intersection(region, shapely.Polygon(ring))


def _section_edges(corners: FloatArray, level: FloatArray) -> FloatArray:
    """Find the ends (k, 2, 2) of the sections of triangles where their level is 0."""
    # A corner on the plane counts as above it: each triangle is cut in two edges or in none.
    above = level >= 0.0
    cut = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    if not len(cut):
        return np.zeros((0, 2, 2))
    corners, level, above = corners[cut], level[cut], above[cut]
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    row, ends = np.arange(len(cut)), []
    for step in (1, 2):
        other = (alone + step) % 3
        share = level[row, alone] / (level[row, alone] - level[row, other])
        start = corners[row, alone]
        ends.append(start + share[:, None] * (corners[row, other] - start))
    return np.stack(ends, axis=1)
