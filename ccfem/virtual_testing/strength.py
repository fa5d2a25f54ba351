"""The load at which the part first fails: matrix or fibre, whichever comes first.

Both limits scale with the load, for the solution with fibres that carry tension only does so too.
Delamination between layers and debonding of the strands are not predicted; nor is what happens
after the first failure.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from ccfem.arrays import FloatArray, IntArray
from ccfem.elasticity.load_kinds import patches_of, points_of
from ccfem.elasticity.nodes import edge_nodes
from ccfem.elasticity.stress_field import StressField
from ccfem.elasticity.support_kinds import AnySupport, EdgeSupport, Support
from ccfem.errors import InputError
from ccfem.mesh.facets import are_among
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.tensor import von_mises
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.virtual_test import VirtualTest

__all__ = ["FIBRE_SHARE", "FirstFailure", "fibre_peak", "first_failure", "matrix_peak"]

_BALL = 2.0
"""Radius, mm, of the ball over which the von Mises stress is averaged."""

_ZONE = 3.0
"""Distance, mm, from patches of loads and supports within which stress is not judged."""

FIBRE_SHARE = 0.99
"""Share of the fibre length whose axial force stays below the fibre's index."""

_SPACING = 0.5
"""Largest distance, mm, between points that stand for a patch."""


@dataclass(frozen=True)
class FirstFailure:
    """When, how and where a part first fails.

    Attributes
    ----------
    load : float, N
        Size of the load at first failure.
    what : str
        "matrix" or "fibre".
    where : (3,) array, mm
        Middle of the cell, or of the piece of fibre, that decides.
    matrix_load, fibre_load : float, N
        Loads at which matrix and fibre would fail; infinite where no fibre is stretched.
    matrix_index : float, MPa
        Peak of the averaged von Mises stress under the load of the test.
    fibre_index : float, N
        Axial force that 99 % of the fibre length stays below under the load of the test.
    """

    load: float
    what: str
    where: FloatArray
    matrix_load: float
    fibre_load: float
    matrix_index: float
    fibre_index: float


def first_failure(
    test: VirtualTest, strand: Strand | None = None, matrix_strength: float | None = None
) -> FirstFailure:
    """Load at which the matrix or the fibre first fails.

    Parameters
    ----------
    test : VirtualTest
    strand : Strand, optional
        Its strength is the fibre's; default 86 N.
    matrix_strength : float, MPa, optional
        Von Mises stress at failure, calibrated (`ccfem.virtual_testing.calibration`); default
        the tensile strength of the material of the part.

    Raises
    ------
    InputError
        When the strength of matrix or fibre is missing.
    """
    strength = (Strand() if strand is None else strand).strength
    if strength is None:
        raise InputError(
            "first-failure load needs the strength of a strand, N; the fibre material has none: "
            "give tensile_strength (MPa), or Strand(strength=...)"
        )
    if matrix_strength is None:
        matrix_strength = test.solution.problem.material.tensile_strength
    if matrix_strength is None:
        raise InputError(
            "first-failure load needs the strength of the matrix, MPa; material "
            f"'{test.solution.problem.material.name}' has none: give tensile_strength, or "
            "calibrate it on a test of the unreinforced part"
        )
    matrix_index, matrix_at = matrix_peak(test.solution)
    fibre_index, fibre_at = fibre_peak(test)
    matrix_load = test.force * matrix_strength / matrix_index
    fibre_load = test.force * strength / fibre_index if fibre_index > 0.0 else np.inf
    broken = fibre_load < matrix_load
    return FirstFailure(
        load=min(matrix_load, fibre_load),
        what="fibre" if broken else "matrix",
        where=fibre_at if broken else matrix_at,
        matrix_load=matrix_load,
        fibre_load=fibre_load,
        matrix_index=matrix_index,
        fibre_index=fibre_index,
    )


def fibre_peak(test: VirtualTest, share: float = FIBRE_SHARE) -> tuple[float, FloatArray]:
    """Axial force, N, that `share` of the fibre length stays below, and a place (3,) of it."""
    order = np.argsort(test.axial_force, kind="stable")
    reached = np.cumsum((test.strands.length * test.strands.share)[order])
    at = order[min(np.searchsorted(reached, share * reached[-1]), len(order) - 1)]
    return float(test.axial_force[at]), test.strands.middle[at]


def matrix_peak(stress: StressField) -> tuple[float, FloatArray]:
    """Largest averaged von Mises stress of the matrix, MPa, and its place (3,).

    The von Mises stress of the cells is averaged by volume over a ball of 2 mm radius. Cells whose
    centroid is closer than 3 mm to a patch with a load or a support are left out, though they count
    in the averages of others. A whole flat face that slides in its plane, as a plane of symmetry
    does, is no such patch: no stress peaks there.

    Raises
    ------
    InputError
        When all cells are left out.
    """
    mesh = stress.mesh
    centroid = mesh.points[mesh.corners].mean(axis=1)
    # Beyond the bound the distance is infinite, and the search short.
    tree, bound = cKDTree(_held_and_loaded(stress)), np.nextafter(_ZONE, np.inf)
    distance, _ = tree.query(centroid, distance_upper_bound=bound)
    judged = np.flatnonzero(np.isinf(distance))
    if not len(judged):
        raise InputError(
            f"no cell lies farther than {_ZONE:g} mm from the patches of loads and supports, so "
            "no matrix stress can be judged: the part is too small for this index"
        )
    average = _averages(centroid, von_mises(stress.stress), mesh.volumes, judged, _BALL)
    peak = average.argmax()
    return float(average[peak]), centroid[judged[peak]]


def _held_and_loaded(stress: StressField) -> FloatArray:
    """Points (k, 3) that cover the patches of the supports and of the load case."""
    problem = stress.problem
    mesh = problem.mesh
    edges = [each.patches for each in problem.supports if isinstance(each, EdgeSupport)]
    kinds: list[Any] = [*problem.loads_of(stress.case)]
    kinds += [
        each
        for each in problem.supports
        if not isinstance(each, EdgeSupport) and not _slides(mesh, each)
    ]
    points = [np.zeros((0, 3))]
    points += [np.array([point]) for kind in kinds for point in points_of(kind)]
    points += [mesh.points[edge_nodes(mesh, names)] for names in edges]
    names = {name for kind in kinds for name in patches_of(kind)}
    points += [_cover(mesh, name) for name in sorted(names)]
    return np.concatenate(points)


def _slides(mesh: TetMesh, support: AnySupport) -> bool:
    """Whether a support holds a whole flat face across its plane and nothing else."""
    if not isinstance(support, Support) or len(support.components) > 1:
        return False
    place = mesh.points[:, "xyz".index(support.components)]
    patch = mesh.patch(support.patch)
    level = place[patch[0, 0]]
    flat = (np.abs(place[mesh.boundary] - level) <= 1e-9 * np.ptp(mesh.bounds)).all(axis=1)
    return bool(are_among(patch, mesh.boundary[flat]).all()) and (
        len(patch) == np.count_nonzero(flat)
    )


def _cover(mesh: TetMesh, name: str) -> FloatArray:
    """Points at most half a millimetre apart on the facets of a patch."""
    corners = mesh.points[mesh.patch(name)]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.maximum(np.ceil(edges / _SPACING), 1.0).astype(np.int64)
    points = [corners.reshape(-1, 3)]
    for n in np.unique(parts):
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        inside = i + j <= n
        weights = np.stack([i[inside], j[inside], n - i[inside] - j[inside]], axis=1) / n
        points.append(np.einsum("wc,kcx->kwx", weights, corners[parts == n]).reshape(-1, 3))
    return np.concatenate(points)


def _averages(
    points: FloatArray, values: FloatArray, weights: FloatArray, judged: IntArray, radius: float
) -> FloatArray:
    """Weighted averages over the points within `radius` of each judged point."""
    first = points.min(axis=0)
    box = np.floor((points - first) / radius).astype(np.int64) + 1
    shape = box.max(axis=0) + 2
    number = (box[:, 0] * shape[1] + box[:, 1]) * shape[2] + box[:, 2]
    order = np.argsort(number, kind="stable")
    offsets = np.searchsorted(number[order], np.arange(int(np.prod(shape)) + 1))
    return np.asarray(
        _ball(points[order], values[order], weights[order], points[judged], number[judged], offsets,
              shape, radius)
    )  # fmt: skip


@njit(cache=True)
def _ball(points, values, weights, centres, box, offsets, shape, radius):  # type: ignore[no-untyped-def]  # pragma: no cover
    result = np.empty(len(centres))
    for k in range(len(centres)):
        total, weight = 0.0, 0.0
        for i in range(-1, 2):
            for j in range(-1, 2):
                row = box[k] + (i * shape[1] + j) * shape[2]
                for p in range(offsets[row - 1], offsets[row + 2]):
                    x = points[p, 0] - centres[k, 0]
                    y = points[p, 1] - centres[k, 1]
                    z = points[p, 2] - centres[k, 2]
                    if x * x + y * y + z * z <= radius * radius:
                        total += weights[p] * values[p]
                        weight += weights[p]
        result[k] = total / weight
    return result
