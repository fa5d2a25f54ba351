"""Paths of other programs: tables, waypoints, and strands on curved layers, a file a layer.

A table is CSV with the columns x, y, z, path, layer, one row a point.
"""

import csv
from pathlib import Path

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.whole import text_of
from ccfem.body.files.strand_files import check_near, holds_strands, read_strand_files
from ccfem.geometry.polylines import pack
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.printing.export.waypoints import CLOSED, LARGEST_NUMBER, close_rings, read_waypoints

FRAMES = ("mesh", "tool")
"""What coordinates of a file may be in: those of the mesh, or the axes of the printer's tool."""

_COLUMNS = ("x", "y", "z", "path", "layer")


def read_paths(path: str | Path, frame: FloatArray, named: str | None = None) -> Toolpaths:
    """Read fibre paths of another program: a table, strands, or waypoints in the published format.

    Parameters
    ----------
    path : str or Path
        A file that ends in ``.csv`` is a table (`read_path_table`); a folder, and a file that ends
        in ``.obj`` or is a table of numbers, holds strands (`read_strands`); any other waypoints.
    frame : (3, 3) array
        Frame of the layers: rows are the tool's axes in the frame of the mesh.
    named : {"mesh", "tool"}, optional
        What the coordinates are in. Default: waypoints in the tool's, all else in the mesh's.

    Raises
    ------
    InputError
        When the file cannot be read, the frame is unknown, a coordinate is beyond 100 m, or a path
        has no length.
    """
    if named is not None and named not in FRAMES:
        raise InputError(f"paths are in the frame 'mesh' or 'tool'; got '{named}': name one")
    path = Path(path)
    table, strands = path.suffix.lower() == ".csv", holds_strands(path)
    tool = (named or ("mesh" if table or strands else "tool")) == "tool"
    axes = frame if tool else np.eye(3)
    if strands:
        paths = read_strands(path, axes, frame[2])
        _check_lengths(paths, str(path))
        return paths
    if table:
        paths = read_path_table(path, axes, frame[2])
        _check_lengths(paths, str(path))
        return paths
    paths = read_waypoints(path, axes)
    _check_lengths(paths, str(path))
    # The normals are those of the layers, whatever the points are in.
    return Toolpaths(
        paths.points, np.broadcast_to(frame[2], paths.points.shape), paths.offsets, paths.layer,
        paths.kind, paths.closed,
    )  # fmt: skip


def _check_lengths(paths: Toolpaths, name: str) -> None:
    """Raise on paths without length."""
    short = np.flatnonzero(paths.lengths == 0.0)
    if len(short):
        where = ", ".join(f"{x:.4g}" for x in paths.points[paths.offsets[short[0]]])
        raise InputError(
            f"{name}: {len(short)} of {len(paths)} paths have no length, the first at ({where}) "
            "mm: remove them"
        )


def read_path_table(path: str | Path, axes: FloatArray, normal: FloatArray) -> Toolpaths:
    """Read fibre paths from a CSV file with a header.

    Parameters
    ----------
    path : str or Path
        Columns x, y, z in mm, path and layer as whole numbers, in any order; others are not read.
        The rows of a path follow each other in the order in which it is laid. A path whose ends
        lie within 0.001 mm is closed.
    axes : (3, 3) array
        Rows: the axes of the coordinates in the frame of the mesh.
    normal : (3,) array
        Of the layers.
    """
    try:
        first, *rows = [*csv.reader(text_of(path, "path table").splitlines())] or [[]]
    except csv.Error as error:
        raise InputError(f"{path} is no path table: {error}: check its name") from None
    head = [word.strip().lower() for word in first]
    missing = [name for name in _COLUMNS if name not in head]
    if missing:
        raise InputError(
            f"{path}: expected a header with the columns {', '.join(_COLUMNS)}; "
            f"{', '.join(missing)} not there: add it"
        )
    place = [head.index(name) for name in _COLUMNS]
    values = []
    for number, row in enumerate(rows, start=2):
        if not any(word.strip() for word in row):
            continue
        try:
            values.append([float(row[k]) for k in place])
            whole = values[-1][3:]
            if not np.isfinite(values[-1]).all() or any(
                v != int(v) or abs(v) > LARGEST_NUMBER for v in whole
            ):
                raise ValueError
        except (ValueError, IndexError):
            raise InputError(
                f"{path}, line {number}: expected numbers {', '.join(_COLUMNS)}, the last two "
                f"whole; got '{','.join(row)[:40]}'"
            ) from None
    return _toolpaths(np.array(values).reshape(-1, 5), axes, normal, str(path))


def _toolpaths(values: FloatArray, axes: FloatArray, normal: FloatArray, name: str) -> Toolpaths:
    """Toolpaths of rows x, y, z, path, layer."""
    if not len(values):
        return Toolpaths.empty()
    number, layer = values[:, 3].astype(np.int64), values[:, 4].astype(np.int64)
    starts = np.flatnonzero(np.append(True, number[1:] != number[:-1]))
    if len(np.unique(number[starts])) < len(starts):
        raise InputError(
            f"{name}: the rows of a path must follow each other; those of a path are apart: sort "
            "the table by path"
        )
    offsets = np.append(starts, len(values))
    if (np.diff(offsets) < 2).any():
        lonely = number[starts[np.diff(offsets) < 2][0]]
        raise InputError(f"{name}: path {lonely} has one point; a path needs two: remove it")
    if (np.repeat(layer[starts], np.diff(offsets)) != layer).any():
        raise InputError(f"{name}: a path lies on one layer; one changes it: cut it there")
    points = values[:, :3]
    check_near(points, name)
    first, last = offsets[:-1], offsets[1:] - 1
    closed = (np.linalg.norm(points[first] - points[last], axis=1) <= CLOSED) & (
        np.diff(offsets) > 3
    )
    points[last[closed]] = points[first[closed]]
    return Toolpaths(
        points @ axes,
        np.broadcast_to(normal, points.shape),
        offsets,
        layer[starts],
        np.full(len(starts), FIBRE),
        closed,
    )


def read_strands(path: str | Path, axes: FloatArray, normal: FloatArray) -> Toolpaths:
    """Read strands of a layer from a file, or of all layers from a folder (`read_strand_files`).

    Which layer a strand lies on is found by its place.
    """
    of_layers = read_strand_files(path)
    lines = [line for layer in of_layers for line in layer]
    if not lines:
        return Toolpaths.empty()
    layers = np.repeat(np.arange(len(of_layers)), [len(layer) for layer in of_layers])
    check_near(np.concatenate(lines), str(path))
    closed = close_rings(lines)
    points, offsets = pack(lines)
    normals = np.broadcast_to(normal, points.shape)
    kind = np.full(len(lines), FIBRE)
    return Toolpaths(points @ axes, normals, offsets, layers, kind, np.array(closed))
