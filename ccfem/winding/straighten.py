"""Straightening of a curve across triangles."""

from dataclasses import replace

import numpy as np
from numba import njit

from ccfem.arrays import FloatArray
from ccfem.winding.triangle_mesh import EdgePath

__all__ = ["straighten"]

_SWEEPS = 20


def straighten(points: FloatArray, path: EdgePath, keep: float, sweeps: int = _SWEEPS) -> EdgePath:
    """Move the crossings of a curve along their edges so that it gets shorter.

    Each crossing in turn goes to where the straight line between its neighbours crosses its edge,
    with the two triangles laid flat; after s sweeps bends are spread over about sqrt(s) crossings.

    Parameters
    ----------
    points : (n, 3) array, mm
    path : EdgePath
    keep : float in (0, 0.5)
        Least share of an edge between a crossing and either end.
    sweeps : int
    """
    share = path.share.copy()
    _sweep(points, path.start, path.end, path.edges, share, keep, sweeps)
    return replace(path, share=share)


@njit(cache=True, nogil=True)
def _sweep(points, start, end, edges, share, keep, sweeps):  # type: ignore[no-untyped-def]
    count = len(share)
    for sweep in range(sweeps):
        for step in range(count):
            k = step if sweep % 2 == 0 else count - 1 - step
            a, b = points[edges[k, 0]], points[edges[k, 1]]
            if k > 0:
                p = points[edges[k - 1, 0]] * (1.0 - share[k - 1]) + (
                    points[edges[k - 1, 1]] * share[k - 1]
                )
            else:
                p = points[start]
            if k < count - 1:
                q = points[edges[k + 1, 0]] * (1.0 - share[k + 1]) + (
                    points[edges[k + 1, 1]] * share[k + 1]
                )
            else:
                q = points[end]
            along = b - a
            square = (along * along).sum()
            # Where each neighbour stands along the edge, and how far off it.
            s, t = ((p - a) * along).sum() / square, ((q - a) * along).sum() / square
            u = np.sqrt(max(((p - a - s * along) ** 2).sum(), 0.0))
            v = np.sqrt(max(((q - a - t * along) ** 2).sum(), 0.0))
            if u + v > 0.0:
                share[k] = min(max((s * v + t * u) / (u + v), keep), 1.0 - keep)
