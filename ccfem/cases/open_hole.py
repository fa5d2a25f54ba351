"""A plate with a round hole in tension: the open-hole test of laminates."""

import shapely

from ccfem.body.mesh.patches import Cylinder, PatchRule, Plane, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.case import Case, pulled
from ccfem.cases.stored import mesh_of_case
from ccfem.fem.elasticity.problem import Order
from ccfem.slicing.slicers.planar import Planar

ELEMENT_SIZE = 2.0
LENGTH, WIDTH, THICKNESS = 200.0, 36.0, 4.0
RADIUS = 6.0


def open_hole_outline() -> shapely.Polygon:
    """Planform of the plate, mm, with the hole in its middle."""
    plate = shapely.box(-0.5 * LENGTH, -0.5 * WIDTH, 0.5 * LENGTH, 0.5 * WIDTH)
    return plate.difference(shapely.Point(0.0, 0.0).buffer(RADIUS, quad_segs=32))


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

    Parameters as in `ccfem.cases.bar`; the cells are shorter at the hole.
    """
    mesh = mesh_of_case("open_hole", element_size, order, open_hole_mesh)
    return Case(
        name="open_hole",
        title="Plate 200 x 36 x 4 mm with a hole of radius 6 mm, in tension",
        problem=pulled(mesh, (force, 0.0, 0.0), order),
        slicing=Planar(count=8),
        source="open-hole tension of laminates; the plate of ASTM D5766 with a hole twice as wide",
    )
