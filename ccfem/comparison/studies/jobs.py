"""The runs of a study, one by one, each with the hash that it is stored under."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, NamedTuple, TypedDict

from ccfem.base.checks import check_known, member_name
from ccfem.base.errors import InputError, Mistakes, shown
from ccfem.base.progress import Progress, silent
from ccfem.cases.case import Case
from ccfem.cases.reading import read
from ccfem.comparison.studies.definition import Study
from ccfem.comparison.studies.fingerprint import fingerprint
from ccfem.paths.planning.strategy import LayerStrategy, PartStrategy, Strategy
from ccfem.slicing import slicers as slicing
from ccfem.slicing.layers.slicer import Slicer
from ccfem.strategies import create

# Sweeps: one entry of a study, and the variants that it stands for.


class Variant(NamedTuple):
    """A name with parameters."""

    name: str  # of a case, part file, slicer or strategy
    parameters: dict[str, Any]


def variants(entry: str | Mapping[str, Any], where: str) -> list[Variant]:
    """List the variants of an entry.

    Parameters
    ----------
    entry : str or mapping
        A name, or ``name``, parameters, and ``sweep``: a table of lists, of which every
        combination is one variant (a grid), or a list of tables, of which each is one.
    where : str
        Place in the study, for the messages.

    Raises
    ------
    InputError
        For an entry without a name, a sweep without values, one that is neither a table of lists
        nor a list of tables, and one over a parameter that has a value already.

    Examples
    --------
    >>> entry = {"name": "isocurve", "cap": 90.0, "sweep": {"density": [1.0, 2.0]}}
    >>> [each.parameters for each in variants(entry, "strategies")]
    [{'cap': 90.0, 'density': 1.0}, {'cap': 90.0, 'density': 2.0}]
    """
    if isinstance(entry, str):
        entry = {"name": entry}
    if not isinstance(entry, Mapping) or not isinstance(entry.get("name"), str):
        raise InputError(
            f"{where} must be a name, or a table with name, parameters and sweep; got "
            f"{shown(entry)}: give its name"
        )
    fixed = {key: value for key, value in entry.items() if key not in ("name", "sweep")}
    where = f"{where} '{entry['name']}'"
    if "sweep" not in entry:
        return [Variant(entry["name"], fixed)]
    variants_of_entry = []
    for values in _swept(entry["sweep"], where):
        twice = sorted(set(values) & set(fixed))
        if twice:
            raise InputError(
                f"{where} has a value and a sweep of '{twice[0]}': drop one of the two"
            )
        variants_of_entry.append(Variant(entry["name"], {**fixed, **_nested(values)}))
    return variants_of_entry


def _swept(sweep: object, where: str) -> Iterator[dict[str, Any]]:
    """Values of each variant of a sweep, by their parameters."""
    if isinstance(sweep, list | tuple):
        if not sweep or not all(isinstance(table, Mapping) and table for table in sweep):
            raise InputError(
                f"sweep of {where} must be a table of lists or a list of tables; got "
                f"{shown(sweep)}: write sweep.NAME = [..] or sweep = [{{NAME = ..}}, ..]"
            )
        yield from (dict(table) for table in sweep)
        return
    axes = dict(_axes(sweep, where, ""))
    for values in itertools.product(*axes.values()):
        yield dict(zip(axes, values, strict=True))


def _axes(sweep: object, where: str, outer: str) -> Iterator[tuple[str, list[Any]]]:
    """Parameters of a grid with their values; those of inner tables with dots."""
    if not isinstance(sweep, Mapping) or not sweep:
        raise InputError(
            f"sweep of {where} must be a table of lists or a list of tables; got "
            f"{shown(sweep)}: write sweep.NAME = [..]"
        )
    for name, values in sweep.items():
        if isinstance(values, Mapping):
            yield from _axes(values, where, f"{outer}{name}.")
            continue
        if not isinstance(values, list | tuple) or not values:
            raise InputError(
                f"sweep.{outer}{name} of {where} must be a list of at least one value; got "
                f"{shown(values)}: list the values"
            )
        yield f"{outer}{name}", list(values)


def _nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Tables of names with dots."""
    nested: dict[str, Any] = {}
    for name, value in values.items():
        *outer, last = name.split(".")
        table = nested
        for key in outer:
            table = table.setdefault(key, {})
        table[last] = value
    return nested


@dataclass(frozen=True)
class Part:
    """A part with the load cases that a study runs on it: solved once."""

    case: Case
    load_cases: tuple[str, ...]


class Outcome(TypedDict, total=False):
    """What became of a run, as its file holds it; of one that crashed the reason alone."""

    ccfem: str
    failure: str
    crashed: bool
    traceback: str
    printable: bool
    why_not: str
    untested: str
    note: str
    findings: Sequence[str]
    fails_in: str
    empty_layers: int
    values: Mapping[str, float | str]
    title: str
    seconds: Mapping[str, float]


@dataclass(frozen=True)
class Job:
    """One run."""

    # Hash of everything that it depends on: mesh, problem, machine, slicing, strategy, length of
    # fibre, virtual test and version.
    key: str
    part: int  # number of its part
    load_case: str
    slicer: Slicer
    strategy: Strategy
    fibre_per_layer: float | None  # mm
    # by column: what it is called in tables: part, load_case, slicing, strategy, and the parameters
    # that were given
    labels: Mapping[str, Any]

    @property
    def name(self) -> str:
        """What it is called in one line."""
        settings = [f"{k.partition('.')[2]} {v}" for k, v in self.labels.items() if "." in k]
        part, strategy = self.labels["part"], self.labels["strategy"]
        return f"{strategy} on {part}" + (f" ({', '.join(settings)})" if settings else "")


@dataclass(frozen=True)
class Jobs:
    """All runs of a study."""

    parts: tuple[Part, ...]
    jobs: tuple[Job, ...]  # each once
    repeated: int  # runs that were named more than once


def jobs_of(study: Study, progress: Progress = silent) -> Jobs:
    """Read all parts of a study and list its runs: nothing is solved, and nothing is written.

    Raises
    ------
    InputError
        For parts, slicings and strategies that do not exist, parameters that they do not take, and
        a part that none of the slicings can cut.
    """
    slicings = _slicings(study)
    parts: list[Part] = []
    jobs: dict[str, Job] = {}
    repeated, mistakes = 0, Mistakes()
    whole = fingerprint(study.virtual_test, study.strand, study.backend, version("ccfem"))
    for label, variant, given in _entries(study.parts, "parts", Case):
        progress(f"reading {label}", 0.0)
        case = _case(study, variant) if given is None else given
        for load_case in study.load_cases:
            check_known(f"load case of {case.name}", load_case, case.problem.cases)
        if not case.problem.cases:
            raise InputError(f"part '{label}' has no load case: give it at least one load")
        if not case.plastic.solid:
            raise InputError(
                f"part '{label}' has the infill '{case.plastic.infill}', and a study solves a part "
                "once for all slicings: leave out [plastic]"
            )
        refused = [Mistakes() for _ in slicings]
        for (cut, slicer), note in zip(slicings, refused, strict=True):
            with note.noted(f"{label}, slicing {cut['slicing']}: "):
                case.check_layers(slicer)
        if all(note.lines for note in refused):  # as `compare`: of several, where none can
            mistakes.lines += [line for note in refused for line in note.lines]
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
    mistakes.complain()
    return Jobs(tuple(parts), tuple(jobs.values()), repeated)


def _entries(entries: tuple[Any, ...], where: str, kind: Any) -> list[tuple[str, Variant, Any]]:
    """Label, variant and, where it was given itself, value of all entries."""
    given_entries: list[tuple[str, Variant, Any]] = []
    for entry in entries:
        if isinstance(entry, kind):
            name = entry.name if isinstance(entry, Case) else member_name(entry)
            given_entries.append((name, Variant(name, {}), entry))
        else:
            given_entries += [(variant.name, variant, None) for variant in variants(entry, where)]
    return given_entries


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
    slicings: list[tuple[dict[str, Any], Slicer | None]] = []
    for label, variant, given in _entries(study.slicings, "slicings", Slicer):
        if given is None and not variant.parameters:
            given = slicing.from_text(variant.name)
        elif given is None:
            given = slicing.create(variant.name, variant.parameters)
        slicings.append(({"slicing": label, **_dotted("slicing", variant)}, given))
    return slicings or [({"slicing": "own"}, None)]


def _strategies(study: Study, case: Case) -> list[tuple[dict[str, Any], Strategy]]:
    """Labels and strategies on one part."""
    labelled = []
    strategies = (LayerStrategy, PartStrategy)
    for label, variant, given in _entries(study.strategies, "strategies", strategies):
        labels = {"strategy": label}
        if given is None:
            parameters = case.parameters.get(variant.name, {})
            given = create(variant.name, {**parameters, **variant.parameters})
            labels |= _dotted("strategy", variant)
        else:
            labels |= {f"strategy.{k}": _plain(v) for k, v in vars(given).items()}
        labelled.append((labels, given))
    return labelled
