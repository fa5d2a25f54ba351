"""The time of a print: another way to the same seconds, and tools that are hot in time."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.printing.duration import durations
from ccfem.printing.moves import FAN, PREHEAT, WORK
from ccfem.printing.part_moves import part_moves

CELL = 0.02


def seconds(run, most, deviation):
    """Time of a run by its phase plane: squares of the speed at the ends of small cells.

    Between corners nothing but the acceleration bounds the change of the square; in a corner the
    nozzle is on the arc that leaves it by the deviation.
    """
    total, chain = 0.0, []

    def finished():
        if not chain:
            return 0.0
        cells, square = [], [0.0]
        for k, step in enumerate(chain):
            count = int(np.ceil(step.length / CELL)) + 1
            if k:
                ways = [np.subtract(s.end, s.start) / s.length for s in (chain[k - 1], step)]
                half = 0.5 * np.arccos(np.clip(ways[0] @ ways[1], -1.0, 1.0))
                radius = deviation / max(1.0 / max(np.cos(half), 1e-9) - 1.0, 1e-12)
                square[-1] = min(square[-1], step.speed**2, most * radius)
            cells += [step.length / count] * count
            square += [step.speed**2] * count
        square[-1] = 0.0
        for k in range(1, len(square)):
            square[k] = min(square[k], square[k - 1] + 2.0 * most * cells[k - 1])
        for k in range(len(square) - 2, -1, -1):
            square[k] = min(square[k], square[k + 1] + 2.0 * most * cells[k])
        speed = np.sqrt(square)
        return float((2.0 * np.array(cells) / (speed[1:] + speed[:-1])).sum())

    for step in run.steps[2:]:
        if step.length and step.number not in run.cuts:
            chain.append(step)
            continue
        total += finished() + (0.0 if step.length else abs(step.fed) / step.speed)
        chain = [step] if step.length else []
    return total + finished() + run.waited


def test_the_time_is_that_of_another_estimator(small_part):
    # Tools that heat at once: the wait for them has a test of its own.
    hot = {"matrix_heating": 1e4, "fibre_heating": 1e4, "process": {"acceleration": 20.0}}
    job = small_part("marlin_two_tools", hot)
    process = job.machine.process
    found = seconds(job.done, process.acceleration, process.junction)
    assert float(job.done.head["TIME"]) == pytest.approx(found, rel=0.01)
    # It does matter: without acceleration the same moves take less.
    plain = sum((s.length or abs(s.fed)) / s.speed for s in job.done.steps[2:]) + job.done.waited
    assert plain < 0.95 * found


def test_a_waiting_tool_is_hot_in_time(small_part):
    # 100 K at 10 K/s: 10 s ahead; the fibre's 70 K at 1.38 K/s take 51 s, less than its break.
    job = small_part("marlin_two_tools", {"matrix_heating": 10.0})
    moves = part_moves(job.plan, job.machine)
    spent = durations(moves, job.machine)
    begin = np.cumsum(spent) - spent
    works = np.flatnonzero(moves.event == WORK)
    for tool, need in ((0, 10.0), (1, 70.0 / 1.38)):
        preheats = np.flatnonzero((moves.event == PREHEAT) & (moves.tool == tool))
        mine = [k for k in works.tolist() if moves.tool[k] == tool][1 - tool :]
        assert len(preheats) == len(mine) == 2
        for early, late in zip(preheats.tolist(), mine, strict=True):
            gap = begin[late] - begin[early]
            assert need <= gap <= need + spent[early + 1] + 1e-9
            assert spent[late] == pytest.approx(0.0, abs=1e-6)
            assert moves.amount[early] == moves.amount[late]
    # Without it the printer waits as long as the tool had cooled, at most 10 s here.
    cold = replace(moves, event=np.where(moves.event == PREHEAT, FAN, moves.event))
    waits = durations(cold, job.machine)[(moves.event == WORK) & (moves.tool == 0)]
    np.testing.assert_allclose(waits, [0.0, 10.0, 10.0], atol=1e-6)
