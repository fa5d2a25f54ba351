"""Smoothing of a mesh that was cut out of another: its cut faces, and the cells behind them."""

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.topopt.cut import CutMesh
from ccfem.geometry.facets import are_among
from ccfem.geometry.measures import signed_volumes

_FLAT = 1e-6
"""Share of the normals round a node in a direction, above which it must not move that way."""
_THIN = 0.02
"""Cells below this share of the mean volume must not shrink."""


def relaxed(cut: CutMesh, passes: int = 30) -> TetMesh:
    """Smooth a cut mesh.

    Its surface is smoothed by Taubin's passes 0.5 and -0.53 (Curve and surface smoothing without
    shrinkage, ICCV 1995), where nodes on the border of the whole mesh slide along it, and stay
    where a patch ends; inner nodes move to the mean of their neighbours. A step that would flatten
    a cell is not taken.

    Parameters
    ----------
    cut : CutMesh
    passes : int, default 30

    Returns
    -------
    TetMesh
        Of the same cells and patches.
    """
    mesh = cut.mesh
    n, surface = len(mesh.points), np.unique(mesh.boundary)
    outer = _mean(_surface_pairs(cut), n)
    inner = _mean(_both_ways(mesh.cells[:, mesh.edges]), n)
    free = _free_directions(cut)
    inside = np.setdiff1d(np.arange(n), surface)
    points = np.array(mesh.points)
    for _ in range(passes):
        # Both steps before the check: one of them alone, taken again and again, would not end.
        wanted = points.copy()
        for factor in (0.5, -0.53):
            step = (outer @ wanted - wanted)[surface]
            wanted[surface] += factor * np.einsum("kij,kj->ki", free[surface], step)
        wanted[inside] = (inner @ wanted)[inside]
        points = _safely_moved(mesh.cells, points, wanted)
    return TetMesh(points, mesh.cells, mesh.patches, mesh.axes)


def _both_ways(edges: IntArray) -> IntArray:
    """Pairs (k, 2) of each edge (..., 2) and of the same turned round."""
    edges = edges.reshape(-1, 2)
    return np.concatenate([edges, edges[:, ::-1]])


def _surface_pairs(cut: CutMesh) -> IntArray:
    """Nodes (k, 2) of the surface with the neighbours that they follow.

    Nodes of the cut follow neighbours on the cut only, so that its rim stays sharp.
    """
    sides = cut.mesh.boundary[:, [[0, 1], [1, 2], [2, 0]]]
    own, rest = _both_ways(sides[cut.facet < 0]), _both_ways(sides[cut.facet >= 0])
    return np.concatenate([own, rest[~np.isin(rest[:, 0], own[:, 0])]])


def _mean(pairs: IntArray, n: int) -> sp.csr_array:
    """Matrix (n, n) that averages over the second nodes of the pairs (k, 2) of each first one."""
    links = sp.csr_array((np.ones(len(pairs)), pairs.T), shape=(n, n))
    links.data[:] = 1.0
    count = np.maximum(np.diff(links.indptr), 1)
    return sp.csr_array(sp.diags_array(1.0 / count) @ links)


def _free_directions(cut: CutMesh) -> FloatArray:
    """Projections (n, 3, 3) onto the directions along the border of the whole mesh."""
    mesh = cut.mesh
    border = mesh.boundary[cut.facet >= 0]
    area, normal = mesh.facet_areas(border)
    products = area[:, None, None] * normal[:, :, None] * normal[:, None, :]
    sums = np.zeros((len(mesh.points), 3, 3))
    for corner in border.T:
        np.add.at(sums, corner, products)
    size = np.maximum(np.trace(sums, axis1=1, axis2=2), 1e-300)
    values, directions = np.linalg.eigh(sums / size[:, None, None])
    kept = directions * (values <= _FLAT)[:, None, :]
    kept[_patch_ends(mesh, border)] = 0.0
    return kept @ np.swapaxes(kept, 1, 2)


def _patch_ends(mesh: TetMesh, border: IntArray) -> BoolArray:
    """Nodes (n,) where facets (b, 3) inside and outside a patch meet."""
    ends = np.zeros(len(mesh.points), dtype=bool)
    for facets in mesh.patches.values():
        own = are_among(border, facets)
        inside, outside = np.zeros((2, len(mesh.points)), dtype=bool)
        inside[border[own]], outside[border[~own]] = True, True
        ends |= inside & outside
    return ends


def _safely_moved(cells: IntArray, points: FloatArray, wanted: FloatArray) -> FloatArray:
    """Points moved to where they are wanted, except those whose cells would become flat."""
    before = signed_volumes(points, cells)
    least = _THIN * float(before.mean())
    moved = wanted.copy()
    while True:
        after = signed_volumes(moved, cells)
        flat = (after < least) & (after < before * (1.0 - 1e-12))
        stuck = np.unique(cells[flat])
        stuck = stuck[(moved[stuck] != points[stuck]).any(axis=1)]
        if not len(stuck):
            return moved
        moved[stuck] = points[stuck]
