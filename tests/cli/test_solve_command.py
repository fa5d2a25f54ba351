"""``ccfem solve``, and planning on the stress that it wrote."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import pyvista

from benchmarks.fuzz.mutants import frd
from ccfem.base.errors import InputError
from ccfem.base.tensor import to_voigt
from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.cases.part_file import read_part
from ccfem.comparison.report.report_views import read_solution
from ccfem.fem.elasticity import solve
from ccfem.fem.stress_files import read_stress
from ccfem.printing.export.vtk import result_path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how_to" / "foreign_stress.md").read_text()


def test_solve_writes_and_prints_each_load_case(ccfem, tmp_path):
    code, out, err = ccfem("solve", "bar", "--set-case", "element_size=6", "-o", "bar.vtu")
    assert (code, err) == (0, "")
    grid = pyvista.read(tmp_path / "bar.vtu")
    force = grid.point_data["reaction"].sum(axis=0)
    np.testing.assert_allclose(force, [-1000.0, 0.0, 0.0], atol=1e-3)
    assert "support support: (-1000," in out
    assert "linear cells; error" in out
    assert "in energy norm" in out
    # As a page shows it: the surface, and shares of the largest values.
    shown = read_solution(tmp_path / "bar.vtu", "title = 'x'")
    size = np.linalg.norm(grid.point_data["displacement"], axis=1)
    moved, stress = shown.surface("moved"), shown.surface("stress")
    assert moved.said.startswith(f"displacement, up to {size.max():.3g} mm")
    far = np.linalg.norm(grid.points[:, None] - stress.points, axis=2)
    near = far.argmin(axis=0)
    np.testing.assert_allclose(moved.share, size[near] / size.max(), atol=0.5 / 254.0 + 1e-9)
    assert far.min(axis=0).max() < 0.01
    a, b, c = np.moveaxis(stress.points[stress.triangles], 1, 0)
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
    assert volume == pytest.approx(grid.volume, rel=1e-3)
    assert list(shown.files) == ["bar.vtu"]
    assert (shown.names, shown.layers, shown.part_file) == ([], [], "title = 'x'")
    (tmp_path / "odd.vtu").write_text("odd")
    with pytest.raises(InputError, match=r"odd\.vtu"):
        read_solution(tmp_path / "odd.vtu")
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


def test_the_page_on_stress_of_another_program_works_as_written(ccfem, tmp_path):
    mesh = box_mesh((60.0, 24.0, 4.0), (10, 4, 1))
    lines = ["*NODE", *(f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(mesh.points, 1))]
    lines += ["*ELEMENT, TYPE=C3D4"]
    lines += [f"{k}, " + ", ".join(map(str, c)) for k, c in enumerate(mesh.cells + 1, 1)]
    for name, patch in (("HELD", "x_min"), ("PULLED", "x_max")):
        lines += [f"*NSET, NSET={name}", *map(str, np.unique(mesh.patches[patch]) + 1)]
    (tmp_path / "beam.inp").write_text("\n".join(lines) + "\n")
    (block,) = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.S)
    (tmp_path / "beam.toml").write_text(block)
    nodal = to_voigt(solve(read_part(tmp_path / "beam.toml").problem)["pull"].nodal)
    (tmp_path / "beam.frd").write_text(frd(mesh, nodal[: len(mesh.points), [0, 1, 2, 5, 3, 4]]))
    (command,) = re.findall(r"^    ccfem (compare beam.toml --stress .*)$", PAGE, flags=re.M)
    assert f"    ccfem {command}\n" in (ROOT / "docs/how_to/commands.md").read_text()
    quick = ("--strategies", "zigzag", "--layers", 1, "--natural", "--no-virtual-test")
    code, out, _ = ccfem(*command.split(), *quick)
    assert code == 0
    assert "taken for MPa, as its nodes are in mm" in " ".join(out.split())


def test_the_table_of_the_page_reads(tmp_path):
    (block,) = re.findall(r"```csv\n(.*?)```", PAGE, flags=re.S)
    (tmp_path / "stress.csv").write_text(block)
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]
    mesh = TetMesh(points, [[0, 1, 2, 3], [1, 2, 3, 4]])
    stress = read_stress(tmp_path / "stress.csv", mesh).stress
    assert stress[:, 0, 0].tolist() == [12.5, 11.75]
    assert stress[1, 0, 2] == 0.1


def test_names_of_load_cases_that_no_file_can_have_are_named():
    assert result_path("part.vtu", "pull 2") == Path("part-pull 2.vtu")
    with pytest.raises(InputError, match="'a/b' cannot stand in that of a file"):
        result_path("part.vtu", "a/b")
