"""Tables of a run, in Markdown."""

from collections.abc import Mapping

from ccfem.machine import SpeedTable
from ccfem.papers.wang_2021.study import LIMIT, PatternStudy, PlateStudy

ROWS = {
    "path 5": "fibre within 5 degrees of the stress, %",
    "path 10": "10 degrees",
    "path 20": "20 degrees",
    "path 30": "30 degrees",
    "path 45": "45 degrees",
    "energy 30": "30 degrees, weighted with the stress, %",
    "stress_best 30": "stress within 30 degrees of the best fibre within 1 mm, %",
    "stress_nearest 30": "stress within 30 degrees of the nearest fibre, %",
    "vertices": "vertices below 0.26 / mm, %",
    "length below": "length below 0.26 / mm, %",
    "largest": "largest curvature, 1/mm",
    "tension": "stiffness x, tension only, equal fibre in the part",
    "bonded": "stiffness x, bonded, equal fibre in the part",
    "pieces": "pieces",
    "length": "length, mm",
    "link_outside": "links outside, mm",
    "link_over_void": "links over windows, mm",
    "link_inside": "links inside, mm",
    "coverage": "covered, %",
    "overfill": "fibre laid over the area",
    "crossings": "crossings",
    "time": "print time, s",
    "speed": "mean speed, mm/s",
    "seconds": "planning, s",
}


def _value(pattern: PatternStudy, row: str) -> float | None:
    """One index of one pattern; None where it was not computed."""
    head, _, angle = row.rpartition(" ")
    if head in pattern.rates:
        return pattern.rate(float(angle), head)
    if row in ("tension", "bonded"):
        return pattern.stiffness.get(row)
    total = pattern.total
    return {
        "vertices": 100.0 * float((pattern.native < LIMIT).mean()),
        "length below": 100.0 * float((pattern.curvature < LIMIT).mean()),
        "largest": float(pattern.curvature.max(initial=0.0)),
        "pieces": total["paths"],
        "length": total["fibre_length"],
        "coverage": 100.0 * total["coverage"],
        "crossings": total["crossings"] + total["self_crossings"],
        "time": total["print_time"],
        "speed": total["mean_speed"],
        "seconds": pattern.seconds,
        **{name: total[name] for name in ("overfill", "link_outside", "link_over_void")},
        "link_inside": total["link_inside"],
    }[row]


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)]) + "\n"


def result_table(plate: PlateStudy) -> str:
    """Every index of every pattern, on the optimised part and on the full plate."""
    columns = dict(plate.optimised.patterns)
    columns |= {f"{name}, full plate": one for name, one in plate.original.patterns.items()}
    rows = []
    for row, text in ROWS.items():
        values = [_value(pattern, row) for pattern in columns.values()]
        rows.append([text, *("" if v is None else f"{v:.4g}" for v in values)])
    return _table(["index", *columns], rows)


def plate_table(study: Mapping[str, PlateStudy]) -> str:
    """List the plates and their optimisation."""
    rows = []
    for name, one in study.items():
        plate, design = one.plate, one.design
        width, height = plate.border.bounds[2:]
        found = ["", "", "", ""]
        if design is not None:
            found = [
                f"{design.compliance[-1]:.4g}",
                str(design.iterations),
                f"{design.grey:.3f}",
                f"{100.0 * one.off_stored:.2f}",
            ]
        work = [2.0 * part.field.strain_energy for part in (one.original, one.optimised)]
        rows.append(
            [
                name,
                f"{width:g} x {height:g}",
                f"{plate.volume_fraction:g}",
                f"{one.optimised.layer.plane.polygon.area / plate.domain.area:.3f}",
                *found,
                *(f"{w:.1f}" for w in work),
                f"{one.seconds:.1f}",
            ]
        )
    head = [
        "plate",
        "box, mm",
        "volume fraction",
        "of the part",
        "compliance of the design, N mm",
        "iterations",
        "grey",
        "off the stored part, %",
        "compliance of the print without fibre: full plate, N mm",
        "part, N mm",
        "all patterns, s",
    ]
    return _table(head, rows)


def speed_table() -> str:
    """Table 2: which speed a piece of the path gets."""
    table = SpeedTable()
    slow, middle, fast = (f"{speed:g} mm/s" for speed in table.speed)
    (high, low), (short, long), (sharp, flat) = table.curvature, table.length, table.angle
    rows = [
        ["curvature, 1/mm", f"> {high:g}", f"{low:g} to {high:g}", f"< {low:g}"],
        ["length, mm", f"< {short:g}", f"{short:g} to {long:g}", f"> {long:g}"],
        ["angle, degrees", f"< {sharp:g}", f"{sharp:g} to {flat:g}", f">= {flat:g}"],
    ]
    return _table(["piece", slow, middle, fast], rows)
