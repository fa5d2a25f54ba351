"""SOMP: densities and the axis of an anisotropic material, by SIMP and principal stress."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ccfem.arrays import BoolArray, FloatArray
from ccfem.elasticity.plane_problem import PlaneProblem
from ccfem.elasticity.plane_stiffness import plane_harmonics, turned_by
from ccfem.errors import InputError
from ccfem.progress import Progress, silent
from ccfem.tensor import largest_in_plane
from ccfem.topopt.compliance import Loaded, PlaneCompliance, compliance_of
from ccfem.topopt.design import Design
from ccfem.topopt.filters import ConeFilter
from ccfem.topopt.iteration import Limits, iterate
from ccfem.topopt.parametrisation import parametrise

__all__ = ["ORIENTATIONS", "OrientedCompliance", "somp"]

_LARGEST_TURN = np.radians(5.0)
"""Of a gradient step."""


class OrientedCompliance:
    """Compliance of a plate whose material axis turns from cell to cell.

    Parameters
    ----------
    plate : PlaneCompliance
    material : (3, 3) array, MPa
        Stiffness in material axes.
    angle : (m,) array, radians
        From global axis x to the material axis, at the start.
    turn : callable, optional
        New angles (m,) from this value and its answer and the factors (m,); applied between one
        call and the next.
    """

    def __init__(
        self,
        plate: PlaneCompliance,
        material: FloatArray,
        angle: FloatArray,
        turn: "Callable[[OrientedCompliance, Loaded, FloatArray], FloatArray] | None" = None,
    ) -> None:
        self.plate, self.angle = plate, angle
        self.centres, self.volumes = plate.centres, plate.volumes
        self._harmonics = plane_harmonics(material)
        self._thickness = np.asarray(plate.system.problem.thickness)[:, None, None]
        self._turn = turn
        self._next = angle

    def stiffness(self, derivative: bool = False) -> FloatArray:
        """Stiffness (m, 3, 3) in the global axes, MPa, or its derivative by the angle."""
        return np.einsum("mk,kij->mij", turned_by(self.angle, derivative), self._harmonics)

    def __call__(self, factor: FloatArray) -> Loaded:
        """Answer with a factor (m,) on the stiffness of each cell, at the present angles."""
        self.angle = self._next
        matrices = self._thickness * self.plate.system.elements.matrices(self.stiffness())
        answer = self.plate(factor, matrices)
        if self._turn is not None:
            self._next = self._turn(self, answer, factor)
        return answer

    def angle_gradient(self, answer: Loaded, factor: FloatArray) -> FloatArray:
        """Differentiate the compliance by the angle of each cell: (m,) array, N mm."""
        elements = self.plate.system.elements
        slope = self._thickness * elements.matrices(self.stiffness(derivative=True))
        energy = np.zeros(len(factor))
        for case, displacement in answer.displacement.items():
            own = elements.cell_displacement(displacement)
            energy += self.plate.weights[case] * np.einsum("mi,mij,mj->m", own, slope, own)
        return -factor * energy

    def principal(self, answer: Loaded, factor: FloatArray) -> FloatArray:
        """Double-angle vectors (m, 2) of the principal stress of largest size, times that size."""
        elements, stiffness = self.plate.system.elements, self.stiffness()
        total = np.zeros((len(factor), 2))
        for case, displacement in answer.displacement.items():
            strain = elements.centre_strain(displacement)
            stress = factor[:, None] * np.einsum("mij,mj->mi", stiffness, strain)
            largest, smallest, angle = largest_in_plane(stress)
            # Across the larger principal stress where the smaller one is larger in size.
            angle = np.where(largest >= -smallest, angle, angle + 0.5 * np.pi)
            size = self.plate.weights[case] * np.maximum(np.abs(largest), np.abs(smallest))
            total += size[:, None] * np.stack([np.cos(2 * angle), np.sin(2 * angle)], axis=1)
        return total


def _by_principal_stress(
    cone: ConeFilter, relaxation: float
) -> Callable[[OrientedCompliance, Loaded, FloatArray], FloatArray]:
    """Turn towards the filtered direction of the largest principal stress."""

    def turn(part: OrientedCompliance, answer: Loaded, factor: FloatArray) -> FloatArray:
        wanted = cone.average(part.principal(answer, factor))
        size = np.linalg.norm(wanted, axis=1)
        present = np.stack([np.cos(2 * part.angle), np.sin(2 * part.angle)], axis=1)
        direction = np.where(
            size[:, None] > 0.0, wanted / np.where(size > 0.0, size, 1.0)[:, None], present
        )
        mixed = (1.0 - relaxation) * present + relaxation * direction
        # At right angles the two cancel: turn at once.
        lost = np.linalg.norm(mixed, axis=1) < 1e-6
        mixed[lost] = direction[lost]
        return 0.5 * np.arctan2(mixed[:, 1], mixed[:, 0])

    return turn


def _by_gradient(
    cone: ConeFilter,
) -> Callable[[OrientedCompliance, Loaded, FloatArray], FloatArray]:
    """Step down the filtered gradient, by 5 degrees where it is as large as at most cells."""

    def turn(part: OrientedCompliance, answer: Loaded, factor: FloatArray) -> FloatArray:
        gradient = cone.average(part.angle_gradient(answer, factor) / part.volumes)
        scale = float(np.percentile(np.abs(gradient), 90.0))
        if not scale > 0.0:
            return part.angle
        step = part.angle - _LARGEST_TURN * np.clip(gradient / scale, -1.0, 1.0)
        return 0.5 * np.arctan2(np.sin(2 * step), np.cos(2 * step))

    return turn


ORIENTATIONS = ("principal", "gradient", "fixed")


def somp(
    problem: PlaneProblem,
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
    the penalised density.

    Parameters
    ----------
    problem : PlaneProblem
        Its stiffness is replaced by that of the material.
    material : (3, 3) array, MPa
        Stiffness in material axes.
    volume_fraction, penalty, radius, filter
        As in `simp`.
    orientation : str, default "principal"
        "principal", "gradient" (steps of at most 5 degrees down the filtered gradient) or "fixed".
    angle : (m,) array or float, radians, default 0
        Of the material axis at the start.
    relaxation : float in (0, 1], default 0.5
        Share of the way to the principal direction that is gone in an iteration.
    weights, solid, void, start, least, move, tolerance, objective_tolerance, iterations
        As in `simp`; an empty cell keeps 1e-3 of its stiffness.
    backend, progress
        As in `simp`.

    Returns
    -------
    Design
        With `angle`, in (-pi/2, pi/2].
    """
    if not isinstance(problem, PlaneProblem):
        raise InputError("somp turns the material axis in a plane: give it a PlaneProblem")
    if orientation not in ORIENTATIONS:
        raise InputError(
            f"no orientation named '{orientation}'; there are: {', '.join(ORIENTATIONS)}"
        )
    if not 0.0 < relaxation <= 1.0:
        raise InputError(f"relaxation must lie in (0, 1]; got {relaxation}")
    m = len(problem.mesh.cells)
    first = np.asarray(angle, dtype=np.float64)
    if first.shape not in ((), (m,)) or not np.isfinite(first).all():
        raise InputError(f"angle must be one number or one a cell ({m}); got shape {first.shape}")
    plate = compliance_of(replace(problem, stiffness=material), weights, backend)
    assert isinstance(plate, PlaneCompliance)
    space = parametrise(plate, volume_fraction, penalty, radius, filter, solid, void, least)
    turns = {
        "principal": _by_principal_stress(space.cone, relaxation),
        "gradient": _by_gradient(space.cone),
        "fixed": None,
    }
    model = OrientedCompliance(plate, material, np.broadcast_to(first, (m,)), turns[orientation])
    limits = Limits(volume_fraction, move, tolerance, objective_tolerance, iterations)
    design = iterate(problem, model, space, limits, start, progress)
    return replace(design, full=replace(problem, stiffness=model.stiffness()), angle=model.angle)
