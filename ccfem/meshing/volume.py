"""Closed surface to tetrahedra, with fTetWild."""

from contextlib import chdir
from tempfile import TemporaryDirectory

import numpy as np

from ccfem.checks import check_number
from ccfem.errors import InputError
from ccfem.io.surface import Surface
from ccfem.mesh.check import check_mesh
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["tetrahedralise"]

_MOST = 2e7
"""Number of cells above which an edge length is taken for a mistake of units."""


def tetrahedralise(surface: Surface, edge_length: float) -> TetMesh:
    """Fill a closed surface with tetrahedra (Hu et al., Fast Tetrahedral Meshing in the Wild).

    The boundary of the mesh stays within 1e-3 of the part's diagonal of the surface.

    Parameters
    ----------
    surface : Surface
    edge_length : float, mm
        Target edge length.

    Returns
    -------
    TetMesh
        Linear, checked, without patches.

    Raises
    ------
    InputError
        When the edge length is too long or too short for the part, or no cells are left.
    """
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    check_number("edge length", edge_length, above=0.0, below=size, unit="mm (the part's diagonal)")
    expected = surface.volume / (edge_length**3 / (6.0 * np.sqrt(2.0)))
    if expected > _MOST:
        raise InputError(
            f"an edge length of {edge_length:g} mm would make about {expected:.1g} cells of a "
            f"part {size:.3g} mm across: choose a longer one"
        )
    import pytetwild

    # fTetWild leaves a file in the working folder.
    with TemporaryDirectory() as folder, chdir(folder):
        points, cells = pytetwild.tetrahedralize(
            np.array(surface.points),
            surface.triangles.astype(np.int32),
            edge_length_abs=float(edge_length),
            optimize=True,
            vtk_ordering=True,
            quiet=True,
        )
    if not len(cells):
        raise InputError(
            "meshing left no cells inside the surface: check that it is closed, does not cut "
            "itself, and that the edge length suits its thickness"
        )
    return check_mesh(TetMesh(points, cells))[0]
