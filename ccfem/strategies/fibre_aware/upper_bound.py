"""The stiffness that no fibre paths can exceed, for a given length of fibre and number of layers.

Paths are replaced by a density of fibre m in each cell and direction in the plane of the layers. It
may jump from cell to cell and cross itself, with at most one strand a width on each flat layer that
cuts a cell. A search approaches the best density, until what it reaches and the bound are close.
Any displacements u_i prove a bound by duality. The compliance C_i of a part with fibre under load
case i is the largest value over all u of ``2 f_i.u - u.K u - EA int m (t.eps t)^2``, so for any
factors v_i, with the best scale,

    sum v_i C_i >= (sum v_i f_i.u_i)^2 / (sum v_i u_i.K u_i + EA S),

where S is the largest sum that fibre of that length can collect: cells are filled in the order of
``max_t sum v_i max(t.eps_i t, 0)^2``, largest first, until the length is used up. One strain has
principal directions. Several have none in common, so 360 angles are tried, with a margin for those
in between. A case in which supports move instead of forces has a compliance too: see
`SmearedPart.pull`.

On curved layers a cell holds fibre along the layer nearest to its middle. The bound then is as
exact as layers are flat within a cell.

Each of several cases counts by C_i over the least compliance that any paths can reach in it alone,
or over the compliance of the part without fibre. The sharpest bound on the largest of these ratios
is found by increasing the factors of the worst cases. The bound holds for any factors.

The search: the compliances are convex in the densities, and their derivative is proportional to the
squared strain along each direction. The optimality criterion multiplies each density by a power of
the strain (mirror ascent) and then scales all densities so that the length is met. Each step
continues the last one, as in Nesterov's method; this momentum restarts where the part gets softer.
Without it hundreds of solves would be needed. The bound is taken from the last displacements and
from the mean of all, later ones counting more: densities and displacements play a game of opposite
aims, in which means come to rest sooner than what is played last (Nesterov, Math. Program. 120,
2009, 221-259).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray, freeze, in_brief
from ccfem.base.checks import check_known, check_number
from ccfem.base.compiled import compiled
from ccfem.base.tensor import largest_in_plane
from ccfem.fem.elasticity import StressField
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.judging.virtual_testing import Strand
from ccfem.judging.virtual_testing.equilibrium import BONDED, TENSION
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.heights import room_for_fibre
from ccfem.strategies.fibre_aware.layer_axes import frames_in_cells
from ccfem.strategies.fibre_aware.smeared import Fibre, SmearedPart, SmearedSolution, smeared_cases

WORST, SUM, LEAST = OBJECTIVES = ("worst", "sum", "least")
"""What is minimised: the largest of ``bound_i / ratio_i``, their weighted mean, or the largest of
``1 / ratio_i``, so that the least ratio is made large."""

LARGEST_GAP = 0.005
"""Share by which the best density may fall short of the bound: the iterations stop there."""

LOOSE = 0.01
"""The same for several cases; and the share above which a remark is made."""

_SINGLE_ITERATIONS = 30
"""Most iterations for the bound of each of several cases alone."""

_MEASURED = 7
"""Iterations for a bound that only measures what a case has reached."""

_ANGLES = 24
_CERTIFIED_ANGLES = 360
_CELL_ITERATIONS = 1_500_000

_PREPARED = 0, 3
"""Iterations before which solves are prepared for the density then: it changes less and less."""

_FULL_STEPS = 10
"""Iterations after which the steps of the factors shrink."""

_EXPONENT = 1.4
"""Exponent of the strain in the optimality criterion. 1 is exact where the stress in the fibre is
given; where its strain is given, larger ones converge faster. From 2 on densities oscillate."""

_MOST_MOMENTUM = 0.9

_TRACE = 1e-9
"""Least density in each direction as a share of the largest: a density of 0 would stay 0."""


@dataclass(frozen=True)
class UpperBound:
    """How stiff a part can get with fibre of some length, under one or several load cases.

    The bound holds if strands keep their width on average in every cell.

    Attributes
    ----------
    objective : {"worst", "sum", "least"}
        What is bounded: the largest of ``singles / ratios``, their weighted mean, or the largest of
        ``1 / ratios``. These are the same for one case.
    singles : (n,) array
        For each case alone the stiffness ratio that no paths exceed; 1 with "least".
    case_weights : (n,) array
        Weights of the cases; their sum is 1.
    least : float
        Certified: no paths can bring the objective below this.
    attained : float
        Objective of the best density found. The sharpest bound lies between `least` and this.
    factors : (n,) array
        Factors of the cases in the certificate; their sum is 1.
    density : (m, k) array, mm/mm^3
        The best density found, in each cell and direction.
    angles : (k,) array, radians
        Directions, from the first axis of the layers' frame.
    iterations : int
        Of the search.
    """

    objective: str
    singles: FloatArray
    case_weights: FloatArray
    least: float
    attained: float
    factors: FloatArray
    density: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    angles: FloatArray = field(default_factory=lambda: np.zeros(0))
    iterations: int = 0

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, singles=float, case_weights=float, factors=float, density=float, angles=float)

    @property
    def ratio(self) -> float:
        """Least stiffness ratio of all cases that no paths exceed; sharp for one, or "least"."""
        return float(self.singles.max()) / self.least

    @property
    def reached(self) -> float:
        """The same ratio of the best density found, for one case or with the objective "least"."""
        return float(self.singles.max()) / self.attained

    @property
    def duality_gap(self) -> float:
        """Share by which `attained` lies above what is certified."""
        return self.attained / self.least - 1.0

    @property
    def tensor(self) -> FloatArray:
        """Sum of ``m t t^T`` over the directions: 11, 22 and 12 in the plane, (m, 3), mm/mm^3.

        Its trace is the density in all directions. Most of the fibre runs along its principal
        direction of largest value.
        """
        return self.density @ directions(len(self.angles))[1]

    def share(self, ratio: float) -> float:
        """Share of the possible gain that a design reaches with this least stiffness ratio."""
        return (ratio - 1.0) / (self.ratio - 1.0)

    def value(self, ratios: ArrayLike) -> float:
        """Objective of a design with these stiffness ratios (n,)."""
        return _objective(self.singles / np.asarray(ratios), self.case_weights, self.objective)

    def gap(self, ratios: ArrayLike) -> float:
        """How far the objective of a design lies above what is certified; 0 is the best."""
        return self.value(ratios) / self.least - 1.0

    def shares(self, ratios: ArrayLike) -> FloatArray:
        """Stiffness ratio of each case over its own bound."""
        return np.asarray(ratios) / self.singles


def _objective(terms: FloatArray, weights: FloatArray, objective: str) -> float:
    """Largest of the terms of the cases, or their weighted mean."""
    return float(weights @ terms) if objective == SUM else float(terms.max())


def upper_bound(
    stress: StressField | WeightedCases,
    layers: Sequence[Layer],
    length: float,
    machine: Machine,
    strand: Strand | None = None,
    mode: str = TENSION,
    iterations: int | None = None,
    gap: float | None = None,
    objective: str = WORST,
    start: FloatArray | None = None,
) -> UpperBound:
    """Bound the stiffness of a part with fibre under one or several load cases.

    Parameters
    ----------
    stress : StressField or WeightedCases
        The part without fibre, under the load that counts, or under several.
    layers : sequence of Layer
        All layers of the part; each carries at most one strand a width.
    length : float, mm
        Total length of fibre.
    machine : Machine
        Its strand width.
    strand : Strand, optional
        Stiffness of a strand; default rho = EA/E = 4 mm^2.
    mode : str, default "tension"
        "tension": fibres in compression carry nothing; "bonded": all fibres carry.
    iterations : int, optional
        Maximum number of iterations, with one solve for each case; at least 1. About 10 bring the
        bound within 1 % of the sharpest, 15 to 40 reach the default gap. Default 60, and fewer for
        more than 25,000 cells: `affordable_iterations`.
    gap : float, optional
        Iterations stop where the best density falls short of the bound by no more than this share.
        Default 0.005 for one case, 0.01 for several.
    objective : {"worst", "sum", "least"}
        How several cases count.
    start : (m, k) array, optional
        Densities to start from, up to a factor, as those found for other lengths (`UpperBound`): a
        mean of the best for a shorter and for a longer one is often close enough by itself, since
        the compliance is convex in the densities. Default: even ones.
    """
    cases = WeightedCases.of(stress)
    check_number("length of fibre", length, above=0.0, unit="mm")
    check_number("number of layers", len(layers), at_least=1)
    if iterations is None:
        iterations = affordable_iterations(len(cases.mesh.cells))
    if gap is None:
        gap = LARGEST_GAP if len(cases) == 1 else LOOSE
    check_number("iterations", iterations, at_least=1)
    check_number("gap", gap, at_least=0.0)
    check_known("mode", mode, (TENSION, BONDED))
    check_known("objective", objective, OBJECTIVES)
    parts = smeared_cases(cases.fields, frames_in_cells(cases.mesh.centres, layers))
    alone = (layers, length, machine, strand, _SINGLE_ITERATIONS, mode)
    singles = measures(objective, cases, *alone)
    volume, most = parts[0].mesh.volumes, room_for_fibre(parts[0], layers, machine)
    length = min(length, float(volume @ most))
    axial = (Strand() if strand is None else strand).stiffness(parts[0].modulus)
    smeared = _Smeared(parts, singles, axial, most, length, mode)
    bound = _searched(smeared, cases.weights, objective, iterations, gap, start)
    if len(cases) > 1 or objective == LEAST:
        return bound
    # One case is measured by this bound itself.
    attained, least = bound.attained / bound.least, bound.least
    return replace(bound, singles=singles / least, least=1.0, attained=attained)


def _searched(
    smeared: "_Smeared",
    weights: FloatArray,
    objective: str,
    iterations: int,
    gap: float,
    start: FloatArray | None,
) -> UpperBound:
    """Search the best density and the sharpest bound, until they are close."""
    volume = smeared.parts[0].mesh.volumes
    ascent = DensityAscent.even(volume, smeared.most, smeared.length, _ANGLES)
    if start is not None:
        ascent = ascent.near(start)
    solutions = [part.unreinforced for part in smeared.parts]
    factors = sharpest = weights
    least = smeared.certificate(solutions, factors)
    best, attained = ascent.density, np.inf
    mean = solutions
    for k in range(iterations):
        if k in _PREPARED:
            smeared = smeared.prepared(ascent.density, solutions)
        solutions = smeared.solve(ascent.density, solutions)
        # Later displacements count more: the k-th in proportion to k.
        mean = [_between(*pair, 2.0 / (k + 2.0)) for pair in zip(mean, solutions, strict=True)]
        terms = smeared.terms(solutions)
        value = _objective(terms, weights, objective)
        if value < attained:
            best, attained = ascent.density, value
        for displaced in (solutions, mean):
            certified = smeared.certificate(displaced, factors)
            if certified >= least:
                least, sharpest = certified, factors
        if attained <= (1.0 + gap) * least:
            break
        merit = -float(factors @ terms)
        if objective != SUM:
            # The bound is on the largest term: the worst cases get more weight, in smaller and
            # smaller steps.
            factors = factors * (terms / terms.max()) ** min(1.0, _FULL_STEPS / (k + 1))
            factors = factors / factors.sum()
        ascent = ascent.step(smeared.stretch(solutions, factors), merit)
    bound = (least, attained, sharpest, best, directions(_ANGLES)[0], k + 1)
    return UpperBound(objective, smeared.singles, weights, *bound)


def _between(one: SmearedSolution, other: SmearedSolution, share: float) -> SmearedSolution:
    """Displacements between two, at a share of the way to the other: for a certificate alone."""
    displacement, strain, work = (
        (1.0 - share) * getattr(one, name) + share * getattr(other, name)
        for name in ("displacement", "strain", "work")
    )
    return replace(other, displacement=displacement, strain=strain, work=work)


@dataclass(frozen=True)
class _Smeared:
    """A part with smeared fibre under its load cases: what `upper_bound` solves.

    Attributes
    ----------
    parts : sequence of SmearedPart
        One for each case.
    singles : (n,) array
        Stiffness ratio that each case is measured by.
    axial_stiffness : float, N
        EA of a strand.
    most : (m,) array, mm/mm^3
        Largest density of fibre in each cell.
    length : float, mm
        Of fibre.
    mode : str
        "tension" or "bonded".
    """

    parts: Sequence[SmearedPart]
    singles: FloatArray
    axial_stiffness: float
    most: FloatArray
    length: float
    mode: str

    @cached_property
    def scale(self) -> FloatArray:
        """Factor (n,) that turns a compliance, N mm, into a term of the objective."""
        return self.singles / np.array([part.unreinforced.work for part in self.parts])

    def solve(
        self, density: FloatArray, starts: Sequence[SmearedSolution]
    ) -> list[SmearedSolution]:
        """Displacements with a density of fibre (m, k), of each case, from those of the last."""
        pairs, fibre = zip(self.parts, starts, strict=True), self._fibre(density)
        return [part.solve(fibre, start, 1e-3) for part, start in pairs]

    def prepared(self, density: FloatArray, solutions: Sequence[SmearedSolution]) -> "_Smeared":
        """Return the same parts, prepared for solves with densities (m, k) near to this one."""
        pairs, fibre = zip(self.parts, solutions, strict=True), self._fibre(density)
        return replace(self, parts=[part.with_fibre(fibre, one.strain) for part, one in pairs])

    def _fibre(self, density: FloatArray) -> Fibre:
        """Stiffness of a density of fibre (m, k)."""
        along = directions(density.shape[1])[1]
        outer = (along[:, :, None] * along[:, None, :]).reshape(-1, 9)

        def fibre(strain: FloatArray) -> FloatArray:
            """Stiffness (m, 3, 3) of the fibre that carries at a strain (m, 3)."""
            carried = density
            if self.mode == TENSION:
                carried = np.where(strain @ along.T > 0.0, density, 0.0)
            return self.axial_stiffness * (carried @ outer).reshape(-1, 3, 3)

        return fibre

    def terms(self, solutions: Sequence[SmearedSolution]) -> FloatArray:
        """Terms of the objective (n,): the measure of each case over its stiffness ratio."""
        pairs = zip(self.parts, solutions, strict=True)
        return self.singles / np.array([part.ratio(solution.work) for part, solution in pairs])

    def certificate(self, solutions: Sequence[SmearedSolution], factors: FloatArray) -> float:
        """Lower bound of the sum of the terms times their factors (n,)."""
        weights = factors * self.scale
        room = (self.axial_stiffness, self.most, self.length, self.mode)
        return certificate(self.parts, solutions, weights, *room)

    def stretch(self, solutions: Sequence[SmearedSolution], factors: FloatArray) -> FloatArray:
        """Root of the mean squared strain along each direction over the cases, (m, k)."""
        along, squares = directions(_ANGLES)[1], 0.0
        for weight, part, solution in zip(factors * self.scale, self.parts, solutions, strict=True):
            strain = solution.strain @ along.T
            stretch = np.maximum(strain, 0.0) if self.mode == TENSION else strain
            squares = squares + weight * (part.pull(solution)[0] * stretch) ** 2
        return np.asarray(np.sqrt(squares))


def affordable_iterations(cells: int) -> int:
    """Return how many iterations take about as long as 60 with 25,000 cells; at least 10."""
    return max(10, min(60, _CELL_ITERATIONS // cells))


def measures(
    objective: str,
    cases: WeightedCases,
    layers: Sequence[Layer],
    length: float,
    machine: Machine,
    strand: Strand | None = None,
    iterations: int = _MEASURED,
    mode: str = TENSION,
) -> FloatArray:
    """Stiffness ratio (n,) that each of several cases is measured by: the bound of it alone.

    1 with the objective "least", and for one case, which is compared with no other. Parameters as
    in `upper_bound`.
    """
    if objective == LEAST or len(cases) == 1:
        return np.ones(len(cases))
    # One factorisation for all.
    smeared_cases(cases.fields, frames_in_cells(cases.mesh.centres, layers))
    return np.array(
        [
            upper_bound(case, layers, length, machine, strand, mode, iterations).ratio
            for case in cases.fields
        ]
    )


def directions(count: int) -> tuple[FloatArray, FloatArray]:
    """Angles (k,), radians, evenly over half a turn, and coefficients of the strains along them.

    The coefficients (k, 3) times strains 11, 22 and 12 (engineering shear) give the strain along
    each angle.
    """
    angles = np.pi * np.arange(count) / count
    cosine, sine = np.cos(angles), np.sin(angles)
    return angles, np.stack([cosine**2, sine**2, cosine * sine], axis=1)


def certificate(
    parts: Sequence[SmearedPart],
    solutions: Sequence[SmearedSolution],
    factors: FloatArray,
    axial_stiffness: float,
    most: FloatArray,
    length: float,
    mode: str = TENSION,
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
    mode : str
        "tension" or "bonded".
    """
    pulls = [part.pull(solution) for part, solution in zip(parts, solutions, strict=True)]
    strains = np.stack(
        [s * solution.strain for (s, _), solution in zip(pulls, solutions, strict=True)]
    )
    square = largest_gathered(strains, np.asarray(factors, dtype=np.float64), mode)
    order = np.argsort(-square, kind="stable")
    room = (parts[0].mesh.volumes * most)[order]
    used = np.minimum(room, np.maximum(length - (np.cumsum(room) - room), 0.0))
    energy, work = axial_stiffness * float(used @ square[order]), 0.0
    for factor, part, solution, (s, load_work) in zip(
        factors, parts, solutions, pulls, strict=True
    ):
        u = s * solution.displacement.reshape(-1)
        energy += factor * float(u @ (part.specimen.matrix @ u))
        work += factor * load_work
    return work**2 / energy


def largest_gathered(strains: FloatArray, factors: FloatArray, mode: str = TENSION) -> FloatArray:
    """Bound ``max over t of sum of factor * max(t.eps t, 0)^2`` from above in each cell, (m,).

    For one case the maximum is along a principal direction. For several, at its maximum the sum has
    slope zero: between two angles that are tried it exceeds the larger value by at most half its
    largest curvature times the square of half their distance.

    Parameters
    ----------
    strains : (n, m, 3) array
        Strains 11, 22 and 12 (engineering shear) in the plane, of each case.
    factors : (n,) array
        Not negative.
    mode : str
        "tension", or "bonded" for ``(t.eps t)^2``.
    """
    bonded = mode != TENSION
    if len(factors) == 1:
        largest, smallest, _ = largest_in_plane(strains[0] * np.array([1.0, 1.0, 0.5]))
        square = np.maximum(largest, 0.0) ** 2
        return factors[0] * (np.maximum(square, smallest**2) if bonded else square)
    _, along = directions(_CERTIFIED_ANGLES)
    half = 0.5 * np.pi / _CERTIFIED_ANGLES
    result = np.empty(strains.shape[1])
    _gathered(np.ascontiguousarray(strains), factors, along, 0.5 * half**2, bonded, result)
    return result


@compiled
def _gathered(
    strains: FloatArray,
    factors: FloatArray,
    along: FloatArray,
    margin: float,
    bonded: bool,
    result: FloatArray,
) -> None:  # pragma: no cover
    for c in range(strains.shape[1]):
        # The strain along t is a + b cos(2 angle - phase): its square bends down by at most
        # 8 b (|a| + b), and by 8 b (a + b) where only tension counts.
        bend = 0.0
        for i in range(len(factors)):
            e1, e2, e12 = strains[i, c, 0], strains[i, c, 1], strains[i, c, 2]
            b = 0.5 * ((e1 - e2) ** 2 + e12 * e12) ** 0.5
            a = abs(0.5 * (e1 + e2)) if bonded else 0.5 * (e1 + e2)
            bend += factors[i] * 8.0 * b * max(a + b, 0.0)
        largest = 0.0
        for k in range(len(along)):
            total = 0.0
            for i in range(len(factors)):
                e = strains[i, c, 0] * along[k, 0] + strains[i, c, 1] * along[k, 1]
                e += strains[i, c, 2] * along[k, 2]
                if e > 0.0 or bonded:
                    total += factors[i] * e * e
            largest = max(largest, total)
        result[c] = largest + margin * bend


@dataclass(frozen=True)
class DensityAscent:
    """Densities of fibre in cells and directions during the search for the optimum.

    Attributes
    ----------
    volume : (m,) array, mm^3
        Of the cells.
    most : (m,) array, mm/mm^3
        Largest density of each cell, all directions together.
    length : float, mm
        Of fibre, at most what the cells can hold.
    density : (m, k) array, mm/mm^3
    stepped : (m, k) array, optional
        The density that the last step would have ended at without momentum.
    steps : int
        Number of steps since the momentum began.
    merit : float
        Merit of the last density; larger is better.
    """

    volume: FloatArray
    most: FloatArray
    length: float
    density: FloatArray
    stepped: FloatArray | None = None
    steps: int = 0
    merit: float = -np.inf

    def __post_init__(self) -> None:
        freeze(self, volume=float, most=float, density=float, stepped=float)

    @classmethod
    def even(
        cls, volume: FloatArray, most: FloatArray, length: float, directions: int
    ) -> "DensityAscent":
        """Start with the same share of its room in every cell, equally in all directions."""
        share = length / float(volume @ most) / directions
        return cls(volume, most, length, np.repeat(share * most[:, None], directions, axis=1))

    def near(self, density: FloatArray) -> "DensityAscent":
        """Return a start at densities (m, k) up to a factor, as far as there is room."""
        return replace(self, density=self._fitted(np.array(density)))

    def step(self, stretch: FloatArray, merit: float) -> "DensityAscent":
        """Return the densities after a step.

        Parameters
        ----------
        stretch : (m, k) array
            Strain along each direction at the present density, not negative.
        Merit of the present density, which grows with the stiffness.
        """
        steps = self.steps + 1 if merit >= self.merit else 1
        # In place, as far as it goes: these arrays fill more than the cache of a processor.
        power = stretch / (float(stretch.max()) or 1.0)
        power **= _EXPONENT
        power *= self.density
        stepped = self._fitted(power)
        density, momentum = stepped, min((steps - 1.0) / (steps + 2.0), _MOST_MOMENTUM)
        if self.stepped is not None and momentum > 0.0:
            ahead = np.maximum(self.stepped, 1e-300)
            np.divide(stepped, ahead, out=ahead)
            ahead **= momentum
            ahead *= stepped
            density = self._fitted(ahead)
        return DensityAscent(self.volume, self.most, self.length, density, stepped, steps, merit)

    def _fitted(self, weight: FloatArray) -> FloatArray:
        """Densities proportional to weights (m, k), with the given length and within the room.

        They take the place of the weights.
        """
        total = weight.sum(axis=1)
        # The length grows with the factor, at a slope that falls where a cell becomes full.
        full = self.most / np.maximum(total, 1e-300)
        order = np.argsort(full, kind="stable")
        room, volume = (self.volume * self.most)[order], (self.volume * total)[order]
        filled = np.cumsum(room) - room
        slope = np.cumsum(volume[::-1])[::-1]
        reached = filled + slope * full[order]
        k = min(int(np.searchsorted(reached, self.length)), len(order) - 1)
        factor = min((self.length - filled[k]) / max(slope[k], 1e-300), full[order[k]])
        scale = np.minimum(full, factor)
        weight *= scale[:, None]
        np.maximum(weight, _TRACE * self.most[:, None], out=weight)
        weight.flags.writeable = False
        return weight
