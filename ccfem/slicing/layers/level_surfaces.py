"""Curved layers: level surfaces of a field on the mesh, cleaned, with a thickness at each point."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.base.parallel import in_threads
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.round_walls import RoundWall
from ccfem.fem.elasticity import cell_gradients
from ccfem.geometry.facets import areas_and_normals, border_edges, connected, sides_at
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.level_cut import chain, cut_at_zero

_SNAP = 1e-5
"""Distance from the level, as a share of the step, below which nodes count as lying on it."""
_SAG = 0.05
"""Largest distance, in shortest edges, by which cleaning may straighten the border."""
_FACING = 0.3
"""Least cosine between a wall's normal and a surface that ends at it: layers may meet it aslant."""
_FEWEST = 4
"""Triangles of the smallest piece that is kept."""


@dataclass(frozen=True)
class LevelSurfaces:
    """Layers cut from a field.

    Attributes
    ----------
    bubbles : int
        Number of closed pieces, which are left out: they have no border, as with a maximum of the
        field inside the part.
    specks : int
        Number of pieces left out because they are smaller than asked for.
    """

    layers: tuple[Layer, ...]
    bubbles: int
    specks: int


def level_surfaces(
    mesh: TetMesh,
    values: FloatArray,
    levels: FloatArray,
    step: float,
    shortest: float,
    least_area: float,
) -> LevelSurfaces:
    """Cut layers at levels of a field.

    Parameters
    ----------
    values : (n,) array
        At the nodes, linear in the cells.
    levels : (k,) array
        In ascending order.
    step : float
        Difference between the levels.
    shortest : float, mm
        Edges of the triangles shorter than this are collapsed.
    least_area : float, mm^2
        Smaller pieces are left out.

    Returns
    -------
    LevelSurfaces
        Layers from the lowest level to the highest, numbered without empty ones. Triangles are
        counter-clockwise seen from the side where the field is higher. A border edge lies on a
        patch if both its ends do.
    """
    gradient = np.einsum("eid,ei->ed", cell_gradients(mesh), values[mesh.corners])
    thickness = thickness_at_nodes(mesh, values, step)
    on_patch = {name: _edge_keys(facets, len(mesh.points)) for name, facets in mesh.patches.items()}
    on_wall = [
        _edge_keys(mesh.boundary[mesh.wall_of == k], len(mesh.points))
        for k in range(len(mesh.round_walls))
    ]

    in_cells = values[mesh.corners]
    low, high = in_cells.min(axis=1) - _SNAP * step, in_cells.max(axis=1) + _SNAP * step

    def cut(level: float) -> tuple[dict[str, Any] | None, int, int]:
        signed = values - level
        signed[np.abs(signed) < _SNAP * step] = 0.0
        among = np.flatnonzero((low <= level) & (high >= level))
        on = (on_patch, on_wall)
        return _surface(mesh, signed, among, gradient, thickness, *on, shortest, least_area)

    cuts = in_threads(cut, levels.tolist(), most=None)
    kept = [surface for surface, _, _ in cuts if surface is not None]
    layers = tuple(Layer(index=k, **surface) for k, surface in enumerate(kept))
    return LevelSurfaces(layers, sum(b for _, b, _ in cuts), sum(s for _, _, s in cuts))


def thickness_at_nodes(mesh: TetMesh, values: FloatArray, step: float) -> FloatArray:
    """Distance, mm, between layers a step of the field apart, at the corner nodes (n,)."""
    gradient = np.einsum("eid,ei->ed", cell_gradients(mesh), values[mesh.corners])
    return np.asarray(step / np.maximum(_at_nodes(mesh, np.linalg.norm(gradient, axis=1)), 1e-12))


def _at_nodes(mesh: TetMesh, values: FloatArray) -> FloatArray:
    """Volume-weighted mean at the corner nodes of values per cell."""
    weight = np.repeat(mesh.volumes, 4)
    nodes, n = mesh.corners.ravel(), len(mesh.points)
    total = np.bincount(nodes, weight, n)
    return np.bincount(nodes, weight * np.repeat(values, 4), n) / np.maximum(total, 1e-300)


def _edge_keys(facets: IntArray, n: int) -> IntArray:
    """Keys of the edges of facets, and of their nodes as edges of zero length."""
    a = np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]])
    key = a.min(axis=1) * n + a.max(axis=1)
    nodes = np.unique(facets)
    return np.unique(np.concatenate([key, nodes * n + nodes]))


def _surface(
    mesh: TetMesh,
    signed: FloatArray,
    among: IntArray,
    gradient: FloatArray,
    thickness: FloatArray,
    on_patch: dict[str, IntArray],
    on_wall: list[IntArray],
    shortest: float,
    least_area: float,
) -> tuple[dict[str, Any] | None, int, int]:
    """Fields of a clean `Layer` where a field is zero; numbers of bubbles and specks left out."""
    cut = cut_at_zero(mesh, signed, among)
    if cut is None:
        return None, 0, 0
    n = len(mesh.points)
    points, triangles, cell = cut.points, cut.triangles, cut.cell
    # Counter-clockwise seen from where the field is higher.
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    down = np.einsum("td,td->t", normal, gradient[cell]) < 0.0
    triangles = np.where(down[:, None], triangles[:, [0, 2, 1]], triangles)
    # Points on edges of patches; where a patch ends on the border, its end stays.
    keys = cut.nodes[:, 0] * n + cut.nodes[:, 1]
    member = {name: np.isin(keys, edges) for name, edges in on_patch.items()}
    fixed = _ends_of_patches(triangles, member, len(points))
    triangles, cell = clean(points, triangles, cell, fixed, shortest, _SAG * shortest)
    wanted, bubbles, specks = _worthwhile(points, triangles, least_area)
    triangles, cell = triangles[wanted], cell[wanted]
    if not len(triangles):
        return None, bubbles, specks
    # Points that no triangle has any more are left out.
    used, triangles = np.unique(triangles, return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    nodes, weights = cut.nodes[used], cut.weights[used]
    border = border_edges(triangles, len(used))
    patches = {name: border[on[used][border].all(axis=1)] for name, on in member.items()}
    # Thickness at the points, between the ends of their edges; its mean by area.
    local = (1.0 - weights) * thickness[nodes[:, 0]] + weights * thickness[nodes[:, 1]]
    area, _ = areas_and_normals(points[used], triangles)
    mean = np.average(local[triangles].mean(axis=1), weights=area)
    surface = {
        "points": points[used],
        "triangles": triangles,
        "cell": cell,
        "nodes": nodes,
        "weights": weights,
        "loops": chain(border),
        "thickness": float(mean),
        "patches": patches,
        "walls": tuple(
            along_walls(
                mesh.round_walls,
                [np.isin(keys[used], edges) for edges in on_wall],
                points[used],
                triangles,
            )
        ),
        "local_thickness": local,
    }
    return surface, bubbles, specks


def along_walls(
    walls: Sequence[RoundWall],
    on_wall: Sequence[BoolArray],
    points: FloatArray,
    triangles: IntArray,
) -> Iterator[tuple[RoundWall, IntArray]]:
    """Round walls, and the border edges (k, 2) that are chords of each: both ends lie on it.

    Of a chord the surface ends at the wall, so that both look the same way. For each wall is given
    which of the points (n, 3), mm, lie on it.
    """
    border = border_edges(triangles, len(points))
    triangle, side = sides_at(border, triangles)
    opposite = triangles[triangle, (side + 2) % 3]
    along = points[border[:, 1]] - points[border[:, 0]]
    inwards = points[opposite] - points[border[:, 0]]
    square = np.maximum(np.einsum("ed,ed->e", along, along), 1e-300)
    inwards -= (np.einsum("ed,ed->e", inwards, along) / square)[:, None] * along
    inwards /= np.maximum(np.linalg.norm(inwards, axis=1), 1e-300)[:, None]
    for wall, of_points in zip(walls, on_wall, strict=True):
        on = of_points[border].all(axis=1)
        outwards = wall.normals_at(points[border[on]].mean(axis=1))
        facing = np.einsum("ed,ed->e", outwards, -inwards[on]) > _FACING
        if facing.any():
            yield wall, border[on][facing]


def _ends_of_patches(triangles: IntArray, member: dict[str, BoolArray], n: int) -> BoolArray:
    """Border points at which a patch begins or ends, (n,), which cleaning must keep."""
    border = border_edges(triangles, n)
    fixed = np.zeros(n, dtype=bool)
    for on in member.values():
        change = on[border[:, 0]] != on[border[:, 1]]
        fixed[border[change]] |= on[border[change]]
    return fixed


def _worthwhile(
    points: FloatArray, triangles: IntArray, least_area: float
) -> tuple[BoolArray, int, int]:
    """Triangles of the pieces that are kept, and the numbers of bubbles and specks left out."""
    n = len(points)
    piece = connected(triangles[:, [[0, 1], [0, 2]]].reshape(-1, 2), n)
    count = int(piece.max()) + 1
    of_triangle = piece[triangles[:, 0]]
    total = np.bincount(of_triangle, areas_and_normals(points, triangles)[0], count)
    number = np.bincount(of_triangle, minlength=count)
    open_ = np.zeros(count, dtype=bool)
    open_[piece[border_edges(triangles, n)[:, 0]]] = True
    bubble = (number > 0) & ~open_
    speck = (number > 0) & open_ & ((total < least_area) | (number < _FEWEST))
    return ~(bubble | speck)[of_triangle], int(bubble.sum()), int(speck.sum())


# Cleaning the triangles of a level surface: short edges collapse, thin pairs are flipped.
#
# Points are only removed, never moved: the remaining points lie where the mesh was cut, and the
# border keeps its shape. Hoppe et al., Mesh optimization, SIGGRAPH 1993.


_FAN = 32
"""Most triangles at a point; collapses that would need more are skipped."""
_TILT = 0.8
"""Least cosine of the angle between a triangle's normals before and after."""
_THIN = 0.2
"""Height of a triangle over its longest side below which a collapse must not make it thinner."""
_ROUNDS = 4


def clean(
    points: FloatArray,
    triangles: IntArray,
    cell: IntArray,
    fixed: BoolArray,
    shortest: float,
    sag: float,
) -> tuple[IntArray, IntArray]:
    """Clean an oriented manifold surface.

    Parameters
    ----------
    points : (n, 3) array, mm
    triangles : (t, 3) int array
    cell : (t,) int array
        Cell of each triangle, kept with it.
    fixed : (n,) bool array
        Points that must stay.
    shortest : float, mm
        Shorter edges are collapsed where that inverts no triangle.
    sag : float, mm
        Largest distance by which the border may change.

    Returns
    -------
    triangles : (t', 3) int array
    cell : (t',) int array
    """
    triangles, cell = triangles.copy(), cell.copy()
    alive = np.ones(len(triangles), dtype=np.bool_)
    fan = np.full((len(points), _FAN), -1, dtype=np.int64)
    size = np.zeros(len(points), dtype=np.int64)
    _gather_fans(triangles, fan, size)
    locked = fixed | (size > _FAN)
    border = np.full((len(points), 2), -1, dtype=np.int64)
    _find_border(triangles, fan, size, border, locked)
    fans = _Fans(points, triangles, alive, fan, size, border)
    for _ in range(_ROUNDS):
        if not _collapse(fans, locked, float(shortest), float(sag)):
            break
    triangles, cell = triangles[alive], cell[alive]
    for _ in range(_ROUNDS):
        if not _flip(points, triangles, *_twins(triangles, len(points))):
            break
    return triangles, cell


class _Fans(NamedTuple):
    """A surface whose triangles are known by their points, changed in place.

    `points` (n, 3), mm; `triangles` (t, 3) and whether they are `alive` (t,); the triangles at each
    point, ``fan[p, : size[p]]``; and the points before and after it on the `border` (n, 2), -1 for
    none.
    """

    points: FloatArray
    triangles: IntArray
    alive: BoolArray
    fan: IntArray
    size: IntArray
    border: IntArray


@compiled
def _gather_fans(triangles: IntArray, fan: IntArray, size: IntArray) -> None:
    """Triangles round each point."""
    for t in range(len(triangles)):
        for i in range(3):
            p = triangles[t, i]
            if size[p] < fan.shape[1]:
                fan[p, size[p]] = t
            size[p] += 1


@compiled
def _find_border(
    triangles: IntArray, fan: IntArray, size: IntArray, border: IntArray, locked: BoolArray
) -> None:
    """Write the border neighbours before and after each point; lock points where borders touch."""
    for p in range(len(fan)):
        if size[p] > fan.shape[1]:
            continue
        for a in range(size[p]):
            t = fan[p, a]
            i = 0
            while triangles[t, i] != p:
                i += 1
            after, before = triangles[t, (i + 1) % 3], triangles[t, (i + 2) % 3]
            # A side that no other triangle at the point has lies on the border.
            alone_after, alone_before = True, True
            for b in range(size[p]):
                u = fan[p, b]
                if u == t:
                    continue
                for k in range(3):
                    alone_after &= triangles[u, k] != after
                    alone_before &= triangles[u, k] != before
            if alone_after:
                locked[p] |= border[p, 1] >= 0
                border[p, 1] = after
            if alone_before:
                locked[p] |= border[p, 0] >= 0
                border[p, 0] = before


@compiled
def _normal(points: FloatArray, a: int, b: int, c: int) -> tuple[float, float, float]:
    """Cross product of two sides of a triangle: its normal, twice as long as its area."""
    ux, uy, uz = (
        points[b, 0] - points[a, 0],
        points[b, 1] - points[a, 1],
        points[b, 2] - points[a, 2],
    )
    vx, vy, vz = (
        points[c, 0] - points[a, 0],
        points[c, 1] - points[a, 1],
        points[c, 2] - points[a, 2],
    )
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@compiled
def _square(points: FloatArray, a: int, b: int) -> float:
    """Squared distance of two points."""
    x, y, z = points[a, 0] - points[b, 0], points[a, 1] - points[b, 1], points[a, 2] - points[b, 2]
    return x * x + y * y + z * z


@compiled
def _off_segment(points: FloatArray, p: int, a: int, b: int) -> float:
    """Distance of a point from the segment between two others."""
    nx, ny, nz = _normal(points, a, b, p)
    base = _square(points, a, b)
    if base == 0.0:
        return np.sqrt(_square(points, p, a))
    dot = 0.0
    for k in range(3):
        dot += (points[p, k] - points[a, k]) * (points[b, k] - points[a, k])
    if dot < 0.0 or dot > base:
        return min(np.sqrt(_square(points, p, a)), np.sqrt(_square(points, p, b)))
    return np.sqrt((nx * nx + ny * ny + nz * nz) / base)


@compiled
def _shared(triangles: IntArray, fan: IntArray, size: IntArray, u: int, v: int) -> tuple[int, int]:
    """Count the triangles with both points, and the points adjacent to both."""
    both, common = 0, 0
    seen = np.empty(3 * fan.shape[1], np.int64)
    known = 0
    for a in range(size[u]):
        t = fan[u, a]
        has = False
        for i in range(3):
            has |= triangles[t, i] == v
        both += has
        for i in range(3):
            p = triangles[t, i]
            if p == u or p == v:  # noqa: SIM109
                continue
            fresh = True
            for k in range(known):
                fresh &= seen[k] != p
            if not fresh:
                continue
            seen[known] = p
            known += 1
            # Adjacent to v as well.
            near = False
            for b in range(size[v]):
                for j in range(3):
                    near |= triangles[fan[v, b], j] == p
            common += near
    return both, common


@compiled
def _may_move(
    points: FloatArray, triangles: IntArray, fan: IntArray, size: IntArray, u: int, v: int
) -> bool:
    """Whether u can move to v without a triangle that inverts, tilts or gets thinner than any.

    Thinness is twice the area over the square of the longest side: the height over that side.
    """
    thinnest_before, thinnest_after = 1.0, 1.0
    for a in range(size[u]):
        t = fan[u, a]
        i = 0
        while triangles[t, i] != u:
            i += 1
        p, q = triangles[t, (i + 1) % 3], triangles[t, (i + 2) % 3]
        ox, oy, oz = _normal(points, u, p, q)
        old = np.sqrt(ox * ox + oy * oy + oz * oz)
        base = _square(points, p, q)
        longest = max(base, _square(points, u, p), _square(points, u, q))
        thinnest_before = min(thinnest_before, old / longest)
        if p == v or q == v:
            continue
        nx, ny, nz = _normal(points, v, p, q)
        new = np.sqrt(nx * nx + ny * ny + nz * nz)
        # The normal of a needle-like triangle is unreliable.
        if old > 1e-3 * longest and ox * nx + oy * ny + oz * nz < _TILT * old * new:
            return False
        longest = max(base, _square(points, v, p), _square(points, v, q))
        thinnest_after = min(thinnest_after, new / longest)
    return thinnest_after >= min(_THIN, thinnest_before)


@compiled
def _collapse(fans: _Fans, locked: BoolArray, shortest: float, sag: float) -> int:
    """Try to move each point to its nearest neighbours; return the number of points removed."""
    points, triangles, _, fan, size, border = fans
    removed = 0
    near = np.empty(2 * fan.shape[1], np.int64)
    far = np.empty(2 * fan.shape[1])
    for u in range(len(points)):
        if locked[u] or size[u] == 0:
            continue
        for k in range(_nearest_neighbours(fans, u, shortest * shortest, near, far)):
            v = near[k]
            on_border = border[u, 0] >= 0
            side = 1 if on_border and v != border[u, 0] else 0
            w = border[u, 1 - side]
            # The border keeps its shape, and no second border joins it.
            if on_border and (
                w == v or border[v, 0] < 0 or _off_segment(points, u, v, w) > sag
            ):  # fmt: skip
                continue
            # The surface stays a manifold: beside the edge lie its own triangles alone, and both
            # ends have no common neighbours but their tips.
            both, common = _shared(triangles, fan, size, u, v)
            if both != (1 if on_border else 2) or common != both:
                continue
            if size[u] + size[v] - 2 * both > fan.shape[1]:
                continue
            if not _may_move(points, triangles, fan, size, u, v):
                continue
            _merge(fans, u, v)
            if on_border:
                border[v, 1 - side] = w
                border[w, side] = v
            removed += 1
            break
    return removed


@compiled
def _nearest_neighbours(fans: _Fans, u: int, limit: float, near: IntArray, far: FloatArray) -> int:
    """Write the points that u may move to, the nearest first; return their number.

    Those at a squared distance `far` below a limit; from the border, along the border alone.
    """
    points, triangles, _, fan, size, border = fans
    count = 0
    for a in range(size[u]):
        for i in range(3):
            v = triangles[fan[u, a], i]
            if v == u:
                continue
            gap = _square(points, u, v)
            if gap >= limit:
                continue
            if border[u, 0] >= 0 and v != border[u, 0] and v != border[u, 1]:
                continue
            known = False
            for k in range(count):
                known |= near[k] == v
            if not known:
                k = count
                while k > 0 and far[k - 1] > gap:
                    near[k], far[k] = near[k - 1], far[k - 1]
                    k -= 1
                near[k], far[k] = v, gap
                count += 1
    return count


@compiled
def _merge(fans: _Fans, u: int, v: int) -> None:
    """Move u to v: triangles with both vanish, the others of u become triangles of v."""
    _, triangles, alive, fan, size, _ = fans
    for a in range(size[u]):
        t = fan[u, a]
        i, has = 0, False
        for j in range(3):
            has |= triangles[t, j] == v
            if triangles[t, j] == u:
                i = j
        if has:
            alive[t] = False
            for j in range(3):
                p = triangles[t, j]
                if p == u:
                    continue
                b = 0
                while fan[p, b] != t:
                    b += 1
                size[p] -= 1
                fan[p, b] = fan[p, size[p]]
        else:
            triangles[t, i] = v
            fan[v, size[v]] = t
            size[v] += 1
    size[u] = 0


def _twins(triangles: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Triangle and corner across the side opposite to each corner, (t, 3) each; -1 where none."""
    a = triangles[:, [1, 2, 0]].ravel()
    b = triangles[:, [2, 0, 1]].ravel()
    key = np.minimum(a, b) * n + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    twin = np.full(len(key), -1, dtype=np.int64)
    twin[order[first]], twin[order[first + 1]] = order[first + 1], order[first]
    return np.where(twin >= 0, twin // 3, -1).reshape(-1, 3), (twin % 3).reshape(-1, 3)


@compiled
def _flip(points: FloatArray, triangles: IntArray, across: IntArray, corner: IntArray) -> int:
    """Flip sides whose opposite angles exceed a half turn (Delaunay); return their number."""
    flipped = 0
    touched = np.zeros(len(triangles), np.bool_)
    for t in range(len(triangles)):
        for i in range(3):
            u = across[t, i]
            if u < 0 or touched[t] or touched[u]:
                continue
            p, q = triangles[t, (i + 1) % 3], triangles[t, (i + 2) % 3]
            a, b = triangles[t, i], triangles[u, corner[t, i]]
            near, far, side = _square(points, a, p), _square(points, a, q), _square(points, p, q)
            one = near + far - side
            near, far = _square(points, b, p), _square(points, b, q)
            other = near + far - side
            ax, ay, az = _normal(points, a, p, q)
            bx, by, bz = _normal(points, b, q, p)
            first, second = (
                np.sqrt(ax * ax + ay * ay + az * az),
                np.sqrt(bx * bx + by * by + bz * bz),
            )
            # Sum of the cotangents of the opposite angles, times the areas.
            if one * second + other * first >= -1e-9 * side * side:
                continue
            cx, cy, cz = _normal(points, a, p, b)
            dx, dy, dz = _normal(points, a, b, q)
            third, fourth = (
                np.sqrt(cx * cx + cy * cy + cz * cz),
                np.sqrt(dx * dx + dy * dy + dz * dz),
            )
            sx, sy, sz = ax + bx, ay + by, az + bz
            total = np.sqrt(sx * sx + sy * sy + sz * sz)
            if cx * sx + cy * sy + cz * sz < _TILT * third * total or third == 0.0:
                continue
            if dx * sx + dy * sy + dz * sz < _TILT * fourth * total or fourth == 0.0:
                continue
            triangles[t, 0], triangles[t, 1], triangles[t, 2] = a, p, b
            triangles[u, 0], triangles[u, 1], triangles[u, 2] = a, b, q
            touched[t] = touched[u] = True
            # Neighbours refer to the two triangles by sides that have moved.
            for k in range(3):
                if across[t, k] >= 0:
                    touched[across[t, k]] = True
                if across[u, k] >= 0:
                    touched[across[u, k]] = True
            flipped += 1
    return flipped
