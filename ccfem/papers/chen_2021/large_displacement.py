"""How far the principal directions turn when a part is pulled far: figure 14.

The solver is linear. A large displacement is therefore made of small steps: each solves the part
in the shape that the steps before left, adds its stress to what is there, turned with the material,
and moves the nodes: an updated Lagrangian scheme of explicit steps. The material is isotropic and
elastic; the paper's is stiffer along the fibre.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.assembly import cell_gradients
from ccfem.fem.elasticity.load_kinds import Displacement
from ccfem.fem.elasticity.problem import Problem, Support
from ccfem.fem.elasticity.solve import solve
from ccfem.fem.elasticity.stress_field import StressField


class Turned(NamedTuple):
    """Angles (m,) of the cells in [0, 90] degrees: in space, and against the turned material."""

    in_space: FloatArray
    in_material: FloatArray


def turns_at(
    problem: Problem, pull: FloatArray, stops: Sequence[float], step: float = 1.0
) -> dict[float, Turned]:
    """Angle that the tension of every cell has turned since the first step.

    Parameters
    ----------
    problem : Problem
        With the patches "support", which is held, and "load", which is moved.
    pull : (3,) array
        Unit vector.
    stops : sequence of float, mm
        Displacements to look at, growing.
    step : float, mm, default 1
        Displacement between two solves.

    Returns
    -------
    dict of displacement to Turned
    """
    mesh = problem.mesh
    turn = np.tile(np.eye(3), (len(mesh.cells), 1, 1))
    stress = np.zeros_like(turn)
    first = stress
    moved, angles = 0.0, {}
    for stop in stops:
        while moved < stop - 1e-9:
            by = min(step, stop - moved)
            field = _moved(mesh, problem, by * pull)
            increment = _rotations(mesh, field.displacement)
            stress = increment @ stress @ increment.mT + field.stress
            turn = increment @ turn
            mesh = TetMesh(mesh.points + field.displacement, mesh.cells, mesh.patches)
            first = stress if moved == 0.0 else first
            moved += by
        still = np.broadcast_to(np.eye(3), turn.shape)
        angles[stop] = Turned(turned_by(first, stress, still), turned_by(first, stress, turn))
    return angles


def turned_by(first: FloatArray, last: FloatArray, turn: FloatArray) -> FloatArray:
    """Angles (m,), degrees, between tensions, the first carried along by rotations (m, 3, 3)."""
    carried = np.einsum("mij,mj->mi", turn, np.linalg.eigh(first)[1][:, :, -1])
    now = np.linalg.eigh(last)[1][:, :, -1]
    cosine = np.abs(np.einsum("mi,mi->m", carried, now))
    return np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))


def _moved(mesh: TetMesh, problem: Problem, vector: FloatArray) -> StressField:
    """Solve one step: the patch "load" moves by a vector, "support" stays."""
    supports = (Support("support"), Support("load"))
    x, y, z = (float(v) for v in vector)
    move = Displacement("load", (x, y, z))
    step = Problem(mesh, problem.material, supports, {"step": (move,)}, order=1)
    return solve(step)["step"]


def _rotations(mesh: TetMesh, displacement: FloatArray) -> FloatArray:
    """Rotations (m, 3, 3) of the cells: the nearest ones to their deformation gradients."""
    gradient = np.einsum("mad,mae->mde", displacement[mesh.cells], cell_gradients(mesh)) + np.eye(3)
    left, _, right = np.linalg.svd(gradient)
    return left @ right
