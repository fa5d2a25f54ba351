"""What keeps a mesh from being solved on: one line with its cure."""

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh.pairing import CROWDED, FOLDED

STRAIGHT = 1e-6
"""Distance of a mid-side node from the middle of its edge, over the edge, that counts as none."""


def first_flaw(
    points: FloatArray,
    cells: IntArray,
    edges: IntArray,
    volumes: FloatArray,
    partners: IntArray,
) -> str:
    """Say what is wrong with a mesh of tetrahedra; empty for a sound one.

    Parameters
    ----------
    points : (n, 3) array, mm
        Finite.
    cells : (m, 4) or (m, 10) int array
    edges : (6, 2) int array
        Corners at the ends of the edge of each mid-side node.
    volumes : (m,) array, mm^3
    partners : (4 m,) int array
        From `ccfem.body.mesh.pairing.pair_facets`.
    """
    if not volumes.min() > 0.0:
        return (
            f"cell {volumes.argmin()} of the mesh has volume {volumes.min():.3g} mm^3: repair flat "
            "and inverted cells first (ccfem.body.mesh.check_mesh)"
        )
    wrong = np.flatnonzero((partners == CROWDED) | (partners == FOLDED))
    if len(wrong):
        cell = wrong[0] // 4
        at = ", ".join(f"{x:.4g}" for x in points[cells[cell, :4]].mean(axis=0))
        return (
            f"cells of the mesh overlap or come twice ({len(wrong)} of their faces belong to cells "
            f"on one side, or to more than two; the first at ({at}) mm): mend it with "
            "ccfem.body.mesh.check_mesh, or mesh the part again"
        )
    return "" if cells.shape[1] == 4 else _curved(points, cells, edges)


def _curved(points: FloatArray, cells: IntArray, edges: IntArray) -> str:
    """Say where sides are curved: all elements of ccfem are straight-sided."""
    off = length = 0.0
    count = 0
    for k, (i, j) in enumerate(edges):
        start, end = points[cells[:, i]], points[cells[:, j]]
        gap = np.linalg.norm(points[cells[:, 4 + k]] - 0.5 * (start + end), axis=1)
        side = np.linalg.norm(end - start, axis=1)
        count += int(np.count_nonzero(gap > STRAIGHT * side))
        worst = gap.argmax()
        if gap[worst] > off:
            off, length = float(gap[worst]), float(side[worst])
    if not count:
        return ""
    return (
        f"{count} edges of quadratic cells are curved, by up to {off:.3g} mm on an edge of "
        f"{length:.3g} mm, but ccfem needs straight ones: straighten them with "
        "ccfem.body.mesh.check_mesh, which reports how far it moved the nodes; use a finer mesh if "
        "that is too far"
    )
