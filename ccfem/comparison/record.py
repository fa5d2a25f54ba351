"""The record of a comparison: all its numbers as a table, and what it takes to repeat it."""

import dataclasses
import platform
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.base.checks import member_name
from ccfem.base.csv_table import write_csv
from ccfem.comparison.headline import TEST_COLUMNS, headline_values
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.fem.elasticity.stress_field import StressField

_FIRST = ("slicing", "strategy", "layer", "failure", "printable", "why_not")

_PACKAGES = ("numpy", "scipy", "numba", "pyamg", "shapely", "pypardiso")


def results_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Every index of every run: one row per layer, and one in total.

    Columns are slicing where several are compared, strategy, layer ("total" or its index), failure,
    printable, why_not (what keeps the paths from being printed), the evaluator's columns, and those
    of the virtual test. Printable, why_not and the virtual test are of the whole part, and stand in
    the total rows only. A failed strategy has its total row, with the reason and no numbers. A row
    holds what it has a value for.
    """
    rows: list[dict[str, Any]] = []
    for run in comparison.runs:
        own = {"slicing": run.slicing} if comparison.over_slicings else {}
        own |= {"strategy": run.strategy_name}
        if run.evaluation is None:
            rows.append({**own, "layer": "total", "failure": run.failure, "printable": False})
            continue
        values = run.evaluation.values
        for k, layer in enumerate((*run.evaluation.layers, "total")):
            found = {name: value[k].item() for name, value in values.items()}
            rows.append({**own, "layer": layer, "failure": "", **found})
        extra = headline_values(run)
        tested = (column.name for column in TEST_COLUMNS)
        rows[-1] |= {name: extra[name] for name in tested if name in extra}
        rows[-1] |= {"printable": run.printable, "why_not": run.why_not, "fails_in": run.fails_in}
        if run.tested is not None and run.tested.cases is not None:
            rows[-1] |= run.tested.cases.values()
    return rows


def _columns(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Columns of rows: who, where and why not first, then in the order in which they occur."""
    names = [name for row in rows for name in row]
    return list(dict.fromkeys([*(n for n in _FIRST if n in names or n != "slicing"), *names]))


def write_table(rows: Sequence[Mapping[str, Any]], file: Path) -> None:
    """Write rows as CSV; what is missing or not a number is empty.

    Pandas, which takes a second to be imported, is not needed for this.
    """
    columns = _columns(rows)
    write_csv(file, columns, ([row.get(name) for name in columns] for row in rows))


def record(comparison: Comparison, command: str, seconds: Mapping[str, float]) -> dict[str, Any]:
    """Everything that it takes to judge and repeat a comparison, ready for JSON.

    Parameters
    ----------
    comparison : Comparison
    command : str
        What was typed, or how the comparison was made.
    seconds : mapping of stage to float
        Stages outside the comparison.

    Returns
    -------
    dict
        Versions, case, machine, mesh, solver record, stage times, and per strategy its parameters,
        note, failure, times and total indices.
    """
    case, stress = comparison.case, comparison.stress
    mesh = stress.mesh
    about: dict[str, Any] = {
        "ccfem": version("ccfem"),
        "command": command,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": _versions(),
        "case": {
            "name": case.name,
            "title": case.title,
            "source": case.source,
            "findings": (*case.findings, *stress.findings),
            "load_case": stress.case,
            "load": _load(stress),
            "material": case.problem.material.name,
            "build": case.build,
            "nodes": len(mesh.points),
            "cells": len(mesh.cells),
            "order": mesh.order,
        },
        "machine": dataclasses.asdict(case.machine),
        "solver": vars(stress.record),
        "planned_on_given_stress": comparison.given is not None,
        "strain_energy": stress.strain_energy,
        "seconds": {**seconds, **comparison.seconds},
    }
    if comparison.over_slicings:
        return _plain(about | _of_slicings(comparison))
    about["case"] |= _of_layers(comparison)
    return _plain(about | _of_strategies(comparison) | _of_bound(comparison))


def _of_layers(comparison: Comparison) -> dict[str, Any]:
    layers = comparison.layers
    heights = [None if layer.flat is None else layer.flat.height for layer in layers]
    return {"layers": len(layers), "heights": heights}


def _of_strategies(comparison: Comparison) -> dict[str, Any]:
    """Say what cut the layers, how much fibre lies on them, and what each strategy did."""
    slicer = comparison.request.slicings[""].slicer or comparison.case.slicing
    return {
        "slicer": member_name(slicer),
        "fibre_per_layer": comparison.fibre_per_layer,
        "strategies": [_run_record(run) for run in comparison.runs],
    }


def _of_bound(comparison: Comparison) -> dict[str, Any]:
    """Say what no paths exceed, and what was compared at several lengths."""
    alone = None if comparison.several_cases else comparison.bound
    curve = comparison.curve
    return {
        "upper_bound": None if alone is None else alone.ratio,
        "upper_bound_gap": None if alone is None else alone.duality_gap,
        "load_cases": _load_cases(comparison) if comparison.several_cases else None,
        "curve": None if curve is None else curve.frame.to_dict(orient="records"),
    }


def _of_slicings(comparison: Comparison) -> dict[str, Any]:
    """Say what was done on each slicing."""
    return {
        "fibre": comparison.fibre,
        "verdict": comparison.verdict,
        "remarks": comparison.remarks,
        "refused": dict(comparison.refused),
        "slicings": {
            name: _of_layers(alone) | _of_strategies(alone)
            for name, alone in comparison.slicings.items()
        },
    }


def _load_cases(comparison: Comparison) -> dict[str, Any]:
    """Say what each load case counts, and what no paths exceed."""
    cases, bound = comparison.cases, comparison.bound
    weights = dict(zip(cases.names, cases.weights.tolist(), strict=True))
    if bound is None:
        return {"weights": weights, "bound": None}
    kept = ("objective", "singles", "case_weights", "least", "factors")
    said = {name: getattr(bound, name) for name in kept} | {"reached": bound.attained}
    return {"weights": weights, "bound": said}


def _load(stress: StressField) -> list[float] | None:
    """Resultant that the supports hold, N; None where nothing is left over, as between grips."""
    total = -stress.reactions.sum(axis=0)
    size = float(np.linalg.norm(total))
    if not size > 1e-6 * float(np.linalg.norm(stress.reactions, axis=1).sum()):
        return None
    return [float(size * share) for share in np.round(total / size, 6) + 0.0]


def _run_record(run: Run) -> dict[str, Any]:
    return {
        "name": run.name,
        "methods": _methods(run),
        "parameters": run.parameters,
        "length_per_layer": run.length_per_layer,
        "note": run.note,
        "failure": run.failure,
        "printable": run.printable,
        "why_not": run.why_not,
        "seconds": run.seconds,
        "untested": run.untested,
        "total": headline_values(run),
        "load_cases": run.tested.cases.values() if run.tested and run.tested.cases else None,
        "first_failure": vars(run.tested.failure) if run.tested and run.tested.failure else None,
        "first_failure_alternative": _alternative_failure(run),
    }


def _methods(run: Run) -> list[str]:
    """Name the strategy of a run, and those that stand among its parameters."""
    inner = [value for value in run.parameters.values() if dataclasses.is_dataclass(value)]
    return [member_name(each) for each in (run.strategy, *inner)]


def _alternative_failure(run: Run) -> dict[str, Any] | None:
    """Say what fails first under the alternative supports; None where there are none."""
    other = None if run.tested is None else run.tested.alternative
    return vars(other.failure) if other is not None and other.failure is not None else None


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version(), "system": platform.platform()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def _plain(value: Any) -> Any:
    """Turn mappings, arrays and numbers into what JSON holds; NaN and infinity become null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)
