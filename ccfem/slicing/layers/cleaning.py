"""Cleaning the triangles of a level surface: short edges collapse, thin pairs are flipped.

Points are only removed, never moved: the remaining points lie where the mesh was cut, and the
border keeps its shape. Hoppe et al., Mesh optimization, SIGGRAPH 1993.
"""

import numpy as np
from numba import njit

from ccfem.base.arrays import BoolArray, FloatArray, IntArray

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
    _gather(triangles, fan, size)
    locked = fixed | (size > _FAN)
    border = np.full((len(points), 2), -1, dtype=np.int64)
    _find_border(triangles, fan, size, border, locked)
    for _ in range(_ROUNDS):
        if not _collapse(
            points, triangles, alive, fan, size, border, locked, shortest, sag, _TILT
        ):  # fmt: skip
            break
    triangles, cell = triangles[alive], cell[alive]
    for _ in range(_ROUNDS):
        if not _flip(points, triangles, *_twins(triangles, len(points)), _TILT):
            break
    return triangles, cell


@njit(cache=True, nogil=True)
def _gather(triangles, fan, size):  # type: ignore[no-untyped-def]
    """Triangles round each point."""
    for t in range(len(triangles)):
        for i in range(3):
            p = triangles[t, i]
            if size[p] < fan.shape[1]:
                fan[p, size[p]] = t
            size[p] += 1


@njit(cache=True, nogil=True)
def _find_border(triangles, fan, size, border, locked):  # type: ignore[no-untyped-def]
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


@njit(cache=True, nogil=True)
def _normal(points, a, b, c):  # type: ignore[no-untyped-def]
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


@njit(cache=True, nogil=True)
def _square(points, a, b):  # type: ignore[no-untyped-def]
    x, y, z = points[a, 0] - points[b, 0], points[a, 1] - points[b, 1], points[a, 2] - points[b, 2]
    return x * x + y * y + z * z


@njit(cache=True, nogil=True)
def _off_segment(points, p, a, b):  # type: ignore[no-untyped-def]
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


@njit(cache=True, nogil=True)
def _shared(triangles, fan, size, u, v):  # type: ignore[no-untyped-def]
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
            near = False
            for b in range(size[v]):
                for j in range(3):
                    near |= triangles[fan[v, b], j] == p
            common += near
    return both, common


@njit(cache=True, nogil=True)
def _may_move(points, triangles, fan, size, u, v, tilt):  # type: ignore[no-untyped-def]
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
        if old > 1e-3 * longest and ox * nx + oy * ny + oz * nz < tilt * old * new:
            return False
        longest = max(base, _square(points, v, p), _square(points, v, q))
        thinnest_after = min(thinnest_after, new / longest)
    return thinnest_after >= min(_THIN, thinnest_before)


@njit(cache=True, nogil=True)
def _collapse(  # type: ignore[no-untyped-def]
    points, triangles, alive, fan, size, border, locked, shortest, sag, tilt
):
    """Try to move each point to its nearest neighbours; return the number of points removed."""
    removed = 0
    limit = shortest * shortest
    near = np.empty(2 * fan.shape[1], np.int64)
    far = np.empty(2 * fan.shape[1])
    for u in range(len(points)):
        if locked[u] or size[u] == 0:
            continue
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
        for k in range(count):
            v = near[k]
            on_border = border[u, 0] >= 0
            if on_border:
                side = 0 if v == border[u, 0] else 1
                w = border[u, 1 - side]
                if w == v or border[v, 0] < 0 or _off_segment(points, u, v, w) > sag:
                    continue
            both, common = _shared(triangles, fan, size, u, v)
            if both != (1 if on_border else 2) or common != both:
                continue
            if size[u] + size[v] - 2 * both > fan.shape[1]:
                continue
            if not _may_move(points, triangles, fan, size, u, v, tilt):
                continue
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
            if on_border:
                w = border[u, 1 - side]
                border[v, 1 - side] = w
                border[w, side] = v
            removed += 1
            break
    return removed


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


@njit(cache=True, nogil=True)
def _flip(points, triangles, across, corner, tilt):  # type: ignore[no-untyped-def]
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
            if cx * sx + cy * sy + cz * sz < tilt * third * total or third == 0.0:
                continue
            if dx * sx + dy * sy + dz * sz < tilt * fourth * total or fourth == 0.0:
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
