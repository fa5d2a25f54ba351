"""A lifting eye: a flange with two bolts and, across them, the eye that a shackle pulls."""

import numpy as np
import shapely

from ccfem.body.mesh.patches import Cylinder
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.case import Case
from ccfem.cases.crossed import arc, crossed_mesh
from ccfem.cases.stored import mesh_of_case
from ccfem.fem.elasticity.problem import Bearing, Order, Problem, Support
from ccfem.fem.materials import printed_pla
from ccfem.slicing.slicers.spatial import Spatial

ELEMENT_SIZE = 3.0
BOLT_RADIUS, EYE_RADIUS = 4.5, 9.0
_BOLTS, _EYE = 36.0, 44.0
"""Bolts at x either side of the middle, and height y of the eye, mm."""
_OUTSIDE, _FOOT, _FILLET = 20.0, 12.0, 12.0
"""Radius round the eye, height of the flange, and radius where they meet, mm."""
HOLES = {
    "bolt_left": Cylinder((-_BOLTS, 0.0, 0.0), "y", BOLT_RADIUS),
    "bolt_right": Cylinder((_BOLTS, 0.0, 0.0), "y", BOLT_RADIUS),
    "eye": Cylinder((0.0, _EYE, 0.0), "z", EYE_RADIUS),
}
"""Patches: the walls of the holes."""


def lifting_eye_front() -> shapely.Polygon:
    """Outline seen along z: a ring on a flange 12 mm high, which goes on beyond the top's."""
    # The fillet touches the flange and, from outside, the ring.
    level = _FOOT + _FILLET
    x = float(np.sqrt((_OUTSIDE + _FILLET) ** 2 - (_EYE - level) ** 2))
    touch = float(np.degrees(np.arctan2(_EYE - level, x)))
    right = np.concatenate(
        [
            arc(0.0, _EYE, _OUTSIDE, 90.0, -touch),
            arc(x, level, _FILLET, 180.0 - touch, 270.0),
            [[80.0, _FOOT], [80.0, 0.0]],
        ]
    )
    outline = shapely.Polygon(np.concatenate([right, right[::-1] * [-1.0, 1.0]])).buffer(0.0)
    return outline.difference(shapely.Point(0.0, _EYE).buffer(EYE_RADIUS, quad_segs=16))


def lifting_eye_top() -> shapely.Polygon:
    """Outline seen along y: the hull of three circles, two holes."""
    discs = [shapely.Point(x, 0.0).buffer(12.0, quad_segs=16) for x in (-_BOLTS, _BOLTS)]
    middle = shapely.Point(0.0, 0.0).buffer(15.0, quad_segs=16)
    outline = shapely.union_all([*discs, middle]).convex_hull
    holes = [shapely.Point(x, 0.0).buffer(BOLT_RADIUS, quad_segs=16) for x in (-_BOLTS, _BOLTS)]
    return outline.difference(shapely.union_all(holes))


def lifting_eye_mesh(element_size: float) -> TetMesh:
    """Mesh of what two extrusions have in common; takes minutes."""
    return crossed_mesh({"z": lifting_eye_front(), "y": lifting_eye_top()}, element_size, HOLES)


def lifting_eye(
    element_size: float = ELEMENT_SIZE, order: Order = 2, force: float = 1000.0
) -> Case:
    """Lifting eye of 96 x 64 x 30 mm: bolted down by its flange, pulled by its eye.

    `lift` pulls straight up, `slant` at 45 degrees in the plane of the eye, as slings do.

    Parameters
    ----------
    element_size : float, mm
        The mesh is stored for the default; making any other takes minutes.
    order : 1, 2 or "auto"
        Linear or quadratic cells, or what their estimated error calls for.
    force : float, N
        Of either pull.
    """
    mesh = mesh_of_case("lifting_eye", element_size, order, lifting_eye_mesh)
    slant = float(np.sqrt(0.5)) * force
    loads = {
        "lift": (Bearing("eye", (0.0, force, 0.0)),),
        "slant": (Bearing("eye", (slant, slant, 0.0)),),
    }
    supports = (Support("bolt_left"), Support("bolt_right"))
    return Case(
        name="lifting_eye",
        title="Lifting eye 96 x 64 x 30 mm on a flange with two bolts",
        problem=Problem(mesh, printed_pla(), supports, loads, order=order),
        build=(0.0, 1.0, 0.0),
        slicing=Spatial(),
        source="our own part",
    )
