"""Filament that is drawn back is given back before anything is laid."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.machine import Machine
from ccfem.printing.moves import FEED, LAY
from ccfem.printing.part_moves import change_tool, lay_line, matrix_steps
from ccfem.printing.recorder import Recorder, steps_along

UP = np.array([[0.0, 0.0, 1.0]] * 2)


def line(x):
    return np.array([[x, 0.0, 0.4], [x, 30.0, 0.4]])


@pytest.mark.parametrize("retract", [0.0, 1.5])
@pytest.mark.parametrize("tool_retract", [0.0, 15.0])
def test_the_melt_stands_at_the_nozzle_where_a_line_begins(retract, tool_retract):
    """The sum of what is fed without moving is zero at the first step of every line."""
    machine = Machine()
    machine = replace(
        machine,
        gcode=replace(machine.gcode, retract=retract),
        process=replace(machine.process, tool_retract=tool_retract),
    )
    recorder = Recorder(machine)
    change_tool(recorder, 0, 0.4, machine)
    for x, changes in ((0.0, False), (5.0, True), (10.0, True), (15.0, False)):
        if changes:
            change_tool(recorder, 1, 0.4, machine)
            change_tool(recorder, 0, 0.4, machine)
        steps = matrix_steps(line(x), UP, np.full(1, 0.4), "infill", machine, 30.0)
        lay_line(recorder, steps, machine)
    moves = recorder.moves()
    drawn, begins, before = 0.0, 0, None
    for event, fed in zip(moves.event, moves.feed, strict=True):
        if event == LAY and before != LAY:
            assert drawn == pytest.approx(0.0, abs=1e-9)
            begins += 1
        if event == FEED:
            drawn += fed
        before = event
    assert begins == 4
    assert drawn == pytest.approx(-retract)


def test_steps_on_a_straight_line_are_one_move():
    """A quarter circle between two straight lines, in steps of about half a millimetre."""
    machine = Machine()
    arc = np.linspace(0.0, 0.5 * np.pi, 61)
    plane = np.concatenate(
        [
            np.column_stack([np.linspace(-40.0, 0.0, 81)[:-1], np.zeros(80)]),
            np.column_stack([20.0 * np.sin(arc), 20.0 - 20.0 * np.cos(arc)]),
            np.column_stack([np.full(80, 20.0), np.linspace(20.0, 60.0, 81)[1:]]),
        ]
    )
    path = np.column_stack([plane, np.full(len(plane), 0.4)]).round(3)
    speeds = np.full(len(path) - 1, 10.0)
    speeds[20:] = 12.0
    up, full = np.broadcast_to([0.0, 0.0, 1.0], path.shape), np.ones(len(speeds))
    recorder = Recorder(machine)
    recorder.travel(path[0], up[0])
    recorder.lay(steps_along(path, up, speeds, 0.05 * full, full, 0.4 * full, "fibre", machine))
    moves = recorder.moves()
    laid = moves.event == LAY
    # The arc needs its points; the lines around it are three moves, one of them slower.
    assert laid.sum() == pytest.approx(60 + 3, abs=1)
    assert moves.speed[laid][0] == 10.0
    assert moves.length[laid][0] == pytest.approx(10.0)
    walked = shapely.LineString(np.vstack([path[0], moves.place[laid]])[:, :2])
    assert shapely.hausdorff_distance(walked, shapely.LineString(path[:, :2])) < 2e-3
    assert moves.feed[laid].sum() == pytest.approx(0.05 * walked.length, abs=1e-4)


def test_a_line_of_one_point_is_no_move():
    """As the way back over a strand's end that is ironed over less than a micrometre."""
    recorder = Recorder(Machine())
    place, nothing = np.array([[3.0, 4.0, 0.4]]), np.zeros(0)
    recorder.travel(place[0], UP[0])
    before = len(recorder.rows)
    recorder.lay(steps_along(place, UP[:1], *4 * [nothing], "travel", Machine()))
    assert len(recorder.rows) == before
    assert not (recorder.moves().event == LAY).any()
