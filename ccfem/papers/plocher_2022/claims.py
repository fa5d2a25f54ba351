"""The claims of the paper beside ours: every quantity is computed from a run."""

from collections.abc import Mapping
from pathlib import Path

from scipy.stats import spearmanr

from ccfem.papers.plocher_2022.study import CaseStudy
from ccfem.papers.verdicts import Check, judged

EXPECTED = Path(__file__).with_name("expected.toml")

_STRAIGHT = 0.002
"""Sinuosities no further apart are equal."""


def quantities(study: Mapping[str, CaseStudy]) -> dict[str, float]:
    """Every quantity that `expected.toml` may name; those whose patterns did not run are left out.

    Orders that hold are 1, others 0.
    """
    found: dict[str, float] = {}
    for name, case in study.items():
        have = set(case.patterns)
        for rule in (_agreement, _energy, _stress, _printing, _sensitivity, _mixed, _ranks):
            found |= rule(case, name, have)
    return found


def raster_quantities(raster: Mapping[str, CaseStudy]) -> dict[str, float]:
    """Quantities of paths of pixels: their names start with "raster"."""
    found = {f"raster {name}": value for name, value in quantities(raster).items()}
    for name, case in raster.items():
        winding = [case.value(p, "si_raw_mean") for p in case.patterns]
        spread = 100.0 * (max(winding) / min(winding) - 1.0)
        found[f"raster range of sinuosity of raw pixels {name}, %"] = spread
    return found


def _agreement(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    found = {f"agreement {p} {name}": case.value(p, "agreement") for p in have}
    if have >= {"mat", "concentric"}:
        less = case.value("mat", "agreement") - case.value("concentric", "agreement")
        found[f"agreement mat less concentric {name}"] = less
    return found


def _energy(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    ratio = {p: case.value(p, "ratio_C") for p in have}
    soft = {p: case.value(p, "energy_S") for p in have}
    found = {
        f"least energy ratio C {name}": min(ratio.values()),
        f"range of energy {name} S, %": 100.0 * (max(soft.values()) / min(soft.values()) - 1.0),
    }
    if have >= {"mps", "grid 45"}:
        found[f"energy grid 45 over mps {name}"] = ratio["grid 45"] / ratio["mps"]
        drop = 1.0 - case.value("mps", "stress_C") / case.value("grid 45", "stress_C")
        found[f"stress drop mps {name}"] = 100.0 * drop
    if have >= {"mps", "grid 45", "grid 0", "concentric", "mat"}:
        middle = [ratio[p] for p in ("grid 0", "concentric", "mat")]
        holds = ratio["mps"] < min(middle) and max(middle) < ratio["grid 45"]
        found[f"order of energies {name}"] = float(holds)
    if have >= {"mps", "concentric", "mat"}:
        for key, suffix in (("ratio_C", ""), ("ratio_off_peaks_C", " off peaks")):
            order = [case.value(p, key) for p in ("mps", "concentric", "mat")]
            best = min(case.value(p, key) for p in have)
            holds = order == sorted(order) and order[0] == best
            found[f"order on {name} C{suffix}"] = float(holds)
    return found


def _stress(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    best = case.benchmarks["C"].laid
    largest = min(case.value(p, "stress_C") for p in have)
    mean = min(case.value(p, "mean_stress_C") for p in have)
    return {
        f"stress of benchmark over least {name}": best.stress / largest,
        f"mean stress of benchmark over least {name}": best.mean_stress / mean,
    }


def _printing(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    found = {}
    if have >= {"mps", "concentric"}:
        seconds = case.value("mps", "cpu_with_fe") / case.value("concentric", "cpu_with_fe")
        found[f"cpu mps over concentric {name}, %"] = 100.0 * (seconds - 1.0)
    if have >= {"grid 45", "concentric"}:
        longer = case.value("grid 45", "print") / case.value("concentric", "print") - 1.0
        found[f"print time grid 45 over concentric {name}, %"] = 100.0 * longer
    if "concentric" in have and len(have) > 1:
        for key, label in (("cpu_with_fe", "cpu"), ("print", "print time")):
            others = min(case.value(p, key) for p in have - {"concentric"})
            found[f"{label} concentric over least other {name}"] = (
                case.value("concentric", key) / others
            )
        long = {p: case.value(p, "over_40") for p in have}
        holds = long["concentric"] == max(long.values())
        found[f"concentric longest {name}"] = float(holds)
    winding = {p: case.value(p, "si") for p in have}
    found[f"range of sinuosity {name}, %"] = 100.0 * (
        max(winding.values()) / min(winding.values()) - 1.0
    )
    grids = [winding[p] for p in have if p.startswith("grid")]
    if grids:
        holds = min(grids) <= min(winding.values()) + _STRAIGHT
        found[f"grid straightest {name}"] = float(holds)
    return found


def _sensitivity(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    return {
        f"drop of f {key} {name}, %": 100.0 * (1.0 - float(best.curve.values[-1]))
        for key, best in case.benchmarks.items()
    }


def _mixed(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    found: dict[str, float] = {}
    if "grid 45" not in have:
        return found
    energy = {p: case.value(p, "energy_mixed") for p in have}
    found[f"grid 45 softest mixed {name}"] = float(energy["grid 45"] == max(energy.values()))
    for p in have - {"grid 45"}:
        drop = 1.0 - case.value(p, "stress_mixed") / case.value("grid 45", "stress_mixed")
        found[f"mixed stress drop {p} {name}"] = 100.0 * drop
    return found


def _ranks(case: CaseStudy, name: str, have: set[str]) -> dict[str, float]:
    found = {}
    for key in case.benchmarks:
        for reading in ("weighted", "literal", "harmonic"):
            label = "PI" if reading == "weighted" else f"PI {reading}"
            for patterns, suffix in ((have, ""), (have - {"grid 0"}, " without 0/90")):
                if len(patterns) < 3:
                    continue
                index = [case.value(p, f"pi_{reading}_{key}") for p in sorted(patterns)]
                stiff = [1.0 / case.value(p, f"energy_{key}") for p in sorted(patterns)]
                rank = float(spearmanr(index, stiff).statistic)
                found[f"rank of {label} {key} {name}{suffix}"] = rank
                far = [1.0 / case.value(p, f"ratio_off_peaks_{key}") for p in sorted(patterns)]
                rank = float(spearmanr(index, far).statistic)
                found[f"rank of {label} {key} {name}{suffix}, off peaks"] = rank
    return found


def verdicts(found: Mapping[str, float]) -> list[Check]:
    """Judge every check of `expected.toml` by the quantities found."""
    return judged(found, EXPECTED)
