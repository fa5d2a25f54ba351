"""Islands, the connected pieces of curved layers, and an order in which the head clears them.

Each island is printed after those that it rests on. Within this constraint, an island that would
obstruct the head above another one is printed after it, worst cases first. The remaining order is
layer by layer.
"""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.geometry.cones import groups_in_cones
from ccfem.machine.machine import Machine
from ccfem.printing.poses import poses
from ccfem.slicing.layers.layer import Layer

_COARSE = 2.0
"""Side, mm, of the cubes in which an island is represented by one point."""
_PATCH = 6
"""Cubes along the side of a patch."""
_LEAST = 1.0
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
    stack, piece, counts, reach = [], [], [], []
    points, normals, tops, areas = [], [], [], []
    for number, layer in enumerate(layers):
        middle = layer.points[layer.triangles].mean(axis=1)
        cube = np.floor(middle / _COARSE).astype(np.int64)
        # Piece by piece, and in each one patch after the other: see `groups_in_cones`.
        key = np.column_stack([layer.component, cube // _PATCH, cube])
        _, first, which = np.unique(key, axis=0, return_index=True, return_inverse=True)
        stands = np.bincount(which.ravel(), layer.areas, minlength=len(first))
        count = np.bincount(layer.component[first])
        points.append(middle[first])
        normals.append(layer.normals[first])
        half = 0.5 * layer.local_thickness[layer.triangles[first]].mean(axis=1)
        tops.append(points[-1] + half[:, None] * normals[-1])
        areas.append(stands)
        counts.append(count)
        stack.append(np.full(len(count), number))
        piece.append(np.arange(len(count)))
        reach.append(np.full(len(count), 2.0 * layer.thickness + _COARSE))
    offsets = np.append(0, np.cumsum(np.concatenate(counts)))
    return Islands(
        np.concatenate(stack),
        np.concatenate(piece),
        np.concatenate(points),
        np.concatenate(normals),
        np.concatenate(tops),
        np.concatenate(areas),
        offsets,
        np.concatenate(reach),
    )


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
    """Area, mm^2, of each island (row) over which the head would touch each other one (k, k).

    Parameters
    ----------
    build : (3,) array
        Unit vector.
    machine : Machine
        Its head, and how far it tilts.
    """
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
        if not gain[a, b] >= _LEAST:
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
        if same and clash[k, last].max() < _LEAST:
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
