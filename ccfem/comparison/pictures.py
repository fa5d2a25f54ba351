"""All pictures of a comparison: every layer of every strategy, and the fibre forces."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ccfem.base.progress import Progress, silent
from ccfem.cases.inspection.part_check import check
from ccfem.comparison.plot.canvas import png
from ccfem.comparison.plot.colours import palette
from ccfem.comparison.plot.curves import StiffnessPoint, stiffness_curves
from ccfem.comparison.plot.fields import tension_picture
from ccfem.comparison.plot.part_picture import part_page, part_picture
from ccfem.comparison.plot.paths import (
    Coloured,
    compare_layer,
    force_on_paths,
    layer_picture,
    layer_pictures,
    mark_failure,
    tension_limit,
)
from ccfem.comparison.ranking import stiffness_ratio
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.shown import caption, drawn_layers, middle_layer
from ccfem.paths.fields.chart import chart_of, flat_view, in_charts
from ccfem.slicing.layers import Layer
from ccfem.slicing.layers.layer import LayerStress, stress_on

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Pictures:
    """PNG files of a comparison."""

    paths: dict[tuple[str, int], bytes]  # by (strategy, layer index)
    # by strategy: force in the fibres of the middle layer, where there was a virtual test
    forces: dict[str, bytes]
    tension: bytes  # tension in the middle layer
    overview: bytes  # all strategies side by side on the middle layer
    part: bytes  # the part with its patches, loads and supports
    part_page: str  # page on which it turns, HTML
    middle: int  # index of the layer that stands for all: the middle one of those with fibre
    curve: bytes = b""  # stiffness over the length of fibre; empty without a curve


def draw_pictures(comparison: Comparison, progress: Progress = silent) -> Pictures:
    """Draw every layer of every strategy that did not fail, all on one colour scale."""
    machine = comparison.case.machine
    runs = [
        replace(run, toolpaths=in_charts(run.toolpaths, comparison.layers))
        for run in comparison.succeeded
    ]
    centre = middle_layer(comparison)
    layers = [flat_view(layer) for layer in drawn_layers(comparison)]
    stresses = [stress_on(layer, comparison.planned_on) for layer in layers]
    limit = max(tension_limit(stress) for stress in stresses)
    colours = palette(run.name for run in comparison.runs)
    middle = next(of_layer for of_layer in stresses if of_layer.layer.index == centre.index)
    heading = f"tension in layer {middle.layer.index}, load case {comparison.stress.case}"
    checked = check(comparison.case)
    return Pictures(
        _layers(runs, stresses, machine.fibre_width, limit, colours, progress),
        _forces(runs, centre, machine.fibre_width, colours),
        png(tension_picture(middle, heading, "size and direction", limit)),
        png(_overview(runs, middle, machine.fibre_width, limit)),
        png(part_picture(checked)),
        part_page(checked),
        middle.layer.index,
        _curve(comparison, colours),
    )


def _curve(comparison: Comparison, colours: Mapping[str, str]) -> bytes:
    """Picture of stiffness over the length of fibre; empty where there is no curve."""
    if comparison.curve is None:
        return b""
    curves = {
        name: [
            StiffnessPoint(run.length_per_layer, stiffness_ratio(run), run.printable)
            for run in runs
        ]
        for name, runs in comparison.curve.runs.items()
        if runs
    }
    heading = "stiffness over length of fibre, tension only"
    return png(stiffness_curves(curves, comparison.curve.common, heading, colours))


def _layers(
    runs: Sequence[Run],
    stresses: Sequence[LayerStress],
    width: float,
    limit: float,
    colours: Mapping[str, str],
    progress: Progress,
) -> dict[tuple[str, int], bytes]:
    """Pictures of every layer of every run."""
    drawn = {}
    for k, stress in enumerate(stresses):
        layer = stress.layer
        progress("drawing pictures", k / len(stresses))
        paths = {run.name: run.toolpaths for run in runs}
        captions = {run.name: caption(run, layer) for run in runs}
        files = layer_pictures(layer, stress, paths, width, captions, limit, colours)
        drawn.update({(name, layer.index): file for name, file in files.items()})
    return drawn


def overview_picture(comparison: Comparison) -> "Figure":
    """Draw all strategies side by side on the layer that stands for all."""
    runs = [
        replace(run, toolpaths=in_charts(run.toolpaths, comparison.layers))
        for run in comparison.succeeded
    ]
    stress = stress_on(flat_view(middle_layer(comparison)), comparison.planned_on)
    return _overview(runs, stress, comparison.case.machine.fibre_width, tension_limit(stress))


def _overview(runs: Sequence[Run], stress: LayerStress, width: float, limit: float) -> "Figure":
    """All runs side by side on one layer."""
    paths = {run.name: run.toolpaths for run in runs}
    captions = {run.name: caption(run, stress.layer) for run in runs}
    return compare_layer(stress.layer, stress, paths, width, captions, limit)


def _forces(
    runs: Sequence[Run], layer: Layer, width: float, colours: Mapping[str, str]
) -> dict[str, bytes]:
    """Pictures of the axial force in the fibres of a layer, all on one scale."""
    coloured = {}
    for run in runs:
        if run.tested is not None:
            test = run.tested.bracket.tension
            s = test.strands
            middle, tangent, force = s.middle, s.tangent, test.axial_force
            length = s.length
            middle, tangent, near = chart_of(layer).pieces(middle, tangent)
            length, force, view = length[near], force[near], flat_view(layer)
            coloured[run.name] = force_on_paths(middle, tangent, length, force, view)
    flat = flat_view(layer)
    end = max((lines.limits[1] for lines in coloured.values()), default=0.0)
    return {
        run.name: _force(
            run, flat, width, replace(coloured[run.name], limits=(0.0, end)), colours[run.name]
        )
        for run in runs
        if run.name in coloured
    }


def _force(run: Run, layer: Layer, width: float, coloured: Coloured, colour: str) -> bytes:
    """Picture of the axial force in the fibres of a layer, and of where the part first fails."""
    failure = run.tested.failure if run.tested is not None else None
    about = "" if failure is None else f"first failure at {failure.load:.0f} N: {failure.what}"
    heading = f"{run.name}, force in the fibres"
    figure = layer_picture(
        layer, None, run.toolpaths, width, heading, about, coloured=coloured, colour=colour
    )
    if failure is not None and layer.turns is None:
        mark_failure(figure.axes[0], layer.plane.project(np.asarray(failure.where)), failure.what)
    return png(figure)
