"""What the figures of the paper share: plates side by side, sections, strokes, maps."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ccfem.base.arrays import FloatArray
from ccfem.base.tensor import strongest_in_plane
from ccfem.comparison.plot.colours import INK, OUTLINE, SECTION
from ccfem.papers.plocher_2022.plates import Plate
from ccfem.papers.plocher_2022.study import CaseStudy

COLOURS = {
    "grid 45": "#d55e00",
    "grid 0": "#56b4e9",
    "concentric": "#e69f00",
    "mat": "#009e73",
    "mps": "#0072b2",
    "benchmark": "#4d4d4d",
}


def plates_grid(
    rows: int, columns: int, plates: Sequence[Plate], width: float = 4.2
) -> tuple[Figure, Any]:
    """Figure with one picture of a plate a place; the plates of a column have one shape."""
    shares = [plate.mask.shape[0] / plate.mask.shape[1] for plate in plates]
    height = width * max(shares) + 0.28
    figure = Figure(figsize=(columns * width, rows * height), dpi=130.0, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False)
    figure.subplots_adjust(0.01, 0.01, 0.99, 1.0 - 0.25 / (rows * height), 0.03, 0.18)
    for one in axes.flat:
        one.set_axis_off()
        one.set_aspect("equal")
    return figure, axes


def section(axes: Any, plate: Plate, filled: bool = True) -> None:
    """Outline of a plate, filled or not, and the limits of its picture."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    rings = [np.asarray(r.coords) for r in (plate.polygon.exterior, *plate.polygon.interiors)]
    outline = Outline.make_compound_path(*[Outline(ring[:, :2], closed=True) for ring in rings])
    axes.add_patch(PathPatch(outline, fc=SECTION if filled else "none", ec=OUTLINE, lw=0.4))
    axes.set_xlim(-1.0, plate.mask.shape[1] * plate.bead + 1.0)
    axes.set_ylim(-1.0, plate.mask.shape[0] * plate.bead + 1.0)


def title(axes: Any, text: str) -> None:
    """Line of text above a picture."""
    axes.set_title(text, size=7.5, color=INK, loc="left", pad=2.0)


def strokes(axes: Any, case: CaseStudy, every: int = 3) -> None:
    """Strokes along the largest stress: red for tension, blue for compression."""
    centres, direction = case.plate.mesh.centres, case.benchmarks["C"].direction
    place = np.floor(centres / case.plate.bead).astype(int)
    chosen = (place % every == every // 2).all(axis=1)
    tension = strongest_in_plane(case.plate.isotropic_field.stress)[0] > 0.0
    half = 0.45 * every * case.plate.bead
    along = half * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    for kind, colour in ((tension, "#a51f2d"), (~tension, "#1f4e9c")):
        pick = chosen & kind
        strokes = np.stack([centres[pick] - along[pick], centres[pick] + along[pick]], axis=1)
        axes.add_collection(LineCollection(list(strokes), colors=colour, linewidths=0.5))


def image(axes: Any, plate: Plate, values: FloatArray, colours: Any, limits: Any) -> Any:
    """Values of the cells of a plate (m,) as a map; what a colour bar needs."""
    pixels = np.full(plate.mask.shape, np.nan)
    pixels[plate.mask] = values
    height, width = (plate.bead * n for n in plate.mask.shape)
    drawn = axes.imshow(
        pixels, cmap=colours, vmin=limits[0], vmax=limits[1], extent=(0.0, width, 0.0, height)
    )
    section(axes, plate, filled=False)
    return drawn


def plain(columns: int, width: float = 4.4, height: float = 3.2) -> tuple[Figure, Any]:
    """Figure with diagrams side by side."""
    figure = Figure(figsize=(columns * width, height), dpi=130.0, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, columns, squeeze=False)[0]
    figure.subplots_adjust(0.14 / columns, 0.2, 0.98, 0.88, 0.28)
    for one in axes:
        one.spines[["top", "right"]].set_visible(False)
        one.tick_params(labelsize=7, colors=INK)
    return figure, axes


def polar(columns: int) -> tuple[Figure, Any]:
    """Figure with polar diagrams side by side."""
    figure = Figure(figsize=(3.6 * columns, 4.0), dpi=130.0, facecolor="white")
    FigureCanvasAgg(figure)
    axes = [figure.add_subplot(1, columns, k + 1, projection="polar") for k in range(columns)]
    for one in axes:
        one.tick_params(labelsize=6)
    figure.subplots_adjust(0.08, 0.1, 0.92, 0.82, 0.35)
    return figure, axes
