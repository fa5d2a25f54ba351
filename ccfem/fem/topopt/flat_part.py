"""A flat part seen from above: its planform, and where its patches lie on it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.geometry.facets import unique_edges

_ON = 1e-6
"""How far a node may lie from the line that it is on, over the size of the part."""


@dataclass(frozen=True)
class Trace:
    """Where a patch of a flat part lies.

    Attributes
    ----------
    wall : shapely geometry, mm
        Lines along the outline.
    faces : tuple of 2 shapely geometries, mm
        Areas on the bottom and on the top.
    """

    wall: Any
    faces: tuple[Any, Any]


@dataclass(frozen=True)
class FlatPart:
    """A prism along z.

    Attributes
    ----------
    planform : shapely Polygon, mm
        Its rings are the edges of the mesh.
    low, high : float, mm
        Of the bottom and the top along z.
    traces : mapping of patch name to Trace
    """

    planform: Any
    low: float
    high: float
    traces: Mapping[str, Trace]

    def __post_init__(self) -> None:
        freeze(self, traces=dict)

    @property
    def tolerance(self) -> float:
        """How far a node may lie from the line that it is on, mm."""
        _, _, *far = self.planform.bounds
        return _ON * max(1.0, float(np.abs(far).max()))

    def ends(self) -> FloatArray:
        """Points (k, 2) at which patches on the walls end, mm."""
        walls = [shapely.line_merge(trace.wall) for trace in self.traces.values()]
        lines = shapely.get_parts(walls) if walls else []
        open_ = [line for line in lines if not line.is_empty and not line.is_closed]
        ends = [shapely.get_coordinates(line)[[0, -1]] for line in open_]
        return np.concatenate([np.zeros((0, 2)), *ends])

    def patches(self, mesh: TetMesh) -> dict[str, IntArray]:
        """Patches of another mesh of this planform, or of a piece of it, as high as this part.

        Of the walls those take a patch that lie on its trace, of bottom and top the facets with
        their middle in it. A patch that nothing is left of is missing.
        """
        facets = mesh.boundary
        _, normal = mesh.facet_areas(facets)
        upright = np.abs(normal[:, 2]) < 0.5
        plane = mesh.points[facets][..., :2]
        patches = {}
        for name, trace in self.traces.items():
            chosen = upright & _all_on(plane, trace.wall, self.tolerance)
            for area, way in zip(trace.faces, (-1.0, 1.0), strict=True):
                if not area.is_empty:
                    x, y = plane.mean(axis=1).T
                    chosen |= (way * normal[:, 2] > 0.5) & shapely.contains_xy(area, x, y)
            if chosen.any():
                patches[name] = facets[chosen]
        return patches


def _all_on(plane: FloatArray, line: Any, off: float) -> BoolArray:
    """Facets (t,) whose corners (t, 3, 2) and their middle lie on a line."""
    middle = 0.5 * (plane.min(axis=1) + plane.max(axis=1))
    if line.is_empty:
        return np.zeros(len(plane), dtype=bool)
    every = np.concatenate([plane, middle[:, None]], axis=1)
    near = shapely.dwithin(shapely.points(every[:, :3]), line, off).all(axis=1)
    # A chord of a curved patch leaves it in its middle by a little.
    chord = np.linalg.norm(plane - np.roll(plane, 1, axis=1), axis=2).max(axis=1)
    return np.asarray(near & shapely.dwithin(shapely.points(middle), line, 0.2 * chord + off))


def flat_part(mesh: TetMesh) -> FlatPart | None:
    """Planform of a mesh that is a prism along z, with its patches; None for any other.

    Raises
    ------
    InputError
        For a patch that takes only a part of the height of a wall.
    """
    low, high = (float(z) for z in mesh.bounds[:, 2])
    off = _ON * max(1.0, float(np.abs(mesh.bounds).max()))
    _, normal = mesh.facet_areas(mesh.boundary)
    level = mesh.points[mesh.boundary][..., 2]
    bottom, top = (np.abs(level - z).max(axis=1) <= off for z in (low, high))
    if not (bottom | top | (np.abs(normal[:, 2]) < 1e-6)).all():
        return None
    planform = _union(mesh, mesh.boundary[bottom])
    volume = float(mesh.volumes.sum())
    if planform.geom_type != "Polygon" or abs(planform.area * (high - low) / volume - 1.0) > 1e-6:
        return None
    traces = {}
    for name, facets in mesh.patches.items():
        level = mesh.points[facets][..., 2]
        below, above = (np.abs(level - z).max(axis=1) <= off for z in (low, high))
        wall = facets[~(below | above)]
        line = _foot(mesh, wall, low + off)
        walls = float(mesh.facet_areas(wall)[0].sum()) if len(wall) else 0.0
        if walls < (1.0 - 1e-6) * line.length * (high - low) or (walls > 0.0 and line.is_empty):
            raise InputError(
                f"patch '{name}' takes only a part of the height of its wall, and a plate in plane "
                "stress knows no height: let it reach from bottom to top"
            )
        faces = (_union(mesh, facets[below]), _union(mesh, facets[above]))
        traces[name] = Trace(line, faces)
    return FlatPart(planform, low, high, traces)


def _union(mesh: TetMesh, facets: IntArray) -> Any:
    """Area that facets cover, seen from above; along their edges, exactly."""
    if not len(facets):
        return shapely.Polygon()
    sides = np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]])
    edges, number = unique_edges(sides)
    border = edges[np.bincount(number.reshape(-1), minlength=len(edges)) == 1]
    lines = shapely.linestrings(mesh.points[border][..., :2])
    rings = shapely.get_parts(shapely.polygonize(lines))
    x, y = mesh.points[facets][..., :2].mean(axis=1).T
    middles = shapely.STRtree(shapely.points(x, y))
    filled = [ring for ring in rings if len(middles.query(ring, predicate="contains"))]
    return shapely.union_all(filled)


def _foot(mesh: TetMesh, wall: IntArray, level: float) -> Any:
    """Lines along which wall facets (k, 3) stand on the bottom."""
    if not len(wall):
        return shapely.LineString()
    down = mesh.points[wall][..., 2] <= level
    chosen = down.sum(axis=1) == 2
    edges = wall[chosen][down[chosen]].reshape(-1, 2)
    return shapely.union_all(shapely.linestrings(mesh.points[edges][..., :2]))
