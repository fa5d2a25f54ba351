"""Three plates, five infill patterns, two materials: Plocher, Wioland and Panesar (2022).

Rapid Prototyping Journal 28 (2022) 1241. The plates are `plates`; one pixel of the finite
elements is one bead wide. Every pattern is laid as polylines, and as paths of pixels, which
is what the paper does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from time import perf_counter
from typing import Any

import numpy as np

from ccfem.base.progress import Progress, silent
from ccfem.fem.elasticity import StressField
from ccfem.fem.materials import named_material
from ccfem.fem.plates import solve_plane
from ccfem.geometry.polylines import lengths, pack
from ccfem.judging.evaluation import evaluate
from ccfem.judging.evaluation.indices.sinuosity import (
    path_sinuosity,
    sample_sinuosity,
    sinuosity_indices,
)
from ccfem.judging.evaluation.indices.stiffness_alignment import READINGS
from ccfem.judging.evaluation.layer_paths import PlanePaths, plane_paths
from ccfem.machine import Machine, Process
from ccfem.papers.contents import WhenAsked
from ccfem.papers.plocher_2022 import plane_study
from ccfem.papers.plocher_2022.plates import Plate, five_holes, plates
from ccfem.paths.linking.print_order import nearest_end_order
from ccfem.paths.planning import plan
from ccfem.paths.raster.raster_plan import RasterPlan
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.printing.export.gcode import gcode
from ccfem.printing.print_plan import PrintPlan
from ccfem.slicing.layers.layer import Layer, stress_on
from ccfem.strategies import create

Patterns = Mapping[str, tuple[str, dict[str, Any]]]

MATERIALS = {"C": "c_fram", "S": "s_fram"}

PATTERNS: dict[str, tuple[str, dict[str, Any]]] = {
    "grid 45": ("grid", {"angle": 45.0}),
    "grid 0": ("grid", {"angle": 0.0}),
    "concentric": ("concentric", {"joined": False, "filled": True, "turns": "tight"}),
    "mat": ("mat", {}),
    "mps": ("mps", {"turns": "tight"}),
}
"""The patterns in the order of the paper: name, then strategy and its parameters."""

PRINTED = ("grid 45", "concentric", "mat", "mps")
"""Patterns of case III that were printed of S-FRAM and bent."""

RASTER: dict[str, tuple[str, dict[str, Any]]] = {
    "grid 45": ("grid", {"angle": 45.0, "lines": "paper", "mode": "raster"}),
    "grid 0": ("grid", {"angle": 0.0, "lines": "paper", "mode": "raster"}),
    "concentric": ("concentric", {"joined": False, "mode": "raster"}),
    "mat": ("mat", {"mode": "raster"}),
    "mps": ("mps", {"mode": "raster"}),
}
"""The same as paths of pixels; every diagonal of pixels is a path of the grid at 45 degrees."""


@dataclass(frozen=True)
class PatternStudy:
    """One pattern on one plate."""

    # Of two layers for the grids, which turn from one to the next, of one for the others.
    toolpaths: Toolpaths
    paths: tuple[PlanePaths, ...]
    maps: tuple[plane_study.FibreMap, ...]
    laid: Mapping[str, plane_study.LaidPlate]  # by "C", "S", "mixed"
    values: Mapping[str, float]  # by index
    raster: tuple[RasterPlan, ...] = ()  # a layer each; none of a pattern of polylines


@dataclass(frozen=True)
class CaseStudy:
    """All patterns on one plate; `benchmarks` by material."""

    plate: Plate
    benchmarks: Mapping[str, plane_study.Benchmark]
    patterns: Mapping[str, PatternStudy]
    seconds: float

    def value(self, pattern: str, index: str) -> float:
        """One index of one pattern."""
        return self.patterns[pattern].values[index]


def machine_of(plate: Plate) -> Machine:
    """Printer of the paper's table 4, which cuts nothing off."""
    return Machine(
        fibre_width=plate.bead,
        minimum_length=0.0,
        minimum_radius=0.0,
        cutter_distance=0.0,
        fibre_speed=plane_study.PRINT_SPEED,
        travel_speed=plane_study.TRAVEL_SPEED,
        process=Process(prime="none", skirt_loops=0),
    )


def run_study(
    patterns: Patterns = PATTERNS,
    known: Mapping[str, CaseStudy] | None = None,
    progress: Progress = silent,
) -> Mapping[str, CaseStudy]:
    """Prepare the study: a case is run when it is asked for.

    Compiled code is loaded before any clock runs. `known` holds the same cases with other patterns:
    their benchmarks are taken over.
    """
    ready = cache(lambda: _load(patterns))

    def compute(name: str) -> CaseStudy:
        ready()
        if known is None:
            return run_case(plates()[name](), patterns)
        return run_case(known[name].plate, patterns, known[name].benchmarks)

    what = "planning and judging case" if known is None else "pixels of case"
    return WhenAsked(("I", "II", "III"), compute, progress, what)


def _load(patterns: Patterns) -> None:
    """Lay every pattern once, so that its code is compiled."""
    plate = five_holes(bead=1.6)
    layers, stress = plate.planned_on(1)
    for strategy, parameters in patterns.values():
        toolpaths = plan(create(strategy, parameters), layers, stress, machine_of(plate))
        _printed(toolpaths, machine_of(plate))


def run_case(
    plate: Plate,
    patterns: Patterns = PATTERNS,
    benchmarks: Mapping[str, plane_study.Benchmark] | None = None,
) -> CaseStudy:
    """Plan, solve and judge all patterns on one plate."""
    begun = perf_counter()
    stiffness = {
        key: plane_study.reduced_stiffness(named_material(name)) for key, name in MATERIALS.items()
    }
    solve_plane(plate.isotropic_field.problem)
    solved = perf_counter() - begun
    layers, stress = plate.planned_on(2)
    if benchmarks is None:
        field = plate.isotropic_field
        benchmarks = {
            key: plane_study.benchmark(field, matrix) for key, matrix in stiffness.items()
        }
    machine = machine_of(plate)
    studies = {}
    for name, (strategy, parameters) in patterns.items():
        planner = create(strategy, parameters)
        chosen = layers[: 2 if strategy == "grid" else 1]
        start = perf_counter()
        first = plan(planner, chosen[:1], stress, machine)
        planned = perf_counter() - start
        _printed(first, machine)
        printed = perf_counter() - start
        toolpaths = Toolpaths.concatenate([first, plan(planner, chosen[1:], stress, machine)])
        raster = _on_pixels(planner, chosen, stress, machine)
        paths = tuple(plane_paths(toolpaths, layer) for layer in chosen)
        maps = tuple(plane_study.fibre_map(p, plate.mesh.centres, plate.bead) for p in paths)
        angles = np.stack([m.angle for m in maps])
        solved_plates = {
            key: plane_study.laid_plate(plate.problem(matrix), angles, matrix)
            for key, matrix in stiffness.items()
        }
        mixed = plane_study.mixed_stiffness(paths, maps, stiffness["C"], stiffness["S"])
        solved_plates["mixed"] = plane_study.laid_plate(
            plate.problem(stiffness["S"]), angles, mixed
        )
        values = {
            "cpu": planned,
            "cpu_to_gcode": printed,
            "cpu_with_fe": printed + (solved if strategy == "mps" else 0.0),
            **_of_paths(toolpaths, chosen, stress, machine, plate),
            **_of_pixels(raster),
            **_of_plate(plate, benchmarks, maps, solved_plates),
        }
        studies[name] = PatternStudy(toolpaths, paths, maps, solved_plates, values, raster)
    return CaseStudy(plate, benchmarks, studies, perf_counter() - begun)


def _printed(toolpaths: Toolpaths, machine: Machine) -> str:
    """G-code of the paths of a layer, in the order of their nearest ends."""
    lines = list(toolpaths)
    starts, ends = np.array([line[[0, -1], :2] for line in lines]).swapaxes(0, 1)
    order, backward, _ = nearest_end_order(starts, ends)
    points, offsets = pack(
        [lines[k][::-1] if back else lines[k] for k, back in zip(order, backward, strict=True)]
    )
    paths = Toolpaths(
        points,
        np.broadcast_to([0.0, 0.0, 1.0], points.shape),
        offsets,
        np.zeros(len(lines), dtype=np.int64),
        np.full(len(lines), FIBRE),
        toolpaths.closed[order],
    )
    return gcode(PrintPlan(paths, np.full(1, 0.2), np.full(1, 0.2)), machine)


def _on_pixels(
    planner: Any, layers: Sequence[Layer], stress: StressField, machine: Machine
) -> tuple[RasterPlan, ...]:
    if getattr(planner, "mode", "polyline") != "raster":
        return ()
    return tuple(planner.raster(layer, stress_on(layer, stress), machine) for layer in layers)


def _of_pixels(raster: Sequence[RasterPlan]) -> dict[str, float]:
    """Compute the indices of the raw chains of pixels, before they are made straight."""
    if not raster:
        return {}
    winding, length = [], []
    for layer_plan in raster:
        points, offsets = pack(layer_plan.chains)
        winding.append(path_sinuosity(points, offsets, layer_plan.raster.pixel))
        length.append(lengths(points, offsets))
    means = [sinuosity.mean() for sinuosity in winding]
    weighted = [np.average(w, weights=n) for w, n in zip(winding, length, strict=True)]
    return {
        "si_raw": float(np.mean(weighted)),
        "si_raw_mean": float(np.mean(means)),
        "isolated": float(np.mean([layer_plan.paths.isolated.sum() for layer_plan in raster])),
    }


def _of_paths(
    toolpaths: Toolpaths, layers: Any, stress: Any, machine: Machine, plate: Plate
) -> dict[str, float]:
    """Compute the indices of the paths alone, mean of the layers."""
    total = evaluate(toolpaths, layers, stress, machine).total
    paths = [plane_paths(toolpaths, layer) for layer in layers]
    winding = [sinuosity_indices(sample_sinuosity(p, plate.bead)) for p in paths]
    mean = {key: float(np.mean([indices[key] for indices in winding])) for key in winding[0]}
    cover = np.mean([plane_study.bead_area(p, plate.bead) for p in paths], axis=0)
    return {
        "paths": total["paths"] / len(layers),
        "length": total["fibre_length"] / len(layers),
        "si": mean["sinuosity"],
        "si_mean": mean["sinuosity_mean"],
        "over_40": 100.0 * mean["over_40_count"],
        "over_40_length": 100.0 * mean["over_40_length"],
        "print": float(np.mean([plane_study.print_seconds(p) for p in paths])),
        "overlap": 100.0 * float(cover[0]),
        "gaps": 100.0 * float(cover[1]),
    }


def _of_plate(
    plate: Plate,
    benchmarks: Mapping[str, plane_study.Benchmark],
    maps: Sequence[plane_study.FibreMap],
    solved: Mapping[str, plane_study.LaidPlate],
) -> dict[str, float]:
    """Compute the indices of the solved plate."""
    off = plate.off_peaks
    values = {"agreement": 100.0 * benchmarks["C"].agreement(maps)}
    for key, best in benchmarks.items():
        plate_of_material = solved[key]
        values |= {
            f"energy_{key}": plate_of_material.strain_energy,
            f"density_sum_{key}": plate_of_material.density_sum,
            f"ratio_{key}": plate_of_material.strain_energy / best.laid.strain_energy,
            f"ratio_off_peaks_{key}": plate_of_material.energy_in(off) / best.laid.energy_in(off),
            f"stress_{key}": plate_of_material.stress,
            f"raw_stress_{key}": plate_of_material.raw_stress,
            f"mean_stress_{key}": plate_of_material.mean_stress,
            **{f"pi_{reading}_{key}": best.index(maps, reading) for reading in READINGS},
        }
    values |= {
        "energy_mixed": solved["mixed"].strain_energy,
        "mixed_over_S": solved["mixed"].strain_energy / solved["S"].strain_energy,
        "stress_mixed": solved["mixed"].stress,
        "raw_stress_mixed": solved["mixed"].raw_stress,
    }
    return values
