"""Arcs in a file, against the file of straight moves, by a printer on paper that follows both."""

from functools import cache

import numpy as np
import pytest
import shapely

from benchmarks.print_checks.all_checks import CHECKS
from benchmarks.print_checks.job import Lines
from benchmarks.print_checks.printer import follow
from ccfem.body.meshing import extrude
from ccfem.machine import Machine, machine_names, machine_table, updated
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.gcode import gcode
from ccfem.printing.moves import LAY, Moves, role, with_arcs
from ccfem.printing.part_moves import part_moves
from ccfem.printing.print_plan import plan_print
from ccfem.slicing.slicers.planar import Planar

ARCS = {"gcode": {"arcs": True}}
TOLERANCE = 0.02
KNOWN = [name for name in machine_names() if name != "aura_like"]
"""Aura's printer has no codes for arcs."""


def ring(radius, count=200):
    turn = np.linspace(0.0, 2.0 * np.pi, count + 1)
    line = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    line[-1] = line[0]
    return line


@cache
def washer():
    """Mesh, layers and paths of a washer with rings of fibre."""
    round_part = shapely.Point(0, 0).buffer(22.0, quad_segs=48) - shapely.Point(0, 0).buffer(9.0)
    mesh = extrude(round_part, 2.0, 3.0)
    layers = Planar(heights=(1.0,)).cut(mesh)
    return mesh, layers, Toolpaths.from_plane([ring(r) for r in (12.0, 18.0)], layers[0])


@pytest.fixture(scope="module", params=KNOWN)
def both(request):
    """Files of the washer without arcs and with them, and what the printer did."""
    mesh, layers, paths = washer()
    files = []
    for values in ({}, ARCS):
        machine = updated(Machine(), machine_table(request.param), values)
        text = gcode(plan_print(paths, layers, mesh, machine), machine)
        files.append((text, follow(text, request.param), machine))
    return files


def test_arcs_lay_the_same_on_the_same_way(both):
    (bare, straight, _), (text, round_, machine) = both
    assert straight.arcs == 0
    assert "\nG2 " not in bare
    assert round_.arcs > 30
    assert round_.wrong == []
    assert len(text) < 0.75 * len(bare)
    bare_lines, arc_lines = Lines.of(straight), Lines.of(round_)
    for tool in (0, 1):
        for values in ("length", "fed"):
            sums = [
                getattr(of, values)[of.lays & (of.tool == tool)].sum()
                for of in (bare_lines, arc_lines)
            ]
            assert sums[1] == pytest.approx(sums[0], rel=1e-3)
    # Lines between the same ways through the air, one by one, either way.
    drawn = [list(of_steps(run)) for run in (straight, round_)]
    assert len(drawn[0]) == len(drawn[1]) > 20
    for first, second in zip(*drawn, strict=True):
        assert max(farthest(first, second), farthest(second, first)) <= TOLERANCE + 2e-3
        assert second.length == pytest.approx(first.length, rel=1e-3)
    assert len(straight.cuts) == len(round_.cuts)
    tails = [sum(step.length for step in steps if step.cut) for steps in round_.strands().values()]
    np.testing.assert_allclose(tails, machine.tail, rtol=1e-3, atol=2e-2)
    assert float(round_.head["TIME"]) == pytest.approx(float(straight.head["TIME"]), rel=1e-2)
    said = [float(x) for x in round_.head["filament used [mm]"].split(",")]
    for tool in (0, 1):
        fed = sum(step.fed for step in round_.steps if step.tool == tool)
        assert said[tool] == pytest.approx(fed, abs=0.02)


def farthest(line, other):
    """Largest distance of points and middles of a line from another one."""
    points = shapely.get_coordinates(line)
    points = np.concatenate([points, 0.5 * (points[1:] + points[:-1])])
    return shapely.distance(shapely.points(points), other).max()


def of_steps(run):
    """Lines that are laid without a break."""
    points = []
    for step in run.steps:
        if step.lays:
            points = points or [step.start[:2]]
            points.append(step.end[:2])
        elif step.rapid and points:
            yield shapely.LineString(points)
            points = []


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
@pytest.mark.parametrize("name", ["marlin_two_tools", "klipper"])
def test_a_part_with_arcs_prints(small_part, check, name):
    job = printed(small_part, name)
    assert check(job, job.done) == []


@cache
def printed(small_part, name):
    return small_part(name, ARCS)


def moves_of(points, speeds=None, feed=0.05, heights=None):
    """Moves that lay a line (n, 2) at a height of 1 mm."""
    count = len(points)
    place = np.column_stack([points, np.ones(count)]).round(3)
    steps = np.append(0.0, np.linalg.norm(np.diff(place, axis=0), axis=1))
    zero, whole = np.zeros(count), np.zeros(count, dtype=int)
    return Moves(
        event=np.append(0, np.full(count - 1, LAY)),
        place=place,
        normal=np.tile([0.0, 0.0, 1.0], (count, 1)),
        tool=whole,
        feed=feed * steps,
        beside=zero,
        speed=np.full(count, 10.0) if speeds is None else np.append(10.0, speeds),
        width=np.full(count, 0.8),
        height=np.full(count, 0.2) if heights is None else np.append(0.2, heights),
        amount=zero,
        role=np.full(count, role("contour")),
        layer=whole,
        strand=whole - 1,
    )


MACHINE = updated(Machine(), ARCS)


def test_a_circle_is_one_arc_with_its_centre():
    """Of a circle of 30 mm all but what would close it, at 0.001 mm from where it is."""
    for backwards in (1, -1):
        moves = with_arcs(moves_of(np.array([3.0, -5.0]) + ring(30.0, 360)[::backwards]), MACHINE)
        arcs = moves.arcs
        assert len(arcs.first) <= 2
        np.testing.assert_allclose(arcs.centre[0], [3.0, -5.0], atol=2e-3)
        assert abs(np.degrees(arcs.sweep[0])) > 345.0
        assert np.sign(arcs.sweep[0]) == backwards
        rows = slice(arcs.first[0], arcs.last[0] + 1)
        length = 30.0 * abs(arcs.sweep[0])
        assert moves.feed[rows].sum() == pytest.approx(0.05 * length, rel=1e-4)


def test_what_is_not_round_stays_straight():
    square = np.array([[0, 0], [10, 0], [10, 10], [0, 10], [0, 0.0]])
    coarse = ring(10.0, 12)  # the middle of its sides is 0.34 mm off
    for line in (square, coarse, np.array([[0, 0], [1, 0], [2, 0.0]])):
        assert with_arcs(moves_of(line), MACHINE).arcs is None


def test_a_compact_file_goes_straight_where_that_is_near_enough():
    """Waves of 0.009 mm are one line to 0.02, not in a plain file; those of 0.1 mm are none."""
    x = np.linspace(0.0, 40.0, 81)
    compact = updated(MACHINE, {"gcode": {"compact": True}})
    wave = np.column_stack([x, 0.009 * np.sin(x)])
    moves = with_arcs(moves_of(wave), compact)
    assert moves.arcs.sweep.tolist() == [0.0]
    assert (moves.arcs.first[0], moves.arcs.last[0]) == (1, 80)
    assert moves.feed.sum() == pytest.approx(0.05 * 40.0, rel=1e-5)
    assert (with_arcs(moves_of(wave * [1.0, 11.0]), compact).arcs.sweep != 0.0).any()
    found = with_arcs(moves_of(wave), MACHINE).arcs
    assert found is None or (found.sweep != 0.0).all()


def test_arcs_turn_with_the_line_and_end_where_it_is_laid_otherwise():
    half = ring(10.0, 120)[:61]
    wave = np.concatenate([half, [-20.0, 0.0] + np.array([1, -1]) * half[1:]])
    arcs = with_arcs(moves_of(wave), MACHINE).arcs
    assert {np.sign(sweep) for sweep in arcs.sweep} == {-1.0, 1.0}
    line, number = ring(10.0, 120), np.arange(120)
    for values in (
        {"speeds": np.where(number < 50, 10.0, 8.0)},
        {"heights": np.where(number < 50, 0.2, 0.15)},
    ):
        arcs = with_arcs(moves_of(line, **values), MACHINE).arcs
        assert not ((arcs.first - 1 < 50) & (arcs.last - 1 >= 50)).any()
        assert (np.abs(arcs.last[0] - 50) <= 1).all()
    # Speeds that differ by less than a hundredth are one, the least.
    near = np.where(number < 50, 10.0, 9.95)
    moves = with_arcs(moves_of(line, speeds=near), MACHINE)
    assert set(moves.speed[moves.arcs.first[0] : moves.arcs.last[0] + 1].tolist()) == {9.95}


def test_no_arc_feeds_more_than_the_firmware_takes():
    short = updated(MACHINE, {"gcode": {"longest_feed": 3.0}})
    moves = with_arcs(moves_of(ring(30.0, 360)), short)
    for first, last in zip(moves.arcs.first, moves.arcs.last, strict=True):
        assert moves.feed[first : last + 1].sum() <= 3.0 * 1.001
    assert len(moves.arcs.first) >= 3


def test_five_axes_go_straight():
    mesh, layers, paths = washer()
    machine = updated(MACHINE, {"kinematics": {"kind": "head_head", "pivot": 40.0}})
    plan = plan_print(paths, layers, mesh, machine)
    assert part_moves(plan, machine).arcs is None
