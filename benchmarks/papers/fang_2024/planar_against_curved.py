"""The T-bracket from planar and from curved layers, at equal length of fibre, tested virtually.

    python -m benchmarks.papers.fang_2024.planar_against_curved [ORDER]

ORDER of the cells, 1 by default. Prints one table in Markdown for each load; the spatial layers
with `winding` set the length.
"""

import sys
from typing import Any

from ccfem.cases.t_bracket import t_bracket
from ccfem.comparison.compare import compare
from ccfem.comparison.result import Comparison, Run
from ccfem.layers.slicing.planar import Planar
from ccfem.layers.slicing.spatial import Spatial

__all__ = ["SLICINGS", "rows"]

SLICINGS: dict[str, tuple[Any, str]] = {
    "spatial": (Spatial(), "winding"),
    "spatial, isocurve": (Spatial(), "isocurve"),
    "planar z": (Planar(axis="z", thickness=0.5), "concentric"),
    "planar z, isocurve": (Planar(axis="z", thickness=0.5), "isocurve"),
    "planar z, winding": (Planar(axis="z", thickness=0.5), "winding"),
    "planar x": (Planar(axis="x", thickness=1.5), "concentric"),
    "planar y": (Planar(axis="y", thickness=1.0), "concentric"),
}
"""Layers and strategy of each row. The paper's planar layers are filled parallel to the border."""

COLUMNS = (
    "row",
    "strategy",
    "layers",
    "fibre m",
    "stiffness, tension only",
    "bonded",
    "first failure N",
    "by",
    "space angle",
    "by stress",
    "across layers",
    "joints linked",
)


def _row(name: str, comparison: Comparison, run: Run) -> str:
    """Figures of a run as a row of the table."""
    if run.evaluation is None or run.tested is None:
        return f"| {name} | {run.name} | {run.failure or run.untested} |"
    total, bracket = run.evaluation.total, run.tested.bracket
    failure = run.tested.failure
    values = [
        name,
        run.name,
        str(len(comparison.layers)),
        f"{total['fibre_length'] / 1e3:.1f}",
        f"{bracket.tension.ratio:.3f}",
        f"{bracket.bonded.ratio:.3f}",
        "–" if failure is None else f"{failure.load:.0f}",
        "–" if failure is None else failure.what,
        f"{total['space_angle_mean']:.1f}",
        f"{total['space_angle_stress']:.1f}",
        f"{total['across_tension']:.3f}",
        f"{total['joints_linked']:.2f}",
    ]
    return f"| {' | '.join(values)} |"


def rows(load_case: str, order: int = 1) -> None:
    """Print the table of one load."""
    case = t_bracket(order=order)
    print(f"\n## {load_case}\n\n| {' | '.join(COLUMNS)} |\n{'|---' * len(COLUMNS)}|", flush=True)
    wanted = None
    for name, (slicer, strategy) in SLICINGS.items():
        stack = 1.0
        if wanted is not None:
            from ccfem.comparison.compare import solve_and_slice

            _, layers, _ = solve_and_slice(case, slicer, load_case)
            stack = float(len(layers))
        found = compare(
            case,
            [strategy],
            layers=slicer,
            fibre_per_layer=None if wanted is None else wanted / stack,
            natural=wanted is None,
            load_case=load_case,
        )
        run = found.runs[0]
        if wanted is None:
            wanted = float(run.toolpaths.lengths.sum())
        print(_row(name, found, run), flush=True)


if __name__ == "__main__":
    for each in ("pull", "side"):
        rows(each, int(sys.argv[1]) if len(sys.argv) > 1 else 1)
