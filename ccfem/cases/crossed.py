"""Solids that extrusions at right angles have in common: what bolts from several sides hold."""

import json
from collections.abc import Mapping
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.body.files.surface import write_stl
from ccfem.body.mesh.check import check_mesh
from ccfem.body.mesh.patches import PatchRule, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude

_TOLERANCE = 5e-4
"""Of the mesher, in the diagonal of the part."""
_BEYOND = 4.0
"""How far each extrusion stands out of the other, mm."""


def arc(x: float, y: float, radius: float, first: float, last: float) -> FloatArray:
    """Points every 6 degrees on an arc about (x, y) from one angle to another, degrees."""
    angle = np.radians(np.linspace(first, last, int(np.ceil(abs(last - first) / 6.0)) + 1))
    return np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)


def crossed_mesh(
    outlines: Mapping[str, shapely.Polygon],
    element_size: float,
    rules: Mapping[str, PatchRule],
) -> TetMesh:
    """Mesh of what extrusions have in common; takes minutes.

    Parameters
    ----------
    outlines : mapping of "x", "y" or "z" to shapely Polygon, mm
        Two or three outlines, seen along these axes, each in the other two in alphabetical order.
    element_size : float, mm
        Target edge length.
    rules : mapping of patch name to PatchRule

    Returns
    -------
    TetMesh
        Linear, checked, with the patches.
    """
    import pytetwild

    low, high = _bounds(outlines)
    with TemporaryDirectory() as folder, chdir(folder):
        for axis, outline in outlines.items():
            along = "xyz".index(axis)
            tall = high[along] - low[along] + 2.0 * _BEYOND
            body = extrude(outline, tall, 2.0 * element_size)
            placed = np.empty_like(body.points)
            placed[:, [k for k in range(3) if k != along]] = body.points[:, :2]
            placed[:, along] = body.points[:, 2] + low[along] - _BEYOND
            # Seen along y the first two axes change their sense, and so do the triangles.
            write_stl(Path(f"{axis}.stl"), placed, body.boundary[:, :: -1 if axis == "y" else 1])
        first, *others = (f"{axis}.stl" for axis in outlines)
        tree: Any = first
        for other in others:
            tree = {"operation": "intersection", "left": tree, "right": other}
        Path("tree.json").write_text(json.dumps(tree), encoding="utf-8")
        diagonal = float(np.linalg.norm(high - low + 2.0 * _BEYOND))
        grid = pytetwild.tetrahedralize_csg(
            "tree.json",
            epsilon=_TOLERANCE,
            edge_length_r=element_size / diagonal,
            num_threads=1,
        )
    cells = np.asarray(grid.cells).reshape(-1, 5)[:, 1:]
    mesh = check_mesh(TetMesh(np.asarray(grid.points), cells))[0]
    return patches_from_rules(mesh, rules)


def _bounds(outlines: Mapping[str, shapely.Polygon]) -> tuple[FloatArray, FloatArray]:
    """Least and largest coordinates (3,) of what the extrusions have in common."""
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    for axis, outline in outlines.items():
        across = [k for k in range(3) if k != "xyz".index(axis)]
        ends = np.reshape(outline.bounds, (2, 2))
        low[across] = np.maximum(low[across], ends[0])
        high[across] = np.minimum(high[across], ends[1])
    return low, high
