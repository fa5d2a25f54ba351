"""How sharply the fibre turns: curvature by arc length, and kinks."""

from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import arc_lengths, curvature_samples, inner_points, turning_angles
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, LayerSamples, PlanePaths
from ccfem.machine.machine import Machine

PLACE = 30
"""Of these columns in tables: the smaller, the farther to the left."""

BY_PATHS = True
"""Equal paths in equal sections have the same samples."""


_TURNS = (45, 90)
"""Turns, degrees, that are counted."""

_SIMPLIFY = 0.02
"""Tolerance, in resampling steps, of the simplification before vertices are counted. It removes
points on straight stretches, which are no turns of the planner."""

_FORMULA = (
    "of the curvature over the fibre's length: every path is resampled in equal steps h of about "
    "one fibre width of arc length, and the curvature at a resampled point is the angle between "
    "the chords before and behind it, over h. Links outside the section or over a void are left "
    "out."
)
_RANGE = ">= 0, at most pi / h; NaN where no path has three resampled points"

COLUMNS = (
    Column("curvature_50", "1/mm", f"Median {_FORMULA}", _RANGE),
    Column("curvature_80", "1/mm", f"80th percentile {_FORMULA}", _RANGE),
    Column("curvature_95", "1/mm", f"95th percentile {_FORMULA}", _RANGE),
    Column("curvature_max", "1/mm", f"Maximum {_FORMULA}", _RANGE),
    Column(
        "curvature_ok",
        "1",
        "Share of the curvature samples below 1 / the machine's minimum radius (0.26 1/mm for "
        "3.85 mm).",
        "0 to 1, 1 is best; NaN where no path has three resampled points",
    ),
    Column(
        "curvature_ok_native",
        "1",
        "Share of the vertices of the paths as planned, simplified by Douglas and Peucker to a "
        "fiftieth of a fibre width, at which the curvature is below 1 / the machine's minimum "
        "radius: 2 sin(a / 2) over the mean length of the two steps between which the path turns "
        "by a, of each of which no more than a fibre width counts. Links outside the section or "
        "over a void are left out. It weighs tight turns more than curvature_ok does, for they "
        "have more vertices (Wang et al. 2021 count points).",
        "0 to 1, 1 is best; NaN where no path has an inner vertex",
    ),
    Column(
        "turns_45",
        "1/m",
        "Points of the paths as planned, not resampled, at which they turn by more than 45 "
        "degrees, per metre of fibre, links included.",
        ">= 0; NaN without fibre",
    ),
    Column("turns_90", "1/m", "The same for more than 90 degrees.", ">= 0; NaN without fibre"),
)


@dataclass(frozen=True)
class CurvatureSamples(LayerSamples):
    """Curvature along the fibre of a layer."""

    curvature: FloatArray  # (s,), 1/mm: at points equally far apart
    native: FloatArray  # (n,), 1/mm: at the vertices of the simplified paths
    # (v,), radians: turning angles at the vertices as planned, those above 45 degrees
    turns: FloatArray
    length: FloatArray  # (1,), mm: of the fibre


def sample_curvature(paths: PlanePaths, step: float) -> CurvatureSamples:
    """Curvature of the paths of a layer.

    Parameters
    ----------
    step : float, mm
        Wanted step h of the resampling; a path of length L gets ``max(1, round(L / h))`` equal
        steps. On a circle of radius R the samples are 1 / R. Closed paths are also sampled where
        they close; the ends of open paths have no curvature. The vertices as planned are first
        simplified to a fiftieth of this.

    Notes
    -----
    Curvature from the planned points themselves would depend on how densely they lie.
    """
    lines = paths.in_part
    turns = turning_angles(paths.points, paths.offsets, paths.closed)
    return CurvatureSamples(
        curvature_samples(lines.points, lines.offsets, lines.closed, step),
        _native(lines, step),
        turns[turns > np.radians(_TURNS[0])],
        np.array([paths.lengths.sum()]),
    )


def _native(paths: PlanePaths, longest: float) -> FloatArray:
    """Curvature at the inner vertices of simplified paths, 1/mm.

    ``2 sin(a / 2) / h`` (Wang et al. 2021) is the curvature of the circle through three vertices
    that lie equally far apart. Steps count up to `longest`, so that a corner between long straight
    lines still counts as one; arcs with a radius of up to six times `longest` have shorter steps.
    """
    if not len(paths):
        return np.zeros(0)
    index = np.repeat(np.arange(len(paths)), np.diff(paths.offsets))
    lines = shapely.linestrings(paths.points, indices=index)
    simple = shapely.simplify(lines, _SIMPLIFY * longest, preserve_topology=False)
    points = shapely.get_coordinates(simple)
    offsets = np.concatenate([[0], np.cumsum(shapely.get_num_coordinates(simple))])
    along = arc_lengths(points, offsets)
    before = np.minimum(along - np.roll(along, 1), longest)
    after = np.roll(before, -1)
    first, last = offsets[:-1], offsets[1:] - 1
    before[first] = before[last]
    inner = inner_points(offsets, paths.closed)
    step = 0.5 * (before + after)[inner]
    angle = turning_angles(points, offsets, paths.closed)[inner]
    return 2.0 * np.sin(0.5 * angle[step > 0.0]) / step[step > 0.0]


def curvature_indices(samples: CurvatureSamples, machine: Machine) -> dict[str, float]:
    """Values of `COLUMNS`."""
    curvature, metres = samples.curvature, float(samples.length.sum()) / 1000.0
    none = not len(curvature)
    shares = [0.5, 0.8, 0.95, 1.0]
    quantiles = [np.nan] * 4 if none else np.quantile(curvature, shares, method="inverted_cdf")
    values = {
        f"curvature_{name}": float(value)
        for name, value in zip(("50", "80", "95", "max"), quantiles, strict=True)
    }
    for name, bend in (("", curvature), ("_native", samples.native)):
        ok = bend * machine.minimum_radius < 1.0
        values[f"curvature_ok{name}"] = float(ok.mean()) if len(ok) else np.nan
    for degrees in _TURNS:
        count = float((samples.turns > np.radians(degrees) + 1e-9).sum())
        values[f"turns_{degrees}"] = count / metres if metres > 0.0 else np.nan
    return values


def sample(paths: LayerPaths) -> CurvatureSamples:
    """Take the samples of one layer."""
    return sample_curvature(paths.plane, paths.machine.fibre_width)


def indices(samples: CurvatureSamples, basis: Basis) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    return curvature_indices(samples, basis.machine)
