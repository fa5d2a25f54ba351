"""Pictures of a part in space, from both sides, coloured and named; and of designs."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.comparison.plot.canvas import canvas, colour_bar, new_figure, save, scale_bar, title
from ccfem.comparison.plot.colours import INK
from ccfem.fem.topopt.design import Design

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ccfem.body.mesh.tet_mesh import TetMesh

_VIEWS = ((-60.0, 28.0), (120.0, -28.0))
"""Azimuth and elevation of the two views, degrees."""
_SIZE = 6.0
"""Width of a view, inches; it is as high, or as high as the part needs."""
_LOWEST = 0.3
"""Least height of a view over its width."""
_BOX = {"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.8}
"""Round words, so that they are read on dark facets too."""
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
    marks : (k, 3) array, mm, optional
        Places of a support: small triangles where they are seen.
    outlines : sequence of (n, 3) arrays, mm, optional
        Lines that are seen through the part.
    """
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgb

    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    tails = [each.place - size / 6.0 * _unit(each.direction) for each in arrows]
    shown = np.concatenate([points, np.reshape(tails, (-1, 3))])
    sides = [_sides(shown, *_frame(*view)[:2]) for view in _VIEWS]
    high = max(float((each[1, 1] - each[0, 1]) / (each[1, 0] - each[0, 0])) for each in sides)
    height = _SIZE * min(max(high, _LOWEST), 1.0)
    figure = canvas(2.0 * _SIZE, height, layout="constrained")
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    base = np.array([to_rgb(each) for each in colour]).reshape(-1, 3)
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
            seen = marks[_seen(marks, points, triangles[order], _frame(*view), 1e-3 * size)]
            axes.scatter(seen @ right, seen @ up, zorder=3, **style)
        for line in outlines:
            axes.plot(line @ right, line @ up, color=_FIBRE, linewidth=0.9, zorder=2)
        for arrow, tail in zip(arrows, tails, strict=True):
            if arrow.text:
                _name_arrow(axes, arrow, tail, right, up)
            axes.annotate(
                "",
                (arrow.place @ right, arrow.place @ up),
                (tail @ right, tail @ up),
                arrowprops={"color": arrow.colour, "width": 2.0, "headwidth": 8.0},
            )
        for label in labels:
            if label.normal @ towards > 0.1 or not label.normal.any():
                at = (float(label.place @ right), float(label.place @ up))
                axes.text(*at, label.text, color=INK, ha="center", va="center", bbox=_BOX, size=9)
        axes.set_xlim(*sides[number][:, 0])
        axes.set_ylim(*sides[number][:, 1])
    if title:
        figure.suptitle(title, color=INK)
    return figure


def _unit(direction: FloatArray) -> FloatArray:
    return np.asarray(direction / max(float(np.linalg.norm(direction)), 1e-300))


def _sides(points: FloatArray, right: FloatArray, up: FloatArray) -> FloatArray:
    """Lowest and highest coordinates (2, 2) of a picture, with room round the points."""
    plane = np.stack([points @ right, points @ up], axis=1)
    room = 0.12 * float(np.ptp(plane, axis=0).max())
    return np.array([plane.min(axis=0) - room, plane.max(axis=0) + room])


def _name_arrow(
    axes: Any, arrow: Arrow, tail: FloatArray, right: FloatArray, up: FloatArray
) -> None:
    """Write the text of an arrow behind its tail, or above one that points at the reader."""
    along = _unit(arrow.direction)
    x, y = float(along @ right), float(along @ up)
    level = abs(x) > abs(y)
    axes.annotate(
        arrow.text,
        (tail @ right, tail @ up),
        xytext=(-6.0 * np.sign(x), 0.0) if level else (0.0, -6.0 if y > 0.0 else 6.0),
        textcoords="offset points",
        color=arrow.colour,
        ha=("right" if x > 0.0 else "left") if level else "center",
        va="center" if level else ("top" if y > 0.0 else "bottom"),
        bbox=_BOX,
        size=9,
    )


def _seen(
    places: FloatArray,
    points: FloatArray,
    facing: IntArray,
    frame: tuple[FloatArray, FloatArray, FloatArray],
    tolerance: float,
) -> BoolArray:
    """Whether no facing triangle lies before each place (k, 3), by more than a tolerance, mm."""
    a, b, c = np.moveaxis((points @ np.stack(frame, axis=1))[facing], 1, 0)
    u, v = b - a, c - a
    area = np.maximum(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], 1e-300)
    seen = np.ones(len(places), dtype=bool)
    for k, (x, y, depth) in enumerate(places @ np.stack(frame, axis=1)):
        p, q = x - a[:, 0], y - a[:, 1]
        s, t = (p * v[:, 1] - q * v[:, 0]) / area, (q * u[:, 0] - p * u[:, 1]) / area
        over = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
        seen[k] = not (over & (a[:, 2] + s * u[:, 2] + t * v[:, 2] > depth + tolerance)).any()
    return seen


def _frame(azimuth: float, elevation: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Directions (3,) of a picture: to its right, up, and towards the reader."""
    turn, rise = np.radians([azimuth, elevation])
    towards = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    return right, np.cross(towards, right), towards


# Pictures of designs: densities with the outline of the part; a part in space by its surface.


_OUTLINE = "#c0392b"
_SURFACE = "#9ec1e3"


def design_picture(design: Design, planform: Any, part: "TetMesh", heading: str) -> "Figure":
    """Draw a design.

    Parameters
    ----------
    design : Design
        Of tetrahedra.
    planform : shapely Polygon, mm, or None
        Outline of the part of a sheet; without it the surface of the part is drawn.
    part : TetMesh
        Of the part.
    """
    if planform is None:
        colour = [_SURFACE] * len(part.boundary)
        return part_figure(part.points, part.boundary, colour, (), title=heading)
    mesh = design.full.mesh
    points = mesh.points[:, :2]
    cells = np.sort(mesh.cells, axis=1)
    low = mesh.points[:, 2] < mesh.points[:, 2].mean()
    # Of the three tetrahedra of a prism, one has its three lower corners.
    base = np.flatnonzero(low[cells].sum(axis=1) == 3)
    triangles = cells[base][low[cells[base]]].reshape(-1, 3)
    low_, high = points.min(axis=0), points.max(axis=0)
    figure, (axes,) = new_figure((*low_, *high))
    shown = axes.tripcolor(
        *points.T, triangles, facecolors=design.density[base], cmap="Greys", vmin=0.0, vmax=1.0
    )
    for ring in (planform.exterior, *planform.interiors):
        axes.plot(*shapely.get_coordinates(ring).T, color=_OUTLINE, linewidth=0.8)
    colour_bar(axes, shown.cmap, (0.0, 1.0), "density")
    scale_bar(axes)
    title(axes, heading)
    return figure
