"""A plate with a round hole in tension: the open-hole test of laminates."""

import shapely

from ccfem.cases.case import Case
from ccfem.cases.stored import mesh_of_case
from ccfem.elasticity.problem import Force, Order, Problem, Support
from ccfem.layers.slicing.planar import Planar
from ccfem.materials import printed_pla
from ccfem.mesh.patches import Cylinder, PatchRule, Plane, patches_from_rules
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.meshing import extrude

__all__ = ["open_hole", "open_hole_mesh", "open_hole_outline"]

ELEMENT_SIZE = 2.0
RADIUS = 6.0
THICKNESS = 4.0


def open_hole_outline(
    length: float = 200.0, width: float = 36.0, radius: float = RADIUS
) -> shapely.Polygon:
    """Planform of the plate, mm, the hole in its middle: a shapely Polygon."""
    plate = shapely.box(-0.5 * length, -0.5 * width, 0.5 * length, 0.5 * width)
    return plate.difference(shapely.Point(0.0, 0.0).buffer(radius, quad_segs=32))


def open_hole_mesh(element_size: float) -> TetMesh:
    """Mesh of the plate with patches support (left end), load (right end) and hole."""
    rules: dict[str, PatchRule] = {
        "support": Plane("x", "min"),
        "load": Plane("x", "max"),
        "hole": Cylinder((0.0, 0.0, 0.0), "z", RADIUS),
    }
    return patches_from_rules(extrude(open_hole_outline(), THICKNESS, element_size), rules)


def open_hole(element_size: float = ELEMENT_SIZE, order: Order = 1, force: float = 1000.0) -> Case:
    """Plate 200 x 36 x 4 mm with a hole of radius 6 mm, held left and pulled right along x.

    Parameters
    ----------
    element_size : float, mm
        Edge length of the cells aimed at; shorter at the hole.
    order : 1, 2 or "auto"
        Linear or quadratic cells, or what their estimated error calls for.
    force : float, N
    """
    problem = Problem(
        mesh_of_case("open_hole", element_size, order, open_hole_mesh),
        printed_pla(),
        (Support("support"),),
        {"pull": (Force("load", (force, 0.0, 0.0)),)},
        order=order,
    )
    return Case(
        name="open_hole",
        title="Plate 200 x 36 x 4 mm with a hole of radius 6 mm, in tension",
        problem=problem,
        slicing=Planar(count=8),
        source="open-hole tension of laminates; the plate of ASTM D5766 with a hole twice as wide",
    )
