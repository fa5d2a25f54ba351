"""Stress fitted by polynomials on patches of cells: more accurate than the stress of the cells.

Superconvergent patch recovery (Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng 33, 1992,
1331-1364): round each corner node a polynomial of the order of the displacement, linear or
quadratic, is fitted to the stress at the points where that of the cells is most accurate. Cells of
very different stiffness are fitted separately, since the stress jumps between them.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray, seen_only
from ccfem.body.mesh.tet_mesh import TetMesh

_A, _B = 0.5854101966249685, 0.1381966011250105
SAMPLES = {1: np.full((1, 4), 0.25), 2: np.full((4, 4), _B) + (_A - _B) * np.eye(4)}
"""Barycentric coordinates of the points where the stress of a cell is most accurate, by its order:
those of the quadrature that is exact for the products of its stress."""

_LEAST = {1: 10, 2: 6}
"""Least number of cells of a patch, where there are so many. A polynomial needs cells on all sides
rather than a large number (measured on problems with known solutions)."""
_RIDGE = np.array([1e-10, 1e-6])
"""Weights, over that of the samples, that keep linear and quadratic terms near zero where a patch
does not determine them; larger for the quadratic ones."""
_ALIKE = 4.0
"""Ratio of stiffnesses up to which cells are fitted together."""


@dataclass(frozen=True)
class Patches:
    """Polynomials round the corner nodes, one for each kind of stiffness at a node.

    Attributes
    ----------
    of_corner : (m, 4) int array
        Polynomial at each corner of each cell.
    centre : (g, 3) array, mm
    size : (g,) array, mm
        Coordinates of a polynomial are distances from its centre over its size.
    coefficients : (g, 4 or 10, 6) array, MPa
        Of 1, x, y, z, and x^2, y^2, z^2, yz, xz, xy; Voigt.
    """

    of_corner: IntArray
    centre: FloatArray
    size: FloatArray
    coefficients: FloatArray


def stress_patches(mesh: TetMesh, stress: FloatArray, stiffness: FloatArray) -> Patches:
    """Fit polynomials to the stress of the cells.

    Parameters
    ----------
    mesh : TetMesh
    stress : (m, q, 6) array, MPa
        Voigt, at the `SAMPLES` of the cells' order.
    stiffness : (m,) or (1,) array
        How stiff each cell is.
    """
    kind = np.floor(np.log(stiffness) / np.log(_ALIKE)).astype(np.int64)
    if len(kind) == 1 or (kind == kind[0]).all():
        # A polynomial for each node; nodes without cells stay empty.
        nodes, of_corner = np.arange(len(mesh.points)), mesh.corners
    else:
        kind -= kind.min()
        kinds = int(kind.max()) + 1
        groups, of_corner = np.unique(mesh.corners * kinds + kind[:, None], return_inverse=True)
        nodes = groups // kinds
    of_corner = seen_only(of_corner.reshape(-1, 4))
    start, cells = _cells_round(of_corner, len(nodes))
    at = SAMPLES[mesh.order]
    terms = 4 if mesh.order == 1 else 10
    size = np.zeros(len(nodes))
    coefficients = np.zeros((len(nodes), terms, 6))
    _fit(mesh.points, seen_only(mesh.corners), of_corner, nodes, start, cells, at, stress,
         _LEAST[mesh.order], _RIDGE, size, coefficients)  # fmt: skip
    return Patches(of_corner, mesh.points[nodes], size, coefficients)


@njit(cache=True)
def _cells_round(of_corner, groups):  # type: ignore[no-untyped-def]
    """Cells that have each polynomial at a corner: their starts, and the cells."""
    start = np.zeros(groups + 1, np.int64)
    for cell in range(len(of_corner)):
        for a in range(4):
            start[of_corner[cell, a]] += 1
    total = 0
    for group in range(groups + 1):
        total, start[group] = total + start[group], total + start[group]
    cells = np.empty(total, np.int64)
    for cell in range(len(of_corner) - 1, -1, -1):
        for a in range(4):
            group = of_corner[cell, a]
            start[group] -= 1
            cells[start[group]] = cell
    return start, cells


@njit(cache=True)
def _terms(x, y, z, p):  # type: ignore[no-untyped-def]
    """Store the terms of a polynomial at a place."""
    p[0], p[1], p[2], p[3] = 1.0, x, y, z
    if len(p) == 10:
        p[4], p[5], p[6], p[7], p[8], p[9] = x * x, y * y, z * z, y * z, x * z, x * y


@njit(cache=True)
def _gather(group, corners, of_corner, start, cells, least, stamp, found):  # type: ignore[no-untyped-def]
    """Store the cells of a patch and return their number: those at the node, more if too few."""
    count = 0
    for k in range(start[group], start[group + 1]):
        found[count] = cells[k]
        stamp[cells[k]] = group
        count += 1
    if count >= least:
        return count
    own = count
    for k in range(own):
        for a in range(4):
            other = of_corner[found[k], a]
            for j in range(start[other], start[other + 1]):
                cell = cells[j]
                if stamp[cell] != group and count < len(found):
                    stamp[cell] = group
                    found[count] = cell
                    count += 1
    return count


@njit(cache=True)
def _cholesky(matrix, right):  # type: ignore[no-untyped-def]
    """Solve with a small positive definite matrix, in place."""
    n, m = right.shape
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(total) if i == j else total / matrix[j, j]
    for c in range(m):
        for i in range(n):
            total = right[i, c]
            for k in range(i):
                total -= matrix[i, k] * right[k, c]
            right[i, c] = total / matrix[i, i]
        for i in range(n - 1, -1, -1):
            total = right[i, c]
            for k in range(i + 1, n):
                total -= matrix[k, i] * right[k, c]
            right[i, c] = total / matrix[i, i]


@njit(cache=True)
def _fit(  # type: ignore[no-untyped-def]
    points, corners, of_corner, nodes, start, cells, at, stress, least, ridge, size, coefficients
):
    terms = coefficients.shape[1]
    p = np.empty(terms)
    gram, right = np.empty((terms, terms)), np.empty((terms, 6))
    stamp = np.full(len(corners), -1, np.int64)
    most = 0
    for group in range(len(nodes)):
        most = max(most, start[group + 1] - start[group])
    found = np.empty(most + 4096, np.int64)
    place = np.empty((len(found) * len(at), 3))
    for group in range(len(nodes)):
        if start[group] == start[group + 1]:
            size[group] = 1.0
            continue
        count = _gather(group, corners, of_corner, start, cells, least, stamp, found)
        extent, s = 0.0, 0
        for k in range(count):
            for q in range(len(at)):
                for d in range(3):
                    x = -points[nodes[group], d]
                    for a in range(4):
                        x += at[q, a] * points[corners[found[k], a], d]
                    place[s, d] = x
                    extent = max(extent, abs(x))
                s += 1
        for i in range(terms):
            for j in range(i + 1):
                gram[i, j] = 0.0
            for j in range(6):
                right[i, j] = 0.0
        for s in range(count * len(at)):
            _terms(place[s, 0] / extent, place[s, 1] / extent, place[s, 2] / extent, p)
            cell, q = found[s // len(at)], s % len(at)
            for i in range(terms):
                for j in range(i + 1):
                    gram[i, j] += p[i] * p[j]
                for j in range(6):
                    right[i, j] += p[i] * stress[cell, q, j]
        for i in range(1, terms):
            gram[i, i] += ridge[0 if i < 4 else 1] * gram[0, 0]
        _cholesky(gram, right)
        size[group] = extent
        for i in range(terms):
            for j in range(6):
                coefficients[group, i, j] = right[i, j]


@njit(cache=True)
def fitted(coefficients, x, y, z, p, out):  # type: ignore[no-untyped-def]
    """Add the stress (6,) of a polynomial at a place to `out`, half of it."""
    _terms(x, y, z, p)
    for i in range(len(p)):
        for j in range(6):
            out[j] += 0.5 * p[i] * coefficients[i, j]
