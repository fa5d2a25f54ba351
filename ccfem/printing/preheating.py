"""Preheating of a waiting tool, so that the print does not wait for it."""

from dataclasses import fields

import numpy as np

from ccfem.machine.machine import Machine
from ccfem.printing.duration import durations
from ccfem.printing.moves import PREHEAT, STANDBY, WORK, Moves


def preheated(moves: Moves, machine: Machine) -> Moves:
    """Insert a row PREHEAT before each change back to a tool that was set to standby.

    It is inserted before the last row that starts at least the heating time, (work - standby) over
    the rate, ahead of the change; or right after the change away if that is later.

    Parameters
    ----------
    moves : Moves
    machine : Machine
    """
    begin = np.concatenate([[0.0], np.cumsum(durations(moves, machine, heating=False))])[:-1]
    rate = (machine.matrix_heating, machine.fibre_heating)
    places, values, tools = [], [], []
    for tool in (0, 1):
        waits = np.flatnonzero((moves.event == STANDBY) & (moves.tool == tool))
        works = np.flatnonzero((moves.event == WORK) & (moves.tool == tool))
        for k in works.tolist():
            before = waits[waits < k]
            if not len(before):
                standby, first = _waiting(tool, machine), 0
            else:
                standby, first = float(moves.amount[before[-1]]), int(before[-1])
            need = max(float(moves.amount[k]) - standby, 0.0) / rate[tool]
            at = int(np.searchsorted(begin, begin[k] - need, side="right")) - 1
            # Behind the change away: standby, selection and wait of the other tool, and its fan.
            behind = first + 4 if len(before) else 1
            at = max(at, behind)
            if need > 0.0 and at < k:
                places.append(at)
                values.append(float(moves.amount[k]))
                tools.append(tool)
    return _with_rows(moves, places, values, tools)


def _waiting(tool: int, machine: Machine) -> float:
    """Temperature of a tool before its first use; the start of the file waits for that of T0."""
    return machine.fibre_standby if tool else machine.matrix_temperature + 1e3


def _with_rows(moves: Moves, places: list[int], values: list[float], tools: list[int]) -> Moves:
    """Insert rows PREHEAT before the rows at the given places."""
    if not places:
        return moves
    found = {}
    for one in fields(moves):
        old = getattr(moves, one.name)
        new = np.zeros((len(places), *old.shape[1:]), dtype=old.dtype)
        at = np.array(places)
        if one.name in ("place", "normal", "layer", "strand"):
            new = old[np.maximum(at - 1, 0)]
        elif one.name == "event":
            new[:] = PREHEAT
        elif one.name == "amount":
            new[:] = values
        elif one.name == "tool":
            new[:] = tools
        found[one.name] = np.insert(old, at, new, axis=0)
    return Moves(**found)
