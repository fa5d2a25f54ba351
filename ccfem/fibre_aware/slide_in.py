"""Strands beside the border slid in until they keep their distance from it.

Where a strand comes too near to the border at a small angle, cutting it takes far more than what is
too near, and in the places of the highest stress. It is slid in, neighbours give way, and so do the
links that go round a hole or along an edge.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from ccfem.arrays import FloatArray
from ccfem.fibre_aware.strand_lines import strand_lines
from ccfem.fibre_aware.strand_spacing import spacing
from ccfem.geometry.polylines import line_length
from ccfem.geometry.shapes import Region
from ccfem.layers.layer import Layer
from ccfem.linking.finishing import keep_off_border
from ccfem.machine.machine import Machine
from ccfem.toolpaths import Toolpaths

__all__ = ["lines_to_slide_in", "slid_in"]

_DEPTH = 0.8
"""Of the distance from the border: what lies nearer is cut, the rest slides in."""

_ROUNDS = 2
"""Slides, each along the normals of where the last one ended."""

_INNER, _APART = 1.01, 1.004
"""Distances that strands slide to, over those from the border and of each other: a slide comes only
near to what is wanted, and steps between points cut corners."""


def lines_to_slide_in(
    lines: Sequence[FloatArray], section: Region, inset: float
) -> list[FloatArray]:
    """Parts of lines that `slid_in` can bring to a distance from the border of a section.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    section : Polygon or MultiPolygon
    inset : float >= 0, mm

    Returns
    -------
    list of (n_i, 2) arrays
        At least 0.8 times the distance off the border. Ends that run onto it are cut at all of it:
        sideways slides do not take them farther in.
    """
    found = []
    for line in keep_off_border(lines, section, _DEPTH * inset):
        kept = keep_off_border([line], section, inset)
        cut = len(kept) == 1 and line_length(line) - line_length(kept[0]) < inset
        found.append(kept[0] if cut else line)
    return found


def slid_in(
    paths: Toolpaths, layer: Layer, machine: Machine, inset: float, radius: float = 0.0
) -> Toolpaths:
    """Slide what lies too near to the border in, and strands apart.

    Parameters
    ----------
    paths : Toolpaths
        On one flat layer.
    layer : Layer
    machine : Machine
    inset : float
        Least distance from the border, in strand widths.
    radius : float, mm, default 0
        Least radius that bends are drawn to keep; 0 for any.

    Returns
    -------
    Toolpaths
        Paths in even steps between corners. Ends that are still too near to the border are cut;
        elsewhere strands stay too near where there is no room.
    """
    width = machine.fibre_width
    if not len(paths):
        return paths
    for _ in range(_ROUNDS):
        lines = strand_lines(paths, (layer,), machine, hold=False)
        off = _INNER * inset * width
        apart = spacing(lines, (layer,), _APART * width, off, come_in=True, radius=radius)
        paths = lines.slid(apart.spread(np.zeros(len(lines.path))))
    return _ends_cut(_back_inside(paths, layer), layer, inset * width, machine)


def _back_inside(paths: Toolpaths, layer: Layer) -> Toolpaths:
    """Paths with the points that neighbours have pushed over the border back on it."""
    section, frame = layer.plane.polygon, layer.plane.frame[:2]
    places = shapely.points(paths.points @ frame.T)
    shapely.prepare(section)
    out = np.flatnonzero(~shapely.covers(section, places))
    ways = shapely.shortest_line(places[out], shapely.boundary(section))
    steps = np.diff(shapely.get_coordinates(ways).reshape(-1, 2, 2), axis=1)[:, 0]
    points = paths.points.copy()
    points[out] += steps @ frame
    return replace(paths, points=points)


def _ends_cut(paths: Toolpaths, layer: Layer, inset: float, machine: Machine) -> Toolpaths:
    """Paths without the ends that are nearer to the border, where they stay long enough."""
    border = shapely.boundary(layer.plane.polygon)
    shapely.prepare(border)
    places = shapely.points(paths.points @ layer.plane.frame[:2].T)
    missing = inset - shapely.distance(places, border)
    left = paths.lengths - np.minimum(paths.lengths, machine.minimum_length)
    cut = []
    for k, (first, end) in enumerate(pairwise(paths.offsets)):
        points, link, short = paths.points[first:end], paths.link[first:end], missing[first:end]
        for _ in range(2):  # one end, then the other
            points, link, short = points[::-1], np.roll(link[::-1], -1), short[::-1]
            number = int(np.argmax(short <= 0.0))
            if number == 0 or paths.closed[k]:
                continue
            share = short[number] / (short[number] - short[number - 1])
            place = points[number] + share * (points[number - 1] - points[number])
            off = line_length(np.concatenate([points[:number], place[None]]))
            if off <= min(left[k], 2.0 * machine.fibre_width):
                left[k] -= off
                points = np.concatenate([place[None], points[number:]])
                link, short = link[number - 1 :], np.concatenate([[0.0], short[number:]])
        cut.append((points, link))
    counts = [len(points) for points, _ in cut]
    normals = np.repeat(paths.normals[paths.offsets[:-1]], counts, axis=0)
    return replace(
        paths,
        points=np.concatenate([points for points, _ in cut]),
        normals=normals,
        offsets=np.concatenate([[0], np.cumsum(counts)]),
        link=np.concatenate([link for _, link in cut]),
    )
