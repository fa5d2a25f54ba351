"""Nodes that follow the faces beside them: two meshes that meet without common nodes.

A tied node takes the displacement of the point of the other surface that is nearest to it, by the
shape functions of the facet there, as *TIE does in Abaqus and CalculiX.
"""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import CellMesh
from ccfem.geometry.locate import nearest_on_triangles

REACH = 0.05
"""Distance, over the mean side of the facets, within which nodes are tied by default."""
_STEPS = 6
"""Steps of Newton's method to the foot on a curved facet, after which it moves no more."""


@dataclass(frozen=True)
class TiedNodes:
    """Nodes that follow others.

    Attributes
    ----------
    nodes : (k,) int array
    leaders : (k, q) int array
    weights : (k, q) array
        Shares of the leaders' displacements; each row sums to 1.
    held : (k, 3) bool array
        Components along the axes of the node that supports hold, so that they follow nothing.
    """

    nodes: IntArray
    leaders: IntArray
    weights: FloatArray
    held: BoolArray


def tied_nodes(
    mesh: CellMesh, nodes: IntArray, facets: IntArray, within: float | None, what: str
) -> TiedNodes:
    """Tie nodes (k,) to facets (f, 3); those farther away than a distance, mm, stay free.

    Nodes of the facets are not tied to themselves.
    """
    of_facet = mesh.facet_nodes(facets)
    nodes = np.setdiff1d(nodes, of_facet)
    foot = nearest_on_triangles(mesh.points, facets, mesh.points[nodes])
    leaders = of_facet[foot.triangle]
    weights = _weights(mesh.points[leaders], foot.weights, mesh.points[nodes])
    feet = np.einsum("ka,kai->ki", weights, mesh.points[leaders])
    away = np.linalg.norm(feet - mesh.points[nodes], axis=1)
    corners = mesh.points[facets]
    side = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())
    reach = REACH * side if within is None else within
    near = away <= reach
    if not near.any():
        nearest = f"the nearest is {away.min():.4g} mm away" if len(away) else "they are the same"
        raise InputError(
            f"no node of {what} lies within {reach:.4g} mm of the faces that it is tied to, "
            f"{nearest}: name two patches that touch, or a larger distance"
        )
    held = np.zeros((np.count_nonzero(near), 3), dtype=bool)
    return TiedNodes(nodes[near], leaders[near], weights[near], held)


def _weights(places: FloatArray, start: FloatArray, points: FloatArray) -> FloatArray:
    """Weights (k, q) of the nodes, at places (k, q, 3), of facets at their points nearest to some.

    The search begins at barycentric coordinates (k, 3); a linear facet ends there.
    """
    if places.shape[1] == 3:
        return start
    at = start
    for _ in range(_STEPS):
        gap = points - np.einsum("ka,kai->ki", _shapes(at), places)
        # Slopes along the second and third coordinate, of which the first is the rest.
        slopes = _slopes(at)
        along = np.einsum("kac,kai->kci", slopes[:, :, 1:] - slopes[:, :, :1], places)
        square = np.einsum("kci,kdi->kcd", along, along)
        step = np.linalg.solve(square, np.einsum("kci,ki->kc", along, gap)[:, :, None])[:, :, 0]
        moved = np.maximum(at + np.column_stack([-step.sum(axis=1), step]), 0.0)
        at = moved / moved.sum(axis=1, keepdims=True)
    return _shapes(at)


def _shapes(at: FloatArray) -> FloatArray:
    """Values (k, 6) of the shape functions of a quadratic facet at coordinates (k, 3)."""
    return np.concatenate([at * (2.0 * at - 1.0), 4.0 * at * np.roll(at, -1, axis=1)], axis=1)


def _slopes(at: FloatArray) -> FloatArray:
    """Differentiate these functions by the coordinates (k, 3): (k, 6, 3)."""
    result = np.zeros((len(at), 6, 3))
    first = np.arange(3)
    after = np.roll(first, -1)
    result[:, first, first] = 4.0 * at - 1.0
    result[:, 3 + first, first] = 4.0 * at[:, after]
    result[:, 3 + first, after] = 4.0 * at
    return result
