"""Fibre outside the layer."""

from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import sample_midpoints
from ccfem.geometry.shapes import INSIDE, TOLERANCE, Region, Shapes, section_places
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, PlanePaths

PLACE = 100
"""Of these columns in tables: the smaller, the farther to the left."""


COLUMNS = (
    Column(
        "outside_length",
        "mm",
        f"Length of fibre axis more than {TOLERANCE:g} mm outside the section of its layer, links "
        "left out: see link_outside and link_over_void.",
        ">= 0, 0 is best",
    ),
    Column(
        "outside_depth",
        "mm",
        "Largest distance of a point of the fibre's axis, links left out, from the section of its "
        "layer, to 0.0001 mm; 0 where outside_length is 0.",
        ">= 0, 0 is best",
    ),
    *(
        Column(
            f"border_{share}",
            "mm",
            f"Distance from the border of the section that {100 - share} % of the length of the "
            "fibre's axis in the section, links included, exceeds (sampled every fibre width).",
            ">= 0; NaN without fibre",
        )
        for share in (1, 50)
    ),
)


_SHARES = np.array([0.01, 0.5]) * (1.0 - 1e-9)
"""Shares of `border_1` and `border_50`, slightly reduced: ties go to the smaller distance."""


@dataclass(frozen=True)
class ContainmentSamples:
    """Fibre outside the section of a layer, and distances from its border, mm.

    Attributes
    ----------
    length, depth : (1,) arrays
        Length outside, and largest distance outside.
    border, step : (s,) arrays
        Distance of samples in the section from its border, and the length that each stands for.
    """

    length: FloatArray
    depth: FloatArray
    border: FloatArray
    step: FloatArray


def sample_containment(paths: PlanePaths, step: float = 1.0) -> ContainmentSamples:
    """Compare the fibre axis of a layer, without its width, with the polygon of the layer.

    Links count for the distances from the border only.

    Parameters
    ----------
    step : float, mm
        Distance of the samples along the fibre.
    """
    section = paths.layer.plane.polygon
    border = _border(paths.in_part, section, step)
    paths = paths.strands
    if not len(paths):
        return ContainmentSamples(np.zeros(1), np.zeros(1), *border)
    grown = section.buffer(TOLERANCE, quad_segs=2)
    shapely.prepare(grown)
    index = np.repeat(np.arange(len(paths)), np.diff(paths.offsets))
    lines = shapely.linestrings(paths.points, indices=index)
    # Segment by segment: the difference of a whole path would merge parts that lie on each other.
    segments = np.stack(_segments(lines[~shapely.covers(grown, lines)]), axis=1)
    pieces = shapely.linestrings(segments) if len(segments) else np.zeros(0, dtype=object)
    outside = shapely.difference(pieces[~shapely.covers(grown, pieces)], grown)
    length = float(shapely.length(outside).sum())
    return ContainmentSamples(np.array([length]), np.array([_depth(outside, section)]), *border)


def _border(paths: PlanePaths, section: Region, step: float) -> tuple[FloatArray, FloatArray]:
    """Distance of samples in the section from its border, and their lengths, mm."""
    points, _, length, _ = sample_midpoints(paths.points, paths.offsets, step)
    inside = section_places(points, section) == INSIDE
    points, length = points[inside], length[inside]
    if not len(points):
        return np.zeros(0), np.zeros(0)
    start, end = _segments(shapely.boundary(section))
    tree = shapely.STRtree(shapely.linestrings(np.stack([start, end], axis=1)))
    edge = tree.nearest(shapely.points(points))
    return _to_edges(points, start[edge], end[edge]), length


def _depth(lines: Shapes, section: Region) -> float:
    """Largest distance from a polygon to lines outside it, by bisection.

    Along a straight piece the distance from one edge of the polygon is convex. The larger of its
    values at both ends is therefore a bound for the piece; the edge nearest to the middle is used.
    Pieces that cannot exceed the largest distance found are dropped, the others halved.
    """
    a, b = _segments(lines)
    if not len(a):
        return 0.0
    start, end = _segments(shapely.boundary(section))
    tree = shapely.STRtree(shapely.linestrings(np.stack([start, end], axis=1)))
    best = 0.0
    while len(a):
        middle = 0.5 * (a + b)
        edge = tree.nearest(shapely.points(middle))
        near, far = start[edge], end[edge]
        best = max(best, float(_to_edges(middle, near, far).max()))
        bound = np.maximum(_to_edges(a, near, far), _to_edges(b, near, far))
        left = bound > best + TOLERANCE
        a, b = (
            np.concatenate([a[left], middle[left]]),
            np.concatenate([middle[left], b[left]]),
        )
    return best


def _segments(lines: shapely.Geometry | Shapes) -> tuple[FloatArray, FloatArray]:
    """First and last points, (s, 2) each, of all segments of lines."""
    points, index = shapely.get_coordinates(shapely.get_parts(lines), return_index=True)
    same = index[1:] == index[:-1]
    return points[:-1][same], points[1:][same]


def _to_edges(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance of each point (s, 2) from its own edge."""
    along, to = end - start, points - start
    square = np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
    share = np.einsum("ij,ij->i", to, along) / square
    return np.hypot(*(to - np.clip(share, 0.0, 1.0)[:, None] * along).T)


def containment_indices(samples: ContainmentSamples) -> dict[str, float]:
    """Values of `COLUMNS`."""
    return {
        "outside_length": float(samples.length.sum()),
        "outside_depth": float(samples.depth.max()) if len(samples.depth) else 0.0,
        **_border_indices(samples),
    }


def _border_indices(samples: ContainmentSamples) -> dict[str, float]:
    if not samples.step.sum() > 0.0:
        return dict.fromkeys(("border_1", "border_50"), float("nan"))
    quantiles = np.quantile(samples.border, _SHARES, weights=samples.step, method="inverted_cdf")
    return dict(zip(("border_1", "border_50"), quantiles.tolist(), strict=True))


def sample(paths: LayerPaths) -> ContainmentSamples:
    """Take the samples of one layer."""
    return sample_containment(paths.plane, paths.machine.fibre_width)


def indices(samples: ContainmentSamples, _: Basis) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    return containment_indices(samples)
