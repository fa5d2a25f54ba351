"""The band of a main path: the strip between its rails, continued through joints and free ends.

The strip is described by the middle between both rails and half the vector from one to the other.
Near joints and free ends the rails belong to other members; there the strip is bridged by a cubic
or extended straight. During construction a strip is an array (n, 5): both vectors, and 1 where the
strip is free.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d

from ccfem.base.arrays import BoolArray, FloatArray, freeze
from ccfem.geometry.polylines import along_line, points_along
from ccfem.strategies.stress_tracing.frame import FREE, Frame, Member
from ccfem.strategies.stress_tracing.main_paths import MainPath

STEP = 0.5
"""Distance between points of a band, mm."""
_CLEARING = 0.9
"""Distance from a joint, in its radii, below which rails are not those of a member."""
_TANGENT = (4.0, 6.0)
"""Lengths, mm, over which the direction of a band is measured for bridging and extension."""
_NORMAL = 2.0
"""Length, mm, over which its width is measured for extension."""
_SMOOTHING = 2.0
"""Standard deviation, mm, of the Gaussian that smooths a band."""
_TURNED = np.array([1.0, 1.0, -1.0, -1.0, 1.0])
"""Factors on a strip that is traversed backwards."""
_PADDING = 10.0
"""Length, mm, that is cut off at both ends after that."""
_INNER_RADIUS = 4.0
"""Radius, mm, of the inner side of a band that turns as it leaves a joint."""
_EXTENSION = 5.0
_LEAST_HALF = 5.0
"""A band is extended at both ends by this many times the sum of half its width and this many mm;
its tracks are clipped afterwards."""


@dataclass(frozen=True)
class Band:
    """Middle line of a main path with half the vector from its right to its left side."""

    # (n, 2), mm: in nearly equal steps
    middle: FloatArray
    half: FloatArray
    core: slice  # points that are not extended
    within: slice  # points up to the middle of the joints that it ends in
    width: FloatArray  # (k,), mm: distance of the rails along the core, before smoothing
    free: FloatArray  # (n,): from 0 where rails guide the band to 1 where it is bridged or extended
    closed: bool = False  # whether the last point leads to the first
    # Whether it starts, and whether it ends, in a joint.
    joined: tuple[bool, bool] = (True, True)

    def __post_init__(self) -> None:
        freeze(self, middle=float, half=float, width=float, free=float)


def band(
    path: MainPath, frame: Frame, crossing: bool = True, turns: tuple[float, float] = (0.0, 0.0)
) -> Band:
    """Band of a main path.

    Parameters
    ----------
    crossing : bool, default True
        Whether an end in a joint continues beyond it; otherwise it stops in the joint's middle.
    turns : 2 floats, radians, default 0
        Turns to the left, at the start and at the end, with which the path leaves such joints.
    """
    nodes = np.concatenate([_own(member, frame) for member in path.members])
    left = np.concatenate([member.left for member in path.members])[nodes]
    right = np.concatenate([member.right for member in path.members])[nodes]
    strip = np.column_stack([0.5 * (left + right), 0.5 * (left - right), np.zeros(len(left))])
    gap = np.diff(np.flatnonzero(nodes)) > 1
    if along_line(strip[:, :2])[-1] < STEP:
        strip, gap = _stub(strip), np.zeros(1, dtype=bool)
    if path.closed:
        strip, gap = _as_ring(strip, np.append(gap, not nodes[0] or not nodes[-1]))
    strip = _even_strip(_bridged(strip, gap), path.closed)
    width = 2.0 * np.linalg.norm(strip[:, 2:4], axis=1)
    if path.closed:
        strip = _gaussian_smoothed(strip[:-1], "wrap")
        every = slice(0, len(strip))
        return Band(strip[:, :2], strip[:, 2:4], every, every, width, strip[:, 4], closed=True)
    # Beyond its ends: far over a free end, and to the middle of a joint or across it.
    ends = (path.members[0].ends[0], path.members[-1].ends[1])
    farthest = _EXTENSION * (_LEAST_HALF + 0.5 * width[[0, -1]])
    middle = [
        far if end == FREE else float(np.linalg.norm(frame.joints[end] - place))
        for end, place, far in zip(ends, strip[[0, -1], :2], farthest, strict=True)
    ]
    reach = farthest if crossing else middle
    before = extension(strip[::-1] * _TURNED, reach[0] + _PADDING, turns[0])[::-1] * _TURNED
    after = extension(strip, reach[1] + _PADDING, turns[1])
    # Smoothed with more on both sides than is kept, so that the ends do not shrink.
    padding = round(_PADDING / STEP)
    core = slice(len(before) - padding, len(before) - padding + len(strip))
    strip = _gaussian_smoothed(np.concatenate([before, strip, after]), "nearest")[padding:-padding]
    within = slice(
        max(0, core.start - round(middle[0] / STEP)),
        min(len(strip), core.stop + round(middle[1] / STEP)),
    )
    joined = (ends[0] != FREE, ends[1] != FREE)
    return Band(strip[:, :2], strip[:, 2:4], core, within, width, strip[:, 4], joined=joined)


def _stub(strip: FloatArray) -> FloatArray:
    """Strip of one step, (2, 5), for one without length, normal to the line between its sides."""
    centre = strip.mean(axis=0)
    x, y = centre[2:4]
    along = np.array([y, -x]) / np.hypot(x, y)
    ends = np.stack([centre, centre])
    ends[:, :2] += STEP * np.array([[-0.5], [0.5]]) * along
    return ends


def _own(member: Member, frame: Frame) -> BoolArray:
    """Mask (m,) of points whose rails belong to a member: away from joints and free ends.

    A member too short for any such points has those farthest from joints and ends.
    """
    points = member.points
    share = np.full(len(points), np.inf)
    if len(frame.joints):
        away = np.linalg.norm(points[:, None] - frame.joints, axis=2)
        share = (away / frame.radius).min(axis=1) / _CLEARING
    if not member.closed:
        for tip, end in ((0, member.ends[0]), (-1, member.ends[1])):
            if end == FREE:
                away = np.linalg.norm(points - points[tip], axis=1)
                share = np.minimum(share, away / (0.5 * member.width[tip]))
    return np.asarray(share >= min(1.0, 0.9 * float(share.max())))


def _as_ring(strip: FloatArray, gap: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Close a strip, counter-clockwise: its first point is repeated.

    It starts in the middle of its longest stretch without gaps.
    """
    count = len(strip)
    x, y = strip[:, :2].T
    if x @ np.roll(y, -1) < y @ np.roll(x, -1):
        strip, gap = strip[::-1] * _TURNED, np.roll(gap[::-1], -1)
    gaps = np.flatnonzero(gap)
    if len(gaps):
        size = np.diff(np.append(gaps, gaps[0] + count))
        longest = int(np.argmax(size))
        start = (int(gaps[longest]) + 1 + int(size[longest]) // 2) % count
        strip, gap = np.roll(strip, -start, axis=0), np.roll(gap, -start)
    return np.concatenate([strip, strip[:1]]), gap


def _bridged(strip: FloatArray, gap: BoolArray) -> FloatArray:
    """Fill gaps (n - 1,) by cubics that continue the directions of the strip on both sides."""
    along, middle = along_line(strip[:, :2]), strip[:, :2]
    gaps = np.flatnonzero(gap & (np.diff(along) > STEP))
    parts, start = [], 0
    for k, here in enumerate(gaps):
        a, b = middle[here], middle[here + 1]
        size = float(np.linalg.norm(b - a))
        first = max(start, int(np.searchsorted(along, along[here] - _TANGENT[0])))
        end = int(gaps[k + 1]) if k + 1 < len(gaps) else len(middle) - 1
        reached = int(np.searchsorted(along, along[here + 1] + _TANGENT[0], side="right")) - 1
        # Directions into the gap and out of it, over some length: those at its ends waver.
        into = _direction(a - middle[first], (b - a) / size)
        out = _direction(middle[min(end, reached)] - b, (b - a) / size)
        t = np.arange(1.0, round(size / STEP))[:, None] * (STEP / size)
        place, slope = _cubic(a, b, size * into, size * out, t)
        tangent = slope / np.maximum(np.linalg.norm(slope, axis=1), 1e-12)[:, None]
        # The width goes over linearly, square to the cubic.
        wide = np.linalg.norm(strip[here : here + 2, 2:4], axis=1)
        normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
        half = ((1.0 - t) * wide[0] + t * wide[1]) * normal
        parts += [strip[start : here + 1], np.column_stack([place, half, np.ones(len(t))])]
        start = int(here) + 1
    return np.concatenate([*parts, strip[start:]])


def _direction(step: FloatArray, otherwise: FloatArray) -> FloatArray:
    """Make a unit vector of a step, or take another one where the step is short."""
    length = float(np.linalg.norm(step))
    return step / length if length > STEP else otherwise


def _cubic(
    a: FloatArray, b: FloatArray, into: FloatArray, out: FloatArray, t: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points and slopes at t (k, 1) of Hermite's cubic from a to b."""
    place = (
        (1.0 + 2.0 * t) * (1.0 - t) ** 2 * a
        + t * (1.0 - t) ** 2 * into
        + t**2 * (3.0 - 2.0 * t) * b
        + t**2 * (t - 1.0) * out
    )
    slope = (
        6.0 * t * (1.0 - t) * (b - a)
        + (1.0 - t) * (1.0 - 3.0 * t) * into
        + t * (3.0 * t - 2.0) * out
    )
    return place, slope


def _even_strip(strip: FloatArray, closed: bool) -> FloatArray:
    """Strip in equal steps along its middle; a closed one from its point nearest to its centre."""
    along = along_line(strip[:, :2])
    at = np.linspace(0.0, along[-1], max(4, round(along[-1] / STEP)) + 1)
    if closed:
        centre = shapely.centroid(shapely.Polygon(strip[:, :2]))
        line = shapely.LineString(strip[:, :2])
        at = (at + shapely.line_locate_point(line, centre)) % along[-1]
    return points_along(strip, along, at)


def _gaussian_smoothed(strip: FloatArray, mode: str) -> FloatArray:
    """Smooth a strip by a Gaussian, twice, so that arcs keep their radius."""
    once = gaussian_filter1d(strip, _SMOOTHING / STEP, axis=0, mode=mode)
    rest = gaussian_filter1d(strip - once, _SMOOTHING / STEP, axis=0, mode=mode)
    smooth = once + rest
    smooth[:, 4] = smooth[:, 4].clip(0.0, 1.0)
    return np.asarray(smooth)


def extension(strip: FloatArray, reach: float, turn: float = 0.0) -> FloatArray:
    """Extension (m, 5) of a strip by `reach`, mm, beyond its last point.

    It is straight, or turns left by `turn`, radians, with an inner radius of 4 mm. It does not
    count as free.
    """
    middle = strip[:, :2]
    tangent = middle[-1] - middle[max(len(middle) - 1 - round(_TANGENT[1] / STEP), 0)]
    tangent = tangent / np.linalg.norm(tangent)
    half = strip[-round(_NORMAL / STEP) :, 2:4].mean(axis=0)
    across = np.array([-tangent[1], tangent[0]])
    size = float(half @ across)
    radius = _INNER_RADIUS + abs(size)
    at = STEP * np.arange(1, int(reach / STEP) + 1)
    turned = np.copysign(np.minimum(at / radius, abs(turn)), turn)
    arc = np.minimum(at, radius * abs(turn))
    # The chord of the arc, then straight on.
    chord = 2.0 * radius * np.sin(0.5 * arc / radius)
    rest = (at - arc)[:, None]
    place = middle[-1] + chord[:, None] * _turned_by(tangent, 0.5 * turned)
    place = place + rest * _turned_by(tangent, turned)
    free = np.full(len(at), 1.0 if turn == 0.0 else 0.0)
    return np.column_stack([place, size * _turned_by(across, turned), free])


def _turned_by(vector: FloatArray, angle: FloatArray) -> FloatArray:
    """Vector (2,) turned to the left by angles (n,): (n, 2)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vector
    return np.stack([c * x - s * y, s * x + c * y], axis=1)
