"""What the figures of the papers are made of: panels, sections, lines, diagrams."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import shapely
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from ccfem.base.arrays import FloatArray
from ccfem.comparison.plot.canvas import canvas
from ccfem.comparison.plot.colours import INK, OUTLINE, SECTION


def panels(
    shapes: Sequence[Any], columns: int, width: float = 4.6, box: Any = None
) -> tuple[Figure, list[Any]]:
    """Figure with a panel for each shape (shapely or points), in rows, without axes."""
    boxes = np.array([shape.bounds for shape in shapes] if box is None else [box] * len(shapes))
    size = boxes[:, 2:] - boxes[:, :2]
    margin = 0.12 * size.max()
    share = float(((size[:, 1] + 2 * margin) / (size[:, 0] + 2 * margin)).max())
    rows = -(-len(shapes) // columns)
    height = width * share + 0.3
    figure = canvas(columns * width, rows * height, dpi=150.0)
    axes = list(figure.subplots(rows, columns, squeeze=False).flat)
    figure.subplots_adjust(0.005, 0.005, 0.995, 1.0 - 0.28 / (rows * height), 0.02, 0.3 / height)
    for k, panel in enumerate(axes):
        panel.set_axis_off()
        panel.set_aspect("equal")
        if k < len(shapes):
            panel.set_xlim(boxes[k, 0] - margin, boxes[k, 2] + margin)
            panel.set_ylim(boxes[k, 1] - margin, boxes[k, 3] + margin)
    return figure, axes


def title(axes: Any, text: str) -> None:
    """Write a heading above a panel."""
    axes.set_title(text, size=8, color=INK, loc="left", pad=2.0)


def section(
    axes: Any, polygon: Any, text: str = "", filled: bool = True, width: float = 0.6
) -> None:
    """Draw a section and its border, under a heading if any."""
    for part in shapely.get_parts(polygon):
        rings = [np.asarray(r.coords)[:, :2] for r in (part.exterior, *part.interiors)]
        outline = Path.make_compound_path(*[Path(ring, closed=True) for ring in rings])
        face = SECTION if filled else "none"
        axes.add_patch(PathPatch(outline, fc=face, ec=OUTLINE, lw=width))
    if text:
        title(axes, text)


def lines_of(axes: Any, lines: Iterable[FloatArray], colour: Any, width: float = 1.0) -> None:
    """Draw polylines (n, 2)."""
    axes.add_collection(LineCollection(list(lines), colors=colour, linewidths=width, zorder=2.5))


def bar(
    figure: Figure, axes: Any, drawn: Any, label: str, shrink: float = 0.6, aspect: float = 16.0
) -> None:
    """Draw a colour bar beside a panel, or several."""
    shown = figure.colorbar(drawn, ax=axes, shrink=shrink, pad=0.01, aspect=aspect)
    shown.set_label(label, size=7)
    shown.ax.tick_params(labelsize=6)


def curves(
    labels: Sequence[tuple[str, str]], width: float = 4.6, height: float = 3.6
) -> tuple[Figure, list[Any]]:
    """Figure with a diagram for each pair of labels, across and up, side by side."""
    figure = canvas(len(labels) * width, height, dpi=150.0)
    axes = list(figure.subplots(1, len(labels), squeeze=False)[0])
    figure.subplots_adjust(0.12 / len(labels), 0.14, 0.99, 0.9, 0.22)
    for panel, (across, up) in zip(axes, labels, strict=True):
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(labelsize=7, colors=INK)
        panel.set_xlabel(across, size=8, color=INK)
        panel.set_ylabel(up, size=8, color=INK)
        panel.grid(color=OUTLINE, alpha=0.2, lw=0.5)
    return figure, axes
