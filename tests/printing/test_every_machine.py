"""What is written can be printed: a small part with every machine.

The numbers come from the file alone, by the printer on paper of `benchmarks.print_checks`.
"""

import csv

import numpy as np
import pytest

from benchmarks.print_checks.all_checks import CHECKS
from benchmarks.print_checks.job import FILAMENT, PART, own
from ccfem.machine import machine_names
from ccfem.printing.export.robot_waypoints import write_robot_cell
from ccfem.printing.part_moves import part_moves


@pytest.fixture(scope="module", params=machine_names())
def printed(request, small_part):
    return small_part(request.param)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_a_part_prints_with_every_machine(printed, check):
    assert check(printed, printed.done) == []


def test_the_checks_see_what_there_is_to_see(printed):
    run = printed.done
    assert len(run.strands()) == 2 * 3 + 1
    assert len(run.changes) == 4 + 1
    highest = max(step.end[2] for step in run.steps if step.lays)
    assert run.steps[-1].end[2] == pytest.approx(highest + printed.machine.process.tool_lift)
    assert {step.kind for step in run.steps if step.lays} >= {*PART, "Wipe tower", "Skirt/Brim"}


def test_block_and_bar_are_as_high_as_their_layers(printed):
    """What is fed fills a line's width from the layer below up to the nozzle."""
    steps = [s for s in printed.done.steps if s.lays and s.kind == "Wipe tower" and s.tool == 0]
    top = np.array([s.end[2] for s in steps])
    levels = np.append(0.0, np.unique(top))
    assert len(levels) > 3
    height = top - levels[np.searchsorted(levels, top) - 1]
    section = printed.machine.matrix_width * height
    long = np.array([s.length for s in steps]) > 1.0
    fed = np.array([s.fed * FILAMENT / s.length for s in steps])
    np.testing.assert_allclose(fed[long], section[long], rtol=0.02)


def test_the_bar_for_the_first_strand_is_three_lines_side_by_side(printed):
    """As long as the tail and 20 mm, a line's width apart; the first strand lies on the middle."""
    machine = printed.machine
    steps = [s for s in printed.done.steps if s.lays and s.kind == "Wipe tower"]
    long = [s for s in steps if s.tool == 0 and abs(s.length - machine.tail - 20.0) < 1e-2]
    across = np.unique(np.round([s.end[1] for s in long], 3))
    np.testing.assert_allclose(np.diff(across), [machine.matrix_width] * 2, atol=2e-3)
    assert across[-1] < printed.corner[1]
    on_bar = [s.end[1] for s in printed.done.steps if s.lays and s.strand.startswith("beside")]
    np.testing.assert_allclose(on_bar, across[1], atol=2e-3)


def test_the_head_says_what_is_used(printed):
    head, machine = printed.done.head, printed.machine
    steps = printed.done.steps
    fibre = sum(step.fed for step in steps if step.tool == 1)
    matrix = sum(step.fed for step in steps if step.tool == 0) + sum(s.beside for s in steps)
    said = [float(one) for one in head["filament used [mm]"].split(",")]
    np.testing.assert_allclose(said, [matrix, fibre], atol=0.02)
    grams = [float(one) for one in head["filament used [g]"].split(",")]
    tex = machine.fibre_tex or machine.filament_area * machine.fibre_density * 1000.0
    np.testing.assert_allclose(grams, [matrix * FILAMENT * 1.24e-3, fibre * tex * 1e-6], atol=2e-3)
    clock = head["estimated printing time (normal mode)"].split()
    parts = [float(one[:-1]) * {"h": 3600, "m": 60, "s": 1}[one[-1]] for one in clock]
    assert sum(parts) == float(head["TIME"])
    assert int(head["LAYER_COUNT"]) == len(printed.plan.top)
    assert head["too short for the cutter"].startswith("40.0 mm in 2 strands are laid") == (
        machine.strand_height >= 0.1
    )
    low = np.array([float(head[f"MIN{axis}"]) for axis in "XYZ"])
    laid = np.array([step.end for step in steps if step.lays])
    np.testing.assert_allclose(laid.min(axis=0), low, atol=1e-3)


def test_a_cell_of_robots_lays_the_same(printed, tmp_path):
    write_robot_cell(tmp_path / "cell.csv", part_moves(printed.plan, printed.machine))
    with (tmp_path / "cell.csv").open() as file:
        rows = list(csv.DictReader(file))
    place = np.array([[float(row[axis]) for axis in "xyz"] for row in rows])
    way = np.linalg.norm(np.diff(place, axis=0, prepend=place[:1]), axis=1)
    strand = np.array([int(row["path"]) for row in rows])
    lay = np.array([row["event"] == "lay" for row in rows])
    for number, steps in enumerate(own(printed.done).values()):
        here = lay & (strand == number)
        points = np.array([step.end for step in steps if step.length])
        np.testing.assert_allclose(place[here], points, atol=1e-3)
        feed = [float(row["feed"]) for row, mine in zip(rows, here, strict=True) if mine]
        assert np.dot(feed, way[here]) == pytest.approx(
            sum(step.fed for step in steps if step.length), abs=1e-3
        )
    events = [row["event"] for row in rows]
    assert events.count("cut") == len(printed.done.cuts) == events.count("start")
    assert events.count("tool 0") == events.count("tool 1") + 1 == 3
    assert {(row["nx"], row["ny"], row["nz"]) for row in rows} == {("0", "0", "1")}
