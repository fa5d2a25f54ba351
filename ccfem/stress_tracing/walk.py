"""Main load paths as the paper traces them: a greedy walk over the points of the medial axis.

For comparison with the paper. The walk skips joints and leaves stray points, by which main paths
are broken up; `main_paths` evaluates the same criterion at the joints instead.
"""

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.medial_axis import medial_axis
from ccfem.geometry.polylines import inner_points, pack, resample
from ccfem.geometry.shapes import Region
from ccfem.layers.layer_stress import LayerStress
from ccfem.stress_tracing.criterion import Criterion
from ccfem.stress_tracing.stress_lines import misalignment, plane_stress_at, stress_lines

__all__ = ["walk"]

_LEAST_POINTS = 3
_ARC_CHORD = 1.6


def walk(
    section: Region,
    stress: LayerStress,
    sampling: float,
    step: float = 1.0,
    criterion: Criterion | None = None,
) -> list[FloatArray]:
    """Trace load paths over the points of the medial axis.

    From an end of the axis under the largest stress, or else the point under the largest stress,
    the next point is always the one with the least smoothness, within the limits of the criterion
    and without leaving the section. The walk ends where there is none; it starts anew until no
    point is left. Joints may be passed once for every two members.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    stress : LayerStress
    sampling : float, mm
        Largest distance of the samples along the border.
    step : float, mm, default 1
        Distance of the points of the axis.
    criterion : Criterion, optional
        Limits by default 90 and 45 degrees and 3 steps.

    Returns
    -------
    list of (n, 2) arrays, mm
        Those of at least three points.
    """
    rule = criterion or Criterion(90.0, 45.0, 3.0 * step)
    points, uses, ends = _points(section, sampling, step)
    if len(points) < _LEAST_POINTS:
        return []
    walker = _Walker(section, points, uses, plane_stress_at(stress, points, step), rule)
    size = np.abs(stress_lines(walker.stress).value)
    paths = []
    while (walker.uses > 0).any():
        fresh = walker.uses == uses
        first = np.flatnonzero(fresh & ends if (fresh & ends).any() else walker.uses > 0)
        start = int(first[np.argmax(size[first])])
        walker.uses[start] -= 1
        path = walker.follow([start])
        if not ends[start]:
            path = walker.follow(path[::-1])
        if len(path) >= _LEAST_POINTS:
            paths.append(points[path])
    return paths


def _points(
    section: Region, sampling: float, step: float
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Points (n, 2) of the axis, how often each may be passed, and which are ends."""
    axis = medial_axis(section, sampling, object_angle=None, arc_chord=_ARC_CHORD)
    if not axis.segments:
        return np.zeros((0, 2)), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool)
    lines, offsets = resample(*pack([segment.points for segment in axis.segments]), step)
    inner = inner_points(offsets, np.array([segment.ends[0] < 0 for segment in axis.segments]))
    ends = [end for segment in axis.segments for end in segment.ends if end >= 0]
    degree = np.bincount(ends, minlength=len(axis.nodes)) if ends else np.zeros(0, dtype=np.int64)
    nodes = np.flatnonzero(degree)
    points = np.concatenate([axis.nodes[nodes], lines[inner]])
    uses = np.ones(len(points), dtype=np.int64)
    uses[: len(nodes)] = np.maximum(degree[nodes] // 2, 1)
    free = np.zeros(len(points), dtype=bool)
    free[: len(nodes)] = degree[nodes] == 1
    return points, uses, free


class _Walker:
    """The walk: points with how often each may still be passed."""

    def __init__(
        self,
        section: Region,
        points: FloatArray,
        uses: IntArray,
        stress: FloatArray,
        rule: Criterion,
    ) -> None:
        self.section, self.points, self.stress, self.rule = section, points, stress, rule
        self.uses = uses.copy()
        self.tree = cKDTree(points)
        shapely.prepare(section)

    def follow(self, path: list[int]) -> list[int]:
        """Path continued from its last point until no point is left within the limits."""
        path = list(path)
        while (following := self._next(path)) is not None:
            self.uses[following] -= 1
            path.append(following)
        return path

    def _next(self, path: list[int]) -> int | None:
        here = path[-1]
        near = np.array(self.tree.query_ball_point(self.points[here], self.rule.distance))
        near = near[(self.uses[near] > 0) & ~np.isin(near, path)]
        steps = self.points[near] - self.points[here]
        distance = np.linalg.norm(steps, axis=1)
        near, steps, distance = (
            near[distance > 0.0],
            steps[distance > 0.0],
            distance[distance > 0.0],
        )
        if not len(near):
            return None
        lines = stress_lines(0.5 * (self.stress[here] + self.stress[near]))
        beta = misalignment(steps, lines, 0.5 * self.rule.misalignment)
        alpha = beta
        if len(path) > 1:
            before = self.points[here] - self.points[path[-2]]
            cosine = steps @ before / (distance * np.linalg.norm(before))
            alpha = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        delta = self.rule(alpha, beta, distance)
        allowed = (alpha <= self.rule.turn) & (beta <= self.rule.misalignment)
        for k in np.argsort(delta, kind="stable"):
            way = shapely.LineString([self.points[here], self.points[near[k]]])
            if allowed[k] and self.section.covers(way):
                return int(near[k])
        return None
