"""Sections of a part by VTK's cutter, which shares no code with the slicer of ccfem."""

import numpy as np
import pyvista
import shapely

from ccfem.body.mesh.tet_mesh import TetMesh

__all__ = ["Sections"]

_TURN = 1e-7
"""Share of the part's size by which a cut is moved off nodes that lie in it."""


class Sections:
    """Sections of a part across the third row of a frame, in the first two rows, moved by a shift.

    Parameters
    ----------
    mesh : TetMesh
    frame : (3, 3) array
    shift : (3,) array, mm
        Taken off all coordinates.
    """

    def __init__(self, mesh: TetMesh, frame: np.ndarray, shift: np.ndarray) -> None:
        corners = mesh.points @ frame.T - shift
        self._off = _TURN * float(np.ptp(corners, axis=0).max())
        cells = np.column_stack([np.full(len(mesh.cells), 4), mesh.corners])
        kinds = np.full(len(cells), pyvista.CellType.TETRA)
        self._grid = pyvista.UnstructuredGrid(cells.ravel(), kinds, corners)
        self._known: dict[float, shapely.Geometry] = {}

    def _triangles(self, height: float) -> np.ndarray:
        """Corners (k, 3, 2) of the triangles of a section."""
        cut = self._grid.slice(normal=(0.0, 0.0, 1.0), origin=(0.0, 0.0, height + self._off))
        faces = cut.triangulate().regular_faces if cut.n_cells else np.zeros((0, 3), dtype=int)
        return np.asarray(cut.points, dtype=np.float64)[faces][:, :, :2]

    def area(self, height: float) -> float:
        """Area of the section at a height, mm^2."""
        a, b, c = np.moveaxis(self._triangles(height), 1, 0)
        u, v = b - a, c - a
        return 0.5 * float(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum())

    def region(self, height: float) -> shapely.Geometry:
        """Section at a height."""
        at = round(height, 4)
        if at not in self._known:
            triangles = shapely.polygons(self._triangles(at))
            whole = shapely.coverage_union_all(triangles[shapely.area(triangles) > 0.0])
            self._known[at] = shapely.make_valid(whole)
        return self._known[at]
