"""The study of Plocher et al. 2022, reduced: one plate of wide beads."""

import tomllib

import numpy as np
import pytest

from ccfem.papers.contents import claim_table, judged, write_figures
from ccfem.papers.plocher_2022.contents import (
    EXPECTED,
    ROWS,
    case_table,
    index_table,
    metric_table,
    prototype_table,
    quantities,
    rank_table,
    raster_quantities,
    result_table,
)
from ccfem.papers.plocher_2022.figures import figures
from ccfem.papers.plocher_2022.plates import five_holes
from ccfem.papers.plocher_2022.study import RASTER, run_case
from ccfem.paths.raster.patterns import INFILL


@pytest.fixture(scope="module")
def case():
    return run_case(five_holes(bead=1.6))


@pytest.fixture(scope="module")
def raster(case):
    return run_case(case.plate, RASTER, case.benchmarks)


def test_order_of_the_patterns(case):
    energy = {name: case.value(name, "ratio_C") for name in case.patterns}
    assert min(energy, key=energy.get) == "mps"
    assert energy["grid 45"] > energy["grid 0"] > energy["mps"]
    assert min(energy.values()) >= 1.0
    # Three shells of wide beads across the load cost more here than in the study.
    agreement = {name: case.value(name, "agreement") for name in case.patterns}
    assert max(agreement, key=agreement.get) == "mps"
    assert agreement["mps"] > 80.0
    for name in ("grid 45", "grid 0"):
        assert 50.0 < case.value(name, "agreement") < 65.0
    # A chopped path is softer, continuous fibre stiffer.
    for name in case.patterns:
        energies = [case.value(name, f"energy_{key}") for key in ("C", "mixed", "S")]
        assert energies == sorted(energies)


def test_sum_of_densities_is_the_energy_over_the_volume_of_a_cell(case):
    for name in case.patterns:
        expected = case.value(name, "energy_C") / 1.6**2
        assert case.value(name, "density_sum_C") == pytest.approx(expected)


def test_pixels_and_polylines_agree(case, raster):
    for name in case.patterns:
        for index, near in (("agreement", 4.0), ("ratio_C", 0.35), ("gaps", 12.0)):
            difference = raster.value(name, index) - case.value(name, index)
            assert abs(difference) < near, (name, index)
    energy = {name: raster.value(name, "ratio_C") for name in raster.patterns}
    assert min(energy, key=energy.get) == "mps"
    assert min(energy.values()) >= 1.0


def test_what_pixels_do_to_length_and_sinuosity(case, raster):
    # Inside the shells, rows step by a bead and diagonals by sqrt 2; the shells are the same.
    shells = {}
    for name, step in (("grid 0", 1.6), ("grid 45", 1.6 * np.sqrt(2.0))):
        steps = []
        for plan in raster.patterns[name].raster:
            inside = plan.regions.domain == INFILL
            begins = inside[tuple(plan.paths.pixels[plan.paths.offsets[:-1]].T)]
            steps.append((inside & ~plan.paths.isolated).sum() - begins.sum())
        shells[name] = raster.value(name, "length") - step * np.mean(steps)
    assert shells["grid 45"] == pytest.approx(shells["grid 0"], rel=1e-6)
    for name in raster.patterns:
        assert raster.value(name, "si_raw") >= raster.value(name, "si") - 1e-9 >= 1.0 - 1e-9
        assert raster.value(name, "isolated") < 0.07 * case.plate.mask.sum()
        assert raster.value(name, "cpu_to_gcode") > raster.value(name, "cpu") > 0.0


def test_every_quantity_of_the_claims_is_computed(case, raster):
    found = quantities(dict.fromkeys(("I", "II", "III"), case))
    found |= raster_quantities(dict.fromkeys(("I", "II", "III"), raster))
    claims = tomllib.loads(EXPECTED.read_text())["claim"]
    named = {check["quantity"] for claim in claims for check in claim["checks"]}
    assert {name for name in named - set(found) if "variant" not in name} == set()
    for claim in claims:
        assert claim["source"]
        assert all(check["low"] <= check["high"] for check in claim["checks"])


def test_verdicts_follow_the_ranges():
    found = {"agreement mps I": 90.0, "agreement mps II": 20.0}
    checks = {c.quantity: c for c in judged(found, EXPECTED)}
    assert checks["agreement mps I"].verdict == "reproduced"
    assert checks["agreement mps II"].verdict == "differs"
    assert checks["agreement mps III"].verdict == "not tried"
    assert np.isnan(checks["mat stiffest of the printed patterns III S"].ours)
    table = claim_table(list(checks.values()))
    assert "| agreement mps II | 85 to 92 % | 82 to 95 | 20 | differs |" in table
    assert "\n- 1a: 3 points: seeds, hole layout and the beam's size are not stated\n" in table


def test_figures_and_tables(case, raster, tmp_path):
    names = write_figures(figures({"II": case}, {"II": raster}), tmp_path)
    assert len(names) >= 8
    assert all((tmp_path / name).stat().st_size > 5000 for name in names)
    of_pixels = {"si_raw", "si_raw_mean", "isolated"}
    assert result_table(case).count("\n") == len(set(ROWS) - of_pixels) + 2
    assert result_table(raster).count("\n") == len(ROWS) + 2
    assert prototype_table({"II": raster}).count("(") >= 5 * 9
    assert metric_table({"II": raster}).count("| II |") == 3
    assert "| II |" in case_table({"II": case})
    assert rank_table(quantities({"II": case})).count("FRAM") == 12
    assert "stiffness_alignment" in index_table()
