"""Nodes that lie on a facet of a cell without being a node of it, so that nothing joins them."""

import numpy as np
from numba import njit

from ccfem.arrays import IntArray
from ccfem.geometry.buckets import bucket
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["hanging_nodes"]

_TOUCH = 1e-6
"""Distance from a facet, over its longest side, within which a node lies on it."""


def hanging_nodes(mesh: TetMesh) -> IntArray:
    """Nodes of the boundary (k,) that hang on a boundary facet, inside it or on one of its sides.

    In a mesh whose cells meet face to face there are none, unless pieces touch that are meant to
    be apart. Nodes that lie on a corner of the facet are no hanging ones, but coincident.

    Parameters
    ----------
    mesh : TetMesh
        Of a quadratic mesh the corners are looked at; its middles follow them.
    """
    facets = mesh.boundary
    nodes = np.unique(facets)
    corners = mesh.points[facets]
    low, high = corners.min(axis=1), corners.max(axis=1)
    margin = _TOUCH * float((high - low).max())
    grid = bucket(low - margin, high + margin)
    found = np.zeros(len(nodes), dtype=np.bool_)
    _hang(grid.origin, grid.cell, grid.shape, grid.starts, grid.items, mesh.points, nodes, facets,
          found)  # fmt: skip
    return nodes[found]


@njit(cache=True)
def _hang(origin, cell, shape, starts, items, points, nodes, facets, found):  # type: ignore[no-untyped-def]
    """Mark the nodes that lie on a facet in their bucket."""
    e, f, g = np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(nodes)):
        node, box = nodes[k], 0
        for d in range(3):
            at = int(np.floor((points[node, d] - origin[d]) / cell))
            box = box * shape[d] + min(max(at, 0), shape[d] - 1)
        for item in range(starts[box], starts[box + 1]):
            a, b, c = facets[items[item]]
            if node in (a, b, c):
                continue
            ee = ff = ef = ge = gf = gg = 0.0
            for d in range(3):
                e[d] = points[b, d] - points[a, d]
                f[d] = points[c, d] - points[a, d]
                g[d] = points[node, d] - points[a, d]
                ee += e[d] * e[d]
                ff += f[d] * f[d]
                ef += e[d] * f[d]
                ge += g[d] * e[d]
                gf += g[d] * f[d]
                gg += g[d] * g[d]
            size = max(ee, ff, ee + ff - 2.0 * ef)
            area = ee * ff - ef * ef
            if area <= 1e-12 * size * size:
                continue
            s, t = (ff * ge - ef * gf) / area, (ee * gf - ef * ge) / area
            if s < -1e-6 or t < -1e-6 or s + t > 1.0 + 1e-6:
                continue
            if max(s, t, 1.0 - s - t) > 1.0 - 1e-6:  # on a corner
                continue
            off = 0.0
            for d in range(3):
                rest = g[d] - s * e[d] - t * f[d]
                off += rest * rest
            if off <= 1e-12 * size:
                found[k] = True
                break
