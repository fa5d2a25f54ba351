"""The speed table of Wang et al. 2021: limits, paths by hand, and its place in files."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import strip_part

from ccfem.base.errors import InputError
from ccfem.base.toml import from_table
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.part_file import read_part
from ccfem.geometry.polylines import pack
from ccfem.judging.evaluation.indices.manufacture import manufacture_indices, sample_manufacture
from ccfem.judging.evaluation.layer_paths import plane_paths
from ccfem.machine import Machine, SpeedTable
from ccfem.machine.gcode_profile import GcodeProfile
from ccfem.machine.speeds import table_speeds
from ccfem.paths.linking.print_order import step_speeds
from ccfem.paths.toolpaths import MATRIX, TRAVEL, Toolpaths
from ccfem.slicing.slicers.planar import Planar

TABLE = SpeedTable()
EASY = {"curvature": 0.0, "length": 100.0, "angle": 180.0}
WIDTH = 1.0


@pytest.mark.parametrize(
    ("what", "values", "speeds"),
    [
        # Table 2: a limit belongs to the middle row, except that 135 degrees are fast.
        ("curvature", [0.0, 0.0499, 0.05, 0.2, 0.2001, np.inf], [35, 35, 15, 15, 7, 7]),
        ("length", [0.0, 14.999, 15.0, 25.0, 25.001], [7, 7, 15, 15, 35]),
        ("angle", [0.0, 89.999, 90.0, 134.999, 135.0, 180.0], [7, 7, 15, 15, 35, 35]),
    ],
)
def test_limits_of_the_published_table(what, values, speeds):
    found = TABLE.at(**{**EASY, what: np.array(values)})
    np.testing.assert_array_equal(found, speeds)


def test_the_least_of_the_three_speeds_counts():
    assert TABLE.at(0.1, 100.0, 60.0) == 7.0
    assert TABLE.at(0.1, 100.0, 180.0) == 15.0
    assert TABLE.at(0.01, 20.0, 180.0) == 15.0
    assert TABLE.at(0.3, 100.0, 180.0) == 7.0


def turned(lengths, turns):
    """Polyline of straight sides, turning by degrees between them."""
    heading = np.radians(np.cumsum([0.0, *turns]))
    sides = np.asarray(lengths)[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    return np.concatenate([[[0.0, 0.0]], np.cumsum(sides, axis=0)])


def arc(start, heading, radius, angle, steps):
    """Points after `start` on a circle that leaves it along `heading` to the left, degrees."""
    turn = np.radians(np.linspace(0.0, angle, steps + 1)[1:])
    local = radius * np.stack([np.sin(turn), 1.0 - np.cos(turn)], axis=1)
    c, s = np.cos(np.radians(heading)), np.sin(np.radians(heading))
    return start + local @ np.array([[c, s], [-s, c]])


def speeds_of(*lines, table=TABLE):
    points, offsets = pack(lines)
    found = table_speeds(points, offsets, table, WIDTH)
    return [found[a : b - 1] for a, b in pairwise(offsets)]


@pytest.mark.parametrize(
    ("lengths", "turns", "expected"),
    [
        # Alone: by length only.
        ([14.0], [], [7]),
        ([25.0], [], [15]),
        ([25.5], [], [35]),
        # A right angle slows both of its sides to 15, one of 60 degrees to 7.
        ([30.0, 40.0, 30.0], [90.0, 90.0], [15, 15, 15]),
        ([30.0, 40.0, 30.0], [90.0, -120.0], [15, 7, 7]),
        # An angle of 135 degrees is no corner: 12 mm and 12 mm are one piece of 24 mm.
        ([12.0, 12.0], [45.0], [15, 15]),
        # One of 134 degrees is: two pieces of 12 mm.
        ([12.0, 12.0], [46.0], [7, 7]),
        # A corner slows all of the piece that it ends, and only that.
        ([30.0, 30.0, 30.0, 30.0], [0.0, 30.0, 80.0], [15, 15, 15, 15]),
        ([30.0, 30.0, 30.0, 30.0], [50.0, 30.0, 50.0], [15, 15, 15, 15]),
        ([30.0, 30.0, 30.0, 30.0], [120.0, 50.0, 50.0], [7, 7, 15, 15]),
    ],
)
def test_straight_sides(lengths, turns, expected):
    (found,) = speeds_of(turned(lengths, turns))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("steps", [24, 60, 240])
@pytest.mark.parametrize(("radius", "speed"), [(30.0, 35.0), (10.0, 15.0), (4.0, 7.0)])
def test_arcs_go_by_their_radius_however_densely_sampled(radius, speed, steps):
    # Three quarters of a circle is 141, 47 and 19 mm long.
    line = np.concatenate([[[0.0, 0.0]], arc(np.zeros(2), 0.0, radius, 270.0, steps)])
    (found,) = speeds_of(line)
    np.testing.assert_array_equal(found, speed)


def test_a_path_worked_out_by_hand():
    # 40 mm straight, a half circle of radius 8 (0.125 1/mm, 25.1 mm), 20 mm straight, a corner of
    # 60 degrees, 50 mm straight.
    line = np.array([[0.0, 0.0], [40.0, 0.0]])
    line = np.concatenate([line, arc(line[-1], 0.0, 8.0, 180.0, 30)])
    line = np.concatenate([line, [line[-1] + [-20.0, 0.0]]])
    heading = np.radians(180.0 + 120.0)
    line = np.concatenate([line, [line[-1] + 50.0 * np.array([np.cos(heading), np.sin(heading)])]])
    (found,) = speeds_of(line)
    np.testing.assert_array_equal(found, [35.0, *[15.0] * 30, 7.0, 7.0])
    seconds = (np.linalg.norm(np.diff(line, axis=0), axis=1) / found).sum()
    assert seconds == pytest.approx(40.0 / 35.0 + np.pi * 8.0 / 15.0 + 70.0 / 7.0, rel=1e-3)


def test_points_a_hair_apart_do_not_make_a_line_bent():
    # The points of isocurves lie where they cross mesh edges: two of them may nearly coincide.
    before, after = np.arange(0.0, 31.0, 2.0), np.arange(32.0, 61.0, 2.0)
    first, second = (np.column_stack([x, np.zeros(len(x))]) for x in (before, after))
    line = np.concatenate([first, [[30.001, 0.0005]], np.add(second, [0.0, 0.0005])])
    for way in (line, line[::-1]):
        np.testing.assert_array_equal(speeds_of(way)[0], 35.0)


def test_corners_of_a_meshed_circle_are_no_turns():
    # A circle of radius 30 in chords of 2.4 mm, as a mesh has it, with points anywhere on them.
    rng = np.random.default_rng(1)
    (layer,) = Planar(count=1).cut(box_mesh((90.0, 90.0, 1.0), (1, 1, 1)))
    turn = np.linspace(0.0, 2.0 * np.pi, 79)
    corners = 45.0 + 30.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    share = rng.random((78, 2, 1))
    share.sort(axis=1)
    between = (1.0 - share) * corners[:-1, None] + share * corners[1:, None]
    line = np.concatenate([corners[:-1, None], between], axis=1).reshape(-1, 2)
    path = Toolpaths.from_plane([np.concatenate([line, line[:1]])], layer)
    np.testing.assert_array_equal(step_speeds(path, Machine(speeds=TABLE))[:-1], 35.0)


def test_repeated_points_and_paths_without_length_change_nothing():
    line = turned([30.0, 40.0, 30.0], [90.0, -120.0])
    again = np.repeat(line, [1, 3, 2, 2], axis=0)
    point = np.zeros((2, 2))
    first, found, other = speeds_of(point, again, line)
    moves = np.diff(again, axis=0).any(axis=1)
    np.testing.assert_array_equal(found[moves], [15, 7, 7])
    np.testing.assert_array_equal(other, [15, 7, 7])
    assert (first > 0.0).all()
    (alone,) = speeds_of(point)
    assert (alone > 0.0).all()
    assert table_speeds(np.zeros((0, 2)), np.zeros(1, dtype=np.int64), TABLE, WIDTH).shape == (0,)


def test_the_table_is_for_fibre_and_the_print_time_goes_by_it():
    (layer,) = Planar(count=1).cut(box_mesh((90.0, 90.0, 1.0), (1, 1, 1)))
    fibre = Toolpaths.from_plane([turned([30.0, 40.0, 20.0], [90.0, 90.0])], layer)
    matrix = replace(Toolpaths.from_plane([turned([30.0], [])], layer), kind=[MATRIX])
    travel = replace(Toolpaths.from_plane([turned([8.0], [])], layer), kind=[TRAVEL])
    every = Toolpaths.concatenate([fibre, travel, matrix])
    machine = Machine(speeds=TABLE, fibre_speed=1.0)
    steps = [15.0, 15.0, 15.0, None, 80.0, None, 12.0, None]
    for value, expected in zip(step_speeds(every, machine), steps, strict=True):
        assert expected is None or value == expected
    samples = sample_manufacture(plane_paths(every, layer), every, machine)
    values = manufacture_indices(samples, machine)
    assert values["print_time"] == pytest.approx(90.0 / 15.0 + 8.0 / 80.0 + 30.0 / 12.0)
    assert values["mean_speed"] == pytest.approx(15.0)
    samples = sample_manufacture(plane_paths(every, layer), every, Machine())
    assert manufacture_indices(samples, Machine())["mean_speed"] == 5.0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"speed": (7.0, 35.0, 15.0)}, "3 rising numbers above 0 as speed; got .*: sort them"),
        ({"speed": (0.0, 15.0, 35.0)}, "3 rising numbers above 0 as speed"),
        ({"curvature": (0.05, 0.2)}, "2 falling numbers >= 0 as curvature"),
        ({"length": (15.0, np.nan)}, "2 rising numbers >= 0 as length"),
        ({"angle": (90.0, 181.0)}, "2 rising numbers from 0 to 180 as angle"),
    ],
)
def test_tables_that_make_no_sense(given, message):
    with pytest.raises(InputError, match=message):
        SpeedTable(**given)


PART = f"{strip_part.PART}[machine]\ncutter_distance = 30.0\n"


def test_a_part_file_sets_the_table(tmp_path):
    part = tmp_path / "part.toml"
    part.write_text(PART)
    assert read_part(part).machine == Machine(cutter_distance=30.0)
    part.write_text(PART + "[machine.speeds]\n")
    assert read_part(part).machine == Machine(cutter_distance=30.0, speeds=SpeedTable())
    part.write_text(PART + "[machine.speeds]\nspeed = [5, 10, 20]\nangle = [80, 120]\n")
    table = SpeedTable(speed=(5.0, 10.0, 20.0), angle=(80.0, 120.0))
    assert read_part(part).machine.speeds == table


def test_the_cutter_allows_the_shortest_strand():
    assert Machine().tail == Machine(minimum_length=50.0).tail == 42.0
    assert Machine(minimum_length=20.0).tail == 20.0
    assert Machine(minimum_length=20.0, cutter_distance=15.0).tail == 15.0


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"speeds": 3}, r"machine\.speeds must be a table; got 3"),
        ({"speeds": {"speed": [1, 2]}}, r"machine\.speeds\.speed must be a list of 3, each a num"),
        ({"speeds": {"radius": 1}}, r"machine\.speeds has no key 'radius'; it has: speed, curv"),
        ({"speeds": {"speed": [3, 2, 1]}}, r"machine\.speeds: the speed table needs 3 rising"),
        ({"cut_wait": -1.0}, r"machine\.cut_wait must be from 0 to 600 s; got -1"),
        ({"matrix_diameter": 0}, r"machine\.matrix_diameter must be from 0\.1 to 20 mm; got 0"),
        (
            {"gcode": {"lift": -1}},
            r"machine\.gcode: gcode_profile\.lift must be 0 or from 0\.01 to 1000 mm; got -1",
        ),
    ],
)
def test_machines_that_make_no_sense(table, message):
    with pytest.raises(InputError, match=message):
        from_table(Machine, table, "machine")


def test_a_direction_of_the_matrix_is_a_number():
    with pytest.raises(InputError, match="matrix_angle must be a finite number of degrees"):
        GcodeProfile(matrix_angle=np.nan)


def test_tables_of_tables_are_left_to_their_reader():
    def make(given: dict[str, SpeedTable]) -> dict[str, SpeedTable]:
        return given

    assert from_table(make, {"given": {"one": {}}}, "it") == {"one": {}}
