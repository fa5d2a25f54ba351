"""What a cell of robots does, as CSV: the moves of the G-code, and how the head stands."""

from collections.abc import Iterator
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
    with whole_file(path) as temporary, temporary.open("w", encoding="ascii") as file:
        file.write(_HEADER + "\n")
        for first in range(0, len(moves), _TOGETHER):
            file.writelines(_lines(moves, first, first + _TOGETHER))


def _lines(moves: Moves, first: int, last: int) -> Iterator[str]:
    """Lines of some rows."""
    before, some = max(first - 1, 0), slice(first, last)
    place = moves.place[before:last]
    way = np.diff(place, axis=0, prepend=place[:1])[first - before :]
    length, event = np.linalg.norm(way, axis=1), moves.event[some]
    feed, beside = moves.feed[some], moves.beside[some]
    laying = (event == LAY) & (length > 0.0)
    share = [np.divide(fed, length, out=np.zeros(len(fed)), where=laying) for fed in (feed, beside)]
    tool, axes = moves.tool[some], (*place[first - before :].T, *moves.normal[some].T)
    sizes = (moves.speed[some], *share, moves.width[some], moves.height[some])
    columns = (moves.strand[some], tool, moves.layer[some], *axes, *sizes)
    about = (event, np.where(feed == 0.0, beside, feed), moves.amount[some], tool)
    names = map(_named, *(column.tolist() for column in about))
    rows = zip(*(column.tolist() for column in columns), names, strict=True)
    return map(_ROW.__mod__, rows)


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
