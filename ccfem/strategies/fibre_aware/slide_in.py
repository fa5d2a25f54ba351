"""Strands beside the border, slid inwards until they keep their distance from it.

If a strand comes too near the border at a small angle, cutting it would remove a long stretch where
the stress is highest. Instead the strand slides inwards. Its neighbours give way, and so do links
that go round a hole or along an edge.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import line_length
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.paths.linking.finishing import keep_off_border
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.strand_lines import strand_lines
from ccfem.strategies.fibre_aware.strand_spacing import spacing

_DEPTH = 0.8
"""Share of the distance from the border below which lines are cut; the rest of them slides in."""

_ROUNDS = 2
"""Number of slides, each along the normals of the paths after the last one."""

_INNER, _APART = 1.01, 1.004
"""Factors on the distances that slides aim at: from the border, and between strands. A slide only
approaches its aim, and the steps between points cut corners."""


def lines_to_slide_in(
    lines: Sequence[FloatArray], section: Region, inset: float
) -> list[FloatArray]:
    """Parts of lines that `slid_in` can bring to a given distance from the border of a section.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    section : Polygon or MultiPolygon
    inset : float >= 0, mm

    Returns
    -------
    list of (n_i, 2) arrays
        Parts at least 0.8 times the distance off the border. Ends that run onto the border are cut
        at the full distance, since sideways slides do not move them inwards.
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
    """Slide paths inwards where they are too near the border, and slide strands apart.

    Parameters
    ----------
    paths : Toolpaths
        On one flat layer.
    layer : Layer
    machine : Machine
    inset : float
        Least distance from the border, in strand widths.
    radius : float, mm, default 0
        Least radius that bends are corrected to; 0 for none.

    Returns
    -------
    Toolpaths
        Paths in even steps between corners. Ends that are still too near the border are cut.
        Elsewhere strands stay too near where there is no room.
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
    """Paths with points that neighbours have pushed over the border moved back onto it."""
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
    """Paths without ends that are too near the border, where the rest is long enough."""
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
