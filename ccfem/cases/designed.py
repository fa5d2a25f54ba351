"""Plates that topology optimisation designs: the parts of Wang et al. 2021.

A plate is given by its border, holes, supports and load. From these come the problem that is
optimised, the part that the optimum stands for, and the case of either part.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.cases.case import Case
from ccfem.cases.filament import printed_pla
from ccfem.cases.stored import mesh_of_case, stored_outline
from ccfem.checks import check_choices, check_fields
from ccfem.elasticity.problem import Force, Problem, Support
from ccfem.errors import InputError
from ccfem.machine.machine import Machine
from ccfem.machine.speed_table import SpeedTable
from ccfem.materials import plane_stress
from ccfem.mesh.patches import Cylinder, Plane, patches_from_rules
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.meshing import extrude
from ccfem.plates.plane_mesh import PlaneMesh, raster_mesh
from ccfem.plates.problem import PlaneProblem
from ccfem.progress import Progress, silent
from ccfem.topopt.design import Design
from ccfem.topopt.outline import solid
from ccfem.topopt.somp import somp

__all__ = [
    "ELEMENT_SIZE",
    "LAMINATE",
    "SOURCE",
    "THICKNESS",
    "DesignPlate",
    "Hole",
    "Stretch",
    "case_of",
    "designed_case",
    "prepreg_printer",
]

ELEMENT_SIZE = 1.2
THICKNESS = 1.0
"""Of the plates, mm; that of the printed parts is not stated."""
SOURCE = "Wang et al. 2021 (Composites Part A 140, 106181)"

LAMINATE = plane_stress(18300.0, 19800.0, 0.17, 5150.0)
"""Stiffness of the laminate of the paper, MPa; Poisson's ratio 21 follows from the moduli."""

_LAYERS = 2
_NEAR = 1e-6
"""How far a node may lie from the line that it is on, mm."""


@dataclass(frozen=True)
class Stretch:
    """A straight stretch of the border of a plate, between two points (x, y), mm."""

    start: tuple[float, float]
    end: tuple[float, float]

    def edges(self, mesh: PlaneMesh) -> IntArray:
        """Boundary edges (k, 2) of a plane mesh with their middles on it."""
        middles = mesh.points[mesh.boundary].mean(axis=1)
        return mesh.boundary[self._holds(middles)]

    def __call__(self, mesh: TetMesh) -> IntArray:
        """Walls (k, 3) of an extruded plate with all their nodes on it."""
        _, normal = mesh.facet_areas(mesh.boundary)
        walls = mesh.boundary[np.abs(normal[:, 2]) < 0.5]
        chosen = self._holds(mesh.points[walls][..., :2]).all(axis=1)
        if not chosen.any():
            raise InputError(f"no wall of the part lies between {self.start} and {self.end} mm")
        return walls[chosen]

    def _holds(self, points: FloatArray) -> BoolArray:
        line = shapely.LineString([self.start, self.end])
        return np.asarray(shapely.dwithin(shapely.points(points), line, _NEAR))


@dataclass(frozen=True)
class Hole:
    """A round hole.

    Attributes
    ----------
    x, y, radius : float, mm
    rim : float, mm
        Width of the ring about it that the optimisation keeps solid.
    """

    x: float
    y: float
    radius: float
    rim: float = 0.0

    def disc(self, more: float = 0.0) -> shapely.Polygon:
        """Area of the hole, wider by `more`, mm: a shapely Polygon."""
        return shapely.Point(self.x, self.y).buffer(self.radius + more, quad_segs=32)


@dataclass(frozen=True)
class DesignPlate:
    """A plate in plane stress, to be optimised.

    Attributes
    ----------
    name, title : str
    border : shapely Polygon, mm
        Without the holes; its box starts at the origin, and its sides lie on whole pixels.
    supports : mapping of patch name to (Stretch, components held)
    load : Stretch
        That a force presses on, down.
    volume_fraction : float in (0, 1]
        Share of the plate that the design fills.
    holes : tuple of Hole
    force : float, N
    mirror : {"", "x", "y"}, default ""
        "x" or "y" where the plate and its load are symmetric along that axis: so is its part then.
    pixel : float, mm, default 1
        Side of a cell of the optimisation.
    radius : float, default 2.5
        Of the filter of the optimisation, in pixels.
    """

    name: str
    title: str
    border: shapely.Polygon
    supports: Mapping[str, tuple[Stretch, str]]
    load: Stretch
    volume_fraction: float
    holes: tuple[Hole, ...] = ()
    force: float = 100.0
    mirror: Literal["", "x", "y"] = ""
    pixel: float = 1.0
    radius: float = 2.5

    def __post_init__(self) -> None:
        freeze(self, supports=dict)
        check_fields(self, "volume_fraction", above=0.0, at_most=1.0)
        check_choices(self)

    @cached_property
    def domain(self) -> shapely.Polygon:
        """The plate with its holes: a shapely Polygon, mm."""
        return self.border.difference(shapely.union_all([hole.disc() for hole in self.holes]))

    @cached_property
    def mask(self) -> BoolArray:
        """Pixels (H, W) with their centre in the plate, row 0 on top."""
        _, _, width, height = self.border.bounds
        rows, columns = np.mgrid[: round(height / self.pixel), : round(width / self.pixel)] + 0.5
        return np.asarray(
            shapely.contains_xy(self.domain, self.pixel * columns, height - self.pixel * rows)
        )

    @cached_property
    def problem(self) -> PlaneProblem:
        """Full plate of the laminate, 1 mm thick, on the pixels."""
        mesh = raster_mesh(self.mask, self.pixel)
        patches = {name: stretch.edges(mesh) for name, (stretch, _) in self.supports.items()}
        return PlaneProblem(
            mesh.with_patches({**patches, "load": self.load.edges(mesh)}),
            LAMINATE,
            1.0,
            tuple(Support(name, held) for name, (_, held) in self.supports.items()),
            {"down": (Force("load", (0.0, -self.force, 0.0)),)},
        )

    @cached_property
    def rims(self) -> BoolArray:
        """Cells (m,) of the problem that stay solid: the rims of the holes."""
        x, y = self.problem.mesh.centres.T
        rims = shapely.union_all([hole.disc(hole.rim) for hole in self.holes if hole.rim > 0.0])
        return np.asarray(shapely.contains_xy(rims, x, y))

    def design(self, iterations: int = 200, progress: Progress = silent) -> Design:
        """Density and material axis of least compliance, by `somp`."""
        return somp(
            self.problem,
            LAMINATE,
            self.volume_fraction,
            radius=self.radius * self.pixel,
            solid=self.rims,
            iterations=iterations,
            progress=progress,
        )

    def outline(self, design: Design) -> shapely.Polygon:
        """Part that a design of this plate stands for: a shapely Polygon, mm."""
        density = np.where(self.rims, 0.0, design.density)
        for hole in self.holes:
            if hole.rim > 0.0:
                # The share of a pixel that the rim covers: its border is round, not of pixels.
                off = np.linalg.norm(self.problem.mesh.centres - (hole.x, hole.y), axis=1)
                beyond = (off - hole.radius - hole.rim) / self.pixel
                density = np.maximum(density, np.clip(0.5 - beyond, 0.0, 1.0))
        if self.mirror:
            density = 0.5 * (density + density[self._mirrored])
        smooth = replace(design, density=density)
        return solid(smooth, self.volume_fraction, domain=self.domain)

    @property
    def _mirrored(self) -> IntArray:
        """Cell (m,) that each cell is the mirror image of."""
        axis = "xy".index(self.mirror)
        centres = np.array(self.problem.mesh.centres)
        centres[:, axis] = self.border.bounds[2 + axis] - centres[:, axis]
        return np.asarray(cKDTree(self.problem.mesh.centres).query(centres)[1])

    @property
    def part(self) -> shapely.Polygon:
        """Optimised part: a shapely Polygon, mm; the stored one where there is one."""
        stored = stored_outline(self.name, self.volume_fraction)
        return self.outline(self.design()) if stored is None else stored

    def mesh(self, polygon: shapely.Polygon, element_size: float, thickness: float) -> TetMesh:
        """Extrude the plate, or a part of it, with patches of supports, load and holes.

        Patch ``bottom`` is the face at z = 0.
        """
        stretches = {name: stretch for name, (stretch, _) in self.supports.items()}
        stretches["load"] = self.load
        ends = [end for each in stretches.values() for end in (each.start, each.end)]
        mesh = extrude(polygon, thickness, element_size, 1, np.array(ends))
        holes = {
            f"hole_{k}": Cylinder((hole.x, hole.y, 0.0), "z", hole.radius, _NEAR)
            for k, hole in enumerate(self.holes, start=1)
            if polygon.distance(hole.disc()) <= _NEAR
        }
        return patches_from_rules(mesh, {**stretches, **holes, "bottom": Plane("z", "min", _NEAR)})


def prepreg_printer() -> Machine:
    """Printer of the prepreg filament, with the speeds of table 2 of the paper.

    Strands 0.9 mm wide, no shorter than 10 mm, and turns of 1.5 mm radius are assumed: the paper
    does not state them.
    """
    return Machine(
        fibre_width=0.9,
        deposited_width=0.9,
        minimum_length=10.0,
        minimum_radius=1.5,
        speeds=SpeedTable(),
    )


def case_of(plate: Callable[..., DesignPlate], title: str) -> Callable[..., Case]:
    """Make the case of a plate: a function of the parameters that all of them share.

    Parameters
    ----------
    plate : callable
        Makes the plate, of its `force`.
    title : str
        What it is, for the list of cases.
    """

    def case(
        optimised: bool = True,
        element_size: float = ELEMENT_SIZE,
        order: int = 1,
        force: float = 100.0,
        thickness: float = THICKNESS,
    ) -> Case:
        return designed_case(plate(force=force), optimised, element_size, order, thickness)

    case.__doc__ = f"""{title}: optimised, or the full plate.

    It is printed of plain matrix, so that the virtual test adds the fibre, and stands on its face
    at z = 0 without friction, so that it stays plane.

    Parameters
    ----------
    optimised : bool, default True
        Whether to take the optimised part, or the full plate.
    element_size : float, mm
        Edge length of the cells aimed at.
    order : {{1, 2}}
        Linear or quadratic cells.
    force : float, N
    thickness : float, mm
    """
    return case


def designed_case(
    plate: DesignPlate,
    optimised: bool = True,
    element_size: float = ELEMENT_SIZE,
    order: int = 1,
    thickness: float = THICKNESS,
) -> Case:
    """Make the case of one plate; parameters as those of the functions that `case_of` makes."""
    polygon = None if optimised else plate.domain
    key = plate.name if optimised and thickness == THICKNESS else ""

    def make(size: float) -> TetMesh:
        return plate.mesh(plate.part if polygon is None else polygon, size, thickness)

    problem = Problem(
        mesh_of_case(key, element_size, order, make),
        printed_pla(),
        (
            *(Support(name, held) for name, (_, held) in plate.supports.items()),
            Support("bottom", "z"),
        ),
        {"down": (Force("load", (0.0, -plate.force, 0.0)),)},
    )
    what = "optimised" if optimised else "full plate"
    return Case(
        name=plate.name,
        title=f"{plate.title}, {what}",
        problem=problem,
        layers=_LAYERS,
        machine=prepreg_printer(),
        source=f"{SOURCE}: size and loading; what it does not state is assumed",
    )
