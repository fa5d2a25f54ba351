"""A plate that topology optimisation designs: its problem, its design, and the part of that."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, IntArray, freeze
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.progress import Progress, silent
from ccfem.body.mesh.patches import Cylinder, Plane, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.designed.border import NEAR, Hole, Stretch
from ccfem.cases.stored.stored_files import stored_outline
from ccfem.fem.elasticity.problem import Force, Support
from ccfem.fem.materials import plane_stress
from ccfem.fem.plates import PlaneProblem, raster_mesh
from ccfem.fem.topopt import Design, Somp, part_shape

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
    holes : tuple of Hole
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
            density = 0.5 * (density + density[self._mirrored])
        smooth = replace(design, density=density)
        return part_shape(smooth, self.volume_fraction, domain=self.domain)

    @property
    def _mirrored(self) -> IntArray:
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
        ends = [end for each in stretches.values() for end in (each.start, each.end)]
        mesh = extrude(polygon, thickness, element_size, 1, np.array(ends))
        holes = {
            f"hole_{k}": Cylinder((hole.x, hole.y, 0.0), "z", hole.radius, NEAR)
            for k, hole in enumerate(self.holes, start=1)
            if polygon.distance(hole.disc()) <= NEAR
        }
        return patches_from_rules(mesh, {**stretches, **holes, "bottom": Plane("z", "min", NEAR)})
