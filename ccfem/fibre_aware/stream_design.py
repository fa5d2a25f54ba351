"""Design of a stream function: a scalar field whose isocurves make the part stiff.

The unknown is the field itself. Its gradient g says everything about the fibre laid along unit
levels: it runs across g, and there are |g| strands a mm, so that a layer of thickness h carries
``|g| / h`` mm of fibre in a mm^3. One solve gives the compliance of the part with that fibre in it
and the gradient of the compliance; L-BFGS does the rest.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.optimize import minimize
from scipy.sparse.linalg import splu

from ccfem.arrays import FloatArray, IntArray
from ccfem.fibre_aware.smeared import SmearedPart, SmearedSolution
from ccfem.fibre_aware.spline_grid import SplineGrid

__all__ = ["DENSEST", "Objective", "StreamDesign", "StreamProblem", "design"]

DENSEST = 0.975
"""Strands a width that should not be exceeded."""

_OVER_BUDGET = 20.0
_STEEP = 100.0
_ROUGH = 1e-3
"""Weights of the three penalties."""

_SMALLEST = 0.02
"""Strands a width below which |g| is rounded off, so that it has a gradient everywhere."""

_SLACK = 1e-3
"""Share of their stiffness that shortened fibres keep."""

_MEMORY = 20
"""Steps that L-BFGS remembers."""

_REACH = 1.0
"""Radius of the filter in squares of the grid."""

_TOLERANCE = 5e-3
"""Relative residual of the solves of a design. The error of the compliance is its square."""


@dataclass(frozen=True)
class Objective:
    """The objective at one field.

    Attributes
    ----------
    value : float
    gradient : (c,) array
        With respect to the coefficients of the fields.
    ratio : float
        Stiffness over that of the part without fibre.
    length : float, mm
        Of fibre.
    solution : SmearedSolution
    """

    value: float
    gradient: FloatArray
    ratio: float
    length: float
    solution: SmearedSolution


@dataclass(frozen=True)
class StreamProblem:
    """What a stream function is designed for.

    Minimised is ``-log(stiffness) + 20 max(length / budget - 1, 0)^2 + 100 mean(max(|g| - 0.975,
    0)^2) + 0.001 mean((Laplacian s)^2)``, g in strands a width, means over the part and over the
    coefficients.

    Attributes
    ----------
    part : SmearedPart
    grid : SplineGrid
        Of every field.
    group : (m,) int array
        Which field each cell follows; field k has the k-th block of ``len(grid)`` coefficients.
    centres : (m, 2) array, mm
        Where each cell samples its field: its centroid in the plane of the layers.
    capacity : (m,) array, 1/mm^2
        Fibre density at one strand a width, ``1 / (width * thickness)`` of the layers there.
    width : float, mm
        Of a strand.
    axial_stiffness : float, N
        EA of a strand.
    budget : float, mm
        Length of fibre in the whole part.
    """

    part: SmearedPart
    grid: SplineGrid
    group: IntArray
    centres: FloatArray
    capacity: FloatArray
    width: float
    axial_stiffness: float
    budget: float

    @cached_property
    def groups(self) -> int:
        """Number of fields."""
        return int(self.group.max()) + 1

    @cached_property
    def slopes(self) -> tuple[Any, Any]:
        """Matrices (m, c) from coefficients to the components of g, strands a width."""
        x, y = (self._of_group(matrix) for matrix in self.grid.slopes(self.centres))
        return self.width * x, self.width * y

    def _of_group(self, matrix: Any) -> Any:
        """Matrix that takes the row of each cell from the block of its group."""
        entries = matrix.tocoo()
        column = entries.col + len(self.grid) * self.group[entries.row]
        shape = (matrix.shape[0], self.groups * len(self.grid))
        return sp.csr_array((entries.data, (entries.row, column)), shape=shape)

    @cached_property
    def _transposed(self) -> tuple[Any, Any]:
        x, y = self.slopes
        return x.T.tocsr(), y.T.tocsr()

    @cached_property
    def laplacian(self) -> Any:
        """Graph Laplacian (c, c) of all fields."""
        return sp.block_diag(self.groups * [self.grid.laplacian], format="csr")

    @cached_property
    def room(self) -> FloatArray:
        """Fibre length (m,), mm, of each cell at one strand a width."""
        return self.part.mesh.volumes * self.capacity

    def evaluate(
        self, field: FloatArray, start: SmearedSolution | None = None, tolerance: float = 1e-5
    ) -> Objective:
        """Evaluate the objective and its gradient.

        Parameters
        ----------
        field : (c,) array
        start : SmearedSolution, optional
            Where the solve starts: the solution of a field like this one.
        tolerance : float
            Relative residual of the solve.
        """
        gx, gy = (slope @ field for slope in self.slopes)
        size = np.sqrt(gx * gx + gy * gy + _SMALLEST**2)
        solution, stretch = self._solve(gx, gy, size, start, tolerance)
        ratio = self.part.ratio(solution.work)
        share = np.where(stretch > 0.0, 1.0, _SLACK)
        e1, e2, e12 = solution.strain.T
        # Of -log(stiffness): fibre energy is stretch^2 / size^3 a cell.
        factor = -self.axial_stiffness * self.room * share * stretch / (solution.work * size**3)
        fall = 3.0 * stretch / size**2
        dx = factor * (2.0 * (2.0 * gx * e2 - gy * e12) - fall * gx)
        dy = factor * (2.0 * (2.0 * gy * e1 - gx * e12) - fall * gy)

        length = float(self.room @ (size - _SMALLEST))
        over = max(length / self.budget - 1.0, 0.0)
        excess = np.maximum(size - DENSEST, 0.0)
        mean = self.part.mesh.volumes / self.part.mesh.volumes.sum()
        bend = self.laplacian @ field
        value = -np.log(ratio) + _OVER_BUDGET * over**2 + _STEEP * float(mean @ excess**2)
        value += _ROUGH * float(bend @ bend) / len(field)
        push = 2.0 * (_OVER_BUDGET * over / self.budget * self.room + _STEEP * mean * excess)
        x, y = self._transposed
        gradient = x @ (dx + push * gx / size) + y @ (dy + push * gy / size)
        gradient += 2.0 * _ROUGH / len(field) * (self.laplacian @ bend)
        return Objective(float(value), gradient, ratio, length, solution)

    def _solve(
        self,
        gx: FloatArray,
        gy: FloatArray,
        size: FloatArray,
        start: SmearedSolution | None,
        tolerance: float,
    ) -> tuple[SmearedSolution, FloatArray]:
        """Equilibrium, and the strain along the fibre times |g|^2 of each cell."""
        along = np.stack([gy * gy, gx * gx, -gx * gy], axis=1)
        strength = self.axial_stiffness * self.capacity / size**3
        outer = strength[:, None, None] * along[:, :, None] * along[:, None, :]

        def stiffness(strain: FloatArray) -> FloatArray:
            stretched = np.einsum("ci,ci->c", along, strain) > 0.0
            return np.where(stretched, 1.0, _SLACK)[:, None, None] * outer

        solution = self.part.solve(stiffness, start, tolerance)
        return solution, np.einsum("ci,ci->c", along, solution.strain)


@dataclass(frozen=True)
class StreamDesign:
    """Designed fields.

    Attributes
    ----------
    field : (c,) array
        Coefficients; unit levels are paths.
    objective : Objective
        At that field.
    ratios : tuple of float
        Stiffness ratio at every evaluation.
    """

    field: FloatArray
    objective: Objective
    ratios: tuple[float, ...]


def design(problem: StreamProblem, start: FloatArray, evaluations: int = 50) -> StreamDesign:
    """Improve fields by L-BFGS on filtered coefficients.

    The unknowns x give the coefficients ``(1 + Laplacian)^-1 x``, the Laplacian in squares of the
    grid: steps are smooth, and what the cells do not feel stays as it is.

    Parameters
    ----------
    problem : StreamProblem
    start : (c,) array
    evaluations : int, default 50
        Maximum number of evaluations of the objective, one or a few solves each; at least 1.

    Returns
    -------
    StreamDesign
        The best of all evaluations.
    """
    smoother = (sp.eye_array(len(start)) + _REACH**2 * problem.laplacian).tocsc()
    factor = splu(smoother)
    tried: list[tuple[FloatArray, Objective]] = []
    ratios: list[float] = []

    def objective(x: FloatArray) -> tuple[float, FloatArray]:
        field = factor.solve(x)
        # The last solution is near to this one, the best one is to be returned.
        last = tried[-1][1].solution if tried else None
        found = problem.evaluate(field, last, _TOLERANCE)
        ratios.append(found.ratio)
        if len(tried) == 2:
            tried.pop() if tried[0][1].value <= tried[1][1].value else tried.pop(0)
        tried.append((field, found))
        return found.value, factor.solve(found.gradient)

    options = {"maxfun": evaluations, "maxiter": evaluations, "maxcor": _MEMORY, "ftol": 1e-9}
    minimize(objective, smoother @ start, jac=True, method="L-BFGS-B", options=options)
    field, found = min(tried, key=lambda one: one[1].value)
    return StreamDesign(field, found, tuple(ratios))
