"""Curved layers and the fibre on them in space: a picture, and a page on which they turn."""

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.comparison.plot.canvas import canvas
from ccfem.geometry.polylines import resample
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_VIEWS = ((25.0, -35.0), (5.0, 0.0), (70.0, 0.0))
"""Elevation and azimuth, degrees, of each view."""
_STEP = 1.5
"""Distance of the points that are drawn, mm."""


def _axes_up(points: FloatArray, up: FloatArray) -> FloatArray:
    """Points with a direction turned to the third axis."""
    axis = int(np.argmax(np.abs(up)))
    return np.roll(points, 2 - axis, axis=-1) if up[axis] > 0.0 else points


def _lines(layers: Sequence[Layer], paths: Toolpaths) -> list[tuple[int, FloatArray]]:
    """Strands, thinned out, with the place of their layer in the stack."""
    place = {layer.index: k for k, layer in enumerate(layers)}
    fibre = paths.of_kind(FIBRE)
    points, offsets = resample(fibre.points, fibre.offsets, _STEP)
    lines = np.split(points, offsets[1:-1]) if len(fibre) else []
    return [(place[int(k)], line) for k, line in zip(fibre.layer, lines, strict=True)]


def space_picture(
    layers: Sequence[Layer],
    paths: Toolpaths,
    title: str = "",
    build: Sequence[float] = (0.0, 0.0, 1.0),
) -> "Figure":
    """Draw the strands in space from three sides, coloured from the first layer to the last.

    Parameters
    ----------
    layers : sequence of Layer
        Their borders are drawn in grey.
    build : sequence of 3 floats
        Upwards in the picture.
    """
    from matplotlib import colormaps
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    up = np.asarray(build, dtype=np.float64)
    lines = _lines(layers, paths)
    borders = [
        _axes_up(layer.points[np.append(loop, loop[:1])], up)
        for layer in layers[:: max(1, len(layers) // 30)]
        for loop in layer.loops
    ]
    colours = colormaps["viridis"](np.linspace(0.0, 0.95, max(len(layers), 2)))
    strands = [_axes_up(line, up) for _, line in lines]
    shades = [colours[k] for k, _ in lines]
    everything = np.concatenate([*borders, *strands])
    low, high = everything.min(axis=0), everything.max(axis=0)
    figure = canvas(13.5, 5.0)
    for number, (elevation, azimuth) in enumerate(_VIEWS):
        axes = figure.add_subplot(1, len(_VIEWS), number + 1, projection="3d")
        axes.add_collection3d(Line3DCollection(borders, colors="0.75", linewidths=0.4))
        axes.add_collection3d(Line3DCollection(strands, colors=shades, linewidths=0.7))
        axes.set_proj_type("ortho")
        axes.view_init(elevation, azimuth)
        axes.set_box_aspect(np.maximum(high - low, 1e-3), zoom=0.98)
        for axis, a, b in zip("xyz", low, high, strict=True):
            getattr(axes, f"set_{axis}lim")(a, max(b, a + 1e-3))
        axes.set_axis_off()
    figure.suptitle(title)
    figure.subplots_adjust(0.0, 0.0, 1.0, 0.95, 0.0, 0.0)
    return figure


def turning_page(
    layers: Sequence[Layer], paths: Toolpaths, title: str, build: Sequence[float] = (0.0, 0.0, 1.0)
) -> str:
    """Write a page, complete in itself, on which the strands turn under the mouse.

    Parameters
    ----------
    build : sequence of 3 floats
        Upwards at the start.

    Returns
    -------
    str
        HTML. A slider cuts the stack off at a layer; dragging turns, the wheel zooms.
    """
    up = np.asarray(build, dtype=np.float64)
    place = {layer.index: k for k, layer in enumerate(layers)}
    rims = [
        (place[layer.index], _axes_up(layer.points[np.append(loop, loop[:1])], up))
        for layer in layers[:: max(1, len(layers) // 30)]
        for loop in layer.loops
    ]
    strands = [(k, _axes_up(line, up)) for k, line in _lines(layers, paths)]
    data = {
        name: [[k, line.round(2).tolist()] for k, line in lines]
        for name, lines in (("strands", strands), ("rims", rims))
    }
    text = json.dumps({**data, "count": len(layers)}, separators=(",", ":"))
    page = Path(__file__).with_name("stack_page.html").read_text(encoding="utf-8")
    return page.replace("@TITLE@", escape(title)).replace("@DATA@", text)
