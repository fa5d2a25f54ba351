"""``ccfem check`` and ``ccfem mesh``: what they print and write."""

import pytest

PART = """
title = "Strip, 60 mm"
material = "pla"
[planform]
outline = [[0, 0], [60, 0], [60, 20], [0, 20]]
height = 5
edge_length = 5
[patches.foot]
rule = "plane"
normal = "x"
offset = "min"
[patches.end]
rule = "plane"
normal = "x"
offset = "max"
[[supports]]
patch = "foot"
[[loads.pull]]
kind = "force"
patch = "end"
vector = [100, 0, 0]
"""


def test_check_says_and_draws(ccfem, tmp_path):
    (tmp_path / "strip.toml").write_text(PART)
    code, out, err = ccfem("check", "strip.toml")
    assert (code, err) == (0, "")
    assert "60 x 20 x 5 mm, 6 cm^3, pla" in out
    assert "nothing keeps this part from being solved" in out
    assert {path.name for path in tmp_path.iterdir()} == {
        *("strip.toml", "strip-check.png", "strip-check.html"),
    }


def test_check_names_all_mistakes_and_writes_nothing(ccfem, tmp_path):
    wrong = PART.replace('"pla"', '"plaa"').replace("edge_length = 5", 'edge_length = "5 mm"')
    wrong = wrong.replace('patch = "foot"', 'pacth = "foot"', 1)
    (tmp_path / "strip.toml").write_text(wrong)
    code, out, err = ccfem("check", "strip.toml")
    assert (code, out) == (2, "")
    lines = err.splitlines()
    assert all(line.startswith("ccfem: error: strip.toml: ") for line in lines)
    assert any("no material named 'plaa'" in line for line in lines)
    assert any("no key 'pacth'; it has: patch" in line for line in lines)
    assert any("got '5 mm': write 5 without quotes and unit, in mm" in line for line in lines)
    assert [path.name for path in tmp_path.iterdir()] == ["strip.toml"]


def test_check_of_what_cannot_be_solved_ends_in_two(ccfem, tmp_path):
    (tmp_path / "strip.toml").write_text(
        PART.replace('patch = "foot"\n[[l', 'patch = "foot"\ncomponents = "x"\n[[l')
    )
    code, out, err = ccfem("check", "strip.toml", "--out", "strip.png")
    assert code == 2
    assert "276 linear cells" in out
    assert "free to" not in out
    assert err.startswith("ccfem: error: the part is free to")
    assert (tmp_path / "strip.html").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("mesh", "a.stl", "--size", "2", "-o", ""), "must not be empty"),
        (("mesh", "a.stl", "--size", "2", "-o", "a.msh"), "cannot write a mesh to a.msh"),
        (("mesh", "a.txt", "--size", "2", "-o", "a.vtu"), "cannot mesh a.txt"),
        (("mesh", "a.stl", "--size", "-2", "-o", "a.vtu"), "does not exist"),
        (("check", "bar", "--out", "bar.doc"), "a picture is written as"),
        (("compare", "bar", "--layers", "1000000000"), "at most 100000"),
    ],
)
def test_bad_words_are_one_line(ccfem, tmp_path, arguments, message):
    code, out, err = ccfem(*arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
