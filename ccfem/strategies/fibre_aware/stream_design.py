"""Design of stream functions: scalar fields whose isocurves make the part stiff.

The unknown is the field itself. Its gradient g determines the fibre laid along its unit levels: the
fibre runs normal to g with |g| strands a mm, so that a layer of thickness h holds ``|g| / h`` mm of
fibre in a mm^3. Each load case has a field in its share of the layers, spread evenly over the
height, so every cell contains fibre of all fields. One solve for each case gives the compliance of
the part with that fibre and its gradient; L-BFGS minimises the objective by all fields at once.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.strategies.fibre_aware.border_levels import BorderLevels
from ccfem.strategies.fibre_aware.field_descent import designed_fields
from ccfem.strategies.fibre_aware.smeared import UPPER, SmearedPart, SmearedSolution
from ccfem.strategies.fibre_aware.spline_grid import SplineGrid
from ccfem.strategies.fibre_aware.upper_bound import LEAST, SUM, WORST

# Cost of levels of a field that bend more tightly than fibre can follow.
#
# The curvature of a level is ``(g_y^2 s_xx - 2 g_x g_y s_xy + g_x^2 s_yy) / |g|^3``, g the gradient
# of the field s.


_FIELD_SMALLEST = 0.05
"""Strands a width below which |g| is rounded off: bends hardly count where little fibre lies."""


@dataclass(frozen=True)
class FieldBends:
    """Cost of bends that are tighter than a radius.

    The cost is the mean over the fibre of ``sqrt(1 + e^2) - 1``. Here e is the share by which the
    curvature exceeds that of the radius; for large e the cost is about e.

    Attributes
    ----------
    slopes : two sparse (m, c) arrays
        Map coefficients to the gradient in each cell, strands a width.
    seconds : three sparse (m, c) arrays
        Map coefficients to the second derivatives xx, xy and yy, strands a width per mm.
    fibre : (m,) array
        Length of fibre in each cell at one strand a width, as a share of that in all cells.
    radius : float, mm
    """

    slopes: tuple[Any, Any]
    seconds: tuple[Any, Any, Any]
    fibre: FloatArray
    radius: float

    def __post_init__(self) -> None:
        freeze(self, fibre=float)

    @cached_property
    def _transposed(self) -> tuple[Any, ...]:
        return tuple(matrix.T.tocsr() for matrix in (*self.slopes, *self.seconds))

    def cost(self, field: FloatArray) -> float:
        """Cost at coefficients (c,)."""
        _, size, _, excess = self._curvature(field)
        return float((self.fibre * size) @ (np.sqrt(1.0 + excess * excess) - 1.0))

    def slope(self, field: FloatArray) -> FloatArray:
        """Return the derivative (c,) of the cost by the coefficients."""
        (x, y, xx, xy, yy), size, curvature, excess = self._curvature(field)
        root = np.sqrt(1.0 + excess * excess)
        # Cost is fibre * size * (root - 1) a cell, curvature is bend / size^3.
        by_curvature = self.fibre * size * excess / root * self.radius * np.sign(curvature)
        by_bend = by_curvature / size**3
        by_size = self.fibre * (root - 1.0) - 3.0 * by_curvature * curvature / size
        by_x = by_size * x / size + by_bend * 2.0 * (x * yy - y * xy)
        by_y = by_size * y / size + by_bend * 2.0 * (y * xx - x * xy)
        parts = (by_x, by_y, by_bend * y * y, -2.0 * by_bend * x * y, by_bend * x * x)
        slope = sum(matrix @ part for matrix, part in zip(self._transposed, parts, strict=True))
        return np.asarray(slope)

    def _curvature(
        self, field: FloatArray
    ) -> tuple[tuple[FloatArray, ...], FloatArray, FloatArray, FloatArray]:
        """Find derivatives of the field, |g|, curvature of levels, and its excess: (m,) each."""
        derivatives = tuple(matrix @ field for matrix in (*self.slopes, *self.seconds))
        x, y, xx, xy, yy = derivatives
        size = np.sqrt(x * x + y * y + _FIELD_SMALLEST**2)
        curvature = (y * y * xx - 2.0 * x * y * xy + x * x * yy) / size**3
        return derivatives, size, curvature, np.maximum(self.radius * np.abs(curvature) - 1.0, 0.0)


DESIGN_POWERS = {WORST: 4.0, SUM: 1.0, LEAST: 4.0}
"""Power of ``bound / ratio`` in the sum over the cases, for each objective: lower than in tests,
where a design begins, since the worst case alone would lead it."""

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


_USUAL = 0.45 * (1.0 + 1e-9)
"""Coverage up to which fields are designed in one step."""

_FIRST = 0.5
"""Share of the room for fibre that is designed for first, with a tenth more as budget."""

_THEN = 0.6
"""Evaluations of the second step, over those of the first."""

Pull: TypeAlias = tuple[FloatArray, FloatArray]
"""Derivatives (m,) by the two components of a field's gradient in the cells."""


@dataclass(frozen=True)
class SmearedFibre:
    """The fibre that one field lays in the cells.

    Attributes
    ----------
    gx, gy : (m,) array
        Gradient of the field, strands a width.
    size : (m,) array
        Its size, rounded off at zero.
    along : (m, 3) array
        Maps strains 11, 22 and 12 in the plane to the strain along the fibre, times ``|g|^2``.
    upper : (m, 6) array, MPa
        Stiffness of the fibre: the upper triangle.
    """

    gx: FloatArray
    gy: FloatArray
    size: FloatArray
    along: FloatArray
    upper: FloatArray

    def stiffness(self, strain: FloatArray) -> FloatArray:
        """Stiffness (m, 6), MPa, at strains (m, 3): next to none for fibre in compression."""
        stretched = np.einsum("ci,ci->c", self.along, strain) > 0.0
        return np.where(stretched, 1.0, SLACK)[:, None] * self.upper


@dataclass(frozen=True)
class StreamModel:
    """The fibre that a stream function lays in a part if it is in all layers, and what it costs.

    The penalties are ``100 mean(max(|g| - 0.975, 0)^2) + 0.001 mean((Laplacian s)^2)``, g in
    strands a width, means over the part and over the coefficients. With a radius the cost of
    tighter bends (`FieldBends`) is added.

    Attributes
    ----------
    part : SmearedPart
        Under any of the load cases.
    grid : SplineGrid
        Of every field.
    group : (m,) int array
        Which field each cell follows; field k has the k-th block of ``len(grid)`` coefficients.
    centres : (m, 2) array, mm
        Where each cell samples its field: its centroid in the plane of the layers; (m, 3) in space
        for curved ones.
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
        slopes = self.part.axes.slopes(self.grid, self.centres)
        x, y = (self.of_group(matrix, self.group) for matrix in slopes)
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
        derivatives = (
            self.of_group(derivative, self.group)
            for derivative in self.grid.derivatives(self.centres)
        )
        x, y, xx, xy, yy = (self.width * matrix for matrix in derivatives)
        return FieldBends((x, y), (xx, xy, yy), self.room / self.budget, self.radius)

    @cached_property
    def room(self) -> FloatArray:
        """Fibre length (m,), mm, of each cell at one strand a width."""
        return self.part.mesh.volumes * self.capacity

    def penalties(self, field: FloatArray, smeared: SmearedFibre) -> tuple[float, float, float]:
        """Penalties of too dense fibre, of a rough field (c,), and of bends."""
        excess, rough = np.maximum(smeared.size - DENSEST, 0.0), self.laplacian @ field
        bends = _BENDS * self.bends.cost(field) if self.bends else 0.0
        steep = _STEEP * float(self.mean @ excess**2)
        return steep, _ROUGH * float(rough @ rough) / len(rough), bends

    def gradient(
        self, field: FloatArray, smeared: SmearedFibre, pull: Pull, over: float
    ) -> FloatArray:
        """Gradient (c,) by the coefficients, with penalties.

        Parameters
        ----------
        field : (c,) array
        smeared : SmearedFibre
            Its fibre.
        pull : two (m,) arrays
            Derivatives of all terms but the penalties by the components of g.
        over : float
            Share of the budget by which the length exceeds it.
        """
        excess, rough = np.maximum(smeared.size - DENSEST, 0.0), self.laplacian @ field
        push = 2.0 * (OVER_BUDGET * over / self.budget * self.room + _STEEP * self.mean * excess)
        x, y = self._transposed
        gradient = x @ (pull[0] + push * smeared.gx / smeared.size)
        gradient = gradient + y @ (pull[1] + push * smeared.gy / smeared.size)
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
        smeared = self.smeared(field)
        stretch = np.maximum(np.einsum("ci,ci->c", smeared.along, solution.strain), 0.0)
        energy = self.axial_stiffness * self.room * stretch**2 / (smeared.size**3 * solution.work)
        weight = energy / smeared.size**2
        weight = weight + _SPREAD * max(float(weight.sum()), _LEAST_ENERGY) * self.mean
        dense = 2.0 * _STEEP * self.mean * (smeared.size > DENSEST)
        x, y = self.slopes
        across = (
            sp.diags_array(smeared.gx / smeared.size) @ x
            + sp.diags_array(smeared.gy / smeared.size) @ y
        )
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

    def length(self, smeared: SmearedFibre) -> float:
        """Length of fibre, mm."""
        return float(self.room @ (smeared.size - _SMALLEST))

    @cached_property
    def mean(self) -> FloatArray:
        """Share of each cell in the volume, (m,)."""
        return self.part.mesh.volumes / self.part.mesh.volumes.sum()

    def smeared(self, field: FloatArray) -> SmearedFibre:
        """Fibre that a field (c,) lays."""
        gx, gy = (slope @ field for slope in self.slopes)
        size = np.sqrt(gx * gx + gy * gy + _SMALLEST**2)
        along = np.stack([gy * gy, gx * gx, -gx * gy], axis=1)
        strength = self.axial_stiffness * self.capacity / size**3
        upper, scaled = np.empty((len(along), 6)), strength[:, None] * along
        for k, (row, column) in enumerate(zip(*UPPER, strict=True)):
            np.multiply(scaled[:, row], along[:, column], out=upper[:, k])
        return SmearedFibre(gx, gy, size, along, upper)

    def pull(self, smeared: SmearedFibre, solution: SmearedSolution) -> Pull:
        """Return the derivatives (m,) of -log(stiffness) by the components of g."""
        stretch = np.einsum("ci,ci->c", smeared.along, solution.strain)
        share = np.where(stretch > 0.0, 1.0, SLACK)
        e1, e2, e12 = solution.strain.T
        gx, gy, size = smeared.gx, smeared.gy, smeared.size
        # Fibre energy is stretch^2 / size^3 a cell.
        factor = -self.axial_stiffness * self.room * share * stretch / (solution.work * size**3)
        fall = 3.0 * stretch / size**2
        dx = factor * (2.0 * (2.0 * gx * e2 - gy * e12) - fall * gx)
        dy = factor * (2.0 * (2.0 * gy * e1 - gx * e12) - fall * gy)
        return dx, dy


@dataclass(frozen=True)
class Objective:
    """The objective at some fields.

    Attributes
    ----------
    gradient : (n * c,) array
        With respect to the coefficients, field after field.
    ratio : (n,) array
        Stiffness of each case over that of the part without fibre.
    length : float, mm
        Of fibre.
    solution : tuple of SmearedSolution
        Of each case.
    """

    value: float
    gradient: FloatArray
    ratio: FloatArray
    length: float
    solution: tuple[SmearedSolution, ...]


@dataclass(frozen=True)
class StreamProblem:
    """What fields are designed for, one for each load case.

    Minimised is ``log(sum of w_i (bound_i / ratio_i)^p) / p + 20 max(length / budget - 1, 0)^2``
    plus the penalties of `StreamModel`, those of each field weighted by its share of the layers.

    Attributes
    ----------
    model : StreamModel
        Of each field alone.
    parts : tuple of SmearedPart
        One for each case.
    weights : (n,) array
        Of the cases; their sum is 1.
    bounds : (n,) array
        Stiffness ratio that each case is measured by
        (`ccfem.strategies.fibre_aware.upper_bound.measures`).
    shares : (n,) array
        Of the layers, of each field; their sum is 1.
    power : float, default 1
        The p above: the larger, the more the worst case counts.
    """

    model: StreamModel
    parts: tuple[SmearedPart, ...]
    weights: FloatArray
    bounds: FloatArray
    shares: FloatArray
    power: float = 1.0

    def __post_init__(self) -> None:
        freeze(self, weights=float, bounds=float, shares=float)

    @classmethod
    def alone(cls, model: StreamModel) -> "StreamProblem":
        """Problem of one load case, of one field in all layers."""
        unit = np.ones(1)
        return cls(model, (model.part,), unit, unit, unit)

    @cached_property
    def laplacian(self) -> Any:
        """Graph Laplacian of all fields."""
        return sp.block_diag(len(self.shares) * [self.model.laplacian], format="csr")

    def evaluate(
        self,
        field: FloatArray,
        start: tuple[SmearedSolution, ...] | None = None,
        tolerance: float = 1e-5,
    ) -> Objective:
        """Evaluate the objective and its gradient.

        Parameters
        ----------
        field : (n * c,) array
            Coefficients, field after field.
        start : tuple of SmearedSolution, optional
            Where the solves start.
        tolerance : float
            Relative residual of the solves.
        """
        smeared = self.smeared(field)
        solutions = self.solve(smeared, start, tolerance)
        value, counts = self.worth(self.ratios(solutions))
        return self.objective(
            field, smeared, solutions, value, self.pulls(smeared, solutions, counts)
        )

    def smeared(self, field: FloatArray) -> tuple[SmearedFibre, ...]:
        """Fibre that each field lays."""
        return tuple(
            self.model.smeared(coefficients) for coefficients in field.reshape(len(self.shares), -1)
        )

    def stiffness(self, smeared: Sequence[SmearedFibre], strain: FloatArray) -> FloatArray:
        """Stiffness (m, 6), MPa, of the fibre of all fields at strains (m, 3)."""
        stiffness = smeared[0].stiffness(strain)
        stiffness *= self.shares[0]
        for share, fibre in zip(self.shares[1:], smeared[1:], strict=True):
            stiffness += share * fibre.stiffness(strain)
        return stiffness

    def solve(
        self,
        smeared: Sequence[SmearedFibre],
        start: tuple[SmearedSolution, ...] | None = None,
        tolerance: float = 1e-5,
    ) -> tuple[SmearedSolution, ...]:
        """Solve each case; parameters as in `evaluate`."""
        starts = start if start is not None else (None,) * len(self.parts)
        return tuple(
            part.solve(lambda strain: self.stiffness(smeared, strain), begin, tolerance)
            for part, begin in zip(self.parts, starts, strict=True)
        )

    def prepared(
        self, field: FloatArray, solutions: Sequence[SmearedSolution] | None = None
    ) -> "StreamProblem":
        """Return the problem with parts that are prepared for the fibre of fields near to these.

        Parameters
        ----------
        field : (n * c,) array
        solutions : sequence of SmearedSolution, optional
            Of each case, as near to that of the fields as is known; default without fibre.
        """
        if solutions is None:
            solutions = [part.unreinforced for part in self.parts]
        smeared = self.smeared(field)
        parts = tuple(
            part.with_fibre(lambda strain: self.stiffness(smeared, strain), solution.strain)
            for part, solution in zip(self.parts, solutions, strict=True)
        )
        return replace(self, parts=parts)

    def ratios(self, solutions: Sequence[SmearedSolution]) -> FloatArray:
        """Stiffness (n,) of each case over that of the part without fibre."""
        ratios = [
            part.ratio(solution.work) for part, solution in zip(self.parts, solutions, strict=True)
        ]
        return np.array(ratios)

    def worth(self, ratios: FloatArray) -> tuple[float, FloatArray]:
        """Objective at stiffness ratios (n,) without penalties, and the weight of each case."""
        shares = ratios / self.bounds
        powers = self.weights * (shares.min() / shares) ** self.power
        value = np.log(powers.sum()) / self.power - np.log(shares.min())
        return float(value), powers / powers.sum()

    def pulls(
        self,
        smeared: Sequence[SmearedFibre],
        solutions: Sequence[SmearedSolution],
        counts: FloatArray,
    ) -> list[Pull]:
        """Derive -log(stiffness), the cases weighted (n,), by each field if in all layers."""
        pulls = []
        for fibre in smeared:
            x, y = zip(*(self.model.pull(fibre, solution) for solution in solutions), strict=True)
            pulls.append((counts @ np.stack(x), counts @ np.stack(y)))
        return pulls

    def objective(
        self,
        field: FloatArray,
        smeared: Sequence[SmearedFibre],
        solutions: tuple[SmearedSolution, ...],
        value: float,
        pulls: Sequence[Pull],
    ) -> Objective:
        """Objective from a value without penalties.

        Parameters
        ----------
        field : (n * c,) array
        smeared, solutions
            Fibre of the field, and the solution of each case with it.
        pulls : sequence of two (m,) arrays
            Derivatives of the value by the gradient of each field, if it were in all layers.
        """
        model, fields, shares = self.model, field.reshape(len(self.shares), -1), self.shares
        length = sum(
            share * model.length(fibre) for share, fibre in zip(shares, smeared, strict=True)
        )
        over = max(length / model.budget - 1.0, 0.0)
        value, gradient = value + OVER_BUDGET * over**2, []
        for share, fibre, coefficients, pull in zip(shares, smeared, fields, pulls, strict=True):
            for penalty in model.penalties(coefficients, fibre):
                value += share * penalty
            gradient.append(share * model.gradient(coefficients, fibre, pull, over))
        ratios = self.ratios(solutions)
        return Objective(float(value), np.concatenate(gradient), ratios, float(length), solutions)

    def _counts(self, solutions: Sequence[SmearedSolution]) -> FloatArray:
        """How much each case counts (n,)."""
        return self.worth(self.ratios(solutions))[1]

    def curvature(self, field: FloatArray, solutions: tuple[SmearedSolution, ...]) -> Any:
        """Matrix with a block for each field: mean over the cases of `StreamModel.curvature`."""
        counts, blocks = self._counts(solutions), []
        for share, values in zip(self.shares, field.reshape(len(self.shares), -1), strict=True):
            of_cases = [self.model.curvature(values, one) for one in solutions]
            mean = sum(count * one for count, one in zip(counts, of_cases, strict=True))
            blocks.append((share or 1.0) * mean)  # a field without layers changes nothing
        return sp.block_diag(blocks, format="csc")

    def levels(self, field: FloatArray, solutions: tuple[SmearedSolution, ...]) -> BorderLevels:
        """Cost, over all cases, of levels that lie farther from the border than they need to."""
        counts, levels = self._counts(solutions), []
        for share, values in zip(self.shares, field.reshape(len(self.shares), -1), strict=True):
            of_cases = [self.model.levels(values, one) for one in solutions]
            weight = share * (counts @ np.stack([one.weight for one in of_cases]))
            levels.append(replace(of_cases[0], weight=weight))
        return BorderLevels.side_by_side(levels)


@dataclass(frozen=True)
class StreamDesign:
    """Designed fields.

    Attributes
    ----------
    fields : (n, c) array
        Coefficients of each field; unit levels are paths.
    objective : Objective
        At these fields.
    ratios : tuple of (n,) arrays
        Stiffness ratios of the cases at every evaluation.
    """

    fields: FloatArray
    objective: Objective
    ratios: tuple[FloatArray, ...]


def design(problem: StreamProblem, start: FloatArray, evaluations: int = 50) -> StreamDesign:
    """Improve fields by `ccfem.strategies.fibre_aware.field_descent.designed_fields`.

    The unknowns are scaled with the curvature of all cases. The levels of each field are drawn to
    the borders that any case stretches along it.

    Parameters
    ----------
    start : (n * c,) array
    evaluations : int, default 50
        Maximum number of evaluations of the objective, one or a few solves of each case; at least
        1.

    Returns
    -------
    StreamDesign
        The best of all evaluations.
    """
    field, objective, ratios = designed_fields(problem, start, evaluations)
    return StreamDesign(field.reshape(len(problem.shares), -1), objective, ratios)


def in_two_steps(problem: StreamProblem, coverage: float) -> bool:
    """Whether `designed_in_steps` takes two; parameters as there."""
    one_case, much = len(problem.parts) == 1, coverage > _USUAL
    return one_case and much and problem.model.budget > _first_budget(problem)


def _first_budget(problem: StreamProblem) -> float:
    return _FIRST * float(problem.model.room.sum())


def first_step(
    problem: StreamProblem, start: Callable[[StreamProblem], FloatArray], evaluations: int
) -> StreamDesign:
    """Design for half of the room, whatever the budget of the problem.

    Designs of one part for several amounts share this step. Parameters as in `designed_in_steps`.
    """
    less = replace(problem, model=replace(problem.model, budget=_first_budget(problem)))
    return design(less, start(less), evaluations)


def designed_in_steps(
    problem: StreamProblem,
    start: Callable[[StreamProblem], FloatArray],
    evaluations: int,
    coverage: float,
    first: StreamDesign | None = None,
) -> StreamDesign:
    """Design fields for half of the room first, and for much fibre from there.

    A field that starts at high density has strands everywhere, even where nothing is stretched.
    They block each other: no small change of the field turns them or thins them out, and the result
    is softer than a design for less fibre. Once that design has converged there is room for the
    rest. Fields of several load cases do not gain by this, and are designed in one step.

    Parameters
    ----------
    start : callable
        Coefficients (n * c,) of the first fields for a problem.
    evaluations : int
        Largest number of evaluations of the objective in the first step. A second step has 0.6
        times as many.
    coverage : float
        Share of the layers to be covered. The budget is larger, since some fibre is cut off later.
    first : StreamDesign, optional
        The first step, if it is known (`first_step`).
    """
    if not in_two_steps(problem, coverage):
        return design(problem, start(problem), evaluations)
    first = first_step(problem, start, evaluations) if first is None else first
    design_of = design(problem, first.fields.ravel(), int(np.ceil(_THEN * evaluations)))
    return replace(design_of, ratios=first.ratios + design_of.ratios)
