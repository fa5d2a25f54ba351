"""Curved layers: level surfaces of a field on the mesh, cleaned, with a thickness at each point."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.threads import in_threads
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.assembly import cell_gradients
from ccfem.slicing.layers.cleaning import clean
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.level_cut import border_edges, chain, cut_at_zero

_SNAP = 1e-5
"""Distance from the level, as a share of the step, below which nodes count as lying on it."""
_SAG = 0.05
"""Largest distance, in shortest edges, by which cleaning may straighten the border."""
_FEWEST = 4
"""Triangles of the smallest piece that is kept."""


@dataclass(frozen=True)
class LevelSurfaces:
    """Layers cut from a field.

    Attributes
    ----------
    layers : tuple of Layer
    bubbles : int
        Number of closed pieces, which are left out: they have no border, as with a maximum of the
        field inside the part.
    specks : int
        Number of pieces left out because they are smaller than asked for.
    """

    layers: tuple[Layer, ...]
    bubbles: int
    specks: int


def level_surfaces(
    mesh: TetMesh,
    values: FloatArray,
    levels: FloatArray,
    step: float,
    shortest: float,
    least_area: float,
) -> LevelSurfaces:
    """Cut layers at levels of a field.

    Parameters
    ----------
    mesh : TetMesh
    values : (n,) array
        At the nodes, linear in the cells.
    levels : (k,) array
        In ascending order.
    step : float
        Difference between the levels.
    shortest : float, mm
        Edges of the triangles shorter than this are collapsed.
    least_area : float, mm^2
        Smaller pieces are left out.

    Returns
    -------
    LevelSurfaces
        Layers from the lowest level to the highest, numbered without empty ones. Triangles are
        counter-clockwise seen from the side where the field is higher. A border edge lies on a
        patch if both its ends do.
    """
    gradient = np.einsum("eid,ei->ed", cell_gradients(mesh), values[mesh.corners])
    thickness = thickness_at_nodes(mesh, values, step)
    on_patch = {name: _edge_keys(facets, len(mesh.points)) for name, facets in mesh.patches.items()}

    in_cells = values[mesh.corners]
    low, high = in_cells.min(axis=1) - _SNAP * step, in_cells.max(axis=1) + _SNAP * step

    def cut(level: float) -> tuple[dict[str, Any] | None, int, int]:
        signed = values - level
        signed[np.abs(signed) < _SNAP * step] = 0.0
        among = np.flatnonzero((low <= level) & (high >= level))
        return _surface(mesh, signed, among, gradient, thickness, on_patch, shortest, least_area)

    found = in_threads(cut, levels.tolist(), most=None)
    kept = [surface for surface, _, _ in found if surface is not None]
    layers = tuple(Layer(index=k, **surface) for k, surface in enumerate(kept))
    return LevelSurfaces(layers, sum(b for _, b, _ in found), sum(s for _, _, s in found))


def thickness_at_nodes(mesh: TetMesh, values: FloatArray, step: float) -> FloatArray:
    """Distance, mm, between layers a step of the field apart, at the corner nodes (n,)."""
    gradient = np.einsum("eid,ei->ed", cell_gradients(mesh), values[mesh.corners])
    return np.asarray(step / np.maximum(_at_nodes(mesh, np.linalg.norm(gradient, axis=1)), 1e-12))


def _at_nodes(mesh: TetMesh, values: FloatArray) -> FloatArray:
    """Volume-weighted mean at the corner nodes of values per cell."""
    weight = np.repeat(mesh.volumes, 4)
    nodes, n = mesh.corners.ravel(), len(mesh.points)
    total = np.bincount(nodes, weight, n)
    return np.bincount(nodes, weight * np.repeat(values, 4), n) / np.maximum(total, 1e-300)


def _edge_keys(facets: IntArray, n: int) -> IntArray:
    """Keys of the edges of facets, and of their nodes as edges of zero length."""
    a = np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]])
    key = a.min(axis=1) * n + a.max(axis=1)
    nodes = np.unique(facets)
    return np.unique(np.concatenate([key, nodes * n + nodes]))


def _surface(
    mesh: TetMesh,
    signed: FloatArray,
    among: IntArray,
    gradient: FloatArray,
    thickness: FloatArray,
    on_patch: dict[str, IntArray],
    shortest: float,
    least_area: float,
) -> tuple[dict[str, Any] | None, int, int]:
    """Fields of a clean `Layer` where a field is zero; numbers of bubbles and specks left out."""
    cut = cut_at_zero(mesh, signed, among)
    if cut is None:
        return None, 0, 0
    n = len(mesh.points)
    points, triangles, cell = cut.points, cut.triangles, cut.cell
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    down = np.einsum("td,td->t", normal, gradient[cell]) < 0.0
    triangles = np.where(down[:, None], triangles[:, [0, 2, 1]], triangles)
    keys = cut.nodes[:, 0] * n + cut.nodes[:, 1]
    member = {name: np.isin(keys, edges) for name, edges in on_patch.items()}
    fixed = _ends_of_patches(triangles, member, len(points))
    triangles, cell = clean(points, triangles, cell, fixed, shortest, _SAG * shortest)
    wanted, bubbles, specks = _worthwhile(points, triangles, least_area)
    triangles, cell = triangles[wanted], cell[wanted]
    if not len(triangles):
        return None, bubbles, specks
    used, triangles = np.unique(triangles, return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    nodes, weights = cut.nodes[used], cut.weights[used]
    border = border_edges(triangles, len(used))
    patches = {name: border[on[used][border].all(axis=1)] for name, on in member.items()}
    local = (1.0 - weights) * thickness[nodes[:, 0]] + weights * thickness[nodes[:, 1]]
    mean = np.average(local[triangles].mean(axis=1), weights=_areas(points[used], triangles))
    surface = {
        "points": points[used],
        "triangles": triangles,
        "cell": cell,
        "nodes": nodes,
        "weights": weights,
        "loops": chain(border),
        "thickness": float(mean),
        "patches": patches,
        "local_thickness": local,
    }
    return surface, bubbles, specks


def _areas(points: FloatArray, triangles: IntArray) -> FloatArray:
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))


def _ends_of_patches(triangles: IntArray, member: dict[str, BoolArray], n: int) -> BoolArray:
    """Border points at which a patch begins or ends, (n,), which cleaning must keep."""
    border = border_edges(triangles, n)
    fixed = np.zeros(n, dtype=bool)
    for on in member.values():
        change = on[border[:, 0]] != on[border[:, 1]]
        fixed[border[change]] |= on[border[change]]
    return fixed


def _worthwhile(
    points: FloatArray, triangles: IntArray, least_area: float
) -> tuple[BoolArray, int, int]:
    """Triangles of the pieces that are kept, and the numbers of bubbles and specks left out."""
    n = len(points)
    ends = (np.repeat(triangles[:, 0], 2), triangles[:, 1:].ravel())
    graph = sp.coo_array((np.ones(len(ends[0]), dtype=np.int8), ends), shape=(n, n))
    count, piece = connected_components(graph, directed=False)
    of_triangle = piece[triangles[:, 0]]
    total = np.bincount(of_triangle, _areas(points, triangles), count)
    number = np.bincount(of_triangle, minlength=count)
    open_ = np.zeros(count, dtype=bool)
    open_[piece[border_edges(triangles, n)[:, 0]]] = True
    bubble = (number > 0) & ~open_
    speck = (number > 0) & open_ & ((total < least_area) | (number < _FEWEST))
    return ~(bubble | speck)[of_triangle], int(bubble.sum()), int(speck.sum())
