"""The twist bar of Fang et al. 2024: a bent bar with bolts at right angles through its ends."""

import numpy as np
import shapely

from ccfem.body.mesh.patches import Cylinder
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.case import Case
from ccfem.cases.crossed import arc, crossed_mesh
from ccfem.cases.stored import mesh_of_case
from ccfem.fem.elasticity.load_kinds import Load
from ccfem.fem.elasticity.problem import Bearing, Force, Order, Problem, Support
from ccfem.fem.materials import printed_pla
from ccfem.machine.machine import Machine
from ccfem.slicing.slicers.spatial import Spatial

ELEMENT_SIZE = 8.0
HOLE_RADIUS = 9.75
_HALF = 30.0
"""Half of the width of the bar, mm."""
_END, _OFFSET = 135.0, 48.7
"""Places of the bolts: x either side of the middle, and y below and above it, mm."""
_BEND, _TURN = 103.6, 58.0
"""Radius, mm, and angle, degrees, of both bends: ours, for the volume of the authors' part."""
HOLES = {
    "base": Cylinder((-_END, 0.0, 0.0), "y", HOLE_RADIUS),
    "head": Cylinder((_END, _OFFSET, 0.0), "z", HOLE_RADIUS),
    "pull": Cylinder((_END, _OFFSET, 0.0), "z", HOLE_RADIUS, half="x"),
}
"""Patches: the walls of the holes, and the half of the head's that a bolt pulls."""


def twist_bar_front() -> shapely.Polygon:
    """Outline seen along z: 60 mm about a line that bends up and back, a round end with a hole."""
    half = _BEND * float(np.sin(np.radians(_TURN)))
    line = np.concatenate(
        [
            [[-200.0, -_OFFSET]],
            arc(-half, _BEND - _OFFSET, _BEND, -90.0, -90.0 + _TURN),
            arc(half, _OFFSET - _BEND, _BEND, 90.0 + _TURN, 90.0),
            [[_END, _OFFSET]],
        ]
    )
    outline = shapely.LineString(line).buffer(_HALF, quad_segs=16)
    return outline.difference(shapely.Point(_END, _OFFSET).buffer(HOLE_RADIUS, quad_segs=16))


def twist_bar_top() -> shapely.Polygon:
    """Outline seen along y: 60 mm wide, a round end with a hole."""
    outline = shapely.LineString([(-_END, 0.0), (200.0, 0.0)]).buffer(_HALF, quad_segs=16)
    return outline.difference(shapely.Point(-_END, 0.0).buffer(HOLE_RADIUS, quad_segs=16))


def twist_bar_mesh(element_size: float) -> TetMesh:
    """Mesh of what two extrusions have in common; takes minutes."""
    return crossed_mesh({"z": twist_bar_front(), "y": twist_bar_top()}, element_size, HOLES)


def twist_bar(element_size: float = ELEMENT_SIZE, order: Order = 2, force: float = 1000.0) -> Case:
    """Bar of 330 x 157 x 60 mm between bolts at right angles, pulled along its length.

    Extent, holes and volume are those of the layers that the authors published (GuoxinFang/
    SpatialFiberPrinting); the bends between are ours. `pull` pulls the head along the bar; `side`
    pushes it across.

    Parameters
    ----------
    element_size : float, mm
        The mesh is stored for the default; making any other takes minutes.
    order : 1, 2 or "auto"
        Linear or quadratic cells, or what their estimated error calls for.
    force : float, N
        Of the pull; a quarter of it sideways.
    """
    mesh = mesh_of_case("twist_bar", element_size, order, twist_bar_mesh)
    loads: dict[str, tuple[Load, ...]] = {
        "pull": (Bearing("pull", (force, 0.0, 0.0)),),
        "side": (Force("pull", (0.0, 0.0, 0.25 * force)),),
    }
    return Case(
        name="twist_bar",
        title="Twist bar 330 x 157 x 60 mm, bolts at right angles through its ends",
        problem=Problem(mesh, printed_pla(), (Support("base"),), loads, order=order),
        build=(0.0, 1.0, 0.0),
        slicing=Spatial(thickness=1.7),
        machine=Machine(fibre_width=1.8),
        source="extent, holes and volume of the layers published by Fang et al., "
        "arXiv:2311.17265; bends and loads are ours",
    )
