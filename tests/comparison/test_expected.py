"""What commands are expected to take, and the progress that is told by it."""

import math
import tomllib
from dataclasses import replace

import pytest
import shapely
import shapely.affinity

from benchmarks.speed import effort as benchmark
from ccfem.body.mesh import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison.effort import (
    COEFFICIENTS,
    Counts,
    about_effort,
    counts,
    curve_steps,
    cutting_effort,
    stage_effort,
    stages,
)
from ccfem.comparison.expected import Schedule, expected_steps, shares_before_writing
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


def test_progress_is_the_share_of_the_time_that_is_behind():
    """1 s is solved, 2 and 3 s are planned, 4 s judged: what was said before is done."""
    told = []
    steps = {"planning a": 2.0, "planning ab": 3.0, "judging a": 4.0}
    tell = Schedule(lambda what, share: told.append((what, share)), steps, 1.0)
    for what in ("planning ab to 5 mm", "planning a", "planning a to 5 mm", "judging a"):
        tell(what)
    assert [share for _, share in told] == pytest.approx([0.1, 0.4, 0.6, 0.6])
    # A curve that turns out to be needed: 2 x 2 and 5 x (2 + 4) s more.
    tell.expect(curve_steps(steps, ["a"]))
    tell("planning the least and the most of a")
    tell("planning a along the curve")
    assert [share for _, share in told[4:]] == pytest.approx([10.0 / 44.0, 14.0 / 44.0])


def test_every_length_of_a_front_is_a_plan():
    request = Request.of("bar", ["stream_function"])
    known = {"": counts(request.case, request.case.known_layers())[0]}
    one = expected_steps(request, known, 1)
    front = expected_steps(replace(request, amount=Spread(4)), known, 1)
    assert front == pytest.approx({step: 4.0 * spent for step, spent in one.items()})


def test_what_is_left_when_the_report_begins_is_the_report():
    request = Request.of("bar", ["isocurve"])
    results, report = shares_before_writing(request)
    known = counts(request.case, request.case.known_layers())[0]
    write, draw = (stage_effort(stage, known) for stage in ("write", "report"))
    assert (report - results) / (1.0 - results) == pytest.approx(write / (write + draw))
    whole = draw / (1.0 - report)
    every = cutting_effort(known) + sum(
        stage_effort(stage, known) for stage in stages(["isocurve"], False)[1:]
    )
    assert whole == pytest.approx(every)


def test_layers_that_cut_the_same_cells_count_once_in_regions_too():
    """Four of each of the two layers of cells, whatever cells a slanted border crosses."""
    mesh = box_mesh((20.0, 10.0, 7.0), (4, 2, 2))
    layers = Planar(count=70).cut(mesh)
    region = shapely.affinity.rotate(shapely.box(1.0, 1.0, 12.0, 9.0), 17.0)
    parts = [layer for layer in (cut_layer(layer, region, mesh) for layer in layers) if layer]
    for those in (layers, parts):
        known = Counts.of(mesh, those, Machine())
        assert known.some_room == pytest.approx(8 / 70 * known.room)
