"""What workers do: solve a part, and run one strategy on it."""

import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from threading import Lock
from typing import Any

from ccfem.base.errors import InputError, SolveError
from ccfem.comparison.engine import Solved, answer, otherwise_held
from ccfem.comparison.headline import headline_values
from ccfem.comparison.request import Natural, PerLayer, Request, Slicing
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import Part as CutPart, Tests, timed
from ccfem.comparison.studies.fingerprint import fingerprint
from ccfem.comparison.studies.jobs import Job, Outcome, Part
from ccfem.comparison.studies.transport import Parted, packed, parted, unpacked
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import StressField, WeightedCases
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.paths.planning.strategy import Strategy
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.slicer import Slicer

_HELD = 2
"""Parts that a worker keeps: the one that it works on, and the one before."""

_ALONE = Lock()
"""One run at a time in a process: threads of a Dask worker wait for each other."""


def part_bytes(part: Part, strand: Strand | None, backend: str) -> bytes:
    """Task of `solve_part`."""
    return packed((part, strand, backend))


def job_bytes(job: Job) -> bytes:
    """Task of `run_job`."""
    return packed((job.load_case, job.slicer, job.strategy, job.fibre_per_layer))


@dataclass(frozen=True)
class _Stress:
    """Stress of a part by load case, that under its alternative supports, or why there is none."""

    part: Part
    strand: Strand | None
    backend: str
    fields: Mapping[str, StressField]
    alternative: Mapping[str, StressField]
    failure: str
    seconds: Mapping[str, float]


def solve_part(task: bytes) -> Parted:
    """Solve a part for all load cases that a study runs on it; a failure is told by its runs."""
    part, strand, backend = unpacked(task)
    seconds: dict[str, float] = {}
    fields: dict[str, StressField] = {}
    alternative: dict[str, StressField] = {}
    failure = ""
    with _ALONE, timed(seconds, "solve"):
        try:
            stress_fields = solve(part.case.problem, backend=backend)
            fields = {name: stress_fields[name] for name in part.load_cases}
            if strand is not None and part.case.alternative_supports:
                for name, stress in fields.items():
                    alternative[name] = otherwise_held(part.case, stress, backend)
        except (InputError, SolveError) as error:
            failure = str(error)
    return parted(_Stress(part, strand, backend, fields, alternative, failure, seconds))


@dataclass
class _Bench:
    """What a worker has of one part: made when a run first needs it, and then kept."""

    stress: _Stress
    solved: dict[str, Solved] = field(default_factory=dict)
    parts: dict[str, CutPart] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)

    def solved_for(self, load_case: str) -> Solved:
        """Stress of a load case with what virtual tests stand on."""
        if load_case not in self.solved:
            field, strand, tests = self.stress.fields[load_case], self.stress.strand, None
            if strand is not None:
                other = self.stress.alternative.get(load_case)
                with timed(self.seconds, "specimens"):
                    tests = Tests.of(field, other, strand, self.stress.backend)
            cases = WeightedCases.of({load_case: field})
            self.solved[load_case] = Solved(self.stress.part.case, cases, None, tests)
        return self.solved[load_case]

    def cut(self, load_case: str, slicer: Slicer) -> CutPart:
        """Part cut into layers by a slicer."""
        key = fingerprint(load_case, slicer)
        if key not in self.parts:
            basis = self.solved_for(load_case)
            with timed(self.seconds, "slice"):
                self.parts[key] = basis.cut(slicer)
        return self.parts[key]


_BENCHES: dict[str, _Bench] = {}


def run_job(stress: Any, name: str, task: bytes) -> Outcome:
    """Plan, evaluate and test one strategy.

    Parameters
    ----------
    stress : bytes and arrays, or callable that returns them
        From `solve_part`; asked for only where this worker does not hold the part yet.
    name : str
        Of the part, different for all parts.
    task : bytes
        From `job_bytes`.

    Returns
    -------
    dict
        What is stored of the run: ready for JSON.
    """
    with _ALONE:
        try:
            if name not in _BENCHES:
                while len(_BENCHES) >= _HELD:
                    del _BENCHES[next(iter(_BENCHES))]
                data = stress() if callable(stress) else stress
                _BENCHES[name] = _Bench(unpacked(*data))
            return _run(_BENCHES[name], *unpacked(task))
        except Exception as error:  # of a strategy or slicer of someone else: told, never dropped
            message = " ".join(f"{type(error).__name__}: {error}".split())
            return crashed(message, traceback.format_exc())


def crashed(why: str, details: str = "") -> Outcome:
    """Outcome of a run that ended in an error that is none of its input: it is tried again."""
    return {"ccfem": version("ccfem"), "failure": why, "crashed": True, "traceback": details}


def _run(
    bench: _Bench, load_case: str, slicer: Slicer, strategy: Strategy, wanted: float | None
) -> Outcome:
    """Outcome of one run."""
    stress, case = bench.stress, bench.stress.part.case
    bench.seconds = {}
    findings: tuple[str, ...] = ()
    try:
        if stress.failure:
            raise InputError(stress.failure)
        basis = bench.solved_for(load_case)
        findings = (*case.findings, *basis.field.findings)
        part = bench.cut(load_case, slicer)
        if not part.layers:
            raise InputError("the slicing has no layer")
        request = Request(
            case,
            {"run": strategy},
            {"": Slicing(slicer)},
            Natural() if wanted is None else PerLayer(wanted),
            load_case,
            stress.strand,
            curve=False,
            bound=False,
        )
        (run,) = answer(request, known=basis, parts={"": part}).runs
    except InputError as error:
        run = Run("run", strategy, Toolpaths.empty(), None, failure=str(error))
    return {
        "ccfem": version("ccfem"),
        "failure": run.failure,
        "crashed": False,
        "printable": run.printable,
        "why_not": run.why_not,
        "untested": run.untested,
        "note": run.note,
        "findings": findings,
        "fails_in": run.fails_in,
        "empty_layers": run.empty_layers,
        "values": {name: _number(value) for name, value in headline_values(run).items()},
        "title": case.title,
        "seconds": {**bench.seconds, **run.seconds},
    }


def _number(value: float) -> float | str:
    """Finite numbers as they are, others as words: JSON has no name for them."""
    value = float(value)
    return value if abs(value) < float("inf") else str(value)
