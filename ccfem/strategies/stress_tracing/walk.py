"""Main load paths as traced in the paper: a greedy walk over the points of the medial axis.

It serves for comparison. The walk skips joints and leaves stray points, which break up main paths;
`main_paths` evaluates the same criterion at the joints instead.
"""

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.medial_axis import medial_axis
from ccfem.geometry.polylines import inner_points, pack, resample
from ccfem.geometry.shapes import Region
from ccfem.slicing.layers.layer_stress import LayerStress
from ccfem.strategies.stress_tracing.criterion import Criterion
from ccfem.strategies.stress_tracing.frame import ARC_CHORD
from ccfem.strategies.stress_tracing.stress_lines import misalignment, plane_stress_at, stress_lines

_LEAST_POINTS = 3
_STEP = 1.0
"""Distance, mm, of the points of the axis."""
_RULE = Criterion(90.0, 45.0, 3.0 * _STEP)


def walk(section: Region, stress: LayerStress, sampling: float) -> list[FloatArray]:
    """Trace load paths over the points of the medial axis.

    The walk starts at an end of the axis under the largest stress, or else at the point under the
    largest stress. The next point is always the one of least smoothness value, within 90 degrees of
    turn, 45 degrees of misalignment and 3 mm, without leaving the section. The walk ends if there
    is none, and new ones start until no point is left. Joints may be passed once per two members.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    stress : LayerStress
    sampling : float, mm
        Largest distance of the samples along the border.

    Returns
    -------
    list of (n, 2) arrays, mm
        Those of at least three points, 1 mm apart.
    """
    points, uses, ends = _points(section, sampling)
    if len(points) < _LEAST_POINTS:
        return []
    shapely.prepare(section)
    tree, plane_stress, left = cKDTree(points), plane_stress_at(stress, points, _STEP), uses.copy()
    size = np.abs(stress_lines(plane_stress).value)

    def followed(path: list[int]) -> list[int]:
        """Path continued from its last point until no point is left within the limits."""
        while True:
            near = np.array(tree.query_ball_point(points[path[-1]], _RULE.distance))
            near = near[(left[near] > 0) & ~np.isin(near, path)]
            following = _next(path, near, points, plane_stress, section)
            if following is None:
                return path
            left[following] -= 1
            path = [*path, following]

    paths = []
    while (left > 0).any():
        fresh_ends = (left == uses) & ends
        first = np.flatnonzero(fresh_ends if fresh_ends.any() else left > 0)
        start = int(first[np.argmax(size[first])])
        left[start] -= 1
        path = followed([start])
        if not ends[start]:
            path = followed(path[::-1])
        if len(path) >= _LEAST_POINTS:
            paths.append(points[path])
    return paths


def _points(section: Region, sampling: float) -> tuple[FloatArray, IntArray, BoolArray]:
    """Points (n, 2) of the axis, how often each may be passed, and which are ends."""
    axis = medial_axis(section, sampling, object_angle=None, arc_chord=ARC_CHORD)
    if not axis.segments:
        return np.zeros((0, 2)), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool)
    lines, offsets = resample(*pack([segment.points for segment in axis.segments]), _STEP)
    inner = inner_points(offsets, np.array([segment.ends[0] < 0 for segment in axis.segments]))
    ends = [end for segment in axis.segments for end in segment.ends if end >= 0]
    degree = np.bincount(np.array(ends, dtype=np.int64), minlength=len(axis.nodes))
    nodes = np.flatnonzero(degree)
    points = np.concatenate([axis.nodes[nodes], lines[inner]])
    uses = np.ones(len(points), dtype=np.int64)
    uses[: len(nodes)] = np.maximum(degree[nodes] // 2, 1)
    free = np.zeros(len(points), dtype=bool)
    free[: len(nodes)] = degree[nodes] == 1
    return points, uses, free


def _next(
    path: list[int], near: IntArray, points: FloatArray, plane_stress: FloatArray, section: Region
) -> int | None:
    """Point of those near that a path goes on to."""
    here = path[-1]
    distance = np.linalg.norm(points[near] - points[here], axis=1)
    near, distance = near[distance > 0.0], distance[distance > 0.0]
    if not len(near):
        return None
    steps = points[near] - points[here]
    lines = stress_lines(0.5 * (plane_stress[here] + plane_stress[near]))
    alpha = beta = misalignment(steps, lines, 0.5 * _RULE.misalignment)
    if len(path) > 1:
        before = points[here] - points[path[-2]]
        cosine = steps @ before / (distance * np.linalg.norm(before))
        alpha = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    allowed = (alpha <= _RULE.turn) & (beta <= _RULE.misalignment)
    for k in np.argsort(_RULE(alpha, beta, distance), kind="stable"):
        way = shapely.LineString([points[here], points[near[k]]])
        if allowed[k] and section.covers(way):
            return int(near[k])
    return None
