"""Duration of moves, with trapezoidal speed profiles limited by the corners between them."""

from itertools import pairwise

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.machine.machine import Machine
from ccfem.printing.moves import (
    CUT,
    FEED,
    LAY,
    PAUSE,
    PREHEAT,
    STANDBY,
    TRAVEL,
    WAIT,
    WORK,
    Moves,
    is_any,
)

_TOGETHER = 100_000
"""Rows that are timed at a time: a large print has millions."""


def durations(moves: Moves, machine: Machine, heating: bool = True) -> FloatArray:
    """Seconds that each row takes, (n,); with or without the waits for tools.

    Moves speed up and slow down at `Process.acceleration`. At a corner the speed is that on the arc
    that deviates from it by `Process.junction` (junction deviation). The nozzle stands still while
    only filament is fed, at cuts and at tool changes. Waiting tools cool and heat at their heating
    rates. The first heating of bed and nozzles is not counted, nor is how long a pause takes.
    """
    seconds = np.zeros(len(moves))
    fed = moves.event == FEED
    length = np.maximum(np.abs(moves.feed[fed]), np.abs(moves.beside[fed]))
    seconds[fed] = length / moves.speed[fed]
    still = is_any(moves.event, CUT, WAIT)
    seconds[still] = moves.amount[still]
    halts = is_any(moves.event, FEED, CUT, WAIT, WORK, PAUSE)
    first = True
    for begin, end in pairwise(_edges(halts)):
        before = max(begin - 1, 0)
        place = moves.place[before:end]
        way = np.diff(place, axis=0, prepend=place[:1])[begin - before :]
        length = np.linalg.norm(way, axis=1)
        moves_on = is_any(moves.event[begin:end], TRAVEL, LAY)
        rows = np.flatnonzero(moves_on & (length > 0.0))
        # The way to the first place of all starts at an unknown one.
        if first and len(rows):
            rows, first = rows[1:], False
        at = begin + rows
        stops = np.cumsum(halts[begin:end], dtype=np.int64)[rows]
        seconds[at] = _motion(way[rows], length[rows], moves.speed[begin:end][rows], stops, machine)
    return seconds + waits(seconds, moves, machine) if heating else seconds


def _edges(halts: BoolArray) -> list[int]:
    """Rows that cut all (n,) into pieces in which moves can be timed alone, between halts."""
    halting, count = np.flatnonzero(halts), len(halts)
    after = np.searchsorted(halting, np.arange(_TOGETHER, count, _TOGETHER))
    cuts = np.unique(halting[after[after < len(halting)]])
    return [0, *cuts.tolist(), count]


def waits(seconds: FloatArray, moves: Moves, machine: Machine) -> FloatArray:
    """Seconds that each row waits for its tool, where all rows take some seconds without."""
    rows, pauses = np.flatnonzero(moves.event == WORK), np.zeros(len(seconds))
    before = seconds[rows]
    _add_heating(seconds, moves, machine)
    pauses[rows] = seconds[rows] - before
    seconds[rows] = before
    return pauses


def _motion(
    way: FloatArray, length: FloatArray, speed: FloatArray, stops: IntArray, machine: Machine
) -> FloatArray:
    """Seconds of moves along ways (k, 3), which stop where the number of halts before changes."""
    if not len(way):
        return np.zeros(0)
    most, process = machine.process.acceleration, machine.process
    way = way / length[:, None]
    cosine = -np.einsum("ij,ij->i", way[1:], way[:-1])
    half = np.sqrt(np.clip(0.5 * (1.0 - cosine), 0.0, 1.0 - 1e-12))
    corner = most * process.junction * half / (1.0 - half)
    corner = np.minimum(corner, np.minimum(speed[1:], speed[:-1]) ** 2)
    corner[stops[1:] != stops[:-1]] = 0.0
    # Squares of the speeds between moves: reachable, and low enough to stop in time.
    square = np.concatenate([[0.0], corner, [0.0]]).tolist()
    gain = (2.0 * most * length).tolist()
    # Comparisons in place of min(): there are hundreds of thousands of moves.
    before = 0.0
    for k, more in enumerate(gain, start=1):
        before += more
        if square[k] < before:
            before = square[k]
        else:
            square[k] = before
    behind = 0.0
    for k in range(len(gain) - 1, -1, -1):
        behind += gain[k]
        if square[k] < behind:
            behind = square[k]
        else:
            square[k] = behind
    first, last = np.sqrt(square[:-1]), np.sqrt(square[1:])
    peak = np.minimum(speed, np.sqrt(0.5 * (first**2 + last**2) + most * length))
    ramps = (peak - first) / most + (peak - last) / most
    way_of_ramps = 0.5 * ((peak**2 - first**2) + (peak**2 - last**2)) / most
    return np.asarray(ramps + np.maximum(length - way_of_ramps, 0.0) / peak)


def _add_heating(seconds: FloatArray, moves: Moves, machine: Machine) -> None:
    """Add the waits for tools that are not hot yet to rows WORK, in place."""
    rate = (machine.matrix_heating, machine.fibre_heating)
    work = np.flatnonzero(is_any(moves.event, STANDBY, PREHEAT, WORK))
    heat = [machine.matrix_temperature + machine.process.warm_matrix, machine.fibre_standby]
    wanted, since = list(heat), [0.0, 0.0]
    now = 0.0
    for last, k in pairwise([0, *work.tolist()]):
        now += float(seconds[last:k].sum())
        tool = int(moves.tool[k])
        step = rate[tool] * (now - since[tool])
        gap = wanted[tool] - heat[tool]
        heat[tool] += float(np.clip(gap, -step, step))
        wanted[tool], since[tool] = float(moves.amount[k]), now
        if moves.event[k] == WORK:
            seconds[k] += max(wanted[tool] - heat[tool], 0.0) / rate[tool]
            heat[tool] = max(heat[tool], wanted[tool])
            # The time of the wait also counts for the rows after it.
