"""What the figures are made of: sections, stress vectors, loads, paths, in panels of one scale."""

from typing import Any

import numpy as np
from matplotlib.collections import LineCollection

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.tensor import in_plane, strongest_in_plane
from ccfem.cases.designed import DesignPlate
from ccfem.comparison.plot.colours import INK, palette
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
    chosen = _one_a_field(middle, float(np.ptp(layer.plane.points, axis=0).max()) / count)
    most = np.quantile(size, 0.97)
    chosen = chosen[size[chosen] > 0.01 * most]
    half = 0.5 * np.ptp(layer.plane.points, axis=0).max() / count
    half = half * np.clip(size[chosen] / most, 0.35, 1.3)
    along = half[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)[chosen]
    for kind, colour in ((pulled[chosen], PULLED), (~pulled[chosen], PRESSED)):
        ends = np.stack([middle[chosen] - along, middle[chosen] + along], axis=1)[kind]
        axes.add_collection(LineCollection(list(ends), colors=colour, linewidths=0.7, zorder=2.0))


def _one_a_field(points: FloatArray, size: float) -> Any:
    """One point for each field of a grid: the one nearest to its middle."""
    field = np.floor(points / size)
    off = np.linalg.norm(points - (field + 0.5) * size, axis=1)
    order = np.lexsort((off, field[:, 1], field[:, 0]))
    _, first = np.unique(field[order], axis=0, return_index=True)
    return order[first]


def path(axes: Any, pattern: PatternStudy, colour: str = STRAND, link: str = LINK) -> None:
    """Draw the paths of a pattern, its links in their own colour, start and end marked if one."""
    paths = pattern.paths
    steps, mask = _path_steps(pattern)
    for kind, stroke in ((~mask, colour), (mask, link)):
        axes.add_collection(LineCollection(list(steps[kind]), colors=stroke, lw=0.45, zorder=2.0))
    if len(paths) == 1:
        axes.plot(*paths.points[0], "o", color=INK, ms=4.0, zorder=3.0)
        axes.plot(*paths.points[-1], "s", color=INK, ms=4.0, zorder=3.0)


def by_level(axes: Any, pattern: PatternStudy, values: FloatArray, unit: str) -> None:
    """Draw the steps of the paths of a pattern, one colour a value (P,), with its share."""
    steps, _ = _path_steps(pattern)
    kept = values[_step_starts(pattern)]
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


def _step_starts(pattern: PatternStudy) -> BoolArray:
    kept = np.ones(len(pattern.paths.points), dtype=bool)
    kept[pattern.paths.offsets[1:] - 1] = False
    return kept


def _path_steps(pattern: PatternStudy) -> tuple[FloatArray, BoolArray]:
    """Return the steps (s, 2, 2) of the paths of a pattern, and whether each is a link."""
    paths, first = pattern.paths, _step_starts(pattern)
    start = np.flatnonzero(first)
    return np.stack([paths.points[start], paths.points[start + 1]], axis=1), paths.link[start]
