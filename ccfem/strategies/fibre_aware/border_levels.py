"""Cost that draws the levels of a field to stretched borders, as near as whole strands can lie.

Strands keep half a width off the border. If the first strand lies farther away, the strip in
between, up to a width wide, has no fibre, although the stress is highest along the border. Fields
designed without this cost leave half a width open on average.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.strategies.fibre_aware.smeared import SmearedPart, SmearedSolution
from ccfem.strategies.fibre_aware.spline_grid import SplineGrid

_UPRIGHT = 0.1
"""Largest cosine of a wall's normal to that of the layers at which it counts as upright."""

_DEPTH = 0.53
"""Distance, in widths, of the first strand from the border, with a margin against rounding."""

_OBLIQUE = float(np.tan(np.radians(20.0)))
"""Slope of strands to the border above which none of them counts as the first one."""

_CONSTANTS = 40
"""Number of constants added to a field that are tried."""

_SHARE = 0.5
"""Cost of an empty strip, as a share of the work of the fibre that it could hold."""


class _Posed(Protocol):
    """The parts of `ccfem.strategies.fibre_aware.stream_design.StreamModel` that are used here."""

    @property
    def part(self) -> SmearedPart: ...
    @property
    def grid(self) -> SplineGrid: ...
    @property
    def group(self) -> IntArray: ...
    @property
    def groups(self) -> int: ...
    @property
    def capacity(self) -> FloatArray: ...
    @property
    def width(self) -> float: ...
    @property
    def axial_stiffness(self) -> float: ...
    def of_group(self, matrix: Any, group: IntArray) -> Any: ...


@dataclass(frozen=True)
class BorderLevels:
    """Cost of fields without a whole number half a width inside stretched borders.

    The cost is ``sum of weight * sin^2(pi s)`` over places half a width inside upright walls. The
    weight is half of the share in the compliance that fibre on a strip a width wide would have; it
    falls to zero where strands meet the border at 20 degrees.

    Attributes
    ----------
    values : sparse (b, c) array
        From coefficients to the field s there.
    weight : (b,) array
    blocks : (c, groups) array
        Coefficients of a constant on each group of layers.
    """

    values: Any
    weight: FloatArray
    blocks: FloatArray

    def __post_init__(self) -> None:
        freeze(self, weight=float, blocks=float)

    @classmethod
    def of(cls, problem: _Posed, field: FloatArray, solution: SmearedSolution) -> "BorderLevels":
        """Weights for a field (c,) and its solution."""
        part, grid, mesh = problem.part, problem.grid, problem.part.mesh
        area, normal = mesh.facet_areas(mesh.boundary)
        axes, cell = part.axes, mesh.boundary_cells
        upright = np.flatnonzero(np.abs(axes.across(normal, cell)) < _UPRIGHT)
        cell = cell[upright]
        inward = axes.along(-normal[upright], cell)
        inward = inward / np.linalg.norm(inward, axis=1)[:, None]
        at = axes.places(mesh.points[mesh.boundary[upright]].mean(axis=1))
        at = axes.moved(at, _DEPTH * problem.width * inward, cell)
        kept = grid.covers(at)
        at, inward, upright, cell = at[kept], inward[kept], upright[kept], cell[kept]
        slopes = axes.slopes(grid, at, cell)
        gx, gy = (problem.of_group(matrix, problem.group[cell]) for matrix in slopes)
        (a, b), (x, y) = inward.T, (gx @ field, gy @ field)
        across, along = np.abs(a * x + b * y), np.abs(a * y - b * x)
        e1, e2, e12 = solution.strain[cell].T
        stretch = np.maximum(e1 * b * b + e2 * a * a - e12 * a * b, 0.0)
        oblique = np.minimum(along / np.maximum(_OBLIQUE * across, 1e-300), 1.0)
        length = area[upright] * problem.width * problem.capacity[cell]
        work = problem.axial_stiffness * length * stretch**2 / solution.work
        weight = _SHARE * work * (1.0 - oblique**2)
        values = problem.of_group(grid.values(at), problem.group[cell])
        ones = np.ones((len(grid), 1))
        blocks = sp.block_diag(problem.groups * [ones]).toarray()
        return cls(values, weight, blocks)

    @classmethod
    def side_by_side(cls, levels: Sequence["BorderLevels"]) -> "BorderLevels":
        """Combine several fields, one after the other; their costs add up."""
        values = sp.block_diag([level.values for level in levels], format="csr")
        weight = np.concatenate([level.weight for level in levels])
        return cls(values, weight, sp.block_diag([level.blocks for level in levels]).toarray())

    def cost(self, field: FloatArray) -> tuple[float, FloatArray]:
        """Cost, and its derivative (c,) by the coefficients."""
        angle = np.pi * (self.values @ field)
        slope = np.pi * self.weight * np.sin(2.0 * angle)
        return float(self.weight @ np.sin(angle) ** 2), np.asarray(self.values.T @ slope)

    def curvature(self) -> Any:
        """Half of the second derivative (c, c) of the cost at its minimum."""
        return np.pi**2 * (self.values.T * self.weight) @ self.values

    def lifted(self, field: FloatArray) -> FloatArray:
        """Field (c,) plus the constant on each group that makes the cost least."""
        for block in self.blocks.T:
            tried = [field + k / _CONSTANTS * block for k in range(_CONSTANTS)]
            field = tried[int(np.argmin([self.cost(trial)[0] for trial in tried]))]
        return field
