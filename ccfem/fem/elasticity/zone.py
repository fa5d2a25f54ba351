"""Where the stress of a part is judged: away from where it is held and loaded, averaged."""

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.tensor import von_mises
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.ball import BALL, ball_averages
from ccfem.fem.elasticity.load_kinds import patches_of, points_of
from ccfem.fem.elasticity.nodes import edge_nodes
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.support_kinds import AnySupport, EdgeSupport, Support
from ccfem.geometry.facets import are_among

ZONE = 3.0
"""Distance, mm, from patches of loads and supports within which stress is not judged."""

_SPACING = 0.5
"""Largest distance, mm, between points that stand for a patch."""


def averaged_mises(
    problem: Problem, case: str, stress: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Von Mises stress of the cells averaged by volume over a ball of 2 mm radius, MPa.

    Parameters
    ----------
    case : str
        The load case.
    stress : (m, 3, 3) array, MPa
        Of the cells.

    Returns
    -------
    judged : (k,) int array
        Cells at least 3 mm from the patches of loads and supports; the others count in averages.
    average : (k,) array, MPa
    centroid : (m, 3) array, mm
        Of all cells.
    """
    mesh = problem.mesh
    centroid = mesh.points[mesh.corners].mean(axis=1)
    judged = np.flatnonzero(np.isinf(distance_from_patches(problem, case, centroid, ZONE)))
    mises = von_mises(stress)[:, None]
    return judged, ball_averages(centroid, mises, mesh.volumes, judged, BALL)[:, 0], centroid


def distance_from_patches(
    problem: Problem, case: str, centroid: FloatArray, most: float
) -> FloatArray:
    """Distance, mm, of points (k, 3) from the patches of loads and supports of a load case.

    Infinite beyond `most`, which keeps the search short. A whole flat face that slides in its
    plane, as a plane of symmetry does, is no such patch: no stress peaks there.
    """
    bound = np.nextafter(most, np.inf)
    tree = cKDTree(_held_and_loaded(problem, case))
    return np.asarray(tree.query(centroid, distance_upper_bound=bound)[0])


def _held_and_loaded(problem: Problem, case: str) -> FloatArray:
    """Points (k, 3) that cover the patches of the supports and of the load case."""
    mesh = problem.mesh
    edges = [support.patches for support in problem.supports if isinstance(support, EdgeSupport)]
    kinds: list[Any] = [*problem.loads_of(case)]
    kinds += [
        support
        for support in problem.supports
        if not isinstance(support, EdgeSupport) and not _slides(mesh, support)
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
