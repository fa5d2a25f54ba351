"""How far neighbouring strands lie apart."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.geometry.locate import Buckets, bucket
from ccfem.geometry.polylines import arc_lengths, sample_midpoints, starts_segment, subdivide
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, PlanePaths
from ccfem.machine.machine import Machine

PLACE = 70
"""Of these columns in tables: the smaller, the farther to the left."""

BY_PATHS = True
"""Equal paths in equal sections have the same samples."""

LARGE = True
"""Its samples take megabytes a layer."""

ON_SOME_LAYERS = True
"""Of a stack of many layers some are enough."""


_FORMULA = (
    "of the distance from the fibre (without links outside the section or over a void), sampled "
    "every fifth of a fibre width, to the nearest point "
    "(exactly, not only to sampled points) of another path of the layer, or of the same path at "
    "an arc distance of at least five fibre widths. Distances above five fibre widths count as "
    "that."
)
_RANGE = "0 to 5 fibre widths; NaN without fibre"

COLUMNS = (
    Column("spacing_1", "mm", f"1st percentile {_FORMULA}", _RANGE),
    Column("spacing_5", "mm", f"5th percentile {_FORMULA}", _RANGE),
    Column("spacing_50", "mm", f"Median {_FORMULA}", _RANGE),
    Column(
        "spacing_below",
        "1",
        "Share of the fibre's length whose neighbour (see spacing_1) is nearer than 0.99 fibre "
        "widths: paths are laid to 0.005 of them.",
        "0 to 1, 0 is best; NaN without fibre",
    ),
)

_ROUNDING = 0.01
"""Share of the fibre width by which strands may be nearer than it and still keep their distance:
two paths in even steps each lie within 0.005 widths of where they were planned."""


@dataclass(frozen=True)
class SpacingSamples:
    """Distance to the neighbouring strand, (s,), mm, and the length it stands for, (s,), mm."""

    distance: FloatArray
    length: FloatArray


def sample_spacing(paths: PlanePaths, width: float) -> SpacingSamples:
    """Distance from the fibre of a layer to its neighbours.

    Parameters
    ----------
    width : float, mm
        Fibre width W. Samples lie 0.2 W apart. A path is its own neighbour from 5 W of arc on
        (round a closed path the shorter way). The search ends at 5 W: a lone strand has the spacing
        5 W, and so has a straight one, whose own points are at least that far away.
    """
    paths = paths.in_part
    if not len(paths):
        return SpacingSamples(np.zeros(0), np.zeros(0))
    reach = 5.0 * width
    points, _, length, line = sample_midpoints(paths.points, paths.offsets, 0.2 * width)
    first = np.searchsorted(line, line, side="left")
    position = (np.arange(len(line)) - first + 0.5) * length
    pieces, offsets, _ = subdivide(paths.points, paths.offsets, width)
    start = np.flatnonzero(starts_segment(offsets))
    ends = np.stack([pieces[start], pieces[start + 1]], axis=1)
    along = arc_lengths(pieces, offsets)
    owner = np.repeat(np.arange(len(paths)), np.diff(offsets))[start]
    grid = bucket(ends.min(axis=1), ends.max(axis=1), width)
    period = np.where(paths.closed, paths.lengths, np.inf)
    strands = _Pieces(grid, ends, along[start], along[start + 1], owner, period)
    distance = np.empty(len(points))
    _nearest(strands, points, line, position, reach, distance)
    return SpacingSamples(distance, length)


class _Pieces(NamedTuple):
    """Pieces of paths to be near to.

    `grid` of the pieces; their `ends` (k, 2, 2), mm; the arc length of their path at the first end,
    `along` (k,), and at the second, `along_end` (k,); the path of each, `owner` (k,); and the
    `period` of the paths (n,): their length where they are closed, else infinite.
    """

    grid: Buckets
    ends: FloatArray
    along: FloatArray
    along_end: FloatArray
    owner: IntArray
    period: FloatArray


@compiled
def _nearest(
    pieces: _Pieces,
    points: FloatArray,
    line: IntArray,
    position: FloatArray,
    reach: float,
    distance: FloatArray,
) -> None:
    """Write the `distance` (s,) from each sample to the nearest piece, at most `reach`.

    `points` (s, 2), `line` and `position` (s,) are the places of the samples, their paths and the
    arc lengths there. Pieces of their own paths count from `reach` of arc on.
    """
    grid, ends, along, along_end, owner, period = pieces
    origin, cell, shape, starts, items = grid
    for q in range(len(points)):
        x, y = points[q, 0], points[q, 1]
        ci, cj = int(np.floor((x - origin[0]) / cell)), int(np.floor((y - origin[1]) / cell))
        best = reach * reach
        ring = 0
        # Every piece in a ring of cells is at least (ring - 1) cells away.
        while ring < 1 or (ring - 1) * cell * (ring - 1) * cell < best:
            for i in range(max(ci - ring, 0), min(ci + ring, shape[0] - 1) + 1):
                step = 1 if abs(i - ci) == ring else max(2 * ring, 1)
                for j in range(cj - ring, cj + ring + 1, step):
                    if j < 0 or j >= shape[1]:
                        continue
                    for item in range(starts[i * shape[1] + j], starts[i * shape[1] + j + 1]):
                        k = items[item]
                        low, high = 0.0, 1.0
                        if owner[k] == line[q]:
                            apart, size = along[k] - position[q], along_end[k] - along[k]
                            low, high = _far_along(apart, size, period[line[q]], reach)
                            if low > high:
                                continue
                        ax, ay = ends[k, 0, 0], ends[k, 0, 1]
                        dx, dy = ends[k, 1, 0] - ax, ends[k, 1, 1] - ay
                        t = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)
                        t = min(max(t, low), high)
                        ex, ey = ax + t * dx - x, ay + t * dy - y
                        best = min(best, ex * ex + ey * ey)
            ring += 1
        distance[q] = np.sqrt(best)


@compiled
def _far_along(apart: float, size: float, period: float, reach: float) -> tuple[float, float]:
    """Shares of a piece between which it is farther than `reach` along its path from a place.

    It begins `apart` beyond the place, and has the length `size`; a closed path has a period.
    """
    low, high = 0.0, 1.0
    if np.isfinite(period):
        apart -= period * np.floor(apart / period)
        low, high = (reach - apart) / size, (period - reach - apart) / size
    elif apart >= 0.0:
        low = (reach - apart) / size
    else:
        high = (-reach - apart) / size
    return max(low, 0.0), min(high, 1.0)


def spacing_indices(samples: SpacingSamples, machine: Machine) -> dict[str, float]:
    """Values of `COLUMNS`."""
    distance = samples.distance
    if not len(distance):
        return {column.name: float("nan") for column in COLUMNS}
    quantiles = np.quantile(distance, [0.01, 0.05, 0.5], method="inverted_cdf")
    near = distance < machine.fibre_width * (1.0 - _ROUNDING)
    return {
        "spacing_1": float(quantiles[0]),
        "spacing_5": float(quantiles[1]),
        "spacing_50": float(quantiles[2]),
        "spacing_below": float(samples.length[near].sum() / samples.length.sum()),
    }


def sample(paths: LayerPaths) -> SpacingSamples:
    """Take the samples of one layer."""
    return sample_spacing(paths.plane, paths.machine.fibre_width)


def indices(samples: SpacingSamples, basis: Basis) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    return spacing_indices(samples, basis.machine)
