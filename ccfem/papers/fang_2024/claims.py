"""The claims of the paper beside ours: every quantity is computed from a run."""

from collections.abc import Mapping
from pathlib import Path

from ccfem.comparison.result import Comparison
from ccfem.papers.fang_2024.measures import Strands
from ccfem.papers.fang_2024.planar_against_curved import failure_loads
from ccfem.papers.fang_2024.t_bracket import PAPER_SECONDS
from ccfem.papers.verdicts import Check, judged

EXPECTED = Path(__file__).with_name("expected.toml")


def quantities(
    field: Mapping[str, float],
    strands: Mapping[str, Strands],
    seconds: Mapping[str, float],
    tests: Mapping[str, Comparison],
) -> dict[str, float]:
    """Every quantity that `expected.toml` may name; orders that hold are 1, others 0."""
    found = {**field, **{f"seconds, {name}": value for name, value in seconds.items()}}
    for name, figures in strands.items():
        found |= {f"{name}: {key}": value for key, value in figures.table().items()}
    for figure, name in (("thickness ratio", "thickness ratio"), ("pieces a layer", "pieces")):
        ratio = found[f"all lines {figure}"] / found[f"default {figure}"]
        found[f"all lines {name} over default"] = ratio
    found["time over the paper's"] = seconds["all, clock"] / PAPER_SECONDS["all"]
    for load, compared in tests.items():
        found |= _loads(load, compared)
    return found


def _loads(load: str, compared: Comparison) -> dict[str, float]:
    """Orders of slicings under one load, with fixed and with pressing supports."""
    found: dict[str, float] = {}
    for held, end in (("fixed", ""), ("pressing", "_alternative")):
        about = f"{load}, {held}"
        fails = failure_loads(compared, f"first_failure_load{end}")
        stiff = failure_loads(compared, f"stiffness_ratio_tension{end}")
        z, x, y = (fails[f"planar {axis}"] for axis in "zxy")
        curved = fails["spatial"]
        found[f"{about}: z below x"] = float(z < x)
        found[f"{about}: x below spatial"] = float(x < curved)
        found[f"{about}: spatial above all flat"] = float(curved > max(x, y, z))
        found[f"{about}: z over x"] = z / x
        found[f"{about}: y over x"] = y / x
        found[f"{about}: spatial over the weakest"] = curved / min(x, y, z)
        found[f"{about}: spatial stiffest"] = float(stiff["spatial"] >= max(stiff.values()))
    for name in ("planar z", "planar x", "planar y", "spatial"):
        found[f"{load}, {name}: angle to stress"] = failure_loads(compared, "space_angle_stress")[
            name
        ]
        found[f"{load}, {name}: joints linked"] = failure_loads(compared, "joints_linked")[name]
    return found


def verdicts(found: Mapping[str, float]) -> list[Check]:
    """Judge the claims of the paper by the quantities found."""
    return judged(found, EXPECTED)
