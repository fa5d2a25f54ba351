"""From a design to a part that is solved, sliced and printed like any other."""

from typing import Any

import numpy as np

from ccfem.base.errors import InputError
from ccfem.body.files.surface import Surface
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.materials import Material
from ccfem.fem.plates.problem import PlaneProblem
from ccfem.fem.topopt.design import Design
from ccfem.fem.topopt.plate_part import plate_outline, plate_part
from ccfem.fem.topopt.tet_part import part_mesh


def part_shape(
    design: Design,
    volume_fraction: float | None = None,
    threshold: float | None = None,
    domain: Any = None,
) -> Any:
    """Shape of the part that a design stands for.

    Parameters
    ----------
    design : Design
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
    axes = design.axes_at(mesh.points[mesh.corners].mean(axis=1))
    return Problem(mesh, material, full.supports, full.loads, axes, order=full.order)
