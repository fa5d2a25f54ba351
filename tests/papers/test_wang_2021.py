"""The study of Wang et al. 2021, reduced: the L-shape on coarse meshes."""

import tomllib

import numpy as np
import pytest

from ccfem.cases import create_case
from ccfem.judging.evaluation.layer_paths import PlanePaths
from ccfem.papers.contents import claim_table, judged, write_figures
from ccfem.papers.wang_2021.contents import (
    EXPECTED,
    ROWS,
    plate_table,
    quantities,
    result_table,
    speed_table,
)
from ccfem.papers.wang_2021.figures import figures
from ccfem.papers.wang_2021.study import PATTERNS, PLATES, curvature_along, run_plate
from ccfem.slicing.slicers.planar import Planar


@pytest.fixture(scope="module")
def plate():
    return run_plate("l_shape", list(PATTERNS), element_size=4.0)


def test_lpp_is_one_path_that_fills_the_part(plate):
    lpp = plate.optimised.patterns["lpp"]
    assert lpp.total["paths"] == 1
    assert lpp.total["coverage"] > 0.93
    assert lpp.total["crossings"] + lpp.total["self_crossings"] > 100
    # Links turn on 1.5 mm, the tracks in the part hardly at all.
    assert lpp.curvature.max() < 1.3
    assert (lpp.curvature_in_part < 0.26).mean() > 0.97


def test_rates_of_the_patterns(plate):
    patterns, full = plate.optimised.patterns, plate.original.patterns
    # Streamlines follow the stress by definition; rates rise to one.
    assert patterns["streamline"].rate(5.0) > 99.0
    for one in (*patterns.values(), *full.values()):
        for rate in one.rates.values():
            assert (np.diff(rate) >= 0.0).all()
        assert one.rates["path"][-1] == pytest.approx(1.0)
    for name, one in full.items():
        assert one.rate(20.0) < patterns["lpp"].rate(20.0)
        assert name == "concentric" or one.rate(30.0) < 60.0


def test_fibre_makes_the_part_stiffer(plate):
    for one in plate.optimised.patterns.values():
        assert 1.0 < one.stiffness["tension"] <= one.stiffness["bonded"] * (1.0 + 1e-6)
    assert all(not one.stiffness for one in plate.original.patterns.values())


def test_curvature_of_a_corner_and_of_a_circle():
    """A square corner has 2 sin 45 degrees over the step, a circle one over its radius."""
    (layer,) = Planar(count=1).cut(create_case("l_shape", element_size=8.0).problem.mesh)
    corner = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 5.0]])
    angle = np.linspace(0.0, 2.0 * np.pi, 7201)
    circle = 6.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = curvature_along(PlanePaths(layer, corner, np.array([0, 3]), np.array([False])))[1]
    assert found.max() == pytest.approx(2.0 * np.sin(np.pi / 4) / 0.5)
    assert np.count_nonzero(found > 1e-9) == 1
    found = curvature_along(PlanePaths(layer, circle, np.array([0, 7201]), np.array([True])))[1]
    np.testing.assert_allclose(found, 1.0 / 6.0, rtol=2e-3)


def test_every_quantity_of_the_claims_is_computed(plate):
    found = quantities(dict.fromkeys(PLATES, plate))
    claims = tomllib.loads(EXPECTED.read_text())["claim"]
    named = {check["quantity"] for claim in claims for check in claim["checks"]}
    holes = "tight places of concentric near the holes suspension"
    missing = {name for name in named - set(found) if not name.startswith("variant")}
    assert missing == {"printed part", holes}
    assert all(claim["source"] for claim in claims)
    assert all(check["low"] <= check["high"] for claim in claims for check in claim["checks"])
    assert found["speeds of table 2 at its limits, of 10"] == 10.0
    # 100 by 100 mm, a bracket in bending whose members the stress follows.
    assert found["width l_shape"] == found["height l_shape"] == 100.0
    assert found["stress within 30 degrees of the medial axis l_shape"] > 85.0


def test_verdicts_follow_the_ranges():
    checks = {
        c.quantity: c for c in judged({"width bridge": 185.0, "height bridge": 49.0}, EXPECTED)
    }
    assert checks["width bridge"].verdict == "reproduced"
    assert checks["height bridge"].verdict == "differs"
    assert checks["width suspension"].verdict == "not tried"
    table = claim_table(list(checks.values()))
    assert "| height bridge | 50 mm | 50 | 49 | differs |" in table
    assert "| crossings of lpp l_shape | cross | from 1 | – | not tried |" in table


def test_figures_and_tables(plate, tmp_path):
    names = write_figures(figures({"l_shape": plate, "suspension": plate}), tmp_path)
    assert len(names) >= 7
    assert all((tmp_path / name).stat().st_size > 5000 for name in names)
    assert result_table(plate).count("\n") == len(ROWS) + 2
    assert "| l_shape | 100 x 100 |" in plate_table({"l_shape": plate})
    assert "0.05 to 0.2" in speed_table()
