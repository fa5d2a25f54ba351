"""Fibre paths on flat layers as lines whose points slide across them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, in_brief, repeated
from ccfem.geometry.polylines import (
    along_line,
    arc_lengths,
    merge_repeated,
    sample_at,
    turning_angles,
)
from ccfem.geometry.tight_bends import tight_bends
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer

_STEP = 0.6
"""Distance between points, in strand widths."""

_CORNER = 0.3
"""Turn, radians, above which a point is a corner and is kept as one."""

_SAME = 1e-6
"""Distance, in widths, up to which neighbouring points are the same."""

_TIGHT = 1.1
"""Bends tighter than this many minimum radii of the machine do not move, and neither do points
within two widths of them: a turn that is squeezed gets tighter still."""

_BESIDE = 2.0

_SMALL_RING = 1.1
"""Rings shorter than this many minimum lengths of the machine do not move: they have no ends that
could be extended."""

_STRETCH, _BEND = 20.0, 200.0
"""Weights of the squared first and second differences between points."""

_HELD = 1e9
"""Weight of points that do not move."""


@dataclass(frozen=True)
class StrandLines:
    """Points of fibre paths, which slide along the initial normals of the paths.

    Smooth slides neither fold lines nor make them overlap themselves.

    Attributes
    ----------
    toolpaths : Toolpaths
        In even steps of about 0.6 widths between corners.
    frame : (3, 3) array
        Axes of all layers: two in their planes, and the normal.
    start : (P, 2) array, mm
        The points in the plane, before they slide.
    normals : (P, 2) array
        Unit vectors across the paths; zero at points that stay.
    path : (P,) int array
        Path of each point.
    arc : (P,) array, mm
        Arc length of the path at each point, before it slides.
    fixed : (P,) bool array
        Points that do not move: of tight bends, of marked links, of rings hardly longer than the
        machine's minimum length, and where a ring closes.
    least : (K,) array, mm
        Length that slides do not reduce a path below: the machine's minimum, or its own if shorter.
    """

    toolpaths: Toolpaths
    frame: FloatArray
    start: FloatArray
    normals: FloatArray
    path: IntArray
    arc: FloatArray
    fixed: BoolArray
    least: FloatArray

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, frame=float, start=float, normals=float, path=int, arc=float, fixed=bool)
        freeze(self, least=float)

    @property
    def offsets(self) -> IntArray:
        """First point of each path, as in CSR."""
        return self.toolpaths.offsets

    @property
    def layer(self) -> IntArray:
        """Number (P,) of the layer of each point."""
        return self.toolpaths.layer[self.path]

    @property
    def heights(self) -> FloatArray:
        """Height (P,), mm, of the points along the normal of the layers."""
        return self.toolpaths.points @ self.frame[2]

    @property
    def roughness(self) -> Any:
        """Matrix (P, P) of ``sum of v^2 + 20 (v')^2 + 200 (v'')^2``, by differences along paths.

        Fixed points are held.
        """
        # By diagonals: of both points of every step, and of all three of every pair of steps.
        one, two = (self.path[k:] == self.path[:-k] for k in (1, 2))
        diagonal = 1.0 + _HELD * self.fixed
        diagonal[:-1] += _STRETCH * one
        diagonal[1:] += _STRETCH * one
        for k, weight in enumerate((1.0, 4.0, 1.0)):
            diagonal[k : len(two) + k] += _BEND * weight * two
        beside = -_STRETCH * one
        beside[:-1] -= 2.0 * _BEND * two
        beside[1:] -= 2.0 * _BEND * two
        bands = [diagonal, beside, beside, _BEND * two, _BEND * two][: 2 * len(diagonal) - 1]
        return sp.diags_array(bands, offsets=[0, 1, -1, 2, -2][: len(bands)], format="csc")

    def points(self, slide: FloatArray) -> FloatArray:
        """Points (P, 2), mm, in the plane, after slides (P,), mm."""
        points = self.start + slide[:, None] * self.normals
        return self._drawn_out(points)

    def slid(self, slide: FloatArray) -> Toolpaths:
        """Toolpaths after slides (P,), mm."""
        off = (self.points(slide) - self.start) @ self.frame[:2]
        return replace(self.toolpaths, points=self.toolpaths.points + off)

    def _drawn_out(self, points: FloatArray) -> FloatArray:
        """Points (P, 2), with the ends of paths that are too short extended straight."""
        step = np.linalg.norm(np.diff(points, axis=0), axis=1) * (self.path[1:] == self.path[:-1])
        length = np.bincount(self.path[1:], step, len(self.toolpaths))
        missing = self.least - length
        for k in np.flatnonzero((missing > 0.0) & ~self.toolpaths.closed).tolist():
            first, last = self.offsets[k], self.offsets[k + 1] - 1
            ends = [end for end in ((first, 1), (last, -1)) if not self.fixed[end[0]]]
            for end, inward in ends or [(first, 1)]:
                out = points[end] - points[end + inward]
                share = missing[k] / max(len(ends), 1)
                points[end] += share * out / max(float(np.linalg.norm(out)), 1e-12)
        return points


def strand_lines(
    fibre: Toolpaths, layers: Sequence[Layer], machine: Machine, hold: bool = True
) -> StrandLines:
    """Points of fibre paths that may slide.

    Parameters
    ----------
    fibre : Toolpaths
        Fibre only, on flat layers.
    layers : sequence of Layer
        At least one; all have the same axes.
    machine : Machine
        With its fibre width, least radius and least length.
    hold : bool, default True
        Whether tight bends, marked links and small rings stay fixed. The point where a ring closes
        always does.
    """
    fibre = fibre.select(fibre.lengths > _SAME * machine.fibre_width)
    frame, paths = layers[0].plane.frame, _in_even_steps(fibre, machine.fibre_width)
    offsets, points = paths.offsets, paths.points @ frame[:2].T
    path = np.repeat(np.arange(len(paths)), np.diff(offsets))
    fixed = hold & (paths.link | np.roll(paths.link, 1))
    lengths = paths.lengths
    for k, (first, end) in enumerate(pairwise(offsets)):
        closed = bool(paths.closed[k])
        fixed[[first, end - 1]] |= closed
        if hold:
            fixed[first:end] |= _bent(points[first:end], closed, machine)
            fixed[first:end] |= closed and lengths[k] < _SMALL_RING * machine.shortest_strand
    return StrandLines(
        toolpaths=paths,
        frame=frame,
        start=points,
        normals=np.where(fixed[:, None], 0.0, _normals(points, offsets, path)),
        path=path,
        arc=arc_lengths(points, offsets),
        fixed=fixed,
        least=np.minimum(fibre.lengths, machine.shortest_strand),
    )


def _in_even_steps(paths: Toolpaths, width: float) -> Toolpaths:
    """Paths in even steps between their corners, which stay, and the ends of their links."""
    points, offsets, kept = merge_repeated(paths.points, paths.offsets, _SAME * width)
    points[offsets[1:] - 1] = paths.points[paths.offsets[1:] - 1]
    path, along = np.repeat(np.arange(len(paths)), np.diff(offsets)), arc_lengths(points, offsets)
    link = paths.link[np.append(kept[1:], len(paths.points)) - 1]  # of the last of equal points
    corner = turning_angles(points, offsets, np.zeros(len(paths), dtype=bool)) > _CORNER
    ends = np.zeros(len(points), dtype=bool)
    ends[offsets[:-1]], ends[offsets[1:] - 1] = True, True
    cut = np.flatnonzero(ends | corner | (link != np.roll(link, 1)))
    first, last = cut[:-1], cut[1:]
    first, last = first[path[first] == path[last]], last[path[first] == path[last]]
    size = along[last] - along[first]
    parts = np.maximum(1, np.round(size / (_STEP * width))).astype(np.int64)
    stretch, number = repeated(parts)
    place = along[first][stretch] + number * (size / parts)[stretch]
    line = np.concatenate([path[first][stretch], np.arange(len(paths))])
    order = np.argsort(line, kind="stable")
    place = np.concatenate([place, along[offsets[1:] - 1]])[order]
    resampled, _ = sample_at(points, offsets, line[order], place)
    counts = np.bincount(line, minlength=len(paths))
    bounds = np.concatenate([[0], np.cumsum(counts)])
    resampled[bounds[1:] - 1] = points[offsets[1:] - 1]
    return replace(
        paths,
        points=resampled,
        normals=np.repeat(paths.normals[paths.offsets[:-1]], counts, axis=0),
        offsets=bounds,
        link=np.concatenate([link[first][stretch], np.zeros(len(paths), dtype=bool)])[order],
    )


def _normals(points: FloatArray, offsets: IntArray, path: IntArray) -> FloatArray:
    """Find unit normals (P, 2) of polylines, to the left of the line between both neighbours."""
    number = np.arange(len(points))
    before = np.maximum(number - 1, offsets[:-1][path])
    after = np.minimum(number + 1, offsets[1:][path] - 1)
    step = points[after] - points[before]
    left = np.stack([-step[:, 1], step[:, 0]], axis=1)
    return np.asarray(left / np.linalg.norm(left, axis=1)[:, None])


def _bent(line: FloatArray, closed: bool, machine: Machine) -> BoolArray:
    """Points (n,) of a line in tight bends, or near to them."""
    along, width = along_line(line), machine.fibre_width
    bent = np.zeros(len(line), dtype=bool)
    for start, end in tight_bends(line, along, closed, _TIGHT * machine.minimum_radius, width):
        low, high = start - _BESIDE * width, end + _BESIDE * width
        bent |= (along >= low) & (along <= high)
        if closed:  # a bend may extend over the start, from either side
            bent |= (along + along[-1] >= low) & (along + along[-1] <= high)
            bent |= (along - along[-1] >= low) & (along - along[-1] <= high)
    return bent
