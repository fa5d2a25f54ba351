"""One part from flat layers and from curved ones: rings on the former, winding strands on both.

    python -m ccfem.papers.fang_2024.planar_against_curved [FOLDER]

on the case ``t_bracket`` with linear cells, pulled as in the paper and pushed out of its plane,
all with the same fibre in all, held by fixed walls and again by bolts that only press. Prints a
table of each load; into a folder it writes the whole reports.
"""

import sys
from pathlib import Path

from ccfem.cases.shipped import t_bracket
from ccfem.comparison.engine import compare
from ccfem.comparison.files import write_results
from ccfem.comparison.result import Comparison
from ccfem.slicing.layers.slicer import Slicer
from ccfem.slicing.slicers.planar import Planar
from ccfem.slicing.slicers.spatial import Spatial

SLICINGS: dict[str, Slicer] = {
    "planar z": Planar(axis="z", thickness=1.0),
    "planar x": Planar(axis="x", thickness=1.0),
    "planar y": Planar(axis="y", thickness=1.0),
    "spatial": Spatial(),
}
"""The paper's fibre layers lie about a millimetre apart, every second one being matrix alone."""

ROWS = {
    "planar z": "concentric",
    "planar x": "concentric",
    "planar y": "concentric",
    "spatial": "winding",
}
"""Strategy of each slicing in the paper: rings parallel to the border on flat layers."""

COLUMNS = (
    "stiffness_ratio_tension",
    "stiffness_ratio_tension_alternative",
    "first_failure_load",
    "first_failure_load_alternative",
    "interlayer_load",
    "interlayer_load_alternative",
    "joints_linked",
    "space_angle_stress",
    "across_tension",
)


def against(load_case: str) -> Comparison:
    """Compare under one load, and print the table."""
    case = t_bracket(order=1, bolts=True)
    compared = compare(case, ["winding", "concentric"], slicings=SLICINGS, load_case=load_case)
    table = compared.frame
    heads = ["slicing", "strategy", "printable", "fails in", *COLUMNS]
    print(f"\n## {load_case}, {compared.fibre:.0f} mm of fibre in all\n")
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    for row in table.to_dict("records"):
        name = [row["slicing"], row["strategy"]]
        if row["failure"]:
            print(f"| {name[0]} | {name[1]} | {row['failure']} |")
            continue
        cells = [f"{row[column]:.4g}" for column in COLUMNS if column in table]
        outcome = ["yes" if row["printable"] else f"no: {row['why_not']}", row["fails_in"]]
        print(f"| {' | '.join([*name, *outcome, *cells])} |", flush=True)
    print(f"\n{compared.verdict}")
    return compared


def failure_loads(compared: Comparison, column: str) -> dict[str, float]:
    """Failure load, N, of the paper's rows, by slicing."""
    rows = {(row["slicing"], row["strategy"]): row for row in compared.frame.to_dict("records")}
    return {slicing: float(rows[slicing, strategy][column]) for slicing, strategy in ROWS.items()}


if __name__ == "__main__":
    for load in ("pull", "side"):
        result = against(load)
        if len(sys.argv) > 1:
            where = Path(sys.argv[1]) / load
            where.mkdir(parents=True, exist_ok=True)
            write_results(result, where)
