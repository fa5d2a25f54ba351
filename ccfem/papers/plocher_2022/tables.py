"""Tables of a run, in Markdown."""

import tomllib
from collections.abc import Mapping
from pathlib import Path

from ccfem.fem.materials import named_material
from ccfem.judging.evaluation import COLUMNS
from ccfem.papers.plocher_2022.plane_study import reduced_stiffness
from ccfem.papers.plocher_2022.study import MATERIALS, CaseStudy

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


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)]) + "\n"


def result_table(case: CaseStudy) -> str:
    """Every index of every pattern on one plate."""
    known = set.intersection(*(set(one.values) for one in case.patterns.values()))
    rows = [
        [title, *(form.format(case.value(pattern, index)) for pattern in case.patterns)]
        for index, (title, form) in ROWS.items()
        if index in known
    ]
    return _table(["index", *case.patterns], rows)


def prototype_table(raster: Mapping[str, CaseStudy], path: Path = PROTOTYPE) -> str:
    """Tabulate the indices of paths of pixels, and behind each that of a prototype."""
    with path.open("rb") as file:
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
    return _table(["case", "index", *next(iter(raster.values())).patterns], rows)


def rank_table(found: Mapping[str, float]) -> str:
    """Rank correlation (Spearman) of PI with the stiffness of the patterns, by reading."""
    head = ["reading of PI", "material", "patterns"]
    cases = [name for name in ("I", "II", "III") if f"rank of PI C {name}" in found]
    rows = []
    for reading in ("PI", "PI literal", "PI harmonic"):
        for key in MATERIALS:
            for suffix in ("", " without 0/90"):
                ranks = [found[f"rank of {reading} {key} {name}{suffix}"] for name in cases]
                about = [reading if reading != "PI" else "PI weighted", f"{key}-FRAM"]
                patterns = "all five" if not suffix else suffix.strip()
                rows.append([*about, patterns, *(f"{rank:.2f}" for rank in ranks)])
    return _table([*head, *(f"case {name}" for name in cases)], rows)


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
    return _table(["index", "unit", "what", "range"], rows)


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
    return _table(head, rows)


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
    return _table(["material", "E1, GPa", "E2", "G12", "nu12", "E1/E2", "source"], rows)
