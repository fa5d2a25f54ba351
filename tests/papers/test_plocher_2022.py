"""The study of Plocher et al. 2022, reduced: one plate of wide beads."""

import tomllib

import numpy as np
import pytest

from benchmarks.papers.plocher_2022.claims import EXPECTED, claim_table, quantities, verdicts
from benchmarks.papers.plocher_2022.figures import draw_all
from benchmarks.papers.plocher_2022.study import run_case
from benchmarks.papers.plocher_2022.tables import (
    ROWS,
    case_table,
    index_table,
    rank_table,
    result_table,
)
from ccfem.cases.plates import five_holes


@pytest.fixture(scope="module")
def case():
    return run_case(five_holes(bead=1.2))


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
        expected = case.value(name, "energy_C") / 1.2**2
        assert case.value(name, "density_sum_C") == pytest.approx(expected)


def test_every_quantity_of_the_claims_is_computed(case):
    found = quantities(dict.fromkeys(("I", "II", "III"), case))
    claims = tomllib.loads(EXPECTED.read_text())["claim"]
    named = {check["quantity"] for claim in claims for check in claim["checks"]}
    assert {name for name in named - set(found) if "variant" not in name} == {"printed tests"}
    for claim in claims:
        assert claim["source"]
        assert all(check["low"] <= check["high"] for check in claim["checks"])


def test_verdicts_follow_the_ranges():
    checks = {c.quantity: c for c in verdicts({"agreement mps I": 90.0, "agreement mps II": 20.0})}
    assert checks["agreement mps I"].verdict == "reproduced"
    assert checks["agreement mps II"].verdict == "differs"
    assert checks["agreement mps III"].verdict == "not tried"
    assert np.isnan(checks["printed tests"].ours)
    assert "| agreement mps II | 85 to 92 % | 20 | differs |" in claim_table(list(checks.values()))


def test_figures_and_tables(case, tmp_path):
    names = draw_all({"II": case}, tmp_path)
    assert len(names) >= 8
    assert all((tmp_path / name).stat().st_size > 5000 for name in names)
    assert result_table(case).count("\n") == len(ROWS) + 2
    assert "| II |" in case_table({"II": case})
    assert rank_table(quantities({"II": case})).count("FRAM") == 12
    assert "stiffness_alignment" in index_table()
