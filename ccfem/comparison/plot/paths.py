"""Pictures of one layer: its section, the tension in it, and the fibre paths."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.tensor import in_plane, largest_in_plane
from ccfem.comparison.plot import canvas
from ccfem.comparison.plot.colours import INK, LINK, OUTLINE, SECTION, palette, scale
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LINE = 0.45
"""Width of a drawn strand over the fibre width, so that neighbours stay apart in the picture."""


_A_ROW = 4
"""Pictures that stand in one row."""


@dataclass(frozen=True)
class Coloured:
    """Straight pieces of fibre with a value each, to colour the paths by."""

    segments: FloatArray  # (s, 2, 2), mm: both ends of each piece in the plane of the layer
    values: FloatArray  # (s,)
    label: str  # unit, and quantity if wanted, for the colour bar
    limits: tuple[float, float]  # values at the ends of the colour scale


def force_on_paths(
    middle: FloatArray, tangent: FloatArray, length: FloatArray, force: FloatArray, layer: Layer
) -> Coloured:
    """Axial force in the pieces of fibre of a flat layer, N.

    Pieces of all layers are given by their middle (s, 3), mm, unit tangent (s, 3), length (s,), mm,
    and force (s,), N. The scale ends at the force that 99 % of those of the layer stay below.
    """
    plane = layer.plane
    here = np.abs(middle @ plane.frame[2] - plane.height) < 1e-6 * (1.0 + abs(plane.height))
    along = 0.5 * length[here, None] * plane.project(tangent[here])
    centre = plane.project(middle[here])
    most = float(np.quantile(force[here], 0.99)) if here.any() else 1.0
    pieces = np.stack([centre - along, centre + along], axis=1)
    return Coloured(pieces, force[here], "N in the fibre", (0.0, max(most, 1e-12)))


def tension_limit(stress: LayerStress) -> float:
    """Tension, MPa, that 98 % of the layer's area stay below: the end of a colour scale.

    At least a tiny positive number, so that a layer without tension has a scale too.
    """
    values = _tension(stress)[stress.layer.triangles].mean(axis=1)
    order = np.argsort(values, kind="stable")
    below = np.cumsum(stress.layer.areas[order])
    if not len(order):
        return 1e-12
    place = min(int(np.searchsorted(below, 0.98 * below[-1])), len(order) - 1)
    return max(float(values[order[place]]), 1e-12)


def _tension(stress: LayerStress) -> FloatArray:
    """Larger principal stress in the plane at the layer's points, (n,), MPa, 0 where negative."""
    largest, _, _ = largest_in_plane(in_plane(stress.nodal, stress.layer.plane.frame))
    return np.maximum(largest, 0.0)


def picture_extents(
    layer: Layer, toolpaths: Iterable[Toolpaths]
) -> tuple[float, float, float, float]:
    """Extents, mm, of a layer with fibre paths on it, whose links may lie outside the section."""
    points = [layer.plane.points]
    for paths in toolpaths:
        wanted = paths.select((paths.layer == layer.index) & (paths.kind == FIBRE))
        points.append(layer.plane.project(wanted.points))
    return canvas.extents_of(np.concatenate(points))


def draw_section(axes: "Axes", layer: Layer, filled: bool = True) -> None:
    """Draw the border of a layer's section, and the section in grey."""
    from matplotlib.collections import PathCollection
    from matplotlib.path import Path

    corners = [layer.plane.points[np.append(loop, loop[:1])] for loop in layer.loops]
    if not corners:
        return
    outline = Path.make_compound_path(*[Path(ring, closed=True) for ring in corners])
    face = SECTION if filled else "none"
    axes.add_collection(
        PathCollection([outline], facecolor=face, edgecolor=OUTLINE, linewidth=0.7, zorder=1.5),
        autolim=False,
    )


def draw_stress(axes: "Axes", stress: LayerStress, limit: float) -> Any:
    """Colour a layer by its tension, from none to `limit`, MPa; returns the colour map."""
    layer, colours = stress.layer, scale("stress")
    axes.tripcolor(
        *layer.plane.points.T,
        layer.triangles,
        _tension(stress),
        shading="gouraud",
        cmap=colours,
        vmin=0.0,
        vmax=limit,
        rasterized=True,
        zorder=1.0,
    )
    return colours


def _draw_paths(axes: "Axes", layer: Layer, paths: Toolpaths, width: float) -> list["Artist"]:
    """Draw the fibre paths of a layer in one colour, and their links, below them, in another."""
    from matplotlib.collections import LineCollection

    drawn: list[Artist] = []

    wanted = paths.select((paths.layer == layer.index) & (paths.kind == FIBRE))
    strands, links = _strands_and_links(wanted, layer)
    for lines, shown, order in ((links, LINK, 1.9), (strands, INK, 2.0)):
        shape = LineCollection(
            lines,
            colors=shown,
            linewidths=_points(axes, _LINE * width),
            capstyle="round",
            joinstyle="round",
            zorder=order,
        )
        axes.add_collection(shape, autolim=False)
        drawn.append(shape)
    return drawn


def _strands_and_links(paths: Toolpaths, layer: Layer) -> tuple[list[FloatArray], list[FloatArray]]:
    """Paths cut where links begin and end: the strands, and the links, as (n, 2) arrays, mm."""
    lines: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    plane = layer.plane.project(paths.points)
    for start, end in pairwise(paths.offsets.tolist()):
        link = paths.link[start : end - 1]
        if not len(link):
            continue
        turns = [0, *(np.flatnonzero(np.diff(link)) + 1).tolist(), len(link)]
        for first, last in pairwise(turns):
            lines[int(link[first])].append(plane[start + first : start + last + 1])
    return lines


def _draw_segments(axes: "Axes", coloured: Coloured, width: float) -> Any:
    """Draw pieces of fibre coloured by their values; returns the colour map."""
    from matplotlib.collections import LineCollection

    colours = scale("size")
    pieces = LineCollection(
        list(coloured.segments),
        cmap=colours,
        linewidths=_points(axes, _LINE * width),
        capstyle="round",
        zorder=2.0,
    )
    pieces.set_array(coloured.values)
    pieces.set_clim(*coloured.limits)
    axes.add_collection(pieces, autolim=False)
    return colours


def mark_failure(axes: "Axes", point: FloatArray, label: str = "") -> None:
    """Mark the spot (2,), mm, where a part fails first."""
    axes.plot(*point, "o", ms=11, mfc="none", mec="white", mew=3.5, zorder=3.0)
    axes.plot(*point, "o", ms=11, mfc="none", mec="#a51f2d", mew=1.8, zorder=3.1)
    if label:
        axes.annotate(
            label,
            (float(point[0]), float(point[1])),
            xytext=(9, 9),
            textcoords="offset points",
            size=8,
            weight="bold",
            color="#a51f2d",
            bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.85},
            zorder=3.2,
        )


def _points(axes: "Axes", length: float) -> float:
    """Size in points of a length, mm, on the axes, at least that of a hairline."""
    return max(72.0 * canvas.inches_per_mm(axes) * length, 0.3)


def layer_picture(
    layer: Layer,
    stress: LayerStress | None,
    paths: Toolpaths,
    width: float,
    heading: str = "",
    caption: str = "",
    limit: float | None = None,
    coloured: Coloured | None = None,
    colour: str | None = None,
) -> "Figure":
    """Picture of the paths of one layer.

    Parameters
    ----------
    stress : LayerStress or None
        Its tension colours the section, unless the paths have colours of their own.
    paths : Toolpaths
        Of the whole part, or of this layer.
    width : float, mm
        Of a strand (`Machine.fibre_width`).
    heading, caption : str
        Title, and a line with key numbers.
    limit : float, MPa, optional
        End of the colour scale of the tension; default `tension_limit` of the layer. Give the same
        for pictures that are compared.
    coloured : Coloured, optional
        Pieces drawn instead of the paths in one colour.
    colour : str, optional
        Of the mark before the heading: that of the strategy.
    """
    figure, (axes,) = canvas.new_figure(picture_extents(layer, [paths]))
    _draw(axes, layer, stress, paths, width, limit, coloured)
    canvas.title(axes, heading, caption, colour)
    return figure


def layer_pictures(
    layer: Layer,
    stress: LayerStress,
    paths: Mapping[str, Toolpaths],
    width: float,
    captions: Mapping[str, str],
    limit: float,
    colours: Mapping[str, str],
) -> dict[str, bytes]:
    """Pictures of the paths of several strategies on one layer, as PNG files.

    All show the same part of the plane; what lies under the paths is drawn once.

    Parameters
    ----------
    layer, stress, width, limit
        As in `layer_picture`.
    captions, colours : mappings of strategy name to str
        Lines with key numbers, and marks.
    """
    figure, (axes,) = canvas.new_figure(picture_extents(layer, paths.values()))
    _draw_background(axes, layer, stress, limit)
    canvas.scale_bar(axes)
    above = []
    for name, lines in paths.items():
        heading = f"{name}, layer {layer.index}"
        drawn = _draw_paths(axes, layer, lines, width)
        above.append(drawn + canvas.title(axes, heading, captions[name], colours[name]))
    return dict(zip(paths, canvas.png_series(figure, above), strict=True))


def _draw_background(
    axes: "Axes", layer: Layer, stress: LayerStress | None, limit: float | None
) -> None:
    """Draw the section, and the tension in it where it is given."""
    draw_section(axes, layer, filled=stress is None)
    if stress is not None:
        end = tension_limit(stress) if limit is None else limit
        canvas.colour_bar(axes, draw_stress(axes, stress, end), (0.0, end), "MPa tension")


def compare_layer(
    layer: Layer,
    stress: LayerStress | None,
    paths: Mapping[str, Toolpaths],
    width: float,
    captions: Mapping[str, str] | None = None,
    limit: float | None = None,
) -> "Figure":
    """Picture of one layer with the paths of several strategies, at most four in a row.

    Parameters
    ----------
    layer, stress, width, limit
        As in `layer_picture`.
    captions : mapping of strategy name to str, optional
        Lines with key numbers.
    """
    rows = max(1, -(-len(paths) // _A_ROW))
    columns = max(1, -(-len(paths) // rows))
    figure, places = canvas.new_figure(picture_extents(layer, paths.values()), columns, rows)
    for left in places[max(len(paths), 1) :]:
        left.remove()
    colours = palette(paths)
    for axes, (name, lines) in zip(places[: len(paths)], paths.items(), strict=True):
        _draw(axes, layer, stress, lines, width, limit)
        canvas.title(axes, name, (captions or {}).get(name, ""), colours[name])
    return figure


def _draw(
    axes: "Axes",
    layer: Layer,
    stress: LayerStress | None,
    paths: Toolpaths,
    width: float,
    limit: float | None,
    coloured: Coloured | None = None,
) -> None:
    """One picture without its title."""
    _draw_background(axes, layer, stress if coloured is None else None, limit)
    if coloured is not None:
        colours = _draw_segments(axes, coloured, width)
        canvas.colour_bar(axes, colours, coloured.limits, coloured.label)
    else:
        _draw_paths(axes, layer, paths, width)
    canvas.scale_bar(axes)
