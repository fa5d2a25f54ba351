"""A tensile bar: of the size of the bar of Chen et al. 2021."""

import shapely

from ccfem.body.mesh.patches import Plane, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.case import Case, pulled
from ccfem.cases.stored import mesh_of_case
from ccfem.fem.elasticity.problem import Order
from ccfem.slicing.slicers.planar import Planar

ELEMENT_SIZE = 1.5
LENGTH, WIDTH, THICKNESS = 125.0, 25.0, 5.0
GAUGE_LENGTH, GAUGE_WIDTH = 40.0, 8.0
SHOULDER = 8.0
"""Radius of the quarter circles from the gauge to the grips, mm."""


def bar_outline() -> shapely.Polygon:
    """Planform of the bar: 125 mm long, 25 mm wide, 8 mm wide in the gauge."""
    end, half, slim = 0.5 * LENGTH, 0.5 * WIDTH, 0.5 * GAUGE_WIDTH
    start = 0.5 * GAUGE_LENGTH + SHOULDER
    grips = [shapely.box(-end, -half, -start, half), shapely.box(start, -half, end, half)]
    body = shapely.union_all([shapely.box(-end, -slim, end, slim), *grips])
    body = body.buffer(SHOULDER, join_style="mitre").buffer(-SHOULDER, quad_segs=32)
    return shapely.remove_repeated_points(body, 1e-3)


def bar_mesh(element_size: float) -> TetMesh:
    """Mesh of the bar with patches support (the left end) and load (the right end)."""
    rules = {"support": Plane("x", "min"), "load": Plane("x", "max")}
    return patches_from_rules(extrude(bar_outline(), THICKNESS, element_size), rules)


def bar(element_size: float = ELEMENT_SIZE, order: Order = 1, force: float = 1000.0) -> Case:
    """Tensile bar, 125 x 25 x 5 mm, held at its left end and pulled at its right end along x.

    Parameters
    ----------
    element_size : float, mm
        Edge length of the cells aimed at.
    order : 1, 2 or "auto"
        Linear or quadratic cells, or what their estimated error calls for.
    force : float, N
    """
    mesh = mesh_of_case("bar", element_size, order, bar_mesh)
    return Case(
        name="bar",
        title="Tensile bar, 125 x 25 x 5 mm, pulled at its ends",
        problem=pulled(mesh, (force, 0.0, 0.0), order),
        slicing=Planar(count=10),
        source="size of the tensile bar of Chen et al. 2021 (Additive Manufacturing 49, 102470); "
        "own outline of lines and quarter circles",
    )
