"""What was tried where a number of the paper may depend on what it does not state."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ccfem.base.tensor import strongest_in_plane
from ccfem.fem.materials import named_material
from ccfem.fem.plates import PlaneField
from ccfem.geometry.polylines import pack
from ccfem.judging.evaluation.indices.sinuosity import (
    path_sinuosity,
    sample_sinuosity,
    sinuosity_indices,
)
from ccfem.judging.evaluation.indices.stiffness_alignment import agreement
from ccfem.judging.evaluation.plane_paths import plane_paths
from ccfem.papers.plocher_2022.fibre_map import fibre_map
from ccfem.papers.plocher_2022.plane_study import laid_plate, print_seconds, reduced_stiffness
from ccfem.papers.plocher_2022.plates import Plate, five_holes, single_hole
from ccfem.papers.plocher_2022.study import RASTER, CaseStudy, machine_of
from ccfem.paths.planning import plan
from ccfem.paths.raster.patterns import concentric_regions, medial_regions
from ccfem.paths.raster.raster_plan import raster_plan
from ccfem.strategies import create

_MPS: tuple[str, dict[str, Any]] = ("mps", {"turns": "tight"})
_ENDS: tuple[str, dict[str, Any]] = ("mps", {"seeds": "ends", "turns": "tight"})
_GRID: tuple[str, dict[str, Any]] = ("grid", {"angle": 45.0})
_PIXEL_ENDS: tuple[str, dict[str, Any]] = ("mps", {"seeds": "ends", "mode": "raster"})

VARIANTS: tuple[tuple[str, Any, dict[str, float], tuple[str, dict[str, Any]]], ...] = (
    *(
        (f"bead {bead:g} mm, I, {label}", single_hole, {"bead": bead}, strategy)
        for bead in (0.8, 1.0, 1.2)
        for label, strategy in (("grid 45", _GRID), ("mps", _MPS))
    ),
    *(
        (f"raster, bead {bead:g} mm, I, {name}", single_hole, {"bead": bead}, RASTER[name])
        for bead in (0.6, 1.0, 1.2)
        for name in ("grid 45", "mps")
    ),
    ("radius 6.46 mm, I, grid 45", single_hole, {"radius": 6.46}, _GRID),
    ("radius 6.46 mm, I, mps", single_hole, {"radius": 6.46}, _MPS),
    ("seeds at load and support, I, mps", single_hole, {}, _ENDS),
    ("seeds at load and support, II, mps", five_holes, {}, _ENDS),
    ("raster, seeds at load and support, I, mps", single_hole, {}, _PIXEL_ENDS),
    ("raster, seeds at load and support, II, mps", five_holes, {}, _PIXEL_ENDS),
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
    _, angle, defined = strongest_in_plane(field.stress)
    return angle, defined


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


def variant_quantities(tried: Mapping[str, Tried]) -> dict[str, float]:
    """Quantities of `expected.toml` that variants give; their names start with "variant"."""
    return {
        f"variant agreement mps with seeds at the ends {name}": tried[
            f"seeds at load and support, {name}, mps"
        ].agreement
        for name in ("I", "II")
    }


def metric_table(cases: Mapping[str, CaseStudy]) -> str:
    """Markdown table: rings of pixels by three metrics, SI of their raw pixels, mean of paths."""
    lines = ["| case | rings by | concentric | mat | paths, concentric | mat |", "|" + "---|" * 6]
    for name, case in cases.items():
        (made,) = case.patterns["concentric"].raster
        for metric in ("euclid", "cross", "square"):
            winding, count = [], []
            for regions_of in (concentric_regions, medial_regions):
                regions = regions_of(made.raster.mask, metric=metric)
                traced = raster_plan(made.raster, regions)
                found = path_sinuosity(*pack(traced.chains), made.raster.pixel)
                winding.append(f"{found.mean():.3f}")
                count.append(str(len(found)))
            lines.append(f"| {' | '.join([name, metric, *winding, *count])} |")
    return "\n".join(lines) + "\n"


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
