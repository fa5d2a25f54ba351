"""Any strategy, planned with too much fibre and then cut back to the most useful fibre.

Not from a paper: the part is tested virtually with its fibre, and the stretches that do the least
work are removed until the wanted length is left (`ccfem.strategies.fibre_aware.prune`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

from ccfem.base.arrays import freeze
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import PartStress
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.judging.virtual_testing import RHO, Strand, specimens
from ccfem.machine.machine import Machine
from ccfem.paths.planning.strategy import (
    Amount,
    ByCoverage,
    LayerPlanner,
    Strategy,
    WholePart,
    full_length,
)
from ccfem.paths.planning.unfolding import may_fold, without_folds
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies import create
from ccfem.strategies.fibre_aware.cut_and_move import Cutting, prune_and_move
from ccfem.strategies.fibre_aware.judges import Goal
from ccfem.strategies.fibre_aware.plain_plans import plain_plans
from ccfem.strategies.fibre_aware.plan_cases import plan_by_layers
from ccfem.strategies.fibre_aware.shortening import TIGHT_SHARES
from ccfem.strategies.fibre_aware.strand_moves import check_moves
from ccfem.strategies.fibre_aware.upper_bound import measures

_BASES: Mapping[str, Mapping[str, Any]] = {"isocurve": {"link_limit": 10.0}}
"""Base parameters with which a strategy plans better when its fibre is pruned afterwards."""

_CASES_ROUNDS = 3
"""Least number of virtual tests for several load cases."""


@dataclass(frozen=True)
class Pruned(ByCoverage):
    """The most useful fibre of another strategy.

    The load is that of the stress given to the strategy. Fibre is taken to carry tension only. With
    the default base, `stripes` and, on flat layers, straight rows along the mean tension and
    contours are pruned and tested too, and the best is taken.

    Attributes
    ----------
    of : str, default "isocurve"
        Name of the base strategy.
    base : mapping of str to value, default {}
        Parameters of the base strategy, as ``{"floor": 0.3}``. For isocurves ``link_limit`` is 10
        by default, since the tests say what short pieces are worth.
    coverage : float, default 0.45
        Fibre length times strand width over area of the layers, in (0, 1].
    overfill : float, default 1.25
        Planned fibre length over the length kept, at least 1; up to 5 % more may be planned.
    rounds : int, default 2
        Virtual tests; with several load cases at least 3, which remove equal parts of the
        excess. Of one case each removes half of the excess, the last one all of it.
    rho : float, mm^2, default 4
        Axial stiffness of a strand over Young's modulus of the matrix.
    strength : float, default 0
        Weight of the load at first failure against the stiffness, in [0, 1]: the objective is
        ``stiffness^(1 - strength) * load^strength``. Of several load cases, the load is that of the
        case that fails first, at the least multiple of its load.
    moves : int, default 0
        Number of steps in which the remaining strands are moved sideways, each step tested
        (`ccfem.strategies.fibre_aware.strand_moves`). 6 steps make a part 1 to 2 % stiffer, and
        planning takes two to three times as long. On flat layers only.
    turns : {"tight", "cut"}
        Whether more than 1 % of the fibre may turn more tightly than the machine's minimum radius.
    objective : {"worst", "sum", "least"}
        How several load cases count, as in `stream_function`.
    """

    of: str = "isocurve"
    base: Mapping[str, Any] = field(default_factory=dict, hash=False)
    coverage: float = 0.45
    overfill: float = 1.25
    rounds: int = 2
    rho: float = RHO
    strength: float = 0.0
    moves: int = 0
    turns: Literal["tight", "cut"] = "tight"
    objective: Literal["worst", "sum", "least"] = "worst"

    amount: ClassVar[Amount] = Amount("coverage", most=0.9, least=0.1)
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "concentric": {"of": "concentric"},
        "moves": {"moves": 2},
        "cut": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        if self.of in ("pruned", "stream_function"):
            raise InputError(
                f"pruned.of must be another strategy; got {self.of!r}: take "
                "concentric or zigzag, for example"
            )
        freeze(self, base=dict)
        self._planner()
        check_choices(self)
        check_fields(self, "coverage", above=0.0, at_most=1.0)
        check_fields(self, "overfill", "rounds", at_least=1)
        check_fields(self, "rho", above=0.0, unit="mm^2")
        check_fields(self, "strength", at_least=0.0, at_most=1.0)
        check_fields(self, "moves", at_least=0)

    @property
    def folds(self) -> bool:
        """Whether strands may fold: those of a base that turns back by design."""
        return may_fold(self._planner())

    def _planner(self) -> Strategy:
        """Underlying strategy with its parameters."""
        return create(self.of, {**_BASES.get(self.of, {}), **self.base})

    def for_part(
        self, stress: PartStress, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Plan and prune all layers of the part."""
        wanted = self.natural_length(layers, machine)
        return self.to_lengths(stress, layers, machine, (wanted,))[0][1]

    def for_cases(
        self,
        cases: WeightedCases,
        layers: Sequence[Layer],
        machine: Machine,
        lengths: Sequence[float],
    ) -> list[tuple["Pruned", LayerPlanner]]:
        """Plan once for the largest of the lengths, mm per layer, and prune that plan to each.

        Each layer is planned for one load case, and tests under all cases say what goes. Lengths
        that need more than the largest coverage are reduced to that coverage.
        """
        check_moves(self.moves, layers)
        full, strand = full_length(layers, machine), Strand(self.rho)
        most = max(self.amount.most, self.coverage) * full
        lengths = [min(length, most) for length in lengths]
        planned = self.overfill * max(lengths)
        paths = plan_by_layers(self._planner(), layers, cases, machine, planned)
        if not self.folds:
            paths = without_folds(paths, layers, machine)
        in_all = max(lengths) * len(layers)
        bounds = measures(self.objective, cases, layers, in_all, machine, strand)
        goal = Goal(specimens(cases), cases.weights, bounds, self.objective)
        rounds = self.rounds if len(cases) == 1 else max(self.rounds, _CASES_ROUNDS)
        tight = TIGHT_SHARES[self.turns]
        how = Cutting(rounds, self.strength, self.moves, tight, self.folds)
        tried = [paths]
        if self.of == "isocurve" and not self.base:
            tried += plain_plans(cases, layers, machine, curves=False)
        planners: list[tuple[Pruned, LayerPlanner]] = []
        for length in lengths:
            wanted = length * len(layers)
            kept = prune_and_move(tried, layers, goal, wanted, machine, strand, how)
            coverage = length / full
            overfill = max(planned / full / coverage, 1.0)
            planners.append((replace(self, coverage=coverage, overfill=overfill), WholePart(kept)))
        return planners
