"""Walls of a part extruded from the outline of a plate, and the plate's patches that they take."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.problem import PointForce
from ccfem.fem.plates.mesh import PlaneMesh
from ccfem.geometry.facets import are_among

_REACH = 1.5
"""How far a wall may lie from the patch that it takes over, in pixels."""
_FACING = 0.5
"""Cosine between the normals of a wall and of the patch that it takes over."""


@dataclass(frozen=True)
class Walls:
    """Boundary facets of an extruded part along its outline.

    Attributes
    ----------
    facets : (w, 3) int array
    middle, normal : (w, 2) arrays
    pixel : float, mm
        Side of a cell of the plate.
    edge_length : float, mm
        Of the part's mesh.
    """

    facets: IntArray
    middle: FloatArray
    normal: FloatArray
    pixel: float
    edge_length: float

    @classmethod
    def of_mesh(cls, mesh: TetMesh, pixel: float, edge_length: float) -> "Walls":
        """Collect the upright boundary facets of a mesh."""
        _, normal = mesh.facet_areas(mesh.boundary)
        upright = np.abs(normal[:, 2]) < 0.5
        facets = mesh.boundary[upright]
        corners = mesh.points[facets, :2]
        # Of a triangle on an upright wall: the middle of its extent along the outline.
        middle = 0.5 * (corners.min(axis=1) + corners.max(axis=1))
        return cls(facets, middle, normal[upright, :2], pixel, edge_length)

    def patches(self, plate: PlaneMesh, needed: tuple[str, ...]) -> dict[str, IntArray]:
        """Patches of the walls by those of the plate; those without a wall are dropped.

        Raises
        ------
        InputError
            When a needed one is dropped.
        """
        patches = {}
        for name, edges in plate.patches.items():
            if edges.shape[1] == 1:
                chosen = self._round(plate.points[edges[:, 0]])
            else:
                chosen = self._along(plate, edges)
            if chosen.any():
                patches[name] = self.facets[chosen]
            elif name in needed:
                raise InputError(
                    f"the outline of the design does not reach patch '{name}': mark the cells "
                    "there as solid, or raise the volume fraction"
                )
        return patches

    def at_point(self, load: PointForce) -> IntArray:
        """Facets (k, 3) that carry a point force."""
        near = self._round(np.array([load.point[:2]]))
        if not near.any():
            raise InputError(
                f"the point force at {load.point} is not on the outline of the design: move it to "
                "the border of the plate, or mark the cells there as solid"
            )
        return self.facets[near]

    def _along(self, plate: PlaneMesh, edges: IntArray) -> BoolArray:
        """Walls (w,) that are nearest to edges (k, 2) of all edges of the plate, and face them."""
        boundary, reach = plate.boundary, _REACH * self.pixel
        own = are_among(boundary, edges)
        tree = shapely.STRtree(shapely.linestrings(plate.points[boundary]))
        middles = shapely.points(self.middle)
        (wall, edge), distance = tree.query_nearest(middles, return_distance=True)
        nearest = np.zeros(len(middles), dtype=bool)
        nearest[wall[own[edge] & (distance <= reach)]] = True
        wall, edge = tree.query(middles, predicate="dwithin", distance=reach)
        wall, edge = wall[own[edge]], edge[own[edge]]
        along = plate.points[boundary[edge, 1]] - plate.points[boundary[edge, 0]]
        outward = np.zeros((len(middles), 2))
        np.add.at(outward, wall, along @ np.array([[0.0, -1.0], [1.0, 0.0]]))
        length = np.linalg.norm(outward, axis=1)
        facing = (outward * self.normal).sum(axis=1) > _FACING * np.maximum(length, 1e-300)
        return nearest & facing

    def _round(self, points: FloatArray) -> BoolArray:
        """Walls (w,) round points (k, 2): within half an edge length, or the nearest ones."""
        chosen = np.zeros(len(self.middle), dtype=bool)
        for point in points:
            distance = np.linalg.norm(self.middle - point, axis=1)
            least = float(distance.min())
            if least <= max(_REACH * self.pixel, self.edge_length):
                chosen |= distance <= max(0.5 * self.edge_length, least) + 1e-9
        return chosen


def patch_ends(plate: PlaneMesh, polygon: Any, pixel: float) -> FloatArray:
    """Find the ends (k, 2) of the patches of edges, moved onto the outline within a pixel, mm."""
    ends = [np.zeros((0, 2))]
    for edges in plate.patches.values():
        if edges.shape[1] == 2:
            nodes, count = np.unique(edges, return_counts=True)
            ends.append(plate.points[nodes[count == 1]])
    points = shapely.points(np.concatenate(ends))
    onto = shapely.shortest_line(points, polygon.boundary)
    near = shapely.length(onto) <= pixel
    return shapely.get_coordinates(shapely.get_point(onto[near], -1))
