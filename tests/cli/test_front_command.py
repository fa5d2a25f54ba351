"""``ccfem front`` with words that make no sense: one line, exit code 2."""

import pytest

QUICK = ["bar", "--set-case", "element_size=4.0", "--strategy", "zigzag", "--layers", "2"]


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (["--strength", "much"], "expected numbers separated by commas"),
        (["--strength", ","], "--strength expects numbers from 0 to 1"),
        (["--strength", "0,0.5"], "'zigzag' does not plan for strength"),
        (["--load-case", "all"], "a front is of one load case"),
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
