"""What of Chen et al. 2021 can be made again."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from matplotlib.figure import Figure

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.csv_table import write_csv
from ccfem.comparison.plot.colours import INK, OUTLINE
from ccfem.judging.evaluation import Evaluation, evaluate
from ccfem.judging.virtual_testing import Specimen, first_failure, virtual_test
from ccfem.papers.chen_2021.authors import STATED
from ccfem.papers.chen_2021.loop import FOLDER
from ccfem.papers.chen_2021.pipeline import STAGES, LayerStages
from ccfem.papers.chen_2021.study import PARTS_AT_HAND, Model, Study, run_study
from ccfem.papers.chen_2021.virtual_test import MATRIX_STRENGTH, authors_paths
from ccfem.papers.contents import (
    Contents,
    claim_table,
    drawn_of,
    judged,
    table,
    write_figures,
    write_report,
)
from ccfem.papers.panels import bar, curves, lines_of, panels, section, title
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer

EXPECTED = Path(__file__).with_name("expected.toml")
"""Claims of the paper, with the ranges that count as reproduced."""

# Figures 4 to 10 and 14 of the paper, redrawn from a run.


_PATH, _RING, _WRONG = "#0072b2", "#e69f00", "#b3261e"


def figures(study: Study, number: int | None = None) -> dict[str, Figure]:
    """Every figure, or those of a number, by name."""
    drawn: dict[str, Callable[[], Figure]] = {
        "figure_04_pipeline": lambda: _pipeline(study.loop),
        "figure_05_connection": lambda: _connection(study.loop),
        "figure_06_layers_of_a_part": lambda: _layers(
            study.models["lifting_eye" if "lifting_eye" in study.models else "Loop"]
        ),
        "figure_07_pushed": lambda: _pushed(study),
        "figure_08_agreement_of_vectors": lambda: _histograms(study),
        "figure_09_powers": lambda: _powers(study),
        "figure_10_field_processing": lambda: _processing(study),
        "figure_14_large_displacement": lambda: _turned_axes(study),
    }
    return drawn_of(drawn, number)


def _middle_stages(model: Model) -> LayerStages:
    return model.stages[len(model.stages) // 2]


def _pipeline(model: Model) -> Figure:
    """Vectors before and after each step, the fields, and the isocurves, on the middle layer."""
    stages, vectors = _middle_stages(model), model.vectors
    layer = stages.layer
    known = stages.directed
    figure, axes = panels([layer.plane.polygon] * 7, 4, 3.4)
    for panel in axes[:7]:
        section(panel, layer.plane.polygon)
    projected = known.tension.direction
    _draw_arrows(axes[0], layer, _in_plane(vectors.raw, layer))
    title(axes[0], "(a) tension, signs as they come")
    _draw_arrows(axes[1], layer, _in_plane(vectors.oriented, layer))
    title(axes[1], "(b) oriented along the spanning tree")
    _draw_arrows(axes[2], layer, _in_plane(vectors.oriented, layer))
    _draw_arrows(axes[2], layer, _in_plane(vectors.oriented, layer), ~known.tension.defined, _WRONG)
    title(axes[2], "(c) red: taken away by the filter")
    _draw_arrows(axes[3], layer, projected, known.tension.defined)
    title(axes[3], "(d) what is left, in the layer")
    size = np.clip(known.size / known.cap, 0.0, 1.0)
    bar(figure, axes[4], _draw_on_faces(axes[4], layer, size), "share of the largest stress")
    _draw_arrows(axes[4], layer, known.direction)
    title(axes[4], "(e) filled and smoothed: u")
    bar(figure, axes[5], _draw_at_points(axes[5], layer, stages.values), "s")
    title(axes[5], "(f) scalar field s")
    lines_of(axes[6], stages.curves.lines(), _PATH, 0.7)
    title(axes[6], "(g) isocurves at least a width apart")
    return figure


def _connection(model: Model) -> Figure:
    """From isocurves to paths."""
    stages = _middle_stages(model)
    layer = stages.layer
    figure, axes = panels([layer.plane.polygon] * 4, 4, 3.4)
    steps: list[tuple[list[tuple[Any, str]], str]] = [
        ([(stages.curves.lines(), _PATH)], f"(a) {len(stages.curves.lines())} isocurves"),
        ([(stages.rings, _RING)], "(b), (c) curves round the chosen holes"),
        ([(stages.led, _PATH), (stages.rings, _RING)], "(d), (e) cut back and led round"),
        ([(_plane_lines(stages.paths, layer), _PATH)], f"(f) joined: {len(stages.paths)} paths"),
    ]
    for panel, (drawn, text) in zip(axes, steps, strict=False):
        section(panel, layer.plane.polygon, text)
        for lines, colour in drawn:
            lines_of(panel, lines, colour, 0.7)
    return figure


def _layers(model: Model) -> Figure:
    """Paths of six layers of a part whose section changes."""
    chosen = np.unique(np.linspace(0, len(model.stages) - 1, 8).astype(int)[1:-1])
    outlines = [model.stages[k].layer.plane.polygon for k in chosen]
    whole = shapely.union_all([stage.layer.plane.polygon for stage in model.stages]).bounds
    figure, axes = panels(outlines, 3, 3.6, box=whole)
    for panel, k in zip(axes, chosen, strict=False):
        stages = model.stages[k]
        section(panel, stages.layer.plane.polygon, f"layer {k + 1} of {len(model.layers)}")
        lines_of(panel, _plane_lines(stages.paths, stages.layer), _PATH, 0.7)
    return figure


def _pushed(study: Study) -> Figure:
    """Fields and paths under a push."""
    stages = _middle_stages(study.models["Loop, pushed"])
    layer = stages.layer
    figure, axes = panels([layer.plane.polygon] * 3, 3, 3.6)
    for panel in axes:
        section(panel, layer.plane.polygon)
    size = np.clip(stages.directed.size / stages.directed.cap, 0.0, 1.0)
    bar(figure, axes[0], _draw_on_faces(axes[0], layer, size), "share of the largest stress")
    _draw_arrows(axes[0], layer, stages.directed.direction)
    title(axes[0], "(b) u, pushed")
    bar(figure, axes[1], _draw_at_points(axes[1], layer, stages.values), "s")
    title(axes[1], "(c) scalar field s")
    lines_of(axes[2], _plane_lines(stages.paths, layer), _PATH, 0.7)
    title(axes[2], "(d) paths")
    return figure


def _histograms(study: Study) -> Figure:
    """Products of neighbouring vectors once they are oriented."""
    figure, axes = curves([("v . v*", "share of pairs, %")] * len(study.models))
    for panel, (name, model) in zip(axes, study.models.items(), strict=True):
        products = agreement(model)
        share = np.full(len(products), 100.0 / len(products))
        panel.hist(products, np.linspace(-1.0, 1.0, 41), weights=share, color=_PATH)
        panel.axvline(0.5, color=_WRONG, lw=1.0)
        panel.set_yscale("log")
        title(panel, f"{name}; red: eta = 0.5")
    return figure


def _powers(study: Study) -> Figure:
    """Paths for several p."""
    layer = _middle_stages(study.loop).layer
    index = layer.index
    figure, axes = panels([layer.plane.polygon] * len(study.powers), len(study.powers), 3.2)
    for panel, (power, paths) in zip(axes, study.powers.items(), strict=True):
        section(
            panel,
            layer.plane.polygon,
            f"p = {power:g}: {1e-3 * paths.lengths.sum():.1f} m in all layers",
        )
        lines_of(panel, _plane_lines(paths.select(paths.layer == index), layer), _PATH, 0.7)
    return figure


def _processing(study: Study) -> Figure:
    """Paths with and without orientation and filter."""
    layer = _middle_stages(study.loop).layer
    index = layer.index
    figure, axes = panels([layer.plane.polygon] * 2, 2, 3.6)
    shown = (("(a) without", study.unprocessed), ("(b) with", study.loop.paths))
    for panel, (text, paths) in zip(axes, shown, strict=True):
        section(panel, layer.plane.polygon, f"{text} orientation and filter")
        lines_of(panel, _plane_lines(paths.select(paths.layer == index), layer), _PATH, 0.7)
    return figure


def _turned_axes(study: Study) -> Figure:
    """How far principal directions turn."""
    labels = ("turned by, degrees", "share of the cells, %")
    figure, axes = curves([labels] * 2)
    for panel, text, which in zip(axes, ("in space", "against the material"), (0, 1), strict=True):
        for (stop, turned), colour in zip(study.turns.items(), (_PATH, _RING), strict=True):
            angles = turned[which]
            share = np.full(len(angles), 100.0 / len(angles))
            panel.hist(
                angles,
                np.linspace(0.0, 45.0, 46),
                weights=share,
                color=colour,
                alpha=0.7,
                label=f"{stop:g} mm",
            )
        panel.legend(fontsize=7, frameon=False)
        title(panel, f"(d) {text}")
    return figure


def _in_plane(vectors: FloatArray, layer: Layer) -> FloatArray:
    """Vectors of the tetrahedra (m, 3) as unit vectors (t, 2) of a layer's triangles."""
    plane = vectors[layer.cell] @ layer.plane.frame[:2].T
    return plane / np.maximum(np.linalg.norm(plane, axis=1), 1e-300)[:, None]


def _plane_lines(paths: Toolpaths, layer: Layer) -> list[FloatArray]:
    """Paths in the plane of a layer."""
    return [path @ layer.plane.frame[:2].T for path in paths]


def _draw_arrows(
    axes: Any, layer: Layer, vectors: FloatArray, chosen: BoolArray | None = None, colour: str = INK
) -> None:
    """Draw arrows on triangles, about 1,500 of them."""
    places = layer.plane.points[layer.triangles].mean(axis=1)
    shown = np.flatnonzero(np.ones(len(places), bool) if chosen is None else chosen)
    every = max(1, len(places) // 1500)
    shown = shown[shown % every == 0]
    axes.quiver(
        *places[shown].T, *vectors[shown].T, color=colour, scale=45.0, width=0.0028, zorder=3.0
    )


def _draw_on_faces(axes: Any, layer: Layer, values: FloatArray) -> Any:
    return axes.tripcolor(
        *layer.plane.points.T, layer.triangles, facecolors=values, cmap="YlOrBr", zorder=2.0
    )


def _draw_at_points(axes: Any, layer: Layer, values: FloatArray) -> Any:
    drawn = axes.tripcolor(
        *layer.plane.points.T,
        layer.triangles,
        values,
        shading="gouraud",
        cmap="viridis",
        zorder=2.0,
    )
    axes.tricontour(
        *layer.plane.points.T,
        layer.triangles,
        values,
        24,
        colors=OUTLINE,
        linewidths=0.3,
        zorder=2.2,
    )
    return drawn


# The whole of the paper: its study, figures, tables and claims beside ours.


def write(study: Study, folder: Path) -> str:
    """Write everything into a folder; returns the table of claims."""
    folder.mkdir(parents=True, exist_ok=True)
    values = quantities(study)
    claims = claim_table(judged(values, EXPECTED))
    write_csv(folder / "quantities.csv", ("quantity", "value"), values.items())
    introduction = (
        "# Field-based toolpaths of Chen et al. (2021): ours beside theirs\n\n"
        "Written by `ccfem reproduce chen_2021`. The algorithm is the published one. "
        f"Part: {study.loop.case.title}. {PARTS_AT_HAND}\n"
    )
    sections = {
        "Claims": claims,
        "Table 1: times": time_table(study),
        "Table 2: fibre and stiffness": length_table(study, values),
    }
    write_report(folder, introduction, sections, write_figures(figures(study), folder))
    return claims


CONTENTS = Contents(
    title="Chen et al. 2021, field-based toolpaths",
    seconds=90.0,
    run=lambda progress: run_study(progress=progress),
    whole=lambda folder, progress: print(write(run_study(progress=progress), folder)),
    tables={
        "claims": lambda study: claim_table(judged(quantities(study()), EXPECTED)),
        "table1": lambda study: time_table(study()),
        "table2": lambda study: length_table(study(), quantities(study())),
    },
    figures=figures,
    numbers=(4, 5, 6, 7, 8, 9, 10, 14),
)


# Tables 1 and 2 of the paper beside ours.


PAPER_1 = {
    "Loop": (32473, 12, 17.684, 0.810, 0.200, 0.030, 8.210, 0.591, 130.862),
    "Shell_Tensile": (112080, 12, 400.683, 3.262, 1.093, 0.096, 24.077, 1.225, 758.140),
    "Wrench": (14002, 12, 2.883, 0.329, 0.108, 0.016, 3.414, 0.342, 56.642),
    "Piston": (85558, 66, 215.88, 2.501, 0.246, 0.031, 6.035, 0.462, 665.953),
    "Shell_Compress": (112080, 12, 414.114, 3.117, 0.964, 0.162, 16.732, 0.935, 676.000),
}
"""Cells and layers; seconds of orientation and removal, of the stages of a layer, and of all."""
_PAPER_2 = {
    "paper: contour and zigzag": (35.895, 0.757 / 0.423),
    "paper: theirs": (34.658, 1.137 / 0.423),
}
"""Fibre, m, and slope over that of the part without fibre, of the Loop."""


def time_table(study: Study) -> str:
    """Table 1 in Markdown: the paper's rows, then ours."""
    stages = tuple(f"{stage}, s a layer" for stage in STAGES)
    rows = [(f"paper: {name}", *(f"{v:g}" for v in values)) for name, values in PAPER_1.items()]
    for name, model in study.models.items():
        layers = np.array([stages_of_layer.seconds for stages_of_layer in model.stages])
        whole = sum(model.vectors.seconds) + float(layers.sum())
        times = (*model.vectors.seconds, *layers.mean(axis=0), whole)
        sizes = (str(len(model.stress.mesh.cells)), str(len(model.layers)))
        rows.append((f"here: {name}", *sizes, *(f"{t:.3f}" for t in times)))
    heads = ("model", "cells", "layers", "orientation, s", "removal, s", *stages, "all, s")
    return table(heads, rows)


def length_table(study: Study, values: Mapping[str, float]) -> str:
    """Table 2 in Markdown, of the Loop: fibre, and stiffness over that of the bare part."""
    rows = dict(_PAPER_2)
    for name, (paths, ratio) in study.compared.items():
        rows[f"here: {name}"] = (1e-3 * float(paths.lengths.sum()), ratio)
    for name in ("ours", "zigzag"):
        if f"fibre of the authors' paths, m, {name}" in values:
            rows[f"their published paths, {name}, tested here"] = (
                values[f"fibre of the authors' paths, m, {name}"],
                values[f"stiffness ratio of the authors' paths, {name}"],
            )
    heads = ("Loop", "fibre, m", "stiffness ratio")
    return table(heads, [(name, f"{a:.2f}", f"{b:.2f}") for name, (a, b) in rows.items()])


# The quantities that the paper's claims are about, and the verdicts.


_VALLEY = (0.3, 0.7)
"""Products of vectors about eta = 0.5 that "separated" leaves few pairs between."""


def quantities(study: Study) -> dict[str, float]:
    """Every number that `expected.toml` names, as far as the run has it."""
    loop = study.loop
    values = _times(study) | _vectors(study) | _paths(study)
    for stop, turned in study.turns.items():
        at = f"at {stop:g} mm, %"
        values[f"turned by more than 10 degrees in space {at}"] = _over_ten(turned.in_space)
        values[f"turned by more than 10 degrees against the material {at}"] = _over_ten(
            turned.in_material
        )
    if os.environ.get(FOLDER) and loop.case.name == "chen_2021_loop":
        values |= _authors(loop)
    return values


def agreement(model: Model) -> FloatArray:
    """Products v . v* of the oriented vectors of cells that share a face, both in tension."""
    vectors, raw = model.vectors.oriented, model.vectors.unfiltered
    pairs = model.stress.mesh.neighbours
    pairs = pairs[raw.defined[pairs].all(axis=1)]
    return np.einsum("pi,pi->p", vectors[pairs[:, 0]], vectors[pairs[:, 1]])


def _over_ten(angles: FloatArray) -> float:
    return 100.0 * float((angles > 10.0).mean())


def _times(study: Study) -> dict[str, float]:
    """Table 1."""
    values = {}
    for name, model in study.models.items():
        layers = np.array([stages.seconds for stages in model.stages])
        orientation, removal = model.vectors.seconds
        values[f"cells {name}"] = float(len(model.stress.mesh.cells))
        values[f"layers {name}"] = float(len(model.layers))
        values[f"seconds of orientation {name}"] = orientation
        values[f"seconds of removal {name}"] = removal
        values[f"seconds of planning {name}"] = orientation + removal + float(layers.sum())
        values[f"extraction, % of a layer {name}"] = 100.0 * float(
            layers[:, 2].sum() / layers.sum()
        )
    return values


def _vectors(study: Study) -> dict[str, float]:
    """Figures 7 and 8."""
    values = {}
    for name, model in study.models.items():
        products = agreement(model)
        low, high = _VALLEY
        between = (products > low) & (products < high)
        values[f"pairs in the valley about eta, % {name}"] = 100.0 * float(between.mean())
    pulled, pushed = (study.models[name].vectors for name in ("Loop", "Loop, pushed"))
    both = pulled.unfiltered.defined & pushed.unfiltered.defined
    cosine = np.abs(np.einsum("mi,mi->m", pulled.oriented[both], pushed.oriented[both]))
    values["median angle between tension of pull and push"] = float(
        np.degrees(np.median(np.arccos(np.clip(cosine, 0.0, 1.0))))
    )
    return values


def _paths(study: Study) -> dict[str, float]:
    """Figures 5, 6, 9 and 10, and table 2."""
    loop = study.loop
    curves = sum(len(evaluation.curves.lines()) for evaluation in loop.stages)
    values = {
        "isocurves over paths": curves / len(loop.paths),
        "shortest path, mm": float(loop.paths.lengths.min()),
    }
    if "lifting_eye" in study.models:
        stages = study.models["lifting_eye"].stages
        lengths = [float(evaluation.paths.lengths.sum()) for evaluation in stages]
        changes = np.abs(np.diff(lengths)) / max(lengths)
        values["layers unlike the one below, %"] = 100.0 * float((changes > 1e-3).mean())
    by_power = {power: _evaluated(loop, paths) for power, paths in study.powers.items()}
    low, high = min(by_power), max(by_power)
    for power, evaluation in by_power.items():
        values[f"fibre, m, p = {power:g}"] = 1e-3 * evaluation.total["fibre_length"]
    values["fibre at the largest p over that at p = 0"] = (
        values[f"fibre, m, p = {high:g}"] / values[f"fibre, m, p = {low:g}"]
    )
    values["median over least spacing, largest p over p = 0"] = _spacing_spread(
        by_power[high]
    ) / _spacing_spread(by_power[low])
    with_it, without = by_power[1.0], _evaluated(loop, study.unprocessed)
    values["nearer than W, %"] = 100.0 * with_it.total["spacing_below"]
    values["within 10 degrees with processing, %"] = 100.0 * with_it.total["aligned_10"]
    values["within 10 degrees without processing, %"] = 100.0 * without.total["aligned_10"]
    values["curvature without over with processing"] = (
        without.total["curvature_95"] / with_it.total["curvature_95"]
    )
    for name, (paths, ratio) in study.compared.items():
        values[f"fibre, m, {name}"] = 1e-3 * float(paths.lengths.sum())
        values[f"stiffness ratio, {name}"] = ratio
    values["stiffness of the algorithm over contour_zigzag"] = (
        values["stiffness ratio, the paper's algorithm"] / values["stiffness ratio, contour_zigzag"]
    )
    return values


def _evaluated(model: Model, paths: Toolpaths) -> Evaluation:
    return evaluate(paths, model.layers, model.stress, model.case.machine)


def _spacing_spread(evaluation: Evaluation) -> float:
    """Median distance to the next strand over the fifth percentile."""
    return evaluation.total["spacing_50"] / evaluation.total["spacing_5"]


def _authors(loop: Model) -> dict[str, float]:
    """Measure the authors' own paths for the Loop."""
    specimen = Specimen.of(loop.stress)
    values, failure = {}, {}
    for name in STATED:
        paths = authors_paths(name)
        values[f"fibre of the authors' paths, m, {name}"] = 1e-3 * float(paths.lengths.sum())
        tested = virtual_test(paths, specimen, span=())
        values[f"stiffness ratio of the authors' paths, {name}"] = tested.ratio
        failure[name] = first_failure(tested, matrix_strength=MATRIX_STRENGTH).load
    ratio = "stiffness ratio of the authors' paths"
    values["stiffness of the authors' paths over their zigzag"] = (
        values[f"{ratio}, ours"] / values[f"{ratio}, zigzag"]
    )
    values["first failure of the authors' paths over their zigzag"] = (
        failure["ours"] / failure["zigzag"]
    )
    return values
