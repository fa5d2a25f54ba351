"""Whether the gain of planning with the fibre in the part holds elsewhere than it was planned.

    python -m benchmarks.studies.confirmed_gain [PART ...] [--pictures DIR]

Four parts are planned at equal fibre by `isocurve`, `pruned` and `stream_function`, the last two
with and without moves, on linear cells under one load. The same paths are tested on cells with
midside nodes, and under that load turned by 15 degrees in the plane of the layers. The last three
parts were looked at for how a design converges and meets the border; no other parameter was chosen
on them.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from benchmarks.studies.table import print_table
from ccfem.body.mesh.patches import Box, Cylinder, PatchRule, Plane, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.bodies import loop_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import printed_pla
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.machine.machine import Machine
from ccfem.paths.planning.equal_fibre import plan_to_length
from ccfem.paths.planning.strategy import full_length
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create
from ccfem.strategies.fibre_aware.upper_bound import upper_bound

__all__ = ["COVERAGE", "LAYERS", "PARTS", "compared", "posed"]

COVERAGE, LAYERS, TURN = 0.45, 6, 15.0
STRATEGIES: dict[str, tuple[str, dict[str, int]]] = {
    "isocurve": ("isocurve", {}),
    "pruned": ("pruned", {}),
    "pruned, moved": ("pruned", {"moves": 6}),
    "stream_function": ("stream_function", {}),
    "stream_function, moved": ("stream_function", {"moves": 6}),
}
"""Names and parameters of what is compared."""


def lever(size: float = 2.2) -> TetMesh:
    """Make a wrench-like lever 150 mm long, 8 thick: a jaw of 24 mm at one end, a slender arm."""
    head, tip = shapely.Point(0.0, 0.0).buffer(24.0), shapely.Point(118.0, 0.0).buffer(10.0)
    arm = shapely.Polygon([(0.0, 12.0), (118.0, 8.0), (118.0, -8.0), (0.0, -12.0)])
    jaw = shapely.box(-30.0, -9.0, 4.0, 9.0)
    outline = shapely.union_all([head, arm, tip]).difference(jaw).buffer(-3.0).buffer(3.0)
    outline = outline.difference(shapely.Point(118.0, 0.0).buffer(4.0))
    rules: dict[str, PatchRule] = {
        # In a box: the arm's upper edge comes through the height of the jaw's wall, too.
        "support": Box((-30.0, 8.95, -1.0), (5.0, 9.05, 9.0)),
        "load": Cylinder((118.0, 0.0, 0.0), "z", 4.0),
    }
    return patches_from_rules(extrude(outline, 8.0, size), rules)


def arch() -> TetMesh:
    """Make a thin arch, a shell of radius 60 and width 14 mm over 150 degrees, 6 mm high."""
    angle = np.radians(np.linspace(15.0, 165.0, 76))
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    outline = shapely.Polygon(np.concatenate([67.0 * around, 53.0 * around[::-1]]))
    feet = [shapely.box(sign * 58.0 - 12.0, 8.0, sign * 58.0 + 12.0, 20.0) for sign in (-1, 1)]
    outline = shapely.union_all([outline, *feet]).buffer(-2.0).buffer(2.0)
    outline = outline.difference(shapely.Point(0.0, 60.0).buffer(3.0))
    rules: dict[str, PatchRule] = {
        "support": Plane("y", "min"),
        "load": Cylinder((0.0, 60.0, 0.0), "z", 3.0),
    }
    return patches_from_rules(extrude(outline, 6.0, 2.0), rules)


def bracket() -> TetMesh:
    """Make an angle of 70 x 60 mm, 8 thick, with a gusset, two bolts in one leg and a pin."""
    legs = shapely.union_all([shapely.box(0, 0, 70, 16), shapely.box(0, 0, 16, 60)])
    gusset = shapely.Polygon([(16.0, 16.0), (44.0, 16.0), (16.0, 44.0)])
    outline = shapely.union_all([legs, gusset]).buffer(3.0).buffer(-6.0).buffer(3.0)
    places = {"bolt_low": (8.0, 12.0), "bolt_high": (8.0, 50.0), "load": (60.0, 8.0)}
    holes = [shapely.Point(*at).buffer(3.0) for at in places.values()]
    rules: dict[str, PatchRule] = {
        name: Cylinder((*at, 0.0), "z", 3.0) for name, at in places.items()
    }
    mesh = extrude(outline.difference(shapely.union_all(holes)), 8.0, 2.0)
    return patches_from_rules(mesh, rules)


PARTS: dict[str, tuple[Callable[[], TetMesh], tuple[str, ...], tuple[float, float]]] = {
    "loop": (lambda: loop_mesh(2.4), ("support",), (0.0, 1000.0)),
    "lever": (lever, ("support",), (0.0, -200.0)),
    "arch": (arch, ("support",), (0.0, 500.0)),
    "bracket": (bracket, ("bolt_low", "bolt_high"), (0.0, -500.0)),
}
"""What makes the mesh, the patches that are held, and the force on the patch `load`, N."""


def posed(name: str) -> Problem:
    """Problem of one part, with the load that is planned for and the same one turned."""
    make, held, force = PARTS[name]
    turn = np.radians(TURN)
    turned = (
        np.cos(turn) * force[0] - np.sin(turn) * force[1],
        np.sin(turn) * force[0] + np.cos(turn) * force[1],
    )
    loads = {
        "planned": (Force("load", (*force, 0.0)),),
        "turned": (Force("load", (*turned, 0.0)),),
    }
    supports = tuple(Support(patch) for patch in held)
    return Problem(make(), printed_pla(), supports, loads, order=1)


def compared(name: str, pictures: Path | None = None) -> list[str]:
    """Rows of the table for one part."""
    problem = posed(name)
    coarse = solve(problem)
    fine = solve(replace(problem, mesh=problem.mesh.quadratic(), order=2))
    layers, machine = Planar(count=LAYERS).cut(problem.mesh), Machine()
    wanted = COVERAGE * full_length(layers, machine)
    parts = {
        "planned": Specimen.of(coarse["planned"]),
        "quadratic": Specimen.of(fine["planned"]),
        "turned": Specimen.of(coarse["turned"]),
    }
    most = upper_bound(coarse["planned"], layers, wanted * LAYERS, machine)
    rows = []
    for strategy, parameters in STRATEGIES.items():
        planner = create(*parameters)
        planned = plan_to_length(planner, layers, coarse["planned"], machine, wanted)
        ratios = [
            virtual_test(planned.toolpaths, part, span=(), machine=machine).ratio
            for part in parts.values()
        ]
        rows.append(
            f"| {name} | {strategy} | {1e-3 * planned.length_per_layer * LAYERS:.2f} | "
            f"{' | '.join(f'{ratio:.3f}' for ratio in ratios)} | {most.share(ratios[0]):.0%} |"
        )
        if pictures is not None:
            planned.toolpaths.plot(layer=0).savefig(pictures / f"{name}-{strategy}.png", dpi=100)
    density = f"{most.reached:.3f} reached by a density"
    rows.append(f"| {name} | bound | | {most.ratio:.3f} ({density}) | | | |")
    return rows


def main(arguments: list[str]) -> None:
    """Print the table."""
    heads = "as planned | midside nodes | load turned | share of the bound's gain"
    print_table(arguments, f"part | strategy | fibre, m | {heads}", PARTS, compared)


if __name__ == "__main__":
    main(sys.argv[1:])
