"""Filament that is drawn back is given back before anything is laid."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.machine import Machine
from ccfem.printing.moves import FEED, LAY
from ccfem.printing.part_moves import change_tool, lay_matrix
from ccfem.printing.recorder import Recorder

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
        lay_matrix(recorder, line(x), UP, np.full(1, 0.4), "infill", machine, 30.0)
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
