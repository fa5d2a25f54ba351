"""Triangulation of a planform: even triangles, smaller ones where the outline turns sharply.

Boundary points are laid along the outline and stay there; inner points start on a hexagonal grid
and move to the area-weighted mean of the triangles round them (Chen and Holst, Efficient mesh
optimization schemes based on optimal Delaunay triangulations, 2011), with a Delaunay
triangulation in every round.
"""

from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.spatial import Delaunay, QhullError, cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.numbering import reverse_cuthill_mckee
from ccfem.body.mesh.round_walls import RoundWall
from ccfem.body.mesh.smooth_faces import round_walls, smooth_faces
from ccfem.geometry.facets import are_among, signed_areas
from ccfem.geometry.shapes import Region

_CORNER = np.radians(25.0)
"""Turn of the outline above which a vertex is a corner, kept as a point of the mesh."""
_PER_TURN = 24
"""Segments of a full turn of the outline."""
_FINEST = 0.25
"""Shortest target edge length, as a share of the one given."""
_GRADING = 0.25
"""Growth of the edge length with the distance from where the outline turns."""
_ROUNDS = 30
"""Rounds of smoothing."""
_SPACING = 0.8
"""Minimum distance between points at the start, in edge lengths."""
_MOST = 2e6
"""Number of triangles above which an edge length is taken for a mistake of units."""
_REMEMBERED = 16
"""Triangulations that a process keeps: a part is read more than once in a session."""

Size = Callable[[FloatArray], FloatArray]


def triangulate(
    polygon: shapely.Polygon, edge_length: float, keep: FloatArray | None = None
) -> tuple[FloatArray, IntArray]:
    """Triangulate a planform.

    Parameters
    ----------
    polygon : shapely Polygon, mm
        Valid, with or without holes.
    edge_length : float, mm
        Target edge length. A full turn of the outline (a hole) has at least 24 segments unless
        that takes edges shorter than a quarter of this length; edges grow from there inwards.
    keep : (k, 2) array, mm, optional
        Points on the outline that become points of the mesh, such as the ends of a patch; those
        elsewhere, or within a quarter of the edge length of a corner, are ignored.

    Returns
    -------
    points : (n, 2) array, mm
        Boundary points, exactly on the outline, first.
    triangles : (t, 3) int array
        Counter-clockwise.
    """
    _check_planform(polygon, edge_length)
    places = None if keep is None else tuple(map(tuple, np.asarray(keep).tolist()))
    points, triangles = _triangulated(polygon, edge_length, places)
    return points.copy(), triangles.copy()


@lru_cache(maxsize=_REMEMBERED)
def _triangulated(
    polygon: shapely.Polygon, edge_length: float, places: tuple[tuple[float, float], ...] | None
) -> tuple[FloatArray, IntArray]:
    """Triangulate as `triangulate` does, once for the same planform."""
    keep = None if places is None else np.array(places)
    rings = [np.asarray(r.coords)[:-1, :2] for r in (polygon.exterior, *polygon.interiors)]
    size = _size_function(rings, edge_length)
    marked = [_with_points(ring, keep, 0.25 * edge_length) for ring in rings]
    outline = [_ring_points(ring, corners, size) for ring, corners in marked]
    inner = _grid(polygon, edge_length, size, np.concatenate(outline))
    outline, inner = _conforming(outline, inner)
    fixed = sum(map(len, outline))
    points = np.concatenate([*outline, inner])
    domain = shapely.Polygon(outline[0], outline[1:])
    if not domain.is_valid:
        raise _not_followed()
    for _ in range(_ROUNDS):
        points = _relaxed(points, _inside(points, domain), fixed, size)
    outline, inner = _conforming(outline, points[fixed:])
    points = np.concatenate([*outline, inner])
    used, triangles = np.unique(_inside(points, domain), return_inverse=True)
    return points[used], triangles.reshape(-1, 3)


def _check_planform(polygon: shapely.Polygon, edge_length: float) -> None:
    """Raise on a planform or edge length that cannot be meshed."""
    if not isinstance(polygon, shapely.Polygon) or polygon.is_empty:
        raise InputError(
            "a planform must be one polygon with an area; got "
            f"{getattr(polygon, 'geom_type', polygon)}: join its parts or mesh them one by one"
        )
    if not polygon.is_valid:
        raise InputError(
            f"the planform is not a valid polygon: {shapely.is_valid_reason(polygon)}: uncross it"
        )
    check_number("edge length", edge_length, above=0.0, unit="mm")
    expected = polygon.area / (0.433 * edge_length**2)
    if expected > _MOST:
        raise InputError(
            f"an edge length of {edge_length:g} mm would make about {expected:.1g} triangles: "
            "choose a longer one"
        )


def _turns(ring: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Turn at each vertex of a ring, (k,), radians, and length of its two sides' mean, mm."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turn = np.abs(np.arctan2(cross, np.einsum("ij,ij->i", before, after)))
    return turn, 0.5 * (np.linalg.norm(before, axis=1) + np.linalg.norm(after, axis=1))


def _size_function(rings: list[FloatArray], edge_length: float) -> Size:
    """Target edge length as a function of points (n, 2)."""
    places, sizes = [], []
    for ring in rings:
        turn, side = _turns(ring)
        smooth = (turn > 1e-6) & (turn < _CORNER)
        wanted = 2.0 * np.pi / _PER_TURN * side[smooth] / turn[smooth]
        wanted = np.maximum(wanted, _FINEST * edge_length)
        places.append(ring[smooth][wanted < edge_length])
        sizes.append(wanted[wanted < edge_length])
    source, least = np.concatenate(places), np.concatenate(sizes)
    step = np.floor(np.log(np.maximum(least, 1e-300) / edge_length) / np.log(1.05)).astype(int)
    trees = [(edge_length * 1.05 ** float(k), cKDTree(source[step == k])) for k in np.unique(step)]

    def size(points: FloatArray) -> FloatArray:
        result = np.full(len(points), edge_length)
        for finest, tree in trees:
            reach = (edge_length - finest) / _GRADING
            gap, _ = tree.query(points, distance_upper_bound=max(reach, 1e-12))
            result = np.minimum(result, finest + _GRADING * gap)
        return result

    return size


def _with_points(
    ring: FloatArray, keep: FloatArray | None, least: float
) -> tuple[FloatArray, IntArray]:
    """Ring with the points of `keep` (k, 2) that lie on it, and its corners, these among them."""
    corners = np.flatnonzero(_turns(ring)[0] >= _CORNER)
    if keep is None or not len(keep):
        return ring, corners
    line = shapely.LinearRing(ring)
    along = shapely.line_locate_point(line, shapely.points(ring))
    stops, chosen = along[corners], []
    for point in np.asarray(keep, dtype=np.float64):
        at = float(shapely.line_locate_point(line, shapely.Point(point)))
        gap = np.abs(stops - at)
        clear = np.minimum(gap, line.length - gap).min(initial=np.inf) >= least
        if clear and line.distance(shapely.Point(point)) <= 1e-6 * line.length:
            stops = np.append(stops, at)
            chosen.append((at, *point))
    where, x, y = np.array(sorted(chosen)).reshape(-1, 3).T
    place = np.searchsorted(along, where)
    is_corner = np.isin(np.arange(len(ring)), corners)
    ring = np.insert(ring, place, np.stack([x, y], axis=1), axis=0)
    return ring, np.flatnonzero(np.insert(is_corner, place, True))


def _ring_points(ring: FloatArray, corners: IntArray, size: Size) -> FloatArray:
    """Points (k, 2) along a ring at the wanted distances.

    Its corners are among them, or its outermost points in x and y where it has none.
    """
    least = 1
    if not len(corners):
        ends = [ring[:, 0].argmin(), ring[:, 0].argmax(), ring[:, 1].argmin(), ring[:, 1].argmax()]
        corners, least = np.unique(ends), 3
    ring = np.roll(ring, -corners[0], axis=0)
    stops = np.append(corners - corners[0], len(ring))
    ring = np.concatenate([ring, ring[:1]])
    points = []
    for start, stop in pairwise(stops):
        line = shapely.LineString(ring[start : stop + 1])
        fine = np.linspace(0.0, line.length, max(64, 8 * (stop - start)) + 1)
        place = shapely.get_coordinates(shapely.line_interpolate_point(line, fine))
        steps = np.diff(fine) / size(0.5 * (place[1:] + place[:-1]))
        passed = np.concatenate([[0.0], np.cumsum(steps)])
        count = max(least, round(passed[-1]))
        at = np.interp(np.linspace(0.0, passed[-1], count + 1)[:-1], passed, fine)
        points.append(shapely.get_coordinates(shapely.line_interpolate_point(line, at)))
    return np.concatenate(points)


def _grid(
    polygon: shapely.Polygon, edge_length: float, size: Size, outline: FloatArray
) -> FloatArray:
    """Inner points (k, 2): a hexagonal grid, and points of a finer one in the gaps it leaves."""
    coarse = _hexagons(polygon, edge_length)
    wanted = size(coarse)
    clear = cKDTree(outline).query(coarse)[0] >= _SPACING * wanted
    coarse = coarse[clear & (wanted > 0.999 * edge_length)]
    fine = _hexagons(polygon, _FINEST * edge_length)
    wanted = _SPACING * size(fine)
    open_ = cKDTree(np.concatenate([outline, coarse])).query(fine)[0] >= wanted
    order = np.random.default_rng(0).permutation(np.flatnonzero(open_))
    return np.concatenate([coarse, _thinned(fine[order], wanted[order])])


def _hexagons(polygon: shapely.Polygon, step: float) -> FloatArray:
    """Points (k, 2) of a hexagonal grid inside a polygon."""
    low, high = np.array(polygon.bounds[:2]), np.array(polygon.bounds[2:])
    count = np.ceil((high - low) / (step * np.array([1.0, np.sqrt(0.75)]))).astype(int) + 2
    i, j = np.meshgrid(np.arange(count[0]), np.arange(count[1]), indexing="ij")
    x = low[0] + step * (i + 0.5 * (j % 2) - 0.5)
    y = low[1] + step * np.sqrt(0.75) * (j - 0.5)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    return points[shapely.contains_xy(polygon, points)]


def _thinned(points: FloatArray, wanted: FloatArray) -> FloatArray:
    """Points that keep the wanted distance from each other, the earlier before the later."""
    if not len(points):
        return points
    pairs = cKDTree(points).query_pairs(wanted.max(), output_type="ndarray")
    gap = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    pairs = np.sort(pairs[gap < wanted[pairs].max(axis=1)], axis=1)
    kept, gone = np.zeros((2, len(points)), dtype=bool)
    while True:
        blocked = kept | gone
        blocked[pairs[:, 1]] = True
        if blocked.all() and not len(pairs):
            return points[kept]
        kept |= ~blocked
        gone[pairs[kept[pairs[:, 0]], 1]] = True
        pairs = pairs[~(kept | gone)[pairs].any(axis=1)]


def _conforming(
    outline: list[FloatArray], inner: FloatArray
) -> tuple[list[FloatArray], FloatArray]:
    """Outline with one more point wherever the triangulation misses one of its sides."""
    for _ in range(8):
        points = np.concatenate([*outline, inner])
        corners = _delaunay(points)
        sides = corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        start, closer = 0, []
        for ring in outline:
            here = start + np.arange(len(ring))
            lost = np.flatnonzero(~are_among(np.stack([here, np.roll(here, -1)], axis=1), sides))
            middle = 0.5 * (ring[lost] + np.roll(ring, -1, axis=0)[lost])
            closer.append(np.insert(ring, lost + 1, middle, axis=0))
            start += len(ring)
        if sum(map(len, closer)) == start:
            return outline, inner
        outline = closer
    raise _not_followed()


def _not_followed() -> InputError:
    return InputError(
        "the outline of the planform cannot be followed at this edge length: choose a shorter one"
    )


def _delaunay(points: FloatArray) -> IntArray:
    """Delaunay triangles (t, 3), counter-clockwise."""
    try:
        corners = np.asarray(Delaunay(points).simplices, dtype=np.int64)
    except QhullError:
        raise InputError(
            "the planform has no area that could be triangulated: check its coordinates"
        ) from None
    clockwise = signed_areas(points, corners) < 0.0
    corners[clockwise] = corners[clockwise][:, ::-1]
    return corners


def _inside(points: FloatArray, domain: Region) -> IntArray:
    """Delaunay triangles with their centre in the domain; those without area are left out."""
    corners = _delaunay(points)
    centre = points[corners].mean(axis=1)
    area = signed_areas(points, corners)
    sides = np.roll(points[corners], 1, axis=1) - points[corners]
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    shapely.prepare(domain)
    return corners[(area > 1e-9 * longest**2) & shapely.contains_xy(domain, centre)]


def _relaxed(points: FloatArray, corners: IntArray, fixed: int, size: Size) -> FloatArray:
    """Points moved to the weighted mean of the centres of the triangles round them."""
    centre = points[corners].mean(axis=1)
    weight = signed_areas(points, corners) / size(centre) ** 2
    total, x, y = (
        np.bincount(corners.T.ravel(), np.tile(weight * values, 3), len(points))
        for values in (np.ones(len(weight)), *centre.T)
    )
    free = total > 0.0
    free[:fixed] = False
    moved = points.copy()
    moved[free] = np.stack([x, y], axis=1)[free] / total[free, None]
    return moved


# Prismatic parts: a triangulated planform, extruded and cut into tetrahedra.


_PRISMS_MOST = 2e7
"""Number of cells above which a length is taken for a mistake of units."""

_SPLIT = np.array([[0, 1, 2, 5], [0, 1, 4, 5], [0, 3, 4, 5]])
"""Tetrahedra of a prism (bottom 0 1 2, top 3 4 5): side diagonals rise with the order."""


def extrude(
    polygon: shapely.Polygon,
    height: float,
    edge_length: float,
    layers: int | None = None,
    keep: FloatArray | None = None,
) -> TetMesh:
    """Mesh a prism on a planform in the x-y plane.

    Parameters
    ----------
    polygon : shapely Polygon, mm
        With or without holes.
    height : float, mm
        The part reaches from z = 0 to `height`.
    edge_length : float, mm
        Target edge length; shorter where the outline turns sharply (`triangulate`).
    layers : int, optional
        Layers of prisms over the height; by default as many as make them about `edge_length` high.
    keep : (k, 2) array, mm, optional
        Points on the outline that become points of the mesh.

    Returns
    -------
    TetMesh
        Linear, without patches. Each prism is cut into three tetrahedra. The diagonals on its
        sides follow a random order of the planform's points (with a fixed seed), reversed in
        every other layer, so that they favour no direction.
    """
    check_number("height", height, above=0.0, unit="mm")
    if layers is not None:
        check_number("layers of cells", layers, at_least=1)
    plane, triangles = triangulate(polygon, edge_length, keep)
    plane, triangles = _numbered_along(plane, triangles)
    count = layers or max(1, round(height / edge_length))
    expected = 3.0 * len(triangles) * count
    if expected > _PRISMS_MOST:
        raise InputError(
            f"a height of {height:g} mm in cells of {edge_length:g} mm would make about "
            f"{expected:.1g} cells: choose a longer edge length"
        )
    levels = count + 1
    points = np.empty((len(plane), levels, 3))
    points[:, :, :2] = plane[:, None]
    points[:, :, 2] = np.linspace(0.0, height, levels)
    rank = np.random.default_rng(0).permutation(len(plane))
    rising = np.take_along_axis(
        triangles, np.argsort(rank[triangles], axis=1, kind="stable"), axis=1
    )
    ordered = np.stack([rising[:, :: 1 - 2 * (level % 2)] for level in range(count)], axis=1)
    lower = ordered * levels + np.arange(count)[:, None]
    cells = np.concatenate([lower, lower + 1], axis=2)[:, :, _SPLIT].reshape(-1, 4)
    inside_out = TetMesh(points.reshape(-1, 3), cells).volumes < 0.0
    cells[inside_out] = cells[inside_out][:, [0, 2, 1, 3]]
    return TetMesh(points.reshape(-1, 3), cells, walls=_outline_walls(polygon, height))


def _outline_walls(polygon: shapely.Polygon, height: float) -> tuple[RoundWall, ...]:
    """Round walls of the prism on an outline as it was given, not as its mesh has it."""
    corners: list[FloatArray] = []
    triangles: list[IntArray] = []
    for ring in shapely.get_rings(shapely.orient_polygons(polygon)):
        low = np.pad(shapely.get_coordinates(ring)[:-1], ((0, 0), (0, 1)))
        start, here = sum(len(known) for known in corners), np.arange(len(low))
        after = np.roll(here, -1)
        above, after_above = here + len(low), after + len(low)
        corners += [low, low + np.array([0.0, 0.0, height])]
        triangles.append(start + np.stack([here, after, after_above], axis=1))
        triangles.append(start + np.stack([here, after_above, above], axis=1))
    points, sides = np.concatenate(corners), np.concatenate(triangles)
    return round_walls(points, sides, smooth_faces(points, sides))


def _numbered_along(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Points numbered so that neighbours have close numbers, triangles by their points."""
    n = len(points)
    ends = triangles[:, [0, 1, 2]].ravel(), triangles[:, [1, 2, 0]].ravel()
    graph = coo_array((np.ones(len(ends[0])), ends), shape=(n, n)).tocsr()
    graph = (graph + graph.T).tocsr()
    order = reverse_cuthill_mckee(graph.indptr, graph.indices)
    number = np.empty(n, dtype=np.int64)
    number[order] = np.arange(n)
    triangles = number[triangles]
    return points[order], triangles[np.argsort(triangles.min(axis=1), kind="stable")]
