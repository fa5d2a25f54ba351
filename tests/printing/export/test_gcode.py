"""G-code of a whole part, followed by a reader that shares nothing with the writer."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.base.toml import from_table
from ccfem.body.mesh.box import box_mesh
from ccfem.body.meshing import extrude
from ccfem.judging.evaluation.indices.manufacture import manufacture_indices, sample_manufacture
from ccfem.judging.evaluation.layer_paths import plane_paths
from ccfem.machine import Machine, Process, SpeedTable
from ccfem.machine.gcode_profile import GcodeProfile
from ccfem.paths.toolpaths import MATRIX, Toolpaths
from ccfem.printing.export.gcode import gcode, write_gcode
from ccfem.printing.laid_layer import Below, with_flow
from ccfem.printing.print_plan import check_machine, plan_print
from ccfem.slicing.slicers.planar import Planar

# Nothing but lines, feeds and cuts: what the process adds has tests of its own.
PLAIN = Process(
    restart_extra=0.0,
    start_length=0.0,
    ramp_length=0.0,
    corner_angle=180.0,
    finish_speed=1e3,
    strand_lift=0.0,
    tool_lift=0.0,
    tool_retract=0.0,
    short="error",
    cover=0.0,
    prime="none",
    skirt_loops=0,
    first_layer_height=0.0,
    first_layer_speed=1.0,
    warm_height=0.0,
    acceleration=1e6,
)
MACHINE = Machine(
    speeds=SpeedTable(),
    matrix_height=0.7,
    fibre_height=0.1,
    filament_area=0.1,
    matrix_heating=1e4,
    fibre_heating=1e4,
    process=PLAIN,
)
TAIL = 42.0
HOLE = 8.0
# A plate of 90 x 50 x 4 mm with a hole; its lower corner lies at (-20, 10, 3).
CORNER, SIZE = np.array([-20.0, 10.0, 3.0]), np.array([90.0, 50.0, 4.0])
AREA = 90.0 * 50.0 - np.pi * HOLE**2
TO_BED = np.array([150.0, 150.0]) - (CORNER + 0.5 * SIZE)[:2]


def ring(radius, count=120):
    turn = np.linspace(0.0, 2.0 * np.pi, count)
    line = np.array([25.0, 35.0]) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    line[-1] = line[0]
    return line


LINES = [
    # One path on each side of the hole, a ring round it, and a short way between two of them.
    [
        ring(11.0),
        # A short side at either end.
        np.array([[-18, 18], [-18, 12], [60, 12], [60, 55], [30, 55], [30, 49]], dtype=float),
    ],
    [ring(14.0)],
    [
        np.array([[-18.0, 58.0], [65.0, 58.0]]),
        np.array([[-18.0, 14.0], [28.0, 14.0], [28.0, 20.0]]),
        np.array([[-18.0, 12.0], [65.0, 12.0]]),
    ],
]


@pytest.fixture(scope="module")
def plate():
    """Mesh of the plate, its layers, and paths on them."""
    outline = shapely.box(*CORNER[:2], *(CORNER + SIZE)[:2])
    mesh = extrude(outline.difference(shapely.Point(25.0, 35.0).buffer(HOLE, 64)), 4.0, 6.0)
    mesh = replace(mesh, points=mesh.points + CORNER * [0.0, 0.0, 1.0])
    layers = Planar(count=3).cut(mesh)
    parts = [Toolpaths.from_plane(lines, k) for lines, k in zip(LINES, layers, strict=True)]
    return mesh, layers, Toolpaths.concatenate(parts)


@pytest.fixture(scope="module")
def printed(plate, follow):
    mesh, layers, paths = plate
    plan = plan_print(paths, layers, mesh, MACHINE)
    text = gcode(plan, MACHINE)
    return plan, text, follow(text)


def match(lines, run):
    """Strand of the file for each given line (n, 2), by where it runs."""
    strands = run.lines(1)
    shapes = [shapely.LineString(strand.points[:, :2]) for strand in strands]
    found = []
    for line in lines:
        wanted = shapely.LineString(line)
        off = [wanted.hausdorff_distance(shape) for shape in shapes]
        assert min(off) < 1.5e-3
        found.append(strands[int(np.argmin(off))])
    assert len({id(strand) for strand in found}) == len(strands)
    return found


def test_fibre_lies_where_it_was_planned(printed, plate):
    *_, run = printed
    lines = [line + TO_BED for lines in LINES for line in lines]
    lengths = plate[2].lengths
    # Layers are slabs of 4/3 mm; the nozzle is at the top of 0.1 mm of fibre round their middle.
    heights = np.repeat([2.0 / 3.0, 2.0, 10.0 / 3.0], [2, 1, 3]) + 0.05
    for line, length, height, strand in zip(
        lines, lengths, heights, match(lines, run), strict=True
    ):
        assert strand.length == pytest.approx(length, abs=2e-3 * len(line))
        np.testing.assert_allclose(strand.points[:, 2], height, atol=1e-3)
        ends = strand.points[[0, -1], :2]
        wanted = line[[0, -1]]
        assert min(np.abs(ends - wanted).max(), np.abs(ends[::-1] - wanted).max()) < 1e-3
        # Every planned point is passed.
        for point in line:
            assert np.abs(strand.points[:, :2] - point).max(axis=1).min() < 1e-3


def test_every_path_is_fed_its_length_and_cut_before_its_end(printed, plate):
    *_, run = printed
    assert run.events.count("cut") == len(plate[2]) == 6
    assert run.waited == 6 * MACHINE.cut_wait
    for strand in run.lines(1):
        (cut,) = strand.cuts
        laid = sum(move.length for move in strand.moves[:cut])
        assert strand.length - laid == pytest.approx(TAIL, abs=2e-3)
        assert strand.fed_before == pytest.approx(TAIL, abs=2e-3)
        assert strand.fed_before + strand.fed == pytest.approx(strand.length, abs=1e-4)
        assert strand.fed == pytest.approx(strand.length - TAIL, abs=2e-3)
        for number, move in enumerate(strand.moves):
            assert (move.fed > 0.0) == (number < cut)
    fed = sum(move.fed for move in run.moves if move.tool == 1)
    assert fed == pytest.approx(plate[2].lengths.sum(), abs=0.02)


def test_matrix_fills_the_section_at_the_middle_of_its_layer():
    """Of a pyramid, whose sides lean in by half a millimetre for each of height."""
    box = box_mesh((80.0, 60.0, 6.0), (16, 12, 6))
    lean = 1.0 - box.points[:, 2:] / [80.0, 60.0]
    plane = [40.0, 30.0] + (box.points[:, :2] - [40.0, 30.0]) * lean
    mesh = replace(box, points=np.column_stack([plane, box.points[:, 2]]))
    layers = Planar(count=1).cut(mesh)
    line = np.array([[10.0, 30.0], [70.0, 30.0]])
    machine = replace(MACHINE, matrix_height=1.45)  # lines are no higher than wide: 0.8
    plan = plan_print(Toolpaths.from_plane([line], layers[0]), layers, mesh, machine)
    matrix = plan.paths.of_kind(MATRIX)
    middles = (plan.top - 0.5 * plan.thickness)[np.unique(matrix.layer)]
    assert len(middles) == 9
    for number, middle in zip(np.unique(matrix.layer), middles, strict=True):
        size = np.ptp(matrix.on_layer(number).points[:, :2], axis=0)
        wanted = np.array([80.0, 60.0]) - middle - machine.matrix_width
        np.testing.assert_allclose(size, wanted, atol=2e-3)


def test_travel_feeds_nothing_and_does_not_drag(printed):
    *_, run = printed
    level = 0.0
    for move in run.moves:
        plane = np.linalg.norm((move.end - move.start)[:2])
        if move.rapid:
            assert move.fed == 0.0
            # Up or down, or across at the lifted height.
            assert plane == 0.0 or move.start[2] == move.end[2]
            if plane > 0.0 and level > 0.0:
                assert move.end[2] >= level + MACHINE.gcode.lift - 1e-9
        else:
            assert move.start[2] == move.end[2]
            assert move.end[2] >= level
            level = move.end[2]


def test_everything_is_laid_inside_the_part(printed):
    *_, run = printed
    laid = np.concatenate([line.points for tool in (0, 1) for line in run.lines(tool)])
    lower = np.array([150.0, 150.0, 0.0]) - [45.0, 25.0, 0.0]
    assert (laid >= lower).all()
    assert (laid <= lower + SIZE + 1e-9).all()
    every = np.array([move.end for move in run.moves])
    assert (every >= 0.0).all()
    assert (every <= 300.0).all()


def test_layers_fill_the_height_with_the_right_tool(printed):
    *_, run = printed
    found = {}
    for tool in (0, 1):
        for line in run.lines(tool):
            assert np.ptp(line.points[:, 2]) == 0.0
            found.setdefault(line.points[0, 2], set()).add(tool)
    # Gaps of 0.617, 1.233, 1.233 and 0.617 mm, in layers of at most 0.7 mm.
    edges = np.array([0.0, 2.0 / 3.0 - 0.05, 2.0 / 3.0 + 0.05, 1.95, 2.05, 3.2833, 3.3833, 4.0])
    tops = [edges[1], edges[2], 0.5 * (edges[2] + edges[3]), edges[3], edges[4]]
    tops += [0.5 * (edges[4] + edges[5]), *edges[5:]]
    tools = [0, 1, 0, 0, 1, 0, 0, 1, 0]
    np.testing.assert_allclose(sorted(found), tops, atol=1e-3)
    assert [found[top] for top in sorted(found)] == [{tool} for tool in tools]
    # From the bottom to the top, and one change of the tool for each change of the material.
    laid = [move.end[2] for move in run.moves if not move.rapid]
    assert (np.diff(laid) >= 0.0).all()
    assert [event for event in run.events if isinstance(event, str) and event != "cut"] == [
        f"tool {tool}" for tool in (0, 1, 0, 1, 0, 1, 0)
    ]


def laid_volumes(run, tool, area):
    """Volume of one tool at each height, from filament of a section that it feeds along lines."""
    found = {}
    for strand in run.lines(tool):
        volume = area * (strand.fed + (strand.fed_before if tool else 0.0))
        found[strand.points[0, 2]] = found.get(strand.points[0, 2], 0.0) + volume
    return found


def test_every_layer_is_full(printed):
    *_, run = printed
    matrix, fibre = laid_volumes(run, 0, 0.25 * np.pi * 1.75**2), laid_volumes(run, 1, 0.1)
    lower = strand = 0.0
    for height in sorted({*matrix, *fibre}):
        if height in fibre:  # is filled by the matrix above
            strand += fibre[height]
            continue
        laid = matrix[height] + strand
        assert laid == pytest.approx(AREA * (height - lower), rel=2e-3)
        lower, strand = height, 0.0
    total = sum(matrix.values()) + sum(fibre.values())
    assert total == pytest.approx(AREA * 4.0, rel=1e-3)
    # What is drawn back before travel is given back after it.
    strands = run.lines(0)
    alone = [move.fed for move in run.moves if move.tool == 0 and move.length == 0.0 and move.fed]
    assert set(alone) == {1.0, -1.0}
    assert alone == [-1.0, *[1.0, -1.0] * (len(strands) - 1)]


def sheet(lines, height=0.8):
    """A plate of 90 x 40 mm with one layer in its middle, strands on it, and the printer."""
    mesh = box_mesh((90.0, 40.0, height), (9, 4, 1))
    layers = Planar(count=1).cut(mesh)
    lines = [np.asarray(line, dtype=float) for line in lines]
    machine = replace(MACHINE, minimum_length=10.0, matrix_height=height)
    return Toolpaths.from_plane(lines, layers[0]), layers, mesh, machine


def test_matrix_leaves_room_where_strands_lie(follow):
    # Strands a width apart in the left half fill their layer of .1 mm, nothing in the right half.
    paths, layers, mesh, machine = sheet([[[0, y], [45, y]] for y in np.arange(40) + 0.5])
    run = follow(gcode(plan_print(paths, layers, mesh, machine), machine))
    filament = 0.25 * np.pi * 1.75**2
    share = {}
    for height in (0.35, 0.8):
        moves = [m for one in run.lines(0) for m in one.moves if one.points[0, 2] == height]
        x = np.array([0.5 * (m.start + m.end)[0] for m in moves]) - (150.0 - 45.0)
        fed, length = np.array([[m.fed * filament, m.length] for m in moves]).T
        for name, part in (("left", (x > 3) & (x < 42)), ("right", (x > 48) & (x < 87))):
            share[height, name] = fed[part].sum() / length[part].sum() / 0.8
    # Below there is no fibre; above, .35 mm stand over fibre and .45 beside it.
    assert share[0.35, "left"] == pytest.approx(share[0.35, "right"], rel=1e-3)
    assert share[0.8, "left"] / share[0.8, "right"] == pytest.approx(0.35 / 0.45, rel=0.01)


@pytest.mark.parametrize(
    ("wide", "scale"), [(0.82, 1.025), (0.76, 0.95), (2.4, 1.1), (0.4, 1 / 1.1)]
)
def test_flow_follows_the_section_within_a_tenth(wide, scale):
    # One line of .8 mm along a strip: too narrow or too wide a strip is not filled by more flow.
    line = np.array([[0.0, 0.0, 0.5], [50.0, 0.0, 0.5]])
    up = np.tile([0.0, 0.0, 1.0], (2, 1))
    paths = Toolpaths(
        points=line,
        normals=up,
        offsets=np.array([0, 2]),
        layer=np.zeros(1, int),
        kind=np.full(1, MATRIX),
        closed=np.zeros(1, bool),
    )
    strip = shapely.box(0.0, -0.5 * wide, 50.0, 0.5 * wide)
    found, laid, warning = with_flow(paths, strip, 0.5, Below(), MACHINE)
    assert found.lengths.sum() == pytest.approx(50.0)
    np.testing.assert_allclose(laid[:-1], 0.5 * scale)
    assert not warning


def test_strands_that_stand_higher_than_the_matrix_above_are_refused():
    # Grids of strands a width apart: twice .1 mm, in .1 mm for the fibre and .07 of matrix.
    rows = [[[0, y], [90, y]] for y in np.arange(40) + 0.5]
    columns = [[[x, 0], [x, 40]] for x in np.arange(90) + 0.5]
    with pytest.raises(InputError, match=r"higher than the 0\.07 mm .*0\.\d+ mm would do") as error:
        plan_print(*sheet(rows + columns, 0.24))
    # What it names is room for a strand on a strand, and .05 mm over them.
    wanted = float(str(error.value).split("layer; ")[1].split(" mm")[0])
    assert wanted == pytest.approx(0.15, abs=0.01)
    plan_print(*sheet(rows + columns, 2.0 * wanted + 0.1))


def test_the_zigzag_turns_by_45_degrees_from_layer_to_layer(printed):
    *_, run = printed
    by_height = {}
    for line in run.lines(0):
        by_height.setdefault(line.points[0, 2], []).extend(line.moves)
    for number, height in enumerate(sorted(by_height)):
        step = np.array([(move.end - move.start)[:2] for move in by_height[height]])
        length = np.linalg.norm(step, axis=1)
        # Double angles, weighted by length; the contour's sides along x and y cancel in part.
        inner = (length > 5.0) & (length < 60.0)
        angle = np.degrees(np.arctan2(step[:, 1], step[:, 0]))[inner]
        share = np.cos(np.radians(2.0 * (angle - 45.0 * (number + 1)))) > 0.999
        assert length[inner][share].sum() > 0.8 * length[inner].sum()


def test_both_nozzles_are_hot_before_they_extrude(printed):
    _, text, run = printed
    assert all(move.hot for move in run.moves if move.fed != 0.0)
    assert {move.tool for move in run.moves if move.fed != 0.0} == {0, 1}
    first = text.index("\nT0\n")
    for line in ("M190 S60", "M109 T0 S200", "G28"):
        assert 0 < text.index(line) < first
    # Each tool is waited for behind each change to it.
    for tool, degrees, changes in ((0, 200, 4), (1, 250, 3)):
        assert text.count(f"\nT{tool}\nM109 T{tool} S{degrees}\n") == changes
    assert text.index("M104 T1 S0") > text.rindex("G1")


def test_speeds_are_those_of_the_table(printed):
    *_, run = printed
    lines = [line + TO_BED for lines in LINES for line in lines]
    speeds = [{round(move.speed, 6) for move in strand.moves} for strand in match(lines, run)]
    # Rings of radius 11 and 14 mm: 0.09 and 0.07 1/mm. Right angles: 15, short sides 7. Straight
    # on: 35.
    assert speeds == [{15.0}, {7.0, 15.0}, {15.0}, {35.0}, {7.0, 15.0}, {35.0}]
    assert {move.speed for line in run.lines(0) for move in line.moves} == {12.0}
    across = [m.speed for m in run.moves if m.rapid and m.start[2] == m.end[2]]
    up = [m.speed for m in run.moves if m.rapid and m.start[2] != m.end[2]]
    assert set(across) == {80.0}
    assert set(up) == {10.0}


def test_the_time_is_that_of_the_evaluator(printed, plate):
    plan, text, run = printed
    layer = plate[1][0]
    for number, height in enumerate(sorted({line.points[0, 2] for line in run.lines(1)})):
        # What the evaluator counts: laying, and ways from path to path on the layer.
        strands = [line for line in run.lines(1) if line.points[0, 2] == height]
        laying = sum(move.seconds for line in strands for move in line.moves)
        ways = sum(np.linalg.norm(b.points[0] - a.points[-1]) for a, b in pairwise(strands))
        paths = plan.paths.on_layer(np.unique(plan.paths.layer[plan.paths.kind == 0])[number])
        samples = sample_manufacture(plane_paths(paths, layer), paths, MACHINE)
        expected = manufacture_indices(samples, MACHINE)["print_time"]
        assert laying + ways / 80.0 == pytest.approx(expected, rel=1e-6)
    # The sum at the head of the file; the way to the first line starts from an unknown place.
    first = next(m for m in run.moves if m.rapid and np.any((m.end - m.start)[:2]))
    seconds = sum(move.seconds for move in run.moves) - first.seconds + run.waited
    (said,) = [line for line in text.splitlines() if line.startswith(";TIME:")]
    assert float(said[6:]) == pytest.approx(seconds, abs=0.6)


def test_paths_follow_each_other_by_their_nearest_ends(printed):
    *_, run = printed
    top = max(line.points[0, 2] for line in run.lines(1))
    strands = [line for line in run.lines(1) if line.points[0, 2] == top]
    # From (65, 58): (65, 12) is nearer than the ends of the path in the middle.
    starts = [strand.points[0, :2] - TO_BED for strand in strands]
    np.testing.assert_allclose(starts, [[-18.0, 58.0], [65.0, 12.0], [-18.0, 14.0]], atol=1e-3)


def test_long_feeds_are_split(plate, follow):
    mesh, layers, paths = plate
    short = replace(MACHINE, gcode=GcodeProfile(longest_feed=20.0))
    run = follow(gcode(plan_print(paths, layers, mesh, short), short))
    assert max(move.fed for move in run.moves) <= 20.0
    fed = sum(move.fed for move in run.moves if move.tool == 1)
    assert fed == pytest.approx(paths.lengths.sum(), abs=0.02)
    match([line + TO_BED for lines in LINES for line in lines], run)
    once = follow(gcode(plan_print(paths, layers, mesh, MACHINE), MACHINE))
    seconds = [sum(m.seconds for x in one.lines(1) for m in x.moves) for one in (run, once)]
    assert seconds[0] == pytest.approx(seconds[1], rel=1e-6)


def test_a_cutter_at_the_nozzle_and_a_path_of_just_the_tail(plate, follow):
    mesh, layers, paths = plate
    at_tip = replace(MACHINE, cutter_distance=0.0)
    run = follow(gcode(plan_print(paths, layers, mesh, at_tip), at_tip))
    for strand in run.lines(1):
        assert strand.cuts == [len(strand.moves)]
        assert strand.fed_before == 0.0
    paths = Toolpaths.from_plane([np.array([[0.0, 15.0], [TAIL, 15.0]])], layers[0])
    (strand,) = follow(gcode(plan_print(paths, layers, mesh, MACHINE), MACHINE)).lines(1)
    assert (strand.cuts, strand.fed) == ([0], 0.0)
    assert strand.fed_before == pytest.approx(TAIL)


def test_a_part_built_along_y_lies_flat_on_the_bed(follow):
    mesh = box_mesh((60.0, 4.0, 20.0), (6, 2, 2), (5.0, -2.0, 7.0))
    layers = Planar(count=2).cut(mesh, (0.0, 1.0, 0.0))
    # The plane's axes are x and -z.
    line = np.array([[10.0, -20.0], [60.0, -20.0]])
    paths = Toolpaths.from_plane([line], layers[1])
    run = follow(gcode(plan_print(paths, layers, mesh, MACHINE), MACHINE))
    (strand,) = run.lines(1)
    wanted = line - [35.0, -17.0] + [150.0, 150.0]
    np.testing.assert_allclose(strand.points[[0, -1], :2], wanted, atol=1e-3)
    assert strand.points[0, 2] == pytest.approx(3.05, abs=1e-3)
    matrix = np.concatenate([line.points for line in run.lines(0)])
    assert matrix[:, 2].max() == 4.0
    np.testing.assert_allclose(np.ptp(matrix[:, :2], axis=0), [59.2, 19.2], atol=1e-3)


def test_the_printer_s_own_commands(plate):
    mesh, layers, paths = plate
    table = {
        "gcode": {
            "start": ["G90", "M83", "M109 T0 S{matrix_temperature}", "M109 T1 S205.5"],
            "cut": ["M42 P4 S255", "G4 P{wait}", "M42 P4 S0"],
            "end": [],
            "bed": [200, 200, 50],
        },
        "cut_wait": 0.25,
        "process": {"prime": "none", "warm_height": 0.0},
    }
    machine = from_table(Machine, table, "machine")
    text = gcode(plan_print(paths, layers, mesh, machine), machine)
    assert text.count("M42 P4 S255\nG4 P250\nM42 P4 S0\n") == 6
    assert "M280" not in text
    assert "M109 T0 S200\nM109 T1 S205.5\n" in text


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"cut": ["M280 P{pin}"]}, r"machine\.gcode: gcode\.cut has no field '\{pin\}' to fill in"),
        ({"start": ["G28\nM112"]}, r"machine\.gcode: start must be a list of single lines"),
        ({"tool": "T0"}, r"machine\.gcode\.tool must be a list, each item a string; got 'T0'"),
        ({"bed": [200, 0, 50]}, r"machine\.gcode: .*bed must be from 10 to 100000 mm; got 0"),
        (
            {"lift": -1},
            r"machine\.gcode: .*lift must be 0 or from 0.01 to 1000 mm; got .*: give more",
        ),
        ({"feed_speed": 0}, r"machine\.gcode: .*feed_speed must be from 0.5 to 2000 mm/s"),
        ({"nozzle": 1}, r"machine\.gcode has no key 'nozzle'"),
    ],
)
def test_profiles_that_make_no_sense(table, message):
    with pytest.raises(InputError, match=message):
        from_table(Machine, {"gcode": table}, "machine")


def test_prints_that_cannot_be(plate, tmp_path):
    mesh, layers, paths = plate
    short = Toolpaths.from_plane([np.array([[0.0, 15.0], [41.9, 15.0]])], layers[0])
    with pytest.raises(InputError, match=r"no shorter than the 42 mm .*; 1 of 1 are, the"):
        plan_print(short, layers, mesh, MACHINE)
    held = replace(MACHINE, held_length=5.0)
    by = r"than the 47 mm of machine\.held_length, 5 mm, and 42 mm from the cutter; 1 of 1 are, the"
    with pytest.raises(InputError, match=by):
        plan_print(short, layers, mesh, held)
    with pytest.raises(InputError, match=r"minimum_length is 20 mm, but the cutter lies 42 mm"):
        check_machine(replace(MACHINE, minimum_length=20.0, cutter_distance=42.0))
    with pytest.raises(InputError, match=r"machine\.matrix_height must be above 0 to print"):
        check_machine(replace(MACHINE, matrix_height=0.0))
    with pytest.raises(InputError, match=r"machine\.fibre_speed must be above 0 to print"):
        check_machine(replace(MACHINE, fibre_speed=0.0, speeds=None))
    check_machine(replace(MACHINE, fibre_speed=0.0))
    with pytest.raises(InputError, match="at least one layer; got none"):
        plan_print(Toolpaths.empty(), [], mesh, MACHINE)
    with pytest.raises(InputError, match="fibre lies on layer 1, which is not among"):
        plan_print(paths, layers[:1], mesh, MACHINE)
    with pytest.raises(InputError, match=r"fibre layer 0 at 3\.66667 mm does not fit .* 3 and 7"):
        plan_print(paths, layers, mesh, replace(MACHINE, fibre_height=1.34))
    close = Planar(heights=[4.0, 4.09]).cut(mesh)
    with pytest.raises(InputError, match=r"fibre layer 1 at 4\.09 mm .* 4\.05 and 7 mm"):
        plan_print(paths.select(paths.layer < 2), close, mesh, MACHINE)
    small = replace(MACHINE, gcode=GcodeProfile(bed=(100.0, 40.0, 100.0)))
    with pytest.raises(InputError, match=r"the part needs 89\.2 x 49\.2 x 5 mm, but the printer"):
        plan_print(paths, layers, mesh, small)
    plan = plan_print(paths, layers, mesh, MACHINE)
    with pytest.raises(InputError, match="there is no folder"):
        write_gcode(tmp_path / "missing" / "a.gcode", plan, MACHINE)
    write_gcode(tmp_path / "a.gcode", plan, MACHINE)
    assert (tmp_path / "a.gcode").read_text() == gcode(plan, MACHINE)
    assert [path.name for path in tmp_path.iterdir()] == ["a.gcode"]


def test_layers_without_fibre_are_filled_with_matrix(plate, follow):
    mesh, layers, paths = plate
    other = replace(paths, kind=np.full(len(paths), MATRIX))
    run = follow(gcode(plan_print(other, layers, mesh, MACHINE), MACHINE))
    assert run.lines(1) == []
    tops = sorted({line.points[0, 2] for line in run.lines(0)})
    np.testing.assert_allclose(tops, np.linspace(0.0, 4.0, 7)[1:], atol=1e-3)
    fed = sum(line.fed for line in run.lines(0))
    assert fed * 0.25 * np.pi * 1.75**2 == pytest.approx(AREA * 4.0, rel=0.015)
    # Fibre on the middle layer alone.
    run = follow(gcode(plan_print(paths.on_layer(1), layers, mesh, MACHINE), MACHINE))
    (strand,) = run.lines(1)
    assert strand.points[0, 2] == pytest.approx(2.05)
    tops = sorted({line.points[0, 2] for line in run.lines(0)})
    np.testing.assert_allclose(tops, [0.65, 1.3, 1.95, 2.7, 3.35, 4.0], atol=1e-3)
