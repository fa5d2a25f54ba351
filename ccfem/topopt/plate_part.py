"""The part that a design of a plate stands for: its outline, extruded, with supports and loads."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.arrays import BoolArray, FloatArray, IntArray
from ccfem.elasticity.problem import Force, Load, PointForce, Problem, Support
from ccfem.errors import InputError
from ccfem.materials import Material
from ccfem.mesh.facets import are_among
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.meshing import extrude
from ccfem.plates.problem import PlaneProblem
from ccfem.topopt.design import Design
from ccfem.topopt.material_axes import axes_about_z
from ccfem.topopt.outline import solid

__all__ = ["plate_part"]

_REACH = 1.5
"""How far a wall may lie from the patch that it takes over, in pixels."""
_FACING = 0.5
"""Cosine between the normals of a wall and of the patch that it takes over."""
_BOTTOM = "bottom"


class _Walls(NamedTuple):
    """Boundary facets of an extruded part along its outline.

    Attributes
    ----------
    facets : (w, 3) int array
    middle, normal : (w, 2) arrays
    """

    facets: IntArray
    middle: FloatArray
    normal: FloatArray


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
    polygon = solid(design, volume_fraction, domain=domain)
    size = float(np.sqrt(plate.mesh.areas.mean()))
    edge_length = 2.0 * size if edge_length is None else edge_length
    height = _height(plate) if thickness is None else thickness
    mesh = extrude(polygon, height, edge_length, keep=_ends(plate, polygon, size))
    walls = _walls(mesh)
    patches = _patches(plate, walls, size, edge_length)
    loads: dict[str, tuple[Load, ...]] = {}
    for case, given in plate.loads.items():
        loads[case] = ()
        for load in given:
            if isinstance(load, PointForce):
                name = f"{case}_point_{len(loads[case])}"
                patches[name] = _at_point(load, walls, size, edge_length)
                load = Force(name, load.vector)
            loads[case] += (load,)
    supports = [
        replace(support, components=support.components.replace("z", ""))
        for support in plate.supports
    ]
    return Problem(
        mesh.with_patches({**patches, _BOTTOM: _level(mesh, 0.0)}),
        material,
        (*supports, Support(_BOTTOM, "z")),
        loads,
        None if design.angle is None else _axes(design, mesh),
    )


def _patches(
    plate: PlaneProblem, walls: _Walls, size: float, edge_length: float
) -> dict[str, IntArray]:
    """Patches of the walls by those of the plate; the ones that nothing is left of drop out."""
    if _BOTTOM in plate.mesh.patches:
        raise InputError(
            f"'{_BOTTOM}' names the face at z = 0 of the part: give the plate's patch another name"
        )
    needed = {support.patch for support in plate.supports}
    needed |= {
        load.patch
        for case in plate.loads.values()
        for load in case
        if not isinstance(load, PointForce)
    }
    patches = {}
    for name, edges in plate.mesh.patches.items():
        chosen = _taken_over(plate, edges, walls, size, edge_length)
        if chosen.any():
            patches[name] = walls.facets[chosen]
        elif name in needed:
            raise InputError(
                f"the outline of the design does not reach patch '{name}': mark the cells there "
                "as solid, or raise the volume fraction"
            )
    return patches


def _at_point(load: PointForce, walls: _Walls, size: float, edge_length: float) -> IntArray:
    """Facets (k, 3) that carry a point force."""
    near = _round(np.array([load.point[:2]]), walls, size, edge_length)
    if not near.any():
        raise InputError(
            f"the point force at {load.point} is not on the outline of the design: move it to the "
            "border of the plate, or mark the cells there as solid"
        )
    return walls.facets[near]


def _height(plate: PlaneProblem) -> float:
    """Thickness of the plate, mm, where it is the same everywhere."""
    thickness = np.asarray(plate.thickness)
    if np.ptp(thickness) > 1e-9 * thickness.max():
        raise InputError(
            f"the plate is {thickness.min():g} to {thickness.max():g} mm thick: name the "
            "thickness of the part"
        )
    return float(thickness[0])


def _ends(plate: PlaneProblem, polygon: Any, size: float) -> FloatArray:
    """Find the ends (k, 2) of the patches of edges, moved onto the outline."""
    ends = [np.zeros((0, 2))]
    for edges in plate.mesh.patches.values():
        if edges.shape[1] == 2:
            nodes, count = np.unique(edges, return_counts=True)
            ends.append(plate.mesh.points[nodes[count == 1]])
    points = shapely.points(np.concatenate(ends))
    onto = shapely.shortest_line(points, polygon.boundary)
    near = shapely.length(onto) <= size
    return shapely.get_coordinates(shapely.get_point(onto[near], -1))


def _level(mesh: TetMesh, z: float) -> IntArray:
    """Boundary facets (k, 3) in a plane across z."""
    return mesh.boundary[(np.abs(mesh.points[mesh.boundary, 2] - z) < 1e-9).all(axis=1)]


def _walls(mesh: TetMesh) -> _Walls:
    _, normal = mesh.facet_areas(mesh.boundary)
    upright = np.abs(normal[:, 2]) < 0.5
    facets = mesh.boundary[upright]
    corners = mesh.points[facets, :2]
    # Of a triangle on an upright wall: the middle of its extent along the outline.
    middle = 0.5 * (corners.min(axis=1) + corners.max(axis=1))
    return _Walls(facets, middle, normal[upright, :2])


def _taken_over(
    plate: PlaneProblem, edges: IntArray, walls: _Walls, size: float, edge_length: float
) -> BoolArray:
    """Walls (w,) that take over a patch of edges (k, 2) or of nodes (k, 1)."""
    mesh = plate.mesh
    boundary = mesh.boundary
    if edges.shape[1] == 1:
        return _round(mesh.points[edges[:, 0]], walls, size, edge_length)
    own = are_among(boundary, edges)
    tree = shapely.STRtree(shapely.linestrings(mesh.points[boundary]))
    middles = shapely.points(walls.middle)
    (wall, edge), distance = tree.query_nearest(middles, return_distance=True)
    nearest = np.zeros(len(middles), dtype=bool)
    nearest[wall[own[edge] & (distance <= _REACH * size)]] = True
    wall, edge = tree.query(middles, predicate="dwithin", distance=_REACH * size)
    along = mesh.points[boundary[edge, 1]] - mesh.points[boundary[edge, 0]]
    outward = np.zeros((len(middles), 2))
    np.add.at(outward, wall[own[edge]], (along @ np.array([[0.0, -1.0], [1.0, 0.0]]))[own[edge]])
    length = np.linalg.norm(outward, axis=1)
    facing = (outward * walls.normal).sum(axis=1) > _FACING * np.maximum(length, 1e-300)
    return nearest & facing


def _round(points: FloatArray, walls: _Walls, size: float, edge_length: float) -> BoolArray:
    """Walls (w,) round points (k, 2): within half an edge length, or the nearest ones."""
    chosen = np.zeros(len(walls.middle), dtype=bool)
    for point in points:
        distance = np.linalg.norm(walls.middle - point, axis=1)
        least = float(distance.min())
        if least <= max(_REACH * size, edge_length):
            chosen |= distance <= max(0.5 * edge_length, least) + 1e-9
    return chosen


def _axes(design: Design, mesh: TetMesh) -> FloatArray:
    """Material axes (m, 3, 3) of the cells of the part: those of the nearest pixel."""
    plate = design.full
    assert isinstance(plate, PlaneProblem)
    assert design.angle is not None
    centres = mesh.points[mesh.corners].mean(axis=1)[:, :2]
    angle = design.angle[cKDTree(plate.mesh.centres).query(centres)[1]]
    return axes_about_z(angle)
