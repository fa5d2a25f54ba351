"""Comparison of strategies on one part: the same stress, layers, machine and length of fibre."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from ccfem.cases.case import Case
from ccfem.checks import check_known
from ccfem.comparison.result import Comparison, Run, Tested
from ccfem.elasticity.solve import solve
from ccfem.elasticity.stress_field import StressField
from ccfem.errors import InputError, SolveError, known_names
from ccfem.evaluation import evaluate
from ccfem.fibre_aware.upper_bound import upper_bound
from ccfem.layers import Layer
from ccfem.layers.slicing.planar import Planar
from ccfem.planning.equal_fibre import (
    Planned,
    check_wanted,
    length_per_layer,
    plan_to_length,
)
from ccfem.planning.plan import plan
from ccfem.planning.strategy import Strategy
from ccfem.progress import Progress, silent
from ccfem.strategies import create
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.equilibrium import BONDED, TENSION
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.strands import cut_strands
from ccfem.virtual_testing.strength import first_failure
from ccfem.virtual_testing.virtual_test import Bracket, virtual_test

__all__ = ["STRATEGIES", "compare", "create_all", "solve_and_slice"]

STRATEGIES = ("isocurve", "concentric", "zigzag", "contour_zigzag")
"""The strategies that are compared when none are named."""

DEFAULT_STRAND = Strand()

_BOUND_ITERATIONS = 7
"""The bound holds after any number of iterations; more than these lower it by half a per cent."""


def create_all(
    case: Case,
    names: Sequence[str] = STRATEGIES,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
) -> dict[str, Strategy]:
    """Strategies by name, with the parameters of the case and, above these, those given.

    Parameters
    ----------
    case : Case
    names : sequence of str
    parameters : mapping of strategy name to parameters, optional

    Raises
    ------
    InputError
        For an unknown strategy or parameter, or one named twice.
    """
    given = dict(parameters or {})
    if not names:
        raise InputError("name at least one strategy to compare; got none")
    repeated = {name for name in names if list(names).count(name) > 1}
    if repeated:
        raise InputError(f"name each strategy once; got '{min(repeated)}' more than once")
    for name in given:
        if name not in names:
            raise InputError(
                f"parameters are given for '{name}', which is not among the strategies: "
                f"{known_names(name, names)}"
            )
    return {
        name: create(name, {**case.parameters.get(name, {}), **given.get(name, {})})
        for name in names
    }


def solve_and_slice(
    case: Case,
    layers: int | Sequence[float] | None = None,
    load_case: str | None = None,
    backend: str = "auto",
) -> tuple[StressField, tuple[Layer, ...], dict[str, float]]:
    """Stress of one load case, the layers, and the seconds that each took.

    Parameters
    ----------
    case : Case
    layers : int or sequence of float, optional
        Number of layers instead of the case's own, or their heights along the build direction, mm.
    load_case : str, optional
        By default the first one.
    backend : str, default "auto"
        As in `solve`.

    Raises
    ------
    InputError
        For an unknown load case, or a problem that cannot be solved or sliced.
    """
    seconds: dict[str, float] = {}
    name = _load_case(case, load_case)
    with _timed(seconds, "solve"):
        stress = solve(case.problem, backend=backend)[name]
    with _timed(seconds, "slice"):
        chosen = case.layers if layers is None else layers
        count, heights = (chosen, None) if isinstance(chosen, int) else (None, chosen)
        stack = Planar(count=count, heights=heights).cut(case.problem.mesh, case.build)
    return stress, stack, seconds


def compare(
    case: Case,
    strategies: Mapping[str, Strategy] | Sequence[str] = STRATEGIES,
    layers: int | Sequence[float] | None = None,
    fibre_per_layer: float | None = None,
    natural: bool = False,
    strand: Strand | None = DEFAULT_STRAND,
    load_case: str | None = None,
    backend: str = "auto",
    progress: Progress = silent,
) -> Comparison:
    """Solve a case once, and plan and evaluate each strategy on it.

    Strategies are compared at equal length of fibre: more fibre wins almost any comparison. When no
    length is given, it is the smallest that any of them lays of its own accord, so that nobody has
    to lay more than it would, and all others are thinned to it by the parameter that each names for
    the purpose. A strategy that fails stays in the result, with the reason.

    Parameters
    ----------
    case : Case
    strategies : mapping of name to Strategy, or sequence of names
        Named ones take the parameters of the case.
    layers : int or sequence of float, optional
        Number of layers instead of the case's own, or their heights along the build direction, mm.
    fibre_per_layer : float, mm, optional
        Length that every strategy is held to, mean over the layers.
    natural : bool, default False
        Let every strategy lay its own amount instead.
    strand : Strand or None
        What a strand is worth in the virtual test; None leaves the test out.
    load_case : str, optional
        Load case to plan, evaluate and test for; by default the first one.
    backend : str, default "auto"
        As in `solve`.
    progress : callable, optional
        Told what is being done, and the share that is done.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        When the case, a strategy's name or its parameters make no sense.
    SolveError
        When the solve misses its tolerance.
    """
    if natural and fibre_per_layer is not None:
        raise InputError("give either a fibre length per layer or the natural amount, not both")
    if fibre_per_layer is not None:
        check_wanted(fibre_per_layer)
    if not isinstance(strategies, Mapping):
        strategies = create_all(case, strategies)
    progress(f"solving {case.name}", 0.0)
    stress, stack, seconds = solve_and_slice(case, layers, load_case, backend)
    spent: dict[str, dict[str, float]] = {name: {} for name in strategies}
    done = _Steps(progress, 0.1, 4 * len(strategies) + 1)
    planner = _Planner(stress, stack, case, spent, done, dict(strategies))
    if fibre_per_layer is not None:
        planner.plan_each(fibre_per_layer)
        wanted: float | None = fibre_per_layer
    else:
        planner.plan_each(None)
        wanted = None if natural else planner.level()
    runs = []
    for name in strategies:
        done(f"evaluating {name}")
        runs.append(_evaluated(name, planner, spent[name]))
    if strand is not None:
        runs = _all_tested(runs, stress, strand, backend, spent, done)
    bound = None
    if any(run.tested is not None for run in runs):
        done("bounding what any paths could reach")
        length = max(float(run.toolpaths.lengths.sum()) for run in runs if run.tested is not None)
        with _timed(seconds, "bound"):
            bound = upper_bound(
                stress, stack, length, case.machine, strand, iterations=_BOUND_ITERATIONS
            )
    return Comparison(case, stress, stack, tuple(runs), wanted, seconds, bound)


@dataclass
class _Planner:
    """Plans of several strategies on one part, brought to the same length."""

    stress: StressField
    layers: tuple[Layer, ...]
    case: Case
    spent: Mapping[str, dict[str, float]]
    done: Callable[[str], None]
    strategies: dict[str, Strategy]
    found: dict[str, Planned] = field(default_factory=dict)
    failures: dict[str, str] = field(default_factory=dict)

    def plan_each(self, wanted: float | None, but: str = "") -> None:
        """Plan every strategy that has not failed, to a length per layer or of its own accord."""
        for name, strategy in self.strategies.items():
            if name in self.failures or name == but:
                continue
            amount = "" if wanted is None else f" to {wanted:.0f} mm a layer"
            self.done(f"planning {name}{amount}")
            try:
                with _timed(self.spent[name], "plan"):
                    self.found[name] = self.planned(strategy, wanted, self.found.get(name))
            except (InputError, SolveError) as error:
                self.failures[name] = str(error)

    def planned(self, strategy: Strategy, wanted: float | None, start: Planned | None) -> Planned:
        """Plan one strategy, from its natural plan where there is one."""
        machine = self.case.machine
        if wanted is not None:
            return plan_to_length(strategy, self.layers, self.stress, machine, wanted, start=start)
        toolpaths = plan(strategy, self.layers, self.stress, machine)
        return Planned(strategy, toolpaths, length_per_layer(toolpaths, self.layers))

    def level(self) -> float | None:
        """Bring all plans to the smallest natural length.

        Returns
        -------
        float, mm, or None
            The length; None where nobody lays fibre.
        """
        lengths = {n: one.length_per_layer for n, one in self.found.items() if len(one.toolpaths)}
        if not lengths:
            return None
        setter = min(lengths, key=lengths.__getitem__)
        self.plan_each(lengths[setter], but=setter)
        note = "lays the least of its own accord: sets the length"
        self.found[setter] = replace(self.found[setter], note=note)
        return lengths[setter]


def _evaluated(name: str, planner: _Planner, seconds: dict[str, float]) -> Run:
    """Evaluate what was planned, or say why there is nothing to evaluate."""
    if name in planner.failures:
        failure = planner.failures[name]
        strategy = planner.strategies[name]
        return Run(name, strategy, Toolpaths.empty(), None, failure=failure, seconds=seconds)
    planned = planner.found[name]
    evaluation, failure = None, ""
    if not len(planned.toolpaths):
        shortest = planner.case.machine.minimum_length
        failure = (
            "laid no fibre: the sections, or what of them is under tension, are too small for the "
            f"shortest strand (machine.minimum_length = {shortest:g} mm): are all lengths in mm?"
        )
    else:
        try:
            with _timed(seconds, "evaluate"):
                evaluation = evaluate(
                    planned.toolpaths, planner.layers, planner.stress, planner.case.machine
                )
        except (InputError, SolveError) as error:
            failure = str(error)
    return Run(
        name,
        planned.strategy,
        planned.toolpaths,
        evaluation,
        length_per_layer=planned.length_per_layer,
        note=planned.note,
        failure=failure,
        seconds=seconds,
    )


def _all_tested(
    runs: Sequence[Run],
    stress: StressField,
    strand: Strand,
    backend: str,
    spent: Mapping[str, dict[str, float]],
    done: Callable[[str], None],
) -> list[Run]:
    """Put every run that did not fail to the virtual test, all on one factorisation."""
    try:
        specimen = Specimen.of(stress, backend)
    except InputError as error:
        return [replace(run, untested=str(error)) for run in runs]
    tested = []
    for run in runs:
        done(f"testing {run.name}")
        if run.evaluation is None:
            tested.append(run)
            continue
        try:
            with _timed(spent[run.name], "virtual test"):
                test = _tested(run, specimen, strand)
            tested.append(replace(run, tested=test, seconds=spent[run.name]))
        except (InputError, SolveError) as error:
            tested.append(replace(run, untested=str(error), seconds=spent[run.name]))
    return tested


def _tested(run: Run, specimen: Specimen, strand: Strand) -> Tested:
    strands = cut_strands(run.toolpaths, specimen.unreinforced.mesh)
    tension = virtual_test(strands, specimen, strand, TENSION)
    bracket = Bracket(tension, virtual_test(strands, specimen, strand, BONDED, span=()))
    try:
        return Tested(bracket, first_failure(tension, strand))
    except InputError as error:
        return Tested(bracket, None, str(error))


def _load_case(case: Case, name: str | None) -> str:
    known = list(case.problem.loads)
    if not known:
        raise InputError(f"case '{case.name}' has no load case; give it at least one load")
    if name is None:
        return known[0]
    check_known("load case", name, known)
    return name


class _Steps:
    """Counts steps of equal share for a progress bar."""

    def __init__(self, progress: Progress, start: float, steps: int) -> None:
        self._progress, self._start, self._steps, self._done = progress, start, steps, 0

    def __call__(self, what: str) -> None:
        """Tell what comes now."""
        share = self._start + (1.0 - self._start) * self._done / self._steps
        self._progress(what, min(share, 1.0))
        self._done += 1


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.perf_counter()
    try:
        yield
    finally:
        seconds[stage] = seconds.get(stage, 0.0) + time.perf_counter() - start
