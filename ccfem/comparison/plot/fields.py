"""Picture of the tension in a layer, which paths follow."""

from typing import TYPE_CHECKING

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.tensor import in_plane, largest_in_plane
from ccfem.comparison.plot.canvas import colour_bar, extents_of, new_figure, scale_bar, title
from ccfem.comparison.plot.colours import INK
from ccfem.comparison.plot.paths import draw_section, draw_stress, tension_limit
from ccfem.slicing.layers.layer import Layer, LayerStress

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STROKES = 45
"""Strokes across the larger extent of a section."""


def tension_picture(
    stress: LayerStress, heading: str = "", caption: str = "", limit: float | None = None
) -> "Figure":
    """Picture of the tension in a layer: its size as colour, its direction as strokes.

    Parameters as in `plot.paths.layer_picture`; the nodal values of the stress are drawn.
    """
    layer = stress.layer
    figure, (axes,) = new_figure(extents_of(layer.plane.points))
    end = tension_limit(stress) if limit is None else limit
    draw_section(axes, layer, filled=False)
    colours = draw_stress(axes, stress, end)
    plane = in_plane(stress.nodal[layer.triangles].mean(axis=1), layer.plane.frame)
    largest, _, angle = largest_in_plane(plane)
    _draw_directions(
        axes, layer, np.stack([np.cos(angle), np.sin(angle)], axis=1), largest > 0.02 * end
    )
    colour_bar(axes, colours, (0.0, end), "MPa tension")
    scale_bar(axes)
    title(axes, heading, caption)
    return figure


def _draw_directions(axes: "Axes", layer: Layer, direction: FloatArray, shown: BoolArray) -> None:
    """Draw strokes along directions (t, 2) of the triangles shown, evenly spread over a section."""
    from matplotlib.collections import LineCollection

    middle = layer.plane.points[layer.triangles].mean(axis=1)
    size = float(np.ptp(layer.plane.points, axis=0).max()) / _STROKES
    kept = np.flatnonzero(shown)
    # One triangle for each field of a grid: the one nearest to the middle of the field.
    field = np.floor(middle[kept] / size)
    off = np.linalg.norm(middle[kept] - (field + 0.5) * size, axis=1)
    order = np.lexsort((off, field[:, 1], field[:, 0]))
    _, first = np.unique(field[order], axis=0, return_index=True)
    chosen = kept[order[first]]
    half = 0.42 * size * direction[chosen]
    strokes = np.stack([middle[chosen] - half, middle[chosen] + half], axis=1)
    axes.add_collection(
        LineCollection(list(strokes), colors=INK, linewidths=0.8, zorder=2.0), autolim=False
    )
