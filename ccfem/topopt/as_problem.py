"""From a design to a part that is solved, sliced and printed like any other."""

from typing import Any

from ccfem.elasticity.plane_problem import PlaneProblem
from ccfem.elasticity.problem import Problem
from ccfem.errors import InputError
from ccfem.materials import Material
from ccfem.topopt.design import Design
from ccfem.topopt.plate_part import plate_part

__all__ = ["as_problem"]


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

    Parameters
    ----------
    design : Design
        Of a plate on a raster.
    material : Material
        Its axes turn with the design's angles, where it has angles.
    thickness : float, mm, optional
        Height of the part; default the thickness of the plate.
    edge_length : float, mm, optional
        Of the tetrahedra aimed at; default two pixels.
    domain : shapely Polygon, mm, optional
        Exact design domain; default the pixels.
    volume_fraction : float in (0, 1], optional
        Share of the domain that the part fills; default that of the design.

    Returns
    -------
    Problem

    Raises
    ------
    InputError
        When no piece joins all loads and supports, or a patch is not reached.
    """
    if not isinstance(design.full, PlaneProblem):
        raise InputError("a part is made of a design of a plate; this design is of tetrahedra")
    return plate_part(design, material, thickness, edge_length, domain, volume_fraction)
