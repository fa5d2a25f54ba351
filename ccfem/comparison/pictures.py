"""All pictures of a comparison: every layer of every strategy, and the fibre forces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.comparison.result import Comparison, Run
from ccfem.evaluation.curvature import sample_curvature
from ccfem.evaluation.matching import THRESHOLDS, matching_rate
from ccfem.evaluation.plane_paths import plane_paths, pool
from ccfem.layers import Layer
from ccfem.layers.layer_stress import stress_on
from ccfem.plot.canvas import png
from ccfem.plot.colours import palette
from ccfem.plot.curves import curvature_curves, matching_curves
from ccfem.plot.fields import tension_picture
from ccfem.plot.on_paths import force_on_paths
from ccfem.plot.paths import Coloured, compare_layer, layer_picture, mark_failure, tension_limit
from ccfem.progress import Progress, silent

__all__ = ["Pictures", "draw_pictures"]


@dataclass(frozen=True)
class Pictures:
    """PNG files of a comparison.

    Attributes
    ----------
    paths : dict of (strategy, layer index) to bytes
    forces : dict of strategy to bytes
        Force in the fibres of the middle layer, where there was a virtual test.
    tension : bytes
        Tension in the middle layer.
    overview : bytes
        All strategies side by side on the middle layer.
    matching, curvature : bytes
        Curves of all strategies over all layers.
    middle : int
        Index of the middle layer.
    """

    paths: dict[tuple[str, int], bytes]
    forces: dict[str, bytes]
    tension: bytes
    overview: bytes
    matching: bytes
    curvature: bytes
    middle: int


def draw_pictures(comparison: Comparison, progress: Progress = silent) -> Pictures:
    """Draw every layer of every strategy that did not fail, all on one colour scale."""
    layers, runs, stress = comparison.layers, comparison.succeeded, comparison.stress
    machine = comparison.case.machine
    width = machine.fibre_width
    limit = max(tension_limit(stress_on(layer, stress)) for layer in layers)
    colours = palette(run.name for run in comparison.runs)
    paths = {}
    for k, layer in enumerate(layers):
        progress("drawing pictures", k / len(layers))
        for run in runs:
            figure = layer_picture(
                layer,
                stress_on(layer, stress),
                run.toolpaths,
                width,
                f"{run.name}, layer {layer.index}",
                caption(run, layer),
                limit,
                colour=colours[run.name],
            )
            paths[run.name, layer.index] = png(figure)
    middle = layers[len(layers) // 2]
    overview = compare_layer(
        middle,
        stress_on(middle, stress),
        {run.name: run.toolpaths for run in runs},
        width,
        {run.name: caption(run, middle) for run in runs},
        limit,
    )
    rates, bends = _curves(comparison)
    heading = f"tension in layer {middle.index}, load case {stress.case}"
    return Pictures(
        paths,
        _forces(runs, middle, width, colours),
        png(tension_picture(stress_on(middle, stress), heading, "size and direction", limit)),
        png(overview),
        png(matching_curves(rates, THRESHOLDS, "fibre along the stress", colours)),
        png(curvature_curves(bends, machine.minimum_radius, "curvature", colours)),
        middle.index,
    )


def caption(run: Run, layer: Layer) -> str:
    """Key numbers of a run on one layer."""
    if run.evaluation is None:
        return ""
    values = run.evaluation.of_layer(layer.index)
    count = int(values["paths"])
    if not count:
        return "no fibre"
    laid = f"{values['fibre_length']:.0f} mm in {count} path{'s' if count > 1 else ''}"
    efficiency = values["efficiency"]
    return laid if np.isnan(efficiency) else f"{laid}, efficiency {efficiency:.2f}"


def _curves(comparison: Comparison) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Take matching rates, and samples of the curvature, 1/mm, of each run over all layers."""
    step = comparison.case.machine.fibre_width
    stresses = [stress_on(layer, comparison.stress) for layer in comparison.layers]
    rates, bends = {}, {}
    for run in comparison.succeeded:
        lines = [plane_paths(run.toolpaths, layer) for layer in comparison.layers]
        rates[run.name] = matching_rate(run.toolpaths, stresses, step=step)
        bends[run.name] = pool([sample_curvature(each, step) for each in lines]).curvature
    return rates, bends


def _forces(
    runs: Sequence[Run], layer: Layer, width: float, colours: dict[str, str]
) -> dict[str, bytes]:
    """Pictures of the axial force in the fibres of a layer, all on one scale."""
    coloured: dict[str, Coloured] = {}
    for run in runs:
        if run.tested is not None:
            test = run.tested.bracket.tension
            s = test.strands
            coloured[run.name] = force_on_paths(
                s.middle, s.tangent, s.length, test.axial_force, layer
            )
    if not coloured:
        return {}
    end = max(one.limits[1] for one in coloured.values())
    drawn = {}
    for run in runs:
        if run.tested is None:
            continue
        failure = run.tested.failure
        about = "" if failure is None else f"first failure at {failure.load:.0f} N: {failure.what}"
        figure = layer_picture(
            layer,
            None,
            run.toolpaths,
            width,
            f"{run.name}, force in the fibres",
            about,
            coloured=replace(coloured[run.name], limits=(0.0, end), signed=False),
            colour=colours[run.name],
        )
        if failure is not None:
            mark_failure(
                figure.axes[0], layer.plane.project(np.asarray(failure.where)), failure.what
            )
        drawn[run.name] = png(figure)
    return drawn
