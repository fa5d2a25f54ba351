"""Figures 4 to 10 and 14 of the paper, redrawn from a run."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from matplotlib.figure import Figure

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.comparison.plot.canvas import save
from ccfem.comparison.plot.colours import INK, OUTLINE
from ccfem.papers.chen_2021.claims import agreement
from ccfem.papers.chen_2021.pipeline import LayerStages
from ccfem.papers.chen_2021.study import Model, Study
from ccfem.papers.contents import drawn_of
from ccfem.papers.wang_2021.panels import bar, curves, lines_of, panels, section, title
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer

_PATH, _RING, _WRONG = "#0072b2", "#e69f00", "#b3261e"


def draw_all(study: Study, folder: Path) -> list[str]:
    """Draw every figure; the names of the files."""
    made = figures(study)
    for name, figure in made.items():
        save(figure, folder / f"{name}.png")
    return [f"{name}.png" for name in made]


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
        "figure_14_large_displacement": lambda: _turns(study),
    }
    return drawn_of(drawn, number)


def _middle(model: Model) -> LayerStages:
    return model.stages[len(model.stages) // 2]


def _pipeline(model: Model) -> Figure:
    """Vectors before and after each step, the fields, and the isocurves, on the middle layer."""
    stages, vectors = _middle(model), model.vectors
    layer = stages.layer
    known = stages.directed
    figure, axes = panels([layer.plane.polygon] * 7, 4, 3.4)
    for one in axes[:7]:
        section(one, layer.plane.polygon)
    projected = known.tension.direction
    _arrows(axes[0], layer, _in_plane(vectors.raw, layer))
    title(axes[0], "(a) tension, signs as they come")
    _arrows(axes[1], layer, _in_plane(vectors.oriented, layer))
    title(axes[1], "(b) oriented along the spanning tree")
    _arrows(axes[2], layer, _in_plane(vectors.oriented, layer))
    _arrows(axes[2], layer, _in_plane(vectors.oriented, layer), ~known.tension.defined, _WRONG)
    title(axes[2], "(c) red: taken away by the filter")
    _arrows(axes[3], layer, projected, known.tension.defined)
    title(axes[3], "(d) what is left, in the layer")
    size = np.clip(known.size / known.cap, 0.0, 1.0)
    bar(figure, axes[4], _faces(axes[4], layer, size), "share of the largest stress")
    _arrows(axes[4], layer, known.direction)
    title(axes[4], "(e) filled and smoothed: u")
    bar(figure, axes[5], _points(axes[5], layer, stages.values), "s")
    title(axes[5], "(f) scalar field s")
    lines_of(axes[6], stages.curves.lines(), _PATH, 0.7)
    title(axes[6], "(g) isocurves at least a width apart")
    return figure


def _connection(model: Model) -> Figure:
    """From isocurves to paths."""
    stages = _middle(model)
    layer = stages.layer
    figure, axes = panels([layer.plane.polygon] * 4, 4, 3.4)
    steps: list[tuple[list[tuple[Any, str]], str]] = [
        ([(stages.curves.lines(), _PATH)], f"(a) {len(stages.curves.lines())} isocurves"),
        ([(stages.rings, _RING)], "(b), (c) curves round the chosen holes"),
        ([(stages.led, _PATH), (stages.rings, _RING)], "(d), (e) cut back and led round"),
        ([(_lines(stages.paths, layer), _PATH)], f"(f) joined: {len(stages.paths)} paths"),
    ]
    for one, (drawn, text) in zip(axes, steps, strict=False):
        section(one, layer.plane.polygon)
        for lines, colour in drawn:
            lines_of(one, lines, colour, 0.7)
        title(one, text)
    return figure


def _layers(model: Model) -> Figure:
    """Paths of six layers of a part whose section changes."""
    chosen = np.unique(np.linspace(0, len(model.stages) - 1, 8).astype(int)[1:-1])
    outlines = [model.stages[k].layer.plane.polygon for k in chosen]
    whole = shapely.union_all([each.layer.plane.polygon for each in model.stages]).bounds
    figure, axes = panels(outlines, 3, 3.6, box=whole)
    for one, k in zip(axes, chosen, strict=False):
        stages = model.stages[k]
        section(one, stages.layer.plane.polygon)
        lines_of(one, _lines(stages.paths, stages.layer), _PATH, 0.7)
        title(one, f"layer {k + 1} of {len(model.layers)}")
    return figure


def _pushed(study: Study) -> Figure:
    """Fields and paths under a push."""
    stages = _middle(study.models["Loop, pushed"])
    layer = stages.layer
    figure, axes = panels([layer.plane.polygon] * 3, 3, 3.6)
    for one in axes:
        section(one, layer.plane.polygon)
    size = np.clip(stages.directed.size / stages.directed.cap, 0.0, 1.0)
    bar(figure, axes[0], _faces(axes[0], layer, size), "share of the largest stress")
    _arrows(axes[0], layer, stages.directed.direction)
    title(axes[0], "(b) u, pushed")
    bar(figure, axes[1], _points(axes[1], layer, stages.values), "s")
    title(axes[1], "(c) scalar field s")
    lines_of(axes[2], _lines(stages.paths, layer), _PATH, 0.7)
    title(axes[2], "(d) paths")
    return figure


def _histograms(study: Study) -> Figure:
    """Products of neighbouring vectors once they are oriented."""
    figure, axes = curves(len(study.models), [("v . v*", "share of pairs, %")] * len(study.models))
    for one, (name, model) in zip(axes, study.models.items(), strict=True):
        products = agreement(model)
        share = np.full(len(products), 100.0 / len(products))
        one.hist(products, np.linspace(-1.0, 1.0, 41), weights=share, color=_PATH)
        one.axvline(0.5, color=_WRONG, lw=1.0)
        one.set_yscale("log")
        title(one, f"{name}; red: eta = 0.5")
    return figure


def _powers(study: Study) -> Figure:
    """Paths for several p."""
    layer = _middle(study.loop).layer
    index = layer.index
    figure, axes = panels([layer.plane.polygon] * len(study.powers), len(study.powers), 3.2)
    for one, (power, paths) in zip(axes, study.powers.items(), strict=True):
        section(one, layer.plane.polygon)
        lines_of(one, _lines(paths.select(paths.layer == index), layer), _PATH, 0.7)
        title(one, f"p = {power:g}: {1e-3 * paths.lengths.sum():.1f} m in all layers")
    return figure


def _processing(study: Study) -> Figure:
    """Paths with and without orientation and filter."""
    layer = _middle(study.loop).layer
    index = layer.index
    figure, axes = panels([layer.plane.polygon] * 2, 2, 3.6)
    shown = (("(a) without", study.unprocessed), ("(b) with", study.loop.paths))
    for one, (text, paths) in zip(axes, shown, strict=True):
        section(one, layer.plane.polygon)
        lines_of(one, _lines(paths.select(paths.layer == index), layer), _PATH, 0.7)
        title(one, f"{text} orientation and filter")
    return figure


def _turns(study: Study) -> Figure:
    """How far principal directions turn."""
    labels = ("turned by, degrees", "share of the cells, %")
    figure, axes = curves(2, [labels] * 2)
    for one, text, which in zip(axes, ("in space", "against the material"), (0, 1), strict=True):
        for (stop, turned), colour in zip(study.turns.items(), (_PATH, _RING), strict=True):
            angles = turned[which]
            share = np.full(len(angles), 100.0 / len(angles))
            one.hist(
                angles,
                np.linspace(0.0, 45.0, 46),
                weights=share,
                color=colour,
                alpha=0.7,
                label=f"{stop:g} mm",
            )
        one.legend(fontsize=7, frameon=False)
        title(one, f"(d) {text}")
    return figure


def _in_plane(vectors: FloatArray, layer: Layer) -> FloatArray:
    """Vectors of the tetrahedra (m, 3) as unit vectors (t, 2) of a layer's triangles."""
    plane = vectors[layer.cell] @ layer.plane.frame[:2].T
    return plane / np.maximum(np.linalg.norm(plane, axis=1), 1e-300)[:, None]


def _lines(paths: Toolpaths, layer: Layer) -> list[FloatArray]:
    """Paths in the plane of a layer."""
    return [path @ layer.plane.frame[:2].T for path in paths]


def _arrows(
    axes: Any,
    layer: Layer,
    vectors: FloatArray,
    chosen: BoolArray | None = None,
    colour: str = INK,
) -> None:
    """Draw arrows on triangles, about 1,500 of them."""
    places = layer.plane.points[layer.triangles].mean(axis=1)
    shown = np.flatnonzero(np.ones(len(places), bool) if chosen is None else chosen)
    every = max(1, len(places) // 1500)
    shown = shown[shown % every == 0]
    axes.quiver(
        *places[shown].T, *vectors[shown].T, color=colour, scale=45.0, width=0.0028, zorder=3.0
    )


def _faces(axes: Any, layer: Layer, values: FloatArray) -> Any:
    return axes.tripcolor(
        *layer.plane.points.T, layer.triangles, facecolors=values, cmap="YlOrBr", zorder=2.0
    )


def _points(axes: Any, layer: Layer, values: FloatArray) -> Any:
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
