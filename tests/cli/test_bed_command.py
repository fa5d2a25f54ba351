"""``ccfem bed``: different parts in one file, and words that make no sense."""

import csv
import json

import numpy as np
import pytest

from benchmarks.print_checks.job import FILAMENT, own
from benchmarks.print_checks.printer import follow

PART = """
name = "{name}"
layers = {layers}
material = "pla"
[planform]
outline = [[0, 0], [{long}, 0], [{long}, 20], [0, 20]]
height = {height}
edge_length = 5
[patches.left]
rule = "plane"
normal = "-x"
offset = 0
[patches.right]
rule = "plane"
normal = "x"
offset = {long}
[[supports]]
patch = "left"
[[loads.pull]]
kind = "force"
patch = "right"
vector = [500, 0, 0]
{more}
"""
BARS = {
    "short": {"long": 70, "height": 2.4, "layers": 2, "more": ""},
    "long": {"long": 90, "height": 3.2, "layers": 3, "more": "[machine]\nmatrix_height = 0.35"},
}
QUICK = ("--strategy", "zigzag", "--machine", "marlin_two_tools", "--no-virtual-test")


@pytest.fixture
def bars(tmp_path):
    for name, values in BARS.items():
        (tmp_path / f"{name}.toml").write_text(PART.format(name=name, **values))


def test_one_file_and_one_table_hold_all_parts(bars, ccfem, tmp_path):
    words = ("--set-machine", "matrix_height=0.35", "--pause", "2mm", "--set", "zigzag.spacing=4")
    words += ("--set-machine", "gcode.thumbnails=['64x48']")
    code, out, _ = ccfem("bed", "short.toml", "long.toml", "short.toml", *QUICK, *words)
    folder = tmp_path / "results" / "bed"
    assert code == 0
    assert {path.name for path in folder.iterdir()} == {
        *("bed.gcode", "parts.csv", "bed.json", "report.html", ".ccfem.json")
    }
    assert "2 x short" in out
    assert "3 parts in" in out
    with (folder / "parts.csv").open() as file:
        rows = {row["part"]: row for row in csv.DictReader(file)}
    record = json.loads((folder / "bed.json").read_text())
    text = (folder / "bed.gcode").read_text()
    run = follow(text, "marlin_two_tools")
    assert run.wrong == []
    assert len(run.halts) == 1
    assert "thumbnail begin 64x48" in text
    # What a printer on paper lays within each part, and how much is said of it.
    for name, row in rows.items():
        spots = [spot for spot in record["standing"] if spot["name"] == name]
        assert int(row["print_count"]) == len(spots) == (2 if name == "short" else 1)
        fed, strands, cruise = np.zeros(2), set(), 0.0
        for step in run.steps:
            for spot in spots:
                low, high = np.subtract(spot["low"], 2e-3), np.add(spot["high"], 2e-3)
                ends = np.array([step.start[:2], step.end[:2]])
                if (ends >= low).all() and (ends <= high).all():
                    fed[step.tool] += step.fed if step.tool or step.lays else 0.0
                    cruise += step.length / step.speed if step.lays else 0.0
                    strands |= {step.strand} if step.tool == 1 and step.strand else set()
        mass = 1e-3 * 1.24 * FILAMENT * fed[0]
        assert float(row["print_matrix_mass"]) == pytest.approx(mass, rel=2e-3)
        assert float(row["print_fibre"]) == pytest.approx(1e-3 * fed[1], rel=1e-6)
        # Cuts, feeds and ways between lines come to the time at the speeds of the file.
        assert 1.0 < float(row["print_seconds"]) / cruise < 1.6
        # The strands that are judged are those that are printed.
        assert len(strands) == len(spots) * int(float(row["paths"]))
    shares = sum(float(row["print_seconds"]) for row in rows.values())
    assert shares < float(run.head["TIME"])
    # From a layer on the file is the rest of the same, and both parts are in it.
    rest = tmp_path / "rest"
    more = ("--from-layer", "4", "--copies", "2", "--copies", "1", "--out", str(rest))
    code, _, _ = ccfem("bed", "short.toml", "long.toml", *QUICK, *words, *more)
    assert code == 0
    left = follow((rest / "bed.gcode").read_text(), "marlin_two_tools")
    level = min(step.end[2] for step in left.steps if step.lays and step.tool == 0)
    assert level > top_of(text, 3)
    above = [steps for steps in own(run).values() if steps[0].end[2] > top_of(text, 3)]
    assert 0 < len(own(left)) == len(above) < len(own(run))


def top_of(text, layer):
    """Height of a layer by the comments of a file."""
    lines = text.split("\n")
    return float(lines[lines.index(f";LAYER:{layer}") - 2].partition(":")[2])


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (["short.toml", "nothing.toml"], "nothing.toml"),
        (["short.toml", "long.toml", *QUICK], "machine.fibre_width"),
        (["short.toml", "long.toml", "--copies", "1", "--copies", "2", "--copies", "3"], "3 for 2"),
        (["short.toml", "long.toml", *QUICK, "--copies", "60"], "fit: ask for fewer"),
        (["short.toml", "long.toml", *QUICK, "--centre", "150,150"], "but need 4"),
        (["short.toml", "--from-layer", "-1"], "at least 0"),
    ],
)
def test_words_that_make_no_sense_are_answered_in_one_line(bars, ccfem, tmp_path, words, answer):
    if "fibre_width" in answer:
        file = tmp_path / "long.toml"
        file.write_text(file.read_text().replace("matrix_height", "fibre_width"))
        words = [word for word in words if word not in ("--machine", "marlin_two_tools")]
    code, _, said = ccfem("bed", *words)
    assert code == 2
    assert answer in said
    assert said.count("ccfem: error: ") == 1
    assert not (tmp_path / "results").exists() or not any((tmp_path / "results").iterdir())
