"""The report of a comparison: one HTML file that holds everything and draws itself."""

import dataclasses
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import spared
from ccfem.base.tensor import von_mises
from ccfem.cases.inspection import Check, check
from ccfem.comparison.bed_print import BedPrint
from ccfem.comparison.citations import bibtex, cited, methods_of, sentence
from ccfem.comparison.headline import TEST_COLUMNS
from ccfem.comparison.plot.colours import palette
from ccfem.comparison.plot.curves import breaking_picture
from ccfem.comparison.plot.part_picture import coloured, drawn_arrows, load_arrows, support_marks
from ccfem.comparison.plot.values import image
from ccfem.comparison.report.charts import curve_charts, fronts, spreads
from ccfem.comparison.report.deformed_view import deformed
from ccfem.comparison.report.layer_view import layer_views
from ccfem.comparison.report.packing import Rounded, compressed, pack
from ccfem.comparison.report.print_view import print_views
from ccfem.comparison.result import Comparison
from ccfem.comparison.table import (
    FIRST_REMARKS,
    Table,
    against_each_other,
    all_indices,
    breaking_table,
    curve_table,
    headline_table,
    load_cases_table,
    stage_seconds,
)
from ccfem.fem.elasticity.stress_field import StressField, about_cells
from ccfem.judging.evaluation import COLUMNS
from ccfem.judging.virtual_testing.progressive_failure import WORTH, BreakingLoad
from ccfem.judging.virtual_testing.stiffness_test import HONEST_PROMISE


class CaseRecord(TypedDict, total=False):
    """What ``results.json`` says of the part."""

    layers: int
    load_case: str
    load: list[float] | None
    material: str
    cells: int
    order: int


class Record(TypedDict, total=False):
    """What the report takes from ``results.json``."""

    ccfem: str
    command: str
    made: str
    versions: Mapping[str, str]
    case: CaseRecord
    solver: Mapping[str, Any]
    strain_energy: float
    seconds: dict[str, float]
    left_out: list[str]
    files: list[str]


def bed_html(bed: BedPrint, record: Record, left_out: list[str]) -> str:
    """Return the report of parts that are printed together as one HTML text, as `report_html`.

    Parameters
    ----------
    left_out : list of str
        Views that fail are added.
    """
    runs = bed.runs
    data: dict[str, Any] = {"part": None, "layers": {"stacks": []}, "print": {"runs": []}}
    data |= {"charts": {}, "breaking": [], "table": dataclasses.asdict(bed.table)}
    with spared("view of the print", left_out):
        data["print"] = print_views([bed])
    named = [replace(run, name=name) for name, run in runs.items()]
    context = {
        "title": ", ".join(bed.comparisons),
        "facts": [f"{bed.print_plan.copies} parts in one file", "units: mm, N, MPa"],
        "left_out": left_out,
        "parts": bed.table,
        "remarks": bed.print_plan.warnings,
        "standing": bed.print_plan.standing,
        "headline": _without_best(headline_table(named, None)),
        "notes": [(name, one.notes) for name, one in bed.comparisons.items() if one.notes],
        "command": record["command"],
        "versions": {"ccfem": record["ccfem"], **record["versions"]},
        "made": record["made"],
    }
    return filled_page(context, data, "bed.html.jinja")


def _without_best(table: Table) -> Table:
    """Table of different parts, of which none is better than another."""
    rows = [
        (name, tuple(replace(cell, best=False) for cell in cells), why)
        for name, cells, why in table.rows
    ]
    return replace(table, rows=tuple(rows))


def report_html(comparison: Comparison, record: Record, part_file: str = "") -> str:
    """Return the report as one HTML text that needs no other file and no network.

    Parameters
    ----------
    record : mapping
        What ``results.json`` holds; a view that fails is added to its "left_out".
    part_file : str
        Text of the part file, where there is one.
    """
    several, curve = comparison.over_slicings, comparison.curve
    strategies = palette(run.strategy_name for run in comparison.runs)
    colours = palette(run.name for run in comparison.runs) if several else strategies
    ranked = [run for run in comparison.ranking if run.evaluation is not None]
    checked = check(comparison.case)
    radius = comparison.case.machine.minimum_radius
    left_out = record["left_out"]
    charts: dict[str, Any] = {"curve": [], "fronts": [], "spreads": []}
    data: dict[str, Any] = {"part": None, "layers": {"stacks": []}, "charts": charts}
    data |= {"print": {"runs": []}, "breaking": [], "part_file": part_file}
    headline = headline_table(comparison.ranking, comparison.wanted, several)
    data["table"] = dataclasses.asdict(headline.first)
    with spared("view of the part", left_out):
        data["part"] = part_view(checked, comparison.stress)
    with spared("view of layers and paths", left_out):
        data["layers"] = layer_views(comparison.slicings, strategies)
    with spared("view of the print", left_out):
        data["print"] = print_views(ranked)
    with spared("steps of the breaking load", left_out):
        data["breaking"] = breaking_views(comparison.broken, comparison.stress.mesh.centres)
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
        "patches": checked.patches,
        "loads": checked.loads,
        "verdicts": comparison.verdicts,
        "headline": headline,
        "colours": colours,
        "left_out": left_out,
        "remarks": comparison.notes,
        "first": FIRST_REMARKS,
        "promise": HONEST_PROMISE if any(run.tested is not None for run in ranked) else "",
        "has_curve": curve is not None,
        "curve_said": _about_curve(comparison),
        "curve_table": curve_table(curve),
        "breaking": _breaking(comparison, colours, left_out),
        "against": against_each_other(comparison.ranking),
        "load_cases": load_cases_table(comparison.ranking),
        "indices": all_indices(comparison.ranking),
        "parameters": _parameters(comparison),
        "machine": _machine(comparison),
        "part_file": part_file,
        "computation": _computation(comparison, record),
        "solver": _rows(record["solver"]),
        "stages": ", ".join(f"{what} {value:.2f}" for what, value in record["seconds"].items()),
        "seconds": stage_seconds(comparison.runs),
        "glossary": (*TEST_COLUMNS, *COLUMNS),
        "citations": [sentence(key) for key in keys],
        "bibtex": bibtex(keys),
        "command": record["command"],
        "versions": {"ccfem": record["ccfem"], **record["versions"]},
        "made": record["made"],
    }
    return filled_page(context, data)


def _facts(comparison: Comparison, record: Record) -> list[str]:
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
        "units: mm, N, MPa",
    ]


def _load_text(record: Record) -> str:
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


def _breaking(
    comparison: Comparison, colours: Mapping[str, str], left_out: list[str]
) -> dict[str, Any]:
    """Picture and table of breaking loads, what is said of them, their worth; empty without any."""
    broken = comparison.broken
    if not broken:
        return {}
    picture = ""
    with spared("picture of the breaking load", left_out):
        picture = image(breaking_picture(broken, colours))
    lines = [f"{name}: {load.said}" for name, load in broken.items()]
    return {"picture": picture, "said": lines, "worth": WORTH, "table": breaking_table(broken)}


def _parameters(comparison: Comparison) -> list[tuple[str, list[tuple[str, str, bool]]]]:
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


def _computation(comparison: Comparison, record: Record) -> list[str]:
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


# How parts break, step by step: what has failed at each row of a curve.


_MOST_FAILED = 6000
"""Cracked cells, and pieces of broken strand, that are drawn of a part; of more, an even share."""


def breaking_views(broken: Mapping[str, BreakingLoad], centres: FloatArray) -> list[dict[str, Any]]:
    """Return what the page draws of breaking loads.

    Parameters
    ----------
    centres : (m, 3) array, mm
        Of the cells of the part.

    Returns
    -------
    list of dict
        Of each part its ``name``, the columns of its curve, and the places of ``cells`` that crack,
        of pieces of ``strands`` that break and of ``layers`` that part, with the rows at which they
        do.
    """
    return [
        {
            "name": name,
            "force": load.curve.force,
            "displacement": load.curve.displacement,
            "cracks": load.curve.cracks,
            "broken": load.curve.broken,
            "parted": load.curve.parted,
            "cells": _failed(centres, load.curve.cracked_at),
            "strands": _failed(load.strands.middle, load.curve.broken_at),
            "layers": _failed(centres, load.curve.parted_at),
        }
        for name, load in broken.items()
    ]


def _failed(places: FloatArray, row: IntArray) -> dict[str, Any]:
    """Places (k, 3) of what fails, in the order of its rows."""
    failed = np.flatnonzero(row >= 0)
    failed = failed[np.argsort(row[failed], kind="stable")]
    failed = failed[:: max(1, -(-len(failed) // _MOST_FAILED))]
    size = float(np.linalg.norm(np.ptp(places, axis=0))) if len(places) else 1.0
    return {"points": Rounded(places[failed], 1e-4 * size), "row": row[failed]}


# The page itself: a template filled with texts, and the data and programs that it holds.


def filled_page(
    context: Mapping[str, Any], data: Mapping[str, Any], template: str = "report.html.jinja"
) -> str:
    """Fill the template of a report.

    Parameters
    ----------
    context : mapping
        What the template names. All texts are escaped.
    data : mapping
        What the page draws: see `ccfem.comparison.report.packing.pack`.

    Returns
    -------
    str
        HTML that needs no other file and no network.
    """
    return (
        _templates()
        .get_template(template)
        .render(
            **context,
            style=_text("report.css"),
            script=_text("report.js"),
            data=pack(data),
            plotly=_plotly(),
        )
    )


def _text(name: str) -> str:
    return files("ccfem.comparison.report").joinpath(name).read_text(encoding="utf-8")


@cache
def _templates() -> Any:
    """Templates with all texts escaped; a name that nothing is given for is an error."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    return Environment(
        loader=FunctionLoader(_text),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


@cache
def _plotly() -> str:
    """Return the drawing library that the package plotly ships, compressed."""
    return compressed(files("plotly").joinpath("package_data", "plotly.min.js").read_bytes())


# The part as the report draws it: patches, loads, supports, and how it deforms.


_FACETS = 16_000
"""Facets that are drawn; a part with more is drawn coarser."""


def part_view(checked: Check, stress: StressField) -> dict[str, Any]:
    """Return what the page draws of a part.

    Parameters
    ----------
    stress : StressField
        Of the load case that counts, without fibre.

    Returns
    -------
    dict
        A tree for `ccfem.comparison.report.packing.pack`.
    """
    mesh = checked.case.problem.mesh
    colours, labels = coloured(checked)
    known = list(dict.fromkeys(colours))
    shade = np.array([known.index(colour) for colour in colours], dtype=np.uint8)
    used, triangles = np.unique(mesh.boundary[:, :3], return_inverse=True)
    points = mesh.points[used]
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    # The corners of quadratic cells come before the middles of their edges.
    same = np.array_equal(stress.mesh.points[: len(mesh.points)], mesh.points)
    moved = stress.displacement[used] if same else None
    kept, triangles, drawn = _coarser(points, triangles.reshape(-1, 3), shade, size)
    corners = mesh.points[mesh.boundary[:, :3]]
    view = {
        "points": Rounded(points[kept], 1e-4 * size),
        "triangles": triangles,
        "colours": known,
        "colour": drawn,
        "size": size,
        "labels": [{"text": label.text, "at": label.place.tolist()} for label in labels],
        "supports": support_marks(checked, stress.case).tolist(),
        "arrows": drawn_arrows(load_arrows(checked, stress.case), 0.25 * size, corners),
        "coarser": len(kept) < len(points),
    }
    if moved is not None:
        most = float(np.linalg.norm(stress.displacement, axis=1).max(initial=0.0))
        view |= deformed(moved, most, von_mises(stress.nodal[used]), kept, size)
    return view


def _coarser(
    points: FloatArray, triangles: IntArray, shade: NDArray[np.uint8], size: float
) -> tuple[IntArray, IntArray, NDArray[np.uint8]]:
    """Merge points that share a cell of a grid until few enough facets are left.

    Returns the points that stay, and the facets and their colours.
    """
    if len(triangles) <= _FACETS:
        return np.arange(len(points)), triangles, shade
    side = size / 120.0
    while True:
        _, first, number = np.unique(
            np.floor(points / side).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        merged = number.reshape(-1)[triangles]
        whole = np.all(merged != np.roll(merged, 1, axis=1), axis=1)
        if whole.sum() <= _FACETS:
            return first, merged[whole], shade[whole]
        side *= 1.25
