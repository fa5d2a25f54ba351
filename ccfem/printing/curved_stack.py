"""Curved layers as they are printed: support, then the matrix of each layer, then its fibre.

Islands are their connected pieces. Each is printed after those that it rests on. Within this
constraint, an island that would obstruct the head above another one is printed after it, worst
cases first. The remaining order is layer by layer.
"""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.parallel import in_threads
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.cones import groups_in_cones
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.polylines import starts_segment
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import chart_of, flat_view
from ccfem.paths.splitting.printed_strands import PrintedStrands
from ccfem.paths.toolpaths import FIBRE, MATRIX, SUPPORT, Toolpaths
from ccfem.printing.bed_layout import Place
from ccfem.printing.laid_layer import COORDINATE_DIGITS, LaidLayer, Stack, in_order
from ccfem.printing.poses import Matter, Obstacles, poses
from ccfem.printing.support import SupportLayers, support_paths
from ccfem.slicing.layers.layer import Layer, plane_frame
from ccfem.slicing.layers.slicer import Vector

# Matrix and fibre on each curved layer, of the part or of its support.


_HALF_WIDTHS = 0.5
"""Distance of the outermost ring from the border, in widths."""


def layer_matrix(layers: Sequence[Layer], machine: Machine) -> Toolpaths:
    """Fill layers with matrix: rings a line's width apart, measured in the chart of curved layers.

    Closed paths, from the border inwards, layer by layer. A line has the width of the machine and
    the height that the layer has where it lies, so that its cross-section changes along it:
    `ccfem.printing.export.robot_waypoints` writes that height.
    """
    return Toolpaths.concatenate(in_threads(lambda layer: _rings(layer, machine), layers))


def _rings(layer: Layer, machine: Machine) -> Toolpaths:
    """Matrix of one layer."""
    width, view = machine.matrix_width, flat_view(layer)
    levels = offset_rings(view.plane.polygon, _HALF_WIDTHS * width, width, width)
    paths = Toolpaths.from_plane([ring for level in levels for ring in level], view)
    paths = replace(paths, kind=np.full(len(paths), MATRIX, dtype=paths.kind.dtype))
    return chart_of(layer).lifted(paths)


_LEAST = 0.2
"""Least share of a layer's height that matrix fills, however much its fibre takes. Our choice."""
_UNEVEN = 0.1
"""Share by which rings may be higher or lower than that, so that their layer is exactly full."""


@dataclass(frozen=True)
class FilledLayer:
    """A layer, and the paths laid on it.

    Attributes
    ----------
    paths : Toolpaths
        Matrix or support first, then fibre; at the top of the layer, half its thickness above it.
    laid : (P,) array, mm
        Height of matrix at each point.
    piece : (K,) int array
        Piece of the layer (`Layer.component`) that each path lies on.
    missing : float, mm^3
        Volume that rings leave out because they do not fit; negative if they lay too much.
    """

    layer: Layer
    paths: Toolpaths
    laid: FloatArray
    piece: IntArray
    missing: float = 0.0


def filled_layers(
    fibre: Toolpaths, layers: Sequence[Layer], support: SupportLayers | None, machine: Machine
) -> list[FilledLayer]:
    """Fill layers with matrix and fibre, from the first printed to the last, and those of support.

    A layer of support stands just before the layer of the part at its level.
    """
    props = None if support is None else support_paths(support, machine, layers=layers)
    filled = []
    for number, layer in enumerate(layers):
        if support is not None and props is not None:
            for k in np.flatnonzero(support.before == number).tolist():
                rings = props.on_layer(k)
                rings = replace(rings, kind=np.full(len(rings), SUPPORT))
                filled.append(_on_top(support.layers[k], rings))
        strands = fibre.on_layer(layer.index)
        whole = _on_top(layer, Toolpaths.concatenate([layer_matrix([layer], machine), strands]))
        filled.append(_full(whole, machine))
    return filled


def _on_top(layer: Layer, paths: Toolpaths) -> FilledLayer:
    """Paths on the middle of a layer, raised to its top."""
    if not len(paths):
        return FilledLayer(layer, paths, np.zeros(0), np.zeros(0, dtype=np.int64))
    nearest = layer.nearest(paths.points)
    height = layer.values_at(nearest, layer.local_thickness)
    piece = layer.component[nearest.triangle[paths.offsets[:-1]]]
    raised = paths.points + 0.5 * height[:, None] * paths.normals
    no_link = np.zeros(len(raised), dtype=bool)  # those of fibre are fibre to the printer
    return FilledLayer(layer, replace(paths, points=raised, link=no_link), height, piece)


def _full(filled: FilledLayer, machine: Machine) -> FilledLayer:
    """Reduce matrix by the volume of fibre, and correct what rings lay too little or too much."""
    layer, paths = filled.layer, filled.paths
    room = float(layer.areas @ layer.local_thickness[layer.triangles].mean(axis=1))
    strands = paths.kind == FIBRE
    rest = room - machine.strand_area * float(paths.lengths[strands].sum())
    share = max(rest / room, _LEAST)
    start = np.flatnonzero(starts_segment(paths.offsets))
    start = start[~np.repeat(strands, np.diff(paths.offsets))[start]]
    steps = np.linalg.norm(paths.points[start + 1] - paths.points[start], axis=1)
    rings = machine.matrix_width * float(steps @ filled.laid[start])
    flow = share
    if rings > 0.0:
        flow = float(np.clip(rest / rings, share * (1.0 - _UNEVEN), share * (1.0 + _UNEVEN)))
    return replace(filled, laid=flow * filled.laid, missing=rest - flow * rings)


# Islands, and an order in which the head clears them.


_COARSE = 2.0
"""Side, mm, of the cubes in which an island is represented by one point."""
_PATCH = 6
"""Cubes along the side of a patch."""
_CONTACT = 1.0
"""Least area, mm^2, of contact with another island: less is below the resolution of points."""


@dataclass(frozen=True)
class Islands:
    """Pieces of layers, those of the first layer first.

    Attributes
    ----------
    layer : (k,) int array
        Place of its layer in the stack.
    piece : (k,) int array
        Its number in the layer (`Layer.component`).
    points, normals : (n, 3) arrays, mm
        Points that stand for the islands, island after island, and normals of the layers there.
    tops : (n, 3) array, mm
        The same points at the top of their layers, half a thickness higher.
    area : (n,) array, mm^2
        That each stands for.
    offsets : (k + 1,) int array
        Where the points of each island begin.
    reach : (k,) array, mm
        Distance within which an island below has points if this one rests on it.
    """

    layer: IntArray
    piece: IntArray
    points: FloatArray
    normals: FloatArray
    tops: FloatArray
    area: FloatArray
    offsets: IntArray
    reach: FloatArray

    def __post_init__(self) -> None:
        freeze(self, layer=int, piece=int, offsets=int)
        freeze(self, points=float, normals=float, tops=float, area=float, reach=float)

    def __len__(self) -> int:
        return len(self.layer)

    @property
    def owner(self) -> IntArray:
        """Island of each point, (n,)."""
        return np.repeat(np.arange(len(self)), np.diff(self.offsets))


def islands_of(layers: Sequence[Layer]) -> Islands:
    """Find the islands of layers, from the first printed to the last."""
    columns = []
    for number, layer in enumerate(layers):
        middle = layer.points[layer.triangles].mean(axis=1)
        cube = np.floor(middle / _COARSE).astype(np.int64)
        # Piece by piece, and in each one patch after the other: see `groups_in_cones`.
        key = np.column_stack([layer.component, cube // _PATCH, cube])
        _, first, which = np.unique(key, axis=0, return_index=True, return_inverse=True)
        area = np.bincount(which.ravel(), layer.areas, len(first)).astype(np.float64)
        count = np.bincount(layer.component[first])
        points, normals = middle[first], layer.normals[first]
        half = 0.5 * layer.local_thickness[layer.triangles[first]].mean(axis=1)
        tops, reach = points + half[:, None] * normals, 2.0 * layer.thickness + _COARSE
        pieces = (np.full(len(count), number), np.arange(len(count)))
        columns.append((*pieces, points, normals, tops, area, count, np.full(len(count), reach)))
    owner, piece, points, normals, tops, area, count, near = (
        np.concatenate(column) for column in zip(*columns, strict=True)
    )
    offsets = np.append(0, np.cumsum(count))
    return Islands(owner, piece, points, normals, tops, area, offsets, near)


def rests_on(islands: Islands) -> BoolArray:
    """Mask (k, k): islands that the one of a row rests on, earlier ones near its lower side."""
    owner, rests = islands.owner, np.zeros((len(islands),) * 2, dtype=bool)
    tree = cKDTree(islands.points)
    pairs = tree.query_pairs(float(islands.reach.max()), output_type="ndarray")
    upper, lower = pairs.max(axis=1), pairs.min(axis=1)
    off = islands.points[upper] - islands.points[lower]
    near = np.linalg.norm(off, axis=1) <= islands.reach[owner[upper]]
    above = np.einsum("kd,kd->k", off, islands.normals[upper]) > 0.0
    later = islands.layer[owner[upper]] > islands.layer[owner[lower]]
    rest = near & above & later
    rests[owner[upper[rest]], owner[lower[rest]]] = True
    return rests


def clashes(islands: Islands, build: FloatArray, machine: Machine) -> FloatArray:
    """Area, mm^2, of each island (row) over which the head would touch each other one (k, k)."""
    axes = poses(islands.normals, build, machine)
    size = (machine.head_angle, machine.head_length)
    met = groups_in_cones(islands.points, axes, islands.points, islands.owner, *size)
    table = np.zeros((len(islands),) * 2)
    np.add.at(table, islands.owner, met * islands.area[:, None])
    return table


def island_order(rest: BoolArray, clash: FloatArray) -> IntArray:
    """Order of islands: each after those it rests on, with few obstructions of the head.

    Parameters
    ----------
    rest : (k, k) bool array
        Islands that the one of a row rests on; these have lower numbers.
    clash : (k, k) array, mm^2
        Area over which the head above the island of a row would touch another one.

    Returns
    -------
    (k,) int array
        Islands from the first printed to the last; in ascending order unless there is a reason.
    """
    count = len(rest)
    after = np.eye(count, dtype=bool)  # (a, b): b comes after a, or is a
    for k in range(count):
        below = np.flatnonzero(rest[k])
        after[:, k] |= after[:, below].any(axis=1)
    edges = [(int(b), int(a)) for a, b in zip(*np.nonzero(rest), strict=True)]
    gain = clash - clash.T  # of (a, b): by printing a before b
    for flat in np.argsort(-gain, axis=None, kind="stable").tolist():
        a, b = divmod(flat, count)
        if not gain[a, b] >= _CONTACT:
            break
        if after[b, a]:
            continue
        edges.append((a, b))
        if not after[a, b]:
            after |= np.outer(after[:, a], after[b])
    return _lowest_first(edges, count)


def steps_of(islands: Islands, order: IntArray, clash: FloatArray) -> list[IntArray]:
    """Islands that are printed together: consecutive ones of one layer, clear of each other."""
    steps: list[list[int]] = []
    for k in order.tolist():
        last = steps[-1] if steps else []
        same = bool(last) and islands.layer[last[-1]] == islands.layer[k]
        if same and clash[k, last].max() < _CONTACT:
            last.append(k)
        else:
            steps.append([k])
    return [np.array(step) for step in steps]


def _lowest_first(edges: Sequence[tuple[int, int]], count: int) -> IntArray:
    """Order that obeys edges (first, then); of the free ones, the lowest number comes first."""
    follow: list[list[int]] = [[] for _ in range(count)]
    waiting = [0] * count
    for first, then in edges:
        follow[first].append(then)
        waiting[then] += 1
    free = [k for k in range(count) if not waiting[k]]
    heapq.heapify(free)
    order = []
    while free:
        order.append(heapq.heappop(free))
        for then in follow[order[-1]]:
            waiting[then] -= 1
            if not waiting[then]:
                heapq.heappush(free, then)
    return np.array(order, dtype=np.int64)


# All of it.


_MISSING = 0.01
"""Share of the part's volume that may be missing without a warning."""


def curved_stack(
    strands: PrintedStrands,
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    place: Place,
    support: SupportLayers | None,
    build: Vector,
) -> Stack:
    """Lay matrix and fibre on curved layers, piece by piece in an order that the head clears.

    `build` is the direction in which the part was to stand.
    """
    filled = filled_layers(strands.fibre, layers, support, machine)
    islands = islands_of([layer.layer for layer in filled])
    clash = clashes(islands, place.axes[2], machine)
    steps = steps_of(islands, island_order(rests_on(islands), clash), clash)
    laid = [(step, _of_step(filled, islands, step, place)) for step in steps]
    laid = [(step, layer) for step, layer in laid if len(layer.paths)]
    when = np.full(len(islands), -1)
    for number, (step, _) in enumerate(laid):
        when[step] = number
    tops, level = place.on_bed(islands.tops), islands.layer
    return Stack(
        [layer for _, layer in laid],
        (*_stands(place.axes[2], build, support), *_not_full(filled, mesh)),
        Obstacles(
            Matter.of(tops, level[islands.owner]),
            Matter.of(tops, when[islands.owner]),
            np.array([level[step[0]] for step, _ in laid], dtype=np.int64),
        ),
    )


def _of_step(
    filled: Sequence[FilledLayer], islands: Islands, step: IntArray, place: Place
) -> LaidLayer:
    """Paths of some islands of a layer, on the bed, matrix before fibre."""
    layer = filled[int(islands.layer[step[0]])]
    here = np.isin(layer.piece, islands.piece[step])
    heights = layer.laid[np.repeat(here, np.diff(layer.paths.offsets))]
    paths, _, at = in_order(layer.paths.select(here))
    points = place.on_bed(paths.points).round(COORDINATE_DIGITS) + 0.0
    return LaidLayer(
        replace(paths, points=points, normals=paths.normals @ place.axes.T),
        float(points[:, 2].max(initial=0.0)),
        layer.layer.thickness,
        heights[at],
    )


def _stands(up: FloatArray, build: Vector, support: SupportLayers | None) -> list[str]:
    """Say how the part stands, if not as asked for, and on what."""
    said = []
    if up @ plane_frame(build)[2] < np.cos(np.radians(0.1)):
        x, y, z = up.tolist()
        said.append(
            f"the part stands with ({x:.3f}, {y:.3f}, {z:.3f}) upwards: along its build direction "
            "layers would look down"
        )
    if support is None:
        said.append("nothing is laid below layers that hang over: plan with support (--support)")
    return said


def _not_full(filled: Sequence[FilledLayer], mesh: TetMesh) -> list[str]:
    """Say how much of the part's volume rings cannot fill."""
    missing, whole = sum(layer.missing for layer in filled), float(mesh.volumes.sum())
    if missing < _MISSING * whole:
        return []
    return [
        f"{missing:.0f} mm^3 of the part, {missing / whole:.1%}, stay empty, because its layers "
        "are too narrow there for lines of matrix"
    ]
