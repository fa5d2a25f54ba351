"""Curved layers of another program, a folder of OBJ files, and the solid that a stack fills.

Between two layers a border moves from the one to the other: the signed distance to the border along
the layer is interpolated in the height between them, as sections of a scan are (Raya and Udupa,
Shape-based interpolation of multidimensional objects, IEEE Trans. Med. Imaging 9, 1990). Where a
layer has no neighbour it ends half a gap from itself.
"""

import os
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.display import by_number
from ccfem.base.errors import InputError
from ccfem.geometry.facets import border_edges, connected, sides_at, unique_edges
from ccfem.geometry.locate import Nearest, nearest_on_triangles


def layer_files(folder: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Files of the layers in a folder, by the numbers in their names."""
    files = sorted(Path(folder).glob("*.obj"), key=lambda file: by_number(file.stem))
    if not files:
        raise InputError(
            f"no .obj file in the folder '{folder}': give the folder of the layers, one surface a "
            "file"
        )
    return tuple(files)


def read_layer(path: Path) -> tuple[FloatArray, IntArray]:
    """Points (n, 3), mm, and triangles (t, 3) of an OBJ file of triangles.

    Points that are the same are one, as where each triangle has its own; triangles of fewer than
    three points are left out.
    """
    points, triangles = [], []
    try:
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            words = line.split()
            if words[:1] == ["v"]:
                points.append([float(word) for word in words[1:4]])
            elif words[:1] == ["f"]:
                a, b, c = (int(word.split("/")[0]) for word in words[1:])
                triangles.append((a, b, c))
        vertices = np.array(points, dtype=np.float64).reshape(-1, 3)
        corners = np.array(triangles, dtype=np.int64).reshape(-1, 3) - 1
    except (ValueError, IndexError, OverflowError):
        raise InputError(f"{path} is no OBJ file of triangles: export it again") from None
    if not len(corners) or corners.min() < 0 or corners.max() >= len(vertices):
        raise InputError(f"{path} has no triangles, or they name points that it has not")
    if not np.isfinite(vertices).all():
        raise InputError(f"{path} has points that are not finite: repair the file")
    _, first, same = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    corners = first[same.reshape(-1)][corners]
    corners = corners[(np.diff(np.sort(corners, axis=1), axis=1) > 0).all(axis=1)]
    if not len(corners):
        raise InputError(f"{path} has no triangle of three points: export it again")
    return vertices, corners


# The solid that a stack of layers fills.


Triangles = tuple[FloatArray, IntArray]

_STEP = 0.75
"""Step of the grid, in gaps between layers."""
_REACH = 3.0
"""Distance along a layer, in gaps, up to which its border is taken for that of its neighbour."""
_SEEN = 2.5
"""Distance from a layer, in gaps, up to which it has a say."""
_BAND = 1.5
"""Heights over a layer, in gaps, at which it is looked for."""
_OFF = 0.1
"""Least depth or height, in steps, of a point of the grid."""
_FEWER = (0.9, 0.8, 0.6)
"""Shares of the triangles that are left out where the surface stays closed."""
_MOST = 60_000_000
"""Points of the grid from which the layers are taken to be in other units."""


@dataclass(frozen=True)
class _Sheet:
    """A layer: its points and unit normals there, its triangles, border, and gaps at its points."""

    points: FloatArray
    triangles: IntArray
    normals: FloatArray
    border: IntArray
    gaps: FloatArray


class _Places(NamedTuple):
    """Points of the grid near one layer: height over it, and depth inside its border, in mm."""

    node: IntArray
    height: FloatArray
    depth: FloatArray
    gap: FloatArray


def median_gap(layers: list[Triangles]) -> float:
    """Distance of neighbouring layers, mm."""
    return float(
        np.median(
            np.concatenate(
                [
                    nearest_on_triangles(*after, before[0]).distance
                    for before, after in pairwise(layers)
                ]
            )
        )
    )


def stack_surface(layers: list[Triangles]) -> Triangles:
    """Make the closed surface of the solid that layers fill.

    Parameters
    ----------
    layers : list of ((n, 3) array, mm, and (t, 3) int array)
        Points and triangles of at least two layers, from the first to the last.

    Returns
    -------
    (n, 3) array, mm, and (t, 3) int array
        Outward.

    Raises
    ------
    InputError
        For fewer than two layers, layers without distance or border, and a grid of too many points.
    """
    if len(layers) < 2:
        raise InputError(
            f"a solid is made of at least two layers; got {len(layers)}: give the folder of all"
        )
    sheets, gap = _sheets(layers)
    step = _STEP * gap
    low = np.min([sheet.points.min(axis=0) for sheet in sheets], axis=0) - 3.0 * gap
    high = np.max([sheet.points.max(axis=0) for sheet in sheets], axis=0) + 3.0 * gap
    shape = np.ceil((high - low) / step).astype(np.int64) + 1
    if np.prod(shape.astype(float)) > _MOST:
        raise InputError(
            f"layers {gap:.3g} mm apart over {np.ptp([low, high], axis=0).max():.3g} mm: are they "
            "in mm, and numbered in the order in which they lie?"
        )
    places = [_places(sheet, low, step, shape, gap) for sheet in sheets]
    return _level_surface(_depths(places, int(np.prod(shape)), gap), low, step, shape, gap)


# Layers with all their normals on the side of the next one, and their gaps.


def _sheets(layers: list[Triangles]) -> tuple[list[_Sheet], float]:
    gap = median_gap(layers)
    if not gap > 0.0:
        raise InputError("layers lie on one another: give each once, in the order of their numbers")
    return [_sheet(layers, k, gap) for k in range(len(layers))], gap


def _sheet(layers: list[Triangles], k: int, usual: float) -> _Sheet:
    """Orient the pieces of a layer, and measure how far the ones before and after it are."""
    points, triangles = layers[k]
    used, triangles = np.unique(triangles, return_inverse=True)
    points, triangles = points[used], triangles.reshape(-1, 3)
    normals = _normals(points, triangles)
    known: list[FloatArray] = []
    upward = np.zeros(len(points))
    for other, sign in ((k + 1, 1.0), (k - 1, -1.0)):
        if not 0 <= other < len(layers):
            continue
        near = nearest_on_triangles(*layers[other], points)
        away = near.points - points
        height = np.einsum("nd,nd->n", away, normals)
        # Beside the border of the other one its distance is none over this one.
        straight = np.abs(height) > 0.9 * near.distance
        known.append(np.where(straight & (near.distance < 3.0 * usual), near.distance, np.nan))
        upward += np.where(straight, sign * np.sign(height), 0.0) / (1e-9 + near.distance)
    piece = connected(triangles[:, [0, 1, 1, 2]].reshape(-1, 2), len(points))
    turned = np.bincount(piece, upward) < 0.0
    flipped = turned[piece[triangles[:, 0]]]
    triangles = np.where(flipped[:, None], triangles[:, ::-1], triangles)
    normals = np.where(turned[piece][:, None], -normals, normals)
    count = np.sum(np.isfinite(known), axis=0)
    gaps = np.where(count > 0, np.nansum(known, axis=0) / np.maximum(count, 1), usual)
    border = border_edges(triangles, len(points))
    if not len(border):
        raise InputError(
            f"layer {k} is closed, without a border: give layers as open surfaces, one a file"
        )
    return _Sheet(points, triangles, normals, border, gaps)


def _normals(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return unit normals at points, of the triangles round them by area."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    across = np.cross(b - a, c - a)
    total = np.stack(
        [np.bincount(triangles.ravel(), np.repeat(across[:, d], 3), len(points)) for d in range(3)],
        axis=1,
    )
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300))


# Where points of the grid lie with regard to one layer.


def _places(sheet: _Sheet, low: FloatArray, step: float, shape: IntArray, gap: float) -> _Places:
    """Points of the grid within some gaps of a layer."""
    samples, normals, gaps = _samples(sheet, step)
    node, at = _near(samples, low, step, shape, _SEEN * gap)
    away, nearest = cKDTree(samples).query(at, distance_upper_bound=_SEEN * gap)
    seen = np.isfinite(away)
    node, at, nearest = node[seen], at[seen], nearest[seen]
    height = np.einsum("nd,nd->n", at - samples[nearest], normals[nearest])
    kept = np.abs(height) < _BAND * gaps[nearest]
    node, at, nearest, height = node[kept], at[kept], nearest[kept], height[kept]
    # Near the border the nearest point of the layer says on which side of it a point lies.
    edges, along = _points_of(sheet.border, sheet.points, 0.5 * step)
    tree = cKDTree(along)
    some = np.flatnonzero(np.isfinite(tree.query(at, distance_upper_bound=_REACH * gap)[0]))
    near = nearest_on_triangles(sheet.points, sheet.triangles, at[some])
    normal = np.einsum("qk,qkd->qd", near.weights, sheet.normals[sheet.triangles[near.triangle]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    offset = at[some] - near.points
    height[some] = np.einsum("nd,nd->n", offset, normal)
    beside = np.linalg.norm(offset - height[some][:, None] * normal, axis=1)
    _, others = tree.query(near.points, k=min(4, len(along)))
    inward = np.min(
        [
            _to_segment(near.points, *np.moveaxis(sheet.points[sheet.border[edges[k]]], 1, 0))
            for k in others.T
        ],
        axis=0,
    )
    depth = np.full(len(at), _REACH * gap)
    depth[some] = np.where(_on_border(sheet, near), -beside, inward)
    depth = np.clip(depth, -_REACH * gap, _REACH * gap)
    return _Places(node, height, depth, gaps[nearest])


def _samples(sheet: _Sheet, step: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points spread over a layer, no sparser than the grid, with normals and gaps."""
    corners = sheet.points[sheet.triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.ceil(longest / step).astype(np.int64)
    samples = [(sheet.points, sheet.normals, sheet.gaps)]
    for count in np.unique(parts[parts > 1]).tolist():
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
        inside = i + j <= count
        weights = np.stack([i, j, count - i - j], axis=-1)[inside] / count
        of = sheet.triangles[parts == count]
        points, normals = (
            np.concatenate(weights @ values[of]) for values in (sheet.points, sheet.normals)
        )
        samples.append((points, normals, (sheet.gaps[of] @ weights.T).ravel()))
    points, normals, gaps = (np.concatenate(values) for values in zip(*samples, strict=True))
    size = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return points, normals / size, gaps


def _near(
    samples: FloatArray, low: FloatArray, step: float, shape: IntArray, reach: float
) -> tuple[IntArray, FloatArray]:
    """Numbers and places of the points of the grid in cubes about samples."""
    from scipy.ndimage import maximum_filter

    at = np.round((samples - low) / step).astype(np.int64)
    margin = int(np.ceil(reach / step))
    first, last = at.min(axis=0) - margin, at.max(axis=0) + margin
    taken = np.zeros(last - first + 1, dtype=np.uint8)
    taken[tuple((at - first).T)] = 1
    index = np.argwhere(maximum_filter(taken, 2 * margin + 1)) + first
    return np.ravel_multi_index(tuple(index.T), tuple(shape)), low + step * index


def _points_of(edges: IntArray, points: FloatArray, step: float) -> tuple[IntArray, FloatArray]:
    """Points along edges, no farther apart than a step, and the edge of each."""
    ends = points[edges]
    count = np.ceil(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / step).astype(np.int64) + 1
    edge = np.repeat(np.arange(len(edges)), count)
    share = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)) / count[edge]
    return edge, ends[edge, 0] + share[:, None] * (ends[edge, 1] - ends[edge, 0])


def _on_border(sheet: _Sheet, near: Nearest) -> BoolArray:
    """Whether nearest points lie on the border of a layer: on a side or in a corner of it."""
    triangle, side = sides_at(sheet.border, sheet.triangles)
    open_ = np.zeros(sheet.triangles.shape, dtype=bool)
    open_[triangle, (side + 2) % 3] = True  # by the corner opposite a side
    corner = np.isin(sheet.triangles, sheet.border)
    none, all_ = near.weights < 1e-6, near.weights > 1.0 - 1e-6
    border = (none & open_[near.triangle]) | (all_ & corner[near.triangle])
    return np.asarray(border.any(axis=1))


def _to_segment(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance of points from straight pieces, one each."""
    along = end - start
    square = np.maximum(np.einsum("nd,nd->n", along, along), 1e-300)
    share = np.clip(np.einsum("nd,nd->n", points - start, along) / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - share[:, None] * along, axis=1))


# Depth of the points of the grid inside the solid.


def _depths(places: list[_Places], count: int, gap: float) -> FloatArray:
    """Depth inside the solid, mm: the largest that any layer and its neighbour give."""
    depth = np.full(count, -_REACH * gap)
    # Up to half a gap from itself a layer is solid, where it has no neighbour.
    alone = [np.minimum(near.depth, 0.5 * near.gap - np.abs(near.height)) for near in places]
    pairs = []
    for k, (lower, upper) in enumerate(pairwise(places)):
        _, i, j = np.intersect1d(lower.node, upper.node, assume_unique=True, return_indices=True)
        between = (lower.height[i] >= 0.0) & (upper.height[j] < 0.0)
        i, j = i[between], j[between]
        share = lower.height[i] / (lower.height[i] - upper.height[j])
        a, b = lower.depth[i], upper.depth[j]
        pair = (1.0 - share) * a + share * b
        # No deeper than below the end of a stack, so that the surface there is where it should be.
        pair = np.minimum(pair, 0.5 * gap + np.minimum(lower.height[i], -upper.height[j]))
        # A neighbour that ends far from here has nothing to do with this border.
        far = np.clip(2.0 * np.maximum(-a, -b) / (_REACH * gap) - 1.0, 0.0, 1.0)
        single = np.maximum(alone[k][i], alone[k + 1][j])
        pairs.append((k, i, j, (1.0 - far) * pair + far * single))
    for k, i, j, value in pairs:
        np.maximum.at(depth, places[k].node[i], value)
        alone[k][i] = alone[k + 1][j] = -np.inf
    for near, value in zip(places, alone, strict=True):
        np.maximum.at(depth, near.node, value)
    return depth


def _level_surface(
    depth: FloatArray, low: FloatArray, step: float, shape: IntArray, gap: float
) -> Triangles:
    """Surface of depth 0, without shells that are smaller than two gaps."""
    import pyvista as pv

    # Triangles that nearly vanish stop what makes them fewer, and meshers.
    depth = np.where(depth < 0.0, np.minimum(depth, -_OFF * step), np.maximum(depth, _OFF * step))
    grid = pv.ImageData(dimensions=shape, spacing=(step,) * 3, origin=low)
    grid.point_data["depth"] = depth.reshape(shape).ravel(order="F")
    surface = grid.contour([0.0], scalars="depth", method="flying_edges")
    if not surface.n_cells:
        raise InputError("layers fill no solid: are they numbered in the order in which they lie?")
    points, triangles = np.asarray(surface.points, dtype=np.float64), surface.regular_faces
    piece = connected(triangles[:, [0, 1, 1, 2]].reshape(-1, 2), len(points))
    ends = np.full((2, piece.max() + 1, 3), np.inf)
    for end, sign in zip(ends, (1.0, -1.0), strict=True):
        np.minimum.at(end, piece, sign * points)
    large = (-ends.sum(axis=0)).max(axis=1) > 2.0 * gap
    used, triangles = np.unique(triangles[large[piece[triangles[:, 0]]]], return_inverse=True)
    points, triangles = points[used], triangles.reshape(-1, 3)
    whole = pv.PolyData.from_regular_faces(points, triangles)
    for share in _FEWER:
        fewer = whole.decimate(share, volume_preservation=True)
        if _closed(fewer.regular_faces, fewer.n_points):
            return np.asarray(fewer.points, dtype=np.float64), fewer.regular_faces
    return points, triangles


def _closed(triangles: IntArray, count: int) -> bool:
    """Whether every edge joins two triangles that run along it in opposite directions."""
    _, times = unique_edges(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2))
    return not len(border_edges(triangles, count)) and bool((np.bincount(times) == 2).all())
