"""Displacement, strain and stress at points, along lines and on patches; forces of supports."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, freeze, in_brief
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.nodes import edge_nodes, nearest_node, patch_nodes
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.support_kinds import (
    AnySupport,
    EdgeSupport,
    PointSpring,
    PointSupport,
    RigidPatch,
)
from ccfem.geometry.locate import locate


@dataclass(frozen=True)
class Probe:
    """Results of a solution at points.

    Attributes
    ----------
    points : (k, 3) array, mm
    displacement : (k, 3) array, mm
    strain : (k, 3, 3) array
        Tensor: shear entries are half the engineering ones.
    stress : (k, 3, 3) array, MPa
    """

    points: FloatArray
    displacement: FloatArray
    strain: FloatArray
    stress: FloatArray

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, points=float, displacement=float, strain=float, stress=float)

    @property
    def distance(self) -> FloatArray:
        """Length (k,) of the line through the points, from the first one, mm."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([np.zeros(min(1, len(self.points))), np.cumsum(steps)])


def located(mesh: TetMesh, points: FloatArray, tolerance: float) -> tuple[IntArray, FloatArray]:
    """Cell (k,) that holds each point (k, 3), and barycentric coordinates (k, 4) in it.

    Raises
    ------
    InputError
        When a point lies farther than the tolerance, mm, outside the part.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise InputError(f"points must be finite and of shape (k, 3), mm; got {points.shape}")
    cell, weights = locate(mesh.points, mesh.corners, points, tolerance)
    if (cell < 0).any():
        first = int(np.flatnonzero(cell < 0)[0])
        raise InputError(
            f"stress is known in the part only; {int((cell < 0).sum())} of {len(cell)} points "
            f"lie outside, the first at {np.round(points[first], 6).tolist()}: check the frame"
        )
    return cell, weights


def displacement_at(
    mesh: TetMesh, displacement: FloatArray, cell: IntArray, weights: FloatArray
) -> FloatArray:
    """Displacement (k, 3), mm, at barycentric coordinates (k, 4) of cells (k,)."""
    values = weights
    if mesh.order == 2:
        i, j = mesh.edges.T
        middle = 4.0 * weights[:, i] * weights[:, j]
        values = np.hstack([weights * (2.0 * weights - 1.0), middle])
    return np.einsum("ka,kai->ki", values, displacement[mesh.cells[cell]])


def support_forces(problem: Problem, reactions: FloatArray) -> dict[str, FloatArray]:
    """Force (3,), N, of each support on the part, by the patch, edge or point that it holds.

    Where supports share a node, each component is divided equally among those that hold it, so that
    all forces together are the total reaction.

    Parameters
    ----------
    problem : Problem
    reactions : (n, 3) array, N
        As `StressField.reactions`.
    """
    mesh = problem.mesh
    claims = [_claim(mesh, support) for support in problem.supports]
    held = np.zeros(mesh.points.shape)
    for _, nodes, components in claims:
        held[np.ix_(nodes, components)] += 1.0
    share = np.divide(reactions, held, out=np.zeros_like(held), where=held > 0.0)
    forces: dict[str, FloatArray] = {}
    for label, nodes, components in claims:
        force = np.zeros(3)
        force[components] = share[np.ix_(nodes, components)].sum(axis=0)
        forces[label] = forces.get(label, np.zeros(3)) + force
    return forces


def _claim(mesh: TetMesh, support: AnySupport) -> tuple[str, IntArray, IntArray]:
    """Name of a support, its nodes, and the components that it may hold there."""
    letters = "xyz" if isinstance(support, RigidPatch) else getattr(support, "components", "xyz")
    components = np.array([k for k in range(3) if "xyz"[k] in letters], dtype=np.int64)
    if isinstance(support, EdgeSupport):
        label = f"edge of {support.patches[0]} and {support.patches[1]}"
        return label, edge_nodes(mesh, support.patches), components
    if isinstance(support, PointSupport | PointSpring):
        node = nearest_node(mesh, support.point, "a support")
        at = ", ".join(f"{x:.6g}" for x in support.point)
        return f"point ({at})", np.array([node]), components
    return support.patch, patch_nodes(mesh, support.patch), components
