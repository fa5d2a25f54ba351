"""Three plates, five infill patterns, two materials: Plocher, Wioland and Panesar (2022).

Rapid Prototyping Journal 28 (2022) 1241. The plates are `ccfem.cases.plates`; one pixel of the
finite elements is one bead wide.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from ccfem.cases.plates import Plate, five_holes, plates
from ccfem.evaluate import evaluate
from ccfem.evaluate.fibre_map import FibreMap, fibre_map
from ccfem.evaluate.plane_paths import PlanePaths, plane_paths
from ccfem.evaluate.plane_study import (
    PRINT_SPEED,
    TRAVEL_SPEED,
    Benchmark,
    LaidPlate,
    bead_area,
    benchmark,
    laid_plate,
    mixed_stiffness,
    print_seconds,
    reduced_stiffness,
)
from ccfem.evaluate.stiffness_alignment import READINGS
from ccfem.machine import Machine
from ccfem.materials import named_material
from ccfem.strategies import create, plan
from ccfem.toolpaths import Toolpaths

__all__ = [
    "MATERIALS",
    "PATTERNS",
    "CaseStudy",
    "PatternStudy",
    "machine_of",
    "run_case",
    "run_study",
]

MATERIALS = {"C": "c_fram", "S": "s_fram"}

PATTERNS: dict[str, tuple[str, dict[str, Any]]] = {
    "grid 45": ("grid", {"angle": 45.0}),
    "grid 0": ("grid", {"angle": 0.0}),
    "concentric": ("concentric", {"joined": False, "filled": True}),
    "mat": ("mat", {}),
    "mps": ("mps", {}),
}
"""The patterns in the order of the paper: name, then strategy and its parameters."""


@dataclass(frozen=True)
class PatternStudy:
    """One pattern on one plate.

    Attributes
    ----------
    toolpaths : Toolpaths
        Of two layers for the grids, which turn from one to the next, of one for the others.
    paths : tuple of PlanePaths
    maps : tuple of FibreMap
    laid : mapping of "C", "S", "mixed" to LaidPlate
    values : mapping of index to float
    """

    toolpaths: Toolpaths
    paths: tuple[PlanePaths, ...]
    maps: tuple[FibreMap, ...]
    laid: Mapping[str, LaidPlate]
    values: Mapping[str, float]


@dataclass(frozen=True)
class CaseStudy:
    """All patterns on one plate; `benchmarks` by material."""

    plate: Plate
    benchmarks: Mapping[str, Benchmark]
    patterns: Mapping[str, PatternStudy]
    seconds: float

    def value(self, pattern: str, index: str) -> float:
        """One index of one pattern."""
        return self.patterns[pattern].values[index]


def machine_of(plate: Plate) -> Machine:
    """Printer of the paper's table 4, which cuts nothing off."""
    return Machine(
        fibre_width=plate.bead,
        deposited_width=plate.bead,
        minimum_length=0.0,
        minimum_radius=0.0,
        fibre_speed=PRINT_SPEED,
        travel_speed=TRAVEL_SPEED,
    )


def run_study(
    cases: Sequence[str] = ("I", "II", "III"),
    patterns: Mapping[str, tuple[str, dict[str, Any]]] = PATTERNS,
) -> dict[str, CaseStudy]:
    """Run the whole study, or a part of it; compiled code is loaded before any clock runs."""
    plate = five_holes()
    layers, stress = plate.planned_on(2)
    for strategy, parameters in patterns.values():
        plan(create(strategy, parameters), layers[:1], stress, machine_of(plate))
    return {name: run_case(plates()[name](), patterns) for name in cases}


def run_case(
    plate: Plate, patterns: Mapping[str, tuple[str, dict[str, Any]]] = PATTERNS
) -> CaseStudy:
    """Plan, solve and judge all patterns on one plate."""
    begun = perf_counter()
    stiffness = {key: reduced_stiffness(named_material(name)) for key, name in MATERIALS.items()}
    field = plate.isotropic_field
    solved = perf_counter() - begun
    layers, stress = plate.planned_on(2)
    benchmarks = {key: benchmark(field, matrix) for key, matrix in stiffness.items()}
    machine = machine_of(plate)
    found = {}
    for name, (strategy, parameters) in patterns.items():
        planner = create(strategy, parameters)
        chosen = layers[: 2 if strategy == "grid" else 1]
        start = perf_counter()
        toolpaths = plan(planner, chosen, stress, machine)
        planned = (perf_counter() - start) / len(chosen)
        paths = tuple(plane_paths(toolpaths, layer) for layer in chosen)
        maps = tuple(fibre_map(p, plate.mesh.centres, plate.bead) for p in paths)
        angles = np.stack([m.angle for m in maps])
        laid = {
            key: laid_plate(plate.problem(matrix), angles, matrix)
            for key, matrix in stiffness.items()
        }
        mixed = mixed_stiffness(paths, maps, stiffness["C"], stiffness["S"])
        laid["mixed"] = laid_plate(plate.problem(stiffness["S"]), angles, mixed)
        values = {
            "cpu": planned,
            "cpu_with_fe": planned + (solved if strategy == "mps" else 0.0),
            **_of_paths(toolpaths, chosen, stress, machine, plate),
            **_of_plate(plate, benchmarks, maps, laid),
        }
        found[name] = PatternStudy(toolpaths, paths, maps, laid, values)
    return CaseStudy(plate, benchmarks, found, perf_counter() - begun)


def _of_paths(
    toolpaths: Toolpaths, layers: Any, stress: Any, machine: Machine, plate: Plate
) -> dict[str, float]:
    """Compute the indices of the paths alone; per layer where they are sums."""
    total = evaluate(toolpaths, layers, stress, machine).total
    paths = [plane_paths(toolpaths, layer) for layer in layers]
    cover = np.mean([bead_area(p, plate.bead) for p in paths], axis=0)
    return {
        "paths": total["paths"] / len(layers),
        "length": total["fibre_length"] / len(layers),
        "si": total["sinuosity"],
        "si_mean": total["sinuosity_mean"],
        "over_40": 100.0 * total["over_40_count"],
        "over_40_length": 100.0 * total["over_40_length"],
        "print": float(np.mean([print_seconds(p) for p in paths])),
        "overlap": 100.0 * float(cover[0]),
        "gaps": 100.0 * float(cover[1]),
    }


def _of_plate(
    plate: Plate,
    benchmarks: Mapping[str, Benchmark],
    maps: Sequence[FibreMap],
    laid: Mapping[str, LaidPlate],
) -> dict[str, float]:
    """Compute the indices of the solved plate."""
    off = plate.off_peaks
    values = {"agreement": 100.0 * benchmarks["C"].agreement(maps)}
    for key, best in benchmarks.items():
        own = laid[key]
        values |= {
            f"energy_{key}": own.strain_energy,
            f"density_sum_{key}": own.density_sum,
            f"ratio_{key}": own.strain_energy / best.laid.strain_energy,
            f"ratio_off_peaks_{key}": own.energy_in(off) / best.laid.energy_in(off),
            f"stress_{key}": own.stress,
            f"raw_stress_{key}": own.raw_stress,
            **{f"pi_{reading}_{key}": best.index(maps, reading) for reading in READINGS},
        }
    values |= {
        "energy_mixed": laid["mixed"].strain_energy,
        "mixed_over_S": laid["mixed"].strain_energy / laid["S"].strain_energy,
        "stress_mixed": laid["mixed"].stress,
        "raw_stress_mixed": laid["mixed"].raw_stress,
    }
    return values
