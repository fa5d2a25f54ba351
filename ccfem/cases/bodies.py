"""Bodies of the shipped cases that are no planform: meshed anew for another element size.

Outlines seen along an axis have the other two coordinates in alphabetical order; lengths are mm.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.progress import Progress, silent
from ccfem.body.files.surface import write_stl
from ccfem.body.mesh.check import check_mesh
from ccfem.body.mesh.patches import Cylinder, PatchRule, Plane, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity.problem import Bearing, Force, Problem, Support
from ccfem.fem.materials import printed_pla
from ccfem.fem.topopt import Design, as_problem
from ccfem.fem.topopt.simp import solid_design

Point = tuple[float, float]


def discs(centres: Sequence[Point], radius: float, segments: int = 16) -> shapely.Geometry:
    """Round areas about some centres, `segments` chords a quarter."""
    return shapely.union_all(
        [shapely.Point(centre).buffer(radius, quad_segs=segments) for centre in centres]
    )


def arc(x: float, y: float, radius: float, angle: FloatArray) -> FloatArray:
    """Points (k, 2) on a circle about (x, y) at angles (k,), radians."""
    return np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)


def sweep(first: float, last: float) -> FloatArray:
    """Angles from one to another, degrees, at most 6 degrees apart; in radians."""
    return np.radians(np.linspace(first, last, int(np.ceil(abs(last - first) / 6.0)) + 1))


def mirrored(right: FloatArray) -> shapely.Polygon:
    """Polygon of a border right of the y axis and its mirror image."""
    return shapely.Polygon(np.concatenate([right, right[::-1] * [-1.0, 1.0]])).buffer(0.0)


# Flat bodies.


def bar_outline() -> shapely.Polygon:
    """Planform of the bar: 125 x 25 mm, 8 mm wide on a gauge of 40 mm, shoulders of radius 8 mm."""
    shoulder = 8.0
    grips = [shapely.box(-62.5, -12.5, -28.0, 12.5), shapely.box(28.0, -12.5, 62.5, 12.5)]
    outline = shapely.union_all([shapely.box(-62.5, -4.0, 62.5, 4.0), *grips])
    outline = outline.buffer(shoulder, join_style="mitre").buffer(-shoulder, quad_segs=32)
    return shapely.remove_repeated_points(outline, 1e-3)


def bar_mesh(element_size: float) -> TetMesh:
    """Mesh with patches support (the left end) and load (the right end)."""
    rules = {"support": Plane("x", "min"), "load": Plane("x", "max")}
    return patches_from_rules(extrude(bar_outline(), 5.0, element_size), rules)


LOOP_HOLE, LOOP_HOLE_RADIUS = 50.0, 5.0
"""Distance of the holes' centres from the middle of the ring, and their radius."""


def loop_outline(fillet: float = 10.0) -> shapely.Polygon:
    """Planform of the loop, 100 mm wide and 140 mm long: a ring with a lug round either hole.

    Parameters
    ----------
    fillet : float, mm
        Radius where a lug meets the ring.
    """
    ring, lug, hole = 50.0, 20.0, LOOP_HOLE
    # The fillet's circle touches the ring's and the lug's from outside.
    y = ((ring + fillet) ** 2 - (lug + fillet) ** 2 + hole**2) / (2.0 * hole)
    x = np.sqrt((ring + fillet) ** 2 - y**2)
    low, high = np.arctan2(y, x), np.arctan2(hole - y, x)

    def along(first: float, last: float) -> FloatArray:
        return np.linspace(first, last, 2 + int(abs(last - first) / np.radians(3.0)))

    quarter = np.concatenate(
        [
            arc(0.0, 0.0, ring, along(0.0, low)),
            arc(x, y, fillet, along(low + np.pi, np.pi - high))[1:],
            arc(0.0, hole, lug, along(-high, 0.5 * np.pi))[1:],
        ]
    )
    half = np.concatenate([quarter, quarter[-2::-1] * [-1.0, 1.0]])
    outline = np.concatenate([half, half[-2:0:-1] * [1.0, -1.0]])
    openings = [shapely.Point(0.0, 0.0).buffer(30.0, quad_segs=32)]
    openings += [
        shapely.Point(0.0, y).buffer(LOOP_HOLE_RADIUS, quad_segs=32) for y in (-hole, hole)
    ]
    return shapely.Polygon(outline, [opening.exterior.coords for opening in openings])


def loop_mesh(element_size: float) -> TetMesh:
    """Mesh with patches support and load, outer halves of the walls hole_bottom and hole_top."""
    bottom, top = (0.0, -LOOP_HOLE, 0.0), (0.0, LOOP_HOLE, 0.0)
    rules = {
        "support": Cylinder(bottom, "z", LOOP_HOLE_RADIUS, half="-y"),
        "load": Cylinder(top, "z", LOOP_HOLE_RADIUS, half="y"),
        "hole_bottom": Cylinder(bottom, "z", LOOP_HOLE_RADIUS),
        "hole_top": Cylinder(top, "z", LOOP_HOLE_RADIUS),
    }
    return patches_from_rules(extrude(loop_outline(), 10.0, element_size), rules)


def two_angle_bracket_mesh(element_size: float) -> TetMesh:
    """Mesh of the hull of three bosses, with a hole in each, without patches."""
    centres = [(0.0, 0.0), (0.0, 56.0), (95.0, 22.0)]
    outline = discs(centres, 10.0, 32).convex_hull.difference(discs(centres, 4.0))
    return extrude(outline, 6.0, element_size)


# Bodies that extrusions at right angles have in common: what bolts from several sides hold.


def crossed_mesh(
    outlines: Mapping[str, shapely.Polygon], element_size: float, rules: Mapping[str, PatchRule]
) -> TetMesh:
    """Mesh of what extrusions have in common; takes minutes.

    Parameters
    ----------
    outlines : mapping of "x", "y" or "z" to shapely Polygon
        Two or three outlines, seen along these axes.
    element_size : float, mm
        Target edge length.

    Returns
    -------
    TetMesh
        Linear, checked, with the patches of the rules.
    """
    import pytetwild

    beyond, tolerance = 4.0, 5e-4  # of an extrusion, mm; of the mesher, in the diagonal
    low, high = _common_box(outlines)
    with TemporaryDirectory() as folder, chdir(folder):
        for axis, outline in outlines.items():
            along = "xyz".index(axis)
            tall = high[along] - low[along] + 2.0 * beyond
            body = extrude(outline, tall, 2.0 * element_size)
            placed = np.empty_like(body.points)
            placed[:, [k for k in range(3) if k != along]] = body.points[:, :2]
            placed[:, along] = body.points[:, 2] + low[along] - beyond
            # Seen along y the first two axes change their sense, and so do the triangles.
            write_stl(Path(f"{axis}.stl"), placed, body.boundary[:, :: -1 if axis == "y" else 1])
        first, *others = (f"{axis}.stl" for axis in outlines)
        tree: Any = first
        for other in others:
            tree = {"operation": "intersection", "left": tree, "right": other}
        Path("tree.json").write_text(json.dumps(tree), encoding="utf-8")
        grid = pytetwild.tetrahedralize_csg(
            "tree.json",
            epsilon=tolerance,
            edge_length_r=element_size / float(np.linalg.norm(high - low + 2.0 * beyond)),
            num_threads=1,
        )
    cells = np.asarray(grid.cells).reshape(-1, 5)[:, 1:]
    return patches_from_rules(check_mesh(TetMesh(np.asarray(grid.points), cells))[0], rules)


def _common_box(outlines: Mapping[str, shapely.Polygon]) -> tuple[FloatArray, FloatArray]:
    """Least and largest coordinates (3,) of what the extrusions have in common."""
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    for axis, outline in outlines.items():
        across = [k for k in range(3) if k != "xyz".index(axis)]
        ends = np.reshape(outline.bounds, (2, 2))
        low[across] = np.maximum(low[across], ends[0])
        high[across] = np.minimum(high[across], ends[1])
    return low, high


LIFTING_EYE_HOLES = {
    "bolt_left": Cylinder((-36.0, 0.0, 0.0), "y", 4.5),
    "bolt_right": Cylinder((36.0, 0.0, 0.0), "y", 4.5),
    "eye": Cylinder((0.0, 44.0, 0.0), "z", 9.0),
}


def lifting_eye_outlines() -> dict[str, shapely.Polygon]:
    """Along z a ring on a flange, led in by fillets; along y the flange, the hull of three discs.

    Seen along z the flange goes on beyond that seen along y.
    """
    outside, foot, fillet, height = 20.0, 12.0, 12.0, 44.0
    # The fillet touches the flange and, from outside, the ring.
    level = foot + fillet
    x = float(np.sqrt((outside + fillet) ** 2 - (height - level) ** 2))
    touch = float(np.degrees(np.arctan2(height - level, x)))
    right = np.concatenate(
        [
            arc(0.0, height, outside, sweep(90.0, -touch)),
            arc(x, level, fillet, sweep(180.0 - touch, 270.0)),
            [[80.0, foot], [80.0, 0.0]],
        ]
    )
    bolts = [(-36.0, 0.0), (36.0, 0.0)]
    flange = shapely.union(discs(bolts, 12.0), discs([(0.0, 0.0)], 15.0)).convex_hull
    return {
        "z": mirrored(right).difference(discs([(0.0, height)], 9.0)),
        "y": flange.difference(discs(bolts, 4.5)),
    }


T_BRACKET_HOLES = {
    "base_left": Cylinder((-50.0, 0.0, 0.0), "y", 5.5),
    "base_right": Cylinder((50.0, 0.0, 0.0), "y", 5.5),
    "head": Cylinder((0.0, 50.0, 0.0), "z", 5.5),
    "pull": Cylinder((0.0, 50.0, 0.0), "z", 5.5, half="y"),
}
"""Walls of the holes, and the half of the head's that a bolt pulls."""
BOLT_HEAD_RADIUS = 9.5
"""Of the bolts in the base of the T-bracket, mm."""


def t_bracket_outlines() -> dict[str, shapely.Polygon]:
    """Along z a head of radius 15 mm about (0, 50), led into a base 15 mm high; along y a bar.

    Seen along z the base goes on beyond that seen along y.
    """
    root = 40.0 - np.sqrt(45.0**2 - 35.0**2)
    end = float(np.degrees(np.arctan2(40.0 - root, 35.0)))
    right = np.concatenate(
        [
            arc(0.0, 50.0, 15.0, sweep(90.0, 0.0)),
            arc(35.0, 40.0, 20.0, sweep(180.0, 270.0)),
            [[80.0, 20.0], [80.0, 5.0]],
            arc(35.0, 40.0, 35.0, sweep(270.0, 180.0 + end)),
            arc(0.0, root, 10.0, sweep(end, 90.0)),
        ]
    )
    bolts = [(-50.0, 0.0), (50.0, 0.0)]
    return {
        "z": mirrored(right).difference(discs([(0.0, 50.0)], 5.5)),
        "y": shapely.LineString(bolts).buffer(15.0, quad_segs=16).difference(discs(bolts, 5.5)),
    }


def bolt_heads(mesh: TetMesh) -> dict[str, IntArray]:
    """Facets (k, 3) of a T-bracket on top of its base under the heads of its bolts."""
    middle = mesh.points[mesh.boundary].mean(axis=1)
    top = (mesh.facet_areas(mesh.boundary)[1][:, 1] > 0.9) & (middle[:, 1] > 15.0)
    return {
        name: mesh.boundary[top & (np.hypot(middle[:, 0] - x, middle[:, 2]) < BOLT_HEAD_RADIUS)]
        for name, x in (("head_left", -50.0), ("head_right", 50.0))
    }


def smooth_wall(mesh: TetMesh, name: str) -> IntArray:
    """Facets of a base hole of a T-bracket that face its axis: on the rim the mesh has a fold."""
    facets = mesh.patch(name)
    inward = np.asarray(T_BRACKET_HOLES[name].point) - mesh.points[facets].mean(axis=1)
    inward[:, 1] = 0.0
    size = np.linalg.norm(inward, axis=1)
    return facets[np.einsum("fd,fd->f", mesh.facet_areas(facets)[1], inward) / size > 0.97]


TWIST_BAR_HOLES = {
    "base": Cylinder((-135.0, 0.0, 0.0), "y", 9.75),
    "head": Cylinder((135.0, 48.7, 0.0), "z", 9.75),
    "pull": Cylinder((135.0, 48.7, 0.0), "z", 9.75, half="x"),
}
"""Walls of the holes, and the half of the head's that a bolt pulls."""


def twist_bar_outlines() -> dict[str, shapely.Polygon]:
    """Along z 60 mm about a line that bends up and back to a hole; along y straight to a hole.

    Radius and angle of the bends are ours, for the volume of the authors' part.
    """
    end, offset, bend, turn = 135.0, 48.7, 103.6, 58.0
    half = bend * float(np.sin(np.radians(turn)))
    line = np.concatenate(
        [
            [[-200.0, -offset]],
            arc(-half, bend - offset, bend, sweep(-90.0, -90.0 + turn)),
            arc(half, offset - bend, bend, sweep(90.0 + turn, 90.0)),
            [[end, offset]],
        ]
    )
    front = shapely.LineString(line).buffer(30.0, quad_segs=16)
    top = shapely.LineString([(-end, 0.0), (200.0, 0.0)]).buffer(30.0, quad_segs=16)
    return {
        "z": front.difference(discs([(end, offset)], 9.75)),
        "y": top.difference(discs([(-end, 0.0)], 9.75)),
    }


ARM_BRACKET_HOLES = {
    "foot_near": Cylinder((35.0, 10.0, 0.0), "z", 3.0),
    "foot_far": Cylinder((68.0, 10.0, 0.0), "z", 3.0),
    "upper": Cylinder((0.0, 10.0, 20.0), "x", 4.0),
}


def arm_bracket_outlines() -> dict[str, shapely.Polygon]:
    """Along y an L 6 mm thick with a fillet of 4 mm; along z with two holes; along x with one."""
    corner = arc(10.0, 10.0, 4.0, sweep(270.0, 180.0))
    front = np.concatenate(
        [[[0.0, 0.0], [80.0, 0.0], [80.0, 6.0]], corner, [[6.0, 28.0], [0.0, 28.0]]]
    )
    return {
        "y": shapely.Polygon(front),
        "z": shapely.box(0.0, 0.0, 80.0, 20.0).difference(discs([(35.0, 10.0), (68.0, 10.0)], 3.0)),
        "x": shapely.box(0.0, 0.0, 20.0, 28.0).difference(discs([(10.0, 20.0)], 4.0)),
    }


# Bodies that topology optimisation shapes.

_RIM = 2.0
"""Width of the rings about the holes that stay solid."""
_CORNER_BOLTS = ((-20.5, -20.5), (20.5, -20.5), (20.5, 20.5), (-20.5, 20.5))
CORNER_BRACKET_HOLES = {
    **{f"foot_{k}": Cylinder((x, y, 0.0), "z", 2.75) for k, (x, y) in enumerate(_CORNER_BOLTS, 1)},
    "upper": Cylinder((0.0, 0.0, 20.0), "x", 4.0),
}


def corner_bracket_outlines() -> dict[str, shapely.Polygon]:
    """Outlines of the design domain: a square with four holes, and a hat, one with a hole."""
    right = [(26.0, 0.0), (26.0, 6.0), (17.5, 6.0), (10.0, 27.0)]
    hat = shapely.Polygon([*right, *((-x, z) for x, z in reversed(right))])
    square = shapely.box(-26.0, -26.0, 26.0, 26.0)
    return {
        "z": square.difference(discs(_CORNER_BOLTS, 2.75, 12)),
        "y": hat,
        "x": hat.difference(discs([(0.0, 20.0)], 4.0, 12)),
    }


def corner_bracket_design(element_size: float) -> Design:
    """Densities of least compliance, 25 % of the domain filled; takes minutes."""
    mesh = crossed_mesh(corner_bracket_outlines(), element_size, CORNER_BRACKET_HOLES)
    feet = tuple(Support(f"foot_{k}") for k in range(1, 5))
    problem = Problem(mesh, printed_pla(), feet, {"lift": (Bearing("upper", (0.0, 0.0, 100.0)),)})
    x, y, z = mesh.centres.T
    bolt = np.hypot(np.abs(x) - 20.5, np.abs(y) - 20.5) <= 2.75 + _RIM
    axle = (np.hypot(y, z - 20.0) <= 4.0 + _RIM) & (np.abs(x) <= 5.0)
    rims = np.asarray((bolt & (z <= 6.0)) | axle)
    return solid_design(problem, 0.25, element_size, rims, 100)


BRACKET_HOLES = {
    "hole_1": (5.5, 45.0),
    "hole_2": (15.5, 45.0),
    "hole_3": (45.0, 15.5),
    "hole_4": (45.0, 5.5),
}
"""Centres of the bolt holes: the first two are held, the others loaded."""
BRACKET_HOLE_RADIUS = 3.0


def bracket_outline() -> shapely.Polygon:
    """Planform of the design domain: an L of 52 x 52 mm with legs 21 mm wide and four holes."""
    corner = shapely.box(21.0, 21.0, 52.0, 52.0)
    holes = discs([*BRACKET_HOLES.values()], BRACKET_HOLE_RADIUS)
    return shapely.box(0.0, 0.0, 52.0, 52.0).difference(shapely.union(corner, holes))


def bracket_domain(element_size: float) -> TetMesh:
    """Mesh of the design domain, 27 mm high, with the walls of its holes as patches."""
    rules = {
        name: Cylinder((x, y, 0.0), "z", BRACKET_HOLE_RADIUS)
        for name, (x, y) in BRACKET_HOLES.items()
    }
    return patches_from_rules(extrude(bracket_outline(), 27.0, element_size), rules)


def bracket_design(
    element_size: float = 1.75, max_iterations: int = 150, progress: Progress = silent
) -> Design:
    """Densities of least compliance of both load cases together, 30 % of the domain filled.

    The iterations stop earlier when the compliance no longer changes.
    """
    loaded, mesh = ("hole_3", "hole_4"), bracket_domain(element_size)
    problem = Problem(
        mesh,
        printed_pla(),
        (Support("hole_1"), Support("hole_2")),
        {
            "down": tuple(Bearing(name, (0.0, -250.0, 0.0)) for name in loaded),
            "side": tuple(Force(name, (0.0, 0.0, 100.0)) for name in loaded),
        },
    )
    centre = mesh.centres[:, None, :2]
    distance = np.linalg.norm(centre - np.array(list(BRACKET_HOLES.values())), axis=2)
    rims = np.asarray((distance <= BRACKET_HOLE_RADIUS + _RIM).any(axis=1))
    return solid_design(problem, 0.3, element_size, rims, max_iterations, progress)


def _crossed(
    outlines: Callable[[], Mapping[str, shapely.Polygon]], holes: Mapping[str, PatchRule]
) -> Callable[[float], TetMesh]:
    return lambda element_size: crossed_mesh(outlines(), element_size, holes)


BODIES: dict[str, tuple[Callable[[float], TetMesh], float]] = {
    "bar": (bar_mesh, 1.5),
    "loop": (loop_mesh, 2.4),
    "two_angle_bracket": (two_angle_bracket_mesh, 2.0),
    "lifting_eye": (_crossed(lifting_eye_outlines, LIFTING_EYE_HOLES), 3.0),
    "t_bracket": (_crossed(t_bracket_outlines, T_BRACKET_HOLES), 3.0),
    "twist_bar": (_crossed(twist_bar_outlines, TWIST_BAR_HOLES), 8.0),
    "arm_bracket": (_crossed(arm_bracket_outlines, ARM_BRACKET_HOLES), 2.0),
    "bracket": (lambda size: as_problem(bracket_design(size), printed_pla()).mesh, 1.75),
    "corner_bracket": (
        lambda size: as_problem(corner_bracket_design(size), printed_pla()).mesh,
        1.5,
    ),
}
"""What makes the mesh of a body of an element size, mm, and the size of the stored one."""
