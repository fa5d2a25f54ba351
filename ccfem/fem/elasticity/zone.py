"""Where the stress of a part is judged: away from where it is held and loaded, averaged."""

from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.base.tensor import von_mises
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity.load_kinds import patches_of, points_of
from ccfem.fem.elasticity.nodes import edge_nodes
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.support_kinds import AnySupport, EdgeSupport, Support
from ccfem.geometry.facets import are_among

ZONE = 3.0
"""Distance, mm, from patches of loads and supports within which stress is not judged."""

_SPACING = 0.5
"""Largest distance, mm, between points that stand for a patch."""
_PIECES = 100
"""Largest number of pieces of a side: cells at facets of more than 50 mm are much larger."""


def averaged_mises(
    problem: Problem, case: str, stress: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Von Mises stress of the cells averaged by volume over a ball of 2 mm radius, MPa.

    In cells that are weaker than their material it is that of the material.

    Parameters
    ----------
    case : str
        The load case.
    stress : (m, 3, 3) array, MPa
        Of the cells.

    Returns
    -------
    judged : (k,) int array
        Cells at least 3 mm from the patches of loads and supports; the others count in averages.
    average : (k,) array, MPa
    centroid : (m, 3) array, mm
        Of all cells.
    """
    mesh = problem.mesh
    centroid = mesh.centres
    judged = np.flatnonzero(np.isinf(distance_from_patches(problem, case, centroid, ZONE)))
    mises = von_mises(problem.in_material(stress))[:, None]
    return judged, ball_averages(centroid, mises, mesh.volumes, judged, BALL)[:, 0], centroid


def distance_from_patches(
    problem: Problem, case: str, centroid: FloatArray, most: float
) -> FloatArray:
    """Distance, mm, of points (k, 3) from the patches of loads and supports of a load case.

    Infinite beyond `most`, which keeps the search short. A whole flat face that slides in its
    plane, as a plane of symmetry does, is no such patch: no stress peaks there.
    """
    bound = np.nextafter(most, np.inf)
    tree = cKDTree(_held_and_loaded(problem, case))
    return np.asarray(tree.query(centroid, distance_upper_bound=bound)[0])


def _held_and_loaded(problem: Problem, case: str) -> FloatArray:
    """Points (k, 3) that cover the patches of the supports and of the load case."""
    mesh = problem.mesh
    edges = [support.patches for support in problem.supports if isinstance(support, EdgeSupport)]
    kinds: list[Any] = [*problem.loads_of(case)]
    kinds += [
        support
        for support in problem.supports
        if not isinstance(support, EdgeSupport) and not _slides(mesh, support)
    ]
    points = [np.zeros((0, 3))]
    points += [np.array([point]) for kind in kinds for point in points_of(kind)]
    points += [mesh.points[edge_nodes(mesh, names)] for names in edges]
    names = {name for kind in kinds for name in patches_of(kind)}
    points += [_cover(mesh, name) for name in sorted(names)]
    # Facets beside each other share points, and a tree without these is searched in a fifth of the
    # time.
    return np.unique(np.concatenate(points), axis=0)


def _slides(mesh: TetMesh, support: AnySupport) -> bool:
    """Whether a support holds a whole flat face across its plane and nothing else."""
    if not isinstance(support, Support) or len(support.components) > 1:
        return False
    place = mesh.points[:, "xyz".index(support.components)]
    patch = mesh.patch(support.patch)
    level = place[patch[0, 0]]
    flat = (np.abs(place[mesh.boundary] - level) <= 1e-9 * np.ptp(mesh.bounds)).all(axis=1)
    return bool(are_among(patch, mesh.boundary[flat]).all()) and (
        len(patch) == np.count_nonzero(flat)
    )


def _cover(mesh: TetMesh, name: str) -> FloatArray:
    """Points on the facets of a patch, half a millimetre apart on those of up to 50 mm."""
    corners = mesh.points[mesh.patch(name)]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.clip(np.ceil(edges / _SPACING), 1.0, _PIECES).astype(np.int64)
    points = [corners.reshape(-1, 3)]
    for n in np.unique(parts):
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        inside = i + j <= n
        weights = np.stack([i[inside], j[inside], n - i[inside] - j[inside]], axis=1) / n
        points.append(np.einsum("wc,kcx->kwx", weights, corners[parts == n]).reshape(-1, 3))
    return np.concatenate(points)


# Weighted averages over a ball round each of many points, and the transposed operation.


BALL = 2.0
"""Radius, mm, of the ball over which stress is averaged."""


def ball_averages(
    points: FloatArray, values: FloatArray, weights: FloatArray, judged: IntArray, radius: float
) -> FloatArray:
    """Weighted averages (k, c) of values (n, c) over the points within a radius, mm.

    Of points (n, 3), mm, those `judged` (k,) are the middles.
    """
    result = np.zeros((len(judged), values.shape[1]))
    apart = float(np.cbrt(np.prod(np.ptp(points, axis=0)) / len(points)))
    parts = int(np.clip(radius / max(_IN_BOX * apart, 1e-300), 1.0, _MOST_PARTS))
    boxes = _boxes(points, weights, radius, parts)
    values = values[boxes.order]
    # Balls beside each other, one after the other, hold the same points.
    turn = np.argsort(boxes.number[judged], kind="stable")
    centres, sums = points[judged[turn]], np.zeros_like(result)
    if parts == 1:
        inside = np.empty(len(boxes.points), dtype=np.int64)
        _average(boxes, values, centres, boxes.number[judged[turn]], sums, inside)
    else:
        columns = np.column_stack([boxes.weights, boxes.weights[:, None] * values])
        until = np.concatenate([np.zeros((1, columns.shape[1])), np.cumsum(columns, axis=0)])
        _average_of_sums(boxes, columns, until, centres, sums)
    result[turn] = sums
    return result


def ball_shares(
    points: FloatArray, values: FloatArray, weights: FloatArray, judged: IntArray, radius: float
) -> FloatArray:
    """Transpose `ball_averages`: from derivatives (k, c) by averages to those (n, c) by values."""
    boxes, spread = _boxes(points, weights, radius), np.zeros((len(points), values.shape[1]))
    _share(boxes, points[judged], boxes.number[judged], values, spread)
    result = np.empty_like(spread)
    result[boxes.order] = spread
    return result


class _Boxes(NamedTuple):
    """Points in boxes of a grid, whose size is the radius of the ball or more, or part of it.

    `points` (n, 3), mm, and `weights` (n,) in the order of the boxes, `order` (n,); `number` (n,)
    of the box of each in the order that they were given in; `offsets` where each box begins;
    `shape` (3,), boxes along each axis, numbered with the last axis fastest; `corner` (3,) of the
    first, mm, and the `size` of each, mm.
    """

    points: FloatArray
    weights: FloatArray
    order: IntArray
    number: IntArray
    offsets: IntArray
    shape: IntArray
    radius: float
    corner: FloatArray
    size: float


_MOST_BOXES = 10_000_000
"""Number of boxes above which they are larger than the ball: about 80 MB."""


_IN_BOX = 1.5
"""Least size of a box, in distances of points: three or four of them are in it."""
_MOST_PARTS = 8
"""Boxes along the radius of a ball, at most."""


def _boxes(points: FloatArray, weights: FloatArray, radius: float, parts: int = 1) -> _Boxes:
    """Sort points into boxes for a ball, with a margin of empty boxes on every side."""
    first = points.min(axis=0)
    size = max(radius / parts, float(np.cbrt(np.prod(np.ptp(points, axis=0)) / _MOST_BOXES)))
    box = np.floor((points - first) / size).astype(np.int64) + 1
    shape = box.max(axis=0) + 2
    number = (box[:, 0] * shape[1] + box[:, 1]) * shape[2] + box[:, 2]
    order = np.argsort(number, kind="stable")
    offsets = np.searchsorted(number[order], np.arange(int(np.prod(shape)) + 1))
    about = (order, number, offsets, shape, float(radius), first - size, size)
    return _Boxes(points[order], weights[order], *about)


@compiled
def _points_in_ball(
    boxes: _Boxes, centre: FloatArray, box: int, inside: IntArray
) -> int:  # pragma: no cover
    """Write the points in the ball round a centre, which lies in a box; return their number."""
    points, shape, offsets = boxes.points, boxes.shape, boxes.offsets
    count, square = 0, boxes.radius * boxes.radius
    for i in range(-1, 2):
        for j in range(-1, 2):
            # The three boxes beside each other along the last axis follow one another.
            row = box + (i * shape[1] + j) * shape[2]
            for p in range(offsets[row - 1], offsets[row + 2]):
                x = points[p, 0] - centre[0]
                y = points[p, 1] - centre[1]
                z = points[p, 2] - centre[2]
                if x * x + y * y + z * z <= square:
                    inside[count] = p
                    count += 1
    return count


@compiled
def _average(
    boxes: _Boxes,
    values: FloatArray,
    centres: FloatArray,
    box: IntArray,
    result: FloatArray,
    inside: IntArray,
) -> None:  # pragma: no cover
    weights = boxes.weights
    for k in range(len(centres)):
        weight = 0.0
        for q in range(_points_in_ball(boxes, centres[k], box[k], inside)):
            p = inside[q]
            for c in range(values.shape[1]):
                result[k, c] += weights[p] * values[p, c]
            weight += weights[p]
        for c in range(values.shape[1]):
            result[k, c] /= weight


_INNER = 1.0 - 1e-9
"""Share of the radius up to which boxes count as wholly inside: rounding lets no point slip."""


@compiled
def _average_of_sums(
    boxes: _Boxes, columns: FloatArray, until: FloatArray, centres: FloatArray, result: FloatArray
) -> None:  # pragma: no cover
    """Averages where many points lie in a ball: those of boxes wholly inside by their sums.

    `columns` (n, 1 + c) are the weight of each point and its weighted values, `until` (n + 1,
    1 + c) their sums over all points before. Boxes along the last axis follow one another.
    """
    points, shape, offsets, corner = boxes.points, boxes.shape, boxes.offsets, boxes.corner
    size, square = boxes.size, boxes.radius * boxes.radius
    count, total = columns.shape[1], np.empty(columns.shape[1])
    low, high = np.empty(2, np.int64), np.empty(2, np.int64)
    for k in range(len(centres)):
        for c in range(count):
            total[c] = 0.0
        for d in range(2):
            low[d] = max(int((centres[k, d] - boxes.radius - corner[d]) / size), 0)
            high[d] = min(int((centres[k, d] + boxes.radius - corner[d]) / size), shape[d] - 1)
        z = centres[k, 2] - corner[2]
        for i in range(low[0], high[0] + 1):
            nearest_x, farthest_x = _reach(centres[k, 0] - corner[0] - i * size, size)
            for j in range(low[1], high[1] + 1):
                nearest_y, farthest_y = _reach(centres[k, 1] - corner[1] - j * size, size)
                outer = square - nearest_x * nearest_x - nearest_y * nearest_y
                if outer < 0.0:
                    continue
                row, half = (i * shape[1] + j) * shape[2], np.sqrt(outer)
                start = offsets[row + max(int((z - half) / size), 0)]
                stop = offsets[row + min(int((z + half) / size), shape[2] - 1) + 1]
                inner = square * _INNER - farthest_x * farthest_x - farthest_y * farthest_y
                first = last = stop
                if inner > 0.0:
                    half = np.sqrt(inner)
                    from_box = max(int(np.ceil((z - half) / size)), 0)
                    to_box = min(int(np.floor((z + half) / size)), shape[2])
                    if to_box > from_box:
                        first, last = offsets[row + from_box], offsets[row + to_box]
                        for c in range(count):
                            total[c] += until[last, c] - until[first, c]
                for begin, end in ((start, first), (last, stop)):
                    for p in range(begin, end):
                        x = points[p, 0] - centres[k, 0]
                        y = points[p, 1] - centres[k, 1]
                        height = points[p, 2] - centres[k, 2]
                        if x * x + y * y + height * height <= square:
                            for c in range(count):
                                total[c] += columns[p, c]
        for c in range(1, count):
            result[k, c - 1] = total[c] / total[0]


@compiled
def _reach(place: float, size: float) -> tuple[float, float]:  # pragma: no cover
    """Least and largest distance of a place from an interval that begins at 0."""
    return max(0.0, -place, place - size), max(place, size - place)


@compiled
def _share(
    boxes: _Boxes, centres: FloatArray, box: IntArray, values: FloatArray, result: FloatArray
) -> None:  # pragma: no cover
    weights, inside = boxes.weights, np.empty(len(boxes.points), np.int64)
    for k in range(len(centres)):
        count, weight = _points_in_ball(boxes, centres[k], box[k], inside), 0.0
        for q in range(count):
            weight += weights[inside[q]]
        for q in range(count):
            share = weights[inside[q]] / weight
            for c in range(values.shape[1]):
                result[inside[q], c] += share * values[k, c]
