"""What fibre carries: how much of each strand lies in the part, on nothing else, and is no fold.

A strand is looked at part by part, each about a quarter of a fibre width long (`beads`). Of a part
carries

* the share that has room among strands of its direction: of m that overlap each has the m-th part;
* of the rest, the share whose width lies in the section of its layer;
* of the rest, what lies on no strand that it crosses, unless the strategy crosses by design;
* nothing in a fold (`ccfem.paths.folds`): the tow is folded over there, and leads no force.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.beads import Beads, beads
from ccfem.geometry.polylines import arc_lengths
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import chart_of
from ccfem.paths.folds import Folds, folds_in, joined_folds
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer

_ACROSS = tuple(((np.arange(10) + 0.5) / 10 - 0.5).tolist())
"""Positions across a band, in widths, that are tested for lying inside: a strand along a border is
outside by its tenths, and by the first from a twentieth on."""


def fibre_beads(toolpaths: Toolpaths, machine: Machine, shared: bool = True) -> Beads:
    """Parts of the fibre paths, in the order of ``toolpaths.of_kind(FIBRE)``, with their room.

    `shared` is that of `ccfem.geometry.beads.beads`.
    """
    fibre = toolpaths.of_kind(FIBRE)
    return beads(
        fibre.points,
        fibre.normals,
        fibre.offsets,
        fibre.closed,
        fibre.layer,
        machine.fibre_width,
        machine.strand_height,
        shared,
    )


def width_inside(
    middle: FloatArray, direction: FloatArray, width: float, section: Region
) -> FloatArray:
    """Share (s,) of the width of parts of strands that lies in a section.

    Parameters
    ----------
    middle, direction : (s, 2) arrays, mm and 1
        In the plane of the section.
    """
    share = np.ones(len(middle))
    inner = section.buffer(-0.5 * width * (1.0 + 1e-6))
    near = np.arange(len(share))
    if not inner.is_empty:
        shapely.prepare(inner)
        x, y = np.ascontiguousarray(middle.T)
        near = np.flatnonzero(~shapely.intersects_xy(inner, x, y))
    if not len(near):
        return share
    shapely.prepare(section)
    side = np.column_stack([-direction[near, 1], direction[near, 0]])
    share[near] = 0.0
    for place in _ACROSS:
        x, y = (middle[near] + place * width * side).T
        within = shapely.intersects_xy(section, np.ascontiguousarray(x), np.ascontiguousarray(y))
        share[near] += within / len(_ACROSS)
    return share


class StrandParts(NamedTuple):
    """Parts of the fibre paths, and what of each carries."""

    beads: Beads  # the parts, in the order of ``toolpaths.of_kind(FIBRE)``
    link: BoolArray  # (s,): parts of links
    # (s,) in [0, 1]: share of the width that lies in the section of the layer; 1 where no layers
    # are given
    inside: FloatArray
    folds: Folds  # of the fibre paths
    folded: BoolArray  # (s,): parts whose middle lies in a fold

    def carrying(self, crosses: bool) -> FloatArray:
        """Share (s,) of each part that carries, also where strands cross if they do so by design.

        Where two strands cross, `Beads.every` counts half of each: twice what it misses lies on or
        under the other one.
        """
        alone, every = self.beads.alone, self.beads.every
        free = alone if crosses else np.clip(2.0 * every - alone, 0.0, alone)
        return np.asarray(np.where(self.folded, 0.0, free * self.inside))


def strand_parts(
    toolpaths: Toolpaths, machine: Machine, layers: Sequence[Layer] = (), shared: bool = True
) -> StrandParts:
    """Cut the fibre paths into parts and find what of each carries.

    Parameters
    ----------
    layers : sequence of Layer
        That the paths lie on; without them all width counts as inside.
    shared : bool, default True
        Whether the room of the parts is found; without it nobody knows what carries.
    """
    fibre = toolpaths.of_kind(FIBRE)
    parts = fibre_beads(toolpaths, machine, shared)
    count = np.diff(parts.first)
    arc = (np.arange(len(parts.line)) - parts.first[parts.line] + 0.5) * parts.length
    # Step of each part: arc lengths of all paths on one axis.
    along = arc_lengths(fibre.points, fibre.offsets)
    base = np.concatenate([[0.0], np.cumsum(fibre.lengths + 1.0)])
    axis = along + np.repeat(base[:-1], np.diff(fibre.offsets))
    step = np.searchsorted(axis, arc + base[parts.line], side="right") - 1
    link = fibre.link[step] if len(step) else np.zeros(0, dtype=bool)
    inside = np.ones(len(parts.line))
    on = np.repeat(fibre.layer, count)
    for layer in layers:
        mine = np.flatnonzero(on == layer.index)
        if len(mine):
            plane = _in_plane(layer, parts.middle[mine], parts.direction[mine])
            inside[mine] = width_inside(*plane, machine.fibre_width, _section(layer))
    folds = folds_in(fibre, machine)
    return StrandParts(parts, link, inside, folds, in_folds(folds, parts.line, arc))


def joined_parts(of: Sequence[StrandParts]) -> StrandParts:
    """Parts of several lots of fibre paths as those of all, lot after lot."""
    lines = np.cumsum([0, *(len(parts.folds.lengths) for parts in of)])
    count = np.cumsum([0, *(len(parts.link) for parts in of)])
    columns = zip(*(parts.beads[2:] for parts in of), strict=True)
    beads_of_all = Beads(
        np.concatenate([parts.beads.line + k for parts, k in zip(of, lines, strict=False)]),
        np.append(
            np.concatenate([p.beads.first[:-1] + k for p, k in zip(of, count, strict=False)]),
            count[-1],
        ),
        *(np.concatenate(column) for column in columns),
    )
    return StrandParts(
        beads_of_all,
        np.concatenate([parts.link for parts in of]),
        np.concatenate([parts.inside for parts in of]),
        joined_folds([parts.folds for parts in of]),
        np.concatenate([parts.folded for parts in of]),
    )


def _section(layer: Layer) -> Region:
    """Section of a flat layer, or of the chart of a curved one."""
    return chart_of(layer).flat.plane.polygon


def _in_plane(
    layer: Layer, middle: FloatArray, direction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Parts of strands in the plane of their layer, or in its chart."""
    chart = chart_of(layer)
    image, turned, _ = chart.pieces(middle, direction, np.inf)
    return chart.flat.plane.project(image), chart.flat.plane.project(turned)


def in_folds(folds: Folds, line: IntArray, arc: FloatArray) -> BoolArray:
    """Places on strands that lie in a fold: by their paths, which increase, and arc lengths."""
    folded = np.zeros(len(line), dtype=bool)
    size = folds.lengths[folds.line]
    for k, start, stop, total in zip(
        folds.line.tolist(), folds.start.tolist(), folds.stop.tolist(), size.tolist(), strict=True
    ):
        first, last = np.searchsorted(line, [k, k + 1])
        at = arc[first:last]
        folded[first:last] |= ((at >= start) & (at <= stop)) | (at + total <= stop)
    return folded


def room_of(
    toolpaths: Toolpaths,
    path: IntArray,
    start: FloatArray,
    stop: FloatArray,
    parts: StrandParts,
    crosses: bool = True,
) -> FloatArray:
    """Share of the fibre of pieces of paths that carries.

    Parameters
    ----------
    path : (s,) int array
        Fibre path of each piece.
    start, stop : (s,) arrays, mm
        Arc lengths of the path at its ends.
    parts : StrandParts
        Of the paths.
    crosses
        As of `StrandParts.carrying`.

    Returns
    -------
    (s,) array in [0, 1]
        Mean over each piece: 1 inside the part where no strand of the same direction is nearer than
        a width; 1/N in N copies of a line; 0 in a fold.
    """
    length, first = parts.beads.length, parts.beads.first
    carried = np.concatenate([[0.0], np.cumsum(length * parts.carrying(crosses))])
    axis = np.concatenate([[0.0], np.cumsum(length)])
    number = (np.cumsum(toolpaths.kind == FIBRE) - 1)[path]
    begin, end = axis[first[number]], axis[first[number + 1]]
    low, high = np.minimum(begin + start, end), np.minimum(begin + stop, end)
    mean = np.interp(high, axis, carried) - np.interp(low, axis, carried)
    mean = mean / np.maximum(high - low, 1e-300)
    return np.asarray(np.clip(mean, 0.0, 1.0))
