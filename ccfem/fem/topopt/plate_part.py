"""The part that a design of a plate stands for: its outline, extruded, with supports and loads."""

from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.patches import Plane
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity.load_kinds import Load
from ccfem.fem.elasticity.problem import Force, PointForce, Problem, Support
from ccfem.fem.materials import Material
from ccfem.fem.plates.problem import PlaneProblem
from ccfem.fem.plates.raster_mesh import raster_image
from ccfem.fem.topopt.design import Design
from ccfem.fem.topopt.outline import outline
from ccfem.fem.topopt.walls import Walls, patch_ends

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
    found = outline(
        raster.image,
        raster.size,
        volume_fraction,
        threshold,
        domain,
        raster.inside,
        _anchors(plate, design.density) - raster.origin,
        apart=design.apart,
    )
    return shapely.transform(found, lambda points: points + raster.origin)


def _anchors(plate: PlaneProblem, density: FloatArray) -> FloatArray:
    """Densest node of every loaded and held patch, and the points of point forces: (k, 2), mm."""
    mesh = plate.mesh
    dense = np.zeros(len(mesh.points))
    np.maximum.at(dense, mesh.cells, density[:, None])
    patches = [np.unique(mesh.patch(name)) for name in plate.held_or_loaded]
    nodes = [own[dense[own].argmax()] for own in patches]
    for load in (load for case in plate.loads.values() for load in case):
        if isinstance(load, PointForce):
            nodes.append(mesh.nearest_nodes(load.point[:2])[0])
    return mesh.points[nodes]


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
        design.axes_at(mesh.points[mesh.corners].mean(axis=1)),
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
