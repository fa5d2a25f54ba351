"""Estimated error of a solution in energy, cell by cell.

The stress of the cells is compared with the smoother stress recovered from patches of cells. The
energy of the difference estimates that of the error (Zienkiewicz and Zhu, Int. J. Numer. Meth.
Engng 24, 1987, 337-357; 33, 1992, 1365-1382). The error of the displacement at the load is of its
square: 10 % here is 1 % of the work of the load.
"""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, seen_only
from ccfem.base.compiled import compiled
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity.assembly import cell_gradients, grouped
from ccfem.fem.elasticity.recovery import slopes_at, times, voigt_strain


@dataclass(frozen=True)
class ErrorEstimate:
    """Estimated error of the stress of the cells: twice its energy, and that of stress, N mm."""

    cells: FloatArray
    energies: FloatArray

    def __post_init__(self) -> None:
        freeze(self, cells=float, energies=float)

    @property
    def relative(self) -> float:
        """Energy norm of the error over that of the exact stress, in [0, 1].

        Under forces, the energies of solution and error add up to that of the exact stress.
        """
        return self.relative_in(slice(None))

    def relative_in(self, cells: IntArray | BoolArray | slice) -> float:
        """Do the same in some cells: the relative error of their stress."""
        error = float(self.cells[cells].sum())
        total = error + float(self.energies[cells].sum())
        return float(np.sqrt(error / total)) if total > 0.0 else 0.0

    def densities(self, volumes: FloatArray) -> FloatArray:
        """Energy norm of the error of each cell (m,) over that of an average cell of its volume."""
        total = float(self.cells.sum() + self.energies.sum())
        mean = total / float(volumes.sum())
        return np.sqrt(self.cells / volumes / mean) if mean > 0.0 else np.zeros(len(volumes))


_FREELY = 1e-16
"""Energy, over that of a part held against all free strain, below which stress is rounding."""


def estimate_error(
    mesh: TetMesh,
    displacement: FloatArray,
    stiffness: FloatArray,
    free: FloatArray | None = None,
    region: IntArray | None = None,
) -> ErrorEstimate:
    """Estimate the error of a displacement.

    Parameters
    ----------
    displacement : (n, 3) array, mm
    stiffness : (6, 6) or (m, 6, 6) array, MPa
        In the global frame.
    free : (m, 4, 6) array, optional
        Stress-free strain at the corners of each cell, Voigt, linear between them.
    region : (m,) int array, optional
        Number from 0 of the material of each cell. Between materials the stress may jump, so that
        each is recovered by itself.
    """
    stiffness = np.asarray(stiffness).reshape(-1, 6, 6)
    ease = np.zeros((1, 4, 6)) if free is None else free
    samples = SAMPLES[mesh.order]
    stress = _stress_at(mesh, displacement, stiffness, ease, samples)
    patches = stress_patches(mesh, stress, np.trace(stiffness, axis1=1, axis2=2), region)
    compliance = np.asarray(np.linalg.inv(stiffness), dtype=np.float64)
    if mesh.order == 1:
        difference = patches.coefficients[patches.of_corner, 0] - stress
        error = mesh.volumes * _linear_energy(difference, compliance)
        energy = mesh.volumes * _sum_of_squares(stress, compliance)
    else:
        # Linear in a cell, so the values at its corners determine it.
        corner = _stress_at(mesh, displacement, stiffness, ease, np.eye(4))
        error = np.empty(len(mesh.cells))
        polynomials = (patches.of_corner, patches.centre, patches.size, patches.coefficients)
        cells = (mesh.points, seen_only(mesh.corners), mesh.volumes, np.asarray(TetMesh.edges))
        _compare_quadratic(*cells, polynomials, corner, compliance, error)
        energy = mesh.volumes * _linear_energy(corner, compliance)
    held = (ease @ stiffness * ease).sum(axis=2).mean(axis=1)
    if error.sum() + energy.sum() <= _FREELY * (mesh.volumes * held).sum():
        error, energy = np.zeros_like(error), np.zeros_like(energy)
    return ErrorEstimate(error, energy)


def _stress_at(
    mesh: TetMesh, displacement: FloatArray, stiffness: FloatArray, free: FloatArray, at: FloatArray
) -> FloatArray:
    """Stress (m, q, 6), Voigt, of each cell at barycentric coordinates (q, 4)."""
    gradients, nodal = cell_gradients(mesh), np.swapaxes(displacement[mesh.cells], 1, 2)
    law = stiffness if len(stiffness) > 1 else stiffness[0]
    stress = np.empty((len(mesh.cells), len(at), 6))
    for q, place in enumerate(at):
        slopes = gradients if mesh.order == 1 else slopes_at(mesh, gradients, place)
        stress[:, q] = times(law, voigt_strain(nodal @ slopes) - place @ free)
    return stress


def _linear_energy(values: FloatArray, compliance: FloatArray) -> FloatArray:
    """Mean (m,) of ``v . S v`` over cells of fields linear in them, by corners (m, 4, 6)."""
    total = values.sum(axis=1, keepdims=True)
    return (_sum_of_squares(values, compliance) + _sum_of_squares(total, compliance)) / 20.0


def _sum_of_squares(values: FloatArray, compliance: FloatArray) -> FloatArray:
    """Sum (m,) of ``v . S v`` of the values (m, q, 6) of each cell."""
    if len(compliance) > 1:
        image = values @ compliance
    else:
        image = (values.reshape(-1, 6) @ compliance[0]).reshape(values.shape)
    return np.asarray(np.einsum("mqi,mqi->m", image, values))


@compiled
def _compare_quadratic(
    points: FloatArray,
    corners: IntArray,
    volumes: FloatArray,
    edges: IntArray,
    polynomials: tuple[IntArray, FloatArray, FloatArray, FloatArray],
    stress: FloatArray,
    compliance: FloatArray,
    error: FloatArray,
) -> None:
    """Energies of the difference from the recovered stress, which is quadratic: by its ten nodes.

    The integrals of the products of the shape functions are those of the quadratic tetrahedron,
    over the volume: 6, 1, -4, -6, 32, 16 and 8 over 420.
    """
    of_corner, centre, size, coefficients = polynomials
    difference, image = np.empty((10, 6)), np.empty((10, 6))
    p = np.empty(10)
    for cell in range(len(corners)):
        s = compliance[cell if len(compliance) > 1 else 0]
        # At a corner the polynomial round it is its constant term: its origin is there.
        for a in range(4):
            for i in range(6):
                difference[a, i] = coefficients[of_corner[cell, a], 0, i] - stress[cell, a, i]
        # In the middle of a side: half of the polynomials of both ends, less the linear stress
        # there.
        for k in range(6):
            ends = edges[k]
            for i in range(6):
                middle = stress[cell, ends[0], i] + stress[cell, ends[1], i]
                difference[4 + k, i] = -0.5 * middle
            for e in range(2):
                group = of_corner[cell, ends[e]]
                x = 0.5 * (points[corners[cell, ends[0]]] + points[corners[cell, ends[1]]])
                x = (x - centre[group]) / size[group]
                fitted(coefficients[group], x[0], x[1], x[2], p, difference[4 + k])
        for a in range(10):
            for i in range(6):
                total = 0.0
                for j in range(6):
                    total += s[i, j] * difference[a, j]
                image[a, i] = total
        total = 0.0
        # Quadratic form of the difference, with the exact integrals of pairs of shape functions.
        for a in range(10):
            for b in range(10):
                if a < 4 and b < 4:
                    w = 6.0 if a == b else 1.0
                elif a >= 4 and b >= 4:
                    i, j = edges[a - 4, 0], edges[a - 4, 1]
                    k, h = edges[b - 4, 0], edges[b - 4, 1]
                    shared = i in (k, h) or j in (k, h)
                    w = 32.0 if a == b else 16.0 if shared else 8.0
                else:
                    corner, edge = min(a, b), max(a, b) - 4
                    touches = edges[edge, 0] == corner or edges[edge, 1] == corner
                    w = -4.0 if touches else -6.0
                for i in range(6):
                    total += w / 420.0 * difference[a, i] * image[b, i]
        error[cell] = volumes[cell] * total


# Stress fitted by polynomials on patches of cells: more accurate than the stress of the cells.
#
# Superconvergent patch recovery (Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng 33, 1992,
# 1331-1364): round each corner node a polynomial of the order of the displacement, linear or
# quadratic, is fitted to the stress at the points where that of the cells is most accurate. Cells
# of other materials, or of very different stiffness, are fitted separately, since the stress jumps
# between them.


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
    """Polynomials round the corner nodes, one for each kind of cell at a node.

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


def stress_patches(
    mesh: TetMesh, stress: FloatArray, stiffness: FloatArray, region: IntArray | None = None
) -> Patches:
    """Fit polynomials to the stress of the cells.

    Parameters
    ----------
    stress : (m, q, 6) array, MPa
        Voigt, at the `SAMPLES` of the cells' order.
    stiffness : (m,) or (1,) array
        How stiff each cell is.
    region : (m,) int array, optional
        Number from 0 of the material of each cell.
    """
    kind = np.floor(np.log(stiffness) / np.log(_ALIKE)).astype(np.int64)
    kind -= kind.min()
    if region is not None:
        kind = kind + (int(kind.max()) + 1) * region
    kinds = int(kind.max()) + 1
    if (kind == kind[0]).all():
        # A polynomial for each node; nodes without cells stay empty.
        nodes, of_corner = np.arange(len(mesh.points)), mesh.corners
    else:
        pairs, of_corner = np.unique(mesh.corners * kinds + kind[:, None], return_inverse=True)
        nodes = pairs // kinds
    of_corner = seen_only(of_corner.reshape(-1, 4))
    entries, start = grouped(of_corner, len(nodes))
    at = SAMPLES[mesh.order]
    terms = 4 if mesh.order == 1 else 10
    size = np.zeros(len(nodes))
    coefficients = np.zeros((len(nodes), terms, 6))
    groups = (of_corner, nodes, start.astype(np.int64), entries.astype(np.int64) // 4)
    settings = (_LEAST[mesh.order], _RIDGE)
    result = (size, coefficients)
    _fit(mesh.points, seen_only(mesh.corners), groups, at, stress, *settings, result)
    return Patches(of_corner, mesh.points[nodes], size, coefficients)


@compiled
def _terms(x: float, y: float, z: float, p: FloatArray) -> None:
    """Store the terms of a polynomial at a place."""
    p[0], p[1], p[2], p[3] = 1.0, x, y, z
    if len(p) == 10:
        p[4], p[5], p[6], p[7], p[8], p[9] = x * x, y * y, z * z, y * z, x * z, x * y


@compiled
def _gather_patch(
    group: int,
    corners: IntArray,
    of_corner: IntArray,
    start: IntArray,
    cells: IntArray,
    least: int,
    stamp: IntArray,
    gathered: IntArray,
) -> int:
    """Store the cells of a patch and return their number: those at the node, more if too few."""
    count = 0
    for k in range(start[group], start[group + 1]):
        gathered[count] = cells[k]
        stamp[cells[k]] = group
        count += 1
    if count >= least:
        return count
    # Too few: the cells round all corners of those at the node.
    begin = count
    for k in range(begin):
        for a in range(4):
            other = of_corner[gathered[k], a]
            for j in range(start[other], start[other + 1]):
                cell = cells[j]
                if stamp[cell] != group and count < len(gathered):
                    stamp[cell] = group
                    gathered[count] = cell
                    count += 1
    return count


@compiled
def _cholesky(matrix: FloatArray, right: FloatArray) -> None:
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


@compiled
def _fit(
    points: FloatArray,
    corners: IntArray,
    groups: tuple[IntArray, IntArray, IntArray, IntArray],
    at: FloatArray,
    stress: FloatArray,
    least: int,
    ridge: FloatArray,
    result: tuple[FloatArray, FloatArray],
) -> None:
    (of_corner, nodes, start, cells), (size, coefficients) = groups, result
    terms = coefficients.shape[1]
    p = np.empty(terms)
    gram, right = np.empty((terms, terms)), np.empty((terms, 6))
    stamp = np.full(len(corners), -1, np.int64)
    most = 0
    for group in range(len(nodes)):
        most = max(most, start[group + 1] - start[group])
    gathered = np.empty(most + 4096, np.int64)
    place = np.empty((len(gathered) * len(at), 3))
    for group in range(len(nodes)):
        if start[group] == start[group + 1]:
            size[group] = 1.0
            continue
        count = _gather_patch(group, corners, of_corner, start, cells, least, stamp, gathered)
        # Sampling points of the patch from its node, in units of the farthest one: well
        # conditioned.
        extent, s = 0.0, 0
        for k in range(count):
            for q in range(len(at)):
                for d in range(3):
                    x = -points[nodes[group], d]
                    for a in range(4):
                        x += at[q, a] * points[corners[gathered[k], a], d]
                    place[s, d] = x
                    extent = max(extent, abs(x))
                s += 1
        for i in range(terms):
            for j in range(i + 1):
                gram[i, j] = 0.0
            for j in range(6):
                right[i, j] = 0.0
        # Normal equations of the least squares fit of all six components.
        for s in range(count * len(at)):
            _terms(place[s, 0] / extent, place[s, 1] / extent, place[s, 2] / extent, p)
            cell, q = gathered[s // len(at)], s % len(at)
            for i in range(terms):
                for j in range(i + 1):
                    gram[i, j] += p[i] * p[j]
                for j in range(6):
                    right[i, j] += p[i] * stress[cell, q, j]
        # Ridge on all but the mean: patches that do not determine a term leave it out.
        for i in range(1, terms):
            gram[i, i] += ridge[0 if i < 4 else 1] * gram[0, 0]
        _cholesky(gram, right)
        size[group] = extent
        for i in range(terms):
            for j in range(6):
                coefficients[group, i, j] = right[i, j]


@compiled
def fitted(
    coefficients: FloatArray, x: float, y: float, z: float, p: FloatArray, out: FloatArray
) -> None:
    """Add the stress (6,) of a polynomial at a place to `out`, half of it."""
    _terms(x, y, z, p)
    for i in range(len(p)):
        for j in range(6):
            out[j] += 0.5 * p[i] * coefficients[i, j]
