"""The printed parts of the table, and the virtual test of every print of them.

Chen et al. 2021: the authors' meshes and paths, the first layers of their files as many as table 2
counts, spread over the height. Loop and Shell are held at one half of the wall of a hole and pulled
by a uniform force on the opposite half of the wall of another; pushed, the Shell is held and
loaded on the other halves. The bars are held at one end and pulled at the other.

Fang et al. 2024 and Zhang et al. 2025: the T-bracket, walls of the base's holes held, a bolt
pulling the head. Layers across x and z of the paper, which is y of the files, carry rings 2.2 mm
apart as long as the published strands.

Plocher et al. 2022: the beam of case III, optimised here, of short fibre in oriented plane stress.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.progress import Progress
from ccfem.body.files import read_mesh
from ccfem.body.mesh.patches import Cylinder, PatchRule, Plane, patches_from_rules
from ccfem.fem.elasticity import StressField, solve
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.equilibrium import IN_COMPRESSION, PARTIAL
from ccfem.judging.virtual_testing.failure_laws.fibre import fibre_peak
from ccfem.judging.virtual_testing.failure_laws.matrix import matrix_peak
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.machine import Machine
from ccfem.papers.chen_2021.authors import PATHS
from ccfem.papers.chen_2021.loop import FOLDER as CHEN, LAYERS_TABLE_2, authors_folder, authors_loop
from ccfem.papers.chen_2021.virtual_test import authors_paths, spread_paths
from ccfem.papers.contents import WhenAsked
from ccfem.papers.evidence.rows import NONE, PartResult
from ccfem.paths.planning import plan_to_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.path_table import read_strands
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

FANG, ZHANG = "CCFEM_FANG2024", "CCFEM_ZHANG2025"
"""Environment variables that name data of authors, beside `CHEN`."""

FAR_END = PARTIAL
"""Mode of the virtual test at the other end of the intervals; the prediction is tension only."""

RHOS = (2.5, 6.0)
"""EA/E, mm^2, at which ratios are known beside the default, to fit it."""

_BUILD = (0.0, 1.0, 0.0)


def _tested(
    field: StressField, paths: Mapping[str, Toolpaths], rhos: Sequence[float] = ()
) -> PartResult:
    """Test prints of a part: tension only, and at the far end of the interval."""
    specimen = Specimen.of(field)
    first: dict[str, float] = {}
    far: dict[str, float] = {}
    by_rho: dict[str, dict[float, float]] = {}
    force: dict[str, float] = {}
    for name, lines in paths.items():
        strands = cut_strands(lines, field.mesh)
        test = virtual_test(strands, specimen, span=rhos)
        other = virtual_test(strands, specimen, mode=FAR_END, span=())
        first[NONE] = far[NONE] = test.unreinforced_stiffness
        first[name], far[name] = test.stiffness, other.stiffness
        by_rho[name] = {test.rho: test.ratio, **dict(test.span)}
        force[name] = fibre_peak(test)[0] / test.force
    index = matrix_peak(field)[0] / specimen.force(np.zeros_like(field.mesh.points))
    return PartResult((first, far), by_rho if rhos else None, index, force)


# Chen et al. 2021.


_SHELL_HOLES = {"support": -50.0, "load": 50.0}
"""z of the loaded holes of the Shell, mm: two of its ten openings are round holes beside the edge,
of radius 6 at x = -39.89."""

_SHELL_LAYERS = {"zigzag": 8, "authors": LAYERS_TABLE_2}
"""Layers of the files that make up the lengths of table 2, 36.998 m and about 25 m."""

_SHELL_PUSHED = 35635.0
"""Fibre of the authors' paths for the pushed Shell, mm, in table 2."""

_BARS: dict[str, tuple[str, dict[str, Any], float]] = {
    "B, zigzag": ("zigzag", {"turns": "tight"}, 835.2),
    "C, contours": ("concentric", {"turns": "tight"}, 815.4),
    "D, uniform": ("isocurve", {"power": 0.0}, 789.3),
    "E, adaptive": ("isocurve", {}, 764.1),
}
"""Bars of figure 3: strategy, parameters and mm of fibre, here on every layer."""

_BAR_LAYERS, _FEWER_LAYERS = 10, 5
"""Layers of the published files of the bar, and a variation: the printed number is not said."""


def chen_field(
    part: str, file: str, rules: Mapping[str, PatchRule], force: FloatArray
) -> StressField:
    """Solve a part of the authors, of PLA: patch "support" held, 1 kN on "load"."""
    mesh = patches_from_rules(read_mesh(authors_folder() / part / file), rules)
    x, y, z = (float(component) for component in force)
    problem = Problem(
        mesh=mesh,
        material=isotropic(3500.0, 0.35),
        supports=(Support("support"),),
        loads={"load": (Force("load", (x, y, z)),)},
        order=1,
    )
    return solve(problem)["load"]


def shell_field(pushed: bool = False) -> StressField:
    """Shell held and pulled at the outer halves of two holes, or pushed at the inner ones."""
    rules = {}
    for name, height in _SHELL_HOLES.items():
        outer = "z" if height > 0.0 else "-z"
        inner = "-z" if height > 0.0 else "z"
        rules[name] = Cylinder(
            (-39.893, 5.0, height), "y", radius=6.0, tolerance=0.1, half=inner if pushed else outer
        )
    return chen_field("Shell", "Shell.tet", rules, np.array([0, 0, -1000.0 if pushed else 1000.0]))


def shell_paths(name: str) -> Toolpaths:
    """Read the published paths of the Shell, "zigzag" or "authors", planned for the pull."""
    file = PATHS["ours" if name == "authors" else name]
    return spread_paths(authors_folder() / "Shell" / file, _SHELL_LAYERS[name])


def _loop(progress: Progress) -> PartResult:
    paths = {"zigzag": authors_paths("zigzag"), "authors": authors_paths("ours")}
    return _tested(solve(authors_loop().problem)["pull"], paths, RHOS)


def _shell_pulled(progress: Progress) -> PartResult:
    return _tested(shell_field(), {name: shell_paths(name) for name in _SHELL_LAYERS}, RHOS)


def _shell_pushed(progress: Progress) -> PartResult:
    """Test the zigzag, and isocurves of ours for this load, as long as the authors' paths."""
    field = shell_field(pushed=True)
    layers = Planar(count=LAYERS_TABLE_2).cut(field.mesh, _BUILD)
    planned = plan_to_length(
        create("isocurve"), layers, field, Machine(), _SHELL_PUSHED / len(layers)
    )
    return _tested(field, {"zigzag": shell_paths("zigzag"), "authors": planned.toolpaths}, RHOS)


def _bar(progress: Progress) -> PartResult:
    rules = {"support": Plane("x", "min"), "load": Plane("x", "max")}
    field = chen_field("bar", "Bar.tet", rules, np.array([1000.0, 0.0, 0.0]))
    folder = authors_folder() / "bar"
    paths = {
        "authors": spread_paths(folder / PATHS["ours"], _BAR_LAYERS, 5.0),
        "zigzag": spread_paths(folder / PATHS["zigzag"], _BAR_LAYERS, 5.0),
    }
    planned = _tested(field, paths | _planned_bars(field, _BAR_LAYERS))
    (fewer, _) = _tested(field, _planned_bars(field, _FEWER_LAYERS)).readings
    return replace(planned, readings=(*planned.readings, {**planned.readings[0], **fewer}))


def _planned_bars(field: StressField, count: int) -> dict[str, Toolpaths]:
    """Plan bars B to E on some layers."""
    layers = Planar(count=count).cut(field.mesh, _BUILD)
    return {
        name: plan_to_length(
            create(strategy, parameters), layers, field, Machine(), wanted
        ).toolpaths
        for name, (strategy, parameters, wanted) in _BARS.items()
    }


GAIN_OF_CUBOID = 0.634
"""Gain of the breaking load of the cuboid that is pulled (figure 2 a), which sets its fibre."""


def _cuboid(progress: Progress) -> PartResult:
    """Strands along the load add their stiffness to that of the cuboid.

    Pushed, they add the share that they carry in compression of what they add when pulled.
    """
    gain = IN_COMPRESSION[FAR_END] * GAIN_OF_CUBOID
    return PartResult(
        ({NONE: 1.0, "along the load": 1.0}, {NONE: 1.0, "along the load": 1.0 + gain})
    )


# Plocher et al. 2022.


_SHARES = (0.6, 0.55, 0.65)
"""Share of the box that the optimised beam fills: the paper's, and variations of its drawing."""


def _beam(progress: Progress) -> PartResult:
    from ccfem.papers.plocher_2022.plates import optimised_beam
    from ccfem.papers.plocher_2022.study import PATTERNS, PRINTED, run_case

    readings = []
    for k, share in enumerate(_SHARES):
        progress(f"beam that fills {share:g} of its box", k / len(_SHARES))
        plate = optimised_beam(volume_fraction=share)
        case = run_case(plate, {name: PATTERNS[name] for name in PRINTED})
        # Under one load stiffnesses are to each other as the energies are the other way round.
        stiffness = {name: 1.0 / case.value(name, "energy_S") for name in PRINTED}
        ends = {"stiffest": max(stiffness.values()), "softest": min(stiffness.values())}
        readings.append({**stiffness, **ends})
    return PartResult(tuple(readings))


# Fang et al. 2024 and Zhang et al. 2025.


@cache
def _bracket() -> StressField:
    from ccfem.papers.fang_2024.authors import authors_mesh, authors_stress

    return authors_stress(authors_mesh(), order=1)


def _curved() -> Toolpaths:
    from ccfem.papers.fang_2024.authors import authors_layers, authors_strands

    return authors_strands(authors_layers(_bracket()))


def _fang_bracket(progress: Progress) -> PartResult:
    from ccfem.papers.fang_2024.strength import COUNTS, FIBRE as LENGTH

    field, curved = _bracket(), _curved()
    rings = create("concentric", {"spacing": 2.2, "turns": "tight"})
    paths = {"curved layers": curved}
    # The part stands on y of the files, the z of the paper.
    for name, axis, build in (("x", "x", (1.0, 0.0, 0.0)), ("z", "y", (0.0, 1.0, 0.0))):
        progress(f"rings on planar layers across {name}", 0.0)
        layers = Planar(count=COUNTS[axis]).cut(field.mesh, build)
        wanted = LENGTH / len(layers)
        planned = plan_to_length(rings, layers, field, Machine(minimum_length=42.0), wanted)
        paths[f"layers across {name}"] = planned.toolpaths
    return _tested(field, paths)


def _zhang_bracket(progress: Progress) -> PartResult:
    folder = Path(os.environ[ZHANG]) / "T-bracket" / "StripPath"
    dense = read_strands(folder, np.eye(3), np.array(_BUILD))
    return _tested(_bracket(), {"curved layers": _curved(), "dense": dense})


@dataclass(frozen=True)
class Part:
    """How a part is tested, and the environment variables that must name the data for it."""

    test: Callable[[Progress], PartResult]
    needs: tuple[str, ...] = ()

    @property
    def missing(self) -> tuple[str, ...]:
        """Variables that are not set."""
        return tuple(name for name in self.needs if not os.environ.get(name))


PARTS = {
    "Loop": Part(_loop, (CHEN,)),
    "Shell, pulled": Part(_shell_pulled, (CHEN,)),
    "Shell, pushed": Part(_shell_pushed, (CHEN,)),
    "cuboid, pushed": Part(_cuboid),
    "bar": Part(_bar, (CHEN,)),
    "bending beam": Part(_beam),
    "T-bracket": Part(_fang_bracket, (FANG,)),
    "T-bracket, dense": Part(_zhang_bracket, (FANG, ZHANG)),
}


def parts_tested(progress: Progress) -> Mapping[str, PartResult]:
    """All parts, each tested when it is first asked for."""
    return WhenAsked(tuple(PARTS), lambda name: PARTS[name].test(progress), progress, "testing")
