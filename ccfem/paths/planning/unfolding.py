"""Strands without folds: led round more widely where there is room, otherwise cut.

A fold (`ccfem.paths.folds`) is replaced by the shortest curve of the machine's least radius from a
place before it to one behind it (Dubins), or of the least radius that does not fold. Where that
curve would come too near to another strand or to the border, the strand ends before the fold, and
another begins behind it.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.geometry.dubins import shortest_curve
from ccfem.geometry.polylines import along_line, is_closed, line_length, pack, points_along
from ccfem.geometry.shapes import Region, strings
from ccfem.machine.machine import Machine
from ccfem.paths.folds import MARGIN, WINDOW, Folds, folds
from ccfem.paths.linking.joining import Joined
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer

_RADII = (1.0, 0.75)
"""Radii of curves that replace a fold, in least radii of the machine; a circle of 0.66 folds."""

_REACHES = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)
"""Distances before and behind a fold at which a curve may leave the strand, in windows."""

_DETOUR = 1.3
"""Length of such a curve over that of the strand that it replaces, at most."""

_CLEARANCE, _INSET = 0.9, 0.48
"""Least distances of such a curve from other strands, and from the border, in widths."""

_STEP = 0.25
"""Longest step of such a curve, in widths."""

_JAG, _SHARP = 0.2, 0.6
"""A jag: a corner by more than this angle, radians, at a piece below this length, in widths."""

_ROUNDS = 4
"""Number of times that the pieces of a strand are cut again."""

_Marked = tuple[FloatArray, BoolArray]
"""Points (n, d) of a line, and the mask (n,) of its steps that are links."""


def may_fold(strategy: object) -> bool:
    """Whether the strands of a strategy may fold.

    Those of published patterns that turn back by design do, and paths of pixels, whose corners lie
    at every pixel: `folds`, a parameter or class variable, and a `mode` that is "raster".
    """
    return bool(getattr(strategy, "folds", False)) or getattr(strategy, "mode", "") == "raster"


def unfolded(joined: Joined, section: Region, machine: Machine, least: float) -> Joined:
    """Lead strands round their folds, or cut them there.

    Parameters
    ----------
    joined : Joined
        Lines (n_i, 2), mm, and which of their steps are links.
    section : Polygon or MultiPolygon
        In which they lie.
    machine : Machine
        With its least radius and its fibre width.
    least : float, mm
        Pieces of cut lines that are shorter are dropped.

    Returns
    -------
    Joined
        Lines without folds as they were; the pieces of each line in its order.
    """
    lines, radius = joined.lines, MARGIN * machine.minimum_radius
    bends = _folds_of(lines, radius)
    if not len(bends.line):
        return joined
    rounding = _Rounding(lines, section, machine)
    result = Joined([], [])
    for k, marked in enumerate(zip(*joined, strict=True)):
        pieces = [marked]
        if bends.counts[k]:
            pieces = _parts_without_folds(rounding.led_round(k, *marked), radius, least)
        result.lines.extend(line for line, _ in pieces)
        result.link.extend(link for _, link in pieces)
    return result


def unfolded_paths(paths: Toolpaths, layer: Layer | None, machine: Machine) -> Toolpaths:
    """Fibre of one layer, led round its folds or cut there; on a curved layer it is only cut.

    Points of jags are left out first: where levels cross the corner of a triangle, or rings that of
    a section, strands of smooth fields waver by hundredths of a width. Paths that are final have no
    layer: they are only cut, and folds looked for without a margin.
    """
    least, radius = machine.shortest_strand, machine.minimum_radius
    radius *= MARGIN if layer is not None else 1.0
    paths = _without_jags(paths, machine.fibre_width, least)
    bends = folds(paths.points, paths.offsets, paths.closed, radius, strict=True)
    folded = (bends.counts > 0) & (paths.kind == FIBRE)
    if not folded.any():
        return paths
    spans = [slice(a, b) for a, b in pairwise(paths.offsets)]
    rounding: _Rounding | None = None
    if layer is not None and layer.flat is not None:
        plane = [layer.plane.project(paths.points[span]) for span in spans]
        rounding = _Rounding(plane, layer.plane.polygon, machine)
    # Points and normals of each path side by side, so that both are cut together.
    columns: list[FloatArray] = []
    links: list[BoolArray] = []
    source = []
    for k, span in enumerate(spans):
        pieces = [(np.hstack([paths.points[span], paths.normals[span]]), paths.link[span])]
        if folded[k] and rounding is not None and layer is not None:
            cut = _parts_without_folds(
                rounding.led_round(k, plane[k], paths.link[span]), radius, least
            )
            up = paths.normals[span.start]
            pieces = [(_in_space(line, layer, up), link) for line, link in cut]
        elif folded[k]:
            pieces = _parts_without_folds(pieces[0], radius, least)
        columns += [line for line, _ in pieces]
        links += [link for _, link in pieces]
        source += len(pieces) * [k]
    if not columns:
        return Toolpaths.empty()
    stacked = np.concatenate(columns)
    return replace(
        paths,
        points=stacked[:, :3],
        normals=stacked[:, 3:] / np.linalg.norm(stacked[:, 3:], axis=1)[:, None],
        offsets=np.concatenate([[0], np.cumsum([len(line) for line in columns])]),
        layer=paths.layer[source],
        kind=paths.kind[source],
        closed=paths.closed[source] & [is_closed(line[:, :3]) for line in columns],
        link=np.concatenate(links),
    )


def _without_jags(paths: Toolpaths, width: float, least: float) -> Toolpaths:
    """Leave out points at sharp corners beside short pieces, until there are none.

    Ends stay, and so do the jags of paths that would become shorter than the least length, mm.
    """
    while len(paths.points) > 2:
        step = np.diff(paths.points, axis=0)
        length = np.linalg.norm(step, axis=1)
        unit = step / np.maximum(length, 1e-300)[:, None]
        sharp = np.einsum("ij,ij->i", unit[1:], unit[:-1]) < np.cos(_SHARP)
        short = np.minimum(length[1:], length[:-1]) < _JAG * width
        jag = np.zeros(len(paths.points), dtype=bool)
        jag[1:-1] = sharp & short
        jag[paths.offsets[:-1]] = jag[paths.offsets[1:] - 1] = False
        jag[1:] &= ~jag[:-1]  # of two beside each other the first one
        at = np.flatnonzero(jag)
        path = np.searchsorted(paths.offsets, at, side="right") - 1
        across = np.linalg.norm(paths.points[at + 1] - paths.points[at - 1], axis=1)
        lost = np.bincount(path, length[at - 1] + length[at] - across, len(paths))
        too_short = (paths.lengths >= least) & (paths.lengths - lost < least)
        jag[at[too_short[path]]] = False
        if not jag.any():
            break
        paths = paths.with_points(~jag)
    return paths


def without_folds(paths: Toolpaths, layers: Sequence[Layer], machine: Machine) -> Toolpaths:
    """Paths of several layers, led round their folds or cut there: see `unfolded_paths`."""
    return Toolpaths.concatenate(
        unfolded_paths(paths.on_layer(layer.index), layer, machine) for layer in layers
    )


def part_of_line(
    line: FloatArray, along: FloatArray, link: BoolArray, start: float, stop: float
) -> _Marked:
    """Part of a line (n, c) between two places of its arc length, and which of its steps are links.

    All columns are interpolated by the arc length (n,), mm. On a closed line `stop` may exceed the
    length; the part then runs on over the start.
    """
    size = float(along[-1])
    if start >= size:
        start, stop = start - size, stop - size
    twice = np.append(along[:-1], along + size)
    inner = twice[(twice > start + 1e-9) & (twice < stop - 1e-9)]
    place = np.concatenate([[start], inner, [stop]])
    place = place[np.append(True, np.diff(place) > 1e-9)]
    middle = 0.5 * (place[1:] + place[:-1])
    # An end that rounding puts behind the last point is that point: a line need not be closed.
    place = np.where(place > size + 1e-9, place - size, np.minimum(place, size))
    step = np.searchsorted(along, np.where(middle > size, middle - size, middle), "right") - 1
    marks = np.append(link[np.clip(step, 0, len(link) - 2)], False)
    return points_along(line, along, place), marks


def off_links(
    start: FloatArray, stop: FloatArray, along: FloatArray, link: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Move starts and ends of pieces off links to the strands between; to nothing without any."""
    if not link.any():
        return start, stop
    strand, size = np.flatnonzero(~link[:-1]), float(along[-1])
    first = np.concatenate([along[strand] + k * size for k in range(3)])  # pieces run over the end
    last = np.concatenate([along[strand + 1] + k * size for k in range(3)])
    after = np.searchsorted(last, start, side="right")
    before = np.searchsorted(first, stop) - 1
    first, last = np.append(first, np.inf), np.append(last, np.inf)
    return np.maximum(start, first[after]), np.minimum(stop, last[before])


def _folds_of(lines: Sequence[FloatArray], radius: float) -> Folds:
    """Folds of lines (n_i, c); the first three columns of more than three are the points."""
    points, offsets = pack(list(lines))
    closed = np.array([is_closed(line) for line in lines], dtype=bool)
    return folds(points[:, :3], offsets, closed, radius, strict=True)


def _in_space(line: FloatArray, layer: Layer, normal: FloatArray) -> FloatArray:
    """Points in space and their normals, (n, 6), of a line (n, 2) on a flat layer."""
    points = layer.plane.to_space(line)
    return np.hstack([points, np.broadcast_to(normal, points.shape)])


def _parts_without_folds(marked: _Marked, radius: float, least: float) -> list[_Marked]:
    """Parts of a line (n, c) without folds, or the line itself, as far as they are long enough."""
    pieces, again = [marked], _ROUNDS
    while again:
        bends = _folds_of([line for line, _ in pieces], radius)
        if not len(bends.line):
            break
        again -= 1
        number, start, stop = bends.free()
        parts: list[_Marked] = []
        for k, (line, link) in enumerate(pieces):
            if not bends.counts[k]:
                parts.append((line, link))
                continue
            along, inside = along_line(line[:, :3]), number == k
            a, b = off_links(start[inside], stop[inside], along, link)
            long = b - a >= least
            parts += [
                part_of_line(line, along, link, *ends)
                for ends in zip(a[long], b[long], strict=True)
            ]
        pieces = parts
        if not pieces:
            break
    # A line led round its folds is shorter than it was.
    return [marked for marked in pieces if line_length(marked[0][:, :3]) >= least * (1.0 - 1e-9)]


class _Curve(NamedTuple):
    """Points (n, 2) of a curve, mm, and the places of a line, by arc length, that it joins."""

    points: FloatArray
    start: float
    stop: float


class _Rounding:
    """Curves that replace folds, and the room for them."""

    def __init__(self, lines: Sequence[FloatArray], section: Region, machine: Machine) -> None:
        self.width, self.radius = machine.fibre_width, machine.minimum_radius
        self.window = WINDOW * self.radius
        self.room = shapely.buffer(section, -_INSET * self.width)
        shapely.prepare(self.room)
        self.strands = strings(lines)
        self.tree = shapely.STRtree(self.strands)
        self.curves: list[shapely.LineString] = []

    def _folds_of(self, lines: Sequence[FloatArray]) -> Folds:
        return _folds_of(lines, MARGIN * self.radius)

    def led_round(self, k: int, line: FloatArray, link: BoolArray) -> _Marked:
        """Lead line number k (n, 2) round as many of its folds as there is room for."""
        bends = self._folds_of([line])
        if bends.longest_free[0] < self.window:
            return line, link  # a wave or a meander of folds: no curve could leave and meet it
        if is_closed(line):
            # From the middle of the longest part without folds on, a ring is like an open line.
            _, start, stop = bends.free()
            if not len(start):
                return line, link
            longest = int(np.argmax(stop - start))
            middle, along = 0.5 * float(start[longest] + stop[longest]), along_line(line)
            line, link = part_of_line(line, along, link, middle, middle + float(along[-1]))
            line[-1] = line[0]
            bends = self._folds_of([line])
        for start, stop in zip(bends.start[::-1], bends.stop[::-1], strict=True):
            line, link = self._without(k, line, link, float(start), float(stop)) or (line, link)
        return line, link

    def _without(
        self, k: int, line: FloatArray, link: BoolArray, start: float, stop: float
    ) -> _Marked | None:
        """Line with a curve in place of the fold between two places; None without room for it."""
        along = along_line(line)
        curves = self._possible_curves(line, along, start, stop)
        curves = [curve for curve in curves if self._clear(k, line, along, curve)]
        # What folds is told for all curves at once, each with a window of the line on both sides.
        near = [_replaced(line, along, curve, self.window) for curve in curves]
        fitting = np.flatnonzero(self._folds_of(near).counts == 0)
        if not len(fitting):
            return None
        curve = curves[fitting[0]]
        self.curves.append(shapely.linestrings(curve.points))
        marked = link[np.searchsorted(along, curve.start) : np.searchsorted(along, curve.stop)]
        before, after = along < curve.start - 1e-9, along > curve.stop + 1e-9
        marks = [link[before], np.full(len(curve.points), marked.any()), link[after]]
        whole = np.concatenate(marks)
        whole[-1] = False
        return _replaced(line, along, curve, np.inf), whole

    def _possible_curves(
        self, line: FloatArray, along: FloatArray, start: float, stop: float
    ) -> list[_Curve]:
        """Curves, no detours, in place of the part of a line between two places, best first."""
        curves = []
        for radius in _RADII:
            for reach in _REACHES:
                a, b = start - reach * self.window, stop + reach * self.window
                if a < 0.0 or b > along[-1]:
                    break
                points = self._shortest(line, along, a, b, radius * self.radius)
                if line_length(points) <= _DETOUR * (b - a):
                    curves.append(_Curve(points, a, b))
        return curves

    def _shortest(
        self, line: FloatArray, along: FloatArray, a: float, b: float, radius: float
    ) -> FloatArray:
        """Shortest curve of a radius that leaves a line at one place and meets it at another."""

        def pose(place: float) -> FloatArray:
            near = np.clip(place + 0.5 * self.width * np.array([-1.0, 1.0]), 0.0, along[-1])
            (x, y), (u, v) = points_along(line, along, near)
            here = points_along(line, along, np.array([place]))[0]
            return np.array([*here, np.arctan2(v - y, u - x)])

        return shortest_curve(pose(a), pose(b), radius, _STEP * self.width)

    def _clear(self, k: int, line: FloatArray, along: FloatArray, curve: _Curve) -> bool:
        """Whether a curve keeps its distances from the border, other strands and its own line."""
        string, apart = shapely.linestrings(curve.points), _CLEARANCE * self.width
        if not shapely.covers(self.room, string):
            return False
        near = self.tree.query(string, predicate="dwithin", distance=apart)
        if (near != k).any():
            return False
        rest = (
            line[along < curve.start - 2.0 * self.width],
            line[along > curve.stop + 2.0 * self.width],
        )
        parts = [*self.curves, *(shapely.linestrings(part) for part in rest if len(part) > 1)]
        return not (parts and shapely.dwithin(string, np.array(parts), apart).any())


def _replaced(line: FloatArray, along: FloatArray, curve: _Curve, window: float) -> FloatArray:
    """Line with a curve in place of a part, as far as a window before and behind that part."""
    first = max(int(np.searchsorted(along, curve.start - window)) - 1, 0)
    last = int(np.searchsorted(along, curve.stop + window)) + 1
    before = np.searchsorted(along, curve.start - 1e-9)
    after = np.searchsorted(along, curve.stop + 1e-9, side="right")
    return np.concatenate([line[first:before], curve.points, line[after:last]])
