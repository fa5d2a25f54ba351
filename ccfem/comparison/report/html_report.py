"""The report of a comparison: one HTML file that holds everything and draws itself."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from ccfem.base.errors import spared
from ccfem.cases.inspection import check
from ccfem.comparison.citations import bibtex, cited, methods_of, sentence
from ccfem.comparison.headline import HEADLINE, HEADLINE_OF_SLICINGS, TEST_COLUMNS
from ccfem.comparison.plot.colours import palette
from ccfem.comparison.report.charts import curve_charts, fronts, spreads
from ccfem.comparison.report.filling import filled_page
from ccfem.comparison.report.layer_view import layer_views
from ccfem.comparison.report.part_view import part_view
from ccfem.comparison.report.report_tables import (
    against_each_other,
    all_indices,
    curve_table,
    headline_table,
    load_cases_table,
    stage_seconds,
)
from ccfem.comparison.result import Comparison
from ccfem.fem.elasticity.stress_field import about_cells
from ccfem.judging.evaluation import COLUMNS
from ccfem.judging.virtual_testing.stiffer import HONEST_PROMISE


def report_html(
    comparison: Comparison,
    record: Mapping[str, Any],
    part_file: str = "",
) -> str:
    """Return the report as one HTML text that needs no other file and no network.

    Parameters
    ----------
    comparison : Comparison
    record : mapping
        What ``results.json`` holds; a view that fails is added to its "left_out".
    part_file : str
        Text of the part file, where there is one.

    Returns
    -------
    str
    """
    several, curve = comparison.over_slicings, comparison.curve
    strategies = palette(run.strategy_name for run in comparison.runs)
    colours = palette(run.name for run in comparison.runs) if several else strategies
    ranked = [run for run in comparison.ranking if run.evaluation is not None]
    checked = check(comparison.case)
    radius = comparison.case.machine.minimum_radius
    left_out: list[str] = record["left_out"]
    charts: dict[str, Any] = {"curve": [], "fronts": [], "spreads": []}
    data: dict[str, Any] = {"part": None, "layers": {"stacks": []}, "charts": charts}
    with spared("view of the part", left_out):
        data["part"] = part_view(checked, comparison.stress)
    with spared("view of layers and paths", left_out):
        data["layers"] = layer_views(comparison.slicings, strategies)
    with spared("curve", left_out):
        charts["curve"] = curve_charts(curve, colours)
    with spared("fronts", left_out):
        charts["fronts"] = fronts(ranked, colours)
    with spared("spreads", left_out):
        charts["spreads"] = list(spreads(ranked, colours, radius)) if ranked else []
    keys = cited(methods_of(record))
    context = {
        "title": comparison.case.title,
        "facts": _facts(comparison, record),
        "source": comparison.case.source,
        "findings": (*comparison.case.findings, *comparison.stress.findings),
        "load_text": _load_text(record),
        "patches": checked.patches,
        "loads": checked.loads,
        "verdicts": comparison.verdicts,
        "headline": headline_table(
            comparison, comparison.wanted, HEADLINE_OF_SLICINGS if several else HEADLINE
        ),
        "colours": colours,
        "left_out": left_out,
        "remarks": comparison.remarks,
        "promise": HONEST_PROMISE if any(run.tested is not None for run in ranked) else "",
        "has_curve": curve is not None,
        "curve_said": _about_curve(comparison),
        "curve_table": curve_table(curve),
        "against": against_each_other(comparison),
        "load_cases": load_cases_table(comparison),
        "indices": all_indices(comparison),
        "parameters": _parameters(comparison),
        "machine": _machine(comparison),
        "part_file": part_file,
        "computation": _computation(comparison, record),
        "solver": _rows(record["solver"]),
        "stages": ", ".join(f"{what} {value:.2f}" for what, value in record["seconds"].items()),
        "seconds": stage_seconds(comparison),
        "glossary": (*TEST_COLUMNS, *COLUMNS),
        "citations": [sentence(key) for key in keys],
        "bibtex": bibtex(keys),
        "command": record["command"],
        "versions": {"ccfem": record["ccfem"], **record["versions"]},
        "made": record["made"],
    }
    return filled_page(context, data)


def _facts(comparison: Comparison, record: Mapping[str, Any]) -> list[str]:
    """Say in few words what was compared."""
    about = record["case"]
    if comparison.over_slicings:
        stacks = [f"{name}: {len(layers)} layers" for name, layers in comparison.stacks.items()]
        amount = "each run lays its own amount of fibre"
        if comparison.fibre is not None:
            amount = f"{1e-3 * comparison.fibre:.2f} m of fibre in all"
    else:
        stacks = [f"{about['layers']} layers"]
        amount = "each strategy lays its own amount of fibre"
        if comparison.fibre_per_layer is not None:
            amount = f"{comparison.fibre_per_layer:.0f} mm of fibre per layer"
    others = len(comparison.cases) - 1
    return [
        f"load case “{about['load_case']}”{_load_text(record)}"
        + (f", together with {others} more" if others else ""),
        f"{about['cells']:,} tetrahedra of order {about['order']}",
        *stacks,
        amount,
        f"fibre width W {comparison.case.machine.fibre_width:g} mm",
    ]


def _load_text(record: Mapping[str, Any]) -> str:
    load = record["case"]["load"]
    return "" if load is None else f", in all ({', '.join(f'{x:.4g}' for x in load)}) N"


def _about_curve(comparison: Comparison) -> str:
    if comparison.curve is None:
        return ""
    common = ", ".join(f"{length:.0f}" for length in comparison.curve.common)
    return (
        f"All strategies reach {common} mm a layer."
        if common
        else "No length is within reach of all strategies."
    )


def _parameters(
    comparison: Comparison,
) -> list[tuple[str, list[tuple[str, str, bool]]]]:
    """Return what every strategy was set to, and which parameter sets its amount of fibre."""
    return [
        (
            run.name,
            [
                (key, _short(value), key == run.strategy.amount.parameter)
                for key, value in run.parameters.items()
            ],
        )
        for run in comparison.runs
    ]


def _machine(comparison: Comparison) -> list[tuple[str, str]]:
    values = vars(comparison.case.machine).items()
    return [(k, _short(v)) for k, v in values if v is not None and k != "gcode"]


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.5g}"
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        inner = (f"{f.name}={_short(getattr(value, f.name))}" for f in dataclasses.fields(value))
        return f"{type(value).__name__}({', '.join(inner)})"
    return str(value)


def _computation(comparison: Comparison, record: Mapping[str, Any]) -> list[str]:
    """Say what was computed how."""
    solver = record["solver"]
    return [
        f"Solve: {solver['backend']}, {solver['unknowns']:,} unknowns, "
        + (f"{solver['iterations']} iterations, " if solver["iterations"] else "direct, ")
        + f"relative residual {solver['residual']:.1e}, assembly "
        f"{solver['assembly_seconds']:.2f} s, solve {solver['solve_seconds']:.2f} s.",
        f"{about_cells(comparison.stress)}; backward error of the equations "
        f"{solver['backward_error']:.1e}.",
        f"Material: {record['case']['material']}. Strain energy "
        f"{record['strain_energy']:.4g} N mm.",
    ]


def _rows(values: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the entries of a record that say something."""
    shown = {k: v for k, v in values.items() if v not in (None, "")}
    return [(k.replace("_", " "), f"{v:.4g}" if isinstance(v, float) else f"{v:,}" if
             isinstance(v, int) else str(v)) for k, v in shown.items()]  # fmt: skip
