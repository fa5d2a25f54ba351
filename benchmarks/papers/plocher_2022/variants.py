"""What was tried where a number of the paper may hang on what it does not state."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.papers.plocher_2022.study import CaseStudy, machine_of
from ccfem.arrays import FloatArray
from ccfem.cases.plates import Plate, five_holes, optimised_beam, single_hole
from ccfem.elasticity.plane import PlaneField
from ccfem.evaluate.fibre_map import fibre_map
from ccfem.evaluate.plane_paths import PlanePaths, plane_paths
from ccfem.evaluate.plane_study import laid_plate, print_seconds, reduced_stiffness
from ccfem.evaluate.sinuosity import path_sinuosity, sample_sinuosity, sinuosity_indices
from ccfem.evaluate.stiffness_alignment import agreement, strongest
from ccfem.geometry.polylines import pack, sample_midpoints
from ccfem.materials import named_material
from ccfem.strategies import create, plan
from ccfem.tensor import largest_in_plane

__all__ = [
    "VARIANTS",
    "Tried",
    "pixel_chains",
    "try_variants",
    "variant_quantities",
    "variant_table",
]

_MPS: tuple[str, dict[str, Any]] = ("mps", {})
_ENDS: tuple[str, dict[str, Any]] = ("mps", {"seeds": "ends"})
_GRID: tuple[str, dict[str, Any]] = ("grid", {"angle": 45.0})
_DIAGONALS: tuple[str, dict[str, Any]] = ("grid", {"angle": 45.0, "lines": "paper"})

VARIANTS: tuple[tuple[str, Any, dict[str, float], tuple[str, dict[str, Any]]], ...] = (
    *(
        (f"bead {bead:g} mm, I, {label}", single_hole, {"bead": bead}, strategy)
        for bead in (0.8, 1.0, 1.2)
        for label, strategy in (("grid 45", _GRID), ("mps", _MPS))
    ),
    ("every diagonal of pixels a path, I, grid 45", single_hole, {}, _DIAGONALS),
    ("every diagonal of pixels a path, II, grid 45", five_holes, {}, _DIAGONALS),
    ("every diagonal of pixels a path, III, grid 45", optimised_beam, {}, _DIAGONALS),
    ("radius 6.46 mm, I, grid 45", single_hole, {"radius": 6.46}, _GRID),
    ("radius 6.46 mm, I, mps", single_hole, {"radius": 6.46}, _MPS),
    ("seeds at load and support, I, mps", single_hole, {}, _ENDS),
    ("seeds at load and support, II, mps", five_holes, {}, _ENDS),
)
"""Name, plate, its parameters, and the strategy with its parameters."""


@dataclass(frozen=True)
class Tried:
    """What a variant gives: C-FRAM, one layer or two."""

    agreement: float
    energy: float
    stress: float
    print_seconds: float
    over_40: float


def strongest_direction(field: PlaneField) -> Any:
    """Direction (m,) of the largest stress, radians, and where there is one."""
    largest, smallest, angle = largest_in_plane(field.stress)
    across, defined = strongest(largest, smallest)
    return angle + np.where(across, 0.5 * np.pi, 0.0), defined


def try_variant(plate: Plate, strategy: str, parameters: dict[str, Any]) -> Tried:
    """Plan and solve one pattern on one plate."""
    stiffness = reduced_stiffness(named_material("c_fram"))
    layers, stress = plate.planned_on(2)
    layers = layers[: 2 if strategy == "grid" else 1]
    toolpaths = plan(create(strategy, parameters), layers, stress, machine_of(plate))
    paths = [plane_paths(toolpaths, layer) for layer in layers]
    maps = [fibre_map(p, plate.mesh.centres, plate.bead) for p in paths]
    laid = laid_plate(plate.problem(stiffness), np.stack([m.angle for m in maps]), stiffness)
    direction, defined = strongest_direction(plate.isotropic_field)
    winding = sinuosity_indices(sample_sinuosity(paths[0], plate.bead))
    return Tried(
        100.0 * float(np.mean([agreement(m.angle - direction)[defined] for m in maps])),
        1e6 * laid.strain_energy,
        laid.stress,
        float(np.mean([print_seconds(p) for p in paths])),
        100.0 * winding["over_40_count"],
    )


def try_variants() -> dict[str, Tried]:
    """Try all variants."""
    return {
        name: try_variant(make(**parameters), strategy, options)
        for name, make, parameters, (strategy, options) in VARIANTS
    }


def variant_quantities(
    tried: Mapping[str, Tried], study: Mapping[str, CaseStudy]
) -> dict[str, float]:
    """Quantities of `expected.toml` that variants give; their names start with "variant"."""
    found = {
        f"variant agreement mps with seeds at the ends {name}": tried[
            f"seeds at load and support, {name}, mps"
        ].agreement
        for name in ("I", "II")
    }
    for name, case in study.items():
        slow = tried[f"every diagonal of pixels a path, {name}, grid 45"].print_seconds
        longer = 100.0 * (slow / case.value("concentric", "print") - 1.0)
        found[f"variant print time of every diagonal over concentric {name}, %"] = longer
        means = [stairs_sinuosity(one.paths, case.plate.bead) for one in case.patterns.values()]
        spread = 100.0 * (max(means) / min(means) - 1.0)
        found[f"variant range of sinuosity of stairs {name}, %"] = spread
    return found


def pixel_chains(paths: PlanePaths, bead: float) -> list[FloatArray]:
    """Paths as chains of raw pixels, (k, 2) arrays, mm, a square step at a time.

    Each path is followed from the centre of one pixel to that of the next; where it goes to one
    across a corner, by way of the pixel beside both.
    """
    points, _, _, line = sample_midpoints(paths.points, paths.offsets, 0.1 * bead)
    pixels = np.floor(points / bead).astype(np.int64)
    chains = []
    for own in np.split(pixels, np.flatnonzero(np.diff(line)) + 1):
        chain = _fresh(own)
        full = np.empty((2 * len(chain) - 1, 2))
        full[::2] = chain
        full[1::2] = np.stack([chain[1:, 0], chain[:-1, 1]], axis=1)
        full = _fresh(full)
        if len(full) > 1:
            chains.append(bead * (full + 0.5))
    return chains


def _fresh(points: Any) -> Any:
    """Points that are not the one before them."""
    return points[np.append(True, (np.diff(points, axis=0) != 0).any(axis=1))]


def stairs_sinuosity(layers: Sequence[PlanePaths], bead: float) -> float:
    """Mean sinuosity of paths as chains of raw pixels."""
    found = [path_sinuosity(*pack(pixel_chains(paths, bead)), bead) for paths in layers]
    return float(np.concatenate(found).mean())


def variant_table(tried: Mapping[str, Tried]) -> str:
    """Markdown table of all variants."""
    lines = [
        "| variant | agreement, % | energy C, 1e-6 N mm | stress p99.9 C, MPa | print, s | "
        "> 40 mm, % |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {name} | {found.agreement:.1f} | {found.energy:.1f} | {found.stress:.3f} | "
        f"{found.print_seconds:.0f} | {found.over_40:.0f} |"
        for name, found in tried.items()
    ]
    return "\n".join(lines) + "\n"
