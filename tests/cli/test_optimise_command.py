"""``ccfem optimise``: from a part file to the part file of what is left."""

import numpy as np
import pytest
import shapely
from command_line import run_command

from ccfem.base.errors import InputError
from ccfem.body.files import write_mesh
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.part_file import read_part
from ccfem.fem.topopt.flat_part import flat_part

_PART = """
mesh = "plate.npz"
order = 1
layers = 2
material = {{ modulus = 2000.0, poisson = 0.0, name = "cork" }}
[[supports]]
patch = "x_min"
[[supports]]
patch = "z_min"
components = "z"
[[loads.pull]]
kind = "force"
patch = "x_max"
vector = {vector}
{more}
[machine]
fibre_width = 0.8
[machine.process]
skirt_loops = 3
[combinations.twice]
pull = 2.0
"""


@pytest.fixture
def plate(monkeypatch, capsys, tmp_path):
    """A plate 40 x 16 x 2 mm in a folder, and the command line there."""

    def call(*arguments, vector="[60.0, 0.0, 0.0]", more=""):
        write_mesh(box_mesh((40.0, 16.0, 2.0), (10, 4, 1)), tmp_path / "plate.npz")
        (tmp_path / "plate.toml").write_text(_PART.format(vector=vector, more=more))
        return run_command(monkeypatch, capsys, tmp_path, "optimise", *arguments)

    return call


def test_a_new_part_file_with_mesh_picture_and_history(plate, tmp_path):
    command = ("plate.toml", "--volume-fraction", "0.5", "--method", "simp", "--keep", "")
    size = ("--element-size", "2.5", "--iterations", "2")
    code, out, err = plate(
        *command,
        *size,
        more='[[loads.shear]]\nkind = "force"\npatch = "x_max"\nvector = [0.0, 20.0, 0.0]\n',
    )
    assert code == 0, err
    assert "ccfem plan plate-optimised.toml --strategy svt" in out
    assert (tmp_path / "plate-optimised.png").stat().st_size > 5000
    before, after = (read_part(tmp_path / f"{name}.toml") for name in ("plate", "plate-optimised"))
    assert after.problem.loads == before.problem.loads
    assert after.problem.supports == before.problem.supports
    assert after.problem.combinations == before.problem.combinations
    assert (after.machine, after.slicing) == (before.machine, before.slicing)
    assert after.problem.material.name == "cork"
    code, _, err = plate(*command, *size)
    assert (code, "is there already" in err) == (2, True)
    assert plate(*command, *size, "--force")[0] == 0
    # Uniform density to begin with: a bar of modulus E (least + (1 - least) 0.5^3) is pulled.
    history = np.loadtxt(
        tmp_path / "plate-optimised.csv", delimiter=",", skiprows=1, usecols=(0, 1)
    )
    modulus = 2000.0 * (1e-6 + (1.0 - 1e-6) * 0.5**3)
    assert history[0, 1] == pytest.approx(60.0**2 * 40.0 / (modulus * 16.0 * 2.0), rel=1e-6)
    assert history[:, 0].tolist() == list(range(len(history)))


def test_files_that_another_run_wrote_meanwhile_stay(plate, tmp_path, monkeypatch):
    def meanwhile(*arguments, **options):
        (tmp_path / "plate-optimised.csv").write_text("theirs")

    monkeypatch.setattr("ccfem.cases.optimised.find_design", meanwhile)
    code, out, err = plate("plate.toml", "--volume-fraction", "0.5")
    assert (code, out) == (2, "")
    assert "plate-optimised.csv is there already" in err
    assert (tmp_path / "plate-optimised.csv").read_text() == "theirs"
    assert not (tmp_path / "plate-optimised.toml").exists()


def test_patches_stay_where_they_are_and_what_is_symmetric_stays_so(plate, tmp_path):
    code, _, err = plate(
        *("plate.toml", "--volume-fraction", "0.6", "--element-size", "2", "--iterations", "12"),
        *("--void", "20,8,2.5", "--solid", "9,6,12,10"),
    )
    assert code == 0, err
    after = read_part(tmp_path / "plate-optimised.toml").problem.mesh
    facets = after.patch("x_max")
    np.testing.assert_allclose(after.points[facets][..., 0], 40.0, atol=1e-9)
    assert after.facet_areas(facets)[0].sum() == pytest.approx(16.0 * 2.0, rel=1e-9)
    np.testing.assert_allclose(after.points[after.patch("x_min")][..., 0], 0.0, atol=1e-9)
    found = flat_part(after)
    assert (found.low, found.high) == pytest.approx((0.0, 2.0))
    mirrored = shapely.transform(found.planform, lambda p: [0.0, 16.0] + p * [1.0, -1.0])
    assert shapely.symmetric_difference(found.planform, mirrored).area < 1e-3 * 640.0
    disc = shapely.Point(20.0, 8.0).buffer(2.4)
    assert shapely.intersection(found.planform, disc).area < 1e-6
    assert found.planform.buffer(1e-6).covers(shapely.box(9.0, 6.0, 12.0, 10.0))


def test_a_patch_of_half_a_wall_has_no_trace_in_a_plate():
    """A wall of 4 mm along y and 6 mm along z: a patch up to z = 4 mm is no line of a planform."""
    mesh = box_mesh((8.0, 4.0, 6.0), (4, 2, 3))
    assert flat_part(mesh).traces["x_max"].wall.length == pytest.approx(4.0)
    wall = mesh.patch("x_max")
    low = wall[mesh.points[wall][..., 2].max(axis=1) < 4.1]
    with pytest.raises(InputError, match="patch 'low' takes only a part of the height"):
        flat_part(mesh.with_patches({"low": low}))


def test_in_space_on_the_cells_of_the_part(plate, tmp_path):
    code, _, err = plate(
        *("plate.toml", "--volume-fraction", "0.7", "--method", "simp", "--in-space"),
        *("--iterations", "6", "--weight", "pull=2"),
        vector="[0.0, 20.0, 0.0]",
    )
    assert code == 0, err
    after = read_part(tmp_path / "plate-optimised.toml").problem
    assert after.mesh.facet_areas(after.mesh.patch("x_max"))[0].sum() == pytest.approx(32.0)
    assert 0.5 * 1280.0 < after.mesh.volumes.sum() < 0.9 * 1280.0


def test_one_line_with_the_cure_and_nothing_left_behind(plate, tmp_path):
    whole = ("plate.toml", "--element-size", "4", "--volume-fraction")
    across = {"vector": "[0.0, 0.0, 5.0]"}
    cases = [
        (("volume fraction must be above 0 and below 1",), (*whole, "1.2"), {}),
        (("pull", "across its plane", "--in-space"), (*whole, "0.4"), across),
        (("SOMP turns", "--method simp"), (*whole, "0.4", "--in-space"), {}),
        (("method", "simp, somp"), (*whole, "0.4", "--method", "bhomp"), {}),
        (("no patch named 'x_mox'", "x_max"), (*whole, "0.4", "--keep", "x_mox"), {}),
        (("solid place is X,Y,RADIUS",), (*whole, "0.4", "--solid", "1,2,-3"), {}),
        (("weights", "pull"), (*whole, "0.4", "--weight", "push=1"), {}),
        (("E1,E2,NU12,G12",), (*whole, "0.4", "--laminate", "1,2"), {}),
        (("--out",), (*whole, "0.4", "--out", "new.npz"), {}),
        (("cannot be met",), (*whole, "0.15"), {}),
        (("--iterations must be at least 1; got 0",), (*whole, "0.4", "--iterations", "0"), {}),
        (("--radius must be above 0 mm; got -1",), (*whole, "0.4", "--radius", "-1"), {}),
    ]
    for words, arguments, part in cases:
        code, out, err = plate(*arguments, **part)
        assert (code, out) == (2, ""), arguments
        assert err.splitlines()[-1].startswith("ccfem: error: ")
        assert all(word in err for word in words), err
    assert {path.name for path in tmp_path.iterdir()} == {"plate.npz", "plate.toml"}
