"""How much of the layer the fibre covers, and how much of its stress."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.base.tensor import in_plane
from ccfem.geometry.polylines import starts_segment, subdivide
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, PlanePaths
from ccfem.slicing.layers.layer import LayerStress

PLACE = 90
"""Of these columns in tables: the smaller, the farther to the left."""

LARGE = True
"""Its samples take megabytes a layer."""

ON_SOME_LAYERS = True
"""Of a stack of many layers some are enough."""


_SAMPLES = (
    "the section, sampled on a square grid of a fifth of a fibre width, that lies within half a "
    "fibre width of a fibre path (without links outside the section or over a void)"
)
_RANGE = "0 to 1; NaN for an empty section"
_STRESS = "with S1+ = max(S1, 0), S1 the larger in-plane principal value of the nodal stress"

COLUMNS = (
    Column("coverage", "1", f"Share of the area of {_SAMPLES}.", _RANGE),
    Column(
        "overfill",
        "1",
        "Length of the fibre, without links outside the section or over a void, times the fibre "
        "width, over the area of the section: the coverage if no strands overlapped or lay over "
        "the border.",
        ">= 0; NaN for an empty section",
    ),
    Column(
        "gap_area",
        "mm^2",
        "Area of the section (on the grid of coverage) that no strand covers and none could: it "
        "lies in no disc one fibre width wide that is free of fibre and in the section.",
        ">= 0; 0 is best",
    ),
    Column(
        "coverage_stress",
        "1",
        f"As coverage, the area weighted {_STRESS}.",
        "0 to 1, 1 is best; NaN where there is no tension",
    ),
    *(
        Column(
            f"coverage_quartile_{k}",
            "1",
            f"Coverage of the part of the section whose S1+ lies in its quartile {k} by area "
            "(4 is the highest stress); areas of equal stress at a limit count in full.",
            _RANGE,
        )
        for k in (1, 2, 3, 4)
    ),
    *(
        Column(
            f"coverage_top_{share}",
            "1",
            f"Coverage of the {share} % of the section's area that has the highest S1+; an area "
            "of equal stress at the limit counts in full.",
            "0 to 1, 1 is best; NaN for an empty section",
        )
        for share in (20, 10)
    ),
)

_TIE = 1e-6
"""Stresses that differ by no more than this share of the largest one are equal."""

_HALF = 2
"""Half a fibre width, in steps of the grid, rounded down."""

_MOST = 500_000
"""Grid points of the largest section that a part may have, up to which all are kept."""

_SHIFT = (0.381966, 0.276393)
"""Offset of the grid in cells: irrational, so that strands at round numbers do not end on it."""


@dataclass(frozen=True)
class CoverageSamples:
    """Samples of equal area inside the section, and whole areas of a layer."""

    tension: FloatArray  # (s,), MPa: S1+
    covered: BoolArray  # (s,)
    laid: FloatArray  # (1,), mm^2: length of the fibre times its width
    # (1,), mm^2: of the section, and of its places that are too narrow for a strand
    area: FloatArray
    gap: FloatArray


def sample_coverage(
    paths: PlanePaths, stress: LayerStress, width: float, share: float = 1.0
) -> CoverageSamples:
    """Sample the section of a layer.

    Parameters
    ----------
    stress : LayerStress
        Stress on the same layer; its nodal values are used, interpolated in the triangles.
    width : float, mm
        Fibre width W: the band that a path covers. Grid points lie 0.2 W apart, so that a
        straight strand along an axis of the layer counts with its exact width.
    share : float, default 1
        Of the grid points inside, chosen at random, that are kept; the same for all layers.
    """
    layer, paths = paths.layer, paths.in_part
    step = 0.2 * width
    plane = layer.plane.points
    low, high = plane.min(axis=0), plane.max(axis=0)
    origin = low - step * np.array(_SHIFT)
    shape = np.floor((high - origin) / step).astype(np.int64) + 1
    tension = np.full((shape[0], shape[1]), -1.0)
    _paint_section(
        tension, origin, step, plane, layer.triangles, in_plane(stress.nodal, layer.plane.frame)
    )
    covered = np.zeros(tension.shape, dtype=np.bool_)
    pieces, offsets, _ = subdivide(paths.points, paths.offsets, width)
    first = np.flatnonzero(starts_segment(offsets))
    _paint_paths(covered, origin, step, pieces[first], pieces[first + 1], 0.5 * width)
    inside = tension >= 0.0
    values, under = tension[inside], covered[inside]
    if share < 1.0:
        kept = np.random.default_rng(layer.index).random(len(values)) < share
        values, under = values[kept], under[kept]
    return CoverageSamples(
        values,
        under,
        np.array([width * paths.lengths.sum()]),
        np.array([layer.areas.sum()]),
        np.array([step * step * _gaps(inside & ~covered)]),
    )


def _gaps(free: BoolArray) -> float:
    """Count the grid points that lie in no free disc one fibre width wide."""
    places = np.arange(-_HALF, _HALF + 1)
    disc = np.argwhere(np.hypot(*np.meshgrid(places, places)) <= _HALF + 0.5).tolist()

    def over_disc(values: BoolArray, combine: Callable[..., Any]) -> BoolArray:
        padded, (n, m) = np.pad(values, _HALF), values.shape
        return np.asarray(reduce(combine, (padded[i : i + n, j : j + m] for i, j in disc)))

    opened = over_disc(over_disc(free, np.logical_and), np.logical_or)
    return float(np.count_nonzero(free & ~opened))


@compiled
def _paint_section(
    tension: FloatArray,
    origin: FloatArray,
    step: float,
    points: FloatArray,
    triangles: IntArray,
    stress: FloatArray,
) -> None:
    """Write S1+ at every grid point inside a triangle."""
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        # Grid coordinates of the corners.
        ax, ay = (points[a, 0] - origin[0]) / step, (points[a, 1] - origin[1]) / step
        bx, by = (points[b, 0] - origin[0]) / step - ax, (points[b, 1] - origin[1]) / step - ay
        cx, cy = (points[c, 0] - origin[0]) / step - ax, (points[c, 1] - origin[1]) / step - ay
        det = bx * cy - by * cx
        if det <= 0.0:
            continue
        for i in range(int(np.ceil(ax + min(0.0, bx, cx))), int(ax + max(0.0, bx, cx)) + 1):
            for j in range(int(np.ceil(ay + min(0.0, by, cy))), int(ay + max(0.0, by, cy)) + 1):
                x, y = i - ax, j - ay
                wb, wc = (x * cy - y * cx) / det, (bx * y - by * x) / det
                wa = 1.0 - wb - wc
                if min(wa, wb, wc) < 0.0:
                    continue
                s11 = wa * stress[a, 0] + wb * stress[b, 0] + wc * stress[c, 0]
                s22 = wa * stress[a, 1] + wb * stress[b, 1] + wc * stress[c, 1]
                s12 = wa * stress[a, 2] + wb * stress[b, 2] + wc * stress[c, 2]
                half = 0.5 * (s11 - s22)
                largest = 0.5 * (s11 + s22) + np.sqrt(half * half + s12 * s12)
                tension[i, j] = max(largest, 0.0)


@compiled
def _paint_paths(
    covered: BoolArray,
    origin: FloatArray,
    step: float,
    starts: FloatArray,
    ends: FloatArray,
    radius: float,
) -> None:
    """Mark every grid point nearer than `radius` to a segment."""
    reach = radius / step
    for k in range(len(starts)):
        ax, ay = (starts[k, 0] - origin[0]) / step, (starts[k, 1] - origin[1]) / step
        dx, dy = (ends[k, 0] - origin[0]) / step - ax, (ends[k, 1] - origin[1]) / step - ay
        square = dx * dx + dy * dy
        if square == 0.0:
            continue
        i0, i1 = max(int(ax + min(0.0, dx) - reach), 0), int(ax + max(0.0, dx) + reach) + 1
        j0, j1 = max(int(ay + min(0.0, dy) - reach), 0), int(ay + max(0.0, dy) + reach) + 1
        for i in range(i0, min(i1, covered.shape[0])):
            for j in range(j0, min(j1, covered.shape[1])):
                x, y = i - ax, j - ay
                t = min(max((x * dx + y * dy) / square, 0.0), 1.0)
                x, y = x - t * dx, y - t * dy
                if x * x + y * y < reach * reach:
                    covered[i, j] = True


def coverage_indices(samples: CoverageSamples, sampled: float = 1.0) -> dict[str, float]:
    """Values of `COLUMNS`, from samples of this share of the layers' area."""
    tension, covered = samples.tension, samples.covered
    if not len(tension):
        return {column.name: float("nan") for column in COLUMNS}
    total = float(tension.sum())
    limits = np.quantile(tension, [0.0, 0.25, 0.5, 0.75, 0.8, 0.9, 1.0])
    tie = _TIE * float(limits[-1])

    def share(low: float, high: float) -> float:
        return float(covered[(tension >= low - tie) & (tension <= high + tie)].mean())

    values = {
        "coverage": float(covered.mean()),
        "overfill": float(samples.laid.sum() / samples.area.sum()),
        "gap_area": float(samples.gap.sum()) / sampled,
        "coverage_stress": float(tension[covered].sum()) / total if total > 0.0 else float("nan"),
    }
    quartiles = [*limits[:4], limits[-1]]
    for k in range(4):
        values[f"coverage_quartile_{k + 1}"] = share(quartiles[k], quartiles[k + 1])
    values["coverage_top_20"] = share(limits[4], limits[-1])
    values["coverage_top_10"] = share(limits[5], limits[-1])
    return values


def sample(paths: LayerPaths) -> CoverageSamples:
    """Take the samples of one layer."""
    width = paths.machine.fibre_width
    longest = np.sort(np.ptp(paths.stress.mesh.bounds, axis=0))[1:]
    share = min(1.0, _MOST * (0.2 * width) ** 2 / float(longest.prod()))
    return sample_coverage(paths.plane, paths.layer_stress, width, share)


def indices(samples: CoverageSamples, basis: Basis) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    return coverage_indices(samples, basis.sampled)
