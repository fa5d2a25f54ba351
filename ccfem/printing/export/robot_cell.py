"""What a cell of robots does, as CSV: the moves of the G-code, and how the head stands."""

from pathlib import Path

import numpy as np

from ccfem.base.whole import whole_file
from ccfem.printing.moves import CUT, EVENTS, FEED, LAY, PATH_END, PATH_START, TOOL, TRAVEL, Moves

_HEADER = "path,tool,layer,x,y,z,nx,ny,nz,speed,feed,beside,width,height,event"
_ROW = 14 * "%.8g," + "%s\n"

_TOGETHER = 100_000
"""Rows that are made at a time: a large print has millions."""


def write_robot_cell(path: str | Path, moves: Moves) -> None:
    """Write moves as CSV, one row a move or an event.

    Notes
    -----
    Columns: ``path, tool, layer, x, y, z, nx, ny, nz, speed, feed, beside, width, height, event``.
    A row is where the nozzle goes, mm, on the bed of the machine, and how its head stands there;
    with the speed, mm/s, of the way there, and for lines the filament that it feeds, mm per mm:
    that of the tool, and matrix beside the fibre. ``path`` is the number of the strand, -1 for all
    else. Events are ``travel``, ``lay``, ``feed L`` of L mm where the nozzle stands, ``start`` and
    ``end`` of a strand, ``cut``, ``tool N``, and those with a value: ``standby``, ``preheat``,
    ``heat`` and ``work`` with the temperature of the tool, ``heat bed``, ``fan`` with a share,
    ``wait`` with seconds, ``layer`` and ``pause`` with its number.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    length = moves.length
    laying = (moves.event == LAY) & (length > 0.0)
    share = [
        np.divide(fed, length, out=np.zeros(len(moves)), where=laying)
        for fed in (moves.feed, moves.beside)
    ]
    numbers = (moves.strand, moves.tool, moves.layer, *moves.place.T, *moves.normal.T)
    columns = (*numbers, moves.speed, *share, moves.width, moves.height)
    value = np.where(moves.feed == 0.0, moves.beside, moves.feed)
    with whole_file(path) as temporary, temporary.open("w", encoding="ascii") as file:
        file.write(_HEADER + "\n")
        for first in range(0, len(moves), _TOGETHER):
            some = slice(first, first + _TOGETHER)
            about = (moves.event, value, moves.amount, moves.tool)
            names = map(_named, *(column[some].tolist() for column in about))
            rows = zip(*(column[some].tolist() for column in columns), names, strict=True)
            file.writelines(map(_ROW.__mod__, rows))


def _named(event: int, feed: float, amount: float, tool: int) -> str:
    """Say in words what a row is."""
    name = EVENTS[event]
    if event == FEED:
        return f"{name} {feed:g}"
    if event == TOOL:
        return f"{name} {tool}"
    if event in (TRAVEL, LAY, CUT, PATH_START, PATH_END):
        return name
    return f"{name} {amount:g}"
