"""From a design to a part that is solved, sliced and printed like any other."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.files.surface import Surface
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.patches import Plane
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity import Load, Problem
from ccfem.fem.elasticity.problem import Force, PointForce, Support
from ccfem.fem.materials import Material
from ccfem.fem.plates.mesh import PlaneMesh, raster_image
from ccfem.fem.plates.problem import PlaneProblem
from ccfem.fem.topopt.design import Design, anchors
from ccfem.fem.topopt.design_outline import outline
from ccfem.fem.topopt.tet_part import part_mesh
from ccfem.geometry.facets import are_among


def part_shape(
    design: Design,
    volume_fraction: float | None = None,
    threshold: float | None = None,
    domain: Any = None,
) -> Any:
    """Shape of the part that a design stands for.

    Parameters
    ----------
    volume_fraction : float in (0, 1], optional
        Share of the domain that the part fills; default that of the design.
    threshold : float in (0, 1), optional
        Density at the border of the part, in place of the share.
    domain : shapely Polygon, mm, optional
        Exact design domain of a plate; default the pixels.

    Returns
    -------
    shapely Polygon or Surface, mm
        Of a plate on a raster its outline, of tetrahedra a closed surface: of the piece that joins
        all loads and supports, smoothed, within the domain.

    Raises
    ------
    InputError
        When no piece joins them.
    """
    if isinstance(design.full, PlaneProblem):
        return plate_outline(design, volume_fraction, threshold, domain)
    _no_plate(domain=domain)
    mesh = part_mesh(design, volume_fraction, threshold)
    used, number = np.unique(mesh.boundary, return_inverse=True)
    return Surface(mesh.points[used], number.reshape(-1, 3))


def _no_plate(**options: Any) -> None:
    """Raise on options that only the part of a plate has."""
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise InputError(
            f"{', '.join(given)}: for plates only; this design is of tetrahedra, whose part is cut "
            "out of its mesh: leave it out"
        )


def as_problem(
    design: Design,
    material: Material,
    thickness: float | None = None,
    edge_length: float | None = None,
    domain: Any = None,
    volume_fraction: float | None = None,
) -> Problem:
    """Make the part of a design a problem of its own: cleaned, meshed, held and loaded.

    The outline of a plate is extruded along z. Its patches of edges become patches of the walls
    nearest to them, with their ends where they were; point forces, and patches of single nodes,
    become small patches about their points. Forces keep their total, tractions and pressures
    their size. The part is held along z on its bottom (patch ``bottom``), where alone nothing
    else holds it: plane stress, as in the design.

    The part of tetrahedra is cut out of their mesh, so that its patches are what is left of those
    of the design; supports and loads stay. ``tetrahedralise(part_shape(design), edge_length)`` is
    another mesh of the same shape.

    Parameters
    ----------
    design : Design
        Of a plate on a raster, or of tetrahedra.
    material : Material
        Its axes turn with the design's angles, where it has angles.
    thickness : float, mm, optional
        Height of the part of a plate; default the thickness of the plate.
    edge_length : float, mm, optional
        Of the tetrahedra aimed at in the part of a plate; default two pixels.
    domain : shapely Polygon, mm, optional
        Exact design domain of a plate; default the pixels.
    volume_fraction : float in (0, 1], optional
        Share of the domain that the part fills; default that of the design.

    Raises
    ------
    InputError
        When no piece joins all loads and supports, or a patch is not reached.
    """
    full = design.full
    if isinstance(full, PlaneProblem):
        return plate_part(design, material, thickness, edge_length, domain, volume_fraction)
    _no_plate(thickness=thickness, edge_length=edge_length, domain=domain)
    mesh = part_mesh(design, volume_fraction)
    axes = design.axes_at(mesh.centres)
    return Problem(mesh, material, full.supports, full.loads, axes, order=full.order)


# The part that a design of a plate stands for: its outline, extruded, with supports and loads.


_BOTTOM = "bottom"


def plate_outline(
    design: Design,
    volume_fraction: float | None = None,
    threshold: float | None = None,
    domain: Any = None,
) -> Any:
    """Outline of a design of squares: see `part_shape`.

    Raises
    ------
    InputError
        When no piece joins all loads and supports, and for a mesh that is no raster.
    """
    plate = design.full
    assert isinstance(plate, PlaneProblem)
    raster = raster_image(plate.mesh, design.density)
    if domain is not None:
        domain = shapely.transform(domain, lambda points: points - raster.origin)
    shape = outline(
        raster.image,
        raster.size,
        volume_fraction,
        threshold,
        domain,
        raster.inside,
        _densest(plate, design.density) - raster.origin,
        apart=design.apart,
    )
    return shapely.transform(shape, lambda points: points + raster.origin)


def _densest(plate: PlaneProblem, density: FloatArray) -> FloatArray:
    """Densest node of every loaded and held patch, and those of point forces: (k, 2), mm."""
    dense = np.zeros(len(plate.mesh.points))
    np.maximum.at(dense, plate.mesh.cells, density[:, None])
    return plate.mesh.points[[nodes[dense[nodes].argmax()] for nodes in anchors(plate)]]


def plate_part(
    design: Design,
    material: Material,
    thickness: float | None,
    edge_length: float | None,
    domain: Any,
    volume_fraction: float | None,
) -> Problem:
    """Extrude the outline of a design of squares: see `as_problem`."""
    plate = design.full
    assert isinstance(plate, PlaneProblem)
    if _BOTTOM in plate.mesh.patches:
        raise InputError(
            f"'{_BOTTOM}' names the face at z = 0 of the part: give the plate's patch another name"
        )
    polygon = plate_outline(design, volume_fraction, domain=domain)
    pixel = float(np.sqrt(plate.mesh.areas.mean()))
    edge_length = 2.0 * pixel if edge_length is None else edge_length
    height = _height(plate) if thickness is None else thickness
    mesh = extrude(polygon, height, edge_length, keep=patch_ends(plate.mesh, polygon, pixel))
    walls = Walls.of_mesh(mesh, pixel, edge_length)
    patches = walls.patches(plate.mesh, plate.held_or_loaded)
    patches[_BOTTOM] = Plane("z", "min", 1e-9)(mesh)
    loads: dict[str, tuple[Load, ...]] = {}
    for case, given in plate.loads.items():
        loads[case] = ()
        for load in given:
            if isinstance(load, PointForce):
                name = f"{case}_point_{len(loads[case])}"
                patches[name] = walls.at_point(load)
                load = Force(name, load.vector)
            loads[case] += (load,)
    supports = [
        replace(support, components=support.components.replace("z", ""))
        for support in plate.supports
    ]
    return Problem(
        mesh.with_patches(patches),
        material,
        (*supports, Support(_BOTTOM, "z")),
        loads,
        design.axes_at(mesh.centres),
        order=1,
    )


def _height(plate: PlaneProblem) -> float:
    """Thickness of the plate, mm, where it is the same everywhere."""
    thickness = np.asarray(plate.thickness)
    if np.ptp(thickness) > 1e-9 * thickness.max():
        raise InputError(
            f"the plate is {thickness.min():g} to {thickness.max():g} mm thick: name the "
            "thickness of the part"
        )
    return float(thickness[0])


# Walls of a part extruded from the outline of a plate, and the plate's patches that they take.


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
                chosen = self._walls_along(plate, edges)
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

    def _walls_along(self, plate: PlaneMesh, edges: IntArray) -> BoolArray:
        """Walls (w,) that are nearest to edges (k, 2) of all edges of the plate, and face them."""
        boundary, reach = plate.boundary, _REACH * self.pixel
        held = are_among(boundary, edges)
        tree = shapely.STRtree(shapely.linestrings(plate.points[boundary]))
        middles = shapely.points(self.middle)
        (wall, edge), distance = tree.query_nearest(middles, return_distance=True)
        nearest = np.zeros(len(middles), dtype=bool)
        nearest[wall[held[edge] & (distance <= reach)]] = True
        wall, edge = tree.query(middles, predicate="dwithin", distance=reach)
        wall, edge = wall[held[edge]], edge[held[edge]]
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
