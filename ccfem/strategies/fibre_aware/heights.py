"""Layers over the height of a part: their cells, how they differ, and the case that each serves."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.base.tensor import in_plane
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.locate import Buckets, barycentric_maps, bucket, locate
from ccfem.machine.machine import Machine
from ccfem.paths.planning.alike import EQUAL, equal_sections
from ccfem.slicing.layers.layer import Layer, curved_layers
from ccfem.strategies.fibre_aware.layer_axes import NearestLayers
from ccfem.strategies.fibre_aware.smeared import SmearedPart

# How much of some surfaces lies in each of the tetrahedra that they run through.


_ROUNDING = 1e-9
"""Distance from a face up to which a triangle lies in it, in the largest coordinate."""


class _Cells(NamedTuple):
    """Tetrahedra by their boxes and barycentric coordinates.

    Attributes
    ----------
    low, high : (m, 3) arrays, mm
    origins : (m, 3) array, mm
        First corners.
    gradients : (m, 4, 3) array, 1/mm
    heights : (m, 4) array, mm
        Over the face opposite to each corner; 0 in a flat cell.
    across : (m, 4) int array
        Cell across that face, -1 for none.
    """

    low: FloatArray
    high: FloatArray
    origins: FloatArray
    gradients: FloatArray
    heights: FloatArray
    across: IntArray


def areas_in_cells(
    points: FloatArray, cells: IntArray, across: IntArray, surfaces: Iterable[FloatArray]
) -> FloatArray:
    """Area of some surfaces in each tetrahedron, (m,), mm^2.

    Triangles are clipped by the faces of the cells. Two cells on both sides of a face in a surface
    share its area. What lies outside all cells counts to the one nearest to the middle of its
    triangle, so that the sum is the area of the surfaces.

    Parameters
    ----------
    points : (n, 3) array, mm
    cells : (m, 4) int array
    across : (m, 4) int array
        Cell across the face opposite to each corner, -1 for none.
    surfaces : iterable of (t, 3, 3) arrays, mm
        Corners of their triangles, of any size.
    """
    corners = points[cells]
    rounding = _ROUNDING * float(np.abs(corners).max())
    low, high = corners.min(axis=1) - rounding, corners.max(axis=1) + rounding
    tetrahedra = _Cells(low, high, *barycentric_maps(corners), np.ascontiguousarray(across))
    grid, areas = bucket(low, high), np.zeros(len(cells))
    for surface in surfaces:
        a, b, c = np.moveaxis(surface, 1, 0)
        size = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        rest = _clip_all(grid, tetrahedra, surface, size, rounding, areas)
        outside = np.flatnonzero(rest > _ROUNDING * size)
        nearest, _ = locate(points, cells, surface[outside].mean(axis=1), float(np.ptp(corners)))
        areas += np.bincount(nearest, rest[outside], len(cells))
    return areas


@compiled
def _clip_all(
    grid: Buckets,
    cells: _Cells,
    surface: FloatArray,
    size: FloatArray,
    rounding: float,
    areas: FloatArray,
) -> FloatArray:
    """Area of each triangle that is in no cell; those in cells are added to `areas`."""
    rest = size.copy()
    seen = np.full(len(areas), -1, np.int64)
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    least, most = np.empty(3), np.empty(3)
    away = np.empty((4, 3))
    polygon, clipped = np.empty((16, 2)), np.empty((16, 2))
    for t in range(len(surface)):
        for d in range(3):
            least[d] = min(surface[t, 0, d], surface[t, 1, d], surface[t, 2, d])
            most[d] = max(surface[t, 0, d], surface[t, 1, d], surface[t, 2, d])
            start = int(np.floor((least[d] - grid.origin[d]) / grid.cell))
            stop = int(np.floor((most[d] - grid.origin[d]) / grid.cell))
            first[d], last[d] = max(start, 0), min(stop, grid.shape[d] - 1)
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                for k in range(first[2], last[2] + 1):
                    box = (i * grid.shape[1] + j) * grid.shape[2] + k
                    for item in range(grid.starts[box], grid.starts[box + 1]):
                        m = grid.items[item]
                        if seen[m] == t:
                            continue
                        seen[m] = t
                        apart = cells.heights[m, 0] == 0.0
                        for d in range(3):
                            apart = apart or cells.low[m, d] > most[d]
                            apart = apart or cells.high[m, d] < least[d]
                        if apart:
                            continue
                        share = _distances(cells, m, surface[t], rounding, away)
                        if share > 0.0:
                            share *= _clipped(away, rounding, polygon, clipped)
                        areas[m] += share * size[t]
                        rest[t] -= share * size[t]
    return rest


@compiled
def _distances(
    cells: _Cells, m: int, corners: FloatArray, rounding: float, away: FloatArray
) -> float:
    """Distances (4, 3) of three corners from the faces of a cell, inwards; written.

    What is returned is 0 where the triangle is outside one, a half where it lies in one that a
    second cell has too, else 1.
    """
    for c in range(3):
        rest = 1.0
        for face in range(1, 4):
            value = 0.0
            for d in range(3):
                value += cells.gradients[m, face, d] * (corners[c, d] - cells.origins[m, d])
            rest -= value
            away[face, c] = value * cells.heights[m, face]
        away[0, c] = rest * cells.heights[m, 0]
    share = 1.0
    for face in range(4):
        if max(away[face, 0], away[face, 1], away[face, 2]) <= rounding:
            if min(away[face, 0], away[face, 1], away[face, 2]) < -rounding:
                return 0.0
            share = 0.5 if cells.across[m, face] >= 0 else 1.0
            # All of it is inside this face.
            for c in range(3):
                away[face, c] = 0.0
    return share


@compiled
def _clipped(away: FloatArray, rounding: float, polygon: FloatArray, clipped: FloatArray) -> float:
    """Share of a triangle inside four faces, from the distances of its corners (4, 3).

    Sutherland and Hodgman 1974, in coordinates (u, v) that are (0, 0), (1, 0) and (0, 1) at the
    corners. Two polygons are overwritten.
    """
    polygon[0, 0], polygon[0, 1] = 0.0, 0.0
    polygon[1, 0], polygon[1, 1] = 1.0, 0.0
    polygon[2, 0], polygon[2, 1] = 0.0, 1.0
    count = 3
    for face in range(4):
        base, along, across = away[face, 0], away[face, 1], away[face, 2]
        if min(base, along, across) >= -rounding:
            continue
        along, across = along - base, across - base
        kept = 0
        for c in range(count):
            u, v = polygon[c]
            p, q = polygon[(c + 1) % count]
            here, there = base + along * u + across * v, base + along * p + across * q
            if here >= 0.0:
                clipped[kept, 0], clipped[kept, 1] = u, v
                kept += 1
            if (here >= 0.0) != (there >= 0.0):
                w = here / (here - there)
                clipped[kept, 0], clipped[kept, 1] = u + w * (p - u), v + w * (q - v)
                kept += 1
        count = kept
        for c in range(count):
            polygon[c, 0], polygon[c, 1] = clipped[c, 0], clipped[c, 1]
    total = 0.0
    for c in range(count):
        u, v = polygon[c]
        p, q = polygon[(c + 1) % count]
        total += u * q - p * v
    return total


_ALIKE = 0.8
"""Share of the stress common to all heights above which all layers get one field."""

_MOST_GROUPS = 6

LARGE_CELLS = 50_000
"""Cells above which plans on flat layers for one load case are made in fewer ways: they take
longest, and what is left out is made up for by one more exchange of stretches."""


def is_large(mesh: TetMesh, layers: Sequence[Layer]) -> bool:
    """Whether a part is one of more than `LARGE_CELLS` on flat layers."""
    return len(mesh.cells) > LARGE_CELLS and not curved_layers(layers)


def nearest_layer(part: SmearedPart, layers: Sequence[Layer]) -> IntArray:
    """Position in `layers` of the one nearest to each cell, (m,); of flat ones in height."""
    if curved_layers(layers):
        return NearestLayers.of(part.centroids, layers).number
    heights = np.array([layer.plane.height for layer in layers])
    order = np.argsort(heights, kind="stable")
    bounds = 0.5 * (heights[order][1:] + heights[order][:-1])
    level = part.centroids @ part.frame[2]
    return np.asarray(order[np.searchsorted(bounds, level)])


def fibre_capacity(part: SmearedPart, layers: Sequence[Layer], machine: Machine) -> FloatArray:
    """Density of fibre (m,), mm/mm^3, at one strand a width in the layer nearest to each cell."""
    if curved_layers(layers):
        return 1.0 / (machine.fibre_width * NearestLayers.of(part.centroids, layers).thickness)
    thickness = np.array([layer.thickness for layer in layers])
    return 1.0 / (machine.fibre_width * thickness[nearest_layer(part, layers)])


def room_for_fibre(part: SmearedPart, layers: Sequence[Layer], machine: Machine) -> FloatArray:
    """Density of fibre (m,), mm/mm^3, at one strand a width on every layer that cuts a cell."""
    mesh = part.mesh
    sections = areas_in_cells(
        mesh.points, mesh.corners, mesh.across, (layer.points[layer.triangles] for layer in layers)
    )
    return sections / (machine.fibre_width * mesh.volumes)


def _upwards(layers: Sequence[Layer]) -> IntArray:
    """Positions of layers from the bottom to the top; a stack of curved ones is sorted."""
    if curved_layers(layers):
        return np.arange(len(layers))
    return np.argsort([layer.plane.height for layer in layers], kind="stable")


def group_layers(layers: Sequence[Layer], groups: int) -> IntArray:
    """Group (n,) of each layer, from the bottom to the top: about as many in each, none empty."""
    order = _upwards(layers)
    group = np.empty(len(layers), dtype=np.int64)
    group[order] = np.arange(len(layers)) * min(groups, len(layers)) // len(layers)
    return group


def alike_share(mesh: TetMesh, frame: FloatArray, stress: FloatArray, size: float) -> float:
    """Share of the in-plane stress that is the same at all heights, in [0, 1].

    Parameters
    ----------
    frame : (3, 3) array
        Of the layers: two directions in their plane, and their normal.
    stress : (m, 3, 3) array, MPa
    size : float, mm
        Side of the squares above which the stress is averaged over the height.

    Returns
    -------
    float
        1 for a plate loaded in its plane, about 0 for a plate that is bent.
    """
    volume = mesh.volumes
    place = mesh.centres @ frame[:2].T
    plane = in_plane(stress, frame) * np.array([1.0, 1.0, np.sqrt(2.0)])
    square = np.floor((place - place.min(axis=0)) / size).astype(np.int64)
    _, column = np.unique(square, axis=0, return_inverse=True)
    total = np.bincount(column, volume)
    mean = np.stack([np.bincount(column, volume * s) / total for s in plane.T], axis=1)
    whole = float(volume @ (plane**2).sum(axis=1))
    return float(total @ (mean**2).sum(axis=1)) / whole if whole > 0.0 else 1.0


def grouped_by_stress(
    mesh: TetMesh, stresses: Sequence[FloatArray], layers: Sequence[Layer], size: float = 0.0
) -> IntArray:
    """Group of each layer, (layers,): one group where the stress is alike at all heights.

    Curved layers form as many groups as flat ones whose stress differs.

    Parameters
    ----------
    stresses : sequence of (m, 3, 3) arrays, MPa
        Of the load cases.
    size : float, mm, default 0
        As of `alike_share`, where it is more than the mean edge of the cells.
    """
    if curved_layers(layers):
        return group_layers(layers, _MOST_GROUPS)
    size = max(size, float(np.cbrt(6.0 * mesh.volumes.mean())))
    frame = layers[0].plane.frame
    alike = min(alike_share(mesh, frame, stress, size) for stress in stresses)
    return group_layers(layers, 1 if alike > _ALIKE else _MOST_GROUPS)


def layers_of_one_kind(
    layers: Sequence[Layer], group: IntArray, distance: float = EQUAL
) -> list[IntArray]:
    """Numbers of the layers of each kind: they share a group, and a section up to a distance, mm.

    No two curved layers are equal; up to a larger distance neighbours of a group count as alike.
    """
    if curved_layers(layers):
        kind_of = np.arange(len(layers))
        if distance > EQUAL:
            kind_of = group * len(layers) + group_layers(layers, _MOST_GROUPS)
        return [np.flatnonzero(kind_of == k) for k in np.unique(kind_of)]
    kinds: list[list[int]] = []
    for k, layer in enumerate(layers):
        for kind in kinds:
            same = group[kind[0]] == group[k]
            if same and equal_sections(layers[kind[0]], layer, distance):
                kind.append(k)
                break
        else:
            kinds.append([k])
    return [np.array(kind) for kind in kinds]


def middle(numbers: IntArray) -> int:
    """Return the middle one of the numbers."""
    return int(numbers[len(numbers) // 2])


def middle_layers(layers: Sequence[Layer], group: IntArray) -> list[Layer]:
    """Return the middle layer of each group, from the group (layers,) of every layer."""
    numbers = [np.flatnonzero(group == k) for k in range(int(group.max()) + 1)]
    return [layers[middle(members)] for members in numbers]


def layer_counts(weights: FloatArray, count: int) -> IntArray:
    """Share out layers among cases of positive weights (n,): the number of each, (n,).

    By the largest remainder.
    """
    wanted = weights / weights.sum() * count
    counts = np.floor(wanted + 1e-9).astype(np.int64)
    rest = np.argsort(-np.round(wanted - counts, 9), kind="stable")
    counts[rest[: count - int(counts.sum())]] += 1
    return counts


def layers_by_case(weights: FloatArray, layers: Sequence[Layer]) -> IntArray:
    """Case of each layer, (layers,); the layers of each case are spread evenly over the height.

    From the bottom up each layer goes to the case that is farthest behind its share; if several
    are, to the first of them.
    """
    count = len(layers)
    counts = layer_counts(weights, count)
    order = _upwards(layers)
    given = np.zeros(len(counts), dtype=np.int64)
    case_of = np.empty(count, dtype=np.int64)
    for place, number in enumerate(order):
        behind = np.round(counts * (place + 0.5) / count - given, 9)
        k = int(np.argmax(np.where(given < counts, behind, -np.inf)))
        given[k] += 1
        case_of[number] = k
    return case_of
