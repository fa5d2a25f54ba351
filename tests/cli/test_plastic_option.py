"""``--set-plastic``: words that make no sense in one line, and what follows those that do."""

import csv
import json
import re

import pytest

from ccfem.cases.part_file import read_part
from ccfem.cases.part_writing import part_text
from ccfem.paths.plastic import Plastic

QUICK = ("bar", "--set-case", "element_size=6.0")
SPARSE = "infill=gyroid,density=0.3,walls=1,skins=1"


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (["--set-plastic", "infill=foam"], "infill must be one of 'solid', 'lines', 'grid'"),
        (["--set-plastic", "density=0.9"], "density must be at least 0.05 and at most 0.6"),
        (["--set-plastic", "walls=two"], "plastic.walls must be a whole number"),
        (["--set-plastic", "brim=3"], "plastic has no key 'brim'"),
        (["--set-plastic", "infill"], "expected NAME=VALUE"),
        (
            ["--set-plastic", "infill=grid", "--slicings", "planar:z,planar:x"],
            "compare slicings, plan for a stiffness",
        ),
        (["--set-plastic", "infill=grid", "--slicing", "spatial"], "goes with flat layers"),
    ],
)
def test_words_that_make_no_sense_are_answered_in_one_line(ccfem, tmp_path, words, answer):
    code, _, said = ccfem("compare", *QUICK, *words)
    assert code == 2
    assert answer in said
    assert said.count("ccfem: error: ") == 1
    assert not (tmp_path / "results").exists() or not any((tmp_path / "results").iterdir())


def test_check_table_and_record_say_how_much_is_plastic(ccfem, tmp_path):
    code, out, _ = ccfem("check", *QUICK, "--set-plastic", f"{SPARSE}")
    assert code in (0, 3)
    (line,) = [line for line in out.splitlines() if "plastic:" in line]
    filled = float(re.search(r"(\d+)% of the volume is filled", line)[1])
    assert "1 wall, 1 skin, 30% gyroid" in line
    assert 30.0 < filled <= 100.0
    ways = ("--strategies", "zigzag", "--layers", "2", "--natural")
    masses = {}
    for name, plastic in (("sparse", SPARSE), ("solid", "walls=1")):
        folder = tmp_path / name
        words = ("--set-plastic", plastic, "--out", str(folder))
        code, _, _ = ccfem("compare", *QUICK, *ways, *words)
        assert code == 0
        with (folder / "results.csv").open() as file:
            *_, total = csv.DictReader(file)
        masses[name] = float(total["matrix_mass"]), float(total["stiffness"])
        record = json.loads((folder / "results.json").read_text())
        assert record["case"]["plastic"]["infill"] == ("gyroid" if name == "sparse" else "solid")
    assert masses["sparse"][0] < 0.95 * masses["solid"][0]
    assert masses["sparse"][1] < masses["solid"][1]


def test_a_part_file_says_it_and_is_written_with_it(tmp_path):
    from ccfem.body.files import write_mesh
    from ccfem.body.mesh.box import box_mesh

    write_mesh(box_mesh((20.0, 10.0, 5.0), (2, 2, 1)), tmp_path / "box.vtu")
    text = """
mesh = "box.vtu"
material = "pla"
[[supports]]
patch = "x_min"
[[loads.pull]]
kind = "force"
patch = "x_max"
vector = [1, 0, 0]
[plastic]
infill = "lines"
walls = 3
seam = "corner"
"""
    file = tmp_path / "part.toml"
    file.write_text(text)
    case = read_part(file)
    assert case.plastic == Plastic("lines", walls=3, seam="corner")
    file.write_text(part_text(case, "box.vtu"))
    assert read_part(file).plastic == case.plastic
