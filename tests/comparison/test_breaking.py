"""Breaking loads of a comparison: off by default, in all files when asked for."""

import csv
import json
from dataclasses import replace

import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.comparison.engine import compare
from ccfem.comparison.files import write_results
from ccfem.comparison.request import Request

from .test_compare import SIZE, strip


def test_breaking_loads_stand_in_every_file_that_says_experiment(tmp_path):
    given = strip()
    case = replace(given, problem=replace(given.problem, mesh=box_mesh(SIZE, (6, 3, 1)), order=1))
    made = compare(case, ["zigzag"], layers=1, natural=True, breaking_load=True)
    (run,) = made.runs
    assert made.bare is not None
    # Uniform tension: the matrix cracks where its stress is its strength.
    assert made.bare.curve.force[1] == pytest.approx(50.0 * SIZE[1] * SIZE[2], rel=1e-3)
    # Before that, it is the part of the virtual test.
    without, with_fibre = (b.curve.force[1] / b.curve.displacement[1] for b in made.broken.values())
    assert without / with_fibre == pytest.approx(1.0 / run.tested.bracket.tension.ratio, rel=1e-4)
    write_results(made, tmp_path)
    with (tmp_path / "zigzag_breaking.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["curve"] for row in rows} == {"middle", "low", "high"}
    highest = max(float(row["load_N"]) for row in rows if row["curve"] == "middle")
    assert highest == pytest.approx(run.broken.load)
    said = f"zigzag: experiment: breaks at {run.broken.load:.4g} N"
    assert any(line.startswith(said) for line in made.remarks)
    assert said in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert (tmp_path / "breaking.png").stat().st_size > 1000
    record = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    entry = record["strategies"][0]["breaking_load_experiment"]
    assert entry["low"] <= entry["load"] == pytest.approx(run.broken.load)


def test_no_breaking_load_without_the_virtual_test():
    with pytest.raises(InputError, match="the breaking load is of a virtual test"):
        Request.of(strip(), ["zigzag"], strand=None, breaking_load=True)
