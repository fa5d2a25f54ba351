"""What commands are expected to take, and the progress that is told by it."""

import math
import time
import tomllib
from dataclasses import replace

import pytest
import shapely
import shapely.affinity

from benchmarks.speed import effort as benchmark
from ccfem.base.errors import InputError
from ccfem.base.progress import silent
from ccfem.body.mesh import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison.effort import (
    COEFFICIENTS,
    Counts,
    about_effort,
    counts,
    curve_steps,
    stage_effort,
    stages,
)
from ccfem.comparison.engine import answer
from ccfem.comparison.expected import (
    WRITING,
    Schedule,
    expected_steps,
    steps_before_solving,
)
from ccfem.comparison.request import Request, Spread
from ccfem.fem.elasticity import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine
from ccfem.paths.placement.fibre_places import cut_layer
from ccfem.slicing.slicers import Planar


def test_a_box_is_counted():
    mesh = box_mesh((40.0, 20.0, 10.0), (8, 4, 2))
    loads = {"pull": (Force("x_max", (1.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("x_min"),), loads)
    layers = Planar(count=3).cut(mesh)
    machine = Machine(fibre_width=0.8)
    linear, quadratic = counts(Case("box", "A box", problem, machine=machine), layers)
    assert (linear.unknowns, linear.solved) == (3 * 9 * 5 * 3, 3 * 9 * 5 * 3)
    assert quadratic.solved == 3 * len(mesh.quadratic().points)
    assert linear.room == pytest.approx(3 * 40.0 * 20.0 / 0.8)
    assert linear.volume == pytest.approx(8000.0)
    assert Counts.of(mesh.quadratic(), layers, machine) == quadratic


@pytest.mark.parametrize(
    ("sides", "times"), [((40.0, 20.0, 10.0), 0.0), ((100.0, 50.0, 25.0), 2.0)]
)
def test_a_part_beyond_those_that_were_measured_is_told_by_extrapolation(sides, times):
    """The largest that was compared has 62.6 cm^3 by the lines of the benchmark."""
    mesh = box_mesh(sides, (8, 4, 2))
    loads = {"pull": (Force("x_max", (1.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("x_min"),), loads, order=1)
    rows = [row for row in benchmark.lines() if row["command"] == "compare"]
    largest = max(float(row["volume"]) for row in rows)
    assert math.prod(sides) / largest == pytest.approx(times, abs=0.2)
    lines = about_effort(Case("box", "A box", problem), Planar(count=3).cut(mesh))
    said = [line for line in lines if line.startswith("extrapolated beyond the largest part")]
    assert len(said) == (times > 1.0)
    assert all(f"compare, {math.prod(sides) / largest:.3g} times" in line for line in said)


def test_coefficients_are_those_of_the_measurement():
    """And tell what was measured at least as well as fits without each part did."""
    rows, written = benchmark.lines(), tomllib.loads(COEFFICIENTS.read_text())
    samples = benchmark.samples_of(rows)
    for stage, found in benchmark.fitted(samples).items():
        assert written[stage] == pytest.approx(found, rel=1e-2, abs=1e-12)
    for command, (near, of, _) in written["within"].items():
        own = [row for row in rows if row["command"] == command]
        off = []
        for row in own:
            steps = stages(benchmark.PLANNED[command], command != "compare", command != "untested")
            told = sum(stage_effort(step, benchmark.known_of(row)) for step in steps)
            off.append(abs(math.log(told / sum(benchmark.seconds_of(row).values()))))
        assert len(own) == of
        assert sum(one <= math.log(1.5) for one in off) >= near


@pytest.fixture
def clock(monkeypatch):
    """Seconds that the clock shows, as the only item of a list."""
    now = [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    return now


def test_the_share_that_is_told_gives_the_time_that_is_left(clock):
    """Steps of 1, 2, 3 and 4 s take as long as expected: each line tells what is then left."""
    left = []
    steps = {"solving": 1.0, "planning a": 2.0, "planning ab": 3.0, "judging a": 4.0}
    tell = Schedule(lambda _, share: left.append(clock[0] * (1.0 / share - 1.0)), steps=steps)
    tell.progress, show = lambda _, share: None, tell.progress
    tell("solving a part")
    tell.progress = show
    # A step that is said again goes on.
    for now, what in ((1.0, "planning a"), (2.5, "planning a to 5 mm"), (3.0, "planning ab")):
        clock[0] = now
        tell(what)
    clock[0] = 6.0
    tell("judging a")
    assert left == pytest.approx([9.0, 7.5, 7.0, 4.0])
    # A curve that turns out to be needed: 2 x 2 and 5 x (2 + 4) s more.
    clock[0] = 10.0
    tell.expect(curve_steps(steps, ["a"]))
    tell("planning the least and the most of a")
    clock[0] = 14.0
    tell("planning a along the curve")
    assert left[4:] == pytest.approx([34.0, 30.0])


def test_the_time_left_follows_the_pace_of_what_is_done(clock):
    """All takes three times as long: once much of it is done, so much is told, up to the prior."""
    left = []
    steps = {f"planning {k}": 100.0 for k in range(20)}
    tell = Schedule(silent, steps=steps)
    for what in steps:
        tell(what)
        left.append(tell.left())
        clock[0] += 300.0
    true = [300.0 * (20 - k) for k in range(20)]
    assert left[0] == pytest.approx(true[0] / 3.0)
    ratios = [told / right for told, right in zip(left, true, strict=True)]
    assert ratios == sorted(ratios)
    assert 0.98 < ratios[-1] < 1.0


def test_one_short_step_that_is_badly_expected_changes_little(clock):
    """A step of 5 ms takes 10 times as long, and one of 100 s as long as expected: 100 s left."""
    tell = Schedule(silent, steps={"solving": 0.005, "planning a": 100.0, "planning b": 100.0})
    for now, what in ((0.0, "solving"), (0.05, "planning a"), (100.05, "planning b")):
        clock[0] = now
        tell(what)
    assert tell.left() == pytest.approx(100.0, rel=0.01)


def test_what_is_done_beside_ends_before_the_writing(clock):
    """6 s are judged and bounded beside 2 s of planning and 1 s of judging: 6 s, and 3 of files."""
    steps = {"planning b": 2.0, "judging a": 4.0, "judging b": 1.0, "bounding": 2.0}
    tell = Schedule(silent, steps=steps | dict.fromkeys(WRITING, 1.5))
    tell.beside(["judging a", "bounding"])
    tell("planning b")
    assert tell.left() == pytest.approx(9.0)


def test_every_length_of_a_front_is_a_plan():
    """Designs share half of their time."""
    request = Request.of("bar", ["stream_function", "zigzag"])
    known = {"": counts(request.case, request.case.known_layers())[0]}
    one = expected_steps(request, known, 1)
    front = expected_steps(replace(request, amount=Spread(4)), known, 1)
    times = dict.fromkeys(one, 4.0) | {"solving": 1.0, "planning stream_function": 2.0}
    assert front == pytest.approx({step: times[step] * spent for step, spent in one.items()})


@pytest.mark.parametrize(("seconds", "words"), [(30.0, ""), (90.0, " (about 90 s in all)")])
def test_a_long_run_says_what_it_will_take_before_it_is_solved(clock, seconds, words):
    """The program started in the 2 s that are expected, so that the pace is as expected too."""
    lines = []
    steps = {"start": 2.0, "solving": 10.0, "planning a": seconds - 10.0}
    tell = Schedule(lambda what, _: lines.append(what), steps=steps, passed={"start": 2.0})
    tell("solving a part")
    tell("planning a")
    assert lines == [f"solving a part{words}", "planning a"]


def test_layers_that_a_strand_does_not_fit_are_refused_before_they_are_cut(monkeypatch):
    monkeypatch.setattr(Planar, "cut", lambda *_: pytest.fail("cut"))
    with pytest.raises(InputError, match="layers must lie at least"):
        answer(Request.of("loop", ["isocurve"], 5000), Schedule(silent, command=True))


def test_a_command_is_expected_to_take_the_time_of_its_stages():
    request = Request.of("bar", ["isocurve"])
    known = counts(request.case, request.case.known_layers())[0]
    every = sum(stage_effort(stage, known) for stage in stages(["isocurve"], False))
    assert sum(steps_before_solving(request, True).values()) == pytest.approx(every)
    within = every - sum(stage_effort(stage, known) for stage in ("start", "write", "report"))
    assert sum(steps_before_solving(request, False).values()) == pytest.approx(within)


def test_a_replay_of_what_was_measured_tells_the_time_left():
    """By the fit to all; the benchmark tells it by fits to the other parts."""
    rows = benchmark.lines()
    coefficients = tomllib.loads(COEFFICIENTS.read_text())
    factors = [
        max(left / true, true / left)
        for row in rows
        for _, left, true in benchmark.replay(row, coefficients)
    ]
    assert len(factors) > 100
    assert sum(factor <= 1.5 for factor in factors) > 0.9 * len(factors)


def test_layers_that_cut_the_same_cells_count_once_in_regions_too():
    """Four of each of the two layers of cells, whatever cells a slanted border crosses."""
    mesh = box_mesh((20.0, 10.0, 7.0), (4, 2, 2))
    layers = Planar(count=70).cut(mesh)
    region = shapely.affinity.rotate(shapely.box(1.0, 1.0, 12.0, 9.0), 17.0)
    parts = [layer for layer in (cut_layer(layer, region, mesh) for layer in layers) if layer]
    for those in (layers, parts):
        known = Counts.of(mesh, those, Machine())
        assert known.some_room == pytest.approx(8 / 70 * known.room)
