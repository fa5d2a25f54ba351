"""Fibre paths as the report draws them: fewer points, and values on the pieces between these."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.tensor import in_plane, largest_in_plane
from ccfem.comparison.runs import Run
from ccfem.geometry.locate import locate
from ccfem.geometry.polylines import arc_lengths, resample, subdivide, turning_angles
from ccfem.paths.fields.chart import chart_of
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress

_TURN = np.radians(6.0)
"""Points at which a path turns by more than this always stay."""
_REACH = 0.05
"""Pieces no further than this, mm, outside a section take the stress of its edge."""


@dataclass(frozen=True)
class DrawnPaths:
    """Paths of one run, thinned out.

    Attributes
    ----------
    points : (P, 3) array, mm
    offsets : (K + 1,) int array
        Path k holds ``points[offsets[k]:offsets[k + 1]]``.
    layer : (K,) int array
        Index of the layer of each path.
    link : (P,) bool array
        Whether the piece from each point to the next one is a link.
    force : (P,) array, N
        Axial force in the piece from each point to the next one; NaN where it is not known.
    curvature : (P,) array, 1/mm
        At the middle of that piece, as `ccfem.judging.evaluation.indices.curvature` samples it.
    """

    points: FloatArray
    offsets: IntArray
    layer: IntArray
    link: BoolArray
    force: FloatArray
    curvature: FloatArray


def drawn_paths(run: Run, step: float, width: float) -> DrawnPaths:
    """Thin out the fibre of a run.

    Parameters
    ----------
    run : Run
    step : float, mm
        Points stay about so far apart; where a path turns sharply all stay.
    width : float, mm
        Of the fibre: the step that curvature is taken over.
    """
    number = np.flatnonzero(run.toolpaths.kind == FIBRE)
    paths = run.toolpaths.of_kind(FIBRE)
    points, offsets, arcs, link = _thinned(paths, step)
    ahead = np.minimum(np.arange(len(points)) + 1, len(points) - 1)
    middle = 0.5 * (arcs + arcs[ahead])
    line = np.repeat(np.arange(len(paths)), np.diff(offsets))
    force = np.full(len(points), np.nan)
    if run.tested is not None:
        test = run.tested.bracket.tension
        s = test.strands
        force = _nearest(s.path, s.arc, test.axial_force, number[line], middle)
    curvature = _curvature(paths, width, line, middle)
    return DrawnPaths(points, offsets, paths.layer, link, force, curvature)


def _thinned(paths: Toolpaths, step: float) -> tuple[FloatArray, IntArray, FloatArray, BoolArray]:
    """Points, offsets, arc length along the path as it was, and links."""
    points, offsets, link = paths.points, paths.offsets, paths.link
    arcs = arc_lengths(points, offsets)
    kept = turning_angles(points, offsets, paths.closed) > _TURN
    cell = np.floor(arcs / step)
    kept[1:] |= (cell[1:] != cell[:-1]) | (link[1:] != link[:-1])
    kept[offsets[:-1]] = kept[offsets[1:] - 1] = True
    before = np.concatenate([[0], np.cumsum(kept)])
    points, arcs, link = points[kept], arcs[kept], link[kept]
    found, offsets, start = subdivide(points, before[offsets], 2.0 * step)
    end = np.minimum(start + 1, len(points) - 1)
    whole = np.linalg.norm(points[end] - points[start], axis=1)
    share = np.linalg.norm(found - points[start], axis=1) / np.maximum(whole, 1e-300)
    return (
        found,
        offsets,
        arcs[start] + np.minimum(share, 1.0) * (arcs[end] - arcs[start]),
        link[start],
    )


def _nearest(
    line: IntArray, arc: FloatArray, values: FloatArray, wanted: IntArray, at: FloatArray
) -> FloatArray:
    """Value at the arc length nearest to each wanted one on the same line; NaN where none is."""
    found = np.full(len(at), np.nan)
    if not len(line):
        return found
    reach = 1.0 + max(float(arc.max()), float(at.max(initial=0.0)))
    order = np.argsort(line * reach + arc, kind="stable")
    keys, sought = (line * reach + arc)[order], wanted * reach + at
    after = np.searchsorted(keys, sought)
    best = np.full(len(at), np.inf)
    for place in (after - 1, after):
        inside = np.clip(place, 0, len(keys) - 1)
        away = np.abs(keys[inside] - sought)
        nearer = (line[order[inside]] == wanted) & (away < best)
        best = np.where(nearer, away, best)
        found = np.where(nearer, values[order[inside]], found)
    return found


def _curvature(paths: Toolpaths, width: float, line: IntArray, at: FloatArray) -> FloatArray:
    """Curvature, 1/mm, at arc lengths of paths: turn between equal steps of about a fibre width."""
    points, offsets = resample(paths.points, paths.offsets, width)
    arcs = arc_lengths(points, offsets)
    steps = arcs[offsets[1:] - 1] / np.maximum(np.diff(offsets) - 1, 1)
    of = np.repeat(np.arange(len(paths)), np.diff(offsets))
    turns = turning_angles(points, offsets, paths.closed) / np.maximum(steps[of], 1e-300)
    return _nearest(of, arcs, turns, line, at)


def in_layer(points: FloatArray, layer: Layer) -> FloatArray:
    """Points (n, 3) of a layer in its plane, or in the chart of a curved one: (n, 2), mm."""
    if layer.flat is not None:
        return layer.plane.project(points)
    return chart_of(layer).images(points)[:, :2]


def angle_on_layer(plane: FloatArray, stress: LayerStress) -> FloatArray:
    """Angle, degrees, of each step from a point to the next to the larger in-plane stress.

    Parameters
    ----------
    plane : (n, 2) array, mm
        In the plane of the layer.
    stress : LayerStress
        Of the flat view of the layer.

    Returns
    -------
    (n,) array in [0, 90]
        NaN at the last point, and where a piece lies outside the layer.
    """
    found = np.full(len(plane), np.nan)
    if len(plane) < 2:
        return found
    layer = stress.layer
    middle, along = 0.5 * (plane[1:] + plane[:-1]), np.diff(plane, axis=0)
    triangle, weights = locate(layer.plane.points, layer.triangles, middle, _REACH)
    inside = np.flatnonzero(triangle >= 0)
    corners = in_plane(stress.nodal, layer.plane.frame)[layer.triangles[triangle[inside]]]
    _, _, direction = largest_in_plane(np.einsum("qk,qkc->qc", weights[inside], corners))
    off = np.abs(np.arctan2(along[inside, 1], along[inside, 0]) - direction) % np.pi
    found[inside] = np.degrees(np.minimum(off, np.pi - off))
    return found
