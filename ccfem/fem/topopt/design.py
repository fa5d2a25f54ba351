"""The result of a topology optimisation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, in_brief
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.base.tensor import rotate_stiffness
from ccfem.fem.elasticity.load_kinds import points_of
from ccfem.fem.elasticity.problem import Order, Problem
from ccfem.fem.plates.problem import PlaneProblem, fitted_harmonics, rotate_plane, turned_by

_APART = "falls apart between its loads and supports"
_CURE = "raise the volume fraction or the filter radius"
FALLS_APART = f"the design {_APART}: {_CURE}"
"""What is wrong with densities whose part joins not all of them, and the cure."""


@dataclass(frozen=True)
class Design:
    """Densities that an optimisation found.

    Attributes
    ----------
    full : PlaneProblem or Problem
        The problem at full density.
    density : (m,) array in [0, 1]
        Of each cell (filtered, with a density filter).
    variables : (m,) array in [0, 1]
        What the optimiser changes: equal to `density` unless that is filtered. Start from them to
        continue a run.
    factor : (m,) array in (0, 1]
        On the stiffness of each cell, from its density.
    compliance : (k,) array, N mm
        Weighted compliance of every iterate, the last one being that of `density`.
    change : (k - 1,) array
        Largest change of a variable in every iteration.
    converged : str
        "change", "objective", or "" when the iterations ran out.
    angle : (m,) array, radians, or None
        Of the material axis of each cell, where it was optimised.
    """

    full: PlaneProblem | Problem
    density: FloatArray
    variables: FloatArray
    factor: FloatArray
    compliance: FloatArray
    change: FloatArray
    converged: str
    angle: FloatArray | None = None

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, density=float, variables=float, factor=float, angle=float)
        freeze(self, compliance=float, change=float)

    @property
    def iterations(self) -> int:
        """Iterations taken."""
        return len(self.change)

    @property
    def apart(self) -> str:
        """What is wrong where its part joins not all loads and supports, and the cure."""
        if self.converged or not self.iterations:
            return FALLS_APART
        return (
            f"the design has not converged (iterations: {self.iterations}) and {_APART}: give it "
            f"more iterations (--iterations), or {_CURE}"
        )

    @property
    def volumes(self) -> FloatArray:
        """Volume of each cell, (m,), mm^3."""
        full = self.full
        return full.volumes if isinstance(full, PlaneProblem) else full.mesh.volumes

    @property
    def volume_fraction(self) -> float:
        """Share of the volume that is filled."""
        return float(self.volumes @ self.density / self.volumes.sum())

    @property
    def grey(self) -> float:
        """Sigmund's measure of non-discreteness, the mean of 4 rho (1 - rho): 0 is black/white."""
        return float(np.mean(4.0 * self.density * (1.0 - self.density)))

    @property
    def problem(self) -> PlaneProblem | Problem:
        """The problem with the stiffness that the densities give, on the cells as they are."""
        if isinstance(self.full, PlaneProblem):
            return replace(self.full, stiffness=self.factor[:, None, None] * self.full.stiffness)
        order: Order = 1 if self.full.mesh.order == 1 else 2
        return replace(self.full, density=self.factor, order=order)

    def axes_at(self, points: FloatArray) -> FloatArray | None:
        """Material axes (k, 3, 3), as columns, of the cells nearest to points (k, 3), mm.

        None where the design has no angles.
        """
        if self.angle is None:
            return None
        mesh = self.full.mesh
        centres = mesh.centres
        return axes_about_z(self.angle[cKDTree(centres).query(points[:, : centres.shape[1]])[1]])

    def filled(self, volume_fraction: float | None = None) -> BoolArray:
        """Densest cells, as an (m,) mask, that make up a share of the volume.

        By default that of the design.
        """
        share = self.volume_fraction if volume_fraction is None else volume_fraction
        check_number("volume_fraction", share, above=0.0, at_most=1.0)
        order = np.argsort(-self.density, kind="stable")
        reached = np.cumsum(self.volumes[order])
        count = int(np.searchsorted(reached, share * reached[-1] * (1.0 + 1e-12), side="right"))
        result = np.zeros(len(order), dtype=bool)
        result[order[: max(count, 1)]] = True
        return result


# Stiffness of a material whose axis turns about z.


def sheet(plane: FloatArray) -> FloatArray:
    """Stiffness (6, 6) of a solid that is strained in its plane as a thin sheet, MPa.

    Parameters
    ----------
    plane : (3, 3) array, MPa
        Plane stress stiffness of the sheet.

    Returns
    -------
    (6, 6) array, MPa
        Stress and strain along z are uncoupled from those in the plane; the shears across it are
        as stiff as the one in it. For tetrahedra that are held along z at every node.
    """
    solid = np.diag([0.0, 0.0, 0.5 * (plane[0, 0] + plane[1, 1]), plane[2, 2], plane[2, 2], 0.0])
    solid[np.ix_([0, 1, 5], [0, 1, 5])] = plane
    return solid


def axes_about_z(angle: FloatArray) -> FloatArray:
    """Axes (m, 3, 3) as columns, turned about z by angles (m,), radians."""
    axes = np.zeros((len(angle), 3, 3))
    axes[:, 0, 0] = axes[:, 1, 1] = np.cos(angle)
    axes[:, 1, 0], axes[:, 0, 1], axes[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
    return axes


def harmonics(material: FloatArray) -> FloatArray:
    """Five matrices (5, k, k) that give the stiffness turned about z, as `turned_by` combines them.

    Constant, cos 2a, sin 2a, cos 4a, sin 4a; for an orthotropic sheet the invariants U1 to U5 of
    Tsai and Pagano (1968).

    Parameters
    ----------
    material : (3, 3) or (6, 6) array, MPa
        In material axes.

    Raises
    ------
    InputError
        For a solid that is not symmetric about the x-y plane.
    """
    if material.shape == (3, 3):
        return fitted_harmonics(lambda angle: rotate_plane(material, angle))

    def turned(angle: FloatArray) -> FloatArray:
        return rotate_stiffness(material, axes_about_z(angle))

    fitted = fitted_harmonics(turned)
    other = np.array([0.3, 1.9])
    missed = turned(other) - np.tensordot(turned_by(other), fitted, axes=1)
    if np.abs(missed).max() > 1e-9 * np.abs(material).max():
        raise InputError(
            "a material whose axis turns about z must be symmetric about the x-y plane: "
            "give one with an axis of symmetry along z"
        )
    return fitted


def anchors(problem: PlaneProblem | Problem, without: Sequence[str] = ()) -> list[IntArray]:
    """Nodes of each held or loaded patch, and of each point force: what a part has to join."""
    mesh, used = problem.mesh, np.unique(problem.mesh.cells)
    nodes = [np.unique(mesh.patch(k)) for k in problem.held_or_loaded if k not in without]
    for load in (load for case in problem.loads.values() for load in case):
        for point in points_of(load):
            away = mesh.points[used] - point[: mesh.points.shape[1]]
            nodes.append(used[[np.linalg.norm(away, axis=1).argmin()]])
    return nodes
