"""Stress of a whole part for planning and evaluation, whatever its source."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ccfem.base.arrays import FloatArray, freeze
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.materials import Material

LARGEST_STRESS = 1e7
"""Largest stress that is taken for meant, MPa: ten times the modulus of diamond."""


def impossible_stress(stress: FloatArray) -> tuple[int, ...] | None:
    """Index of the first entry that is NaN, infinite or beyond `LARGEST_STRESS`; None without."""
    wrong = np.argwhere(~(np.abs(stress) <= LARGEST_STRESS))
    return tuple(wrong[0].tolist()) if len(wrong) else None


class PartStress(Protocol):
    """Stress on a tetrahedral mesh; a `StressField` is one, and so is a `GivenStress`."""

    @property
    def mesh(self) -> TetMesh:
        """The mesh."""
        ...

    @property
    def stress(self) -> FloatArray:
        """Stress of each cell, (m, 3, 3), MPa."""
        ...

    @property
    def nodal(self) -> FloatArray:
        """Stress at the nodes, (n, 3, 3), MPa."""
        ...

    @property
    def held_or_loaded(self) -> tuple[str, ...]:
        """Names of the patches that carry a support or a load."""
        ...

    @property
    def loaded(self) -> tuple[str, ...]:
        """Those of them that carry a load."""
        ...

    @property
    def material(self) -> Material | None:
        """Material of the part; None where only its stress is known."""
        ...


@dataclass(frozen=True)
class GivenStress:
    """Stress on a mesh from another program or a formula.

    Attributes
    ----------
    stress : (m, 3, 3) array, MPa
        Per cell.
    nodal : (n, 3, 3) array, MPa
        At the nodes.
    held_or_loaded : tuple of str, default none
        Names of the patches that carry a support or a load.
    loaded : tuple of str, default none
        Those of them that carry a load.
    material : Material, optional
        Of the part, where it is known.
    assumed : str, default none
        What was assumed when it was read from a file; said with the results.

    Raises
    ------
    InputError
        For arrays of the wrong shape, and stress that is not finite or beyond `LARGEST_STRESS`.
    """

    mesh: TetMesh
    stress: FloatArray
    nodal: FloatArray
    held_or_loaded: tuple[str, ...] = ()
    loaded: tuple[str, ...] = ()
    material: Material | None = None
    assumed: str = ""

    def __repr__(self) -> str:
        return f"GivenStress on {self.mesh!r}"

    def __post_init__(self) -> None:
        freeze(self, stress=float, nodal=float)
        for name, count in (("stress", len(self.mesh.cells)), ("nodal", len(self.mesh.points))):
            value = getattr(self, name)
            if value.shape != (count, 3, 3):
                raise InputError(
                    f"{name} must have shape ({count}, 3, 3), one tensor for each "
                    f"{'cell' if name == 'stress' else 'node'}; got {value.shape}: use "
                    "tensor.from_voigt for six components"
                )
            at = impossible_stress(value)
            if at is not None:
                raise InputError(
                    f"stress must be finite and within {LARGEST_STRESS:g} MPa; got "
                    f"{value[at]:g} at {name}[{', '.join(map(str, at))}]: correct it, or its unit"
                )
