"""Sensitivity of the worth of strands to their position: the direction in which to slide them.

Sliding a piece of fibre in a fixed strain field makes the part stiffer, to first order, by the
increase of the energy of that piece. Where the load at first failure counts too, the worth for both
replaces the energy (`StrainWorth`). The strain of linear cells jumps between cells and has no
gradient inside them. It is therefore averaged at the corners of the cells and linear in between.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray, freeze, in_brief
from ccfem.base.tensor import in_plane, strain_from_voigt
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.assembly import cell_gradients
from ccfem.fem.elasticity.recovery import strain_at_nodes
from ccfem.geometry.locate import locate
from ccfem.geometry.polylines import starts_segment
from ccfem.judging.virtual_testing.near_failure import POWER
from ccfem.strategies.fibre_aware.strain_worth import StrainWorth

_REACH = 1.0
"""Distance outside the mesh, mm, up to which the strain of the nearest cell is continued."""


@dataclass(frozen=True)
class PlaneStrain:
    """Strain in the planes of the layers, continuous over the mesh.

    Attributes
    ----------
    mesh : TetMesh
    frame : (3, 3) array
        Axes of the layers: two in their planes, and the normal.
    values : (cases, n, 3) array
        At the nodes, e11, e22 and e12 in the plane, times the square root of the worth of a squared
        strain. Zero at nodes that are no corner of a cell.
    pairs : (k, 2, n, 3) array
        Strains of the displacement and of the adjoint displacement, for cases with strength.
    terms : (k, 3) array
        `StrainWorth.mixed`, `peak` and `most` of these cases.
    slopes : (m, 4, 2) array, 1/mm
        Gradients of the barycentric coordinates of each cell in the plane.
    """

    mesh: TetMesh
    frame: FloatArray
    values: FloatArray
    pairs: FloatArray
    terms: FloatArray
    slopes: FloatArray

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, frame=float, values=float, pairs=float, terms=float, slopes=float)


def plane_strain(mesh: TetMesh, worths: Sequence[StrainWorth], frame: FloatArray) -> PlaneStrain:
    """Average the strain of displacements at the corners of the cells, weighted by volume.

    Parameters
    ----------
    mesh : TetMesh
    worths : sequence of StrainWorth
        One for each load case.
    frame : (3, 3) array
        Axes of the layers.
    """
    corners, n = mesh.corners, len(mesh.points)
    weight = np.repeat(mesh.volumes, 4)
    total = np.bincount(corners.ravel(), weight, n)

    def at_nodes(displacement: FloatArray, factor: float = 1.0) -> FloatArray:
        tensor = strain_from_voigt(strain_at_nodes(mesh, displacement)[:, :4])
        strain = factor * in_plane(tensor, frame).reshape(-1, 3)
        sums = [np.bincount(corners.ravel(), weight * part, n) for part in strain.T]
        return np.stack(sums, axis=1) / np.where(total > 0.0, total, 1.0)[:, None]

    values = [at_nodes(one.displacement, float(np.sqrt(one.squared))) for one in worths]
    pairs, terms = np.zeros((0, 2, n, 3)), np.zeros((0, 3))
    for one in worths:
        if one.adjoint is not None:
            pair = np.stack([at_nodes(one.displacement), at_nodes(one.adjoint)])
            pairs = np.concatenate([pairs, pair[None]])
            terms = np.concatenate([terms, [[one.mixed, one.peak, one.most]]])
    slopes = cell_gradients(mesh) @ frame[:2].T
    return PlaneStrain(mesh, frame, np.array(values), pairs, terms, slopes)


def fibre_energy(
    points: FloatArray, heights: FloatArray, offsets: IntArray, strain: PlaneStrain
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Energy of the stretched segments of polylines, and its gradient by their points.

    A segment d has the energy ``max(d . eps d, 0)^2 / |d|^3`` with the strain eps at its middle:
    its length times the square of the strain along it. The energies of all load cases add up. Where
    strength counts, the energy is the length times `StrainWorth.value`.

    Parameters
    ----------
    points : (P, 2) array, mm
        In the frame of the strain.
    heights : (P,) array, mm
        Along its normal.
    offsets : (K + 1,) int array
        As in CSR.
    strain : PlaneStrain

    Returns
    -------
    energy : (s,) array, mm
        Of each segment.
    length : (s,) array, mm
    gradient : (P, 2) array
        Of the sum of the energies.
    """
    first = np.flatnonzero(starts_segment(offsets))
    middle = 0.5 * (points[first] + points[first + 1])
    height = 0.5 * (heights[first] + heights[first + 1])
    places = middle @ strain.frame[:2] + height[:, None] * strain.frame[2]
    cell, weights = locate(strain.mesh.points, strain.mesh.corners, places, _REACH)
    energy, length = np.zeros(len(first)), np.zeros(len(first))
    gradient = np.zeros(points.shape)
    at = (points, first, cell, weights, strain.mesh.corners, strain.slopes)
    _energy(*at, strain.values, energy, length, gradient)
    if len(strain.pairs):
        _strength(*at, strain.pairs, strain.terms, POWER, energy, gradient)
    return energy, length, gradient


@njit(cache=True)
def _energy(points, first, cell, weights, corners, slopes, values, energy, length, gradient):  # type: ignore[no-untyped-def]  # pragma: no cover
    for s in range(len(first)):
        i = first[s]
        dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        size = np.sqrt(dx * dx + dy * dy)
        length[s] = size
        c = cell[s]
        if c < 0 or size == 0.0:
            continue
        for k in range(len(values)):
            e1, e2, e12 = 0.0, 0.0, 0.0
            qx, qy = 0.0, 0.0  # slope of d . eps d with the place
            for a in range(4):
                n = corners[c, a]
                v1, v2, v12 = values[k, n, 0], values[k, n, 1], values[k, n, 2]
                e1 += weights[s, a] * v1
                e2 += weights[s, a] * v2
                e12 += weights[s, a] * v12
                along = v1 * dx * dx + v2 * dy * dy + 2.0 * v12 * dx * dy
                qx += along * slopes[c, a, 0]
                qy += along * slopes[c, a, 1]
            ex, ey = e1 * dx + e12 * dy, e12 * dx + e2 * dy
            q = dx * ex + dy * ey
            if q <= 0.0:
                continue
            cube = size * size * size
            energy[s] += q * q / cube
            turn, fall = 4.0 * q / cube, 3.0 * q * q / (cube * size * size)
            slide = q / cube  # half of 2 q / |d|^3: the middle moves by half of each end
            gradient[i, 0] += slide * qx - turn * ex + fall * dx
            gradient[i, 1] += slide * qy - turn * ey + fall * dy
            gradient[i + 1, 0] += slide * qx + turn * ex - fall * dx
            gradient[i + 1, 1] += slide * qy + turn * ey - fall * dy


@njit(cache=True)
def _strength(points, first, cell, weights, corners, slopes, pairs, terms, power, energy, gradient):  # type: ignore[no-untyped-def]  # pragma: no cover
    for s in range(len(first)):
        i, c = first[s], cell[s]
        dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        size = np.sqrt(dx * dx + dy * dy)
        if c < 0 or size == 0.0:
            continue
        square = size * size
        for k in range(len(pairs)):
            # Strain along the segment, and its derivatives by place and by segment, for both.
            strain, px, py, tx, ty = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
            for j in range(2):
                e1, e2, e12 = 0.0, 0.0, 0.0
                for a in range(4):
                    n = corners[c, a]
                    v1, v2, v12 = pairs[k, j, n, 0], pairs[k, j, n, 1], pairs[k, j, n, 2]
                    e1 += weights[s, a] * v1
                    e2 += weights[s, a] * v2
                    e12 += weights[s, a] * v12
                    along = (v1 * dx * dx + v2 * dy * dy + 2.0 * v12 * dx * dy) / square
                    px[j] += along * slopes[c, a, 0]
                    py[j] += along * slopes[c, a, 1]
                ex, ey = e1 * dx + e12 * dy, e12 * dx + e2 * dy
                strain[j] = (dx * ex + dy * ey) / square
                tx[j] = 2.0 * (ex - strain[j] * dx) / square
                ty[j] = 2.0 * (ey - strain[j] * dy) / square
            if strain[0] <= 0.0:
                continue
            mixed, peak, most = terms[k, 0], terms[k, 1], terms[k, 2]
            near = peak * (strain[0] / most) ** power
            worth = mixed * strain[0] * strain[1] - near
            by, by_adjoint = mixed * strain[1] - power * near / strain[0], mixed * strain[0]
            energy[s] += size * worth
            slide_x = 0.5 * size * (by * px[0] + by_adjoint * px[1])
            slide_y = 0.5 * size * (by * py[0] + by_adjoint * py[1])
            turn_x = size * (by * tx[0] + by_adjoint * tx[1]) + worth * dx / size
            turn_y = size * (by * ty[0] + by_adjoint * ty[1]) + worth * dy / size
            gradient[i, 0] += slide_x - turn_x
            gradient[i, 1] += slide_y - turn_y
            gradient[i + 1, 0] += slide_x + turn_x
            gradient[i + 1, 1] += slide_y + turn_y
