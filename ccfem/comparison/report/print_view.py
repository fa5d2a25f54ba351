"""The whole print as the report draws it: matrix, fibre and travel of every layer, in space."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.comparison.report.packing import Rounded
from ccfem.comparison.runs import Printed
from ccfem.printing.export.thumbnail import LINE_COLOURS
from ccfem.printing.moves import LAY, ROLES, TRAVEL, Moves, is_any

KINDS = ("contour", "matrix", "fibre", "support and pads", "beside the part", "travel")
"""What the lines of a print are drawn as."""
COLOURS = (*LINE_COLOURS, "#cfd8c8", "#b3261e")
"""Colour of each of them."""
FILLS, BESIDE, MOVES = 1, 4, 5
"""Kinds whose lines are not always drawn: what fills a layer, what is beside the part, travel."""

_KIND_OF = {
    "travel": 5,
    "contour": 0,
    "infill": 1,
    "fibre": 2,
    "tail": 2,
    "block": 4,
    "skirt": 4,
    "pad": 3,
    "short": 1,
    "sparse": 1,
}
"""Place in `KINDS` of each role of a line."""

_ROWS = 1_500_000
"""Moves of a print above which some of its layers are drawn."""
_POINTS = 250_000
"""Points of all layers above which lines are drawn more coarsely, and some layers not at all."""
_COARSE = (0.03, 0.1, 0.3)
"""Distance from its line by which a point is left out, mm: the first that is coarse enough."""
_STEP = 0.01
"""What coordinates are rounded to, mm."""


def print_views(runs: Sequence[Printed]) -> dict[str, Any]:
    """Lines of the print of each run that has one, layer by layer.

    Returns
    -------
    dict
        ``kinds``, names, their ``colours``, and ``runs``, each with its ``name``, the ``count`` of
        its layers, and the ``layers`` that are drawn: ``index``, ``top`` in mm, ``points``,
        ``offsets`` of lines in these and ``kind`` of each line.
    """
    return {
        "kinds": list(KINDS),
        "colours": list(COLOURS),
        "runs": [
            {"name": run.name, **_drawn(run.moves, run.print_plan.top)}
            for run in runs
            if run.moves is not None and run.print_plan is not None
        ],
    }


def _drawn(moves: Moves, top: FloatArray) -> dict[str, Any]:
    """Layers of one print."""
    moving = is_any(moves.event, LAY, TRAVEL)
    bounds = np.searchsorted(moves.layer, np.arange(len(top) + 1))
    chosen = _spread(len(top), int(np.count_nonzero(moving)), _ROWS)
    rows = {k: bounds[k] + np.flatnonzero(moving[bounds[k] : bounds[k + 1]]) for k in chosen}
    for tolerance in _COARSE:
        layers = {k: _lines(moves, rows[k], tolerance) for k in chosen}
        count = sum(len(points) for points, _, _ in layers.values())
        if count <= _POINTS:
            break
    kept = chosen[_spread(len(chosen), count, _POINTS)]
    return {
        "count": len(top),
        "layers": [
            {
                "index": int(k),
                "top": float(top[k]),
                "points": Rounded(layers[k][0], _STEP),
                "offsets": layers[k][1],
                "kind": layers[k][2],
            }
            for k in kept
            if len(layers[k][0])
        ],
    }


def _spread(layers: int, size: int, most: int) -> IntArray:
    """Layers, evenly spread with the first and the last, whose share of a size is affordable."""
    count = layers if size <= most else max(2, layers * most // size)
    return np.unique(np.linspace(0, layers - 1, count).round().astype(int))


def _lines(
    moves: Moves, rows: IntArray, tolerance: float
) -> tuple[FloatArray, IntArray, NDArray[np.uint8]]:
    """Points (n, 3), offsets and kinds of the lines of one layer, each from where it starts."""
    if not len(rows):
        return np.zeros((0, 3)), np.zeros(1, dtype=int), np.zeros(0, dtype=np.uint8)
    kind = np.array([_KIND_OF[name] for name in ROLES], dtype=np.uint8)[moves.role[rows]]
    kind[moves.event[rows] == TRAVEL] = len(KINDS) - 1
    first = np.ones(len(rows), dtype=bool)
    first[1:] = (kind[1:] != kind[:-1]) | (np.diff(rows) > 1)
    # Each line begins where the nozzle was before its first row.
    line = np.cumsum(first) - 1
    starts = np.flatnonzero(first)
    before = moves.place[np.maximum(rows[starts] - 1, 0)]
    points = np.insert(moves.place[rows], starts, before, axis=0)
    drawn = shapely.linestrings(points, indices=np.insert(line, starts, np.arange(len(starts))))
    printed = kind[starts] != len(KINDS) - 1
    heights = moves.place[rows[kind != len(KINDS) - 1], 2]
    if len(heights) and np.ptp(heights) < _STEP:  # seen from above nothing is lost
        drawn[printed] = shapely.simplify(drawn[printed], tolerance, preserve_topology=False)
    thinned, owner = shapely.get_coordinates(drawn, include_z=True, return_index=True)
    offsets = np.searchsorted(owner, np.arange(len(starts) + 1))
    return thinned, offsets, kind[starts]
