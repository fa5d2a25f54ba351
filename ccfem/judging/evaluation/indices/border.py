"""Distance of the fibre from the border of its layer."""

from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import sample_midpoints
from ccfem.geometry.shapes import INSIDE, section_places
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, PlanePaths

PLACE = 105
"""Of these columns in tables: the smaller, the farther to the left."""

BY_PATHS = True
"""Equal paths in equal sections have the same samples."""

ON_SOME_LAYERS = True
"""Of a stack of many layers some are enough."""

COLUMNS = tuple(
    Column(
        f"border_{share}",
        "mm",
        f"Distance from the border of the section that {100 - share} % of the length of the "
        "fibre's axis in the section, links included, exceeds (sampled every fibre width).",
        ">= 0; NaN without fibre",
    )
    for share in (1, 50)
)

_SHARES = np.array([0.01, 0.5]) * (1.0 - 1e-9)
"""Shares of `border_1` and `border_50`, slightly reduced: ties go to the smaller distance."""


@dataclass(frozen=True)
class BorderSamples:
    """Distance (s,) of fibre in the section from its border, and the length it stands for, mm."""

    distance: FloatArray
    length: FloatArray


def sample_border(paths: PlanePaths, step: float = 1.0) -> BorderSamples:
    """Measure how far the fibre axis of a layer, links included, lies within its section.

    Parameters
    ----------
    step : float, mm
        Distance of the samples along the fibre.
    """
    section, lines = paths.layer.plane.polygon, paths.in_part
    points, _, length, _ = sample_midpoints(lines.points, lines.offsets, step)
    inside = section_places(points, section) == INSIDE
    points, length = points[inside], length[inside]
    if not len(points):
        return BorderSamples(np.zeros(0), np.zeros(0))
    border = shapely.boundary(section)
    shapely.prepare(border)
    return BorderSamples(shapely.distance(border, shapely.points(points)), length)


def sample(paths: LayerPaths) -> BorderSamples:
    """Take the samples of one layer."""
    return sample_border(paths.plane, paths.machine.fibre_width)


def indices(samples: BorderSamples, _: Basis) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    names = [column.name for column in COLUMNS]
    if not samples.length.sum() > 0.0:
        return dict.fromkeys(names, float("nan"))
    weights = samples.length
    values = np.quantile(samples.distance, _SHARES, weights=weights, method="inverted_cdf")
    return dict(zip(names, values.tolist(), strict=True))
