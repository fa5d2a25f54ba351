"""The T-bracket of Fang et al. 2024: a base with two bolt holes and a head with one across them."""

import numpy as np
import shapely

from ccfem.base.arrays import IntArray
from ccfem.body.mesh.patches import Cylinder
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.case import Case
from ccfem.cases.crossed import arc, crossed_mesh
from ccfem.cases.stored import mesh_of_case
from ccfem.fem.elasticity.problem import Bearing, Force, Order, Problem, Support
from ccfem.fem.elasticity.support_kinds import PressingSupport
from ccfem.fem.materials import printed_pla
from ccfem.slicing.slicers.spatial import Spatial

ELEMENT_SIZE = 3.0
HOLE_RADIUS = 5.5
_DEPTH = 15.0
"""Half of the thickness of the head, along z, and of the width of the base, mm."""
HEAD_RADIUS = 9.5
"""Radius of the heads of the bolts in the base, mm."""
_HEAD_LEVEL, _UP, _FACING = 15.0, 0.9, 0.97
"""Height, mm, above which the top of the base lies, least y of its outward normal, and least cosine
of a wall's normals to the way to its axis."""
HOLES = {
    "base_left": Cylinder((-50.0, 0.0, 0.0), "y", HOLE_RADIUS),
    "base_right": Cylinder((50.0, 0.0, 0.0), "y", HOLE_RADIUS),
    "head": Cylinder((0.0, 50.0, 0.0), "z", HOLE_RADIUS),
    "pull": Cylinder((0.0, 50.0, 0.0), "z", HOLE_RADIUS, half="y"),
}
"""Patches: the walls of the holes, and the half of the head's that a bolt pulls."""


def t_bracket_front() -> shapely.Polygon:
    """Outline seen along z: a head of radius 15 mm about (0, 50), led into a base 15 mm high.

    The base goes on to x = 80 mm either side, beyond `t_bracket_top`.
    """
    root = 40.0 - np.sqrt(45.0**2 - 35.0**2)
    end = float(np.degrees(np.arctan2(40.0 - root, 35.0)))
    right = np.concatenate(
        [
            arc(0.0, 50.0, 15.0, 90.0, 0.0),
            arc(35.0, 40.0, 20.0, 180.0, 270.0),
            [[80.0, 20.0], [80.0, 5.0]],
            arc(35.0, 40.0, 35.0, 270.0, 180.0 + end),
            arc(0.0, root, 10.0, end, 90.0),
        ]
    )
    outline = shapely.Polygon(np.concatenate([right, right[::-1] * [-1.0, 1.0]])).buffer(0.0)
    return outline.difference(shapely.Point(0.0, 50.0).buffer(HOLE_RADIUS, quad_segs=16))


def t_bracket_top() -> shapely.Polygon:
    """Outline seen along y: all within 15 mm of the line from (-50, 0) to (50, 0), two holes."""
    outline = shapely.LineString([(-50.0, 0.0), (50.0, 0.0)]).buffer(_DEPTH, quad_segs=16)
    holes = [shapely.Point(x, 0.0).buffer(HOLE_RADIUS, quad_segs=16) for x in (-50.0, 50.0)]
    return outline.difference(shapely.union_all(holes))


def bolt_heads(mesh: TetMesh) -> dict[str, IntArray]:
    """Find the facets (k, 3) on top of the base with their middles under the heads of its bolts."""
    middle = mesh.points[mesh.boundary].mean(axis=1)
    up = mesh.facet_areas(mesh.boundary)[1][:, 1] > _UP
    top = up & (middle[:, 1] > _HEAD_LEVEL)
    found = {}
    for name, x in (("head_left", -50.0), ("head_right", 50.0)):
        radius = np.hypot(middle[:, 0] - x, middle[:, 2])
        found[name] = mesh.boundary[top & (radius < HEAD_RADIUS)]
    return found


def _smooth_wall(mesh: TetMesh, name: str) -> IntArray:
    """Facets of the wall of a base's hole that face its axis: on the rim the mesh has a fold."""
    facets, hole = mesh.patch(name), HOLES[name]
    inward = np.asarray(hole.point) - mesh.points[facets].mean(axis=1)
    inward[:, 1] = 0.0
    size = np.linalg.norm(inward, axis=1)
    along = np.einsum("fd,fd->f", mesh.facet_areas(facets)[1], inward) / size
    return facets[along > _FACING]


def t_bracket_mesh(element_size: float) -> TetMesh:
    """Mesh of what two extrusions have in common; takes minutes.

    Patches are the walls of the holes, and `pull`: half of the wall of the head's.
    """
    return crossed_mesh({"z": t_bracket_front(), "y": t_bracket_top()}, element_size, HOLES)


def t_bracket(
    element_size: float = ELEMENT_SIZE,
    order: Order = 2,
    force: float = 1000.0,
    bolts: bool = False,
) -> Case:
    """T-bracket of 130 x 60 x 30 mm: bolted down at its base, pulled by a bolt through its head.

    The shape is recovered from the layers that the authors published (GuoxinFang/
    SpatialFiberPrinting): the base's holes run along y, the head's along z. Their load is a pull of
    the head away from the base (`pull`); `side` pushes the head out of the plane of the T.

    Parameters
    ----------
    element_size : float, mm
        The mesh is stored for the default; making any other takes minutes.
    order : 1, 2 or "auto"
        Linear or quadratic cells, or what their estimated error calls for.
    force : float, N
        Of the pull; a quarter of it sideways.
    bolts : bool
        Whether strategies are tested a second time with the base's bolts as they are: walls and
        heads that only press.
    """
    mesh = mesh_of_case("t_bracket", element_size, order, t_bracket_mesh)
    alternative: tuple[PressingSupport, ...] = ()
    if bolts:
        heads = bolt_heads(mesh)
        walls = {name: _smooth_wall(mesh, name) for name in ("base_left", "base_right")}
        mesh = mesh.with_patches({**heads, **walls})
        pressed = ("base_left", "base_right", *heads)
        alternative = tuple(PressingSupport(name) for name in pressed)
    return Case(
        name="t_bracket",
        title="T-bracket 130 x 60 x 30 mm, bolts through base and head at right angles",
        problem=Problem(
            mesh,
            printed_pla(),
            (Support("base_left"), Support("base_right")),
            {
                "pull": (Bearing("pull", (0.0, force, 0.0)),),
                "side": (Force("pull", (0.0, 0.0, 0.25 * force)),),
            },
            order=order,
        ),
        build=(0.0, 1.0, 0.0),
        slicing=Spatial(),
        source="shape recovered from the layers published by Fang et al., "
        "arXiv:2311.17265; load in the direction of theirs",
        alternative_supports=alternative,
    )
