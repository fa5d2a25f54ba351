"""The runs of a study, one by one, each with the hash that it is stored under."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from ccfem.base.checks import check_known, member_name
from ccfem.base.errors import InputError
from ccfem.base.progress import Progress, silent
from ccfem.cases.case import Case
from ccfem.cases.reading import read
from ccfem.comparison.studies.definition import Study
from ccfem.comparison.studies.fingerprint import fingerprint
from ccfem.comparison.studies.sweep import Variant, variants
from ccfem.paths.planning.strategy import LayerStrategy, PartStrategy, Strategy
from ccfem.slicing import slicers as slicing
from ccfem.slicing.layers.slicer import Slicer
from ccfem.strategies import create


@dataclass(frozen=True)
class Part:
    """A part with the load cases that a study runs on it: solved once.

    Attributes
    ----------
    case : Case
    load_cases : tuple of str
    """

    case: Case
    load_cases: tuple[str, ...]


@dataclass(frozen=True)
class Job:
    """One run.

    Attributes
    ----------
    key : str
        Hash of everything that it depends on: mesh, problem, machine, slicing, strategy, length of
        fibre, virtual test and version.
    part : int
        Number of its part.
    load_case : str
    slicer : Slicer
    strategy : Strategy
    fibre_per_layer : float, mm, or None
    labels : mapping of column to value
        What it is called in tables: part, load_case, slicing, strategy, and the parameters that
        were given.
    """

    key: str
    part: int
    load_case: str
    slicer: Slicer
    strategy: Strategy
    fibre_per_layer: float | None
    labels: Mapping[str, Any]

    @property
    def name(self) -> str:
        """What it is called in one line."""
        told = [f"{k.partition('.')[2]} {v}" for k, v in self.labels.items() if "." in k]
        part, strategy = self.labels["part"], self.labels["strategy"]
        return f"{strategy} on {part}" + (f" ({', '.join(told)})" if told else "")


@dataclass(frozen=True)
class Jobs:
    """All runs of a study.

    Attributes
    ----------
    parts : tuple of Part
    jobs : tuple of Job
        Each once.
    repeated : int
        Runs that were named more than once.
    """

    parts: tuple[Part, ...]
    jobs: tuple[Job, ...]
    repeated: int


def jobs_of(study: Study, progress: Progress = silent) -> Jobs:
    """Read all parts of a study and list its runs: nothing is solved, and nothing is written.

    Raises
    ------
    InputError
        For parts, slicings and strategies that do not exist, and parameters that they do not take.
    """
    slicings = _slicings(study)
    parts: list[Part] = []
    jobs: dict[str, Job] = {}
    repeated = 0
    whole = fingerprint(study.virtual_test, study.strand, study.backend, version("ccfem"))
    for label, variant, given in _entries(study.parts, "parts", Case):
        progress(f"reading {label}", 0.0)
        case = _case(study, variant) if given is None else given
        for load_case in study.load_cases:
            check_known(f"load case of {case.name}", load_case, case.problem.cases)
        if not case.problem.cases:
            raise InputError(f"part '{label}' has no load case: give it at least one load")
        part = Part(case, study.load_cases or case.problem.cases[:1])
        number = len(parts)
        parts.append(part)
        strategies = _strategies(study, case)
        about = fingerprint(
            whole,
            *(case.problem, case.build, case.machine, case.alternative_supports),
            # Only where there is one, so that runs from before it was known stay known.
            *([] if case.fibre is None else [case.fibre]),
        )
        named = {"part": label, **_dotted("part", variant)}
        for (cut, slicer), load_case, (strategy, values), length in itertools.product(
            slicings, part.load_cases, strategies, study.fibre_per_layer or (None,)
        ):
            chosen = case.slicing if slicer is None else slicer
            key = fingerprint(about, load_case, chosen, values, length)
            labels = {**named, "load_case": load_case, **cut, **strategy}
            if length is not None:
                labels["study.fibre_per_layer"] = length
            repeated += key in jobs
            jobs.setdefault(key, Job(key, number, load_case, chosen, values, length, labels))
    return Jobs(tuple(parts), tuple(jobs.values()), repeated)


def _entries(entries: tuple[Any, ...], where: str, kind: Any) -> list[tuple[str, Variant, Any]]:
    """Label, variant and, where it was given itself, value of all entries."""
    found: list[tuple[str, Variant, Any]] = []
    for entry in entries:
        if isinstance(entry, kind):
            name = entry.name if isinstance(entry, Case) else member_name(entry)
            found.append((name, Variant(name, {}), entry))
        else:
            found += [(each.name, each, None) for each in variants(entry, where)]
    return found


def _dotted(owner: str, variant: Variant) -> dict[str, Any]:
    """Parameters of a variant as columns of a table."""
    return {f"{owner}.{name}": _plain(value) for name, value in variant.parameters.items()}


def _plain(value: Any) -> Any:
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _case(study: Study, variant: Variant) -> Case:
    """Case of a name, or of a part file beside the study file."""
    name = variant.name
    if name.endswith(".toml"):
        name = str(study.folder / name)
    return read(name, **variant.parameters)


def _slicings(study: Study) -> list[tuple[dict[str, Any], Slicer | None]]:
    """Labels and slicers; no slicer for a part's own."""
    found: list[tuple[dict[str, Any], Slicer | None]] = []
    for label, variant, given in _entries(study.slicings, "slicings", Slicer):
        if given is None and not variant.parameters:
            given = slicing.from_text(variant.name)
        elif given is None:
            given = slicing.create(variant.name, variant.parameters)
        found.append(({"slicing": label, **_dotted("slicing", variant)}, given))
    return found or [({"slicing": "own"}, None)]


def _strategies(study: Study, case: Case) -> list[tuple[dict[str, Any], Strategy]]:
    """Labels and strategies on one part."""
    found = []
    strategies = (LayerStrategy, PartStrategy)
    for label, variant, given in _entries(study.strategies, "strategies", strategies):
        labels = {"strategy": label}
        if given is None:
            own = case.parameters.get(variant.name, {})
            given = create(variant.name, {**own, **variant.parameters})
            labels |= _dotted("strategy", variant)
        else:
            labels |= {f"strategy.{k}": _plain(v) for k, v in vars(given).items()}
        found.append((labels, given))
    return found
