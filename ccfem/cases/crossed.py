"""Solids that two extrusions at right angles have in common: what bolts from two sides hold."""

import json
from collections.abc import Mapping
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import shapely

from ccfem.arrays import FloatArray
from ccfem.mesh.check import check_mesh
from ccfem.mesh.patches import PatchRule, patches_from_rules
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.meshing import extrude

__all__ = ["arc", "crossed_mesh"]

_TOLERANCE = 5e-4
"""Of the mesher, in the diagonal of the part."""
_BEYOND = 4.0
"""How far each extrusion stands out of the other, mm."""


def arc(x: float, y: float, radius: float, first: float, last: float) -> FloatArray:
    """Points every 6 degrees on an arc about (x, y) from one angle to another, degrees."""
    angle = np.radians(np.linspace(first, last, int(np.ceil(abs(last - first) / 6.0)) + 1))
    return np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)


def crossed_mesh(
    front: shapely.Polygon,
    top: shapely.Polygon,
    element_size: float,
    rules: Mapping[str, PatchRule],
) -> TetMesh:
    """Mesh of what two extrusions have in common; takes minutes.

    Parameters
    ----------
    front : shapely Polygon, mm
        Outline seen along z, in x and y.
    top : shapely Polygon, mm
        Outline seen along y, in x and z.
    element_size : float, mm
        Target edge length.
    rules : mapping of patch name to PatchRule

    Returns
    -------
    TetMesh
        Linear, checked, with the patches.
    """
    import pytetwild

    (_, low, _, high), (_, near, _, far) = front.bounds, top.bounds
    deep, tall = far - near + 2.0 * _BEYOND, high - low + 2.0 * _BEYOND
    one = extrude(front, deep, 2.0 * element_size)
    other = extrude(top, tall, 2.0 * element_size)
    # The planform of `top` lies in x and z, and is extruded along y.
    upright = other.points @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    upright = upright + np.array([0.0, high + _BEYOND, 0.0])
    with TemporaryDirectory() as folder, chdir(folder):
        _write_surface("front.stl", one.points + np.array([0.0, 0.0, near - _BEYOND]), one)
        _write_surface("top.stl", upright, other)
        tree = {"operation": "intersection", "left": "front.stl", "right": "top.stl"}
        Path("tree.json").write_text(json.dumps(tree), encoding="utf-8")
        width = max(front.bounds[2], top.bounds[2]) - min(front.bounds[0], top.bounds[0])
        diagonal = float(np.linalg.norm([width, tall, deep]))
        grid = pytetwild.tetrahedralize_csg(
            "tree.json",
            epsilon=_TOLERANCE,
            edge_length_r=element_size / diagonal,
            num_threads=1,
        )
    cells = np.asarray(grid.cells).reshape(-1, 5)[:, 1:]
    mesh = check_mesh(TetMesh(np.asarray(grid.points), cells))[0]
    return patches_from_rules(mesh, rules)


def _write_surface(name: str, points: FloatArray, mesh: TetMesh) -> None:
    """Write the boundary of a mesh, moved to other points, as STL."""
    import pyvista

    faces = np.column_stack([np.full(len(mesh.boundary), 3), mesh.boundary])
    pyvista.PolyData(points, faces.ravel()).save(name)
