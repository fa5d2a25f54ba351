"""Calibration: what it finds is what rod-in-matrix formulae say; files survive; bad ones do not."""

import dataclasses

import numpy as np
import pytest
from flat_paths import flat_paths

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.materials import isotropic, transversely_isotropic
from ccfem.judging.virtual_testing.calibration import (
    Calibration,
    Curve,
    calibrate,
    read_calibration,
    read_curve,
)
from ccfem.judging.virtual_testing.strand import Strand

LENGTH, AREA, COUNT = 12.0, 64.0, 4


def pulled():
    """Bar of 12 x 8 x 8 mm drawn out by a plate, sides free to slide."""
    supports = (
        Support("x_min", "x"),
        Support("y_min", "y"),
        Support("z_min", "z"),
        Support("x_max", "x", (0.1, 0.0, 0.0)),
    )
    mesh = box_mesh((LENGTH, 8.0, 8.0), (6, 4, 4))
    return Problem(mesh, isotropic(1234.0, 0.3), supports, {"draw": ()})


def fibres():
    return flat_paths([[[0.0, y, z], [LENGTH, y, z]] for y in (2.5, 5.5) for z in (2.5, 5.5)])


def curve(stiffness, peak, name="test", slack=0.2):
    """Slack, a straight rise to 60 % of the peak, softening to the peak, and a drop."""
    force = np.concatenate([np.linspace(0.0, 0.6, 40), np.linspace(0.62, 1.0, 20), [0.3, 0.1]])
    soft = 2.0 * np.maximum(force - 0.6, 0.0) ** 2
    displacement = (force + soft) * peak / stiffness + slack
    displacement[:3] = [0.0, 0.5 * slack, slack]
    displacement[-2:] = displacement[-3] * np.array([1.05, 1.1])
    return Curve(displacement, force * peak, name)


def test_modulus_strength_and_rho_are_found():
    modulus, strength, rho = 510.0, 33.0, 5.5
    stiffness = modulus * AREA / LENGTH
    none = curve(stiffness, strength * AREA, "none.csv")
    with_fibre = curve(stiffness * (1.0 + COUNT * rho / AREA), 3000.0, "fibre.csv")
    alone = calibrate(pulled(), none)
    assert alone.modulus == pytest.approx(modulus, rel=1e-6)
    assert alone.tensile_strength == pytest.approx(strength, rel=1e-6)
    assert alone.poisson == pytest.approx(0.3, rel=1e-9)
    assert alone.rho is None
    assert alone.strand() == Strand()
    both = calibrate(pulled(), none, with_fibre, fibres(), name="our PLA")
    assert both.rho == pytest.approx(rho, rel=1e-3)
    assert both.modulus == alone.modulus
    assert both.strand().rho == both.rho
    assert both.strand().strength == Strand().strength
    assert "none.csv" in both.source
    assert "fibre.csv" in both.source
    assert both.material.tensile_strength == both.tensile_strength
    np.testing.assert_allclose(
        both.material.stiffness, isotropic(modulus, 0.3).stiffness, rtol=1e-6
    )


def test_a_material_file_comes_back_as_it_was(tmp_path):
    path = tmp_path / "ours.toml"
    for found in (
        Calibration('PLA "X" \\ é\n', 512.3, 0.35, 33.1, 4.2, "a.csv: 1 N/mm"),
        Calibration("plain", 512.3, 0.35, 33.1),
    ):
        found.write(path)
        assert read_calibration(path) == found


def test_curves_are_read_in_their_units(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text("# machine 7\ntime;Force [kN];Displacement (um)\n0;0.0;0\n1;1.5;20\n\n2;3;40\n")
    found = read_curve(path)
    np.testing.assert_allclose(found.force, [0.0, 1500.0, 3000.0])
    np.testing.assert_allclose(found.displacement, [0.0, 0.02, 0.04])
    assert found.name == "curve.csv"
    path.write_text("displacement,force\n0,0\n1,2\n")
    np.testing.assert_allclose(read_curve(path).force, [0.0, 2.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line of column names and lines of numbers; got none"),
        ("strain,force\n0,1\n", "expected one column named displacement; got strain, force"),
        ("displacement,force,force\n0,1,2\n", "expected one column named force"),
        ("displacement,force [lbf]\n0,1\n", "unit 'lbf'; known are n, kn: convert it"),
        ("displacement,force\n0,1\n1,x\n", "line 3: expected numbers .* got '1,x'"),
        ("displacement,force\n0,1\n1\n", "line 3: expected numbers"),
        ("displacement,force\n0,nan\n", "must be finite"),
        ("displacement,force\n0,0\n1,-5\n", "never rises above 0"),
    ],
)
def test_bad_curve_files_are_refused(tmp_path, text, message):
    path = tmp_path / "curve.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_curve(path)


def test_missing_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist: check its name"):
        read_curve(tmp_path / "none.csv")
    with pytest.raises(InputError, match="does not exist: check its name"):
        read_calibration(tmp_path / "none.toml")
    path = tmp_path / "m.toml"
    path.write_text("modulus = 'a'\n")
    with pytest.raises(InputError, match="modulus must be a number; got 'a'"):
        read_calibration(path)
    path.write_text("modulus = 500\npoisson = 0.3\n")
    with pytest.raises(InputError, match="needs the key 'tensile_strength'"):
        read_calibration(path)
    path.write_text("modulus = \n")
    with pytest.raises(InputError, match=r"cannot be read.*write it by ccfem calibrate"):
        read_calibration(path)


TABLE = [(0.0, 0), (0.1, 210), (0.2, 432), (0.3, 640), (0.4, 861), (0.6, 1290), (0.9, 1820)]
"""Displacement, mm, and force, N, of a curve: 2150 N/mm between 10 and 40 % of the peak."""


@pytest.mark.parametrize(
    ("place", "row", "wrong"),
    [
        (3, (1e6, 320), "1e+06 mm at 320 N"),
        (1, (0.6, 250), "0.6 mm at 250 N"),
        (4, (0.3, 1e6), "0.3 mm at 1e+06 N"),
        (7, (0.9, 18200), "0.9 mm at 18200 N"),
    ],
)
def test_a_row_that_leaves_the_curve_is_named(tmp_path, place, row, wrong):
    path, rows = tmp_path / "none.csv", [*TABLE]
    write = lambda: path.write_text(  # noqa: E731
        "# tested\ndisplacement,force\n" + "".join(f"{d},{f}\n" for d, f in rows)
    )
    write()
    assert read_curve(path).slope() == pytest.approx(2150.0, rel=1e-3)
    rows.insert(place, row)
    write()
    with pytest.raises(InputError) as caught:
        read_curve(path).slope()
    assert str(caught.value) == (
        f"none.csv, line {place + 3}: {wrong} lies far off the line of the other rows: correct or "
        "delete the line"
    )


def test_noise_slack_and_yield_stay_on_the_curve():
    noise = np.random.default_rng(1).normal(scale=0.02, size=62)
    rough = curve(300.0, 900.0)
    rough = dataclasses.replace(rough, displacement=rough.displacement * (1.0 + noise))
    assert rough.slope() == pytest.approx(300.0, rel=0.1)
    few = Curve(np.array([0.0, 0.1, 0.2, 0.3, 0.4, 1.0]), 100.0 * np.array([0, 1, 2, 3, 4, 9.0]))
    assert few.slope() == pytest.approx(1000.0)


@pytest.mark.parametrize(
    ("stiffness", "peak", "said"),
    [(1e-6, 1.0, "the modulus that follows is"), (1e3, 1e7, "the strength that follows is")],
)
def test_values_that_no_material_has_are_refused(stiffness, peak, said):
    with pytest.raises(InputError, match=rf"none.csv: {said} .* usual: check the units of the"):
        calibrate(pulled(), curve(stiffness * AREA / LENGTH, peak, "none.csv"))


def test_curves_without_a_slope_are_refused():
    with pytest.raises(InputError, match=r"at least 3 rising points .* got 0: record more"):
        Curve(np.array([0.0, 1.0]), np.array([0.0, 5.0])).slope()
    line = np.linspace(0.0, 1.0, 50)
    with pytest.raises(InputError, match="force falls with displacement"):
        Curve(-line, line).slope()
    with pytest.raises(InputError, match="as many forces"):
        Curve(line, line[:-1])


def test_impossible_calibrations_are_refused():
    stiffness = 500.0 * AREA / LENGTH
    none, weak = curve(stiffness, 2000.0), curve(0.9 * stiffness, 2000.0, "weak.csv")
    with pytest.raises(InputError, match="both its curve and its toolpaths"):
        calibrate(pulled(), none, weak)
    with pytest.raises(InputError, match=r"weak.csv: the part with fibre is not stiffer"):
        calibrate(pulled(), none, weak, fibres())
    with pytest.raises(InputError, match="no strand between"):
        calibrate(pulled(), none, curve(1e4 * stiffness, 2000.0), fibres())
    with pytest.raises(InputError, match="got push: name one of draw"):
        calibrate(pulled(), none, case="push")
    carbon = transversely_isotropic(60000.0, 4100.0, 0.33, 2200.0)
    with pytest.raises(InputError, match="one isotropic modulus"):
        calibrate(dataclasses.replace(pulled(), material=carbon), none)


def test_the_load_case_must_be_named_where_there_are_several():
    problem = dataclasses.replace(pulled(), loads={"a": (), "b": (Force("x_max", (1.0, 0, 0)),)})
    with pytest.raises(InputError, match="name one of a, b"):
        calibrate(problem, curve(1.0, 1.0))
