"""Strands that cross more than the matrix above can level: higher matrix, or ends in turn."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.machine import Machine, Process
from ccfem.paths.planning.unfolding import part_of_line
from ccfem.paths.splitting.printed_strands import ended_in_stacks, height_over
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.printing.print_plan import plan_print
from ccfem.slicing.slicers.planar import Planar

MACHINE = Machine(minimum_length=20.0, cutter_distance=20.0, matrix_height=0.2)
SECTION = shapely.box(0.0, 0.0, 100.0, 100.0)


def bundles(count):
    """Two bundles of strands a width apart, across each other in the middle."""
    offset = 50.0 + np.arange(count) - 0.5 * (count - 1)
    along = [np.array([[0.0, y], [100.0, y]]) for y in offset]
    return along + [line[:, ::-1] for line in along]


def height(lines, place):
    """Volume of strands per area within 4.5 mm of a place, mm: counted without the code."""
    disc = shapely.Point(place).buffer(4.5)
    length = sum(shapely.LineString(line).intersection(disc).length for line in lines)
    return MACHINE.strand_area * length / disc.area


def test_of_neighbours_one_ends_and_the_other_goes_on():
    lines = bundles(11)
    room = 1.6 * MACHINE.strand_height
    assert height(lines, (50.0, 50.0)) == pytest.approx(2.0 * MACHINE.strand_height, rel=0.1)
    found = ended_in_stacks(lines, SECTION, room, MACHINE)
    assert height(found.lines, (50.0, 50.0)) < 1.15 * room
    # Half of what was there at most is left out, nothing outside the crossing, and no short piece.
    away = shapely.box(40.0, 40.0, 60.0, 60.0)
    before, after = (
        sum(shapely.LineString(x).difference(away).length for x in each)
        for each in (lines, found.lines)
    )
    assert before == pytest.approx(after, abs=1e-6)
    lost = 2200.0 - sum(shapely.LineString(x).length for x in found.lines)
    assert found.removed == pytest.approx(lost, abs=1e-6)
    assert 0.0 < lost < 0.5 * 22 * 11
    assert min(shapely.LineString(x).length for x in found.lines) >= MACHINE.minimum_length


def test_strands_that_are_not_too_high_or_cannot_be_cut_stay():
    lines = bundles(11)
    room = 2.5 * MACHINE.strand_height
    assert ended_in_stacks(lines, SECTION, room, MACHINE).places == 0
    long = replace(MACHINE, minimum_length=60.0)
    assert ended_in_stacks(lines, SECTION, 1.6 * MACHINE.strand_height, long).places == 0


def planned(machine, top=0.8):
    mesh = box_mesh((100.0, 100.0, top), (2, 2, 1))
    layers = Planar(heights=(0.35,)).cut(mesh)
    return plan_print(Toolpaths.from_plane(bundles(40), layers[0]), layers, mesh, machine)


def test_the_matrix_above_is_as_high_as_a_stack_needs():
    plan = planned(replace(MACHINE, matrix_height=0.12))
    fibre = int(plan.paths.of_kind(FIBRE).layer[0])
    # Two strands in one place: their second needs a strand's height above, and .05 mm of matrix.
    need = MACHINE.strand_height + 0.05
    assert plan.thickness[fibre + 1] == pytest.approx(need, rel=0.1)
    assert height_over(bundles(40), SECTION, MACHINE) == pytest.approx(need, rel=0.1)
    assert plan.thickness[fibre + 2 :].max() <= 0.12 + 1e-9
    assert plan.ended == 0.0
    assert plan.warnings == ()


def test_without_room_above_strands_end_or_the_print_is_refused():
    # .11 mm above: a stack of two leaves .0025 mm of it, on 16 % of the layer.
    top = 0.35 + 0.5 * MACHINE.strand_height + 0.11
    tight = replace(MACHINE, process=Process(cover=0.1))
    with pytest.raises(InputError, match=r"or set process\.stacks = 'end'$"):
        planned(tight, top)
    plan = planned(replace(tight, process=Process(cover=0.1, stacks="end")), top)
    assert plan.ended > 0.0
    (said, *_) = plan.warnings
    assert said.startswith(f"{plan.ended:.0f} mm of fibre layer 0 are left out in ")
    laid = plan.paths.of_kind(FIBRE).lengths.sum()
    assert laid + plan.ended + plan.dropped == pytest.approx(80 * 100.0, abs=0.5)


def test_no_piece_is_left_by_rounding():
    """Strands that end in the stack: what was left beyond it had the length of a rounding error."""
    pick = np.random.default_rng(1)
    lines = []
    for line in bundles(11):
        ends = [0.0, 0.55 + 0.003 * pick.uniform()]
        share = np.sort(np.append(pick.uniform(0.0, 0.55, 40), ends))[:, None]
        lines.append(line[0] + share * (line[1] - line[0]))
    found = ended_in_stacks(lines, SECTION, 1.2 * MACHINE.strand_height, MACHINE)
    assert found.places > 0
    assert min(stop - start for _, (start, stop) in found.pieces) >= MACHINE.minimum_length - 1e-6


def test_a_part_that_ends_behind_the_last_point_by_rounding_ends_there():
    """It ended at the first point: a strand of `bracket` by svt ran right across the part."""
    line = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 7.0]])
    along, link = np.array([0.0, 10.0, 17.0]), np.zeros(3, dtype=bool)
    for stop in (17.0, np.nextafter(17.0, 18.0), 17.0 + 1e-12):
        points, _ = part_of_line(line, along, link, 4.0, stop)
        np.testing.assert_allclose(points, [[4.0, 0.0], [10.0, 0.0], [10.0, 7.0]], atol=1e-9)
