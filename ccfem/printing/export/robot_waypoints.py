"""Files for robots, as CSV: waypoints on the layers, and all that a cell does in a print."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ccfem.base.errors import InputError
from ccfem.base.whole import existing_file, whole_file
from ccfem.machine.machine import Machine
from ccfem.paths.linking.print_order import step_speeds
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.printing.moves import CUT, EVENTS, FEED, LAY, PATH_END, PATH_START, TOOL, TRAVEL, Moves
from ccfem.slicing.layers.layer import Layer

_HEADER = "layer,path,x,y,z,nx,ny,nz,height,feed"
_JUMP = 3.0
"""Steps of a published file longer than this, mm, are travel between strands."""


def write_robot_waypoints(
    path: str | Path,
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    machine: Machine,
    kind: int = FIBRE,
) -> None:
    """Write paths of one kind as CSV: ``layer, path, x, y, z, nx, ny, nz, height, feed``.

    Parameters
    ----------
    toolpaths : Toolpaths
        Paths of other kinds are left out.
    layers : sequence of Layer
        Layers that the paths lie on.
    machine : Machine
        Says the feed, mm/s, with which the step from each point to the next is laid.
    kind : int, default FIBRE
        As in `ccfem.paths.toolpaths`: MATRIX for the paths of `layer_matrix`.

    Notes
    -----
    x, y, z and height (of the layer at the point) in mm, in the frame of the mesh.
    """
    fibre, known = toolpaths.of_kind(kind), {layer.index: layer for layer in layers}
    missing = set(fibre.layer.tolist()) - set(known)
    if missing:
        raise InputError(
            f"paths lie on layer {min(missing)}, which is not among the layers given: give the "
            "layers that the paths were planned on"
        )
    feed = step_speeds(fibre, machine)
    number = np.repeat(np.arange(len(fibre)), np.diff(fibre.offsets))
    owner = fibre.layer[number]
    height = np.zeros(len(fibre.points))
    for index, layer in known.items():
        here = owner == index
        if here.any():
            places = layer.nearest(fibre.points[here])
            height[here] = layer.values_at(places, layer.local_thickness)
    table = np.column_stack([fibre.points, fibre.normals, height, feed])
    with whole_file(path) as temporary, temporary.open("w", encoding="ascii") as file:
        file.write(_HEADER + "\n")
        for k, p, row in zip(owner.tolist(), number.tolist(), table.tolist(), strict=True):
            file.write(f"{k},{p}," + ",".join(f"{value:.6g}" for value in row) + "\n")


def write_layer_waypoints(path: str | Path, toolpaths: Toolpaths, layer: int) -> None:
    """Write one layer, by its index, as the files published with Fang et al. 2024.

    Rows of ``x y z nx ny nz`` and three flags: the third last is 0, the second last 1 in the first
    row only, the last 2; the strands follow each other.
    """
    fibre = toolpaths.of_kind(FIBRE).on_layer(layer)
    if not len(fibre):
        raise InputError(f"layer {layer} has no fibre to write: name one that has")
    start = np.zeros(len(fibre.points))
    start[0] = 1.0
    flags = np.column_stack([np.zeros(len(start)), start, np.full(len(start), 2.0)])
    with whole_file(path) as temporary, temporary.open("w", encoding="ascii") as file:
        rows = np.column_stack([fibre.points, fibre.normals])
        for row, flag in zip(rows.tolist(), flags.tolist(), strict=True):
            numbers = " ".join(f"{value:.6f}" for value in row)
            file.write(numbers + " " + " ".join(f"{value:g}" for value in flag) + "\n")


def read_layer_waypoints(path: str | Path, layer: Layer) -> Toolpaths:
    """Read the fibre on a layer from a file as published with Fang et al. 2024.

    Steps longer than 3 mm are travel: the strands are cut there, and those whose ends lie within 3
    mm of each other are closed. Points are put on the layer, whose normals they take, since some of
    the published ones are missing.
    """
    file = existing_file(path, "waypoint file")
    try:
        table = np.loadtxt(file, ndmin=2)
        points = table[:, :3]
    except (ValueError, IndexError):
        raise InputError(
            f"{path} is no waypoint file: expected rows of x y z nx ny nz and flags, got other "
            "text: check its name"
        ) from None
    if not np.isfinite(points).all():
        raise InputError(f"{path} has a place that is no number: mend or leave out that row")
    nearest = layer.nearest(points)
    normals = layer.normals_at(nearest)
    cut = np.flatnonzero(np.linalg.norm(np.diff(points, axis=0), axis=1) > _JUMP) + 1
    lines, across = np.split(points, cut), np.split(normals, cut)
    for k, line in enumerate(lines):
        if len(line) > 3 and np.linalg.norm(line[0] - line[-1]) <= _JUMP:
            lines[k] = np.vstack([line, line[:1]])
            across[k] = np.vstack([across[k], across[k][:1]])
    return Toolpaths.in_space(lines, across, layer)


# What a cell of robots does: the moves of the G-code, and how the head stands.


_CELL_HEADER = "path,tool,layer,x,y,z,nx,ny,nz,speed,feed,beside,width,height,event"
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
    """
    with whole_file(path) as temporary, temporary.open("w", encoding="ascii") as file:
        file.write(_CELL_HEADER + "\n")
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
