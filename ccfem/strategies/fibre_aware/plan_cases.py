"""Planning a part by any strategy for one load case, or for several at once.

A strategy that plans for all cases does so itself (`CasesStrategy`). Of any other that follows the
stress, each layer is planned for one case, the layers of a case spread evenly over the height; more
is planned than wanted, and tests under all cases say what to take off. What does not follow the
stress is planned as it is.
"""

from collections.abc import Sequence

from ccfem.fem.elasticity import StressField
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.judging.virtual_testing import Strand, specimens
from ccfem.machine.machine import Machine
from ccfem.paths.planning import Planned, Strategy, length_per_layer, plan, plan_to_length
from ccfem.paths.planning.equal_fibre import TOLERANCE, about_shortfall, plan_to_lengths
from ccfem.paths.planning.layer_plans import check_layers, plan_layers
from ccfem.paths.planning.strategy import CasesStrategy, LengthStrategy
from ccfem.paths.planning.unfolding import may_fold
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.heights import layers_by_case
from ccfem.strategies.fibre_aware.judges import Goal
from ccfem.strategies.fibre_aware.prune import prune
from ccfem.strategies.fibre_aware.upper_bound import WORST, measures

_TOO_MUCH = 1.15
"""Length that is planned over that kept."""

_ROUNDS = 3
"""Virtual tests under every case that say what is taken off."""

_SLACK = 0.05
"""Share by which less may be planned: it is found in fewer steps."""


def plan_cases(
    strategy: Strategy,
    layers: Sequence[Layer],
    stress: StressField | WeightedCases,
    machine: Machine,
    wanted: float | None = None,
    strand: Strand | None = None,
) -> Planned:
    """Plan a part for one or several load cases.

    Parameters
    ----------
    layers : sequence of Layer
        All layers of the part.
    wanted : float, mm, optional
        Fibre per layer, mean over the stack; default what the strategy lays by itself, of which
        nothing is taken off.
    strand : Strand, optional
        Of the tests; default rho = EA/E = 4 mm^2.
    """
    check_layers(strategy, layers, machine)
    if wanted is None and isinstance(strategy, LengthStrategy):
        wanted = strategy.natural_length(layers, machine)
    cases = WeightedCases.of(stress)
    if _is_of_one(strategy, cases):
        field = cases.heaviest
        if wanted is not None:
            return plan_to_length(strategy, layers, field, machine, wanted)
        paths = plan(strategy, layers, field, machine)
        return Planned(strategy, paths, length_per_layer(paths, layers))
    if isinstance(strategy, CasesStrategy) and wanted is not None:
        return _by_itself(strategy, layers, cases, machine, (wanted,))[0]
    if wanted is None:
        return _planned(strategy, plan_by_layers(strategy, layers, cases, machine), layers, machine)
    too_much = plan_by_layers(strategy, layers, cases, machine, _TOO_MUCH * wanted)
    in_all = wanted * len(layers)
    bounds = measures(WORST, cases, layers, in_all, machine, strand)
    goal = Goal(specimens(cases), cases.weights, bounds, WORST)
    paths = prune(too_much, goal, in_all, machine, strand, _ROUNDS)
    return _planned(strategy, paths, layers, machine, wanted)


def plan_cases_to_lengths(
    strategy: Strategy,
    layers: Sequence[Layer],
    stress: StressField | WeightedCases,
    machine: Machine,
    lengths: Sequence[float],
    strand: Strand | None = None,
) -> list[Planned]:
    """Plan for one or several load cases to several lengths of fibre, mm per layer.

    For one case, and by a strategy that plans for all cases (`CasesStrategy`), all lengths are
    planned together; by any other each length is planned on its own. Parameters and errors as in
    `plan_cases`.
    """
    cases = WeightedCases.of(stress)
    if _is_of_one(strategy, cases):
        return plan_to_lengths(strategy, layers, cases.heaviest, machine, lengths)
    if isinstance(strategy, CasesStrategy):
        check_layers(strategy, layers, machine)
        return _by_itself(strategy, layers, cases, machine, lengths)
    return [plan_cases(strategy, layers, cases, machine, length, strand) for length in lengths]


def _is_of_one(strategy: Strategy, cases: WeightedCases) -> bool:
    """Whether one load case says all that a plan follows."""
    return len(cases) == 1 or getattr(strategy, "ignores_stress", False)


def _by_itself(
    strategy: CasesStrategy,
    layers: Sequence[Layer],
    cases: WeightedCases,
    machine: Machine,
    lengths: Sequence[float],
) -> list[Planned]:
    """Plans of a strategy that plans for all cases, of several lengths per layer."""
    plans = []
    planners = strategy.for_cases(cases, layers, machine, lengths)
    for (asked, planner), wanted in zip(planners, lengths, strict=True):
        fold = may_fold(asked)
        paths = plan_layers(planner, layers, layers, cases.fields[0], machine, fold)
        plans.append(_planned(asked, paths, layers, machine, wanted))
    return plans


def plan_by_layers(
    strategy: Strategy,
    layers: Sequence[Layer],
    cases: WeightedCases,
    machine: Machine,
    length: float | None = None,
) -> Toolpaths:
    """Plan each layer for one case, by their weights, the cases taking turns over the height.

    Parameters
    ----------
    length : float, mm, optional
        Per layer, met within 5 %; default the strategy's own.
    """
    case = layers_by_case(cases.weights, layers)
    parts = []
    for k, field in enumerate(cases.fields):
        case_layers = [layer for layer, number in zip(layers, case, strict=True) if number == k]
        if case_layers and length is None:
            parts.append(plan(strategy, case_layers, field, machine))
        elif case_layers and length is not None:
            wanted = (1.0 + _SLACK) * length
            planned = plan_to_length(
                strategy, case_layers, field, machine, wanted, tolerance=_SLACK
            )
            parts.append(planned.toolpaths)
    whole = Toolpaths.concatenate(parts)
    return Toolpaths.concatenate(whole.on_layer(layer.index) for layer in layers)


def _planned(
    strategy: Strategy,
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    machine: Machine,
    wanted: float | None = None,
) -> Planned:
    """Plan with what has to be said of its length."""
    length = length_per_layer(toolpaths, layers)
    if wanted is None or length >= (1.0 - TOLERANCE) * wanted:
        return Planned(strategy, toolpaths, length)
    note = about_shortfall(length, wanted, layers, machine, " for all load cases")
    return Planned(strategy, toolpaths, length, note, reached=False)
