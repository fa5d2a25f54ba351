"""Pictures of a part in space, from both sides: its faces or patches coloured and named."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.arrays import FloatArray, IntArray
from ccfem.plot.canvas import save
from ccfem.plot.colours import INK

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Arrow", "Label", "draw_part", "part_figure"]

_VIEWS = ((-60.0, 28.0), (120.0, -28.0))
"""Azimuth and elevation of the two views, degrees."""
_SIZE = 6.0
"""Width and height of a view, inches."""
_FIBRE = "#2a7a2a"
"""Borders of the layers that get fibre."""
_SHADE = 0.45
"""How much darker a facet is that faces away from the light."""


@dataclass(frozen=True)
class Label:
    """A word at a place (3,), mm, of a surface with an outward normal (3,)."""

    text: str
    place: FloatArray
    normal: FloatArray


@dataclass(frozen=True)
class Arrow:
    """An arrow of a direction (3,) that ends at a place (3,), mm, with a text at its tail."""

    place: FloatArray
    direction: FloatArray
    colour: str = INK
    text: str = ""


def draw_part(
    points: FloatArray,
    triangles: IntArray,
    colour: Sequence[str],
    labels: Sequence[Label],
    path: Path,
    arrows: Sequence[Arrow] = (),
    title: str = "",
) -> None:
    """Draw a closed surface from two opposite sides into a file: see `part_figure`."""
    save(part_figure(points, triangles, colour, labels, arrows, title), path)


def part_figure(
    points: FloatArray,
    triangles: IntArray,
    colour: Sequence[str],
    labels: Sequence[Label],
    arrows: Sequence[Arrow] = (),
    title: str = "",
    marks: FloatArray | None = None,
    outlines: Sequence[FloatArray] = (),
) -> "Figure":
    """Draw a closed surface from two opposite sides, without perspective.

    Parameters
    ----------
    points : (n, 3) array, mm
    triangles : (t, 3) int array
        Outward.
    colour : sequence of str
        Of each triangle, "#rrggbb".
    labels : sequence of Label
        Written where they face the reader.
    arrows : sequence of Arrow, optional
        Drawn a sixth of the part long.
    title : str, optional
    marks : (k, 3) array, mm, optional
        Places of a support: small triangles.
    outlines : sequence of (n, 3) arrays, mm, optional
        Lines that are seen through the part.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgb
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2.0 * _SIZE, _SIZE), layout="constrained")
    FigureCanvasAgg(figure)
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    base = np.array([to_rgb(each) for each in colour]).reshape(-1, 3)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    for number, view in enumerate(_VIEWS):
        axes = figure.add_subplot(1, 2, number + 1, aspect="equal")
        axes.set_axis_off()
        right, up, towards = _frame(*view)
        light = towards + 0.4 * up - 0.3 * right
        facing = normal @ towards > 0.0
        order = np.flatnonzero(facing)
        depth = points[triangles[order]].mean(axis=1) @ towards
        order = order[np.argsort(depth, kind="stable")]
        shade = np.clip(normal[order] @ light / np.linalg.norm(light), 0.0, 1.0)
        shades = base[order] * (1.0 - _SHADE * (1.0 - shade[:, None]))
        plane = np.stack([points @ right, points @ up], axis=1)
        shapes = list(plane[triangles[order]])
        axes.add_collection(PolyCollection(shapes, facecolors=shades, edgecolors=shades, lw=0.3))
        if marks is not None and len(marks):
            style: dict[str, Any] = {
                "s": 26.0,
                "marker": "^",
                "c": "white",
                "edgecolors": INK,
                "linewidths": 1.0,
            }
            axes.scatter(marks @ right, marks @ up, zorder=3, **style)
        for line in outlines:
            axes.plot(line @ right, line @ up, color=_FIBRE, linewidth=0.9, zorder=2)
        for arrow in arrows:
            along = arrow.direction / max(float(np.linalg.norm(arrow.direction)), 1e-300)
            tail = arrow.place - along * size / 6.0
            if arrow.text:
                at = (float(tail @ right), float(tail @ up))
                axes.text(*at, arrow.text, color=arrow.colour, ha="center", va="center", size=9)
            axes.annotate(
                "",
                (arrow.place @ right, arrow.place @ up),
                (tail @ right, tail @ up),
                arrowprops={"color": arrow.colour, "width": 2.0, "headwidth": 8.0},
            )
        for label in labels:
            if label.normal @ towards > 0.1 or not label.normal.any():
                box = {"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.8}
                at = (float(label.place @ right), float(label.place @ up))
                axes.text(*at, label.text, color=INK, ha="center", va="center", bbox=box, size=9)
        ends = np.array([plane.min(axis=0), plane.max(axis=0)])
        room = 0.12 * float(np.ptp(ends, axis=0).max())
        axes.set_xlim(ends[0, 0] - room, ends[1, 0] + room)
        axes.set_ylim(ends[0, 1] - room, ends[1, 1] + room)
    if title:
        figure.suptitle(title, color=INK)
    return figure


def _frame(azimuth: float, elevation: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Directions (3,) of a picture: to its right, up, and towards the reader."""
    turn, rise = np.radians([azimuth, elevation])
    towards = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    return right, np.cross(towards, right), towards
