"""Nodes that lie on a facet of a cell without being a node of it, so that nothing joins them."""

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.body.mesh.tet_mesh import TetMesh

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
    centre = corners.mean(axis=1)
    reach = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    tree = cKDTree(mesh.points[nodes])
    near = tree.query_ball_point(centre, (1.0 + _TOUCH) * reach, return_sorted=False)
    facet = np.repeat(np.arange(len(facets)), [len(each) for each in near])
    node = nodes[np.concatenate([np.asarray(each, dtype=np.int64) for each in near])]
    other = (facets[facet] != node[:, None]).all(axis=1)
    facet, node = facet[other], node[other]
    return np.unique(node[_lies_on(mesh.points[node], *np.moveaxis(corners[facet], 1, 0))])


def _lies_on(
    points: FloatArray, first: FloatArray, second: FloatArray, third: FloatArray
) -> BoolArray:
    """Whether each point (k, 3) lies on its triangle, and not on a corner of it."""
    e, f, g = second - first, third - first, points - first
    ee, ff, ef = _dot(e, e), _dot(f, f), _dot(e, f)
    ge, gf = _dot(g, e), _dot(g, f)
    size = np.maximum(np.maximum(ee, ff), ee + ff - 2.0 * ef)
    area = ee * ff - ef * ef
    proper = area > 1e-12 * size * size
    area = np.where(proper, area, 1.0)
    s, t = (ff * ge - ef * gf) / area, (ee * gf - ef * ge) / area
    weights = np.stack([1.0 - s - t, s, t])
    off = g - s[:, None] * e - t[:, None] * f
    inside = (weights.min(axis=0) >= -_TOUCH) & (weights.max(axis=0) <= 1.0 - _TOUCH)
    return proper & inside & (_dot(off, off) <= _TOUCH**2 * size)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.einsum("ij,ij->i", a, b)
