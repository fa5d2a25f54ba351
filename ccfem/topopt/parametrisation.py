"""Penalised densities: from the variables of an optimiser to stiffness, and gradients back."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ccfem.arrays import BoolArray, FloatArray
from ccfem.errors import InputError
from ccfem.topopt.filters import ConeFilter
from ccfem.topopt.model import ComplianceModel
from ccfem.topopt.parameters import Parameters

__all__ = ["Parametrisation"]


@dataclass(frozen=True)
class Parametrisation:
    """How variables become densities and stiffness, with the gradients back.

    Attributes
    ----------
    parameters : Parameters
    cone : ConeFilter
    solid, void : (m,) bool arrays
        Passive cells, whose density stays 1 or 0.
    """

    parameters: Parameters
    cone: ConeFilter
    solid: BoolArray
    void: BoolArray

    @classmethod
    def of_model(
        cls,
        parameters: Parameters,
        model: ComplianceModel,
        solid: BoolArray | None,
        void: BoolArray | None,
    ) -> "Parametrisation":
        """Make the filter of a part, and check its passive cells, (m,) each or None.

        Raises
        ------
        InputError
            For cells that are both solid and void, a volume fraction that the passive cells make
            impossible, and a radius so large that every cell sees most others.
        """
        m = len(model.volumes)
        solid = np.zeros(m, dtype=bool) if solid is None else solid
        void = np.zeros(m, dtype=bool) if void is None else void
        if solid.dtype != np.bool_ or void.dtype != np.bool_:
            raise InputError(
                f"solid and void must be bool arrays; got {solid.dtype} and {void.dtype}"
            )
        if (solid & void).any():
            raise InputError("a cell cannot be both solid and void: correct the masks")
        filled, empty = (float(model.volumes[mask].sum()) for mask in (solid, void))
        total, share = float(model.volumes.sum()), parameters.volume_fraction
        if not filled < share * total < total - empty:
            raise InputError(
                f"volume fraction {share} cannot be met: solid cells fill {filled / total:.3g} and "
                f"void cells {empty / total:.3g} of the volume"
            )
        cone = ConeFilter.of_cells(model.centres, model.volumes, parameters.radius)
        return cls(parameters, cone, solid, void)

    @cached_property
    def free(self) -> BoolArray:
        """Cells whose density is to be found, (m,)."""
        return ~(self.solid | self.void)

    def start(self, given: FloatArray | None) -> FloatArray:
        """Variables (m,) to begin with: given, or uniform where they are free."""
        volumes = self.cone.volumes
        if given is not None:
            variables = np.array(given, dtype=np.float64)
            if not ((variables >= 0.0) & (variables <= 1.0)).all():
                raise InputError(
                    f"start must be densities in [0, 1]; got {variables.min()} to {variables.max()}"
                )
        else:
            rest = self.parameters.volume_fraction * volumes.sum() - volumes[self.solid].sum()
            variables = np.full(len(volumes), rest / volumes[self.free].sum())
        variables[self.solid], variables[self.void] = 1.0, 0.0
        return variables

    def density(self, variables: FloatArray) -> FloatArray:
        """Densities (m,) of the variables (m,)."""
        filtered = self.parameters.filter == "density"
        density = self.cone.average(variables) if filtered else variables.copy()
        density[self.solid], density[self.void] = 1.0, 0.0
        return density

    def factor(self, density: FloatArray) -> FloatArray:
        """Factor (m,) on the stiffness of each cell, by modified SIMP.

        ``least + density**penalty * (1 - least)`` with the minimum stiffness (Sigmund, Struct.
        Multidisc. Optim. 33 (2007) 401).
        """
        least = self.parameters.minimum_stiffness
        return least + density**self.parameters.penalty * (1.0 - least)

    def gradient(self, density: FloatArray, energy: FloatArray) -> FloatArray:
        """Differentiate the compliance by the variables, exactly: (m,) array.

        Parameters
        ----------
        density : (m,) array
        energy : (m,) array, N mm
            ``u^T k u`` of each cell at full density.
        """
        penalty, least = self.parameters.penalty, self.parameters.minimum_stiffness
        slope = penalty * density ** (penalty - 1.0) * (1.0 - least)
        return self._by_variables(-slope * energy)

    def volume_gradient(self) -> FloatArray:
        """Differentiate the volume by the variables: (m,) array, mm^3."""
        return self._by_variables(self.cone.volumes)

    def _by_variables(self, by_density: FloatArray) -> FloatArray:
        """Gradient (m,) by the variables from that by the densities: the chain rule."""
        own = np.where(self.free, by_density, 0.0)
        return self.cone.transposed(own) if self.parameters.filter == "density" else own

    def sensitivities(
        self, variables: FloatArray, density: FloatArray, energy: FloatArray
    ) -> FloatArray:
        """Gradient (m,) that the update takes: with the sensitivity filter, smoothed."""
        gradient = self.gradient(density, energy)
        if self.parameters.filter == "sensitivity":
            return self.cone.sensitivities(variables, gradient)
        return gradient
