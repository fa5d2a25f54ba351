"""Plates that topology optimisation designs: the parts of Wang et al. 2021.

A plate is given by its border, holes, supports and load. From these come the problem that is
optimised, the part that the optimum stands for, and the case of either part.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.errors import InputError
from ccfem.base.progress import Progress, silent
from ccfem.body.mesh.patches import Bounded, Cylinder, Plane, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.case import Case
from ccfem.cases.stored import stored_mesh, stored_outline
from ccfem.fem.elasticity.problem import Force, Order, Problem, Support
from ccfem.fem.materials import plane_stress, printed_pla
from ccfem.fem.plates import PlaneMesh, PlaneProblem, raster_mesh
from ccfem.fem.topopt import Design, Somp, part_shape
from ccfem.machine.machine import Machine
from ccfem.machine.speeds import SpeedTable
from ccfem.slicing.slicers.planar import Planar

NEAR = 1e-6
"""How far a node may lie from the line that it is on, mm."""


@dataclass(frozen=True)
class Stretch:
    """A straight stretch of the border of a plate, between two points (x, y), mm."""

    start: tuple[float, float]
    end: tuple[float, float]

    def edges(self, mesh: PlaneMesh) -> IntArray:
        """Boundary edges (k, 2) of a plane mesh with their middles on it."""
        middles = mesh.points[mesh.boundary].mean(axis=1)
        return mesh.boundary[self._contains(middles)]

    def __call__(self, mesh: Bounded) -> IntArray:
        """Walls (k, 3) of an extruded plate with all their nodes on it."""
        _, normal = mesh.facet_areas(mesh.boundary)
        walls = mesh.boundary[np.abs(normal[:, 2]) < 0.5]
        chosen = self._contains(mesh.points[walls][..., :2]).all(axis=1)
        if not chosen.any():
            raise InputError(f"no wall of the part lies between {self.start} and {self.end} mm")
        return walls[chosen]

    def _contains(self, points: FloatArray) -> BoolArray:
        line = shapely.LineString([self.start, self.end])
        return np.asarray(shapely.dwithin(shapely.points(points), line, NEAR))


@dataclass(frozen=True)
class Hole:
    """A round hole."""

    # mm
    x: float
    y: float
    radius: float
    rim: float = 0.0  # mm: width of the ring about it that the optimisation keeps solid

    def disc(self, more: float = 0.0) -> Any:
        """Area of the hole, wider by `more`, mm: a shapely Polygon."""
        return shapely.Point(self.x, self.y).buffer(self.radius + more, quad_segs=32)


LAMINATE = plane_stress(18300.0, 19800.0, 0.17, 5150.0)
"""Stiffness of the laminate of Wang et al. 2021, MPa; Poisson's ratio 21 follows from the moduli.
"""


@dataclass(frozen=True)
class DesignPlate:
    """A plate in plane stress, to be optimised.

    Attributes
    ----------
    border : shapely Polygon, mm
        Without the holes; its box starts at the origin, and its sides lie on whole pixels.
    supports : mapping of patch name to (Stretch, components held)
    load : Stretch
        That a force presses on, down.
    volume_fraction : float in (0, 1]
        Share of the plate that the design fills.
    force : float, N
    mirror : str, default ""
        "x" or "y" where the plate and its load are symmetric along that axis: its part is then
        made symmetric too.
    pixel : float, mm, default 1
        Side of a cell of the optimisation.
    radius : float, default 2.5
        Of the filter of the optimisation, in pixels.
    """

    name: str
    title: str
    border: Any
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
    def domain(self) -> Any:
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

    def design(self, max_iterations: int = 200, progress: Progress = silent) -> Design:
        """Density and material axis of least compliance, by `Somp`."""
        method = Somp(
            self.volume_fraction, radius=self.radius * self.pixel, max_iterations=max_iterations
        )
        return method(self.problem, LAMINATE, solid=self.rims, progress=progress)

    def outline(self, design: Design) -> Any:
        """Part that a design of this plate stands for: a shapely Polygon, mm."""
        density = np.where(self.rims, 0.0, design.density)
        for hole in self.holes:
            if hole.rim > 0.0:
                # The share of a pixel that the rim covers: its border is round, not of pixels.
                off = np.linalg.norm(self.problem.mesh.centres - (hole.x, hole.y), axis=1)
                beyond = (off - hole.radius - hole.rim) / self.pixel
                density = np.maximum(density, np.clip(0.5 - beyond, 0.0, 1.0))
        if self.mirror:
            density = 0.5 * (density + density[self._mirror_images])
        smooth = replace(design, density=density)
        return part_shape(smooth, self.volume_fraction, domain=self.domain)

    @property
    def _mirror_images(self) -> IntArray:
        """Cell (m,) that each cell is the mirror image of."""
        axis = "xy".index(self.mirror)
        centres = np.array(self.problem.mesh.centres)
        centres[:, axis] = self.border.bounds[2 + axis] - centres[:, axis]
        return np.asarray(cKDTree(self.problem.mesh.centres).query(centres)[1])

    @property
    def part(self) -> Any:
        """Optimised part: a shapely Polygon, mm; the stored one where there is one."""
        stored = stored_outline(self.name, self.volume_fraction)
        return self.outline(self.design()) if stored is None else stored

    def mesh(self, polygon: Any, element_size: float, thickness: float) -> TetMesh:
        """Extrude the plate, or a part of it, with patches of supports, load and holes.

        Patch ``bottom`` is the face at z = 0.
        """
        stretches = {name: stretch for name, (stretch, _) in self.supports.items()}
        stretches["load"] = self.load
        ends = [end for stretch in stretches.values() for end in (stretch.start, stretch.end)]
        mesh = extrude(polygon, thickness, element_size, 1, np.array(ends))
        holes = {
            f"hole_{k}": Cylinder((hole.x, hole.y, 0.0), "z", hole.radius, NEAR)
            for k, hole in enumerate(self.holes, start=1)
            if polygon.distance(hole.disc()) <= NEAR
        }
        return patches_from_rules(mesh, {**stretches, **holes, "bottom": Plane("z", "min", NEAR)})


PLATES = {
    plate.name: plate
    for plate in (
        DesignPlate(
            name="bridge",
            title="Bridge 185 x 50 mm, pressed down at the middle of its top",
            border=shapely.box(0.0, 0.0, 185.0, 50.0),
            supports={
                "support_left": (Stretch((0.0, 0.0), (5.0, 0.0)), "xy"),
                "support_right": (Stretch((180.0, 0.0), (185.0, 0.0)), "y"),
            },
            load=Stretch((90.0, 50.0), (95.0, 50.0)),
            volume_fraction=0.4,
            mirror="x",
        ),
        DesignPlate(
            name="suspension",
            title="Suspension 175 x 126 mm with two holes, pressed down on its arm",
            border=shapely.union(
                shapely.box(0.0, 0.0, 60.0, 126.0), shapely.box(0.0, 90.0, 175.0, 126.0)
            ),
            supports={"support": (Stretch((0.0, 0.0), (60.0, 0.0)), "xy")},
            load=Stretch((170.0, 126.0), (175.0, 126.0)),
            volume_fraction=0.4,
            holes=(Hole(30.0, 25.0, 8.0), Hole(150.0, 108.0, 8.0, rim=3.0)),
            radius=3.0,
        ),
        DesignPlate(
            name="cantilever",
            title="Cantilever 120 x 60 mm, fixed on its left, loaded on its right",
            border=shapely.box(0.0, 0.0, 120.0, 60.0),
            supports={"support": (Stretch((0.0, 0.0), (0.0, 60.0)), "xy")},
            load=Stretch((120.0, 28.0), (120.0, 32.0)),
            volume_fraction=0.5,
            mirror="y",
        ),
        # An arch is pressed, and what hangs from it is pulled: both families of figure 15.
        DesignPlate(
            name="m_shape",
            title="M-shape 120 x 60 mm, pulled down at the middle of its bottom",
            border=shapely.box(0.0, 0.0, 120.0, 60.0),
            supports={
                "support_left": (Stretch((0.0, 0.0), (5.0, 0.0)), "xy"),
                "support_right": (Stretch((115.0, 0.0), (120.0, 0.0)), "xy"),
            },
            load=Stretch((58.0, 0.0), (62.0, 0.0)),
            volume_fraction=0.3,
            mirror="x",
        ),
        DesignPlate(
            name="l_shape",
            title="L-shape 100 x 100 mm, fixed at its top, loaded on its right",
            border=shapely.box(0.0, 0.0, 100.0, 100.0).difference(
                shapely.box(40.0, 40.0, 100.0, 100.0)
            ),
            supports={"support": (Stretch((0.0, 100.0), (40.0, 100.0)), "xy")},
            load=Stretch((100.0, 18.0), (100.0, 22.0)),
            volume_fraction=0.4,
        ),
    )
}
"""Plates of the paper by name; their measures are ours but for those of the first two."""

# Cases of the plates, printed of prepreg filament as the parts of the paper.

ELEMENT_SIZE = 1.2
THICKNESS = 1.0
"""Of the plates, mm; that of the printed parts is not stated."""


def designed_case(
    plate: DesignPlate,
    optimised: bool = True,
    element_size: float = ELEMENT_SIZE,
    order: Order = 1,
    thickness: float = THICKNESS,
) -> Case:
    """Make the case of one plate, loaded by its force.

    It is printed of plain matrix, so that the virtual test adds the fibre, and stands on its face
    at z = 0 without friction, so that it stays plane. The machine has the speeds of table 2 of the
    paper; strands 0.9 mm wide, no shorter than 10 mm, and turns of 1.5 mm radius are assumed, since
    the paper does not state them.

    Parameters
    ----------
    optimised : bool, default True
        Whether to take the optimised part, or the full plate.
    element_size : float, mm
        Edge length of the cells aimed at.
    order : int or str
        Linear or quadratic cells, or what their estimated error calls for.
    thickness : float, mm
    """
    stored = optimised and thickness == THICKNESS
    mesh = stored_mesh(plate.name, element_size) if stored else None
    if mesh is None:
        mesh = plate.mesh(plate.part if optimised else plate.domain, element_size, thickness)
    held = [Support(name, components) for name, (_, components) in plate.supports.items()]
    return Case(
        name=plate.name,
        title=f"{plate.title}, {'optimised' if optimised else 'full plate'}",
        problem=Problem(
            mesh.quadratic() if order == 2 else mesh,
            printed_pla(),
            (*held, Support("bottom", "z")),
            {"down": (Force("load", (0.0, -plate.force, 0.0)),)},
            order=order,
        ),
        slicing=Planar(count=2),
        machine=Machine(
            fibre_width=0.9, minimum_length=10.0, minimum_radius=1.5, speeds=SpeedTable()
        ),
        source="Wang et al. 2021 (Composites Part A 140, 106181): size and loading; what it does "
        "not state is assumed",
    )


def maker_of(plate: DesignPlate) -> Callable[..., Case]:
    """Return a function of a force and the parameters of `designed_case` that makes a case."""

    def make(
        optimised: bool = True,
        element_size: float = ELEMENT_SIZE,
        order: Order = 1,
        force: float = 100.0,
        thickness: float = THICKNESS,
    ) -> Case:
        return designed_case(replace(plate, force=force), optimised, element_size, order, thickness)

    _, _, parameters = (designed_case.__doc__ or "").partition("    Parameters\n")
    make.__doc__ = (
        f"{plate.title}: optimised, or the full plate.\n\n    Parameters\n{parameters}"
        "force : float, N\n        Of the load, down.\n    "
    )
    return make
