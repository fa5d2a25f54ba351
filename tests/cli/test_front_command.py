"""``ccfem front`` with words that make no sense: one line, exit code 2."""

import numpy as np
import pytest

from ccfem.cli import fibre_amounts
from ccfem.comparison.front_cases import PointCases
from ccfem.comparison.front_points import FibreFront, FrontPoint
from ccfem.paths.toolpaths import Toolpaths
from ccfem.strategies.fibre_aware.upper_bound import UpperBound

QUICK = ["bar", "--set-case", "element_size=4.0", "--strategy", "zigzag", "--layers", "2"]


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (["--layers", "nan"], "--layers expects whole numbers as 6,12; got 'nan'"),
        (["--layers", "2.5"], "--layers expects whole numbers"),
        (["--strength", "much"], "expected numbers separated by commas"),
        (["--strength", ","], "--strength expects numbers from 0 to 1"),
        (["--strength", "0,0.5"], "'zigzag' does not plan for strength"),
        (["--load-case", "all"], "all load cases of 'bar' were asked for and it has one (pull)"),
        (["--set-fibre", "levels=3"], "fibre has no key 'levels'"),
        (["--set-fibre", "layers=7"], "fibre is asked for on layer 7"),
    ],
)
def test_words_that_make_no_sense_are_answered_in_one_line(ccfem, tmp_path, words, answer):
    code, _, said = ccfem("front", *QUICK, *words)
    assert code == 2
    assert answer in said
    assert said.count("ccfem: error: ") == 1
    assert not (tmp_path / "results").exists() or not any((tmp_path / "results").iterdir())


@pytest.mark.parametrize(
    ("asked", "said"), [(2229.0, "of which it lays 1895 mm a layer"), (1900.0, "")]
)
def test_a_plan_that_lays_less_than_asked_is_said_to(capsys, asked, said):
    point = FrontPoint(3, asked, 5685.0, 3.07, 2788.0, "fibre", 3.29, "", Toolpaths.empty())
    fibre_amounts._say(FibreFront("bar", "stream_function", (point,), {}, 1999.0))
    lines = capsys.readouterr().out.splitlines()
    command = f"ccfem plan ... --strategy stream_function --layers 3 --fibre-per-layer {asked:.0f}"
    assert lines[2].split()[3:5] == ["3.070*", "3.290"]
    after = lines[lines.index(command) + 1 :]
    assert after[0].startswith(said) if said else not after


def test_a_plan_without_a_bound_has_a_dash(capsys):
    point = FrontPoint(3, 9.0, 27.0, 3.07, 2788.0, "fibre", np.nan, "", Toolpaths.empty())
    fibre_amounts._say(FibreFront("bar", "zigzag", (point,), {}, 1999.0))
    assert capsys.readouterr().out.splitlines()[2].split()[4] == "-"


def test_the_table_of_several_load_cases_says_every_ratio_with_its_bound(capsys):
    bound = UpperBound("worst", [4.0, 2.0], [0.5, 0.5], 1.25, 1.26, [0.5, 0.5])
    cases = PointCases(("pull", "side"), [2.4, 1.5], [3.0, 2.5], bound)
    plan = (2.4, 2500.0, "fibre", 4.0, "", Toolpaths.empty(), 0.0, cases)
    found = FibreFront(
        "bar", "pruned", (FrontPoint(2, 900.0, 1800.0, *plan),), {}, 1.5, (), ((1800.0, bound),)
    )
    fibre_amounts._say(found)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split("  ")[-1] == "first failure"
    words = lines[2].replace("(", " ").replace(")", " ").split()
    # Worst 2.4 / 4, at most 1 / 1.25; ratio and bound of each case; the one that fails first.
    wanted = "2 0 1.80 60.0%* 80.0% 2.400 4.000 1.500 2.000 2.5 × side*"
    assert words == wanted.split()
    assert len(lines[0]) == len(lines[1].split(" 1.5 ×")[0]) + len(" first failure")
    assert lines[-1] == (
        "ccfem plan ... --load-case all --strategy pruned --layers 2 --fibre-per-layer 900"
    )
