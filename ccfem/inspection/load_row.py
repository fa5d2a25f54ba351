"""What a load comes to: its resultant, where that acts, and how much of it falls on supports."""

import re
from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray, freeze
from ccfem.elasticity.held import Held
from ccfem.elasticity.load_kinds import (
    BodyForce,
    Displacement,
    Gravity,
    Load,
    SurfaceLoad,
    Temperature,
    patches_of,
)
from ccfem.elasticity.loads import nodal_forces
from ccfem.elasticity.problem import Problem
from ccfem.elasticity.volume_loads import volume_forces

__all__ = ["LoadRow", "kind_of", "load_row"]

_NONE = 1e-9
"""Resultant over the sum of the sizes of the nodal forces that counts as none."""


@dataclass(frozen=True)
class LoadRow:
    """A load.

    Attributes
    ----------
    case : str
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
    kind = kind_of(load)
    where = "".join(f" on {name}" for name in patches_of(load))
    if isinstance(load, Displacement | Temperature):
        nothing = np.full(3, np.nan)
        return LoadRow(case, f"{kind}{where}", nothing, nothing, nothing, 0.0)
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
    lost = 0.0
    if held is not None and held.ties is None and isinstance(load, SurfaceLoad):
        free = np.linalg.norm(np.where(held.free[: len(forces)], forces, 0.0), axis=1)
        lost = 1.0 - float(free.sum() / sizes.sum())
    return LoadRow(case, f"{kind}{where}", total, moment, point, lost)


def kind_of(value: object) -> str:
    """Kind of a load or a support in words, as "point force"."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(value).__name__).lower()
