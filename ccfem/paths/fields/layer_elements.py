"""Linear finite elements on the triangles of a layer: gradients, Laplacian, adjacency."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from ccfem.base.arrays import FloatArray, IntArray, read_only
from ccfem.body.mesh.numbering import nested_dissection
from ccfem.geometry.facets import areas_and_normals, paired, signed_areas
from ccfem.geometry.isocontours import triangle_edges
from ccfem.slicing.layers.layer import Layer


def positive_definite(matrix: Any) -> Any:
    """Factorise a sparse symmetric positive definite matrix; the result has ``solve``."""
    options = {"SymmetricMode": True, "DiagPivotThresh": 0.0}
    return splu(sparse.csc_array(matrix), permc_spec="MMD_AT_PLUS_A", options=options)


def dissected(matrix: Any, points: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Factorise as `positive_definite`, quickly on regular triangles too; return the solve.

    The matrix has k rows for each point (n, d), mm, one after the other, and is ordered by
    `nested_dissection`.
    """
    columns = sparse.csc_array(matrix)
    each = columns.shape[0] // len(points)
    order = nested_dissection(points, columns.indptr[::each], columns.indices // each)
    rows = (each * order[:, None] + np.arange(each)).ravel()
    options = {"SymmetricMode": True, "DiagPivotThresh": 0.0}
    factor = splu(columns[rows][:, rows], permc_spec="NATURAL", options=options)

    def solve(right: FloatArray) -> FloatArray:
        solution = np.empty_like(right)
        solution[rows] = factor.solve(right[rows])
        return solution

    return solve


_STEEP = 0.9
"""Cosine to a triangle's normal above which an axis counts as almost normal to the triangle."""
_THIN = 1e-9
"""Area, over the mean area, below which a triangle has no usable gradient and gets none."""


@dataclass(frozen=True)
class Surface:
    """Triangles (t, 3) between points (n, 2 or 3), mm, with the operators that the fields need.

    Gradients and metrics have two components: in the plane, or in space along the `frames` of each
    triangle.
    """

    points: FloatArray
    triangles: IntArray

    @classmethod
    def of(cls, layer: Layer) -> "Surface":
        """Surface of a flat layer in its plane coordinates."""
        return cls(layer.plane.points, layer.triangles)

    @cached_property
    def frames(self) -> FloatArray:
        """Two unit vectors along each triangle in space, (t, 2, 3), the second left of the first.

        The first is the projection onto the triangle of an axis: of those not almost normal to the
        triangle, the one along which the surface is longest.
        """
        _, normal = areas_and_normals(self.points, self.triangles)
        longest, second = np.argsort(-np.ptp(self.points, axis=0), kind="stable")[:2]
        steep = np.abs(normal[:, longest]) > _STEEP
        axis = np.where(steep[:, None], np.eye(3)[second], np.eye(3)[longest])
        first = axis - np.einsum("td,td->t", axis, normal)[:, None] * normal
        first = first / np.maximum(np.linalg.norm(first, axis=1), 1e-300)[:, None]
        return read_only(np.stack([first, np.cross(normal, first)], axis=1))

    @cached_property
    def _plane_corners(self) -> FloatArray:
        """Corners of each triangle in its own plane, (t, 3, 2)."""
        corners = self.points[self.triangles]
        if self.points.shape[1] == 2:
            return corners
        away = corners - corners[:, :1]
        return np.asarray(np.einsum("tid,tkd->tik", away, self.frames))

    @cached_property
    def areas(self) -> FloatArray:
        """Area of each triangle, (t,), mm^2; 0 where a chart inverts the triangle."""
        corners = np.arange(3 * len(self.triangles)).reshape(-1, 3)
        return read_only(np.maximum(signed_areas(self._plane_corners.reshape(-1, 2), corners), 0.0))

    @cached_property
    def gradients(self) -> FloatArray:
        """Gradients of the three shape functions on each triangle, (t, 3, 2), 1/mm."""
        p = self._plane_corners
        opposite = p[:, [2, 0, 1]] - p[:, [1, 2, 0]]
        turned = np.stack([-opposite[..., 1], opposite[..., 0]], axis=-1)
        thick = self.areas > _THIN * self.areas.mean()
        double = np.where(thick, 2.0 * self.areas, np.inf)
        return read_only(turned / double[:, None, None])

    @cached_property
    def gradient_matrix(self) -> Any:
        """Matrix (2 t, n) from values at the points to x and y gradients, alternating."""
        values = np.swapaxes(self.gradients, 1, 2).ravel()
        columns = np.repeat(self.triangles, 2, axis=0).ravel()
        rows = np.arange(0, len(values) + 1, 3)
        shape = (2 * len(self.triangles), len(self.points))
        return sparse.csr_array((values, columns, rows), shape=shape)

    def gradient(self, values: FloatArray) -> FloatArray:
        """Gradient (t, 2) on each triangle of a field (n,) given at the points."""
        return np.einsum("tk,tkd->td", values[self.triangles], self.gradients)

    def mean(self, values: FloatArray) -> FloatArray:
        """Mean on each triangle, (t, ...), of a field (n, ...) given at the points."""
        return values[self.triangles].mean(axis=1)

    def energy(self, metric: FloatArray) -> Any:
        """Matrix (n, n) of the quadratic form ``sum_f grad s . metric_f grad s``.

        The metric (t, 2, 2) is symmetric, and includes the area of the triangle.
        """
        gx, gy = self.gradients[:, :, 0], self.gradients[:, :, 1]
        fx = metric[:, 0, 0, None] * gx + metric[:, 0, 1, None] * gy
        fy = metric[:, 1, 0, None] * gx + metric[:, 1, 1, None] * gy
        return self.matrix(gx[:, :, None] * fx[:, None, :] + gy[:, :, None] * fy[:, None, :])

    def matrix(self, blocks: FloatArray) -> sparse.csc_array:
        """Assemble matrices (t, 3, 3) of the triangles to one (n, n) of the points."""
        rows = np.repeat(self.triangles, 3, axis=1).ravel()
        columns = np.tile(self.triangles, (1, 3)).ravel()
        n = len(self.points)
        return sparse.coo_array((blocks.ravel(), (rows, columns)), shape=(n, n)).tocsc()

    def source(self, flux: FloatArray) -> FloatArray:
        """Vector (n,) of the linear form ``sum_f grad s . flux_f`` for (t, 2) fluxes."""
        values = np.einsum("tid,td->ti", self.gradients, flux)
        return self._at_points(values.ravel())

    def lumped(self, weight: FloatArray) -> FloatArray:
        """Lumped mass (n,) of a weight (t,) per triangle, in mm^2 times the unit of the weight."""
        share = np.repeat(self.areas * weight / 3.0, 3)
        return self._at_points(share)

    def _at_points(self, values: FloatArray) -> FloatArray:
        total = np.bincount(self.triangles.ravel(), values, minlength=len(self.points))
        return total.astype(np.float64)

    def to_points(self, values: FloatArray) -> FloatArray:
        """Area-weighted mean at the points, (n,), of a field (t,) given on the triangles."""
        return self.lumped(values) / np.maximum(self.lumped(np.ones(len(values))), 1e-300)

    @cached_property
    def edges(self) -> tuple[IntArray, IntArray]:
        """Unique edges (e, 2), and the edges (t, 3) opposite to the corners of each triangle."""
        return triangle_edges(self.triangles)

    @cached_property
    def neighbours(self) -> IntArray:
        """Pairs of triangles that share an edge, (f, 2)."""
        sides = self.triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
        return read_only(paired(sides)[0] // 3, int)
