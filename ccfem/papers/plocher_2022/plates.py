"""Plates of Plocher et al. (2022): one hole, five holes, and a bending beam by optimisation.

A plate is a section in the plane with its bitmap, one pixel a bead wide, its supports and its
load. The loading axis is x.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from scipy import ndimage

from ccfem.base.arrays import BoolArray, FloatArray, freeze
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity import Problem, StressField
from ccfem.fem.elasticity.load_kinds import SurfaceLoad
from ccfem.fem.elasticity.problem import Force, PointForce, Support
from ccfem.fem.materials import isotropic, plane_stress
from ccfem.fem.plates import PlaneField, PlaneMesh, PlaneProblem, raster_mesh, solve_plane
from ccfem.fem.topopt import Design, Simp, outline
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.planar import Planar

BEAD = 0.8
"""Bead width, mm: that of the printer of the paper is not stated."""
_POISSON = 0.3
_THICKNESS = 1.0
_EDGE = 2.5
"""Edge length over the bead width of the triangles that strategies plan on."""
_ON_SIDE = 1e-9


@dataclass(frozen=True)
class Plate:
    """A plate in plane stress, 1 mm thick."""

    name: str
    title: str
    polygon: Any  # shapely Polygon, mm: the section; its box starts at the origin
    # (H, W): row 0 is the top; a pixel is solid where its centre lies in the section
    mask: BoolArray
    bead: float  # mm: side of a pixel, and bead width
    supports: tuple[Support, ...]
    load: tuple[SurfaceLoad, ...]
    # by patch name, (x, y), mm: patches of the one node nearest to a point
    points: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # mm: places of point loads and point supports, where stress has no bound
    peaks: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        freeze(self, mask=bool, points=dict)

    @cached_property
    def mesh(self) -> PlaneMesh:
        """A square cell for every solid pixel, with the patches of the supports."""
        mesh = raster_mesh(self.mask, self.bead)
        nodes = {name: mesh.nearest_nodes(at)[:, None] for name, at in self.points.items()}
        return mesh.with_patches(nodes)

    def problem(self, stiffness: FloatArray) -> PlaneProblem:
        """Problem with the stiffness (3, 3) or (m, 3, 3), MPa, of its cells."""
        loads = {"load": self.load}
        return PlaneProblem(self.mesh, stiffness, _THICKNESS, self.supports, loads)

    @cached_property
    def isotropic_field(self) -> PlaneField:
        """Solution with an isotropic material, Poisson's ratio 0.3."""
        stiffness = plane_stress(1000.0, 1000.0, _POISSON, 500.0 / (1.0 + _POISSON))
        return solve_plane(self.problem(stiffness))["load"]

    @cached_property
    def off_peaks(self) -> BoolArray:
        """Cells (m,) farther than 5 pixels from every point load and point support."""
        far = np.ones(len(self.mesh.cells), dtype=bool)
        for peak in self.peaks:
            far &= np.linalg.norm(self.mesh.centres - peak, axis=1) > 5.0 * self.bead
        return far

    def planned_on(self, layers: int = 2) -> tuple[tuple[Layer, ...], StressField]:
        """Layers of the plate, and its stress on them, as strategies take them.

        The section is extruded and sliced; the stress is that of `isotropic_field`, carried from
        the pixels to the nodes, so that a plate is planned and evaluated as any other part.
        """
        mesh = self._with_patches(extrude(self.polygon, _THICKNESS, _EDGE * self.bead, 1))
        plane = self.isotropic_field
        nodal = _spatial_stress(self._interpolated(plane.stress, mesh.points[:, :2]))
        cell = nodal[mesh.corners].mean(axis=1)
        nothing = np.zeros_like(mesh.points)
        loads = {"load": (Force("load", (1.0, 0.0, 0.0)),)}
        held = tuple(Support(name) for name in mesh.patches if name != "load")
        problem = Problem(mesh, isotropic(1000.0, _POISSON), held, loads)
        stress = StressField(
            problem, "load", nothing, cell, nodal, nothing, plane.strain_energy, plane.record
        )
        return Planar(count=layers).cut(mesh), stress

    def _with_patches(self, mesh: TetMesh) -> TetMesh:
        """Facets on the sides where the plate is held and loaded, or round the points there."""
        facets = mesh.boundary
        x, y = np.moveaxis(mesh.points[facets][..., :2], 2, 0)
        if not self.peaks:
            right = x.min(axis=1) > mesh.bounds[1, 0] - _ON_SIDE
            patches = {"support": facets[x.max(axis=1) < _ON_SIDE], "load": facets[right]}
            return mesh.with_patches(patches)
        upright = np.abs(mesh.facet_areas(facets)[1][:, 2]) < 0.5
        middle = np.stack([x.mean(axis=1), y.mean(axis=1)], axis=1)
        near = [
            upright & (np.linalg.norm(middle - peak, axis=1) < 2.0 * _EDGE * self.bead)
            for peak in self.peaks
        ]
        names = ("load", "support", "support_right")
        return mesh.with_patches({n: facets[k] for n, k in zip(names, near, strict=True)})

    def _interpolated(self, values: FloatArray, points: FloatArray) -> FloatArray:
        """Bilinear interpolation (k, c), between pixel centres, of values (m, c) per cell."""
        image = np.zeros((*self.mask.shape, values.shape[1]))
        image[self.mask] = values
        nearest = ndimage.distance_transform_edt(
            ~self.mask, return_distances=False, return_indices=True
        )
        image = image[nearest[0], nearest[1]]
        row = len(self.mask) - 0.5 - points[:, 1] / self.bead
        column = points[:, 0] / self.bead - 0.5
        return np.stack(
            [
                ndimage.map_coordinates(image[..., k], [row, column], order=1, mode="nearest")
                for k in range(values.shape[1])
            ],
            axis=1,
        )


def _spatial_stress(plane: FloatArray) -> FloatArray:
    """Stress tensors (k, 3, 3) of plane stress (k, 3)."""
    tensor = np.zeros((len(plane), 3, 3))
    tensor[:, 0, 0], tensor[:, 1, 1] = plane[:, 0], plane[:, 1]
    tensor[:, 0, 1] = tensor[:, 1, 0] = plane[:, 2]
    return tensor


def plates() -> Mapping[str, Callable[..., Plate]]:
    """Every plate by its number in the paper."""
    return {"I": single_hole, "II": five_holes, "III": optimised_beam}


def single_hole(bead: float = BEAD, radius: float = 6.0) -> Plate:
    """Case I: a plate 201.6 x 36 mm (5.6 : 1) with a hole, pulled with 1 N along x.

    Parameters
    ----------
    bead : float, mm
    radius : float, mm
        Stated as 6 mm; the stated cut-out area of 131 mm^2 would be 6.46 mm.
    """
    return _pulled_plate(
        "I", "Single hole in tension", (201.6, 36.0), [(100.8, 18.0)], radius, bead
    )


def five_holes(bead: float = BEAD, radius: float = 4.0) -> Plate:
    """Case II: a plate 108 x 36 mm (3 : 1) with five holes, pulled with 1 N along x.

    The cut-out area of 251 mm^2 is that of five holes of radius 4 mm; their layout is not stated:
    one in the middle, four at (+-30, +-9) mm from it.
    """
    centres = [(54.0 + 30.0 * i, 18.0 + 9.0 * j) for i in (-1, 1) for j in (-1, 1)]
    return _pulled_plate(
        "II", "Five holes in tension", (108.0, 36.0), [(54.0, 18.0), *centres], radius, bead
    )


def _pulled_plate(
    name: str,
    title: str,
    size: tuple[float, float],
    holes: list[tuple[float, float]],
    radius: float,
    bead: float,
) -> Plate:
    """Plate with round holes, sliding on its left end and pulled at its right one."""
    if not 0.0 < bead < 0.25 * min(size):
        raise InputError(
            f"bead width must be above 0 and below {0.25 * min(size):g} mm; got {bead}"
        )
    width, height = round(size[0] / bead), round(size[1] / bead)
    mask = np.ones((height, width), dtype=bool)
    row, column = np.mgrid[:height, :width] + 0.5
    polygon = shapely.box(0.0, 0.0, width * bead, height * bead)
    for x, y in holes:
        # In pixels and with room for rounding, so that ties fall alike on all sides.
        middle = 0.5 * width + (x - 0.5 * size[0]) / bead, 0.5 * height + (y - 0.5 * size[1]) / bead
        off = (column - middle[0]) ** 2 + (height - row - middle[1]) ** 2
        mask &= off > (radius / bead) ** 2 + 1e-9
        centre = shapely.Point(bead * middle[0], bead * middle[1])
        polygon = polygon.difference(centre.buffer(radius, quad_segs=32))
    return Plate(
        name=name,
        title=title,
        polygon=polygon,
        mask=mask,
        bead=bead,
        supports=(Support("x_min", "x"), Support("pin", "y")),
        load=(Force("x_max", (1.0, 0.0, 0.0)),),
        points={"pin": (0.0, bead * (height // 2))},
    )


def optimised_beam(bead: float = BEAD, volume_fraction: float = 0.6) -> Plate:
    """Case III: a beam (3.4 : 1) in bending, by topology optimisation.

    1 N at the middle of the top and 0.5 N at both sides of it; see
    `ccfem.papers.plocher_2022.plates`.

    Parameters
    ----------
    bead : float, mm
    volume_fraction : float
        Of the box of the beam.
    """
    beam = three_point_bending(bead, volume_fraction)
    forces = zip(beam.loads.tolist(), (0.5, 1.0, 0.5), strict=True)
    left, right = ((float(x), float(y)) for x, y in beam.supports)
    top = (float(beam.loads[1, 0]), float(beam.loads[1, 1]))
    return Plate(
        name="III",
        title="Beam in bending, by topology optimisation",
        polygon=beam.polygon,
        mask=beam.mask,
        bead=bead,
        supports=(Support("left", "xy"), Support("right", "y")),
        load=tuple(PointForce((x, y, 0.0), (0.0, -force, 0.0)) for (x, y), force in forces),
        points={"left": left, "right": right},
        peaks=(top, left, right),
    )


# The beam in three-point bending of Plocher et al. 2022, case III, by topology optimisation.


_COLUMNS, _ROWS, _TIMES = 68, 20, 3
_SUPPORT_IN = 2
"""Cells between the ends of the beam and its supports."""


@dataclass(frozen=True)
class BendingBeam:
    """An optimised beam, mirror symmetric to the last pixel."""

    mask: BoolArray  # (60, 204): pixels of the part, row 0 on top
    density: FloatArray  # (60, 204) in [0, 1]: optimised density, interpolated to the pixels
    # Shapely Polygon, mm: smooth outline of the same part; the origin is the lower left corner of
    # the image.
    polygon: Any
    size: float  # mm: side of a pixel
    supports: FloatArray  # (2, 2), mm: points at the bottom
    # (3, 2), mm: points at the top: the middle one carries 1 N, its neighbours 0.5 N each
    loads: FloatArray
    design: Design  # on the coarse raster

    def __post_init__(self) -> None:
        freeze(self, mask=bool, density=float, supports=float, loads=float)


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
    mask = _symmetric_part(fine, volume_fraction)
    width, height = size * mask.shape[1], size * mask.shape[0]
    inward = _SUPPORT_IN * _TIMES * size
    supports = np.array([[inward, 0.0], [width - inward, 0.0]])
    loads = 0.5 * width + _TIMES * size * np.array([-1.0, 0.0, 1.0])
    loads = np.stack([loads, np.full(3, height)], axis=1)
    return BendingBeam(
        mask=mask,
        density=fine,
        polygon=outline(
            fine, size, volume_fraction, keep=np.concatenate([supports, loads]), least_hole=12.0
        ),
        size=size,
        supports=supports,
        loads=loads,
        design=design,
    )


def _symmetric_part(density: FloatArray, share: float) -> BoolArray:
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
