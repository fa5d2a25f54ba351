"""``ccfem solve``, and planning on the stress that it wrote."""

import json

import numpy as np
import pyvista


def test_solve_writes_and_prints_each_load_case(ccfem, tmp_path):
    code, out, err = ccfem("solve", "bar", "--set-case", "element_size=6", "-o", "bar.vtu")
    assert (code, err) == (0, "")
    grid = pyvista.read(tmp_path / "bar.vtu")
    force = grid.point_data["reaction"].sum(axis=0)
    np.testing.assert_allclose(force, [-1000.0, 0.0, 0.0], atol=1e-3)
    assert "support support: (-1000," in out
    assert "linear cells; error" in out
    assert "in energy norm" in out
    code, _, err = ccfem("solve", "bar", "-o", "bar.vtk")
    assert code == 2
    assert "end it in .vtu" in err
    code, _, err = ccfem("solve", "bar", "--load-case", "bend", "-o", "bar.vtu")
    assert code == 2
    assert "load case" in err


def test_cells_are_refined_on_demand(ccfem, tmp_path):
    part = ("bar", "--set-case", "element_size=12", "--refine")
    code, out, err = ccfem("solve", *part, "-o", "bar.vtu")
    assert (code, err) == (0, "")
    assert "294 cells were refined to " in out
    error = float(out.split("linear cells; error ")[1].split("%")[0])
    assert error <= 10.0
    code, _, err = ccfem("plan", *part, "--strategy", "zigzag", "--stress", "bar.vtu")
    assert code == 2
    assert "--refine changes the mesh that the file of --stress is on: drop one" in err


def test_a_comparison_on_the_written_stress_is_the_same(ccfem, tmp_path):
    case = ("bar", "--set-case", "element_size=6", "--layers", 2, "--no-virtual-test")
    assert ccfem("solve", *case[:3], "-o", "bar.vtu")[0] == 0
    plan = ("plan", *case, "--strategy", "isocurve")
    assert ccfem(*plan, "--out", "own")[0] == 0
    code, out, _ = ccfem(*plan, "--stress", "bar.vtu", "--out", "given")
    assert code == 0
    assert "planned and evaluated on the stress of another program" in out
    own, given = (
        json.loads((tmp_path / name / "results.json").read_text()) for name in ("own", "given")
    )
    assert own["strategies"][0]["total"] == given["strategies"][0]["total"]
    assert given["planned_on_given_stress"]
    assert not own["planned_on_given_stress"]
    name = "isocurve_waypoints.txt"
    assert (tmp_path / "own" / name).read_text() == (tmp_path / "given" / name).read_text()
    code, _, err = ccfem(*plan, "--stress-unit", "MPa")
    assert code == 2
    assert "--stress-unit belongs to --stress" in err
