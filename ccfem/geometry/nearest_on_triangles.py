"""Nearest points on a triangulated surface."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError


@dataclass(frozen=True)
class Nearest:
    """Points of a surface that are nearest to others.

    Attributes
    ----------
    triangle : (q,) int array
    weights : (q, 3) array
        Barycentric coordinates in it, in [0, 1].
    points : (q, 3) array, mm
    distance : (q,) array, mm
    """

    triangle: IntArray
    weights: FloatArray
    points: FloatArray
    distance: FloatArray


def nearest_on_triangles(points: FloatArray, triangles: IntArray, queries: FloatArray) -> Nearest:
    """Find the points of a surface that are nearest to given ones.

    Triangles may be of any size; those without area are passed over. Of several triangles at the
    same distance any may be returned.

    Parameters
    ----------
    points : (n, 3) array, mm
    triangles : (t, 3) int array
    queries : (q, 3) array, mm

    Raises
    ------
    InputError
        For queries that are not finite, and for a surface without area.
    """
    import pyvista as pv
    from vtkmodules.vtkCommonCore import reference
    from vtkmodules.vtkCommonDataModel import vtkStaticCellLocator

    if not np.isfinite(queries).all():
        raise InputError("expected finite points to find the nearest ones of; got NaN or infinity")
    points = np.asarray(points, dtype=np.float64)
    triangle, foot = np.full(len(queries), -1), np.zeros((len(queries), 3))
    locator: Any = vtkStaticCellLocator()
    if len(triangles):
        locator.SetDataSet(pv.PolyData.from_regular_faces(points, triangles))
        locator.BuildLocator()
        at, part, square = [0.0, 0.0, 0.0], reference(0), reference(0.0)
        cell: Any = reference(-1)
        for k, query in enumerate(queries.tolist()):
            cell.set(-1)  # stays where no triangle is at a finite distance
            locator.FindClosestPoint(query, at, cell, part, square)
            triangle[k], foot[k] = cell.get(), at
    if (triangle < 0).any():
        raise InputError(
            "expected a surface with area at a finite distance; got "
            f"{len(triangles)} triangles without"
        )
    weights = _barycentric(points[triangles[triangle]], foot)
    nearest = np.einsum("qk,qkd->qd", weights, points[triangles[triangle]])
    return Nearest(triangle, weights, nearest, np.linalg.norm(nearest - queries, axis=1))


def _barycentric(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Coordinates (q, 3) of points (q, 3) of triangles with the given corners (q, 3, 3)."""
    sides = corners[:, [1, 2]] - corners[:, :1]
    normal = np.cross(sides[:, 0], sides[:, 1])
    square = np.maximum(np.einsum("qd,qd->q", normal, normal), np.finfo(float).tiny)
    # Twice the areas that the point spans with two sides, as shares of the triangle's.
    across = np.cross(points[:, None] - corners[:, :1], sides[:, ::-1]) * [[[1.0], [-1.0]]]
    weights = np.clip(np.einsum("qkd,qd->qk", across, normal) / square[:, None], 0.0, 1.0)
    weights = np.column_stack([1.0 - weights.sum(axis=1), weights])
    return np.maximum(weights, 0.0) / np.maximum(weights, 0.0).sum(axis=1, keepdims=True)
