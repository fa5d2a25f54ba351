"""A corner bracket on four feet, as topology optimisation shapes it: Kipping and Schueppstuhl."""

from dataclasses import replace

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray
from ccfem.base.progress import Progress, silent
from ccfem.body.mesh.patches import Cylinder
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.case import Case
from ccfem.cases.crossed import crossed_mesh
from ccfem.cases.stored import mesh_of_case
from ccfem.fem.elasticity.problem import Bearing, Order, Problem, Support
from ccfem.fem.materials import printed_pla
from ccfem.fem.topopt import Design, as_problem
from ccfem.fem.topopt.solid_design import solid_design
from ccfem.machine.machine import Machine
from ccfem.slicing.slicers.load_oriented import LoadOriented

ELEMENT_SIZE = 1.5
VOLUME_FRACTION = 0.25
_HALF, _FOOT, HEIGHT = 26.0, 6.0, 27.0
"""Half of the side, height of the feet, and height, mm."""
_SHOULDER, _TOP = 17.5, 10.0
"""Half of the width just above the feet, and at the top, mm."""
_BOLT, _BOLT_RADIUS = 20.5, 2.75
_AXLE, _AXLE_RADIUS = 20.0, 4.0
"""Height of the loaded hole, and its radius, mm."""
_RIM = 2.0
"""Width of the rings about the holes that stay solid, mm."""
HOLES = {
    **{
        f"foot_{k + 1}": Cylinder((x * _BOLT, y * _BOLT, 0.0), "z", _BOLT_RADIUS)
        for k, (x, y) in enumerate([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    },
    "upper": Cylinder((0.0, 0.0, _AXLE), "x", _AXLE_RADIUS),
}
"""Patches: the walls of the holes."""


def corner_bracket_outlines() -> dict[str, shapely.Polygon]:
    """Outlines of the design domain: a square with four holes, and a hat, one with a hole."""
    right = [(_HALF, 0.0), (_HALF, _FOOT), (_SHOULDER, _FOOT), (_TOP, HEIGHT)]
    hat = shapely.Polygon([*right, *((-x, z) for x, z in reversed(right))])
    feet = [
        shapely.Point(*HOLES[f"foot_{k}"].point[:2]).buffer(_BOLT_RADIUS, quad_segs=12)
        for k in range(1, 5)
    ]
    axle = shapely.Point(0.0, _AXLE).buffer(_AXLE_RADIUS, quad_segs=12)
    square = shapely.box(-_HALF, -_HALF, _HALF, _HALF)
    return {"z": square.difference(shapely.union_all(feet)), "y": hat, "x": hat.difference(axle)}


def corner_bracket_domain(element_size: float) -> TetMesh:
    """Mesh of the design domain with the patches of the holes; takes minutes."""
    return crossed_mesh(corner_bracket_outlines(), element_size, HOLES)


def _problem(mesh: TetMesh, force: float) -> Problem:
    held = tuple(Support(f"foot_{k}") for k in range(1, 5))
    return Problem(mesh, printed_pla(), held, {"lift": (Bearing("upper", (0.0, 0.0, force)),)})


def _rims(mesh: TetMesh) -> BoolArray:
    """Cells (m,) in the rings about the holes: about the loaded one within the width of the top."""
    x, y, z = mesh.points[mesh.cells].mean(axis=1).T
    bolt = np.hypot(np.abs(x) - _BOLT, np.abs(y) - _BOLT) <= _BOLT_RADIUS + _RIM
    axle = (np.hypot(y, z - _AXLE) <= _AXLE_RADIUS + _RIM) & (np.abs(x) <= 0.5 * _TOP)
    return np.asarray((bolt & (z <= _FOOT)) | axle)


def corner_bracket_design(
    element_size: float = ELEMENT_SIZE, max_iterations: int = 100, progress: Progress = silent
) -> Design:
    """Densities of least compliance, a share of the domain filled."""
    problem = _problem(corner_bracket_domain(element_size), 100.0)
    rims = _rims(problem.mesh)
    return solid_design(problem, VOLUME_FRACTION, element_size, rims, max_iterations, progress)


def corner_bracket_mesh(element_size: float) -> TetMesh:
    """Mesh of the optimised part, with the patches of the domain; takes minutes."""
    return as_problem(corner_bracket_design(element_size), printed_pla()).mesh


def corner_bracket(
    element_size: float = ELEMENT_SIZE, order: Order = 1, force: float = 100.0
) -> Case:
    """Corner bracket of 52 x 52 x 27 mm: four feet bolted down, an axle pulled up.

    Size, four holes and the pull are those of part A of Kipping and Schueppstuhl, Materials 16
    (2023) 998, which was optimised too; its domain is not stated there, and ours.

    Parameters
    ----------
    element_size : float, mm
        Of the design domain. The part is stored for the default; any other is optimised anew,
        which takes minutes.
    order : 1, 2 or "auto"
        Linear or quadratic cells, or what their estimated error calls for.
    force : float, N
        On the upper hole, upwards.
    """
    mesh = mesh_of_case("corner_bracket", element_size, order, corner_bracket_mesh)
    return Case(
        name="corner_bracket",
        title="Corner bracket 52 x 52 x 27 mm on four feet, optimised",
        problem=replace(_problem(mesh, force), order=order),
        slicing=LoadOriented(),
        machine=Machine(fibre_width=0.9),
        source="size, holes and load of part A of Kipping and Schueppstuhl, Materials 16 (2023) "
        "998; design domain of our choice",
    )
