"""``ccfem calibrate`` and ``--calibration``, called with the words of a user."""

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from ccfem.cli.main import main
from ccfem.judging.virtual_testing.calibration import read_calibration

QUICK = ["--set-case", "element_size=4.0", "--layers", "2"]


class Ended(NamedTuple):
    """What a command left."""

    returncode: int
    stdout: str
    stderr: str


def ccfem(*arguments: str, folder: Path) -> Ended:
    """Call the command line in a folder."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.chdir(folder)
        patch.setattr(sys, "argv", ["ccfem", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
    code = ended.value.code or 0
    assert isinstance(code, int)
    return Ended(code, out.getvalue(), err.getvalue())


def curve(path: Path, slope: float, peak: float) -> None:
    displacement = np.linspace(0.0, peak / slope, 30)
    rows = [f"{d},{slope * d}" for d in displacement]
    path.write_text("displacement [mm],force [N]\n" + "\n".join(rows) + "\n")


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("calibrate")
    curve(folder / "none.csv", 400.0, 900.0)
    curve(folder / "fibre.csv", 520.0, 1500.0)
    rows = (folder / "none.csv").read_text().splitlines()
    (folder / "row.csv").write_text("\n".join([*rows[:9], "1000000,320", *rows[9:]]))
    run = ccfem(
        "calibrate", "bar", *QUICK, "--unreinforced", "none.csv", "--reinforced", "fibre.csv",
        "--strategy", "isocurve", "--out", "printed.toml", folder=folder,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert "printed.toml: modulus" in run.stdout
    return folder


def test_the_calibrated_part_has_the_measured_stiffness(calibrated: Path) -> None:
    """A plan of the same fibre with the fitted values gives the two slopes back."""
    found = read_calibration(calibrated / "printed.toml")
    assert found.rho is not None
    run = ccfem(
        "plan", "bar", *QUICK, "--strategy", "isocurve", "--calibration", "printed.toml",
        "--out", "again", folder=calibrated,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    frame = (calibrated / "again" / "results.csv").read_text().splitlines()
    header, total = frame[0].split(","), frame[-1].split(",")
    values = dict(zip(header, total, strict=True))
    assert float(values["stiffness_ratio_tension"]) == pytest.approx(520.0 / 400.0, rel=1e-3)
    assert float(values["stiffness"]) == pytest.approx(520.0, rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--unreinforced", "no.csv"], "CSV file no.csv does not exist: check its name and folder"),
        (["--unreinforced", "none.csv", "--reinforced", "fibre.csv"], "belong together"),
        (
            ["--unreinforced", "row.csv"],
            "row.csv, line 10: 1e+06 mm at 320 N lies far off",
        ),
    ],
)
def test_bad_input_is_one_line(calibrated: Path, arguments: list[str], message: str) -> None:
    run = ccfem("calibrate", "bar", *QUICK, *arguments, "--out", "x.toml", folder=calibrated)
    assert run.returncode == 2
    assert message in run.stderr
    assert len(run.stderr.splitlines()) == 1
    assert not (calibrated / "x.toml").exists()


def test_a_curve_is_not_replaced_by_the_material(calibrated: Path) -> None:
    before = (calibrated / "none.csv").read_text()
    run = ccfem(
        "calibrate", "bar", *QUICK, "--unreinforced", "none.csv", "--out", "./none.csv",
        folder=calibrated,
    )  # fmt: skip
    assert run.returncode == 2
    assert "is the curve of a test: name another file for the material" in run.stderr
    assert (calibrated / "none.csv").read_text() == before


@pytest.mark.parametrize("out", ["nofolder/x.toml", "."])
def test_a_file_that_cannot_be_written_is_refused_before_the_solve(
    calibrated: Path, out: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    solved = []
    monkeypatch.setattr(
        "ccfem.judging.virtual_testing.calibration.calibrate", lambda *_: solved.append(1)
    )
    monkeypatch.chdir(calibrated)
    command = ["ccfem", "calibrate", "bar", "--unreinforced", "none.csv", "--out", out]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith(f"ccfem: error: cannot write {out}: ")
    assert said.count("\n") == 1
    assert not solved


def test_a_missing_material_is_one_line(calibrated: Path) -> None:
    run = ccfem(
        "plan", "bar", *QUICK, "--strategy", "isocurve", "--calibration", "no.toml",
        "--out", "none", folder=calibrated,
    )  # fmt: skip
    assert run.returncode == 2
    assert "material file no.toml does not exist: check its name and folder" in run.stderr
    assert not (calibrated / "none").exists()
