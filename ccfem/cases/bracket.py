"""A bracket with four bolt holes, as topology optimisation in space shapes it."""

from dataclasses import replace

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray
from ccfem.base.progress import Progress, silent
from ccfem.body.mesh.patches import Cylinder, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.case import Case
from ccfem.cases.stored import mesh_of_case
from ccfem.fem.elasticity.problem import Bearing, Force, Order, Problem, Support
from ccfem.fem.materials import printed_pla
from ccfem.fem.topopt import Design, as_problem
from ccfem.fem.topopt.solid_design import solid_design

ELEMENT_SIZE = 1.75
HOLES = {
    "hole_1": (5.5, 45.0),
    "hole_2": (15.5, 45.0),
    "hole_3": (45.0, 15.5),
    "hole_4": (45.0, 5.5),
}
"""Centres of the bolt holes, mm: the first two are held, the others loaded."""
HOLE_RADIUS = 3.0
RIM = 2.0
"""Width of the rings about the holes that stay solid, mm."""
SIDE, LEG, HEIGHT = 52.0, 21.0, 27.0
VOLUME_FRACTION = 0.3
FORCE = 500.0
"""Of the load case "down", on both loaded holes together, N."""


def bracket_outline() -> shapely.Polygon:
    """Planform of the design domain: an L of 52 x 52 mm with legs 21 mm wide and four holes."""
    corner = shapely.box(LEG, LEG, SIDE, SIDE)
    holes = [shapely.Point(x, y).buffer(HOLE_RADIUS, quad_segs=16) for x, y in HOLES.values()]
    return shapely.box(0.0, 0.0, SIDE, SIDE).difference(shapely.union_all([corner, *holes]))


def bracket_domain(element_size: float) -> TetMesh:
    """Mesh of the design domain with patches hole_1 to hole_4: the walls of the holes."""
    rules = {name: Cylinder((x, y, 0.0), "z", HOLE_RADIUS) for name, (x, y) in HOLES.items()}
    return patches_from_rules(extrude(bracket_outline(), HEIGHT, element_size), rules)


def _problem(mesh: TetMesh, force: float) -> Problem:
    loaded = ("hole_3", "hole_4")
    return Problem(
        mesh,
        printed_pla(),
        (Support("hole_1"), Support("hole_2")),
        {
            "down": tuple(Bearing(name, (0.0, -0.5 * force, 0.0)) for name in loaded),
            "side": tuple(Force(name, (0.0, 0.0, 0.2 * force)) for name in loaded),
        },
    )


def _rims(mesh: TetMesh) -> BoolArray:
    """Cells (m,) in the rings about the holes."""
    centre = mesh.points[mesh.cells].mean(axis=1)[:, None, :2]
    distance = np.linalg.norm(centre - np.array(list(HOLES.values())), axis=2)
    return np.asarray((distance <= HOLE_RADIUS + RIM).any(axis=1))


def bracket_design(
    element_size: float = ELEMENT_SIZE, max_iterations: int = 150, progress: Progress = silent
) -> Design:
    """Densities of least compliance of both load cases together, 30 % of the domain filled.

    The iterations stop earlier when the compliance no longer changes.
    """
    problem = _problem(bracket_domain(element_size), FORCE)
    rims = _rims(problem.mesh)
    return solid_design(problem, VOLUME_FRACTION, element_size, rims, max_iterations, progress)


def bracket_mesh(element_size: float) -> TetMesh:
    """Mesh of the optimised part, with the patches of the domain; takes a minute or two."""
    return as_problem(bracket_design(element_size), printed_pla()).mesh


def bracket(
    optimised: bool = True,
    element_size: float = ELEMENT_SIZE,
    order: Order = 1,
    force: float = FORCE,
) -> Case:
    """Bracket of 52 x 52 x 27 mm with four bolt holes: optimised, or the full L.

    The size, and the four holes, are those of the optimised bracket of Kipping and Schueppstuhl,
    Materials 16 (2023) 998; its geometry, loads and supports are not stated there. Here it is the
    L of many papers: two legs 21 mm wide, with two holes of radius 3 mm side by side near either
    end, all along z. One pair is bolted down; the other is pressed down (y) by bolts in one load
    case, and pulled sideways (z) with 0.4 of the force in another.

    Parameters
    ----------
    optimised : bool, default True
        Whether to take the optimised part, or the full domain. The part is stored for the default
        element size; any other takes a new optimisation.
    element_size : float, mm
        Edge length of the cells of the domain.
    order : 1, 2 or "auto"
        Linear or quadratic cells, or what their estimated error calls for.
    force : float, N
        Of the load case "down", on both holes together.
    """
    if optimised:
        mesh = mesh_of_case("bracket", element_size, order, bracket_mesh)
    else:
        mesh = bracket_domain(element_size)
        mesh = mesh.quadratic() if order == 2 else mesh
    return Case(
        name="bracket",
        title="Bracket 52 x 52 x 27 mm with four bolt holes"
        + (", optimised" if optimised else ": the design domain"),
        problem=replace(_problem(mesh, force), order=order),
        source="size and number of holes of the optimised bracket of Kipping and Schueppstuhl, "
        "Materials 16 (2023) 998; L, loads and supports of our choice",
    )
