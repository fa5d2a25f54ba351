"""Stages of a comparison: each makes of a `Run` one that holds more, or the reason why not."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from ccfem.comparison.runs import Run, Tested
from ccfem.elasticity.part_stress import PartStress
from ccfem.elasticity.stress_field import StressField
from ccfem.errors import InputError, SolveError
from ccfem.evaluation import evaluate
from ccfem.evaluation.printable import why_not
from ccfem.export.print_plan import plan_print
from ccfem.layers import Layer
from ccfem.machine.machine import Machine
from ccfem.planning.equal_fibre import TOLERANCE, Planned, length_per_layer, plan_to_length
from ccfem.planning.given_paths import GivenPaths
from ccfem.planning.plan import plan
from ccfem.planning.strategy import LengthStrategy
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.equilibrium import BONDED, TENSION
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.strand import RHO_SPAN, Strand
from ccfem.virtual_testing.strands import Strands, cut_strands
from ccfem.virtual_testing.strength import first_failure, matrix_peak
from ccfem.virtual_testing.virtual_test import Bracket, virtual_test

__all__ = [
    "Part",
    "Tell",
    "all_tested",
    "attempted",
    "evaluated",
    "levelled",
    "planned",
    "timed",
    "with_plan",
    "with_print",
]

Tell = Callable[[str], None]
"""Told what is done next."""


@dataclass(frozen=True)
class Part:
    """What all runs share: the stress that counts, the layers, the machine and the strand."""

    stress: PartStress
    layers: tuple[Layer, ...]
    machine: Machine
    strand: Strand | None = None


def planned(
    run: Run, part: Part, wanted: float | None, tell: Tell, start: Planned | None = None
) -> Run:
    """Plan a strategy to a length per layer, mm, from a known plan, or to its natural amount."""
    if run.failure:
        return run
    tell(f"planning {run.name}" + ("" if wanted is None else f" to {wanted:.0f} mm a layer"))

    def work() -> Run:
        layers, stress, machine = part.layers, part.stress, part.machine
        if isinstance(run.strategy, GivenPaths):
            paths = run.strategy.toolpaths
            laid = length_per_layer(paths, layers)
            found = Planned(run.strategy, paths, laid, _as_given(laid, wanted))
        elif wanted is None:
            paths = plan(run.strategy, layers, stress, machine)
            found = Planned(run.strategy, paths, length_per_layer(paths, layers))
        else:
            found = plan_to_length(run.strategy, layers, stress, machine, wanted, start=start)
        return with_plan(run, found)

    bare = replace(run, toolpaths=Toolpaths.empty(), length_per_layer=0.0)
    return _stage(bare, "plan", work)


def with_plan(run: Run, found: Planned) -> Run:
    """Run with a plan."""
    return replace(
        run,
        strategy=found.strategy,
        toolpaths=found.toolpaths,
        length_per_layer=found.length_per_layer,
        note=found.note,
    )


def attempted(run: Run, work: Callable[[], Run]) -> Run:
    """Run that planning makes of `run`; where it fails, `run` with the reason."""
    return _stage(run, "plan", work)


def _as_given(laid: float, wanted: float | None) -> str:
    """Note on paths that stay as they are, where they miss the wanted length, mm per layer."""
    if wanted is None or abs(laid / wanted - 1.0) <= TOLERANCE:
        return ""
    return f"given paths stay as they are: lays {laid:.0f} of {wanted:.0f} mm per layer"


def levelled(runs: Sequence[Run], part: Part, tell: Tell) -> tuple[list[Run], float | None]:
    """Plan all runs to the smallest of their natural amounts.

    Strategies that take the length itself are planned once that is known.

    Returns
    -------
    list of Run
    float, mm, or None
        The length per layer; None where nobody lays fibre.
    """
    own = {
        run.name: run
        if isinstance(run.strategy, LengthStrategy)
        else planned(run, part, None, tell)
        for run in runs
    }
    setter = _setter(own, part, tell)
    if setter is None:
        return list(own.values()), None
    length = own[setter].length_per_layer
    given = isinstance(own[setter].strategy, GivenPaths)

    def level(run: Run) -> Run:
        if run.name == setter:
            how = "given" if given else "has the shortest natural length"
            return replace(run, note=f"{how}: sets the length")
        start = Planned(run.strategy, run.toolpaths, run.length_per_layer)
        return planned(run, part, length, tell, start if len(run.toolpaths) else None)

    return [level(run) for run in own.values()], length


def _setter(own: dict[str, Run], part: Part, tell: Tell) -> str | None:
    """Name of the run whose natural length is that of all: it is planned after this."""
    while True:
        natural = {}
        for name, run in own.items():
            if len(run.toolpaths):
                natural[name] = run.length_per_layer
            elif isinstance(run.strategy, LengthStrategy) and not run.failure:
                natural[name] = run.strategy.natural_length(part.layers, part.machine)
        given = [name for name in natural if isinstance(own[name].strategy, GivenPaths)]
        setter = min(given or natural, key=natural.__getitem__, default=None)
        if setter is None or len(own[setter].toolpaths):
            return setter
        run = planned(own[setter], part, natural[setter], tell)
        nothing = not run.failure and not len(run.toolpaths)
        own[setter] = replace(run, failure=_no_fibre(part.machine)) if nothing else run


def _no_fibre(machine: Machine) -> str:
    return (
        "laid no fibre: the sections, or what of them is under tension, are too small "
        f"for the shortest strand (machine.minimum_length = {machine.minimum_length:g} mm): are "
        "all lengths in mm?"
    )


def evaluated(run: Run, part: Part, tell: Tell) -> Run:
    """Evaluate what was planned, or say why there is nothing to evaluate."""
    tell(f"evaluating {run.name}")
    if run.failure:
        return run
    if not len(run.toolpaths):
        return replace(run, failure=_no_fibre(part.machine))

    def work() -> Run:
        found = evaluate(run.toolpaths, part.layers, part.stress, part.machine, part.strand)
        broken = why_not(found.total, part.machine)
        return replace(run, evaluation=found, why_not="; ".join(broken))

    return _stage(run, "evaluate", work)


def with_print(run: Run, part: Part, tell: Tell) -> Run:
    """Plan the print of the whole part, or say why it cannot be printed."""
    tell(f"planning the print of {run.name}")
    if run.evaluation is None:
        return run
    try:
        found = plan_print(run.toolpaths, part.layers, part.stress.mesh, part.machine)
    except InputError as error:
        return replace(run, unprinted=str(error))
    share = found.volume(part.machine) / float(part.stress.mesh.volumes.sum())
    return replace(run, print_plan=found, printed_volume=share)


def all_tested(
    runs: Sequence[Run],
    stress: StressField,
    part: Part,
    strand: Strand,
    backend: str,
    tell: Tell,
    alternative: StressField | None = None,
    span: Sequence[float] = RHO_SPAN,
) -> list[Run]:
    """Test every run that did not fail virtually, all on one factorisation.

    Where there is a solution under alternative supports, every run is tested under these too.
    """
    fields = [stress] if alternative is None else [stress, alternative]
    try:
        specimens = [Specimen.of(field, backend) for field in fields]
    except InputError as error:
        return [replace(run, untested=str(error)) for run in runs]
    before = [_peak(field) for field in fields]
    models = list(zip(specimens, before, strict=True))
    return [_tested(run, models, strand, part, tell, span) for run in runs]


def _peak(stress: StressField) -> float:
    """Peak of the averaged von Mises stress, MPa; NaN where it cannot be judged."""
    try:
        return matrix_peak(stress)[0]
    except InputError:
        return float("nan")


def _tested(
    run: Run,
    models: Sequence[tuple[Specimen, float]],
    strand: Strand,
    part: Part,
    tell: Tell,
    span: Sequence[float],
) -> Run:
    """Test a run virtually under one or two models of the supports, or say why it cannot be."""
    tell(f"testing {run.name}")
    if run.evaluation is None:
        return run

    def work() -> Run:
        mesh = models[0][0].unreinforced.mesh
        strands = cut_strands(run.toolpaths, mesh, machine=part.machine)
        found = [_test(strands, *model, strand, part, span) for model in models]
        return replace(run, tested=replace(found[0], alternative=[*found[1:], None][0]))

    return _stage(run, "virtual test", work, reason="untested")


def _test(
    strands: Strands,
    specimen: Specimen,
    before: float,
    strand: Strand,
    part: Part,
    span: Sequence[float],
) -> Tested:
    """Both tests of strands, and what fails first."""
    tension = virtual_test(strands, specimen, strand, TENSION, span)
    bracket = Bracket(tension, virtual_test(strands, specimen, strand, BONDED, span=()))
    try:
        failure = first_failure(tension, strand, layers=part.layers)
    except InputError as error:
        return Tested(bracket, None, str(error))
    return Tested(bracket, failure, matrix_before=before)


def _stage(run: Run, stage: str, work: Callable[[], Run], reason: str = "failure") -> Run:
    """Run that `work` makes of `run`; where it fails, `run` with the reason in that field."""
    seconds = dict(run.seconds)
    try:
        with timed(seconds, stage):
            done = work()
    except (InputError, SolveError) as error:
        said: Any = {reason: str(error)}
        done = replace(run, **said)
    return replace(done, seconds=seconds)


@contextmanager
def timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Add what the block takes to the seconds of a stage."""
    start = time.perf_counter()
    try:
        yield
    finally:
        seconds[stage] = seconds.get(stage, 0.0) + time.perf_counter() - start
