"""Nodal forces of loads, consistent with linear and quadratic facets."""

from collections.abc import Callable

import numpy as np

from ccfem.arrays import FloatArray, IntArray
from ccfem.elasticity.problem import (
    Bearing,
    Force,
    Load,
    PointForce,
    Pressure,
    Problem,
    Traction,
)
from ccfem.errors import InputError
from ccfem.mesh import TetMesh

__all__ = ["facet_nodes", "load_case", "nodal_forces"]


def facet_nodes(mesh: TetMesh, facets: IntArray) -> IntArray:
    """Nodes of facets: their corners, and on a quadratic mesh the middles of their sides.

    Parameters
    ----------
    mesh : TetMesh
    facets : (k, 3) int array

    Returns
    -------
    (k, 3) or (k, 6) int array
        Middles in the order of the sides 01, 12, 20.
    """
    if mesh.order == 1 or not len(facets):
        return facets
    n = len(mesh.points)
    on_facet = np.zeros(n, dtype=bool)
    on_facet[facets] = True
    ends = mesh.cells[:, mesh.edges].reshape(-1, 2)
    chosen = np.flatnonzero(on_facet[ends].all(axis=1))
    ends = np.sort(ends[chosen], axis=1)
    keys, first = np.unique(ends[:, 0] * n + ends[:, 1], return_index=True)
    middle = mesh.cells[:, 4:].reshape(-1)[chosen[first]]
    sides = np.sort(facets[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    wanted = sides[..., 0] * n + sides[..., 1]
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    if (keys[at] != wanted).any():
        raise InputError("a patch has facets that no cell of the mesh has: name boundary facets")
    return np.hstack([facets, middle[at]])


def _facets(mesh: TetMesh, name: str) -> IntArray:
    """Facets of a patch that must not be empty."""
    facets = mesh.patch(name)
    if not len(facets):
        raise InputError(f"patch '{name}' is empty: no boundary facet meets its rule")
    return facets


def _outward(mesh: TetMesh, name: str) -> tuple[IntArray, FloatArray, FloatArray]:
    """Facets of a patch with their areas and outward unit normals."""
    facets, n = _facets(mesh, name), len(mesh.points)

    def key(corners: IntArray) -> IntArray:
        a, b, c = np.sort(corners, axis=1).T
        return (a * n + b) * n + c

    known, wanted = key(mesh.boundary), key(facets)
    order = np.argsort(known)
    at = order[np.minimum(np.searchsorted(known, wanted, sorter=order), len(order) - 1)]
    if (known[at] != wanted).any():
        raise InputError(
            f"patch '{name}' has facets inside the part: pressure and bearing need boundary facets"
        )
    facets = mesh.boundary[at]
    return facets, *mesh.facet_areas(facets)


def _spread(mesh: TetMesh, facets: IntArray, forces: FloatArray) -> FloatArray:
    """Nodal forces (n, 3) of forces (k, 3) spread evenly over facets.

    A linear facet gives a third to each corner; a quadratic one a third to each middle.
    """
    nodes = facet_nodes(mesh, facets)[:, -3:]
    result = np.empty((len(mesh.points), 3))
    for k in range(3):
        weights = np.repeat(forces[:, k] / 3.0, 3)
        result[:, k] = np.bincount(nodes.reshape(-1), weights, len(mesh.points))
    return result


def _force(mesh: TetMesh, load: Force) -> FloatArray:
    facets = _facets(mesh, load.patch)
    area, _ = mesh.facet_areas(facets)
    return _spread(mesh, facets, area[:, None] / area.sum() * np.array(load.vector))


def _traction(mesh: TetMesh, load: Traction) -> FloatArray:
    facets = _facets(mesh, load.patch)
    area, _ = mesh.facet_areas(facets)
    return _spread(mesh, facets, area[:, None] * np.array(load.vector))


def _pressure(mesh: TetMesh, load: Pressure) -> FloatArray:
    facets, area, normal = _outward(mesh, load.patch)
    return _spread(mesh, facets, -load.magnitude * area[:, None] * normal)


def _bearing(mesh: TetMesh, load: Bearing) -> FloatArray:
    """Pressure ``-normal . a`` where that is positive, the vector a fitted to the total force.

    On an evenly meshed half cylinder a is parallel to the force, and the pressure its cosine.
    """
    facets, area, normal = _outward(mesh, load.patch)
    force = np.array(load.vector, dtype=np.float64)
    touched = normal @ force < 0.0
    for _ in range(50):
        weighted = (area * touched)[:, None] * normal
        a = np.asarray(np.linalg.lstsq(weighted.T @ normal, force, rcond=1e-9)[0])
        now = -(normal @ a) > 1e-9 * np.linalg.norm(a)
        if np.array_equal(now, touched):
            break
        touched = now
    forces = weighted * (normal @ a)[:, None]
    if not np.linalg.norm(forces.sum(axis=0) - force) <= 1e-6 * np.linalg.norm(force):
        raise InputError(
            f"bearing load {load.vector} cannot press on patch '{load.patch}': give a force "
            "across the axis of the hole, toward the wall that the patch covers"
        )
    return _spread(mesh, facets, forces)


def _point(mesh: TetMesh, load: PointForce) -> FloatArray:
    used = np.unique(mesh.cells)
    distance = np.linalg.norm(mesh.points[used] - np.array(load.point), axis=1)
    result = np.zeros((len(mesh.points), 3))
    result[used[distance.argmin()]] = load.vector
    return result


_KINDS: dict[type, Callable[..., FloatArray]] = {
    Force: _force,
    Traction: _traction,
    Pressure: _pressure,
    Bearing: _bearing,
    PointForce: _point,
}


def nodal_forces(mesh: TetMesh, load: Load) -> FloatArray:
    """Return the forces at the nodes that do the same work as a load.

    Parameters
    ----------
    mesh : TetMesh
    load : Force, Traction, Pressure, Bearing or PointForce

    Returns
    -------
    (n, 3) array, N

    Raises
    ------
    InputError
        For a load that is zero or not finite, on an empty or unknown patch, or a bearing load
        that no pressure on its patch can carry.
    """
    for value in vars(load).values():
        if not isinstance(value, str) and not np.isfinite(value).all():
            raise InputError(f"a load must be finite; got {load}: correct its numbers")
    size = load.magnitude if isinstance(load, Pressure) else load.vector
    if not np.any(size):
        raise InputError(f"a load must not be zero; got {load}: give it a size or leave it out")
    return _KINDS[type(load)](mesh, load)


def load_case(problem: Problem, name: str) -> FloatArray:
    """Nodal forces (n, 3), N, of one load case of a problem.

    Raises
    ------
    InputError
        For a bad load, or when the loads cancel at every node and no support moves.
    """
    mesh = problem.mesh
    total = np.zeros((len(mesh.points), 3))
    largest = 0.0
    for load in problem.loads[name]:
        forces = nodal_forces(mesh, load)
        largest = max(largest, float(np.abs(forces).max()))
        total += forces
    moved = any(np.any(support.value) for support in problem.supports)
    if np.abs(total).max() <= 1e-12 * largest and not moved:
        raise InputError(
            f"load case '{name}' is zero and no support moves: nothing to solve for; give a load"
        )
    return total
