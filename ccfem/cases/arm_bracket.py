"""An arm bracket: an upright on a long foot, pulled up, as part B of Kipping and Schueppstuhl."""

import numpy as np
import shapely

from ccfem.body.mesh.patches import Cylinder
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.case import Case
from ccfem.cases.crossed import arc, crossed_mesh
from ccfem.cases.stored import mesh_of_case
from ccfem.fem.elasticity.problem import Bearing, Order, Problem, Support
from ccfem.fem.materials import printed_pla
from ccfem.machine.machine import Machine
from ccfem.slicing.slicers.load_oriented import LoadOriented

ELEMENT_SIZE = 2.0
LENGTH, WIDTH, HEIGHT = 80.0, 20.0, 28.0
_THICK, _FILLET = 6.0, 4.0
"""Thickness of foot and upright, and radius where they meet, mm."""
HOLES = {
    "foot_near": Cylinder((35.0, 10.0, 0.0), "z", 3.0),
    "foot_far": Cylinder((68.0, 10.0, 0.0), "z", 3.0),
    "upper": Cylinder((0.0, 10.0, 20.0), "x", 4.0),
}
"""Patches: the walls of the holes."""


def arm_bracket_outlines() -> dict[str, shapely.Polygon]:
    """Outlines seen along y, an L with a fillet; along z, with two holes; along x, with one."""
    inner = _THICK + _FILLET
    front = np.concatenate(
        [
            [[0.0, 0.0], [LENGTH, 0.0], [LENGTH, _THICK]],
            arc(inner, inner, _FILLET, 270.0, 180.0),
            [[_THICK, HEIGHT], [0.0, HEIGHT]],
        ]
    )
    holes = {name: (hole.point, hole.radius) for name, hole in HOLES.items()}
    feet = [
        shapely.Point(*holes[name][0][:2]).buffer(holes[name][1], quad_segs=16)
        for name in ("foot_near", "foot_far")
    ]
    upper = shapely.Point(*holes["upper"][0][1:]).buffer(holes["upper"][1], quad_segs=16)
    return {
        "y": shapely.Polygon(front),
        "z": shapely.box(0.0, 0.0, LENGTH, WIDTH).difference(shapely.union_all(feet)),
        "x": shapely.box(0.0, 0.0, WIDTH, HEIGHT).difference(upper),
    }


def arm_bracket_mesh(element_size: float) -> TetMesh:
    """Mesh of what three extrusions have in common; takes minutes."""
    return crossed_mesh(arm_bracket_outlines(), element_size, HOLES)


def arm_bracket(element_size: float = ELEMENT_SIZE, order: Order = 1, force: float = 100.0) -> Case:
    """Arm bracket of 80 x 20 x 28 mm: bolted down by its foot, pulled up by its upright.

    The size and the pull are those of part B of Kipping and Schueppstuhl, Materials 16 (2023) 998;
    thickness, fillet and holes are not stated there, and ours. Layers follow the stress above a
    quarter of the peak: with less, stress that is nearly the same all round tilts them sideways.

    Parameters
    ----------
    element_size : float, mm
        The mesh is stored for the default; making any other takes minutes.
    order : 1, 2 or "auto"
        Linear or quadratic cells, or what their estimated error calls for.
    force : float, N
        On the upper hole, upwards.
    """
    mesh = mesh_of_case("arm_bracket", element_size, order, arm_bracket_mesh)
    return Case(
        name="arm_bracket",
        title="Arm bracket 80 x 20 x 28 mm, pulled up beside its bolts",
        problem=Problem(
            mesh,
            printed_pla(),
            (Support("foot_near"), Support("foot_far")),
            {"lift": (Bearing("upper", (0.0, 0.0, force)),)},
            order=order,
        ),
        slicing=LoadOriented(share=0.25),
        machine=Machine(fibre_width=0.9),
        source="size and load of part B of Kipping and Schueppstuhl, Materials 16 (2023) 998; "
        "thickness, fillet and holes of our choice",
    )
