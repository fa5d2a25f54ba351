"""What a comparison shows of itself: the paths of a layer, fronts, and a page for notebooks."""

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ccfem.base.errors import InputError
from ccfem.comparison.front import cost_of, on_front
from ccfem.comparison.headline import headline_values
from ccfem.comparison.runs import Run
from ccfem.fem.elasticity.stress_field import PartStress
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import flat_view, in_charts
from ccfem.slicing.layers import Layer
from ccfem.slicing.layers.layer import stress_on

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def shown_layer(runs: Sequence[Run], layers: Sequence[Layer]) -> int:
    """Index of the layer that shows most: the middle one of those with fibre of any run."""
    indices = sorted({int(k) for run in runs for k in np.unique(run.toolpaths.layer)})
    if indices:
        return indices[len(indices) // 2]
    if not layers:
        raise InputError("there is no layer to draw: slice the part into at least one")
    return layers[len(layers) // 2].index


def layer_view(
    runs: Sequence[Run], layers: Sequence[Layer], stress: PartStress, machine: Machine, index: int
) -> "Figure":
    """Draw the paths of all runs on one layer, side by side, on the tension there.

    Raises
    ------
    InputError
        Where there is no such layer, and where no run has paths.
    """
    from ccfem.comparison.plot.paths import compare_layer

    by_index = {layer.index: layer for layer in layers}
    if index not in by_index:
        raise InputError(
            f"there is no layer {index}; layers are {min(by_index)} to {max(by_index)}: choose one"
        )
    if not runs:
        raise InputError("no strategy could plan this part: see why in .frame['failure']")
    flat = flat_view(by_index[index])
    runs = [replace(run, toolpaths=in_charts(run.toolpaths, layers)) for run in runs]
    captions = {}
    for run in runs:
        there = run.toolpaths.on_layer(index)
        captions[run.name] = f"{there.lengths.sum():.0f} mm in {len(there)} paths"
    paths = {run.name: run.toolpaths for run in runs}
    return compare_layer(flat, stress_on(flat, stress), paths, machine.fibre_width, captions)


def front_picture(runs: Sequence[Run], over: str) -> "Figure":
    """Draw stiffness over another index, a point a run; the front of what is printable joined.

    Raises
    ------
    InputError
        For an unknown index, and runs without a virtual test.
    """
    from ccfem.comparison.plot.fronts import FrontPoint, front_figure

    cost = cost_of(over)
    values = [headline_values(run) for run in runs]
    known = [
        (run, row)
        for run, row in zip(runs, values, strict=True)
        if "stiffness" in row and over in row
    ]
    if not known:
        raise InputError(f"no run has stiffness and {over}: compare with the virtual test")
    across = cost.factor * np.array([row[over] for _, row in known])
    up = np.array([row["stiffness"] for _, row in known])
    printable = np.array([run.printable for run, _ in known])
    best = on_front(np.where(printable, across, np.nan), up, cost.better)
    names = [run.name for run, _ in known]
    points = map(
        FrontPoint, names, across.tolist(), up.tolist(), best.tolist(), printable.tolist(), names
    )
    return front_figure({"": [*points]}, cost.title, "stiffness, N/mm")


def paragraphs(remarks: Sequence[str]) -> str:
    """Remarks as HTML, a paragraph each."""
    return "".join(f"<p>{escape(line)}</p>" for line in remarks)
