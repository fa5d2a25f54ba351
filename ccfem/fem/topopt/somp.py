"""SOMP: densities and the axis of an anisotropic material, by SIMP and principal stress."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.base.progress import Progress, silent
from ccfem.base.tensor import strongest_in_plane
from ccfem.fem.elasticity import Problem
from ccfem.fem.plates.problem import PlaneProblem, turned_by
from ccfem.fem.topopt.compliance import Compliance, Response
from ccfem.fem.topopt.design import Design, harmonics, sheet
from ccfem.fem.topopt.parametrisation import ConeFilter, Parameters, Parametrisation
from ccfem.fem.topopt.simp import iterate

# Cells whose material axis turns: their compliance, and where to turn the axes.


_LARGEST_TURN = np.radians(5.0)
"""Of a gradient step."""


@dataclass(frozen=True)
class OrientedCompliance:
    """Compliance of a part whose material axis turns from group to group, about z.

    The angles (g,), radians, are from global axis x to the material axis; `harmonics` (5, k, k),
    MPa, are those of the material.
    """

    part: Compliance
    harmonics: FloatArray
    angle: FloatArray

    def stiffness(self, derivative: bool = False) -> FloatArray:
        """Stiffness (g, k, k) in the global axes, MPa, or its derivative by the angle."""
        return np.einsum("mk,kij->mij", turned_by(self.angle, derivative), self.harmonics)

    def __call__(self, factor: FloatArray) -> Response:
        """Response with a factor (g,) on the stiffness of each group."""
        return self.part(factor, self.stiffness())

    def angle_gradient(self, response: Response, factor: FloatArray) -> FloatArray:
        """Differentiate the compliance by the angle of each group: (g,) array, N mm."""
        slope, energy = self.stiffness(derivative=True), np.zeros(len(factor))
        for case, displacement in response.displacement.items():
            energy += self.part.weights[case] * self.part.energy(displacement, slope)
        return -factor * energy

    def principal(self, response: Response, factor: FloatArray) -> FloatArray:
        """Double-angle vectors (g, 2) of the principal stress of largest size, times that size.

        The stress is that in the x-y plane.
        """
        stiffness, total = self.stiffness(), np.zeros((len(factor), 2))
        for case, displacement in response.displacement.items():
            stress = factor[:, None] * self.part.stress(displacement, stiffness)
            value, angle, _ = strongest_in_plane(stress)
            size = self.part.weights[case] * np.abs(value)
            total += size[:, None] * _doubled(angle)
        return total


Turn = Callable[[OrientedCompliance, Response, FloatArray], OrientedCompliance]
"""Compliance of the next iteration, from that of this one, its response and factors (g,)."""


def to_principal_stress(
    model: OrientedCompliance,
    response: Response,
    factor: FloatArray,
    cone: ConeFilter,
    relaxation: float,
) -> OrientedCompliance:
    """Turn towards the filtered direction of the principal stress of largest size."""
    wanted = cone.average(model.principal(response, factor))
    size = np.linalg.norm(wanted, axis=1)
    present = _doubled(model.angle)
    direction = np.where(
        size[:, None] > 0.0, wanted / np.where(size > 0.0, size, 1.0)[:, None], present
    )
    mixed = (1.0 - relaxation) * present + relaxation * direction
    # At right angles the two cancel: turn at once.
    lost = np.linalg.norm(mixed, axis=1) < 1e-6
    mixed[lost] = direction[lost]
    return replace(model, angle=0.5 * np.arctan2(mixed[:, 1], mixed[:, 0]))


def down_the_gradient(
    model: OrientedCompliance, response: Response, factor: FloatArray, cone: ConeFilter
) -> OrientedCompliance:
    """Step down the filtered gradient, by 5 degrees where it reaches its 90th percentile."""
    gradient = cone.average(model.angle_gradient(response, factor) / cone.volumes)
    scale = float(np.percentile(np.abs(gradient), 90.0))
    if not scale > 0.0:
        return model
    step = model.angle - _LARGEST_TURN * np.clip(gradient / scale, -1.0, 1.0)
    return replace(model, angle=0.5 * np.arctan2(np.sin(2 * step), np.cos(2 * step)))


def _doubled(angle: FloatArray) -> FloatArray:
    """Vectors (g, 2) of length 1 at twice the angles (g,): lines, whatever their sense."""
    return np.stack([np.cos(2 * angle), np.sin(2 * angle)], axis=1)


@dataclass(frozen=True)
class Somp(Parameters):
    """Densities and material axes of least compliance with a given volume.

    Wang et al., Composites Part A 140 (2021) 106181, eq. 1, with the axis along the principal
    stress of largest size: averaged over the filter in double-angle form, weighted by its size and
    the penalised density. On tetrahedra the axis turns about z, and the stress is that in the x-y
    plane: for plates that lie in it.

    Attributes
    ----------
    volume_fraction, penalty, radius, filter
        As in `Simp`; so are move, tolerance, objective_tolerance, max_iterations and backend.
    minimum_stiffness : float in (0, 1), default 1e-3
        Share of the stiffness that an empty cell keeps.
    orientation : str, default "principal"
        "principal", "gradient" (steps of at most 5 degrees down the filtered gradient) or "fixed".
    relaxation : float in (0, 1], default 0.5
        Share of the way to the principal direction that is gone in an iteration.
    """

    minimum_stiffness: float = 1e-3
    orientation: Literal["principal", "gradient", "fixed"] = "principal"
    relaxation: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, "relaxation", above=0.0, at_most=1.0)

    def __call__(
        self,
        problem: PlaneProblem | Problem,
        stiffness: FloatArray,
        *,
        angle: FloatArray | float = 0.0,
        weights: Mapping[str, float] | None = None,
        solid: BoolArray | None = None,
        void: BoolArray | None = None,
        groups: IntArray | None = None,
        start: FloatArray | None = None,
        progress: Progress = silent,
    ) -> Design:
        """Optimise a plate or a part.

        Parameters
        ----------
        problem : PlaneProblem or Problem
            Its stiffness is replaced. One layer of tetrahedra held along z at every node, with
            `groups`, is a plate in plane stress.
        stiffness : (3, 3) array, MPa, or (6, 6) on tetrahedra
            Of the laminate or material, in its axes. On tetrahedra, (3, 3) is a thin sheet in plane
            stress.
        angle : (m,) array or float, radians, default 0
            Of the material axis at the start.
        weights, solid, void, progress
            As in `Simp`.
        groups : (m,) int array, optional
            Cells with the same number share density and angle: the columns of a plate of
            tetrahedra.
        start : (m,) array in [0, 1], optional
            As in `Simp`. To continue a run give its variables, and its `angle` as `angle`.

        Returns
        -------
        Design
            With `angle`, in (-pi/2, pi/2].
        """
        m = len(problem.mesh.cells)
        first, stiffness = _first_angle(angle, m), _checked_stiffness(problem, stiffness)
        uniform = np.broadcast_to(stiffness, (m, *stiffness.shape))
        part = Compliance(replace(problem, stiffness=uniform), weights, self.backend, groups)
        space = Parametrisation.of_part(self, part, solid, void)
        first = part.cells.reduced("angle", first)
        oriented = OrientedCompliance(part, harmonics(stiffness), first)
        turn = self._turn(space.cone)
        design, oriented = iterate(problem, oriented, space, start, progress, turn)
        member = part.cells.member
        full = replace(problem, stiffness=oriented.stiffness()[member])
        return replace(design, full=full, angle=oriented.angle[member])

    def _turn(self, cone: ConeFilter) -> Turn | None:
        """How the axes turn from one iteration to the next."""
        if self.orientation == "principal":
            return partial(to_principal_stress, cone=cone, relaxation=self.relaxation)
        return partial(down_the_gradient, cone=cone) if self.orientation == "gradient" else None


def _first_angle(angle: FloatArray | float, m: int) -> FloatArray:
    """Angle of the material axis of each cell at the start, (m,), radians."""
    first = np.asarray(angle, dtype=np.float64)
    if first.shape not in ((), (m,)) or not np.isfinite(first).all():
        raise InputError(f"angle must be one number or one a cell ({m}); got shape {first.shape}")
    return np.broadcast_to(first, (m,))


def _checked_stiffness(problem: PlaneProblem | Problem, stiffness: FloatArray) -> FloatArray:
    """Stiffness in material axes of the size that the problem's cells take."""
    stiffness = np.asarray(stiffness, dtype=np.float64)
    size = 3 if isinstance(problem, PlaneProblem) else 6
    if size == 6 and stiffness.shape == (3, 3):
        return sheet(stiffness)
    if stiffness.shape != (size, size):
        raise InputError(
            f"stiffness must have shape ({size}, {size}) here; got {stiffness.shape}: give "
            "Material.stiffness for tetrahedra, plane_stress(...) for a plate"
        )
    return stiffness
