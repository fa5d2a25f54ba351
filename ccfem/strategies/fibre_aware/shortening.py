"""Cutting fibre paths to the stretches that are worth most.

All fibre has the same price, and each path keeps the stretches that are worth more. Where only a
share of the fibre may turn more tightly than the machine allows, such turns have an extra price.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.polylines import along_line, curvature_samples, points_along, runs
from ccfem.geometry.tight_bends import tight_bends
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.strategies.fibre_aware.path_profile import Profile, least_price

TIGHT_SHARES = {"tight": 1.0, "cut": 0.0095}
"""Share of the fibre that may turn too tightly, for each value of the parameter `turns`."""

_LOWER_PRICES = (0.999, 0.99, 0.97, 0.93, 0.85)
"""Shares of the price at which remaining room is used: a path may be worth all or nothing."""

_PRICES = (1e-3, 300.0)
"""Range of the extra price of a mm that turns too tightly, over the value of the best fibre."""

_BISECTIONS = 14

_TRIFLE = 1e-6
"""Value of fibre that carries nothing, over that of the best: it stays only where there is room."""


def shorten(
    toolpaths: Toolpaths,
    along: Sequence[Profile],
    length: float,
    minimum: float,
    cut_cost: float = 20.0,
) -> Toolpaths:
    """Keep the most valuable stretches of fibre paths, at most a wanted length in total.

    Parameters
    ----------
    along : sequence of Profile
        Of its fibre paths, from `profiles`.
    length : float, mm
    minimum : float, mm
        Least length of a stretch.
    cut_cost : float, mm, default 20
        See `Profile.kept`.

    Returns
    -------
    Toolpaths
        The price is the same for all paths: the smallest at which the length is not exceeded. The
        room it leaves is filled path by path with what slightly lower prices would keep, or with
        parts of that, no shorter than `minimum`, where all of it is too long.
    """
    price = least_price(along, length, minimum, cut_cost)
    chosen = {profile.path: profile.kept(price, minimum, cut_cost)[0] for profile in along}
    room = length - sum(profile.step * float(chosen[profile.path].sum()) for profile in along)
    for factor in _LOWER_PRICES if price > 0.0 else ():
        for profile in along:
            if profile.step > room:  # not even one piece fits
                continue
            before = chosen[profile.path]
            longer = profile.kept(factor * price, minimum, cut_cost)[0]
            if profile.step * (longer.sum() - before.sum()) > room:
                count = int(room / profile.step)
                longer = _grown(before, longer, count, profile.value, profile.least(minimum))
            more = profile.step * float(longer.sum() - before.sum())
            if 0.0 < more <= room:
                chosen[profile.path] = longer
                room -= more
    return _shortened(toolpaths, along, chosen)


def shorten_bent(
    toolpaths: Toolpaths, along: Sequence[Profile], length: float, machine: Machine, tight: float
) -> Toolpaths:
    """As `shorten`, with at most a share of the fibre in bends tighter than the machine's radius.

    A mm of such a bend has an extra price, the smallest that meets the share within the bisection.
    Fibre that carries nothing stays where there is room for a stretch of the machine's shortest
    strand, since plans are compared at equal length. Fibre that does harm goes.

    Parameters
    ----------
    toolpaths, along, length
        As of `shorten`.
    machine : Machine
        With its minimum length and radius.
    tight : float in [0, 1]
        Share of the fibre's length; 1 for no limit.
    """
    least = machine.shortest_strand
    best = max((float(np.abs(profile.value).max()) for profile in along), default=0.0) or 1.0
    along = [
        replace(
            profile,
            value=np.where(profile.value < 0.0, profile.value, profile.value + _TRIFLE * best),
        )
        for profile in along
    ]
    shortened = shorten(toolpaths, along, length, least)
    if tight >= 1.0 or tight_share(shortened, machine) <= tight:
        return shortened
    shares = _tight_pieces(toolpaths, along, machine)
    low, high = (np.log(price * best) for price in _PRICES)
    shortened = toolpaths.select(toolpaths.kind != FIBRE)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        price = float(np.exp(middle))
        priced = [
            replace(profile, value=profile.value - price * share)
            for profile, share in zip(along, shares, strict=True)
        ]
        trial = shorten(toolpaths, priced, length, least)
        if tight_share(trial, machine) <= tight:
            shortened, high = trial, middle
        else:
            low = middle
    return shortened


def tight_share(toolpaths: Toolpaths, machine: Machine) -> float:
    """Share of the fibre that turns more tightly than the machine's radius; 0 without fibre.

    Samples are a fibre width apart, as in the evaluator.
    """
    fibre = toolpaths.of_kind(FIBRE)
    points, offsets, closed = fibre.points, fibre.offsets, fibre.closed
    curvature = curvature_samples(points, offsets, closed, machine.fibre_width)
    return float((curvature * machine.minimum_radius >= 1.0).mean()) if len(curvature) else 0.0


def _bends(toolpaths: Toolpaths, k: int, machine: Machine) -> FloatArray:
    """Start and end (n, 2), mm, of the tight bends of one path."""
    line = toolpaths.points[toolpaths.offsets[k] : toolpaths.offsets[k + 1]]
    closed, radius = bool(toolpaths.closed[k]), machine.minimum_radius
    return tight_bends(line, along_line(line), closed, radius, machine.fibre_width)


def _tight_pieces(
    toolpaths: Toolpaths, along: Sequence[Profile], machine: Machine
) -> list[FloatArray]:
    """Share of each piece of the profiles that turns too tightly."""
    tightness = []
    for profile in along:
        edges = profile.origin + profile.step * np.arange(len(profile.value) + 1)
        size = profile.step * len(profile.value)
        bent = np.zeros(len(profile.value))
        # The pieces of a ring may start anywhere, and a bend may extend over its start.
        for start, end in _bends(toolpaths, profile.path, machine):
            for round_ in (-size, 0.0, size):
                last = np.minimum(edges[1:], end + round_)
                bent += np.maximum(last - np.maximum(edges[:-1], start + round_), 0.0)
        tightness.append(np.minimum(bent / profile.step, 1.0))
    return tightness


def _grown(
    kept: BoolArray, longer: BoolArray, count: int, value: FloatArray, least: int
) -> BoolArray:
    """Kept pieces (n,), and up to `count` more of a longer choice.

    Those that adjoin kept ones come first, then stretches of at least `least` pieces, of most worth
    first.
    """
    grown = kept.copy()
    while count > 0:
        beside = np.concatenate([[False], grown[:-1]]) | np.concatenate([grown[1:], [False]])
        fresh = np.flatnonzero(longer & ~grown & beside)[:count]
        if not len(fresh):
            fresh = _worthiest(runs(longer & ~grown), count, value, least)
        if not len(fresh):
            break
        grown[fresh] = True
        count -= len(fresh)
    return grown


def _worthiest(spans: IntArray, count: int, value: FloatArray, least: int) -> IntArray:
    """Pieces of the stretch of most worth in spans (k, 2) of pieces: `least` to `count` of them."""
    worth = np.concatenate([[0.0], np.cumsum(value)])
    best, pieces = -np.inf, np.arange(0)
    for start, end in spans.tolist():
        size = min(end - start, count)
        if size < least:
            continue
        first = start + int(
            np.argmax(worth[start + size : end + 1] - worth[start : end + 1 - size])
        )
        if worth[first + size] - worth[first] > best:
            best, pieces = worth[first + size] - worth[first], np.arange(first, first + size)
    return pieces


def _shortened(
    toolpaths: Toolpaths, along: Sequence[Profile], chosen: dict[int, BoolArray]
) -> Toolpaths:
    """Toolpaths with each profiled path cut to its stretches."""
    profile = {one.path: one for one in along}
    parts: list[FloatArray] = []
    source, closed = [], []
    for k in range(len(toolpaths)):
        span = slice(toolpaths.offsets[k], toolpaths.offsets[k + 1])
        link = toolpaths.link[span, None]
        line = np.hstack([toolpaths.points[span], toolpaths.normals[span], link])
        whole = k not in chosen or bool(chosen[k].all())
        stretches = (
            [line] if whole else _stretches(line, profile[k], chosen[k], toolpaths.closed[k])
        )
        parts += stretches
        source += len(stretches) * [k]
        closed += len(stretches) * [bool(toolpaths.closed[k]) and whole]
    if not parts:
        return Toolpaths.empty()
    columns = np.concatenate(parts)
    normals = columns[:, 3:6] / np.linalg.norm(columns[:, 3:6], axis=1)[:, None]
    return Toolpaths(
        points=columns[:, :3],
        normals=normals,
        offsets=np.concatenate([[0], np.cumsum([len(part) for part in parts])]),
        layer=toolpaths.layer[source],
        kind=toolpaths.kind[source],
        closed=np.array(closed),
        link=columns[:, 6] > 0.0,
    )


def _stretches(
    line: FloatArray, profile: Profile, keep: BoolArray, closed: bool
) -> list[FloatArray]:
    """Kept stretches of a line (n, 7); the two beside the seam of a ring are joined."""
    spans = runs(keep)
    if closed and len(spans) > 1 and keep[0] and keep[-1]:
        spans = np.concatenate([spans[1:-1], [[spans[-1, 0], len(keep) + spans[0, 1]]]])
    step, origin = profile.step, profile.origin
    return [_between(line, origin + a * step, origin + b * step) for a, b in spans]


def _between(line: FloatArray, start: float, end: float) -> FloatArray:
    """Part of a line (n, 7) between two arc lengths, which may pass the end of a ring.

    Columns are the point, its normal, and whether the step to the next point is a link.
    """
    along = along_line(line[:, :3])
    if end > along[-1] * (1.0 + 1e-12):  # past the seam, at most once round
        line = np.concatenate([line[:-1], line[:-1], line])
        along = np.concatenate([along, along[-1] + along[1:], 2.0 * along[-1] + along[1:]])
    inside = along[(along > start + 1e-9) & (along < end - 1e-9)]
    wanted = np.concatenate([[start], inside, [end]])
    step = np.searchsorted(along, 0.5 * (wanted[1:] + wanted[:-1]), side="right") - 1
    link = np.append(line[step, 6], 0.0)
    return np.column_stack([points_along(line[:, :6], along, wanted), link])
