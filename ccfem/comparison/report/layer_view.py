"""Layers as the report draws them: border, tension and its direction, error, paths of every run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.tensor import in_plane, largest_in_plane
from ccfem.comparison.plot.canvas import extents_of
from ccfem.comparison.plot.paths import tension_limit
from ccfem.comparison.report.packing import Rounded, as_bytes
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.shown import caption, drawn_layers, middle_layer
from ccfem.geometry.polylines import arc_lengths, resample, subdivide, turning_angles
from ccfem.paths.fields.chart import chart_of, flat_view
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress, flat_layers, stress_on

# Fibre paths as the report draws them: fewer points, and values on the pieces between these.


_TURN = np.radians(6.0)
"""Points at which a path turns by more than this always stay."""
_REACH = 0.05
"""Pieces no further than this, mm, outside a section take the stress of its edge."""


@dataclass(frozen=True)
class DrawnPaths:
    """Paths of one run, thinned out."""

    points: FloatArray  # (P, 3), mm
    offsets: IntArray  # (K + 1,): path k holds ``points[offsets[k]:offsets[k + 1]]``
    layer: IntArray  # (K,): index of the layer of each path
    link: BoolArray  # (P,): whether the piece from each point to the next one is a link
    # (P,), N: axial force in the piece from each point to the next one; NaN where it is not known
    force: FloatArray
    broken: BoolArray  # (K,): whether the path breaks a rule for strands (`StrandVerdict`)
    # (P,), 1/mm: at the middle of that piece, as `ccfem.judging.evaluation.indices.curvature`
    # samples it
    curvature: FloatArray


def drawn_paths(run: Run, step: float, width: float, layer: int | None = None) -> DrawnPaths:
    """Thin out the fibre of a run.

    Parameters
    ----------
    step : float, mm
        Points stay about so far apart; where a path turns sharply all stay.
    width : float, mm
        Of the fibre: the step that curvature is taken over.
    layer : int, optional
        Index of the one that is drawn. Default: all.
    """
    fibre = run.toolpaths.kind == FIBRE
    chosen = fibre if layer is None else fibre & (run.toolpaths.layer == layer)
    number, paths = np.flatnonzero(chosen), run.toolpaths.select(chosen)
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
    broken = run.strand_verdict.strands(int(fibre.sum()))[chosen[fibre]]
    return DrawnPaths(points, offsets, paths.layer, link, force, broken, curvature)


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
    thinned, offsets, start = subdivide(points, before[offsets], 2.0 * step)
    end = np.minimum(start + 1, len(points) - 1)
    whole = np.linalg.norm(points[end] - points[start], axis=1)
    share = np.linalg.norm(thinned - points[start], axis=1) / np.maximum(whole, 1e-300)
    return (
        thinned,
        offsets,
        arcs[start] + np.minimum(share, 1.0) * (arcs[end] - arcs[start]),
        link[start],
    )


def _nearest(
    line: IntArray, arc: FloatArray, values: FloatArray, wanted: IntArray, at: FloatArray
) -> FloatArray:
    """Value at the arc length nearest to each wanted one on the same line; NaN where none is."""
    nearest = np.full(len(at), np.nan)
    if not len(line):
        return nearest
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
        nearest = np.where(nearer, values[order[inside]], nearest)
    return nearest


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
    chart = chart_of(layer)
    return chart.flat.plane.project(chart.images(points))


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
    angle = np.full(len(plane), np.nan)
    if len(plane) < 2:
        return angle
    layer = stress.layer
    middle, along = 0.5 * (plane[1:] + plane[:-1]), np.diff(plane, axis=0)
    triangle, weights = layer.plane_triangles.locate(middle, _REACH)
    inside = np.flatnonzero(triangle >= 0)
    corners = in_plane(stress.nodal, layer.plane.frame)[layer.triangles[triangle[inside]]]
    _, _, direction = largest_in_plane(np.einsum("qk,qkc->qc", weights[inside], corners))
    off = np.abs(np.arctan2(along[inside, 1], along[inside, 0]) - direction) % np.pi
    angle[inside] = np.degrees(np.minimum(off, np.pi - off))
    return angle


_POINTS = 150_000
"""Points of all paths together: about a megabyte."""
_STEPS = (1.5, 3.0)
"""Distances of the points of a path, fibre widths: the second where the first are too many."""
_STEP = 0.01
"""What coordinates are rounded to, mm."""
_CELLS, _FEW_CELLS, _STROKES = 128, 80, 40
"""Cells across a map of tension, with many layers, and strokes of its direction."""
_MANY = 30
"""Layers from which on maps are coarse."""


def layer_views(stacks: Mapping[str, Comparison], colours: Mapping[str, str]) -> dict[str, Any]:
    """Return what the page draws of layers and paths.

    Parameters
    ----------
    stacks : mapping of name to Comparison
        Of each slicing; of one alone, its name is empty.

    Returns
    -------
    dict
        A tree for `ccfem.comparison.report.packing.pack`: ``stacks``, each with layers and runs,
        and the ends of the scales, which are the same everywhere.
    """
    step, total = _step(stacks)
    shown = _shown(stacks, total)
    lines = {
        (name, run.name): [
            drawn_paths(run, step, stack.case.machine.fibre_width, layer.index)
            for layer in shown[name]
        ]
        for name, stack in stacks.items()
        for run in stack.succeeded
    }
    stresses = {
        name: [stress_on(flat_view(k), stack.planned_on) for k in shown[name]]
        for name, stack in stacks.items()
    }
    tension = max(
        (tension_limit(s) for of_layer in stresses.values() for s in of_layer), default=1e-12
    )
    machine = next(iter(stacks.values())).case.machine
    most = 1.0 if machine.minimum_radius <= 0.0 else 2.0 / machine.minimum_radius
    forces = [_most_force(drawn) for drawn in lines.values() if drawn]
    scales = {
        "tension": tension,
        "force": max(forces, default=0.0) or 1e-12,
        "angle": 90.0,
        "curvature": most,
    }
    layer_list = []
    for name, stack in stacks.items():
        runs = {run.name: lines[name, run.name] for run in stack.succeeded}
        views = [
            _layer(layer, stress, stack, scales, len(shown[name]))
            for layer, stress in zip(shown[name], stresses[name], strict=True)
        ]
        paths = [
            _run(run, runs[run.name], shown[name], stresses[name], scales, colours)
            for run in stack.ranking
            if run.name in runs
        ]
        layer_list.append(
            {
                "name": name,
                "count": len(stack.layers),
                "first": [k.index for k in shown[name]].index(middle_layer(stack).index),
                "layers": views,
                "runs": paths,
            }
        )
    return {"stacks": layer_list, "scales": scales, "step": step, "width": machine.fibre_width}


def _step(stacks: Mapping[str, Comparison]) -> tuple[float, int]:
    """Distance of points, mm, that the number of all paths asks for, and their number."""
    step, total = 0.0, 0
    for times in _STEPS:
        total = 0
        for stack in stacks.values():
            step = times * stack.case.machine.fibre_width
            for run in stack.succeeded:
                fibre = run.toolpaths.of_kind(FIBRE)
                of_layers = (fibre.on_layer(k) for k in np.unique(fibre.layer).tolist())
                total += sum(len(_thinned(paths, step)[0]) for paths in of_layers)
        if total <= _POINTS:
            break
    return step, total


def _shown(stacks: Mapping[str, Comparison], total: int) -> dict[str, list[Layer]]:
    """Layers of each stack that are drawn: all, or every second, third ... of too many points."""
    every = max(1, int(np.ceil(total / _POINTS)))
    shown = {}
    for name, stack in stacks.items():
        drawn = drawn_layers(stack)
        always = [k.index for k in drawn].index(middle_layer(stack).index)
        shown[name] = drawn[always % every :: every]
    return shown


def _most_force(layers: Sequence[DrawnPaths]) -> float:
    """Force, N, that 99 % of the pieces that are drawn stay below."""
    force = np.concatenate([paths.force for paths in layers])
    known = force[~np.isnan(force)]
    return float(np.quantile(known, 0.99)) if len(known) else 0.0


def _layer(
    layer: Layer,
    stress: LayerStress,
    comparison: Comparison,
    scales: Mapping[str, float],
    layers: int,
) -> dict[str, Any]:
    """Border and maps of a layer."""
    flat = stress.layer
    loops = [np.append(loop, loop[:1]) for loop in flat.loops]
    corner = np.concatenate([np.zeros(0, dtype=np.int64), *loops])
    box = extents_of(flat.plane.points)
    where = "curved, laid flat"
    space: Any = Rounded(layer.points[corner], _STEP)
    if layer.flat is not None:
        where = f"at {layer.flat.height:.2f} mm of the build direction"
        space = [*layer.flat.frame.ravel().tolist(), layer.flat.height]
    return {
        "index": layer.index,
        "where": where,
        "box": box,
        "rims": Rounded(flat.plane.points[corner], _STEP),
        "rim_offsets": np.cumsum([0, *map(len, loops)]),
        "space": space,
        **_maps(stress, box, comparison, scales["tension"], layers),
    }


def _maps(
    stress: LayerStress, box: Sequence[float], comparison: Comparison, limit: float, layers: int
) -> dict[str, Any]:
    """Tension and error on a raster from the upper left on, and direction on a coarser one."""
    layer = stress.layer
    cells = _CELLS if layers <= _MANY else _FEW_CELLS
    points, shape = _raster(box, cells)
    triangle, weights = layer.plane_triangles.locate(points, _size(box) / cells)
    plane = in_plane(stress.nodal, layer.plane.frame)[layer.triangles[triangle]]
    largest, _, _ = largest_in_plane(np.einsum("qk,qkc->qc", weights, plane))
    error = comparison.stress.error.densities(comparison.stress.mesh.volumes)[layer.cell]
    end = max(float(np.quantile(error, 0.98)), 1e-12) if len(error) else 1.0
    away = triangle < 0
    strokes, strokes_shape = _raster(box, _STROKES)
    at, share = layer.plane_triangles.locate(strokes)
    tensor = in_plane(stress.nodal, layer.plane.frame)[layer.triangles[at]]
    size, _, angle = largest_in_plane(np.einsum("qk,qkc->qc", share, tensor))
    shown = (at >= 0) & (size > 0.02 * limit)
    return {
        "shape": shape,
        "tension": as_bytes(np.where(away, np.nan, np.maximum(largest, 0.0)), limit),
        "error": as_bytes(np.where(away, np.nan, error[triangle]), end),
        "error_limit": end,
        "stroke_shape": strokes_shape,
        "strokes": as_bytes(np.where(shown, np.mod(angle, np.pi), np.nan), np.pi),
    }


def _size(box: Sequence[float]) -> float:
    return max(box[2] - box[0], box[3] - box[1], 1e-9)


def _raster(box: Sequence[float], cells: int) -> tuple[FloatArray, tuple[int, int]]:
    """Middles of square cells of a box, row by row from its upper left; columns and rows."""
    side = _size(box) / cells
    columns = max(1, int(np.ceil((box[2] - box[0]) / side - 1e-9)))
    rows = max(1, int(np.ceil((box[3] - box[1]) / side - 1e-9)))
    x = box[0] + (np.arange(columns) + 0.5) * side
    y = box[3] - (np.arange(rows) + 0.5) * side
    return np.stack([np.tile(x, rows), np.repeat(y, columns)], axis=1), (columns, rows)


def _run(
    run: Run,
    drawn: Sequence[DrawnPaths],
    layers: Sequence[Layer],
    stresses: Sequence[LayerStress],
    scales: Mapping[str, float],
    colours: Mapping[str, str],
) -> dict[str, Any]:
    """Paths of a run on each of the layers that are shown."""
    views = []
    for paths, layer, stress in zip(drawn, layers, stresses, strict=True):
        views.append({"caption": caption(run, layer), **_paths(paths, layer, stress, scales)})
    return {
        "name": run.name,
        "colour": colours[run.name],
        "layers": views,
        "failure": _failure(run, layers),
        "tested": run.tested is not None,
    }


def _paths(
    paths: DrawnPaths, layer: Layer, stress: LayerStress, scales: Mapping[str, float]
) -> dict[str, Any]:
    """Return the paths of a run on one layer."""
    plane = in_layer(paths.points, layer)
    curved = {} if layer.flat is not None else {"space": Rounded(paths.points, _STEP)}
    return {
        "points": Rounded(plane, _STEP),
        "offsets": paths.offsets,
        "force": as_bytes(np.maximum(paths.force, 0.0), scales["force"]),
        "angle": as_bytes(angle_on_layer(plane, stress), scales["angle"]),
        "curvature": as_bytes(paths.curvature, scales["curvature"]),
        "link": paths.link.astype(np.uint8) if paths.link.any() else None,
        "broken": paths.broken.astype(np.uint8) if paths.broken.any() else None,
        **curved,
    }


def _failure(run: Run, layers: Sequence[Layer]) -> dict[str, Any] | None:
    """Where the part first fails, with the place of the nearest of the layers that are flat."""
    failure = None if run.tested is None else run.tested.failure
    if failure is None:
        return None
    where = np.asarray(failure.where, dtype=np.float64)
    place = {"what": failure.what, "load": failure.load, "where": where.tolist()}
    flat = flat_layers(layers)
    if not flat:
        return place
    away = [abs(float(where @ layer.plane.frame[2]) - layer.plane.height) for layer in flat]
    nearest = flat[int(np.argmin(away))]
    number = next(k for k, layer in enumerate(layers) if layer is nearest)
    return {**place, "layer": number, "at": nearest.plane.project(where).tolist()}
