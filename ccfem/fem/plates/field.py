"""What the solve of a plate finds: displacement, strain, stress and energy."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, freeze, in_brief
from ccfem.fem.elasticity.stress_field import SolveRecord
from ccfem.fem.plates.mesh import PlaneMesh
from ccfem.fem.plates.problem import PlaneProblem
from ccfem.fem.plates.stiffness import strain_in_axes, stress_in_axes


@dataclass(frozen=True)
class PlaneField:
    """Displacement, strain and stress of one load case of a plate.

    Attributes
    ----------
    case : str
        Name of the load case.
    displacement : (n, 2) array, mm
    strain : (m, 3) array
        [e11, e22, 2 e12] at the centre of each cell, in the global axes.
    stress : (m, 3) array, MPa
        [s11, s22, s12] there; of layers stacked in one cell, their mean.
    cell_energy : (m,) array, N mm
        Strain energy of each cell.
    reactions : (n, 2) array, N
        Force that the supports put on the plate; zero away from them.
    """

    problem: PlaneProblem
    case: str
    displacement: FloatArray
    strain: FloatArray
    stress: FloatArray
    cell_energy: FloatArray
    reactions: FloatArray
    record: SolveRecord

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, displacement=float, strain=float, stress=float)
        freeze(self, cell_energy=float, reactions=float)

    @property
    def mesh(self) -> PlaneMesh:
        """Mesh of the problem."""
        return self.problem.mesh

    @property
    def strain_energy(self) -> float:
        """Strain energy of the plate, N mm."""
        return float(self.cell_energy.sum())

    @property
    def energy_density(self) -> FloatArray:
        """Strain energy of each cell over its volume, (m,), MPa."""
        return self.cell_energy / self.problem.volumes

    def stress_in(self, angle: FloatArray, stiffness: FloatArray | None = None) -> FloatArray:
        """Stress at the centre of each cell in its material axes.

        Parameters
        ----------
        angle : (m,) array or float, radians
            From global axis x to material axis 1.
        stiffness : (3, 3) or (m, 3, 3) array, MPa, optional
            In material axes: of the one layer that the stress is wanted in. By default the mean
            stress of the cell is turned.

        Returns
        -------
        (m, 3) array, MPa
            [s11, s22, s12].
        """
        if stiffness is None:
            return stress_in_axes(self.stress, angle)
        return np.einsum("...ij,...j->...i", stiffness, strain_in_axes(self.strain, angle))
