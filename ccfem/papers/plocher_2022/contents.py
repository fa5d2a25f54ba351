"""What of Plocher et al. 2022 can be made again."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from ccfem.base.csv_table import write_csv
from ccfem.base.progress import Progress, silent
from ccfem.base.tensor import strongest_in_plane
from ccfem.fem.materials import named_material
from ccfem.fem.plates import PlaneField
from ccfem.geometry.polylines import pack
from ccfem.judging.evaluation import COLUMNS
from ccfem.judging.evaluation.indices.sinuosity import (
    path_sinuosity,
    sample_sinuosity,
    sinuosity_indices,
)
from ccfem.judging.evaluation.indices.stiffness_alignment import agreement
from ccfem.judging.evaluation.layer_paths import plane_paths
from ccfem.papers.contents import Contents, claim_table, judged, table, write_figures, write_report
from ccfem.papers.plocher_2022.figures import figures
from ccfem.papers.plocher_2022.plane_study import (
    fibre_map,
    laid_plate,
    print_seconds,
    reduced_stiffness,
)
from ccfem.papers.plocher_2022.plates import Plate, five_holes, single_hole
from ccfem.papers.plocher_2022.study import (
    MATERIALS,
    PRINTED,
    RASTER,
    CaseStudy,
    machine_of,
    run_study,
)
from ccfem.paths.planning import plan
from ccfem.paths.planning.strategy import Strategy
from ccfem.paths.raster.patterns import concentric_regions, medial_regions
from ccfem.paths.raster.raster_plan import raster_plan
from ccfem.strategies import create
from ccfem.strategies.grid import Grid

EXPECTED = Path(__file__).with_name("expected.toml")
"""Claims of the paper, with the ranges that count as reproduced."""

# The whole of the paper: its study, figures, tables and claims beside ours.


PROTOTYPE_NOTE = """\
Both chains follow the same rules; they share no code. Where they differ:

- The bitmap: here a pixel is solid where its centre lies in the section, with ties outside. The
  holes of I and II differ from the prototype's by a few pixels, which may be what moves the peak
  stress of 0/90 on case I; the outline of III is smoothed here.
- MAT: the medial axis is symmetric here; MAT of case II, which has most of it, agrees better.
- Paths over 40 mm and SI of raw pixels depend on the tracer. Here a ring stays one path where it
  can, so that concentric has more long paths; pixels at its sharp tips stay isolated, and diagonal
  steps cut its corners, so that raw chains wind less.
"""


def write_all(folder: Path, progress: Progress = silent) -> None:
    """Run the study, and write figures, tables and claims into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    begun = perf_counter()
    study = run_study(progress=progress)
    raster = run_study(patterns=RASTER, known=study, progress=progress)
    tried = try_variants()
    values = quantities(study) | raster_quantities(raster) | variant_quantities(tried)
    claims = claim_table(judged(values, EXPECTED))
    computed = perf_counter() - begun
    drawn = write_figures(figures(study, raster), folder)
    rows = [
        [name, mode, pattern, index, f"{value:.8g}"]
        for mode, cases in (("polyline", study), ("raster", raster))
        for name, case in cases.items()
        for pattern, paths in case.patterns.items()
        for index, value in paths.values.items()
    ]
    write_csv(folder / "results.csv", ("case", "mode", "pattern", "index", "value"), rows)
    introduction = (
        "# Infill patterns of Plocher, Wioland and Panesar (2022): ours beside theirs\n\n"
        "Written by `ccfem reproduce plocher_2022`.\n\n"
        f"Study {computed:.1f} s, figures {perf_counter() - begun - computed:.1f} s.\n"
    )
    sections = {"Claims": claims}
    for name in study:
        sections[f"Case {name}, polylines"] = result_table(study[name])
        sections[f"Case {name}, pixels"] = result_table(raster[name])
    sections |= {
        "Pixels beside a prototype (in brackets)": f"{prototype_table(raster)}\n{PROTOTYPE_NOTE}",
        "Rings of pixels by metric: SI of raw pixels": metric_table(raster),
        "Ranks of PI": rank_table(values),
        "Variants tried": variant_table(tried),
        "Table 2: indices": index_table(),
        "Table 3: cases": case_table(study),
        "Table 5: materials": material_table(),
    }
    write_report(folder, introduction, sections, drawn)
    print(claims)
    print(f"report.md: {perf_counter() - begun:.1f} s")


# What was tried where a number of the paper may depend on what it does not state.


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


def try_variant(plate: Plate, strategy: Strategy) -> Tried:
    """Plan and solve one pattern on one plate."""
    stiffness = reduced_stiffness(named_material("c_fram"))
    layers, stress = plate.planned_on(2)
    layers = layers[: 2 if isinstance(strategy, Grid) else 1]
    toolpaths = plan(strategy, layers, stress, machine_of(plate))
    paths = [plane_paths(toolpaths, layer) for layer in layers]
    maps = [fibre_map(p, plate.mesh.centres, plate.bead) for p in paths]
    solved = laid_plate(plate.problem(stiffness), np.stack([m.angle for m in maps]), stiffness)
    direction, defined = strongest_direction(plate.isotropic_field)
    winding = sinuosity_indices(sample_sinuosity(paths[0], plate.bead))
    return Tried(
        100.0 * float(np.mean([agreement(m.angle - direction)[defined] for m in maps])),
        1e6 * solved.strain_energy,
        solved.stress,
        float(np.mean([print_seconds(p) for p in paths])),
        100.0 * winding["over_40_count"],
    )


def try_variants() -> dict[str, Tried]:
    """Try all variants."""
    return {
        name: try_variant(make(**parameters), create(strategy, options))
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
    rows = []
    for name, case in cases.items():
        (made,) = case.patterns["concentric"].raster
        for metric in ("euclid", "cross", "square"):
            winding = []
            for regions_of in (concentric_regions, medial_regions):
                traced = raster_plan(made.raster, regions_of(made.raster.mask, metric=metric))
                winding.append(path_sinuosity(*pack(traced.chains), made.raster.pixel))
            means = [f"{sinuosity.mean():.3f}" for sinuosity in winding]
            rows.append([name, metric, *means, *(str(len(sinuosity)) for sinuosity in winding)])
    return table(("case", "rings by", "concentric", "mat", "paths, concentric", "mat"), rows)


def variant_table(tried: Mapping[str, Tried]) -> str:
    """Markdown table of all variants."""
    head = ("variant", "agreement, %", "energy C, 1e-6 N mm", "stress p99.9 C, MPa", "print, s")
    rows = [
        (
            *(name, f"{variant.agreement:.1f}", f"{variant.energy:.1f}", f"{variant.stress:.3f}"),
            *(f"{variant.print_seconds:.0f}", f"{variant.over_40:.0f}"),
        )
        for name, variant in tried.items()
    ]
    return table((*head, "> 40 mm, %"), rows)


_Both = tuple[Mapping[str, CaseStudy], Mapping[str, CaseStudy]]


def _run(progress: Progress) -> _Both:
    """Study on polylines, and on pixels."""
    study = run_study(progress=progress)
    return study, run_study(patterns=RASTER, known=study, progress=progress)


def _claims(study: _Both) -> str:
    """Claims, but for those that need the variants, which take as long again."""
    return claim_table(judged(quantities(study[0]) | raster_quantities(study[1]), EXPECTED))


CONTENTS = Contents(
    title="Plocher et al. 2022, infill patterns",
    seconds=60.0,
    run=_run,
    whole=write_all,
    tables={
        "claims": lambda study: _claims(study()),
        "table2": lambda study: index_table(),
        "table3": lambda study: case_table(study()[0]),
        "table5": lambda study: material_table(),
    },
    figures=lambda study, number: figures(study[0], study[1], number),
    numbers=(2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14),
)


# The claims of the paper beside ours: every quantity is computed from a run.

_STRAIGHT = 0.002
"""Sinuosities no further apart are equal."""


def quantities(study: Mapping[str, CaseStudy]) -> dict[str, float]:
    """Every quantity that `expected.toml` may name; those whose patterns did not run are left out.

    Orders that hold are 1, others 0.
    """
    values: dict[str, float] = {}
    for name, case in study.items():
        have = set(case.patterns)
        for rule in (_agreement, _energy, _stress, _printing, _sensitivity, _mixed, _ranks):
            values |= rule(case, name, have)
    return values


def raster_quantities(raster: Mapping[str, CaseStudy]) -> dict[str, float]:
    """Quantities of paths of pixels: their names start with "raster"."""
    values = {f"raster {name}": value for name, value in quantities(raster).items()}
    for name, case in raster.items():
        winding = [case.value(p, "si_raw_mean") for p in case.patterns]
        spread = 100.0 * (max(winding) / min(winding) - 1.0)
        values[f"raster range of sinuosity of raw pixels {name}, %"] = spread
    return values


def _agreement(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    values = {f"agreement {p} {name}": case.value(p, "agreement") for p in have}
    if have >= {"mat", "concentric"}:
        less = case.value("mat", "agreement") - case.value("concentric", "agreement")
        values[f"agreement mat less concentric {name}"] = less
    return values


def _energy(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    ratio = {p: case.value(p, "ratio_C") for p in have}
    soft = {p: case.value(p, "energy_S") for p in have}
    values = {
        f"least energy ratio C {name}": min(ratio.values()),
        f"range of energy {name} S, %": 100.0 * (max(soft.values()) / min(soft.values()) - 1.0),
    }
    if have >= {"mps", "grid 45"}:
        values[f"energy grid 45 over mps {name}"] = ratio["grid 45"] / ratio["mps"]
        drop = 1.0 - case.value("mps", "stress_C") / case.value("grid 45", "stress_C")
        values[f"stress drop mps {name}"] = 100.0 * drop
    if have >= {"mps", "grid 45", "grid 0", "concentric", "mat"}:
        middle = [ratio[p] for p in ("grid 0", "concentric", "mat")]
        holds = ratio["mps"] < min(middle) and max(middle) < ratio["grid 45"]
        values[f"order of energies {name}"] = float(holds)
    if name == "III" and have >= set(PRINTED):
        printed = {p: soft[p] for p in PRINTED}
        spread = max(printed.values()) / min(printed.values()) - 1.0
        values["spread of stiffness of the printed patterns III S, %"] = 100.0 * spread
        values["mat stiffest of the printed patterns III S"] = float(
            min(printed, key=printed.__getitem__) == "mat"
        )
    if have >= {"mps", "concentric", "mat"}:
        for key, suffix in (("ratio_C", ""), ("ratio_off_peaks_C", " off peaks")):
            order = [case.value(p, key) for p in ("mps", "concentric", "mat")]
            best = min(case.value(p, key) for p in have)
            holds = order == sorted(order) and order[0] == best
            values[f"order on {name} C{suffix}"] = float(holds)
    return values


def _stress(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    best = case.benchmarks["C"].laid
    largest = min(case.value(p, "stress_C") for p in have)
    mean = min(case.value(p, "mean_stress_C") for p in have)
    return {
        f"stress of benchmark over least {name}": best.stress / largest,
        f"mean stress of benchmark over least {name}": best.mean_stress / mean,
    }


def _printing(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    values = {}
    if have >= {"mps", "concentric"}:
        seconds = case.value("mps", "cpu_with_fe") / case.value("concentric", "cpu_with_fe")
        values[f"cpu mps over concentric {name}, %"] = 100.0 * (seconds - 1.0)
    if have >= {"grid 45", "concentric"}:
        longer = case.value("grid 45", "print") / case.value("concentric", "print") - 1.0
        values[f"print time grid 45 over concentric {name}, %"] = 100.0 * longer
    if "concentric" in have and len(have) > 1:
        for key, label in (("cpu_with_fe", "cpu"), ("print", "print time")):
            others = min(case.value(p, key) for p in have - {"concentric"})
            values[f"{label} concentric over least other {name}"] = (
                case.value("concentric", key) / others
            )
        long = {p: case.value(p, "over_40") for p in have}
        holds = long["concentric"] == max(long.values())
        values[f"concentric longest {name}"] = float(holds)
    winding = {p: case.value(p, "si") for p in have}
    values[f"range of sinuosity {name}, %"] = 100.0 * (
        max(winding.values()) / min(winding.values()) - 1.0
    )
    grids = [winding[p] for p in have if p.startswith("grid")]
    if grids:
        holds = min(grids) <= min(winding.values()) + _STRAIGHT
        values[f"grid straightest {name}"] = float(holds)
    return values


def _sensitivity(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    return {
        f"drop of f {key} {name}, %": 100.0 * (1.0 - float(best.curve.values[-1]))
        for key, best in case.benchmarks.items()
    }


def _mixed(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    values: dict[str, float] = {}
    if "grid 45" not in have:
        return values
    energy = {p: case.value(p, "energy_mixed") for p in have}
    values[f"grid 45 softest mixed {name}"] = float(energy["grid 45"] == max(energy.values()))
    for p in have - {"grid 45"}:
        drop = 1.0 - case.value(p, "stress_mixed") / case.value("grid 45", "stress_mixed")
        values[f"mixed stress drop {p} {name}"] = 100.0 * drop
    return values


def _ranks(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    values = {}
    for key in case.benchmarks:
        for reading in ("weighted", "literal", "harmonic"):
            label = "PI" if reading == "weighted" else f"PI {reading}"
            for patterns, suffix in ((have, ""), (have - {"grid 0"}, " without 0/90")):
                if len(patterns) < 3:
                    continue
                index = [case.value(p, f"pi_{reading}_{key}") for p in sorted(patterns)]
                stiff = [1.0 / case.value(p, f"energy_{key}") for p in sorted(patterns)]
                rank = float(spearmanr(index, stiff).statistic)
                values[f"rank of {label} {key} {name}{suffix}"] = rank
                far = [1.0 / case.value(p, f"ratio_off_peaks_{key}") for p in sorted(patterns)]
                rank = float(spearmanr(index, far).statistic)
                values[f"rank of {label} {key} {name}{suffix}, off peaks"] = rank
    return values


# Tables of a run, in Markdown.


PROTOTYPE = Path(__file__).with_name("prototype.toml")

ROWS = {
    "agreement": ("agreement, %", "{:.1f}"),
    "ratio_C": ("strain energy / benchmark, C", "{:.2f}"),
    "ratio_off_peaks_C": ("same, 5 pixels off point loads", "{:.2f}"),
    "ratio_S": ("strain energy / benchmark, S", "{:.3f}"),
    "stress_C": ("stress p99.9, C, MPa", "{:.3f}"),
    "raw_stress_C": ("stress raw, C, MPa", "{:.3f}"),
    "stress_S": ("stress p99.9, S, MPa", "{:.3f}"),
    "pi_weighted_C": ("PI weighted, C", "{:.3f}"),
    "pi_literal_C": ("PI literal, C", "{:.4f}"),
    "pi_harmonic_C": ("PI harmonic, C", "{:.3f}"),
    "pi_weighted_S": ("PI weighted, S", "{:.3f}"),
    "pi_harmonic_S": ("PI harmonic, S", "{:.3f}"),
    "si": ("SI by length", "{:.4f}"),
    "si_mean": ("SI mean of paths", "{:.4f}"),
    "si_raw": ("SI of raw pixels by length", "{:.4f}"),
    "si_raw_mean": ("SI of raw pixels, mean of paths", "{:.4f}"),
    "isolated": ("isolated pixels a layer", "{:.0f}"),
    "paths": ("paths a layer", "{:.0f}"),
    "over_40": ("paths > 40 mm, % of number", "{:.0f}"),
    "over_40_length": ("paths > 40 mm, % of length", "{:.0f}"),
    "length": ("length a layer, mm", "{:.0f}"),
    "overlap": ("overlap, % of area", "{:.2f}"),
    "gaps": ("gaps, % of area", "{:.2f}"),
    "print": ("print time a layer, s", "{:.0f}"),
    "cpu": ("CPU time of planning a layer, s", "{:.3f}"),
    "cpu_to_gcode": ("same, to the text of its G-code", "{:.3f}"),
    "cpu_with_fe": ("same, with its plane-stress solve", "{:.3f}"),
    "mixed_over_S": ("both materials: energy / all S", "{:.3f}"),
    "stress_mixed": ("both materials: stress p99.9, MPa", "{:.3f}"),
    "raw_stress_mixed": ("both materials: stress raw, MPa", "{:.3f}"),
}


def result_table(case: CaseStudy) -> str:
    """Every index of every pattern on one plate."""
    known = set.intersection(*(set(pattern.values) for pattern in case.patterns.values()))
    rows = [
        [title, *(form.format(case.value(pattern, index)) for pattern in case.patterns)]
        for index, (title, form) in ROWS.items()
        if index in known
    ]
    return table(["index", *case.patterns], rows)


def prototype_table(raster: Mapping[str, CaseStudy]) -> str:
    """Tabulate the indices of paths of pixels, and behind each that of a prototype."""
    with PROTOTYPE.open("rb") as file:
        theirs = tomllib.load(file)
    rows = []
    for name, case in raster.items():
        for index, values in theirs[name].items():
            title, form = ROWS[index]
            pairs = zip(case.patterns, values, strict=True)
            cells = [
                f"{form.format(case.value(pattern, index))} ({value:g})" for pattern, value in pairs
            ]
            rows.append([name, title, *cells])
    return table(["case", "index", *next(iter(raster.values())).patterns], rows)


def rank_table(values: Mapping[str, float]) -> str:
    """Rank correlation (Spearman) of PI with the stiffness of the patterns, by reading."""
    head = ["reading of PI", "material", "patterns"]
    cases = [name for name in ("I", "II", "III") if f"rank of PI C {name}" in values]
    rows = []
    for reading in ("PI", "PI literal", "PI harmonic"):
        for key in MATERIALS:
            for suffix in ("", " without 0/90"):
                ranks = [values[f"rank of {reading} {key} {name}{suffix}"] for name in cases]
                about = [reading if reading != "PI" else "PI weighted", f"{key}-FRAM"]
                patterns = "all five" if not suffix else suffix.strip()
                rows.append([*about, patterns, *(f"{rank:.2f}" for rank in ranks)])
    return table([*head, *(f"case {name}" for name in cases)], rows)


def index_table() -> str:
    """Table 2: the paper's indices as the evaluator defines them."""
    names = (
        "agreement",
        "stiffness_alignment",
        "stiffness_alignment_harmonic",
        "sinuosity",
        "sinuosity_mean",
        "over_40_count",
        "over_40_length",
        "print_time",
    )
    columns = {column.name: column for column in COLUMNS}
    rows = [[n, columns[n].unit, columns[n].formula, columns[n].range] for n in names]
    return table(["index", "unit", "what", "range"], rows)


def case_table(study: Mapping[str, CaseStudy]) -> str:
    """Table 3: the plates."""
    rows = []
    for name, case in study.items():
        plate = case.plate
        width, height = (plate.bead * n for n in plate.mask.shape[::-1])
        rows.append(
            [
                name,
                plate.title,
                f"{width:.1f} x {height:.1f}",
                f"{plate.polygon.area:.0f}",
                f"{int(plate.mask.sum())}",
                f"{plate.bead:g}",
                f"{case.seconds:.1f}",
            ]
        )
    head = ["case", "plate", "box, mm", "area, mm^2", "elements", "bead, mm", "all patterns, s"]
    return table(head, rows)


def material_table() -> str:
    """Table 5: the materials in plane stress."""
    rows = []
    for key, name in MATERIALS.items():
        material = named_material(name)
        q = reduced_stiffness(material)
        rest = 1.0 - q[0, 1] ** 2 / (q[0, 0] * q[1, 1])
        values = (q[0, 0] * rest, q[1, 1] * rest, q[2, 2])
        rows.append(
            [
                f"{key}-FRAM",
                *(f"{1e-3 * v:.2f}" for v in values),
                f"{q[0, 1] / q[1, 1]:.2f}",
                f"{values[0] / values[1]:.1f}",
                material.source,
            ]
        )
    return table(["material", "E1, GPa", "E2", "G12", "nu12", "E1/E2", "source"], rows)
