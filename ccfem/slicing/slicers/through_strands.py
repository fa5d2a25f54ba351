"""Layers through the strands of another program, which are published without their layers."""

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.body.files.strand_files import read_strand_files
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.geometry.polylines import pack, resample
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.level_surfaces import clean
from ccfem.slicing.layers.slicer import Vector, read_once
from ccfem.slicing.slicers.surfaces import Sheet, facing_up, layer_from_surface

_STEP = 0.5
"""Distance of the points on strands that layers are fitted to, mm."""
_NEIGHBOURS = 24
"""Points that a plane is fitted to."""
_WIDE = 1.5
"""Distance, mm, at which a point has lost two thirds of its weight."""
_LONE = 0.1
"""Spread of points, mm, below which the plane turns towards the neighbouring layers instead."""
_SHORTEST, _SAG = 0.25, 0.01
"""Edge of a layer, mm, and how far its border may move, mm, where shorter ones are collapsed."""


@dataclass(frozen=True)
class ThroughStrands:
    """Curved layers rebuilt from strands: a file a layer, ordered by the numbers in their names.

    At each node of the mesh near strands the distance from a plane is taken that is fitted to the
    points nearest to it (moving least squares); the layer is where it vanishes. Along a strand that
    is alone the plane is the one across the direction from the layer before to the one after.

    Attributes
    ----------
    folder : str
        Of files as `ccfem.body.files.strand_files` reads them.
    thickness : float, mm, optional
        Of the layers. Default: their median distance from the next one.
    reach : float, mm, default 2
        Distance from all strands beyond which there is no layer.
    """

    folder: str = "."
    thickness: float | None = None
    reach: float = 2.0

    curved: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_fields(self, "thickness", "reach", above=0.0, unit="mm")

    def __call__(self, stress: PartStress, build: Vector, machine: Machine) -> tuple[Layer, ...]:
        """Rebuild the layers; neither the stress nor the build direction has an influence.

        Raises
        ------
        InputError
            For strands of fewer than two layers, and for a layer without strands in the part.
        """
        clouds = self._clouds()
        sheets = [_sheet(stress.mesh, clouds, k, self.reach) for k in range(len(clouds))]
        thickness = self.thickness or _pitch(sheets)
        return tuple(
            layer_from_surface(stress.mesh, *sheet, k, thickness)
            for k, sheet in enumerate(facing_up(sheets, build))
        )

    def check(self, mesh: TetMesh, build: Vector, machine: Machine) -> None:
        """Refuse files that cannot be read, and layers whose strands miss the box of a part."""
        low, high = mesh.bounds[0] - self.reach, mesh.bounds[1] + self.reach
        for k, cloud in enumerate(self._clouds()):
            if not ((cloud >= low) & (cloud <= high)).all(axis=1).any():
                raise _misses(k)

    def _clouds(self) -> list[FloatArray]:
        """Points on the strands of each layer."""
        read = read_once(self, self.folder, lambda: read_strand_files(self.folder))
        files = [strands for strands in read if strands]
        if len(files) < 2:
            raise InputError(
                "layers are rebuilt from the strands of two or more, which tell the side on which "
                f"material is added; got {len(files)}: name the folder of all"
            )
        return [resample(*pack(strands), _STEP)[0] for strands in files]


def _misses(k: int) -> InputError:
    return InputError(
        f"no strand of layer {k} lies in the part: are they in mm, and in the frame of the mesh?"
    )


def _pitch(sheets: list[Sheet]) -> float:
    """Median distance of the points of sheets from the next sheet, mm."""
    pairs = pairwise(sheets)
    gaps = [nearest_on_triangles(*upper, lower[0]).distance for lower, upper in pairs]
    return float(np.median(np.concatenate(gaps)))


def _sheet(mesh: TetMesh, clouds: list[FloatArray], k: int, reach: float) -> Sheet:
    """Points and triangles through the points of one layer."""
    import pyvista as pv

    tree = cKDTree(clouds[k])
    near = np.flatnonzero(np.isfinite(tree.query(mesh.points, distance_upper_bound=2 * reach)[0]))
    height = np.full(len(mesh.points), np.nan)
    height[near] = _heights(mesh.points[near], clouds, k, tree)
    known = np.isfinite(height[mesh.corners]).all(axis=1)
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: mesh.corners[known]}, mesh.points)
    grid.point_data["height"] = np.nan_to_num(height)
    level = grid.contour([0.0], scalars="height")
    points, triangles = (
        np.asarray(level.points, dtype=np.float64),
        level.regular_faces.reshape(-1, 3),
    )
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    middle, across = (a + b + c) / 3.0, np.cross(b - a, c - a)
    kept = np.isfinite(tree.query(middle, distance_upper_bound=reach)[0])
    kept &= np.linalg.norm(across, axis=1) > 0.0
    if not kept.any():
        raise _misses(k)
    # Slivers where the surface passes close by nodes of the mesh.
    triangles, free = triangles[kept], np.zeros(len(points), dtype=np.bool_)
    triangles, _ = clean(points, triangles, np.arange(len(triangles)), free, _SHORTEST, _SAG)
    used, triangles = np.unique(triangles, return_inverse=True)
    return points[used], triangles.reshape(-1, 3)


def _heights(points: FloatArray, clouds: list[FloatArray], k: int, tree: cKDTree) -> FloatArray:
    """Distances, mm, of points from planes through the part of a layer that is near them."""
    away, index = tree.query(points, min(_NEIGHBOURS, tree.n))
    weight = np.exp(-((away - away[:, :1]) ** 2) / _WIDE**2)[..., None]
    weight /= weight.sum(axis=1, keepdims=True)
    cloud = clouds[k][index]
    middle = (weight * cloud).sum(axis=1)
    spread = cloud - middle[:, None]
    upward = _upward(points, clouds, k)
    upward /= np.maximum(np.linalg.norm(upward, axis=1, keepdims=True), 1e-12)
    # The normal is the direction of least spread; of equal ones, that towards the next layer.
    covariance = np.einsum("nki,nkj->nij", weight * spread, spread)
    covariance -= _LONE**2 * upward[:, :, None] * upward[:, None, :]
    normal = np.linalg.eigh(covariance)[1][:, :, 0]
    sense = np.sign(np.einsum("nd,nd->n", normal, upward))
    return np.asarray(sense * np.einsum("nd,nd->n", normal, points - middle))


def _upward(points: FloatArray, clouds: list[FloatArray], k: int) -> FloatArray:
    """Direction from the layer before to the one after, where points (n, 3) are."""
    ends = []
    for number in (max(k - 1, 0), min(k + 1, len(clouds) - 1)):
        tree = cKDTree(clouds[number])
        _, index = tree.query(points, min(_NEIGHBOURS, tree.n))
        ends.append(clouds[number][index].mean(axis=1))
    return np.asarray(ends[1] - ends[0])
