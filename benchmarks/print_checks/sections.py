"""Sections of a part by VTK's cutter, which shares no code with the slicer of ccfem."""

import numpy as np
import pyvista
import shapely

from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["section_of"]

_TURN = 1e-7
"""Share of the part's size by which a cut is moved off nodes that lie in it."""


def section_of(mesh: TetMesh, frame: np.ndarray, height: float) -> shapely.Geometry:
    """Section of a part at a height along the third row of a frame, in its first two rows."""
    corners = mesh.points @ frame.T
    height = height + _TURN * float(np.ptp(corners, axis=0).max())
    cells = np.column_stack([np.full(len(mesh.cells), 4), mesh.corners])
    kinds = np.full(len(cells), pyvista.CellType.TETRA)
    grid = pyvista.UnstructuredGrid(cells.ravel(), kinds, corners)
    cut = grid.slice(normal=(0.0, 0.0, 1.0), origin=(0.0, 0.0, height))
    faces = cut.triangulate().regular_faces if cut.n_cells else np.zeros((0, 3), dtype=int)
    triangles = shapely.polygons(np.asarray(cut.points, dtype=np.float64)[faces][:, :, :2])
    return shapely.make_valid(shapely.coverage_union_all(triangles[shapely.area(triangles) > 0.0]))
