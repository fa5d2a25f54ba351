"""What the figures are made of: sections, stress vectors, loads, paths, in panels of one scale."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import shapely
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.tensor import in_plane, strongest_in_plane
from ccfem.cases.designed import DesignPlate
from ccfem.comparison.plot.colours import INK, OUTLINE, SECTION, palette
from ccfem.papers.wang_2021.study import PartStudy, PatternStudy

COLOURS = {
    "lpp": "#0072b2",
    "lpp uncrossed": "#56b4e9",
    "concentric": "#e69f00",
    "zigzag 45": "#009e73",
    "zigzag 90": "#cc79a7",
    "offset": "#d55e00",
    "streamline": "#8c7a00",
    "eqs": "#4d4d4d",
}
PULLED, PRESSED = "#1f4e9c", "#2c8a4b"
"""Tension and compression: blue and green, as in the paper."""
STRAND, LINK = "#a51f2d", "#1f4e9c"
"""The path inside, and its links: red and blue, as in the paper."""

_MARGIN = 0.12


def panels(
    shapes: Sequence[Any], columns: int, width: float = 4.6, box: Any = None
) -> tuple[Figure, list[Any]]:
    """Figure with a panel for each shape (shapely or points), in rows, without axes."""
    boxes = np.array([shape.bounds for shape in shapes] if box is None else [box] * len(shapes))
    size = boxes[:, 2:] - boxes[:, :2]
    margin = _MARGIN * size.max()
    share = float(((size[:, 1] + 2 * margin) / (size[:, 0] + 2 * margin)).max())
    rows = -(-len(shapes) // columns)
    height = width * share + 0.3
    figure = Figure(figsize=(columns * width, rows * height), dpi=150.0, facecolor="white")
    FigureCanvasAgg(figure)
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


def section(axes: Any, polygon: Any, filled: bool = True, colour: str = OUTLINE) -> None:
    """Draw a section and its border."""
    for part in shapely.get_parts(polygon):
        rings = [np.asarray(r.coords)[:, :2] for r in (part.exterior, *part.interiors)]
        outline = Path.make_compound_path(*[Path(ring, closed=True) for ring in rings])
        face = SECTION if filled else "none"
        axes.add_patch(PathPatch(outline, fc=face, ec=colour, lw=0.6))


def show_load(axes: Any, plate: DesignPlate) -> None:
    """Mark the supports of a plate by triangles and its load by an arrow."""
    size = 0.05 * max(plate.border.bounds[2:])
    for stretch, _ in plate.supports.values():
        start, end = np.array(stretch.start), np.array(stretch.end)
        count = max(1, round(float(np.linalg.norm(end - start)) / (2.0 * size)))
        at = start + (np.arange(count)[:, None] + 0.5) / count * (end - start)
        axes.plot(*at.T, "^", color=INK, ms=5.0, zorder=4.0, clip_on=False)
    x, y = np.mean([plate.load.start, plate.load.end], axis=0)
    style = {"arrowstyle": "-|>", "color": STRAND, "lw": 1.6}
    above = y > 0.9 * plate.border.bounds[3]
    head, tail = ((x, y), (x, y + 2.2 * size)) if above else ((x, y - 2.2 * size), (x, y))
    axes.annotate("", xy=head, xytext=tail, arrowprops=style, zorder=4.0, annotation_clip=False)


def strokes(axes: Any, part: PartStudy, count: int = 70) -> None:
    """Stress vectors: strokes along the principal stress of the larger size, as long as it is."""
    layer = part.layer
    plane = in_plane(part.stress.nodal, layer.plane.frame)[layer.triangles].mean(axis=1)
    value, angle, _ = strongest_in_plane(plane)
    pulled, size = value >= 0.0, np.abs(value)
    middle = layer.plane.points[layer.triangles].mean(axis=1)
    chosen = _spread(middle, float(np.ptp(layer.plane.points, axis=0).max()) / count)
    most = np.quantile(size, 0.97)
    chosen = chosen[size[chosen] > 0.01 * most]
    half = 0.5 * np.ptp(layer.plane.points, axis=0).max() / count
    half = half * np.clip(size[chosen] / most, 0.35, 1.3)
    along = half[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)[chosen]
    for kind, colour in ((pulled[chosen], PULLED), (~pulled[chosen], PRESSED)):
        ends = np.stack([middle[chosen] - along, middle[chosen] + along], axis=1)[kind]
        axes.add_collection(LineCollection(list(ends), colors=colour, linewidths=0.7, zorder=2.0))


def _spread(points: FloatArray, size: float) -> Any:
    """One point for each field of a grid: the one nearest to its middle."""
    field = np.floor(points / size)
    off = np.linalg.norm(points - (field + 0.5) * size, axis=1)
    order = np.lexsort((off, field[:, 1], field[:, 0]))
    _, first = np.unique(field[order], axis=0, return_index=True)
    return order[first]


def path(axes: Any, pattern: PatternStudy, colour: str = STRAND, link: str = LINK) -> None:
    """Draw the paths of a pattern, its links in their own colour, start and end marked if one."""
    paths = pattern.paths
    steps, mask = _steps(pattern)
    for kind, stroke in ((~mask, colour), (mask, link)):
        axes.add_collection(LineCollection(list(steps[kind]), colors=stroke, lw=0.45, zorder=2.0))
    if len(paths) == 1:
        axes.plot(*paths.points[0], "o", color=INK, ms=4.0, zorder=3.0)
        axes.plot(*paths.points[-1], "s", color=INK, ms=4.0, zorder=3.0)


def by_level(axes: Any, pattern: PatternStudy, values: FloatArray, unit: str) -> None:
    """Draw the steps of the paths of a pattern, one colour a value (P,), with its share."""
    steps, _ = _steps(pattern)
    kept = values[_first(pattern)]
    length = np.linalg.norm(steps[:, 1] - steps[:, 0], axis=1)
    levels = np.unique(kept)
    colours = palette(map(str, levels)).values()
    for level, colour in zip(levels, colours, strict=True):
        at_level = kept == level
        share = 100.0 * length[at_level].sum() / length.sum()
        label = f"{level:g} {unit}: {share:.0f} % of the length"
        lines = LineCollection(
            list(steps[at_level]), colors=colour, lw=0.8, zorder=2.0, label=label, capstyle="round"
        )
        axes.add_collection(lines)
    axes.legend(fontsize=6, frameon=False, loc="upper right")


def _first(pattern: PatternStudy) -> BoolArray:
    kept = np.ones(len(pattern.paths.points), dtype=bool)
    kept[pattern.paths.offsets[1:] - 1] = False
    return kept


def _steps(pattern: PatternStudy) -> tuple[FloatArray, BoolArray]:
    """Return the steps (s, 2, 2) of the paths of a pattern, and whether each is a link."""
    paths, first = pattern.paths, _first(pattern)
    start = np.flatnonzero(first)
    return np.stack([paths.points[start], paths.points[start + 1]], axis=1), paths.link[start]


def lines_of(axes: Any, lines: Iterable[FloatArray], colour: Any, width: float = 1.0) -> None:
    """Draw polylines (n, 2)."""
    axes.add_collection(LineCollection(list(lines), colors=colour, linewidths=width, zorder=2.5))


def bar(figure: Figure, axes: Any, drawn: Any, label: str) -> None:
    """Draw a colour bar beside a panel."""
    shown = figure.colorbar(drawn, ax=axes, shrink=0.6, pad=0.01, aspect=16)
    shown.set_label(label, size=7)
    shown.ax.tick_params(labelsize=6)


def curves(count: int, labels: Sequence[tuple[str, str]]) -> tuple[Figure, list[Any]]:
    """Figure with plain axes side by side, and their labels."""
    figure = Figure(figsize=(4.6 * count, 3.6), dpi=150.0, facecolor="white")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(1, count, squeeze=False)[0])
    figure.subplots_adjust(0.12 / count, 0.14, 0.99, 0.9, 0.22)
    for panel, (across, up) in zip(axes, labels, strict=True):
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(labelsize=7, colors=INK)
        panel.set_xlabel(across, size=8, color=INK)
        panel.set_ylabel(up, size=8, color=INK)
        panel.grid(color=OUTLINE, alpha=0.2, lw=0.5)
    return figure, axes
