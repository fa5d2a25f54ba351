"""``ccfem plan --gcode``: a part file in, a file to print out."""

import json
import re

import numpy as np
import pytest
from command_line import run_command, without_progress

from ccfem.printing.export.waypoints import read_waypoints

PART = """
layers = 2
[planform]
outline = [[0, 0], [60, 0], [60, 24], [0, 24]]
height = 3.0
edge_length = 4.0
[material]
modulus = 3500.0
poisson = 0.35
[patches.left]
rule = "plane"
normal = "x"
offset = "min"
[patches.right]
rule = "plane"
normal = "x"
offset = "max"
[[supports]]
patch = "left"
[[loads.pull]]
kind = "force"
patch = "right"
vector = [100, 0, 0]
[machine]
cutter_distance = 42.0
"""


@pytest.fixture
def ccfem(monkeypatch, capsys, tmp_path):
    """Call the command line in a folder of its own: exit code, stderr, files in results."""

    def call(part, *arguments):
        (tmp_path / "part.toml").write_text(part)
        words = ["plan", "part.toml", "--strategy", "zigzag", "--no-virtual-test", *arguments]
        code, _, err = run_command(monkeypatch, capsys, tmp_path, *words)
        return code, without_progress(err), tmp_path / "results" / "part-zigzag"

    return call


def test_the_printed_fibre_is_the_planned_fibre(ccfem, follow):
    # Without what the process adds: the evaluator counts the speeds of the table.
    plain = "start_length = 0\nramp_length = 0\ncorner_angle = 180\nfinish_speed = 1000\n"
    part = f"{PART}[machine.process]\n{plain}[machine.speeds]\n"
    code, err, folder = ccfem(part, "--gcode", "--set-machine", "process.prime=none")
    assert (code, err) == (0, "")
    run = follow((folder / "zigzag.gcode").read_text())
    waypoints = read_waypoints(folder / "zigzag_waypoints.txt", np.eye(3))
    strands = run.lines(1)
    assert len(strands) == len(waypoints) == run.events.count("cut") > 0
    length = sorted(strand.length for strand in strands)
    assert length == pytest.approx(sorted(waypoints.lengths), abs=0.05)
    about = json.loads((folder / "results.json").read_text())
    assert about["machine"]["speeds"]["speed"] == [7.0, 15.0, 35.0]
    (total,) = [strategy["total"] for strategy in about["strategies"]]
    assert total["cuts"] == len(strands)
    laid = sum(move.seconds for strand in strands for move in strand.moves)
    assert total["fibre_length"] / total["mean_speed"] == pytest.approx(laid, rel=1e-3)


def test_no_file_without_the_option(ccfem):
    code, _, folder = ccfem(PART)
    assert code == 0
    assert not list(folder.glob("*.gcode"))


@pytest.mark.parametrize(
    ("machine", "message"),
    [
        ("minimum_length = 20.0", "machine.minimum_length is 20 mm, but the cutter lies 42 mm"),
        ("fibre_speed = 0", "machine.fibre_speed must be above 0 to print"),
        ("[machine.gcode]\nbed = [50, 50, 50]", "the part needs 59.2 x 23.2 x 4 mm, but the print"),
        ("[machine.gcode]\ncut = ['{pin}']", "gcode.cut has no field '{pin}'"),
    ],
)
def test_what_cannot_be_printed_ends_in_one_line(ccfem, machine, message):
    code, err, folder = ccfem(PART + machine, "--gcode")
    assert code == 2
    assert err.startswith("ccfem: error: ")
    assert err.count("\n") == 1
    assert message in err
    assert not folder.exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--gcode", "--copies", "400"], "400 copies of 60 x 24 mm do not fit on the bed"),
        (["--gcode", "--centre", "2,2"], "with its middle at 2, 2 mm the part, or what is printed"),
        (["--gcode", "--turn", "w=1"], "a turn must be AXIS=DEGREES, as x=90; got 'w=1'"),
        (["--gcode", "--pause", "900"], "a pause must lie within the print, layer 1 to"),
        (["--gcode", "--pause", "3 cm"], "a pause must be a layer, as 12, or a height, as 3.4mm"),
        (["--gcode", "--from-layer", "900"], "--from-layer must be a layer of the print, 0 to"),
        (["--pause", "3"], "pauses and a first layer are of a print: add --gcode"),
        (["--copies", "2"], "--centre and --copies place a print on the bed: add --gcode"),
    ],
)
def test_a_wrong_place_on_the_bed_or_in_the_print_ends_in_one_line(ccfem, words, said):
    code, err, folder = ccfem(PART, *words)
    assert (code, err.count("\n")) == (2, 1)
    assert said in err
    assert not folder.exists()


def test_options_and_table_place_copies_and_say_that_all_is_of_all(ccfem, follow):
    code, err, folder = ccfem(PART, "--gcode", "--copies", "1x2", "--turn", "z=90")
    assert (code, err) == (0, "")
    text = (folder / "zigzag.gcode").read_text()
    seconds = float(re.search(r";TIME:(\d+)", text)[1])
    run, about = follow(text), json.loads((folder / "results.json").read_text())
    (total,) = [strategy["total"] for strategy in about["strategies"]]
    assert len(run.lines(1)) == 2 * total["paths"] + 1  # and the first strand, on its bar
    assert "; 2 copies, of all of which are fibre, matrix, time and file" in text
    assert total["whole_print_time"] == pytest.approx(seconds, abs=1)
    upright = PART.replace("[planform]", "[bed]\nturn = ['x=90']\ncopies = 2\n[planform]")
    code, _, folder = ccfem(upright, "--gcode", "--force")
    assert code == 0
    again = (folder / "zigzag.gcode").read_text()
    height = float(re.search(r";MAXZ:([\d.]+)", again)[1])
    assert height == pytest.approx(24.0, abs=1e-3)


def test_pauses_spools_and_costs_are_in_file_and_record(ccfem):
    supplies = "[machine.spools]\nfibre = 2.0\n[machine.costs]\nhour = 12\ncurrency = 'EUR'\n"
    code, _, folder = ccfem(PART + supplies, "--gcode", "--pause", "2", "--from-layer", "1")
    assert code == 0
    text = (folder / "zigzag.gcode").read_text()
    (record,) = json.loads((folder / "results.json").read_text())["strategies"]
    printed = record["print"]
    assert (printed["copies"], printed["pauses"], printed["first_layer"]) == (1, [2], 1)
    seconds = float(re.search(r";TIME:(\d+)", text)[1])
    assert sum(printed["layer_seconds"].values()) == pytest.approx(seconds, abs=1.0)
    assert min(map(int, printed["layer_seconds"])) == 1
    assert printed["cost"]["machine"] == pytest.approx(12.0 * seconds / 3600.0, abs=2e-3)
    (spool,) = printed["spools"]
    assert f"; fibre: {spool['length']:.2f} m, needs {spool['count']} spools, change before" in text
    assert text.count("\nM0\n") == 1
    assert "; begins at layer 1, on" in text


def test_a_table_for_robots_is_written_where_it_is_wanted(ccfem):
    code, _, folder = ccfem(PART, "--gcode")
    assert code == 0
    assert (folder / "zigzag.gcode").exists()
    assert not (folder / "zigzag_cell.csv").exists()
    code, _, folder = ccfem(PART, "--gcode", "--cell")
    assert code == 0
    assert (folder / "zigzag_cell.csv").read_text().startswith("path,tool,layer")
    code, err, _ = ccfem(PART, "--cell")
    assert (code, err) == (2, "ccfem: error: --cell writes the moves of a print: add --gcode\n")
