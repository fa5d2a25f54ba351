"""A flat bracket with two bolt holes and a pin that pulls at two angles: one print for both."""

import numpy as np
import shapely

from ccfem.body.mesh.patches import Cylinder, PatchRule, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.case import Case
from ccfem.fem.elasticity.problem import Bearing, Order, Problem, Support
from ccfem.fem.materials import printed_pla
from ccfem.slicing.slicers.planar import Planar

ELEMENT_SIZE = 2.0
BOLTS, PIN = ((0.0, 0.0), (0.0, 56.0)), (95.0, 22.0)
HOLE_RADIUS, RIM, THICKNESS = 4.0, 10.0, 6.0
ANGLE = 30.0
"""Between each load and x, degrees."""


def two_angle_bracket_mesh(element_size: float) -> TetMesh:
    """Mesh of the bracket with patches bolt_1, bolt_2 and pin: the walls of its holes."""
    centres = [*BOLTS, PIN]
    bosses = [shapely.Point(*each).buffer(RIM, quad_segs=32) for each in centres]
    holes = [shapely.Point(*each).buffer(HOLE_RADIUS, quad_segs=16) for each in centres]
    outline = shapely.union_all(bosses).convex_hull.difference(shapely.union_all(holes))
    rules: dict[str, PatchRule] = {
        name: Cylinder((x, y, 0.0), "z", HOLE_RADIUS)
        for name, (x, y) in zip(("bolt_1", "bolt_2", "pin"), centres, strict=True)
    }
    return patches_from_rules(extrude(outline, THICKNESS, element_size), rules)


def two_angle_bracket(
    element_size: float = ELEMENT_SIZE, order: Order = 1, force: float = 500.0
) -> Case:
    """Flat bracket, 115 x 76 x 6 mm, held at two bolt holes; a pin pulls at two angles.

    Its load cases are meant to be planned for at once (``--load-case all``).

    Parameters
    ----------
    element_size : float, mm
        Target edge length.
    order : 1, 2 or "auto"
        As in `ccfem.cases.bar`.
    force : float, N
        On the pin, in either load case.
    """
    mesh = two_angle_bracket_mesh(element_size)
    mesh = mesh.quadratic() if order == 2 else mesh
    x, y = force * np.cos(np.radians(ANGLE)), force * np.sin(np.radians(ANGLE))
    loads = {
        "up": (Bearing("pin", (float(x), float(y), 0.0)),),
        "down": (Bearing("pin", (float(x), float(-y), 0.0)),),
    }
    supports = (Support("bolt_1"), Support("bolt_2"))
    return Case(
        name="two_angle_bracket",
        title="Flat bracket with two bolts and a pin that pulls at 30 degrees up or down",
        problem=Problem(mesh, printed_pla(), supports, loads, order=order),
        slicing=Planar(count=8),
        source="ours, for planning with several load cases",
    )
