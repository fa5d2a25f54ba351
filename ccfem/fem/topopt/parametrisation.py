"""Penalised densities: from the variables of an optimiser to stiffness, and gradients back."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.errors import InputError
from ccfem.fem.topopt.compliance import CellGroups, Compliance

# Filters against checkerboards and mesh dependence: of densities, or of sensitivities.


@dataclass(frozen=True)
class ConeFilter:
    """Averages over the cells round each one, with weights that fall linearly to zero.

    Attributes
    ----------
    weights : csr_array (m, m)
        ``max(0, radius - distance)`` between the centres, times the volume of the column's cell.
    volumes : (m,) array, mm^3
    """

    weights: sp.csr_array
    volumes: FloatArray

    @classmethod
    def of_cells(cls, centres: FloatArray, volumes: FloatArray, radius: float) -> "ConeFilter":
        """Filter of cells with given centres (m, d), mm, and volumes (m,).

        The radius is above 0; below the distance of the centres, nothing is averaged.
        """
        m = len(centres)
        tree = cKDTree(centres)
        sample = centres[:: max(1, m // 100)]
        around = np.mean([len(neighbours) for neighbours in tree.query_ball_point(sample, radius)])
        if around * m > 1e8:
            raise InputError(
                f"filter radius {radius} mm reaches {around:.0f} cells round each of {m}: give a "
                "smaller one"
            )
        first, second = tree.query_pairs(radius, output_type="ndarray").T
        near = radius - np.linalg.norm(centres[first] - centres[second], axis=1)
        cells = np.arange(m)
        row, column = np.concatenate([first, second, cells]), np.concatenate([second, first, cells])
        weight = np.concatenate([near, near, np.full(m, radius)])
        matrix = sp.csr_array((weight * volumes[column], (row, column)), shape=(m, m))
        return cls(matrix, volumes)

    @cached_property
    def _total(self) -> FloatArray:
        return np.asarray(self.weights.sum(axis=1)).reshape(-1)

    def average(self, values: FloatArray) -> FloatArray:
        """Weighted mean (m, ...) of values (m, ...) round each cell."""
        total = self._total.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray(self.weights @ values) / total

    def transposed(self, gradient: FloatArray) -> FloatArray:
        """Gradient (m,) by the values, of the gradient by their averages: the chain rule."""
        return np.asarray(self.weights.T @ (gradient / self._total))

    def sensitivities(self, density: FloatArray, gradient: FloatArray) -> FloatArray:
        """Sigmund's filtered sensitivities (Struct. Multidisc. Optim. 21 (2001) 120, eq. 5).

        The gradient (m,) is that of the objective by the density (m,) of each cell.
        """
        mean = np.asarray(self.weights @ (density * gradient / self.volumes)) / self._total
        return self.volumes * mean / np.maximum(density, 1e-3)


# The parameters that SIMP and SOMP share.


@dataclass(frozen=True)
class Parameters:
    """What is optimised for, and when the iterations stop: see `Simp` for each of them."""

    volume_fraction: float
    penalty: float = 3.0
    radius: float = 2.5
    filter: Literal["sensitivity", "density"] = "sensitivity"
    minimum_stiffness: float = 1e-9
    move: float = 0.2
    tolerance: float = 0.01
    objective_tolerance: float = 1e-4
    max_iterations: int = 200
    backend: str = "auto"

    def __post_init__(self) -> None:
        check_fields(self, "volume_fraction", "minimum_stiffness", above=0.0, below=1.0)
        check_fields(self, "penalty", "max_iterations", at_least=1)
        check_fields(self, "radius", above=0.0, unit="mm")
        check_fields(self, "move", above=0.0, at_most=1.0)
        check_fields(self, "tolerance", "objective_tolerance", at_least=0.0)
        check_choices(self)


@dataclass(frozen=True)
class Parametrisation:
    """How variables become densities and stiffness, with the gradients back.

    Attributes
    ----------
    cells : CellGroups
        g groups of m cells; all that follows is by groups.
    solid, void : (g,) bool arrays
        Passive cells, whose density stays 1 or 0.
    """

    parameters: Parameters
    cells: CellGroups
    cone: ConeFilter
    solid: BoolArray
    void: BoolArray

    @classmethod
    def of_part(
        cls,
        parameters: Parameters,
        part: Compliance,
        solid: BoolArray | None,
        void: BoolArray | None,
    ) -> "Parametrisation":
        """Make the filter of a part, and check its passive cells, (m,) bool arrays or None.

        Raises
        ------
        InputError
            For cells that are both solid and void, a volume fraction that the passive cells make
            impossible, and a radius so large that it reaches too many cells.
        """
        cells = part.cells
        solid, void = _mask(cells, "solid", solid), _mask(cells, "void", void)
        if (solid & void).any():
            raise InputError("a cell cannot be both solid and void: correct the masks")
        total, share = float(part.volumes.sum()), parameters.volume_fraction
        filled, empty = (float(part.volumes[mask].sum()) / total for mask in (solid, void))
        if not filled < share < 1.0 - empty:
            raise InputError(
                f"volume fraction {share} cannot be met: solid cells fill {filled:.3g} and void "
                f"cells {empty:.3g} of the volume"
            )
        cone = ConeFilter.of_cells(part.centres, part.volumes, parameters.radius)
        return cls(parameters, cells, cone, solid, void)

    @cached_property
    def free(self) -> BoolArray:
        """Groups whose density is to be found, (g,)."""
        return ~(self.solid | self.void)

    def start(self, given: FloatArray | None) -> FloatArray:
        """Variables (g,) to begin with: given (m,), or uniform where they are free."""
        volumes = self.cone.volumes
        if given is not None:
            variables = np.array(self.cells.reduced("start", given), dtype=np.float64)
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
        """Densities (g,) of the variables (g,)."""
        filtered = self.parameters.filter == "density"
        density = self.cone.average(variables) if filtered else variables.copy()
        density[self.solid], density[self.void] = 1.0, 0.0
        return density

    def factor(self, density: FloatArray) -> FloatArray:
        """Factor (g,) on the stiffness of each group, by modified SIMP.

        ``least + density**penalty * (1 - least)`` with the minimum stiffness (Sigmund, Struct.
        Multidisc. Optim. 33 (2007) 401).
        """
        least = self.parameters.minimum_stiffness
        return least + density**self.parameters.penalty * (1.0 - least)

    def gradient(self, density: FloatArray, energy: FloatArray) -> FloatArray:
        """Differentiate the compliance by the variables, exactly: (g,) array.

        `energy` (g,), N mm, is ``u^T k u`` of each group at full density.
        """
        penalty, least = self.parameters.penalty, self.parameters.minimum_stiffness
        slope = penalty * density ** (penalty - 1.0) * (1.0 - least)
        return self._by_variables(-slope * energy)

    def volume_gradient(self) -> FloatArray:
        """Differentiate the volume by the variables: (g,) array, mm^3."""
        return self._by_variables(self.cone.volumes)

    def _by_variables(self, by_density: FloatArray) -> FloatArray:
        """Gradient (g,) by the variables from that by the densities: the chain rule."""
        by_free = np.where(self.free, by_density, 0.0)
        return self.cone.transposed(by_free) if self.parameters.filter == "density" else by_free

    def sensitivities(
        self, variables: FloatArray, density: FloatArray, energy: FloatArray
    ) -> FloatArray:
        """Gradient (g,) that the update takes: with the sensitivity filter, smoothed."""
        gradient = self.gradient(density, energy)
        if self.parameters.filter == "sensitivity":
            return self.cone.sensitivities(variables, gradient)
        return gradient


def _mask(cells: CellGroups, name: str, given: BoolArray | None) -> BoolArray:
    """Mask (g,) of the groups from one (m,) of the cells, or empty."""
    mask = np.zeros(len(cells.member), dtype=bool) if given is None else np.asarray(given)
    if mask.dtype != np.bool_:
        raise InputError(f"{name} must be a bool array; got {mask.dtype}: compare, as in x > 0")
    return cells.reduced(name, mask)
