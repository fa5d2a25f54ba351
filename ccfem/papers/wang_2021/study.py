"""Five plates, optimised and full, under the load-dependent paths and those of other methods.

T. Wang et al., Load-dependent path planning method for 3D printing of continuous fiber reinforced
plastics, Composites Part A 140 (2021) 106181. The plates are those of `ccfem.cases.designed`;
lpp is strategy `svt`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from time import perf_counter
from types import MappingProxyType
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.progress import Progress, silent
from ccfem.cases import Case, create_case
from ccfem.cases.designed import ELEMENT_SIZE, PLATES, DesignPlate
from ccfem.fem.elasticity import StressField, solve
from ccfem.fem.topopt import Design
from ccfem.geometry.polylines import resample, turning_angles
from ccfem.judging.evaluation import evaluate
from ccfem.judging.evaluation.indices.curvature import sample_curvature
from ccfem.judging.evaluation.indices.matching import READINGS, matching_rate
from ccfem.judging.evaluation.layer_paths import PlanePaths, plane_paths
from ccfem.judging.virtual_testing import RHO, Specimen, Strand, virtual_bracket
from ccfem.machine import Machine
from ccfem.papers.contents import WhenAsked
from ccfem.paths.planning import plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers import LayerStress
from ccfem.slicing.layers.layer import Layer, stress_on
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create, named

PATTERNS: Mapping[str, tuple[str, dict[str, Any]]] = MappingProxyType(
    {
        "lpp": ("svt", {}),
        "lpp uncrossed": ("svt", {"crossings": False}),
        "concentric": ("concentric", {"joined": False, "filled": True, "turns": "tight"}),
        "zigzag 45": ("zigzag", {"angle": 45.0, "turns": "tight"}),
        "zigzag 90": ("zigzag", {"angle": 90.0, "turns": "tight"}),
        "offset": ("offset", {"turns": "tight"}),
        "streamline": ("streamline", {}),
        "eqs": ("eqs", {}),
    }
)
"""Name, then strategy and its parameters, with the turns of the paper.

lpp uncrossed ends its tracks in the joints.
"""

BASELINES = ("concentric", "zigzag 45", "zigzag 90")
"""The patterns of the slicer that the paper compares with."""

LIMIT = 0.26
"""Curvature, 1/mm, that the paper counts below."""
LEAST = 0.5
"""Step, mm, of the resampled curvature: with it none exceeds the paper's 4 / mm."""


@dataclass(frozen=True)
class PatternStudy:
    """One pattern on one part."""

    toolpaths: Toolpaths
    paths: PlanePaths
    total: Mapping[str, float]  # by index: from `evaluate`
    # (18,) by reading: matching rates at 5, 10, ..., 90 degrees; "strands" is "path" without links
    rates: Mapping[str, FloatArray]
    places: FloatArray  # (s, 2), mm: in steps of half a millimetre; outside the part too
    curvature: FloatArray  # (s,), 1/mm: at these places
    curvature_in_part: FloatArray  # (s,), 1/mm
    # (v,), 1/mm: at the vertices as planned
    native: FloatArray
    native_in_part: FloatArray
    # by "tension" and "bonded": stiffness of the part with its fibre over that without, in the
    # virtual test, with strands so stiff that all patterns have the same volume of fibre in the
    # part; empty for full plates
    stiffness: Mapping[str, float]
    seconds: float  # of planning

    def rate(self, angle: float, reading: str = "path") -> float:
        """Return the matching rate, %, within an angle that is a multiple of 5 degrees."""
        return 100.0 * float(self.rates[reading][round(angle / 5.0) - 1])


@dataclass(frozen=True)
class PartStudy:
    """All patterns on the optimised or on the full plate."""

    case: Case
    machine: Machine  # that of the case, with no shortest path
    field: StressField
    layer: Layer
    stress: LayerStress
    patterns: Mapping[str, PatternStudy]  # by name


@dataclass(frozen=True)
class PlateStudy:
    """One plate."""

    plate: DesignPlate
    optimised: PartStudy
    original: PartStudy
    design: Design | None  # of an optimisation in this run
    # Area by which its outline differs from the stored one, over the area; NaN without it.
    off_stored: float
    seconds: float


def run_study(progress: Progress = silent) -> Mapping[str, PlateStudy]:
    """Prepare the study; patterns whose strategy is not there are left out.

    A plate is run, and optimised again beside its stored outline, when it is asked for.
    """
    known = named()
    chosen = [name for name, (strategy, *_) in PATTERNS.items() if strategy in known]
    ready = cache(lambda: run_plate("l_shape", chosen, element_size=6.0))

    def compute(name: str) -> PlateStudy:
        ready()  # compiled code is loaded before any clock runs
        return run_plate(name, chosen, design=True)

    return WhenAsked(tuple(PLATES), compute, progress, "optimising, planning and judging")


def run_plate(
    name: str, patterns: Sequence[str], design: bool = False, element_size: float = ELEMENT_SIZE
) -> PlateStudy:
    """Optimise a plate if asked to, then solve, plan and judge both parts."""
    begun = perf_counter()
    plate = PLATES[name]
    new_design = plate.design() if design else None
    off = np.nan
    if new_design is not None:
        outline = plate.outline(new_design)
        off = outline.symmetric_difference(plate.part).area / outline.area
    optimised, original = (
        run_part(
            create_case(name, optimised=whole, element_size=element_size),
            [p for p in patterns if whole or p in BASELINES],
            whole,
        )
        for whole in (True, False)
    )
    return PlateStudy(plate, optimised, original, new_design, off, perf_counter() - begun)


def run_part(case: Case, patterns: Sequence[str], tested: bool) -> PartStudy:
    """Solve a part, lay the patterns on it, and judge them; `tested` virtually, too."""
    machine = replace(case.machine, minimum_length=0.0)
    field = solve(case.problem)["down"]
    (layer,) = Planar(count=1).cut(case.problem.mesh)
    stress = stress_on(layer, field)
    specimen = Specimen.of(field) if tested else None
    studies = {p: _run_pattern(p, layer, field, machine, specimen) for p in patterns}
    return PartStudy(case, machine, field, layer, stress, MappingProxyType(studies))


def _run_pattern(
    name: str, layer: Layer, field: StressField, machine: Machine, specimen: Specimen | None
) -> PatternStudy:
    strategy, parameters = PATTERNS[name]
    stress = stress_on(layer, field)
    begun = perf_counter()
    toolpaths = plan(create(strategy, parameters), (layer,), field, machine)
    seconds = perf_counter() - begun
    width = machine.fibre_width
    rates: dict[str, FloatArray] = {
        reading: matching_rate(toolpaths, [stress], reading, step=width) for reading in READINGS
    }
    rates["strands"] = matching_rate(toolpaths, [stress], "path", links=False, step=width)
    paths = plane_paths(toolpaths, layer)
    whole = PlanePaths(layer, paths.points, paths.offsets, paths.closed)
    places, curvature = curvature_along(whole)
    total = evaluate(toolpaths, (layer,), field, machine).total
    return PatternStudy(
        toolpaths,
        paths,
        total,
        MappingProxyType(rates),
        places,
        curvature,
        curvature_along(paths.in_part)[1],
        sample_curvature(whole, width).native,
        sample_curvature(paths, width).native,
        {} if specimen is None else _tested(paths, specimen, RHO / total["overfill"]),
        seconds,
    )


def _tested(paths: PlanePaths, specimen: Specimen, rho: float) -> dict[str, float]:
    """Stiffness gained by the fibre that lies in the part."""
    lines = paths.in_part
    fibre = Toolpaths.from_plane(np.split(lines.points, lines.offsets[1:-1]), lines.layer)
    both = virtual_bracket(fibre, specimen, Strand(rho), span=())
    return {
        "tension": both.tension.stiffness / both.tension.unreinforced_stiffness,
        "bonded": both.bonded.stiffness / both.bonded.unreinforced_stiffness,
    }


def curvature_along(paths: PlanePaths) -> tuple[FloatArray, FloatArray]:
    """Points (s, 2), mm, in equal steps, and the curvature there, (s,), 1/mm.

    ``2 sin(a / 2) / h`` with the turn a and the step h, which is at most ``2 / h``: the paper's
    common maximum of about 4 / mm is that of half a millimetre.
    """
    if not len(paths):
        return np.zeros((0, 2)), np.zeros(0)
    points, offsets = resample(paths.points, paths.offsets, LEAST)
    angle = turning_angles(points, offsets, paths.closed)
    count = np.diff(offsets)
    size = np.repeat(paths.lengths / np.maximum(count - 1, 1), count)
    inner = np.ones(len(points), dtype=bool)
    inner[offsets[:-1]] = paths.closed
    inner[offsets[1:] - 1] = False
    return points[inner], (2.0 * np.sin(0.5 * angle) / size)[inner]
