"""The ring with two lugs, pulled along its length or across: one print for both."""

from dataclasses import replace
from math import inf

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.body.mesh.patches import Box, Cylinder, PatchRule, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.case import Case, pulled
from ccfem.cases.stored import mesh_of_case
from ccfem.fem.elasticity.problem import Force, Order
from ccfem.slicing.slicers.planar import Planar

# A ring with two lugs, pulled at the holes: of the size of the Loop of Chen et al. 2021.


ELEMENT_SIZE = 2.4
HOLE = 50.0
"""Distance of the holes' centres from the middle of the ring, mm."""
HOLE_RADIUS = 5.0
RING_RADIUS, RING_WIDTH, LUG_RADIUS = 50.0, 20.0, 20.0
"""Outer radius and width of the ring, and radius of the lugs round the holes, mm."""
THICKNESS = 10.0


def loop_outline(fillet: float = 10.0) -> shapely.Polygon:
    """Planform of the loop, 100 mm wide and 140 mm long.

    Parameters
    ----------
    fillet : float, mm
        Radius where a lug meets the ring.
    """
    # The fillet's circle touches the ring's and the lug's from outside.
    y = ((RING_RADIUS + fillet) ** 2 - (LUG_RADIUS + fillet) ** 2 + HOLE**2) / (2.0 * HOLE)
    x = np.sqrt((RING_RADIUS + fillet) ** 2 - y**2)
    low, high = np.arctan2(y, x), np.arctan2(HOLE - y, x)
    quarter = np.concatenate(
        [
            _arc(0.0, 0.0, RING_RADIUS, 0.0, low),
            _arc(x, y, fillet, low + np.pi, np.pi - high)[1:],
            _arc(0.0, HOLE, LUG_RADIUS, -high, 0.5 * np.pi)[1:],
        ]
    )
    half = np.concatenate([quarter, quarter[-2::-1] * [-1.0, 1.0]])
    outline = np.concatenate([half, half[-2:0:-1] * [1.0, -1.0]])
    openings = [shapely.Point(0.0, 0.0).buffer(RING_RADIUS - RING_WIDTH, quad_segs=32)]
    openings += [shapely.Point(0.0, y).buffer(HOLE_RADIUS, quad_segs=32) for y in (-HOLE, HOLE)]
    return shapely.Polygon(outline, [ring.exterior.coords for ring in openings])


def _arc(x: float, y: float, radius: float, start: float, stop: float) -> FloatArray:
    """Points (k, 2) on an arc round (x, y), no more than 3 degrees apart."""
    angle = np.linspace(start, stop, 2 + int(abs(stop - start) / np.radians(3.0)))
    return np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)


def loop_mesh(element_size: float) -> TetMesh:
    """Mesh of the loop with patches support, load, hole_bottom and hole_top."""
    bottom, top = (0.0, -HOLE, 0.0), (0.0, HOLE, 0.0)
    rules = {
        "support": Cylinder(bottom, "z", HOLE_RADIUS, half="-y"),
        "load": Cylinder(top, "z", HOLE_RADIUS, half="y"),
        "hole_bottom": Cylinder(bottom, "z", HOLE_RADIUS),
        "hole_top": Cylinder(top, "z", HOLE_RADIUS),
    }
    return patches_from_rules(extrude(loop_outline(), THICKNESS, element_size), rules)


def loop(element_size: float = ELEMENT_SIZE, order: Order = 1, force: float = 1000.0) -> Case:
    """Ring with two lugs, 140 x 100 x 10 mm, pulled apart at the two holes.

    The outer half of the bottom hole is fixed, the outer half of the top hole pulled along y.

    Parameters as in `ccfem.cases.bar`.
    """
    mesh = mesh_of_case("loop", element_size, order, loop_mesh)
    return Case(
        name="loop",
        title="Ring with two lugs, 140 x 100 x 10 mm, pulled at its two holes",
        problem=pulled(mesh, (0.0, force, 0.0), order),
        source="size and loading of the Loop of Chen et al. 2021 (Additive Manufacturing 49, "
        "102470); own outline of circles",
    )


SIDE = 12.0
"""Half of the length, mm, of the sides of the ring that are pulled apart."""


def two_pull_loop(
    element_size: float = ELEMENT_SIZE, order: Order = 1, force: float = 1000.0
) -> Case:
    """Ring with two lugs, 140 x 100 x 10 mm, its top hole pulled along y or along x.

    The part of `ccfem.cases.two_pull_loop`: the outer half of the bottom hole is
    fixed, the outer half of the top hole is loaded. Its load cases are meant to be planned for at
    once (``--load-case all``).

    Parameters
    ----------
    element_size, order
        As in `ccfem.cases.bar`.
    force : float, N
        Of the load case "along", along y; a tenth of it, along x, in "across".
    """
    case = loop(element_size, order, force)
    rules: dict[str, PatchRule] = {
        "left": Box((-inf, -SIDE, -inf), (SIDE - RING_RADIUS, SIDE, inf), "-x"),
        "right": Box((RING_RADIUS - SIDE, -SIDE, -inf), (inf, SIDE, inf), "x"),
    }
    mesh = patches_from_rules(case.problem.mesh, rules)
    loads = {
        "along": (Force("load", (0.0, force, 0.0)),),
        "across": (Force("left", (-force, 0.0, 0.0)), Force("right", (force, 0.0, 0.0))),
    }
    return replace(
        case,
        name="two_pull_loop",
        title="Ring with two lugs, 140 x 100 x 10 mm, pulled along its length or across",
        problem=replace(case.problem, mesh=mesh, loads=loads),
        slicing=Planar(count=8),
        source=f"{case.source}; the second load is ours",
    )
