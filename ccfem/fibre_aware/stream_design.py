"""Design of a stream function: a scalar field whose isocurves make the part stiff.

The unknown is the field itself. Its gradient g determines the fibre laid along its unit levels: the
fibre runs normal to g with |g| strands a mm, so that a layer of thickness h holds ``|g| / h`` mm of
fibre in a mm^3. One solve gives the compliance of the part with that fibre and its gradient; L-BFGS
minimises it.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray, IntArray
from ccfem.fibre_aware.border_levels import BorderLevels
from ccfem.fibre_aware.field_bends import FieldBends
from ccfem.fibre_aware.field_design import designed_fields
from ccfem.fibre_aware.smeared import SmearedPart, SmearedSolution
from ccfem.fibre_aware.spline_grid import SplineGrid

__all__ = [
    "DENSEST",
    "OVER_BUDGET",
    "SLACK",
    "Laid",
    "Objective",
    "StreamDesign",
    "StreamProblem",
    "design",
]

DENSEST = 0.975
"""Strands a width that should not be exceeded."""

OVER_BUDGET = 20.0
_STEEP = 100.0
_ROUGH = 1e-3
_BENDS = 1.0
"""Weights of the four penalties."""

_SMALLEST = 0.02
"""Strands a width below which |g| is rounded off, so that it is differentiable everywhere."""

SLACK = 1e-3
"""Share of their stiffness that fibres in compression keep."""

_SPREAD = 0.1
"""Share of the fibre's energy that the curvature of the objective assumes evenly over the part."""

_LEAST_ENERGY = 1e-6
"""Least energy of the fibre in that, as a share of all: a field may lay no stretched fibre."""

_BENT, _HELD = 0.02, 1e-6
"""Terms of the curvature against bends of the field and its constant, over its mean diagonal."""


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
class Laid:
    """The fibre that one field lays in the cells.

    Attributes
    ----------
    gx, gy : (m,) array
        Gradient of the field, strands a width.
    size : (m,) array
        Its size, rounded off at zero.
    along : (m, 3) array
        Maps strains 11, 22 and 12 in the plane to the strain along the fibre, times ``|g|^2``.
    outer : (m, 3, 3) array, MPa
        Stiffness of the fibre.
    """

    gx: FloatArray
    gy: FloatArray
    size: FloatArray
    along: FloatArray
    outer: FloatArray

    def stiffness(self, strain: FloatArray) -> FloatArray:
        """Stiffness (m, 3, 3), MPa, at strains (m, 3): next to none for fibre in compression."""
        stretched = np.einsum("ci,ci->c", self.along, strain) > 0.0
        return np.where(stretched, 1.0, SLACK)[:, None, None] * self.outer


@dataclass(frozen=True)
class StreamProblem:
    """Objective that a stream function is designed for.

    Minimised is ``-log(stiffness) + 20 max(length / budget - 1, 0)^2 + 100 mean(max(|g| - 0.975,
    0)^2) + 0.001 mean((Laplacian s)^2)``, g in strands a width, means over the part and over the
    coefficients. With a radius the cost of tighter bends (`FieldBends`) is added.

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
    radius : float, mm, default 0
        Levels that bend more tightly have a cost; 0 for none.
    """

    part: SmearedPart
    grid: SplineGrid
    group: IntArray
    centres: FloatArray
    capacity: FloatArray
    width: float
    axial_stiffness: float
    budget: float
    radius: float = 0.0

    @cached_property
    def groups(self) -> int:
        """Number of fields."""
        return int(self.group.max()) + 1

    @cached_property
    def slopes(self) -> tuple[Any, Any]:
        """Matrices (m, c) from coefficients to the components of g, strands a width."""
        x, y = (self.of_group(matrix, self.group) for matrix in self.grid.slopes(self.centres))
        return self.width * x, self.width * y

    def of_group(self, matrix: Any, group: IntArray) -> Any:
        """Matrix (n, k) that takes each row from the block of its group (n,)."""
        entries = matrix.tocoo()
        column = entries.col + len(self.grid) * group[entries.row]
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
    def bends(self) -> FieldBends | None:
        """Cost of bends, if there is one."""
        if not self.radius:
            return None
        found = (self.of_group(one, self.group) for one in self.grid.derivatives(self.centres))
        x, y, xx, xy, yy = (self.width * matrix for matrix in found)
        return FieldBends((x, y), (xx, xy, yy), self.room / self.budget, self.radius)

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
        laid = self.laid(field)
        solution = self.part.solve(laid.stiffness, start, tolerance)
        ratio = self.part.ratio(solution.work)
        length = self.length(laid)
        over = max(length / self.budget - 1.0, 0.0)
        value = -np.log(ratio) + OVER_BUDGET * over**2
        for penalty in self.penalties(field, laid):
            value += penalty
        gradient = self.gradient(field, laid, self.pull(laid, solution), over)
        return Objective(float(value), gradient, ratio, length, solution)

    def penalties(self, field: FloatArray, laid: Laid) -> tuple[float, float, float]:
        """Penalties of too dense fibre, of a rough field (c,), and of bends."""
        excess, rough = np.maximum(laid.size - DENSEST, 0.0), self.laplacian @ field
        bends = _BENDS * self.bends.cost(field) if self.bends else 0.0
        steep = _STEEP * float(self.mean @ excess**2)
        return steep, _ROUGH * float(rough @ rough) / len(rough), bends

    def gradient(
        self, field: FloatArray, laid: Laid, pull: tuple[FloatArray, FloatArray], over: float
    ) -> FloatArray:
        """Gradient (c,) by the coefficients, with penalties.

        Parameters
        ----------
        field : (c,) array
        laid : Laid
            Its fibre.
        pull : two (m,) arrays
            Derivatives of all terms but the penalties by the components of g.
        over : float
            Share of the budget by which the length exceeds it.
        """
        excess, rough = np.maximum(laid.size - DENSEST, 0.0), self.laplacian @ field
        push = 2.0 * (OVER_BUDGET * over / self.budget * self.room + _STEEP * self.mean * excess)
        x, y = self._transposed
        gradient = x @ (pull[0] + push * laid.gx / laid.size)
        gradient = gradient + y @ (pull[1] + push * laid.gy / laid.size)
        gradient += 2.0 * _ROUGH / len(rough) * (self.laplacian @ rough)
        if self.bends:
            gradient += _BENDS * self.bends.slope(field)
        return np.asarray(gradient)

    def curvature(self, field: FloatArray, solution: SmearedSolution) -> Any:
        """Positive definite matrix (c, c) that approximates the second derivative of the objective.

        The energy of stretched fibre is of degree one in the gradient of its field; rotating the
        gradient changes it by ``energy / |g|^2``. A tenth of the energy is assumed evenly over the
        part. Where strands are too dense, that penalty counts across them.
        """
        laid = self.laid(field)
        stretch = np.maximum(np.einsum("ci,ci->c", laid.along, solution.strain), 0.0)
        energy = self.axial_stiffness * self.room * stretch**2 / (laid.size**3 * solution.work)
        weight = energy / laid.size**2
        weight = weight + _SPREAD * max(float(weight.sum()), _LEAST_ENERGY) * self.mean
        dense = 2.0 * _STEEP * self.mean * (laid.size > DENSEST)
        x, y = self.slopes
        across = sp.diags_array(laid.gx / laid.size) @ x + sp.diags_array(laid.gy / laid.size) @ y
        even = (x.T * weight) @ x + (y.T * weight) @ y + (across.T * dense) @ across
        size, square = even.diagonal().mean(), self.laplacian.T @ self.laplacian
        return even + size * (_BENT * square + _HELD * sp.eye_array(len(field)))

    def levels(self, field: FloatArray, solution: SmearedSolution) -> BorderLevels:
        """Cost of levels of a field (c,) that lie farther from the border than they need to."""
        return BorderLevels.of(self, field, solution)

    def signed(self, field: FloatArray, group: int) -> FloatArray:
        """Coefficients (k,) of one group, with a sign that does not depend on the axes."""
        count = len(self.grid)
        field = field[group * count : (group + 1) * count]
        inside = self.group == group
        values = self.grid.values(self.centres[inside]) @ field
        weight = self.part.mesh.volumes[inside]
        values = values - weight @ values / weight.sum()
        return field if weight @ values**3 >= 0.0 else -field

    def length(self, laid: Laid) -> float:
        """Length of fibre, mm."""
        return float(self.room @ (laid.size - _SMALLEST))

    @cached_property
    def mean(self) -> FloatArray:
        """Share of each cell in the volume, (m,)."""
        return self.part.mesh.volumes / self.part.mesh.volumes.sum()

    def laid(self, field: FloatArray) -> Laid:
        """Fibre that a field (c,) lays."""
        gx, gy = (slope @ field for slope in self.slopes)
        size = np.sqrt(gx * gx + gy * gy + _SMALLEST**2)
        along = np.stack([gy * gy, gx * gx, -gx * gy], axis=1)
        strength = self.axial_stiffness * self.capacity / size**3
        return Laid(
            gx, gy, size, along, strength[:, None, None] * along[:, :, None] * along[:, None, :]
        )

    def pull(self, laid: Laid, solution: SmearedSolution) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives (m,) of -log(stiffness) by the components of g."""
        stretch = np.einsum("ci,ci->c", laid.along, solution.strain)
        share = np.where(stretch > 0.0, 1.0, SLACK)
        e1, e2, e12 = solution.strain.T
        gx, gy, size = laid.gx, laid.gy, laid.size
        # Fibre energy is stretch^2 / size^3 a cell.
        factor = -self.axial_stiffness * self.room * share * stretch / (solution.work * size**3)
        fall = 3.0 * stretch / size**2
        dx = factor * (2.0 * (2.0 * gx * e2 - gy * e12) - fall * gx)
        dy = factor * (2.0 * (2.0 * gy * e1 - gx * e12) - fall * gy)
        return dx, dy


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
    """Improve fields by `ccfem.fibre_aware.field_design.designed_fields`.

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
    return StreamDesign(*designed_fields(problem, start, evaluations))
