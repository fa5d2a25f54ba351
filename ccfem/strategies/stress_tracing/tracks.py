"""Tracks of a main path: strands that fill the width of its band evenly.

The paper shows tracks whose spacing follows the width of the member, and gives no formula.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.optimize import isotonic_regression
from scipy.sparse import diags_array, eye_array
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.offsets import ring_from
from ccfem.geometry.polylines import along_line, subdivide, turning_angles
from ccfem.geometry.shapes import Region
from ccfem.slicing.layers.layer import LayerStress
from ccfem.strategies.stress_tracing.band import STEP, Band, band, extension
from ccfem.strategies.stress_tracing.frame import FREE, Frame
from ccfem.strategies.stress_tracing.main_paths import MainPath
from ccfem.strategies.stress_tracing.stress_lines import plane_stress_at, stress_lines

_BEYOND = 6
"""Number of points by which a track is continued where it leaves its band sideways."""
_OUTSIDE = 1.5
"""Length outside the section, mm, after which a track or its tail has left it for good."""
_INSET = 0.1
"""Distance inside the border, mm, to which a track outside is pushed."""
_SPREAD = 1.5
"""Standard deviation, mm, of the Gaussian that spreads such a push to neighbouring points."""
_EASING = 1.0
_ROUNDS = 60
"""Standard deviation, mm, of the Gaussian that eases sharp turns, and how often at most."""


def tracks(
    band: Band,
    pitch: float,
    section: Region,
    radius: float = 0.0,
    stress: LayerStress | None = None,
) -> list[FloatArray]:
    """Tracks of a band, evenly over its width, clipped to a section.

    Parameters
    ----------
    pitch : float, mm
        Wanted distance between neighbouring tracks.
    section : shapely (Multi)Polygon, mm
    radius : float, mm, default 0
        Tighter turns are smoothed, unless the border leaves no room for that.
    stress : LayerStress, optional
        Stress that the tracks turn to in joints and beside free ends.

    Returns
    -------
    list of (n, 2) arrays, mm
        From left to right. Closed tracks repeat their first point, which is the one nearest to the
        middle of the section.
    """
    shapely.prepare(section)
    inner = shapely.buffer(section, -_INSET)
    seam = shapely.get_coordinates(shapely.centroid(section))[0]
    share = places(band, pitch, section)
    lines = band.middle + share[..., None] * band.half
    if stress is not None:
        lines = relaxed(lines, band, stress, section, share)
    held = []
    for line, place in zip(lines, share, strict=True):
        line = eased(line, radius, band.closed)
        whole = band.closed and bool((np.abs(place) <= 1.0).all())
        if whole:
            pieces = [ring_from(np.concatenate([line, line[:1]]), seam)]
        elif band.closed:
            # Open it where it lies farthest outside.
            start = -int(np.argmax(np.abs(place)))
            line, place = np.roll(line, start, axis=0), np.roll(place, start)
            runs = _track_stretches(place, slice(0, len(line)))
            pieces = [clipped(line[r], section, *2 * (slice(0, r.stop - r.start),)) for r in runs]
        else:
            pieces = [
                clipped(line[run], section, *_parts_of(band, run))
                for run in _track_stretches(place, band.core)
            ]
        held += [_held(piece, section, inner, whole) for piece in pieces if len(piece) > 1]
    return held


def _track_stretches(place: FloatArray, core: slice) -> list[slice]:
    """Stretches of a track that lie within its band, or on beyond its ends."""
    within = np.abs(place) <= 1.0
    ends = np.flatnonzero(np.diff(np.concatenate([[False], within, [False]]).astype(np.int8)))
    stretches = []
    for a, b in ends.reshape(-1, 2):
        # One point beyond the border at either side, so that the track is cut there.
        run = slice(max(int(a) - _BEYOND, 0), min(int(b) + _BEYOND, len(place)))
        if a < core.stop and b > core.start:
            stretches.append(run)
    return stretches


def _parts_of(band: Band, run: slice) -> tuple[slice, slice]:
    """Return the core of a band, and what is within it, in a stretch of it."""
    core, within = (
        slice(max(part.start, run.start) - run.start, min(part.stop, run.stop) - run.start)
        for part in (band.core, band.within)
    )
    return core, within


def eased(line: FloatArray, radius: float, closed: bool = False) -> FloatArray:
    """Smooth a line (n, 2) in even steps wherever it turns more tightly than a radius, mm."""
    mode = "wrap" if closed else "nearest"
    reach = round(4.0 * _EASING / STEP) + 1
    for _ in range(_ROUNDS):
        ring = np.concatenate([line[-1:], line, line[:1]]) if closed else line
        offsets = np.array([0, len(ring)])
        turn = turning_angles(ring, offsets, np.zeros(1, dtype=bool))
        step = np.linalg.norm(np.diff(ring, axis=0), axis=1)
        beside = 0.5 * (np.append(step, step[-1]) + np.append(step[0], step))
        sharp = 2.0 * np.sin(0.5 * turn) * radius > beside
        sharp = sharp[1:-1] if closed else sharp
        if not sharp.any():
            break
        near = maximum_filter1d(sharp.astype(np.float64), reach, mode=mode)
        weight = gaussian_filter1d(near, _EASING / STEP, mode=mode)[:, None]
        smooth = gaussian_filter1d(line, _EASING / STEP, axis=0, mode=mode)
        line = line + weight * (smooth - line)
    return line


def clipped(line: FloatArray, section: Region, core: slice, within: slice) -> FloatArray:
    """Part of a line round the middle of its core, up to where it leaves a section for good.

    Excursions shorter than 1.5 mm do not end it: they would cut a track that grazes the border into
    pieces. Its ends lie on the border. If an end does not leave the section, but would run along
    the member behind a joint, the end of the points `within` is used.
    """
    inside = shapely.contains_xy(section, line)
    in_core = np.flatnonzero(inside[core]) + core.start
    if not len(in_core):
        return line[:0]
    middle = (core.start + core.stop) // 2
    start = int(in_core[np.argmin(np.abs(in_core - middle))])
    first = start - _last_inside(line[start::-1], inside[start::-1])
    last = start + _last_inside(line[start:], inside[start:])
    ahead = back = line[:0]
    if first > 0:
        back = _way_out(line[first], line[first - 1], section)
    else:
        first = min(within.start, start)
    if last + 1 < len(line):
        ahead = _way_out(line[last], line[last + 1], section)
    else:
        last = max(within.stop - 1, start)
    return np.concatenate([back, line[first : last + 1], ahead])


def _last_inside(line: FloatArray, inside: BoolArray) -> int:
    """Index of the last point inside before a line leaves for good."""
    along = along_line(line)
    within = np.flatnonzero(inside)
    left = np.flatnonzero(np.diff(along[within]) > _OUTSIDE + STEP)
    return int(within[left[0]] if len(left) else within[-1])


def _way_out(inner: FloatArray, outer: FloatArray, section: Region) -> FloatArray:
    """Point (1, 2) where a step out of a section first crosses its border; none at its start."""
    step = shapely.LineString([inner, outer])
    border = shapely.get_coordinates(shapely.intersection(step, section.boundary))
    away = np.linalg.norm(border - inner, axis=1)
    border = border[away > 1e-6]
    return border[[np.argmin(away[away > 1e-6])]] if len(border) else border


def _held(line: FloatArray, section: Region, inner: Region, closed: bool) -> FloatArray:
    """Push a line back where it leaves a section between its ends, and neighbouring points less."""
    step = 0.2 * STEP
    fine, _, _ = subdivide(line, np.array([0, len(line)]), step)
    ends = 0 if closed else round(STEP / step)
    between = np.arange(len(fine)) >= ends
    between &= between[::-1]
    outside = between & ~shapely.contains_xy(section, fine)
    if not outside.any() or shapely.is_empty(inner):
        return line
    mode = "wrap" if closed else "nearest"
    reach = 2 * round(2.0 * _SPREAD / step) + 1
    beside = between & (maximum_filter1d(outside.astype(np.float64), reach, mode=mode) > 0.0)
    push = np.zeros_like(fine)
    for _ in range(_ROUNDS):
        out = np.flatnonzero(beside)[~shapely.contains_xy(inner, fine[beside])]
        push[:] = 0.0
        if not len(out):
            break
        # Pushed to the inner section; spread along the line, and twice as far, since spreading
        # flattens.
        ways = shapely.shortest_line(inner, shapely.points(fine[out]))
        push[out] = shapely.get_coordinates(ways)[::2] - fine[out]
        spread = gaussian_filter1d(push, _SPREAD / step, axis=0, mode=mode)
        fine = fine + np.where(beside[:, None], 2.0 * spread, 0.0)
    return fine + push


# Tracks turned towards the stress where no rails guide them: in joints and near free ends.
#
# A track may move sideways by u(s). The turned track minimises the sum, over its length, of ::
#
# cos(2 r) (u' - tan r)^2 + (c u'')^2 + (u / l)^2
#
# with the angle r from the track to the stress. The terms are misalignment, curvature, and distance
# from the old position. The distance counts much in members, whose width the tracks fill evenly,
# and little in joints. Where r exceeds 45 degrees, in joints that it crosses, a track is not
# changed.


_BENDING = 2.0
_HELD = 2.0
_FREE = 12.0
"""Lengths, mm: c, and l in members and in joints."""
_CLOSEST = 0.9
"""Share of their distance from each other that tracks keep."""
_TURNING_ROUNDS = 2


def relaxed(
    lines: FloatArray, band: Band, stress: LayerStress, section: Region, share: FloatArray
) -> FloatArray:
    """Turn the tracks of a band towards the stress: (k, n, 2) mm.

    Parameters
    ----------
    lines : (k, n, 2) array, mm
        Tracks along the points of the band.
    section : shapely (Multi)Polygon, mm
    share : (k, n) array
        Place of the tracks across the band, from left (1) to right (-1).
    """
    along = np.roll(lines, -1, axis=1) - np.roll(lines, 1, axis=1)
    if not band.closed:
        along[:, [0, -1]] = np.diff(lines, axis=1)[:, [0, -1]]
    along = along / np.linalg.norm(along, axis=2, keepdims=True)
    normal = np.stack([-along[..., 1], along[..., 0]], axis=2)
    hold = (1.0 - band.free) / _HELD**2 + band.free / _FREE**2
    moved = np.zeros(lines.shape[:2])
    for _ in range(_TURNING_ROUNDS):
        weight, slope = _wanted(lines + moved[..., None] * normal, band.closed, stress, section)
        slope += _differences(moved, band.closed) / STEP
        moved = np.stack(
            [_least_move(w, g, hold, band.closed) for w, g in zip(weight, slope, strict=True)]
        )
        moved = _apart(moved, band, share)
    return lines + moved[..., None] * normal


def _differences(values: FloatArray, closed: bool) -> FloatArray:
    """From each point of lines (k, n, ...) to the next."""
    if closed:
        return np.roll(values, -1, axis=1) - values
    return np.diff(values, axis=1)


def _wanted(
    lines: FloatArray, closed: bool, stress: LayerStress, section: Region
) -> tuple[FloatArray, FloatArray]:
    """Weight and wanted slope (k, n or n - 1) of every step of lines."""
    steps = _differences(lines, closed)
    middles = lines[:, : steps.shape[1]] + 0.5 * steps
    points = middles.reshape(-1, 2)
    stress_line = stress_lines(plane_stress_at(stress, points, STEP))
    x, y = stress_line.direction.T
    heading = np.arctan2(steps[..., 1], steps[..., 0])
    turn = np.arctan2(y, x).reshape(heading.shape) - heading
    turn = (turn + 0.5 * np.pi) % np.pi - 0.5 * np.pi
    counts = stress_line.defined & shapely.contains_xy(section, points)
    weight = np.where(counts.reshape(turn.shape), np.maximum(np.cos(2.0 * turn), 0.0), 0.0)
    return weight, np.where(weight > 0.0, np.tan(turn), 0.0)


def _least_move(
    weight: FloatArray, slope: FloatArray, hold: FloatArray, closed: bool
) -> FloatArray:
    """Move (n,) of one line that minimises the sum."""
    here = eye_array(len(hold), format="csr")
    ahead = here[np.roll(np.arange(len(hold)), -1)]
    rise = (ahead - here)[: len(weight)] / STEP
    bend = (ahead - 2.0 * here + ahead.T)[slice(None) if closed else slice(1, -1)] / STEP**2
    matrix = rise.T @ (weight[:, None] * rise) + _BENDING**2 * (bend.T @ bend) + diags_array(hold)
    return np.asarray(spsolve(matrix.tocsc(), rise.T @ (weight * slope)))


def _apart(moved: FloatArray, band: Band, share: FloatArray) -> FloatArray:
    """Find the moves (k, n) nearest to the given ones that keep tracks apart."""
    count = len(moved)
    size = np.linalg.norm(band.half, axis=1)
    number = np.arange(count)[:, None]
    even = (1.0 - share) * size
    step = even[1:2] - even[:1] if count > 1 else 0.0 * even
    least = _CLOSEST * step * number
    place = even - moved - least  # from the left, to grow from track to track
    for column in np.flatnonzero((np.diff(place, axis=0) < 0.0).any(axis=0)):
        place[:, column] = isotonic_regression(place[:, column]).x
    mode = "wrap" if band.closed else "nearest"
    return np.asarray(gaussian_filter1d(even - place - least, 1.0 / STEP, axis=1, mode=mode))


# Tails: the direction in which the tracks of a main path leave the joint that it ends in.
#
# They cross the joint and leave the section. Straight on, they would often run along another main
# path, over its strands or between them. Of several turns the one is taken for which they run least
# beside other strands, and least long in the section.


_TURNS = np.radians([0.0, 15.0, -15.0, 30.0, -30.0, 45.0, -45.0, 60.0, -60.0])
_NEAR = 0.75
"""Strands nearer than this share of the pitch lie beside each other,"""
_ALONG = np.cos(np.radians(30.0))
"""where they run within 30 degrees of each other."""
_LENGTH = 0.15
"""Cost of a length in the section, over that of a length beside other strands."""
_TURNING = 2.0
"""Cost of a turn of a radian, in mm beside other strands, for each strand."""
_TIED = 1e-3
"""Share by which turns to the left and to the right must differ in cost, so that a path on an axis
of symmetry stays there."""
_NONE = np.zeros((0, 2))


def tail_turns(
    paths: Sequence[MainPath], frame: Frame, pitch: float, section: Region
) -> list[tuple[float, float]]:
    """Find the turns, radians to the left, of main paths beyond the joints that they end in.

    Parameters
    ----------
    pitch : float, mm
        Distance between neighbouring tracks.
    section : shapely (Multi)Polygon, mm

    Returns
    -------
    list of 2 floats
        At the start and at the end of each; 0 for a free end.
    """
    section = shapely.force_2d(section)
    shapely.prepare(section)
    bands = [band(path, frame) for path in paths]
    shares = [places(strip, pitch, section) for strip in bands]
    fixed = [_fixed(*arguments) for arguments in zip(paths, bands, shares, strict=True)]
    turns_of_tails = []
    for k, (path, strip, share) in enumerate(zip(paths, bands, shares, strict=True)):
        turns = [0.0, 0.0]
        if not path.closed:
            points, along = (
                np.concatenate([other[part] for n, other in enumerate(fixed) if n != k] or [_NONE])
                for part in (0, 1)
            )
            for side, end in enumerate((path.members[0].ends[0], path.members[-1].ends[1])):
                if end != FREE and len(points):
                    tree = cKDTree(points)
                    # Tails in every turn that is tried: their cost against what lies there, and for
                    # turning.
                    tails = _tails(strip, share, side)
                    costs = [
                        _cost(lines, tree, along, pitch, section) + _TURNING * len(lines) * abs(t)
                        for t, lines in zip(_TURNS, tails, strict=True)
                    ]
                    turns[side] = _best(costs)
        turns_of_tails.append((turns[0], turns[1]))
    return turns_of_tails


def _best(costs: Sequence[float]) -> float:
    """Turn of least cost; none if turns to the left and to the right cost the same."""
    best = int(np.argmin(costs))
    # Turns come in pairs behind the first one, which is none.
    other = best + 1 if best % 2 else best - 1
    alike = best > 0 and costs[other] <= (1.0 + _TIED) * costs[best]
    return 0.0 if alike else float(_TURNS[best])


def _fixed(path: MainPath, strip: Band, share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (m, 2) of the tracks that do not depend on turns, and their directions (m, 2)."""
    first, last = strip.core.start, strip.core.stop
    if not path.closed:
        first = 0 if path.members[0].ends[0] == FREE else first
        last = len(strip.middle) if path.members[-1].ends[1] == FREE else last
    lines = strip.middle + share[..., None] * strip.half
    along = np.gradient(lines, axis=1)
    along = along / np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-12)
    kept = (np.abs(share) <= 1.0)[:, first:last]
    return lines[:, first:last][kept], along[:, first:last][kept]


def _tails(strip: Band, share: FloatArray, side: int) -> list[FloatArray]:
    """Lines (k, n, 2) behind the end of a band, for every turn."""
    core = np.column_stack([strip.middle, strip.half, strip.free])[strip.core]
    shares = share[:, strip.core]
    if side == 0:
        core, shares = core[::-1] * [1.0, 1.0, -1.0, -1.0, 1.0], -shares[:, ::-1]
        reach = STEP * strip.core.start
    else:
        reach = STEP * (len(strip.middle) - strip.core.stop)
    there = shares[:, -1:]
    there = there[np.abs(there[:, 0]) <= 1.0]
    ahead = [extension(core, reach, turn) for turn in _TURNS]
    return [tail[:, :2] + there[..., None] * tail[:, 2:4] for tail in ahead]


def _cost(
    lines: FloatArray, tree: cKDTree, along: FloatArray, pitch: float, section: Region
) -> float:
    """Length, mm, of lines (k, n, 2) beside others, plus a share of their length in the section."""
    inside = shapely.contains_xy(section, lines.reshape(-1, 2)).reshape(lines.shape[:2])
    beyond = round(_OUTSIDE / STEP) + 1
    total = 0.0
    for line, within in zip(lines, inside, strict=True):
        outside = np.convolve(~within, np.ones(beyond, dtype=int), mode="valid") == beyond
        stop = int(np.argmax(outside)) if outside.any() else len(line)
        if stop < 2:
            continue
        line, within = line[:stop], within[:stop]
        tangent = np.gradient(line, axis=0)
        tangent = tangent / np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
        near = tree.query_ball_point(line, _NEAR * pitch)
        beside = [
            bool(within[n] and len(k) and (np.abs(along[k] @ tangent[n]) > _ALONG).any())
            for n, k in enumerate(near)
        ]
        total += STEP * (sum(beside) + _LENGTH * float(within.sum()))
    return total


# Number of tracks along the length of a band: whole numbers that follow its width.
#
# Where the number changes, tracks leave the section through the border, on one side or on both, and
# the others spread out over a length. So the distance between tracks stays near the pitch, and
# tracks end outside, where links turn.


_CHANGE = 0.3
"""Cost of one track more or less: as much as a tenth of the band left open over 3 mm."""
_CROWDED = 4.0
"""Cost of tracks nearer than `_NEAREST`, over that of a gap as wide as their overlap."""
_OVER = 0.02
"""The same for tracks that overlap but are not nearer than `_NEAREST`."""
_ROUNDING = 1.002
"""Distance, in pitches, that counts as one pitch."""
_LESS = 0.3
"""Weight of lengths in joints, which other tracks cross too."""
_NEAREST = 0.9
"""Distance, in pitches, below which tracks are too near to each other."""
_IN_JOINT = 6.0
"""Factor on the cost of a change in joints."""
_CLEAR = 5.0
"""Distance, mm, from a joint within which a change would reach into it."""
_CHANGE_SPREAD = 3.0
"""Standard deviation, mm, of the Gaussian over which a change of the number is spread."""
_ON_BORDER = 0.5
"""Distance, mm, up to which a side of a band runs along the border."""
_CLEARLY = 0.2
"""Share of a side by which more of it must lie on the outer border."""
_ONE_SIDE = 1.0
"""Factor on the cost of even changes below which changes on one side are taken."""


def places(band: Band, pitch: float, section: Region) -> FloatArray:
    """Place of every track across a band, in half widths.

    Parameters
    ----------
    pitch : float, mm
        Wanted distance between neighbouring tracks.
    section : shapely (Multi)Polygon, mm

    Returns
    -------
    (k, n) array
        From left (1) to right (-1) at each point of the band; tracks beyond lie outside it.
    """
    width = np.maximum(2.0 * np.linalg.norm(band.half, axis=1), 1e-9)
    wanted = width / pitch
    if band.closed:
        number = _round_ring(wanted, band.free > 0.5)
        shift = _outer(band, section) if np.ptp(number) else 0.0
        return _track_places(gaussian_filter1d(number, _CHANGE_SPREAD / STEP, mode="wrap"), shift)
    return _places_between_ends(band, wanted, pitch, section)


def _places_between_ends(
    band: Band, wanted: FloatArray, pitch: float, section: Region
) -> FloatArray:
    """Places (k, n) of tracks in a band with two ends, given the wanted numbers (n,) at a pitch."""
    # A free end continues to the border, by half its width.
    first, last = band.core.start, band.core.stop
    if not band.joined[0]:
        first = max(0, first - round(0.5 * wanted[first] * pitch / STEP))
    if not band.joined[1]:
        last = min(len(wanted), last + round(0.5 * wanted[last - 1] * pitch / STEP))
    inner = wanted[first:last]
    reach = 2 * round(_CLEAR / STEP) + 1
    joint = maximum_filter1d(band.free, reach, mode="constant", cval=1.0)[band.core] > 0.5
    joint = np.pad(joint, (band.core.start - first, last - band.core.stop))
    # Tracks come and go in pairs, one on each side; on one side only where that is much better.
    even, even_cost = min(
        (_steady_numbers(inner, joint, first, 2) for first in (1, 2)),
        key=lambda candidate: candidate[1],
    )
    any_, any_cost = _steady_numbers(inner, joint, 1, 1)
    shift = 0.0
    number = even
    if any_cost < _ONE_SIDE * even_cost:
        number, shift = any_, _outer(band, section)
    whole = np.concatenate(
        [np.full(first, number[0]), number, np.full(len(wanted) - last, number[-1])]
    )
    return _track_places(
        gaussian_filter1d(whole.astype(np.float64), _CHANGE_SPREAD / STEP, mode="nearest"), shift
    )


def _outer(band: Band, section: Region) -> float:
    """1 where tracks leave through the left side of a band, else -1.

    This is the side on the outer border, where links have room, not that on a hole. If both are
    equal, it is the longer side.
    """
    left, right = (band.middle[band.core] + sign * band.half[band.core] for sign in (1.0, -1.0))
    outside = shapely.union_all(shapely.get_exterior_ring(shapely.get_parts(section)))
    near = [
        float(np.mean(shapely.dwithin(shapely.points(side), outside, _ON_BORDER)))
        for side in (left, right)
    ]
    if abs(near[0] - near[1]) > _CLEARLY:
        return 1.0 if near[0] > near[1] else -1.0
    sizes = [np.linalg.norm(np.diff(side, axis=0), axis=1).sum() for side in (left, right)]
    return 1.0 if sizes[0] > sizes[1] else -1.0


def _track_places(number: FloatArray, shift: float) -> FloatArray:
    """Places (k, n) of tracks whose number (n,) changes on both sides (0) or on one (1, -1)."""
    most = int(np.ceil(number.max() - 1e-9))
    k = np.arange(most)[:, None]
    centred = most - 1.0 - 2.0 * k
    # On one side: the tracks of the other side keep their place at the border.
    return np.asarray((centred + shift * (most - number)) / number)


def _round_ring(wanted: FloatArray, joint: BoolArray) -> FloatArray:
    """Find whole numbers (n,) round a closed band: two rounds, cut in the middle of the first."""
    count = len(wanted)
    number, _ = _steady_numbers(np.tile(wanted, 2), np.tile(joint, 2), 1, 1)
    if number[count // 2] != number[count // 2 + count]:
        return np.full(count, float(max(1, round(float(np.median(wanted))))))
    return np.roll(number[count // 2 : count // 2 + count], count // 2).astype(np.float64)


def _steady_numbers(
    wanted: FloatArray, joint: BoolArray, first: int, step: int
) -> tuple[IntArray, float]:
    """Whole numbers (n,) near the wanted ones (n,) that change seldom, and their cost.

    In joints (n,) they hardly change, since there is no border to leave through. They are `first`
    plus multiples of `step`, and are found by dynamic programming.
    """
    most = max(first, int(np.ceil(wanted.max())) + 1)
    numbers = np.arange(first, most + 1, step)
    apart = wanted[:, None] / numbers
    # A single track may lie in a band narrower than itself.
    near = np.where(numbers == 1, 0.0, np.maximum(_NEAREST - apart, 0.0))
    over = np.maximum(1.0 - apart, 0.0)
    cost = STEP * (np.maximum(apart - _ROUNDING, 0.0) + _CROWDED * near + _OVER * over)
    cost[joint] *= _LESS
    change = _CHANGE * np.abs(numbers[:, None] - numbers)
    best, came = cost[0], np.zeros(cost.shape, dtype=np.int64)
    for n in range(1, len(cost)):
        over = best[:, None] + (_IN_JOINT if joint[n] else 1.0) * change
        came[n] = over.argmin(axis=0)
        best = over.min(axis=0) + cost[n]
    chosen = np.empty(len(cost), dtype=np.int64)
    chosen[-1] = best.argmin()
    for n in range(len(cost) - 1, 0, -1):
        chosen[n - 1] = came[n, chosen[n]]
    return numbers[chosen], float(best.min())
