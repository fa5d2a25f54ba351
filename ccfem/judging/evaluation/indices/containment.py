"""Fibre outside the layer."""

from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.shapes import TOLERANCE, Region, Shapes
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, PlanePaths

PLACE = 100
"""Of these columns in tables: the smaller, the farther to the left."""

BY_PATHS = True
"""Equal paths in equal sections have the same samples."""


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
)


@dataclass(frozen=True)
class ContainmentSamples:
    """Length of fibre outside the section of a layer, and its largest distance, (1,) each, mm."""

    length: FloatArray
    depth: FloatArray


def sample_containment(paths: PlanePaths) -> ContainmentSamples:
    """Compare the fibre axis of a layer, without its width and links, with the layer's polygon."""
    section = paths.layer.plane.polygon
    paths = paths.strands
    if not len(paths):
        return ContainmentSamples(np.zeros(1), np.zeros(1))
    grown = section.buffer(TOLERANCE, quad_segs=2)
    shapely.prepare(grown)
    index = np.repeat(np.arange(len(paths)), np.diff(paths.offsets))
    lines = shapely.linestrings(paths.points, indices=index)
    # Segment by segment: the difference of a whole path would merge parts that lie on each other.
    steps = np.stack(segments(lines[~shapely.covers(grown, lines)]), axis=1)
    pieces = shapely.linestrings(steps) if len(steps) else np.zeros(0, dtype=object)
    outside = shapely.difference(pieces[~shapely.covers(grown, pieces)], grown)
    length = float(shapely.length(outside).sum())
    return ContainmentSamples(np.array([length]), np.array([_depth(outside, section)]))


def _depth(lines: Shapes, section: Region) -> float:
    """Largest distance from a polygon to lines outside it, by bisection.

    Along a straight piece the distance from one edge of the polygon is convex. The larger of its
    values at both ends is therefore a bound for the piece; the edge nearest to the middle is used.
    Pieces that cannot exceed the largest distance found are dropped, the others halved.
    """
    a, b = segments(lines)
    if not len(a):
        return 0.0
    start, end = segments(shapely.boundary(section))
    tree = shapely.STRtree(shapely.linestrings(np.stack([start, end], axis=1)))
    best = 0.0
    while len(a):
        middle = 0.5 * (a + b)
        edge = tree.nearest(shapely.points(middle))
        near, far = start[edge], end[edge]
        best = max(best, float(to_edges(middle, near, far).max()))
        bound = np.maximum(to_edges(a, near, far), to_edges(b, near, far))
        left = bound > best + TOLERANCE
        a, b = (np.concatenate([a[left], middle[left]]), np.concatenate([middle[left], b[left]]))
    return best


def segments(lines: shapely.Geometry | Shapes) -> tuple[FloatArray, FloatArray]:
    """First and last points, (s, 2) each, of all segments of lines, one after the other."""
    points, index = shapely.get_coordinates(shapely.get_parts(lines), return_index=True)
    same = index[1:] == index[:-1]
    return points[:-1][same], points[1:][same]


def to_edges(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance of each point (s, 2) from its own edge."""
    along, to = end - start, points - start
    square = np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
    share = np.einsum("ij,ij->i", to, along) / square
    return np.hypot(*(to - np.clip(share, 0.0, 1.0)[:, None] * along).T)


def containment_indices(samples: ContainmentSamples, _: Basis | None = None) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    return {
        "outside_length": float(samples.length.sum()),
        "outside_depth": float(samples.depth.max()) if len(samples.depth) else 0.0,
    }


def sample(paths: LayerPaths) -> ContainmentSamples:
    """Take the samples of one layer."""
    return sample_containment(paths.plane)


indices = containment_indices
