"""The headline of a comparison: the few indices that tables show first."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ccfem.base.toml import read_toml
from ccfem.comparison.runs import Run, Tested
from ccfem.judging.evaluation.layer_paths import Column
from ccfem.judging.virtual_testing.failure_laws import named
from ccfem.judging.virtual_testing.scatter import RatioScatter
from ccfem.judging.virtual_testing.strength import FirstFailure


@dataclass(frozen=True)
class _Index(Column):
    """An index of the virtual test, and how it follows from the test; None where it does not."""

    value: Callable[[Tested], float | None] = lambda tested: None


def _of_failure(
    value: Callable[[FirstFailure, Tested], float | None],
) -> Callable[[Tested], float | None]:
    """Value of the first failure, where the strengths are known."""
    return lambda tested: None if tested.failure is None else value(tested.failure, tested)


def _of_bond(value: Callable[[FirstFailure], float]) -> Callable[[Tested], float | None]:
    """Value of the bond between layers, where it was judged."""
    return _of_failure(lambda f, tested: value(f) if f.interlayer_zones else None)


def _of_law(law: str, column: Column) -> _Index:
    """Load of a law of failure that has a column of its own."""
    load = _of_failure(lambda failure, tested: failure.loads.get(law))
    return _Index(column.name, column.unit, column.formula, column.range, load)


def _of_scatter(value: Callable[[RatioScatter], float]) -> Callable[[Tested], float | None]:
    """Value of the scatter of the stiffness ratio."""
    return lambda tested: None if tested.scatter is None else value(tested.scatter)


def _under_alternative(index: _Index) -> _Index:
    """Index under the alternative supports of the part."""
    return _Index(
        f"{index.name}_alternative",
        index.unit,
        f"{index.name} under the alternative supports of the part.",
        f"as {index.name}; missing where the part has none",
        lambda tested: None if tested.alternative is None else index.value(tested.alternative),
    )


_VALUES: dict[str, Callable[[Tested], float | None]] = {
    "stiffness_ratio_tension": lambda tested: tested.bracket.tension.ratio,
    "stiffness_ratio_partial": lambda tested: tested.bracket.partial.ratio,
    "stiffness_ratio_bonded": lambda tested: tested.bracket.bonded.ratio,
    "stiffness_ratio_scatter": _of_scatter(lambda scatter: scatter.deviation),
    "fibre_sensitivity": _of_scatter(lambda scatter: scatter.fibre),
    "matrix_sensitivity": _of_scatter(lambda scatter: scatter.matrix),
    "strand_scatter": _of_scatter(lambda scatter: scatter.independent),
    "stiffness": lambda tested: tested.bracket.tension.stiffness,
    "displacement": lambda tested: tested.bracket.tension.force / tested.bracket.tension.stiffness,
    "share_of_gain": lambda tested: (
        (tested.bracket.tension.ratio - 1.0) / (tested.most - 1.0) if tested.most > 1.0 else None
    ),
    "gain_per_metre": lambda tested: tested.bracket.tension.gain_per_metre,
    "strain_energy": lambda tested: tested.bracket.tension.solution.strain_energy,
    "matrix_stress_change": _of_failure(
        lambda failure, tested: failure.matrix_index / tested.matrix_before - 1.0
    ),
    "first_failure_load": _of_failure(lambda failure, tested: failure.load),
    "pinned_joint_load": lambda tested: tested.joints[0].load if tested.joints else None,
    "interlayer_load": _of_bond(lambda failure: failure.interlayer_zones[0]),
    "interlayer_load_near": _of_bond(lambda failure: failure.interlayer_zones[1]),
    "interlayer_load_everywhere": _of_bond(lambda failure: failure.interlayer_zones[2]),
    "interlayer_index": _of_bond(lambda failure: failure.interlayer_index),
    "interlayer_x": _of_bond(lambda failure: failure.interlayer_where[0]),
    "interlayer_y": _of_bond(lambda failure: failure.interlayer_where[1]),
    "interlayer_z": _of_bond(lambda failure: failure.interlayer_where[2]),
    "interlayer_opening": _of_bond(lambda failure: failure.opening),
    "interlayer_sliding": _of_bond(lambda failure: failure.sliding),
}
"""How indices follow from a test; what they mean stands in ``test_columns.toml``."""

_TESTED = (
    *(
        _Index(name, **text, value=_VALUES.get(name, lambda tested: None))
        for name, text in read_toml(Path(__file__).with_name("test_columns.toml"), "table").items()
    ),
    *(_of_law(name, law.COLUMN) for name, law in named().items() if hasattr(law, "COLUMN")),
)
_WITH_ALTERNATIVE = (
    "stiffness_ratio_tension",
    "stiffness_ratio_partial",
    "stiffness_ratio_bonded",
    "stiffness",
    "first_failure_load",
    "interlayer_load",
)

TEST_COLUMNS = (
    *_TESTED,
    *(_under_alternative(index) for index in _TESTED if index.name in _WITH_ALTERNATIVE),
)
"""Indices of the virtual test, described as those of the evaluator are."""


@dataclass(frozen=True)
class Headline:
    """One column of the headline table."""

    column: str  # name of the index
    title: str  # what tables print above it
    better: str  # "high", "low", or "" where neither is better
    pattern: str  # how a value is printed, for `str.format`


HEADLINE = (
    Headline("printable", "printable", "", "{}"),
    Headline("stiffness", "stiffness, N/mm", "high", "{:.4g}"),
    Headline("stiffness_ratio_tension", "stiffness ratio", "high", "{:.2f}"),
    Headline("share_of_gain", "share of gain", "high", "{:.0%}"),
    Headline("stiffness_ratio_bonded", "stiffness ratio, bonded", "", "{:.2f}"),
    Headline(
        "stiffness_ratio_tension_alternative", "stiffness ratio, other supports", "", "{:.2f}"
    ),
    Headline("stiffness_ratio_scatter", "scatter of the ratio", "", "± {:.0%}"),
    Headline("displacement", "displacement, mm", "low", "{:.3g}"),
    Headline("first_failure_load", "first failure, N", "high", "{:.0f}"),
    Headline("first_failure_load_alternative", "first failure, other supports, N", "", "{:.0f}"),
    Headline("pinned_joint_load", "pin tears out, N", "", "{:.0f}"),
    Headline("interlayer_load", "delamination load, N", "", "{:.0f}"),
    Headline("fibre_per_layer", "fibre, mm a layer", "", "{:.0f}"),
    Headline("fibre_mass", "fibre, g", "", "{:.3g}"),
    Headline("matrix_mass", "matrix, g", "", "{:.3g}"),
    Headline("print_time_nearest", "laying fibre, min", "low", "{:.0f}"),
    Headline("whole_print_time", "whole print, min", "low", "{:.0f}"),
    Headline("efficiency", "efficiency", "high", "{:.3f}"),
    Headline("aligned_stress_10", "within 10°, by stress", "high", "{:.1%}"),
    Headline("coverage_top_20", "coverage of top 20 % stress", "high", "{:.1%}"),
    Headline("curvature_95", "curvature 95 %, 1/mm", "low", "{:.3f}"),
    Headline("paths_per_layer", "paths a layer", "low", "{:.1f}"),
    Headline("on_fibre", "on other fibre", "low", "{:.1%}"),
    Headline("outside_width", "outside, by width", "low", "{:.1%}"),
    Headline("all_crossings", "crossings", "low", "{:.0f}"),
)
"""The columns of the headline table; those that no run has are left out."""

_OVER_SLICINGS = (
    "printable",
    "stiffness",
    "stiffness_ratio_tension",
    "stiffness_ratio_bonded",
    "stiffness_ratio_tension_alternative",
    "first_failure_load",
    "first_failure_load_alternative",
    "interlayer_load",
)

HEADLINE_OF_SLICINGS = (
    *(head for head in HEADLINE if head.column in _OVER_SLICINGS),
    Headline("interlayer_load_alternative", "delamination load, other supports, N", "", "{:.0f}"),
    Headline("joints_linked", "joints linked", "high", "{:.2f}"),
    Headline("fibre_length", "fibre, mm", "", "{:.0f}"),
    Headline("space_angle_stress", "angle to stress, degrees", "low", "{:.1f}"),
    Headline("across_tension", "tension across layers", "low", "{:.1%}"),
)
"""The columns of the table over several slicings: nothing per layer, for the layers differ."""


def headline_values(run: Run) -> Mapping[str, float]:
    """Every total index of a run, with some per layer; empty where it failed."""
    if run.evaluation is None:
        return {}
    total, layers = run.evaluation.total, max(len(run.evaluation.layers), 1)
    return {
        **_test_values(run),
        **total,
        "fibre_per_layer": total["fibre_length"] / layers,
        "paths_per_layer": total["paths"] / layers,
        "all_crossings": total["crossings"] + total["self_crossings"],
        "printable": float(run.printable),
        **print_values(run),
    }


def print_values(run: Run) -> dict[str, float]:
    """Values of a planned print, which take the place of estimates; empty where there is none."""
    if run.print_totals is None:
        return {}
    total = run.print_totals
    return {
        "printed_volume": run.printed_volume,
        "whole_print_time": total.seconds,
        "print_time_nearest": total.fibre_seconds,
        "fibre_mass": total.fibre_mass,
        "matrix_mass": total.matrix_mass,
    }


def _test_values(run: Run) -> dict[str, float]:
    """Values of the virtual test; empty where there was none."""
    if run.tested is None:
        return {}
    values = {index.name: index.value(run.tested) for index in TEST_COLUMNS}
    return {name: value for name, value in values.items() if value is not None}


def cell_text(run: Run, head: Headline) -> tuple[str, str]:
    """Text of a cell of the headline table, and what to add to it in smaller letters."""
    values = headline_values(run)
    text = value_text(values, head)
    beside = "" if text == _NONE or head.column == "printable" else head.column
    return text, _beside(run, beside, values)


_NONE = "–"


def value_text(values: Mapping[str, float | None], head: Headline) -> str:
    """Text of a value of the headline table; a dash where there is none."""
    value = values.get(head.column)
    if value is None or not np.isfinite(value):
        return _NONE
    if head.column == "printable":
        return "yes" if value else "no"
    if head.column in ("print_time_nearest", "whole_print_time"):
        value /= 60.0
    return head.pattern.format(value)


_UPPER = "stiffness_ratio_partial"
"""Column that ends the range of the stiffness ratio."""


def _beside(run: Run, column: str, values: Mapping[str, float]) -> str:
    """Text beside a value: the range of a stiffness ratio, what fails first and how."""
    if column == "stiffness_ratio_tension":
        low, high = (f"{values.get(name, np.nan):.2f}" for name in (column, _UPPER))
        return f"to {high}" if low != high else ""
    tested = run.tested
    if tested is not None and column.endswith("_alternative"):
        tested = tested.alternative
    if column.startswith("first_failure_load") and tested is not None and tested.failure:
        return tested.failure.what
    if column == "pinned_joint_load" and tested is not None:
        return tested.joints[0].mode
    return ""
