"""The authors' strands on the T-bracket, and the layers that they lie on, rebuilt from them.

The data set has the strands of this part as lines, without its layers. The part is that of Fang et
al. 2024, whose solid is recovered from their own layers.
"""

import os
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.geometry.polylines import resample
from ccfem.paths.planning.given_paths import GivenPaths
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.path_table import read_strands
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.surfaces import layer_from_surface

DATA = "CCFEM_ZHANG2025"
"""Environment variable that names the folder of the published data."""
BUILD = (0.0, 1.0, 0.0)

_STEP = 0.5
"""Distance of the points on strands through which layers are laid, mm."""
_NEIGHBOURS = 24
"""Points that a plane is fitted to."""
_WIDE = 1.5
"""Distance, mm, at which a point has lost two thirds of its weight."""
_REACH = 2.0
"""Distance from all strands, mm, beyond which there is no layer."""


def authors_folder() -> Path:
    """Folder of the strands of the T-bracket."""
    named = os.environ.get(DATA)
    if not named:
        raise InputError(f"set {DATA} to the folder of the data of Zhang et al. 2025")
    return Path(named) / "T-bracket" / "StripPath"


def authors_strands(folder: Path) -> Toolpaths:
    """Read the strands, numbered by the layers of their files."""
    return read_strands(folder, np.eye(3), np.array(BUILD))


def rebuilt_layers(mesh: TetMesh, strands: Toolpaths, thickness: float) -> tuple[Layer, ...]:
    """Lay a surface through the strands of each layer, as far as the part reaches.

    At each node of the mesh near strands the distance from a plane is taken that is fitted to the
    points nearest to it (moving least squares); the layer is where it vanishes. What lies farther
    from all strands than 2 mm is left out.

    Parameters
    ----------
    mesh : TetMesh
        Of the part.
    strands : Toolpaths
        On at least two layers, which lie on one another.
    thickness : float, mm
    """
    numbers = np.unique(strands.layer).tolist()
    if len(numbers) < 2:
        raise InputError(
            f"layers are rebuilt from the strands of two or more; got {len(numbers)}: name the "
            "folder of all"
        )
    clouds = []
    for number in numbers:
        lines = strands.on_layer(number)
        clouds.append(resample(lines.points, lines.offsets, _STEP)[0])
    return tuple(
        layer_from_surface(mesh, *_sheet(mesh, clouds, k), k, thickness) for k in range(len(clouds))
    )


def strands_on(layers: tuple[Layer, ...], strands: Toolpaths) -> Toolpaths:
    """Move strands onto the layers that were laid through them."""
    numbers = np.unique(strands.layer).tolist()
    return Toolpaths.concatenate(
        [
            GivenPaths(strands.on_layer(number), "the authors' strands").on([layer]).toolpaths
            for number, layer in zip(numbers, layers, strict=True)
        ]
    )


def _sheet(mesh: TetMesh, clouds: list[FloatArray], k: int) -> tuple[FloatArray, IntArray]:
    """Triangles through the points of one layer, counter-clockwise seen from the next one."""
    import pyvista as pv

    tree = cKDTree(clouds[k])
    near = np.flatnonzero(np.isfinite(tree.query(mesh.points, distance_upper_bound=2 * _REACH)[0]))
    height = np.full(len(mesh.points), np.nan)
    height[near] = _heights(mesh.points[near], clouds, k, tree)
    known = np.isfinite(height[mesh.corners]).all(axis=1)
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: mesh.corners[known]}, mesh.points)
    grid.point_data["height"] = np.nan_to_num(height)
    found = grid.contour([0.0], scalars="height")
    points, triangles = np.asarray(found.points, dtype=np.float64), found.regular_faces
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    middle, across = (a + b + c) / 3.0, np.cross(b - a, c - a)
    kept = np.isfinite(tree.query(middle, distance_upper_bound=_REACH)[0])
    kept &= np.linalg.norm(across, axis=1) > 0.0
    up = np.einsum("td,td->t", across, _upward(middle, clouds, k))
    turned = up[kept].sum() < 0.0
    return points, triangles[kept][:, ::-1] if turned else triangles[kept]


def _heights(points: FloatArray, clouds: list[FloatArray], k: int, tree: cKDTree) -> FloatArray:
    """Distances, mm, of points from planes through the part of a layer that is near them."""
    away, index = tree.query(points, _NEIGHBOURS)
    weight = np.exp(-((away - away[:, :1]) ** 2) / _WIDE**2)[..., None]
    cloud = clouds[k][index]
    middle = (weight * cloud).sum(axis=1) / weight.sum(axis=1)
    spread = cloud - middle[:, None]
    normal = np.linalg.eigh(np.einsum("nki,nkj->nij", weight * spread, spread))[1][:, :, 0]
    sense = np.sign(np.einsum("nd,nd->n", normal, _upward(points, clouds, k)))
    return np.asarray(sense * np.einsum("nd,nd->n", normal, points - middle))


def _upward(points: FloatArray, clouds: list[FloatArray], k: int) -> FloatArray:
    """Direction from the layer before to the one after, where points (n, 3) are."""
    ends = []
    for number in (max(k - 1, 0), min(k + 1, len(clouds) - 1)):
        _, index = cKDTree(clouds[number]).query(points, _NEIGHBOURS)
        ends.append(clouds[number][index].mean(axis=1))
    return np.asarray(ends[1] - ends[0])
