"""What a load comes to: its resultant, where that acts, and how much of it falls on supports."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, freeze
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.load_kinds import (
    BodyForce,
    Displacement,
    Gravity,
    Load,
    SurfaceLoad,
    Temperature,
    in_words,
)
from ccfem.fem.elasticity.loads import nodal_forces
from ccfem.fem.elasticity.plausibility import held_share
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.volume_loads import volume_forces

_NONE = 1e-9
"""Resultant over the sum of the sizes of the nodal forces that counts as none."""


@dataclass(frozen=True)
class LoadRow:
    """A load.

    Attributes
    ----------
    what : str
        Kind and patch.
    resultant : (3,) array, N
        NaN for a temperature or a displacement.
    moment : (3,) array, N mm
        About the point of attack.
    point : (3,) array, mm
        Of attack: on the line of the resultant, nearest to the middle of the forces; their middle
        where they have no resultant.
    held : float
        Share of the nodal forces of a load on a patch that supports take at once; 0 for a force of
        the volume, whose share on held nodes is meant.
    """

    case: str
    what: str
    resultant: FloatArray
    moment: FloatArray
    point: FloatArray
    held: float

    def __post_init__(self) -> None:
        freeze(self, resultant=float, moment=float, point=float)

    @property
    def size(self) -> float:
        """Size of the resultant, N."""
        return float(np.linalg.norm(self.resultant))


def load_row(problem: Problem, case: str, load: Load, held: Held | None) -> LoadRow:
    """Describe a load.

    Raises
    ------
    InputError
        For a load that its patch cannot take.
    """
    what = in_words(load)
    if isinstance(load, Displacement | Temperature):
        nothing = np.full(3, np.nan)
        return LoadRow(case, what, nothing, nothing, nothing, 0.0)
    if isinstance(load, SurfaceLoad):
        forces = nodal_forces(problem.mesh, load)
    else:
        assert isinstance(load, BodyForce | Gravity)
        forces = volume_forces(problem, load)
    sizes = np.linalg.norm(forces, axis=1)
    middle = sizes @ problem.mesh.points / sizes.sum()
    total = forces.sum(axis=0)
    turning = np.cross(problem.mesh.points - middle, forces).sum(axis=0)
    point = middle
    if np.linalg.norm(total) > _NONE * sizes.sum():
        point = middle + np.cross(total, turning) / (total @ total)
    else:
        total = np.zeros(3)
    moment = turning - np.cross(point - middle, total)
    lost = 0.0 if held is None else held_share(problem, load, held)
    return LoadRow(case, what, total, moment, point, lost)
