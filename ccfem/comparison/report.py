"""The report of a comparison: one HTML file that holds everything, pictures included."""

from collections.abc import Mapping, Sequence
from typing import Any

from ccfem.comparison.curve_section import curve_section
from ccfem.comparison.html import figure, grid
from ccfem.comparison.pictures import Pictures
from ccfem.comparison.report_sections import (
    against_each_other,
    all_indices,
    computation,
    glossary,
    header,
    headline_section,
    page,
    parameters_section,
    reproduce,
)
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.layers.layer import Layer

__all__ = ["report_html"]


def report_html(
    comparison: Comparison,
    record: Mapping[str, Any],
    pictures: Pictures,
) -> str:
    """Return the report as one HTML text that needs no other file.

    Parameters
    ----------
    comparison : Comparison
    record : mapping
        What `ccfem.comparison.record.record` returns.
    pictures : Pictures

    Returns
    -------
    str
    """
    sections = [
        _header(comparison, record),
        headline_section(comparison, comparison.fibre_per_layer, comparison.verdicts),
        curve_section(comparison.curve, pictures.curve),
        against_each_other(comparison),
        _pictures(comparison, pictures),
        all_indices(comparison),
        parameters_section(comparison),
        computation(comparison, record),
        glossary(),
        reproduce(record),
    ]
    return page(comparison.case.title, sections)


def _header(comparison: Comparison, record: Mapping[str, Any]) -> str:
    amount = (
        "each strategy lays its own amount of fibre"
        if comparison.fibre_per_layer is None
        else f"{comparison.fibre_per_layer:.0f} mm of fibre per layer"
    )
    return header(comparison, record, [f"{record['case']['layers']} layers", amount])


def _pictures(comparison: Comparison, pictures: Pictures) -> str:
    runs = [run for run in comparison.ranking if run.evaluation is not None]
    drawn = {index for _, index in pictures.paths}
    places = {layer.index: _place(layer) for layer in comparison.layers if layer.index in drawn}
    rows = [_layer(index, place, runs, pictures) for index, place in places.items()]
    every = ""
    if len(rows) > 1:
        every = f"<details><summary>All {len(rows)} layers</summary>\n{''.join(rows)}</details>\n"
    tension = figure(pictures.tension, "tension in the middle layer")
    error = figure(pictures.error, "estimated error of the cells in the middle layer")
    part = figure(pictures.part, "patches, resultants of the loads, supports (triangles)")
    return (
        f"<h2>Paths</h2>\n{_layer(pictures.middle, places[pictures.middle], runs, pictures)}"
        f"{every}{_forces(runs, pictures)}{_curves(pictures)}"
        f"<h2>Tension without fibres</h2>\n{grid([tension, error, '', ''])}\n"
        f"<h2>The part</h2>\n{grid([part])}\n"
    )


def _place(layer: Layer) -> str:
    """Where a layer is, in words."""
    if layer.flat is None:
        return "curved, laid flat"
    return f"at {layer.flat.height:.2f} mm along the build direction"


def _layer(index: int, place: str, runs: Sequence[Run], pictures: Pictures) -> str:
    """One layer of every run side by side."""
    figures = [
        figure(pictures.paths[run.name, index], f"{run.name}, layer {index}") for run in runs
    ]
    title = f"<h3>Layer {index}, {place}</h3>"
    return f"{title}{grid(figures)}\n"


def _forces(runs: Sequence[Run], pictures: Pictures) -> str:
    if not pictures.forces:
        return ""
    figures = [
        figure(pictures.forces[run.name], f"{run.name}, force in the fibres")
        for run in runs
        if run.name in pictures.forces
    ]
    return (
        "<h2>Force in the fibres</h2>\n"
        '<p class="note">Predicted axial force, fibres carrying tension only, in layer '
        f"{pictures.middle}; the mark is where the part first fails, on whatever layer.</p>\n"
        f"{grid(figures)}\n"
    )


def _curves(pictures: Pictures) -> str:
    curves = [
        figure(pictures.matching, "share of the fibre within an angle of the stress"),
        figure(pictures.curvature, "share of the fibre below a curvature"),
        "",
    ]
    return (
        "<h2>Direction and curvature</h2>\n"
        '<p class="note">Share of the fibre\'s length within an angle of the in-plane principal '
        "stress of the larger size, and share of it that is straighter than a curvature; all "
        f"layers.</p>\n{grid(curves)}\n"
    )
