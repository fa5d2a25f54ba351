"""Fibre outside the layer."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from ccfem.arrays import FloatArray
from ccfem.evaluate.column import Column
from ccfem.evaluate.plane_paths import PlanePaths

__all__ = ["COLUMNS", "ContainmentSamples", "containment_indices", "sample_containment"]

_TOLERANCE = 1e-4
"""Fibre no further than this, mm, outside the section counts as inside: rounding of coordinates."""

COLUMNS = (
    Column(
        "outside_length",
        "mm",
        f"Length of fibre axis more than {_TOLERANCE:g} mm outside the section of its layer.",
        ">= 0, 0 is best",
    ),
    Column(
        "outside_depth",
        "mm",
        "Largest distance of a point of the fibre's axis from the section of its layer, to 0.0001 "
        "mm; 0 where outside_length is 0.",
        ">= 0, 0 is best",
    ),
)


@dataclass(frozen=True)
class ContainmentSamples:
    """Length outside (1,) and largest distance outside (1,) a layer, mm."""

    length: FloatArray
    depth: FloatArray


def sample_containment(paths: PlanePaths) -> ContainmentSamples:
    """Fibre of a layer that lies outside its polygon (the axis of it, without its width)."""
    if not len(paths):
        return ContainmentSamples(np.zeros(1), np.zeros(1))
    section = paths.layer.polygon
    grown = section.buffer(_TOLERANCE, quad_segs=2)
    shapely.prepare(grown)
    index = np.repeat(np.arange(len(paths)), np.diff(paths.offsets))
    lines = shapely.linestrings(paths.points, indices=index)
    outside = shapely.difference(lines[~shapely.covers(grown, lines)], grown)
    length = float(shapely.length(outside).sum())
    return ContainmentSamples(np.array([length]), np.array([_depth(outside, section)]))


def _depth(lines: Any, section: Any) -> float:
    """Largest distance of lines from a polygon, by bisection.

    The distance from the polygon changes along a line by no more than the way gone, so a piece
    whose middle is at d reaches at most d + half its length; pieces that cannot beat the largest
    distance found are dropped, the others halved.
    """
    points, index = shapely.get_coordinates(shapely.get_parts(lines), return_index=True)
    same = index[1:] == index[:-1]
    a, b = points[:-1][same], points[1:][same]
    if not len(a):
        return 0.0
    shapely.prepare(section)
    best = float(shapely.distance(section, shapely.points(points)).max())
    while len(a):
        middle = 0.5 * (a + b)
        distance = shapely.distance(section, shapely.points(middle))
        best = max(best, float(distance.max()))
        half = 0.5 * np.hypot(*(b - a).T)
        left = distance + half > best + _TOLERANCE
        a, b = (
            np.concatenate([a[left], middle[left]]),
            np.concatenate([middle[left], b[left]]),
        )
    return best


def containment_indices(samples: ContainmentSamples) -> dict[str, float]:
    """Values of `COLUMNS`."""
    return {
        "outside_length": float(samples.length.sum()),
        "outside_depth": float(samples.depth.max()) if len(samples.depth) else 0.0,
    }
