"""How far the virtual test can tell designs apart: two meshes, two rotations and two seeds a part.

    python -m benchmarks.studies.resolution [PART ...]

The paths of several strategies are planned once, at equal length. The part is then meshed again
with another edge length, with its outline turned (so that the cells lie otherwise about the same
paths), and with its inner nodes moved at random, and the same paths are tested on each of the
eight meshes. The ratio of the stiffnesses of two designs should not feel the mesh; the table says
by how much it does: the largest change over all pairs of designs where one of the three differs,
and where any differ.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np
import shapely
from shapely.affinity import rotate

from ccfem.base.arrays import FloatArray
from ccfem.body.mesh.patches import Cylinder, PatchRule, Plane, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.bodies import (
    BRACKET_HOLE_RADIUS,
    BRACKET_HOLES,
    LOOP_HOLE,
    LOOP_HOLE_RADIUS,
    bar_outline,
    bracket_outline,
    loop_outline,
)
from ccfem.cases.case import Case
from ccfem.comparison import compare
from ccfem.fem.elasticity import Bearing, Force, Problem, Support, solve
from ccfem.fem.materials import printed_pla
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_bracket
from ccfem.judging.virtual_testing.strands import cut_strands

__all__ = ["PARTS", "Part", "changes", "meshed", "ratios"]

STRATEGIES = ("concentric", "contour_zigzag", "zigzag", "isocurve", "stream_function")
LAYERS = 4
ANGLES = (0.0, 37.0)
SEEDS = (None, 1)
_SHAKEN = 0.1
"""Most by which a seed moves inner nodes, in edge lengths, along each axis."""

Setting = tuple[float, float, int | None]
"""Edge length, angle of the outline in degrees, and seed."""


@dataclass(frozen=True)
class Part:
    """A prismatic part that can be meshed in several ways.

    Attributes
    ----------
    outline : shapely Polygon, mm
    height : float, mm
    sizes : (float, float), mm
        Edge lengths, the first that of the paths.
    rules : mapping of patch name to PatchRule
    problem : callable
        Problem on a mesh.
    """

    outline: shapely.Polygon
    height: float
    sizes: tuple[float, float]
    rules: Mapping[str, PatchRule]
    problem: Callable[[TetMesh], Problem]


def _pull_x(mesh: TetMesh) -> Problem:
    loads = {"pull": (Force("load", (1000.0, 0.0, 0.0)),)}
    return Problem(mesh, printed_pla(), (Support("support"),), loads, order=1)


def _pull_y(mesh: TetMesh) -> Problem:
    return replace(_pull_x(mesh), loads={"pull": (Force("load", (0.0, 1000.0, 0.0)),)})


def _push_down(mesh: TetMesh) -> Problem:
    loads = tuple(Bearing(name, (0.0, -50.0, 0.0)) for name in ("hole_3", "hole_4"))
    held = (Support("hole_1"), Support("hole_2"))
    return Problem(mesh, printed_pla(), held, {"down": loads})


_PLATE = shapely.box(-100.0, -18.0, 100.0, 18.0).difference(
    shapely.Point(0.0, 0.0).buffer(6.0, quad_segs=32)
)
_ENDS: dict[str, PatchRule] = {"support": Plane("x", "min"), "load": Plane("x", "max")}
_EYES: dict[str, PatchRule] = {
    "support": Cylinder((0.0, -LOOP_HOLE, 0.0), "z", LOOP_HOLE_RADIUS, half="-y"),
    "load": Cylinder((0.0, LOOP_HOLE, 0.0), "z", LOOP_HOLE_RADIUS, half="y"),
}
_BOLTS: dict[str, PatchRule] = {
    name: Cylinder((x, y, 0.0), "z", BRACKET_HOLE_RADIUS) for name, (x, y) in BRACKET_HOLES.items()
}
PARTS = {
    "bar": Part(bar_outline(), 5.0, (2.5, 2.0), _ENDS, _pull_x),
    "loop": Part(loop_outline(), 10.0, (3.2, 2.5), _EYES, _pull_y),
    "open_hole": Part(_PLATE, 4.0, (2.5, 2.0), _ENDS, _pull_x),
    "bracket": Part(bracket_outline(), 6.0, (2.2, 1.75), _BOLTS, _push_down),
}


def meshed(part: Part, size: float, angle: float, seed: int | None) -> TetMesh:
    """Mesh with an edge length, of the outline turned by an angle and back, nodes moved by a seed.

    Parameters
    ----------
    part : Part
    size : float, mm
    angle : float, degrees
    seed : int or None
        None moves nothing.
    """
    turned = rotate(part.outline, angle, origin=(0.0, 0.0))
    mesh = extrude(turned, part.height, size)
    points = mesh.points.copy()
    if seed is not None:
        border = np.unique(mesh.facets[mesh.partners < 0])
        inner = np.setdiff1d(np.arange(len(points)), border)
        moved = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(inner), 3))
        points[inner] += _SHAKEN * size * moved
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    back = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return patches_from_rules(replace(mesh, points=points @ back.T), part.rules)


def ratios(name: str) -> dict[Setting, FloatArray]:
    """Stiffness of designs, without and with compression, (2, k), N/mm, on each of the meshes."""
    part = PARTS[name]
    settings = list(product(part.sizes, ANGLES, SEEDS))
    first = part.problem(meshed(part, *settings[0]))
    case = Case(name, name, first)
    runs = compare(case, STRATEGIES, layers=LAYERS, strand=None).runs
    found = {}
    for setting in settings:
        field = next(iter(solve(part.problem(meshed(part, *setting))).values()))
        specimen = Specimen.of(field)
        tests = [
            virtual_bracket(cut_strands(run.toolpaths, field.mesh), specimen, span=())
            for run in runs
            if not run.failure
        ]
        found[setting] = np.array(
            [[t.tension.stiffness for t in tests], [t.partial.stiffness for t in tests]]
        )
        print(name, setting, len(field.mesh.cells), np.round(found[setting][0], 1), flush=True)
    return found


def changes(found: Mapping[Setting, FloatArray]) -> dict[str, FloatArray]:
    """Tell by how much the ratios of all pairs of designs change, by what differs of the meshes.

    Parameters
    ----------
    found : mapping of Setting to (2, k) array
        Stiffnesses, as from `ratios`.

    Returns
    -------
    dict of "mesh", "rotation", "seed" and "any" to (n,) arrays
        Of both tests, relative, positive.
    """
    result: dict[str, list[FloatArray]] = {"mesh": [], "rotation": [], "seed": [], "any": []}
    for one, other in combinations(found, 2):
        differs = [a != b for a, b in zip(one, other, strict=True)]
        gain = np.log(found[one] / found[other])
        pairs = combinations(range(gain.shape[1]), 2)
        change = np.concatenate([np.abs(np.expm1(gain[:, i] - gain[:, j])) for i, j in pairs])
        result["any"].append(change)
        if sum(differs) == 1:
            result[["mesh", "rotation", "seed"][differs.index(True)]].append(change)
    return {what: np.concatenate(each) for what, each in result.items()}


def main() -> None:
    """Print the table."""
    rows = {name: changes(ratios(name)) for name in sys.argv[1:] or PARTS}
    print("largest change of the ratio of the stiffnesses of two designs")
    print(f"{'part':12}{'mesh':>8}{'rotation':>10}{'seed':>8}{'any':>8}{'any, 95 %':>12}")
    for name, row in rows.items():
        most = {what: f"{each.max():.2%}" for what, each in row.items()}
        print(
            f"{name:12}{most['mesh']:>8}{most['rotation']:>10}{most['seed']:>8}{most['any']:>8}"
            f"{np.quantile(row['any'], 0.95):>12.2%}"
        )
    every = np.concatenate([row["any"] for row in rows.values()])
    print(f"all: {every.max():.2%}, 95 % of all: {np.quantile(every, 0.95):.2%}")


if __name__ == "__main__":
    main()
