"""Straightening of a curve across triangles."""

from dataclasses import replace

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray, seen_only
from ccfem.strategies.winding_curves.triangle_mesh import EdgePath

_SWEEPS = 20


def straighten(points: FloatArray, path: EdgePath, keep: float, sweeps: int = _SWEEPS) -> EdgePath:
    """Move the crossings of a curve along their edges so that it gets shorter.

    Each crossing in turn moves to where the straight line between its neighbours crosses its edge,
    with both triangles laid flat. After s sweeps bends are spread over about sqrt(s) crossings.

    Parameters
    ----------
    points : (n, 3) array, mm
    path : EdgePath
    keep : float in (0, 0.5)
        Least share of an edge between a crossing and either end.
    sweeps : int
    """
    share = path.share.copy()
    _sweep(seen_only(points), path.start, path.end, path.edges, share, keep, sweeps)
    return replace(path, share=share)


@njit(cache=True, nogil=True)
def _sweep(points, start, end, edges, share, keep, sweeps):  # type: ignore[no-untyped-def]
    count = len(share)
    for sweep in range(sweeps):
        for step in range(count):
            k = step if sweep % 2 == 0 else count - 1 - step
            # Position of each neighbour along the edge, and its distance from the edge.
            square, s, t = 0.0, 0.0, 0.0
            for i in range(points.shape[1]):
                a = points[edges[k, 0], i]
                along = points[edges[k, 1], i] - a
                square += along * along
                s += (_before(points, start, edges, share, k, i) - a) * along
                t += (_behind(points, end, edges, share, k, i) - a) * along
            s, t = s / square, t / square
            u, v = 0.0, 0.0
            for i in range(points.shape[1]):
                a = points[edges[k, 0], i]
                along = points[edges[k, 1], i] - a
                u += (_before(points, start, edges, share, k, i) - a - s * along) ** 2
                v += (_behind(points, end, edges, share, k, i) - a - t * along) ** 2
            u, v = np.sqrt(u), np.sqrt(v)
            if u + v > 0.0:
                share[k] = min(max((s * v + t * u) / (u + v), keep), 1.0 - keep)


@njit(cache=True, nogil=True)
def _before(points, start, edges, share, k, i):  # type: ignore[no-untyped-def]
    """Coordinate i of the point before crossing k: the previous crossing, or the start."""
    return points[start, i] if k == 0 else _crossing(points, edges, share, k - 1, i)


@njit(cache=True, nogil=True)
def _behind(points, end, edges, share, k, i):  # type: ignore[no-untyped-def]
    """Coordinate i of the point after crossing k: the next crossing, or the end."""
    return points[end, i] if k == len(share) - 1 else _crossing(points, edges, share, k + 1, i)


@njit(cache=True, nogil=True)
def _crossing(points, edges, share, k, i):  # type: ignore[no-untyped-def]
    """Coordinate i of a crossing."""
    return points[edges[k, 0], i] * (1.0 - share[k]) + points[edges[k, 1], i] * share[k]
