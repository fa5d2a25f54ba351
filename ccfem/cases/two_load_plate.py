"""A plate with a round hole that is pulled, or sheared: one print for both."""

import shapely

from ccfem.body.mesh.patches import PatchRule, Plane, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.case import Case
from ccfem.fem.elasticity.load_kinds import Load
from ccfem.fem.elasticity.problem import Force, Order, Problem, Support
from ccfem.fem.materials import printed_pla
from ccfem.slicing.slicers.planar import Planar

ELEMENT_SIZE = 1.5
LENGTH, WIDTH, THICKNESS = 120.0, 36.0, 4.0
RADIUS = 6.0


def two_load_plate_mesh(element_size: float) -> TetMesh:
    """Mesh of the plate with patches support (left end), load (right end), bottom and top."""
    plate = shapely.box(-0.5 * LENGTH, -0.5 * WIDTH, 0.5 * LENGTH, 0.5 * WIDTH)
    outline = plate.difference(shapely.Point(0.0, 0.0).buffer(RADIUS, quad_segs=32))
    rules: dict[str, PatchRule] = {
        "support": Plane("x", "min"),
        "load": Plane("x", "max"),
        "bottom": Plane("y", "min"),
        "top": Plane("y", "max"),
    }
    return patches_from_rules(extrude(outline, THICKNESS, element_size), rules)


def _shear(force: float) -> tuple[Load, ...]:
    """Uniform shear of the edges that are not held, with so much force, N, on the right end."""
    along = force * LENGTH / WIDTH
    return (
        Force("load", (0.0, force, 0.0)),
        Force("top", (along, 0.0, 0.0)),
        Force("bottom", (-along, 0.0, 0.0)),
    )


def two_load_plate(
    element_size: float = ELEMENT_SIZE,
    order: Order = 1,
    force: float = 1000.0,
    both_ways: bool = False,
) -> Case:
    """Plate 120 x 36 x 4 mm with a hole of radius 6 mm, held left; pulled or sheared right.

    Its load cases are meant to be planned for at once (``--load-case all``).

    Parameters
    ----------
    element_size : float, mm
        Target edge length.
    order : 1, 2 or "auto"
        As in `ccfem.cases.bar`.
    force : float, N
        On the right end: along x in the load case "tension", along y in "shear", in which the
        long edges are sheared as much.
    both_ways : bool, default False
        Whether there is a third load case, "shear_back", the other way.
    """
    loads: dict[str, tuple[Load, ...]] = {
        "tension": (Force("load", (force, 0.0, 0.0)),),
        "shear": _shear(force),
    }
    if both_ways:
        loads["shear_back"] = _shear(-force)
    mesh = two_load_plate_mesh(element_size)
    mesh = mesh.quadratic() if order == 2 else mesh
    return Case(
        name="two_load_plate",
        title="Plate 120 x 36 x 4 mm with a hole of radius 6 mm, in tension or in shear",
        problem=Problem(mesh, printed_pla(), (Support("support"),), loads, order=order),
        slicing=Planar(count=8),
        source="ours, for planning with several load cases",
    )
