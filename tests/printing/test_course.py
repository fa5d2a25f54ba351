"""Pauses, files that begin above the lowest layer, spools and costs, read back from the file."""

import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.print_checks.job import Lines
from benchmarks.print_checks.printer import follow
from ccfem.base.errors import InputError
from ccfem.machine import Machine, machine_names, updated
from ccfem.printing.course import Course, on_course
from ccfem.printing.duration import durations
from ccfem.printing.export.gcode import gcode
from ccfem.printing.part_moves import part_moves
from ccfem.printing.print_totals import print_totals, spool_uses


@pytest.fixture(scope="module", params=machine_names())
def printed(request, small_part):
    return small_part(request.param)


def file_of(job, course, machine=None):
    machine = machine or job.machine
    plan = on_course(job.plan, course, machine)
    text = gcode(plan, machine)
    return plan, text, follow(text, job.name)


def test_a_pause_comes_before_its_layer_lifted_and_parked(printed):
    last = len(printed.plan.top) - 1
    middle = last // 2
    height = float(printed.plan.top[middle - 1])
    for course in (Course((f"{last}", f"{middle}")), Course((f"{height:.6g}mm", f"{last}"))):
        plan, text, run = file_of(printed, course)
        assert plan.pauses == (middle, last)
        assert run.wrong == []
        halts, lines = run.halts, Lines.of(run)
        assert len(halts) == 2
        for halt, number in zip(halts, plan.pauses, strict=True):
            # All that is printed by then lies below this layer, and nothing of it comes later.
            assert halt.highest == pytest.approx(plan.top[number - 1])
            part = lines.lays & lines.in_part
            assert lines.end[: halt.at][part[: halt.at], 2].max() < plan.top[number] - 1e-6
            assert lines.end[halt.at :][part[halt.at :], 2].min() > plan.top[number - 1] - 1e-6
            assert halt.place[2] >= halt.highest + printed.machine.process.tool_lift - 1e-6
            carriage = np.array(halt.place[:2])
            if halt.tool == 1:
                carriage = carriage - printed.machine.gcode.offset[:2]
            np.testing.assert_allclose(carriage, printed.machine.gcode.park, atol=1e-3)
            before = text.index(f";LAYER:{number}\n")
            lines_of_pause = "\n".join(printed.machine.gcode.pause)
            assert before < text.index(lines_of_pause, before)
        # What is laid is what is laid without a pause.
        whole = Lines.of(printed.done)
        for tool in (0, 1):
            laid = [of.length[of.lays & (of.tool == tool)].sum() for of in (lines, whole)]
            assert laid[0] == pytest.approx(laid[1])
        fed = [of.fed[of.tool == 0].sum() for of in (lines, whole)]
        assert fed[0] == pytest.approx(fed[1], abs=1e-3)
        assert f"; pause before layer {middle}" in text


def test_a_file_from_a_layer_lays_what_the_whole_file_lays_above(printed):
    whole = Lines.of(printed.done)
    for first in range(1, len(printed.plan.top)):
        plan, text, run = file_of(printed, Course(from_layer=first))
        assert run.wrong == []
        below, rest = float(plan.top[first - 1]), Lines.of(run)
        mine, other = (
            [
                (start, end, fed)
                for start, end, fed, here in zip(
                    of.start.tolist(),
                    of.end.tolist(),
                    of.fed.tolist(),
                    of.lays & of.in_part & ~of.beside_part & (of.end[:, 2] > below + 1e-6),
                    strict=True,
                )
                if here
            ]
            for of in (rest, whole)
        )
        assert mine == other
        # Nothing stands where the nozzle goes first, and block and bar go on where they are.
        travel = rest.rapid & (np.abs(rest.end - rest.start)[:, :2].max(axis=1) > 0.0)
        assert rest.end[travel, 2].min() >= below + printed.machine.gcode.lift - 1e-6
        beside = rest.lays & ~rest.in_part
        known = whole.end[whole.lays & (whole.kind == "Wipe tower")]
        assert (rest.end[beside] >= known.min(axis=0) - 1e-6).all()
        assert (rest.end[beside] <= known.max(axis=0) + 1e-6).all()
        assert "Skirt/Brim" not in set(rest.kind[rest.lays].tolist())
        assert "; begins at layer" in text.split("G", 1)[0]
        assert re.search(r"(?m)^G28$", text.split("M109")[0]) is None
        assert f"={below:.10g}" in text or f"Z{below:.10g}" in text
        assert f";LAYER:{first}\n" in text
        assert f";LAYER:{first - 1}\n" not in text


def test_the_rest_takes_what_is_left_of_the_whole(printed):
    first = len(printed.plan.top) // 2
    plan = on_course(printed.plan, Course(from_layer=first), printed.machine)
    rest = print_totals(part_moves(plan, printed.machine), printed.machine)
    whole = print_totals(part_moves(printed.plan, printed.machine), printed.machine)
    after = sum(taken for layer, taken in whole.by_layer.items() if layer >= first)
    assert rest.seconds == pytest.approx(after, rel=0.1)
    assert sum(whole.by_layer.values()) == pytest.approx(whole.seconds)


@pytest.mark.parametrize(
    ("course", "said"),
    [
        ({"pauses": ("0",)}, "a pause must lie within the print"),
        ({"pauses": ("400",)}, "a pause must lie within the print"),
        ({"pauses": ("0.01mm",)}, "a pause must lie within the print"),
        ({"pauses": ("1.8mm",)}, "a pause must lie within the print"),
        ({"pauses": ("3",), "from_layer": 3}, "a pause must lie within the print"),
        ({"from_layer": 400}, "--from-layer must be a layer of the print"),
        ({"pauses": ("-1",)}, "a pause must be a layer"),
        ({"pauses": ("1.5",)}, "a pause must be a layer"),
        ({"pauses": ("top",)}, "a pause must be a layer"),
        ({"from_layer": -1}, "at least 0"),
    ],
)
def test_what_is_no_place_in_a_print_is_refused(small_part, course, said):
    job = small_part("marlin_two_tools")
    with pytest.raises(InputError, match=said):
        on_course(job.plan, Course(**course), job.machine)


def test_curved_layers_go_on_from_no_layer(small_part):
    plan = small_part("marlin_two_tools").plan
    tilted = np.tile([0.0, 0.6, 0.8], (len(plan.paths.points), 1))
    curved = replace(plan, paths=replace(plan.paths, normals=tilted))
    with pytest.raises(InputError, match="flat layers"):
        on_course(curved, Course(from_layer=2), Machine())


def test_layers_say_the_time_until_then(small_part):
    shown = ["M73 P{percent} R{minutes}", ";TIME_ELAPSED:{elapsed}"]
    job = small_part("marlin_two_tools", {"gcode": {"layer": shown}})
    assert job.done.wrong == []
    elapsed = [float(x) for x in re.findall(r"TIME_ELAPSED:([\d.]+)", job.text)]
    moves = part_moves(job.plan, job.machine)
    seconds = durations(moves, job.machine)
    for number, until in enumerate(elapsed):
        assert until == pytest.approx(seconds[moves.layer < number].sum(), abs=0.06)
    percent = [int(x) for x in re.findall(r"M73 P(\d+) ", job.text)]
    minutes = [int(x) for x in re.findall(r"M73 P\d+ R(\d+)", job.text)]
    total = float(job.done.head["TIME"])
    assert percent[0] == 0
    assert percent == [int(100 * x / total) for x in elapsed]
    np.testing.assert_allclose(minutes, [(total - x) / 60 for x in elapsed], atol=0.51)
    # The file without these lines is the file as it was.
    bare = "\n".join(x for x in job.text.split("\n") if not x.startswith(("M73", ";TIME_EL")))
    assert bare == small_part("marlin_two_tools").text


def with_spools(job, **spools):
    machine = updated(job.machine, {"spools": spools})
    return {use.what: use for use in spool_uses(part_moves(job.plan, machine), machine)}


def test_spools_are_changed_between_layers_and_never_in_a_strand(small_part):
    job = small_part("marlin_two_tools")
    run = job.done
    fed = 1e-3 * sum(step.fed for step in run.steps if step.tool == 1)
    use = with_spools(job, fibre=50.0)["fibre"]
    assert (use.count, use.changes) == (1, ())
    assert use.length == pytest.approx(fed, abs=1e-5)
    assert use.left == pytest.approx(50.0 - fed, abs=1e-5)
    # Two layers of fibre of about half each: what is left does not do for the second.
    layers = np.unique(job.plan.paths.layer[job.plan.paths.kind == 0]).tolist()
    use = with_spools(job, fibre=50.0, fibre_left=0.75 * fed)["fibre"]
    assert (use.count, use.changes) == (2, ((layers[1], 0),))
    assert f"needs 2 spools, change before layer {layers[1]}; " in use.words
    # Spools of half a layer are changed between strands.
    use = with_spools(job, fibre=0.3 * fed)["fibre"]
    assert use.count > 3
    assert all(piece > 0 or layer in layers for layer, piece in use.changes)
    assert "more than the" in with_spools(job, fibre=0.05)["fibre"].words
    assert "matrix" not in with_spools(job, fibre=50.0)


def test_matrix_beside_the_fibre_has_a_spool_of_its_own(small_part):
    job = small_part("aura_like")
    uses = with_spools(job, fibre=50.0, matrix=100.0, coextruded=100.0)
    steps = job.done.steps
    fed = {
        "fibre": sum(s.fed for s in steps if s.tool == 1),
        "matrix": sum(s.fed for s in steps if s.tool == 0),
        "coextruded": sum(s.beside for s in steps),
    }
    for what, use in uses.items():
        assert use.length == pytest.approx(1e-3 * fed[what], abs=1e-4)


def test_costs_are_of_kilograms_metres_and_hours(small_part):
    job = small_part("marlin_two_tools")
    moves = part_moves(job.plan, job.machine)
    assert print_totals(moves, job.machine).words == ()
    prices = {"matrix": 30.0, "fibre": 2.0, "hour": 12.0, "currency": "EUR"}
    totals = print_totals(moves, updated(job.machine, {"costs": prices}))
    head = job.done.head
    matrix, _ = (float(x) for x in head["filament used [g]"].split(","))
    _, fibre = (float(x) for x in head["filament used [mm]"].split(","))
    assert totals.cost["matrix"] == pytest.approx(30.0 * matrix / 1000.0, abs=1e-4)
    assert totals.cost["fibre"] == pytest.approx(2.0 * fibre / 1000.0, abs=1e-4)
    assert totals.cost["machine"] == pytest.approx(12.0 * float(head["TIME"]) / 3600.0, abs=2e-3)
    assert totals.words[-1].startswith(f"cost: {sum(totals.cost.values()):.2f} EUR (matrix ")
    alone = print_totals(moves, updated(job.machine, {"costs": {"fibre": 2.0}}))
    assert set(alone.cost) == {"fibre"}
