"""Rules that choose cells of a mesh by where their centres lie: in a box, in a cylinder.

The border of what they choose runs along the cells, so it is as fine as they are.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.body.mesh.patches import Vector, unit_vector
from ccfem.body.mesh.tet_mesh import TetMesh


class CellRule(Protocol):
    """Chooses cells of a mesh."""

    def __call__(self, mesh: TetMesh) -> IntArray:
        """Cells (k,), k >= 1."""
        ...


@dataclass(frozen=True)
class CellBox:
    """Cells with their centres in a box.

    Attributes
    ----------
    lower, upper : tuple of 3 floats, mm
        Opposite corners; infinite where the box has no end.
    """

    lower: Vector
    upper: Vector

    def __post_init__(self) -> None:
        check_box(self.lower, self.upper)

    def __call__(self, mesh: TetMesh) -> IntArray:
        """Cells (k,) in the box."""
        centres = _centres(mesh)
        inside: BoolArray = np.all((centres >= self.lower) & (centres <= self.upper), axis=1)
        return _chosen(inside, f"box {self.lower} to {self.upper}", mesh)


@dataclass(frozen=True)
class CellCylinder:
    """Cells with their centres in a cylinder, which goes through the whole part.

    Attributes
    ----------
    point : tuple of 3 floats, mm
        A point on the axis.
    axis : str or tuple of 3 floats
        Direction of the axis.
    radius : float, mm
    """

    point: Vector
    axis: str | Vector
    radius: float

    def __post_init__(self) -> None:
        unit_vector(self.axis, "cylinder axis")
        check_fields(self, "radius", above=0.0, unit="mm")

    def __call__(self, mesh: TetMesh) -> IntArray:
        """Cells (k,) in the cylinder."""
        axis = unit_vector(self.axis, "cylinder axis")
        arm = _centres(mesh) - np.asarray(self.point)
        away = np.linalg.norm(arm - np.outer(arm @ axis, axis), axis=1)
        label = f"cylinder round {self.point} along {self.axis}, radius {self.radius:g} mm"
        inside: BoolArray = away <= self.radius
        return _chosen(inside, label, mesh)


def check_box(lower: Vector, upper: Vector) -> None:
    """Refuse opposite corners of a box, mm, of which the first does not lie below the second."""
    if not (np.asarray(lower) < np.asarray(upper)).all():
        raise InputError(f"box lower must lie below upper; got {lower} and {upper}: swap them")


def _centres(mesh: TetMesh) -> FloatArray:
    return np.asarray(mesh.points[mesh.corners].mean(axis=1))


def _chosen(inside: BoolArray, label: str, mesh: TetMesh) -> IntArray:
    if not inside.any():
        (x, y, z), (u, v, w) = mesh.bounds
        raise InputError(
            f"{label} holds the centre of no cell; the part lies between ({x:.4g}, {y:.4g}, "
            f"{z:.4g}) and ({u:.4g}, {v:.4g}, {w:.4g}) mm: move or widen it, or shorten the edges"
        )
    return np.flatnonzero(inside)
