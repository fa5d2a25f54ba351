"""How sharply the fibre turns: curvature by arc length, and kinks."""

from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.evaluate.column import Column
from ccfem.evaluate.plane_paths import PlanePaths
from ccfem.geometry.polylines import resample, turning_angles
from ccfem.machine import Machine

__all__ = ["COLUMNS", "CurvatureSamples", "curvature_indices", "sample_curvature"]

_FORMULA = (
    "of the curvature over the fibre's length: every path is resampled in equal steps h of about "
    "one fibre width of arc length, and the curvature at a resampled point is the angle between "
    "the chords before and behind it, over h."
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
        "turns_45",
        "1/m",
        "Points of the paths as planned, not resampled, at which they turn by more than 45 "
        "degrees, per metre of fibre.",
        ">= 0; NaN without fibre",
    ),
    Column(
        "turns_90",
        "1/m",
        "The same for more than 90 degrees.",
        ">= 0; NaN without fibre",
    ),
)


@dataclass(frozen=True)
class CurvatureSamples:
    """Curvature (s,), 1/mm, native turning angles (v,), radians, and fibre length (1,), mm."""

    curvature: FloatArray
    turns: FloatArray
    length: FloatArray


def sample_curvature(paths: PlanePaths, step: float) -> CurvatureSamples:
    """Curvature of the paths of a layer.

    Parameters
    ----------
    paths : PlanePaths
    step : float, mm
        Wanted step h of the resampling; a path of length L gets ``max(1, round(L / h))`` equal
        steps. On a circle of radius R the samples are 1 / R. Closed paths are also sampled where
        they close; the ends of open paths have no curvature.

    Notes
    -----
    Curvature from the planned points themselves would depend on how densely they lie.
    """
    points, offsets = resample(paths.points, paths.offsets, step)
    angle = turning_angles(points, offsets, paths.closed)
    inner = np.ones(len(points), dtype=bool)
    inner[offsets[:-1]] = paths.closed
    inner[offsets[1:] - 1] = False
    size = np.repeat(paths.lengths, np.diff(offsets)) / np.repeat(
        np.maximum(np.diff(offsets) - 1, 1), np.diff(offsets)
    )
    return CurvatureSamples(
        (angle / size)[inner],
        turning_angles(paths.points, paths.offsets, paths.closed),
        np.array([paths.lengths.sum()]),
    )


def curvature_indices(samples: CurvatureSamples, machine: Machine) -> dict[str, float]:
    """Values of `COLUMNS`."""
    curvature, metres = samples.curvature, float(samples.length.sum()) / 1000.0
    none = not len(curvature)
    shares = [0.5, 0.8, 0.95, 1.0]
    quantiles = [np.nan] * 4 if none else np.quantile(curvature, shares, method="inverted_cdf")
    ok = np.nan if none else float((curvature * machine.minimum_radius < 1.0).mean())
    values = {
        f"curvature_{name}": float(value)
        for name, value in zip(("50", "80", "95", "max"), quantiles, strict=True)
    }
    values["curvature_ok"] = ok
    for degrees in (45, 90):
        count = float((samples.turns > np.radians(degrees) + 1e-9).sum())
        values[f"turns_{degrees}"] = count / metres if metres > 0.0 else np.nan
    return values
