"""What keeps a mesh from being solved on: one line with its cure."""

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh.curved_cells import CELL_POINTS, NODES, curved_cells, jacobians
from ccfem.body.mesh.pairing import CROWDED, FOLDED


def first_flaw(
    points: FloatArray,
    cells: IntArray,
    volumes: FloatArray,
    partners: IntArray,
) -> str:
    """Say what is wrong with a mesh of tetrahedra; empty for a sound one.

    Parameters
    ----------
    points : (n, 3) array, mm
        Finite.
    cells : (m, 4) or (m, 10) int array
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
    return "" if cells.shape[1] == 4 else _folded(points, cells)


def _folded(points: FloatArray, cells: IntArray) -> str:
    """Say which quadratic cell its curved sides turn inside out."""
    curved = curved_cells(points, cells)
    nodes = points[cells[curved]]
    least = np.min([jacobians(nodes, at) for at in (*NODES, *CELL_POINTS)], axis=0)
    folded = curved[least <= 0.0]
    if not len(folded):
        return ""
    at = ", ".join(f"{x:.4g}" for x in points[cells[folded[0], :4]].mean(axis=0))
    return (
        f"{len(folded)} quadratic cells are turned inside out by their curved sides, the first at "
        f"({at}) mm: straighten them with ccfem.body.mesh.check_mesh, or use a finer mesh there"
    )
