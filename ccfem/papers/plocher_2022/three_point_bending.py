"""The beam in three-point bending of Plocher et al. 2022, case III, by topology optimisation."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from ccfem.base.arrays import BoolArray, FloatArray, read_only
from ccfem.fem.elasticity.problem import PointForce, Support
from ccfem.fem.materials import plane_stress
from ccfem.fem.plates import PlaneProblem, raster_mesh
from ccfem.fem.topopt import Design, Simp, outline

_COLUMNS, _ROWS, _TIMES = 68, 20, 3
_SUPPORT_IN = 2
"""Cells between the ends of the beam and its supports."""


@dataclass(frozen=True)
class BendingBeam:
    """An optimised beam, mirror symmetric to the last pixel.

    Attributes
    ----------
    mask : (60, 204) bool array
        Pixels of the part, row 0 on top.
    density : (60, 204) array in [0, 1]
        Optimised density, interpolated to the pixels.
    polygon : shapely Polygon, mm
        Smooth outline of the same part; the origin is the lower left corner of the image.
    size : float, mm
        Side of a pixel.
    supports : (2, 2) array, mm
        Points at the bottom.
    loads : (3, 2) array, mm
        Points at the top: the middle one carries 1 N, its neighbours 0.5 N each.
    design : Design
        On the coarse raster.
    """

    mask: BoolArray
    density: FloatArray
    polygon: Any
    size: float
    supports: FloatArray
    loads: FloatArray
    design: Design

    def __post_init__(self) -> None:
        for name, dtype in (
            ("mask", np.bool_),
            ("density", np.float64),
            ("supports", np.float64),
            ("loads", np.float64),
        ):
            object.__setattr__(self, name, read_only(getattr(self, name), dtype))


def three_point_bending_problem(size: float = 1.0) -> PlaneProblem:
    """Solid beam of 68 x 20 cells with the loads and supports of the case.

    Parameters
    ----------
    size : float, mm
        Side of a cell. The loads, 0.5, 1 and 0.5 N, press on three neighbouring nodes.
    """
    mesh = raster_mesh(np.ones((_ROWS, _COLUMNS), dtype=bool), size)
    middle, far = 0.5 * _COLUMNS, _COLUMNS - _SUPPORT_IN
    feet = mesh.nearest_nodes(size * np.array([[_SUPPORT_IN, 0], [far, 0]]))[:, None]
    mesh = mesh.with_patches({"left": feet[:1], "right": feet[1:]})
    loads = tuple(
        PointForce((size * (middle + k), size * _ROWS, 0.0), (0.0, -force, 0.0))
        for k, force in ((-1, 0.5), (0, 1.0), (1, 0.5))
    )
    modulus, poisson = 1.0, 0.3
    stiffness = plane_stress(modulus, modulus, poisson, modulus / (2.0 * (1.0 + poisson)))
    supports = (Support("left", "xy"), Support("right", "y"))
    return PlaneProblem(mesh, stiffness, 1.0, supports, {"bend": loads})


def three_point_bending(size: float = 0.8, volume_fraction: float = 0.6) -> BendingBeam:
    """Optimise the beam and make a part of it.

    SIMP (penalty 3, sensitivity filter of 1.5 cells, at most 120 iterations) on 68 x 20 cells,
    interpolated to pixels a third as large, cut at the volume, largest piece, voids below 12
    pixels filled, one half copied onto the other.

    Parameters
    ----------
    size : float, mm, default 0.8
        Side of a pixel; the beam is 204 x 60 pixels. The published size is not known.
    volume_fraction : float, default 0.6
    """
    problem = three_point_bending_problem(_TIMES * size)
    method = Simp(
        volume_fraction, radius=1.5 * _TIMES * size, objective_tolerance=0.0, max_iterations=120
    )
    design = method(problem)
    coarse = design.density.reshape(_ROWS, _COLUMNS)
    coarse = 0.5 * (coarse + coarse[:, ::-1])
    fine = ndimage.zoom(coarse, _TIMES, order=1, mode="nearest", grid_mode=True)
    half = fine.shape[1] // 2
    fine = np.concatenate([fine[:, :half], fine[:, :half][:, ::-1]], axis=1)
    mask = _part(fine, volume_fraction)
    width, height = size * mask.shape[1], size * mask.shape[0]
    inward = _SUPPORT_IN * _TIMES * size
    supports = np.array([[inward, 0.0], [width - inward, 0.0]])
    loads = 0.5 * width + _TIMES * size * np.array([-1.0, 0.0, 1.0])
    loads = np.stack([loads, np.full(3, height)], axis=1)
    return BendingBeam(
        mask=mask,
        density=fine,
        polygon=outline(
            fine,
            size,
            volume_fraction,
            keep=np.concatenate([supports, loads]),
            least_hole=12.0,
        ),
        size=size,
        supports=supports,
        loads=loads,
        design=design,
    )


def _part(density: FloatArray, share: float) -> BoolArray:
    """Densest pixels of a share of the image: the largest piece, with its small voids filled."""
    order = np.sort(density.reshape(-1))[::-1]
    dense = density >= order[round(share * order.size) - 1]
    pieces, count = ndimage.label(dense)
    sizes = ndimage.sum_labels(dense, pieces, np.arange(1, count + 1))
    part = pieces == 1 + int(np.argmax(sizes))
    voids, count = ndimage.label(~part)
    border = np.unique(np.concatenate([voids[0], voids[-1], voids[:, 0], voids[:, -1]]))
    for k in range(1, count + 1):
        if k not in border and (voids == k).sum() < 12:
            part |= voids == k
    half = part.shape[1] // 2
    return np.concatenate([part[:, :half], part[:, :half][:, ::-1]], axis=1)
