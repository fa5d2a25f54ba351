"""SOMP: densities and the axis of an anisotropic material, by SIMP and principal stress."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ccfem.arrays import BoolArray, FloatArray, IntArray
from ccfem.elasticity.problem import Problem
from ccfem.errors import InputError
from ccfem.plates.problem import PlaneProblem
from ccfem.progress import Progress, silent
from ccfem.topopt.compliance import GroupedCompliance, compliance_of
from ccfem.topopt.design import Design
from ccfem.topopt.groups import CellGroups
from ccfem.topopt.iteration import Limits, iterate
from ccfem.topopt.material_axes import (
    OrientedCompliance,
    by_gradient,
    by_principal_stress,
    sheet,
)
from ccfem.topopt.parametrisation import parametrise

__all__ = ["ORIENTATIONS", "somp"]

ORIENTATIONS = ("principal", "gradient", "fixed")


def somp(
    problem: PlaneProblem | Problem,
    material: FloatArray,
    volume_fraction: float,
    penalty: float = 3.0,
    radius: float = 2.5,
    filter: str = "sensitivity",
    *,
    orientation: str = "principal",
    angle: FloatArray | float = 0.0,
    relaxation: float = 0.5,
    weights: Mapping[str, float] | None = None,
    solid: BoolArray | None = None,
    void: BoolArray | None = None,
    start: FloatArray | None = None,
    groups: IntArray | None = None,
    least: float = 1e-3,
    move: float = 0.2,
    tolerance: float = 0.01,
    objective_tolerance: float = 1e-4,
    iterations: int = 200,
    backend: str = "auto",
    progress: Progress = silent,
) -> Design:
    """Find densities and material axes of least compliance with a given volume.

    Wang et al., Composites Part A 140 (2021) 106181, eq. 1, with the axis along the principal
    stress of largest size: averaged over the filter in double-angle form, weighted by its size and
    the penalised density. On tetrahedra the axis turns about z, and the stress is that in the x-y
    plane: for plates that lie in it.

    Parameters
    ----------
    problem : PlaneProblem or Problem
        Its stiffness is replaced by that of the material. One layer of tetrahedra held along z at
        every node, with `groups`, is a plate in plane stress.
    material : (3, 3) array, MPa, or (6, 6) on tetrahedra
        Stiffness in material axes. Of tetrahedra, (3, 3) is a thin sheet in plane stress.
    volume_fraction, penalty, radius, filter
        As in `simp`.
    orientation : str, default "principal"
        "principal", "gradient" (steps of at most 5 degrees down the filtered gradient) or "fixed".
    angle : (m,) array or float, radians, default 0
        Of the material axis at the start.
    relaxation : float in (0, 1], default 0.5
        Share of the way to the principal direction that is gone in an iteration.
    weights, solid, void, start, least, move, tolerance, objective_tolerance, iterations
        As in `simp`; an empty cell keeps 1e-3 of its stiffness. To go on with a run give its
        variables as `start` and its `angle`.
    groups : (m,) int array, optional
        Cells with the same number share density and angle: the columns of a plate of tetrahedra.
    backend, progress
        As in `simp`.

    Returns
    -------
    Design
        With `angle`, in (-pi/2, pi/2].
    """
    if orientation not in ORIENTATIONS:
        raise InputError(
            f"no orientation named '{orientation}'; there are: {', '.join(ORIENTATIONS)}"
        )
    if not 0.0 < relaxation <= 1.0:
        raise InputError(f"relaxation must lie in (0, 1]; got {relaxation}")
    m = len(problem.mesh.cells)
    first = _first_angle(angle, m)
    material = _stiffness(problem, material)
    whole = np.broadcast_to(material, (m, *material.shape))
    model: Any = compliance_of(replace(problem, stiffness=whole), weights, backend)
    cells = None if groups is None else CellGroups.of_cells(groups, m)
    if cells is not None:
        model = GroupedCompliance(model, cells.member)
        solid, void = cells.reduced("solid", solid), cells.reduced("void", void)
        start, first = cells.reduced("start", start), cells.reduced("angle", first)
    space = parametrise(model, volume_fraction, penalty, radius, filter, solid, void, least)
    turns = {
        "principal": by_principal_stress(space.cone, relaxation),
        "gradient": by_gradient(space.cone),
        "fixed": None,
    }
    oriented = OrientedCompliance(model, material, first, turns[orientation])
    limits = Limits(volume_fraction, move, tolerance, objective_tolerance, iterations)
    design = iterate(problem, oriented, space, limits, start, progress)
    stiffness, angle = oriented.stiffness(), oriented.angle
    if cells is not None:
        design = cells.expanded(design)
        stiffness, angle = stiffness[cells.member], angle[cells.member]
    return replace(design, full=replace(problem, stiffness=stiffness), angle=angle)


def _first_angle(angle: FloatArray | float, m: int) -> FloatArray:
    """Angle of the material axis of each cell at the start, (m,), radians."""
    first = np.asarray(angle, dtype=np.float64)
    if first.shape not in ((), (m,)) or not np.isfinite(first).all():
        raise InputError(f"angle must be one number or one a cell ({m}); got shape {first.shape}")
    return np.broadcast_to(first, (m,))


def _stiffness(problem: PlaneProblem | Problem, material: FloatArray) -> FloatArray:
    """Stiffness in material axes of the size that the problem's cells take."""
    material = np.asarray(material, dtype=np.float64)
    size = 3 if isinstance(problem, PlaneProblem) else 6
    if size == 6 and material.shape == (3, 3):
        return sheet(material)
    if material.shape != (size, size):
        raise InputError(
            f"material must be a stiffness of shape ({size}, {size}) here; got {material.shape}: "
            "give Material.stiffness for tetrahedra, plane_stress(...) for a plate"
        )
    return material
