"""Tables as CSV: texts stay texts in a spreadsheet, and numbers numbers everywhere."""

import csv
import io

import numpy as np
import pandas as pd
import pytest

from ccfem.base.csv_table import as_text, write_csv
from ccfem.comparison.files import write_table
from ccfem.fem.stress_files.stress_file import table_stress
from ccfem.judging.virtual_testing.calibration import read_curve

NUMBERS = ("-1.5", "+2", "-1e-300", "0", "-inf", "nan", "1_000")
FORMULAS = (
    *("=cmd|' /C calc'!A0", "+1+1", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "\tx", "\rx", "\n=1"),
    *(" =1", "-", "=", "-1.5 mm", "\uff1d1", "a;=1", "a\t=1", "a\n-b"),
)


@pytest.mark.parametrize("text", FORMULAS)
def test_no_cell_begins_as_a_formula_does(text):
    """In files whose cells are separated by commas, semicolons or tabs, or end with a line."""
    written = as_text(text)
    assert written.replace("'", "") == text.replace("'", "")
    for piece in (written, *written.replace("\t", ";").replace("\n", ";").split(";")):
        assert piece.strip()[:1] not in tuple("=+-@\uff1d")
    assert written[:1] not in tuple("\t\r\n")
    assert as_text(written) == written


@pytest.mark.parametrize("text", NUMBERS)
def test_numbers_stay_numbers(text):
    assert as_text(text) == text


def test_a_table_is_what_pandas_writes_where_there_are_no_formulas(tmp_path):
    frame = pd.DataFrame(
        {
            "name": ["bar", 'a, "b"', None],
            "value": [-1.5, np.nan, 1e-20],
            "count": [1, -2, 3],
            "kept": [True, False, True],
            "mixed": [-3, "total", None],
        }
    )
    write_csv(tmp_path / "a.csv", [*frame], frame.itertuples(index=False))
    assert (tmp_path / "a.csv").read_text() == frame.to_csv(index=False)


def test_names_of_columns_and_cells_are_read_back(tmp_path):
    write_csv(tmp_path / "a.csv", ["=a", "b"], [["=cmd|calc!A0", -1.5], ["x", float("nan")]])
    rows = list(csv.reader(io.StringIO((tmp_path / "a.csv").read_text())))
    assert rows == [["'=a", "b"], ["'=cmd|calc!A0", "-1.5"], ["x", ""]]


def test_what_ccfem_reads_itself_is_read_back(tmp_path):
    curve = [[0.0, 0.0], *([0.01 * k, 100.0 * k] for k in range(1, 11))]
    write_csv(tmp_path / "c.csv", ("displacement_mm", "force [N]"), curve)
    assert read_curve(tmp_path / "c.csv").slope() == pytest.approx(1e4)
    stress = [[k, *(-1.5 * k for _ in range(6))] for k in range(3)]
    names = ("element", *(f"S{axes} [MPa]" for axes in ("xx", "yy", "zz", "xy", "yz", "xz")))
    write_csv(tmp_path / "s.csv", names, stress)
    assert table_stress(tmp_path / "s.csv").cell[2].tolist() == [-3.0] * 6


def test_names_of_runs_are_no_formulas_in_the_table_of_results(tmp_path):
    rows = [{"strategy": "=cmd|calc!A0", "layer": "total", "failure": "", "stress": -1.5}]
    write_table(rows, tmp_path / "results.csv")
    text = (tmp_path / "results.csv").read_text()
    assert text == "strategy,layer,failure,printable,why_not,stress\n'=cmd|calc!A0,total,,,,-1.5\n"
