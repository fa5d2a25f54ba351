"""The stiffness that no fibre paths can exceed under several load cases at once.

As `ccfem.fibre_aware.upper_bound`, for the compliances C_i of n cases with factors v_i. For any
displacements u_i,

    sum v_i C_i >= (sum v_i f_i.u_i)^2 / (sum v_i u_i.K u_i + EA S),

where S is the largest sum that fibre of that length can collect: cells are filled in the order of
``max_t sum v_i max(t.eps_i t, 0)^2``, largest first, until the length is used up. Several strains
have no common principal direction, so 360 angles are tried, with a margin for those in between. A
case in which supports move instead of forces has a compliance too: see `SmearedPart.pull`.

Each case counts by C_i over the least compliance that any paths can reach in it alone, or over the
compliance of the part without fibre. The sharpest bound on the largest of these ratios is found by
increasing the factors of the worst cases. The bound holds for any factors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from ccfem.arrays import FloatArray, freeze, in_brief
from ccfem.checks import check_known, check_number
from ccfem.elasticity.weighted_cases import WeightedCases
from ccfem.fibre_aware.density_ascent import DensityAscent
from ccfem.fibre_aware.heights import fibre_capacity
from ccfem.fibre_aware.smeared import SmearedPart, SmearedSolution, smeared_cases
from ccfem.fibre_aware.upper_bound import LOOSE, affordable_iterations, directions, upper_bound
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.virtual_testing.strand import Strand

__all__ = [
    "LEAST",
    "OBJECTIVES",
    "SUM",
    "WORST",
    "CasesBound",
    "cases_bound",
    "cases_certificate",
    "largest_gathered",
    "measures",
    "objective_value",
    "single_bounds",
]

WORST, SUM, LEAST = OBJECTIVES = ("worst", "sum", "least")
"""What is minimised: the largest of ``bound_i / ratio_i``, their weighted mean, or the largest of
``1 / ratio_i``, so that the least ratio is made large."""

_SINGLE_ITERATIONS = 30
"""Most iterations for the bound of each case alone."""
_ANGLES = 24
_CERTIFIED_ANGLES = 360
_FULL_STEPS = 10
"""Iterations after which the steps of the factors shrink."""


@dataclass(frozen=True)
class CasesBound:
    """How stiff a part can get under several load cases with fibre of some length.

    Attributes
    ----------
    objective : str
        "worst": the largest of ``singles / ratios``; "sum": their weighted mean; "least": the
        largest of ``1 / ratios``.
    singles : (n,) array
        For each case alone the stiffness ratio that no paths exceed; 1 with "least".
    case_weights : (n,) array
        Weights of the cases; their sum is 1.
    least : float
        Certified: no paths can bring the objective below this.
    reached : float
        Objective of the best density found. The sharpest bound lies between `least` and this.
    factors : (n,) array
        Factors of the cases in the certificate; their sum is 1.
    """

    objective: str
    singles: FloatArray
    case_weights: FloatArray
    least: float
    reached: float
    factors: FloatArray

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, singles=float, case_weights=float, factors=float)

    @property
    def duality_gap(self) -> float:
        """Share by which `reached` lies above what is certified."""
        return self.reached / self.least - 1.0

    def value(self, ratios: ArrayLike) -> float:
        """Objective of a design with these stiffness ratios (n,)."""
        return objective_value(self.singles / np.asarray(ratios), self.case_weights, self.objective)

    def gap(self, ratios: ArrayLike) -> float:
        """How far the objective of a design lies above what is certified; 0 is the best."""
        return self.value(ratios) / self.least - 1.0

    def shares(self, ratios: ArrayLike) -> FloatArray:
        """Stiffness ratio of each case over its own bound."""
        return np.asarray(ratios) / self.singles


def objective_value(terms: FloatArray, weights: FloatArray, objective: str) -> float:
    """Largest of the terms of the cases, or their weighted mean."""
    return float(weights @ terms) if objective == SUM else float(terms.max())


def cases_bound(
    cases: WeightedCases,
    layers: Sequence[Layer],
    length: float,
    machine: Machine,
    strand: Strand | None = None,
    objective: str = WORST,
    iterations: int | None = None,
    gap: float = LOOSE,
) -> CasesBound:
    """Bound the stiffness of a part with fibre under several load cases, in tension only.

    Parameters
    ----------
    cases : WeightedCases
    layers : sequence of Layer
        All flat layers of the part; each carries at most one strand a width.
    length : float, mm
        Total length of fibre.
    machine : Machine
        Its strand width.
    strand : Strand, optional
        Stiffness of a strand; default rho = EA/E = 4 mm^2.
    objective : {"worst", "sum", "least"}
    iterations : int, optional
        Maximum number of iterations, with one solve for each case; at least 1. Default as in
        `upper_bound`.
    gap : float, default 0.01
        Iterations stop where `reached` lies no farther than this share above the bound.

    Raises
    ------
    InputError
        As `upper_bound`, and for an unknown objective.
    """
    check_known("objective", objective, OBJECTIVES)
    if iterations is None:
        iterations = affordable_iterations(len(cases.mesh.cells))
    check_number("iterations", iterations, at_least=1)
    check_number("number of layers", len(layers), at_least=1)
    parts = smeared_cases(cases.fields, layers[0].plane.frame)
    singles = measures(objective, cases, layers, length, machine, strand, _SINGLE_ITERATIONS)
    axial = (Strand() if strand is None else strand).stiffness(parts[0].modulus)
    most = fibre_capacity(parts[0], layers, machine)
    volume = parts[0].mesh.volumes
    length = min(length, float(volume @ most))
    scale = singles / np.array([part.unreinforced.work for part in parts])

    _, along = directions(_ANGLES)
    outer = (along[:, :, None] * along[:, None, :]).reshape(_ANGLES, 9)
    ascent = DensityAscent.even(volume, most, length, _ANGLES)
    solutions: list[SmearedSolution | None] = [None] * len(cases)
    factors, best = cases.weights, cases.weights
    reached, bounds = np.inf, [0.0]
    for k in range(iterations):

        def fibre(strain: FloatArray, density: FloatArray = ascent.density) -> FloatArray:
            carried = np.where(strain @ along.T > 0.0, density, 0.0)
            return axial * (carried @ outer).reshape(-1, 3, 3)

        found = [
            part.solve(fibre, start, 1e-3) for part, start in zip(parts, solutions, strict=True)
        ]
        solutions = list(found)
        compliances = [part.compliance(one.work) for part, one in zip(parts, found, strict=True)]
        terms = scale * np.array(compliances)
        reached = min(reached, objective_value(terms, cases.weights, objective))
        bounds.append(cases_certificate(parts, found, factors * scale, axial, most, length))
        if bounds[-1] >= max(bounds):
            best = factors
        if reached <= (1.0 + gap) * max(bounds):
            break
        merit = -float(factors @ terms)
        if objective != SUM:
            factors = factors * (terms / terms.max()) ** min(1.0, _FULL_STEPS / (k + 1))
            factors = factors / factors.sum()
        stretch = np.sqrt(
            sum(
                v * (part.pull(one)[0] * np.maximum(one.strain @ along.T, 0.0)) ** 2
                for v, part, one in zip(factors * scale, parts, found, strict=True)
            )
        )
        ascent = ascent.step(stretch, merit)
    return CasesBound(objective, singles, cases.weights, max(bounds), reached, best)


def measures(
    objective: str,
    cases: WeightedCases,
    layers: Sequence[Layer],
    length: float,
    machine: Machine,
    strand: Strand | None = None,
    iterations: int = 7,
) -> FloatArray:
    """Stiffness ratio (n,) that each case is measured by: its own bound, or 1 with "least"."""
    if objective == LEAST:
        return np.ones(len(cases))
    return single_bounds(cases, layers, length, machine, strand, iterations)


def single_bounds(
    cases: WeightedCases,
    layers: Sequence[Layer],
    length: float,
    machine: Machine,
    strand: Strand | None = None,
    iterations: int = 7,
) -> FloatArray:
    """Stiffness ratio (n,) that no paths exceed in each case alone; parameters as `upper_bound`."""
    smeared_cases(cases.fields, layers[0].plane.frame)  # one factorisation for all
    found = (
        upper_bound(field, layers, length, machine, strand, iterations=iterations)
        for field in cases.fields
    )
    return np.array([one.ratio for one in found])


def cases_certificate(
    parts: Sequence[SmearedPart],
    solutions: Sequence[SmearedSolution],
    factors: FloatArray,
    axial_stiffness: float,
    most: FloatArray,
    length: float,
) -> float:
    """Lower bound of ``sum of factor * compliance``, N mm, from any displacements.

    Parameters
    ----------
    parts : sequence of SmearedPart
        One for each case.
    solutions : sequence of SmearedSolution
        Any displacements that respect the supports, with their strains in the plane; where
        supports move also the work.
    factors : (n,) array
        Not negative.
    axial_stiffness : float, N
        EA of a strand.
    most : (m,) array, mm/mm^3
        Largest density of fibre in each cell.
    length : float, mm
        Of fibre.
    """
    pulls = [part.pull(one) for part, one in zip(parts, solutions, strict=True)]
    strains = np.stack([s * one.strain for (s, _), one in zip(pulls, solutions, strict=True)])
    square = largest_gathered(strains, np.asarray(factors, dtype=np.float64))
    order = np.argsort(-square, kind="stable")
    room = (parts[0].mesh.volumes * most)[order]
    used = np.minimum(room, np.maximum(length - (np.cumsum(room) - room), 0.0))
    energy, work = axial_stiffness * float(used @ square[order]), 0.0
    for factor, part, one, (s, own) in zip(factors, parts, solutions, pulls, strict=True):
        u = s * one.displacement.reshape(-1)
        energy += factor * float(u @ (part.specimen.matrix @ u))
        work += factor * own
    return work**2 / energy


def largest_gathered(strains: FloatArray, factors: FloatArray) -> FloatArray:
    """Bound ``max over t of sum of factor * max(t.eps t, 0)^2`` from above in each cell, (m,).

    At its maximum the sum has slope zero. Between two angles that are tried it therefore exceeds
    the larger value by at most half its largest curvature times the square of half their distance.

    Parameters
    ----------
    strains : (n, m, 3) array
        Strains 11, 22 and 12 (engineering shear) in the plane, of each case.
    factors : (n,) array
        Not negative.
    """
    _, along = directions(_CERTIFIED_ANGLES)
    half = 0.5 * np.pi / _CERTIFIED_ANGLES
    result = np.empty(strains.shape[1])
    _gathered(np.ascontiguousarray(strains), factors, along, 0.5 * half**2, result)
    return result


# The strain along t is a + b cos(2 angle - phase): its square bends down by at most 8 b (a + b).
@njit(cache=True)
def _gathered(strains, factors, along, margin, result):  # type: ignore[no-untyped-def]  # pragma: no cover
    for c in range(strains.shape[1]):
        bend = 0.0
        for i in range(len(factors)):
            e1, e2, e12 = strains[i, c, 0], strains[i, c, 1], strains[i, c, 2]
            b = 0.5 * ((e1 - e2) ** 2 + e12 * e12) ** 0.5
            bend += factors[i] * 8.0 * b * max(0.5 * (e1 + e2) + b, 0.0)
        largest = 0.0
        for k in range(len(along)):
            total = 0.0
            for i in range(len(factors)):
                e = strains[i, c, 0] * along[k, 0] + strains[i, c, 1] * along[k, 1]
                e += strains[i, c, 2] * along[k, 2]
                if e > 0.0:
                    total += factors[i] * e * e
            largest = max(largest, total)
        result[c] = largest + margin * bend
