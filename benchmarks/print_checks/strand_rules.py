"""Rules for every strand, by geometry alone: polylines and polygons, nothing of ccfem.

A strand is a polyline in millimetres, (n, 3), of the middle of the fibre. Strands of one height are
a layer. What is measured of each:

*Folds.* The tangent of a polyline is that of its pieces. Between two pieces whose facing ends are
no farther apart along the strand than a window ``w`` it turns by the angle between them. A radius
``r`` turns by ``w / r`` there; the window is 4 mm at the radius 3.85 mm, ``w = 4 / 3.85 r``, so
that the machine's least radius turns by 59.5 degrees. A turn of more than 90 degrees is a *fold*:
one and a half times that. A circle folds below the radius ``2 w / pi``, .66 of the machine's. A
fold is the shortest part of the strand that turns so far; those that touch or overlap are one.

*Free run.* The longest part of a strand without a fold, to be held against the cutter's length.

*Outside.* The share of the strand's width, mean over its length, that is not over the part's
section at the height of the strand.

*Crossings.* Places where a strand crosses a strand of its layer, itself included, farther than half
a width from any end: what ends on the side of another strand does not cross it.

*Over.* Length along which the axis of another strand, or of this one farther along, is nearer than
half a width; *close*: nearer than nine tenths, which no spacing of a width explains. *Stack*: most
strands at one place of the axis. A crossing explains two widths of lying over, and four of close.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from scipy.spatial import cKDTree

__all__ = ["Measured", "Rules", "broken", "folds", "largest_turn", "measure"]

_LATTICE = 0.002
"""Corners nearer to a straight line than this are those of rounding, mm."""
_SLACK = np.radians(0.5)
"""A right angle of rounded numbers is no fold."""


@dataclass(frozen=True)
class Rules:
    """What strands are held against.

    Attributes
    ----------
    width, radius, length : float, mm
        Of a strand; the machine's least radius; the cutter's least length.
    tail : float, mm
        Length that lies between the cutter and the nozzle.
    turn : float, degrees
        Largest turn within the window.
    outside : float
        Largest share of a strand's width outside the part.
    close : float
        Largest share of its length, crossings aside, that is close to other fibre.
    held : float, mm
        Least length that is held before a cut and after a start.
    """

    width: float = 1.0
    radius: float = 3.85
    length: float = 42.0
    tail: float = 42.0
    turn: float = 90.0
    outside: float = 0.05
    close: float = 0.1
    held: float = 20.0

    @property
    def window(self) -> float:
        """Length over which a turn is measured, mm."""
        return 4.0 / 3.85 * self.radius


@dataclass
class Measured:
    """What was measured of a strand.

    Attributes
    ----------
    points : (n, 3) array, mm
    length : float, mm
    turn : float, degrees
        Largest within the window.
    folds : (k, 2) array, mm
        Where each fold begins and ends along the strand.
    free : float, mm
        Longest run without a fold.
    outside : float
        Share of the width.
    crossings : (m, 2) array, mm
        Places.
    over, close : float, mm
    stack : int
    before_cut, after_start : float, mm
        Length that lies on something without a gap up to the cut, and from the start on. Of paths
        without a print: all up to the cut, and no limit.
    """

    points: np.ndarray
    length: float
    turn: float
    folds: np.ndarray
    free: float
    outside: float = 0.0
    crossings: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    over: float = 0.0
    close: float = 0.0
    stack: int = 1
    before_cut: float = np.inf
    after_start: float = np.inf

    def at(self, along: Sequence[float] | np.ndarray) -> np.ndarray:
        """Places (k, 3) at lengths along the strand."""
        return _places(self.points, np.asarray(along, dtype=float))


def _along(points: np.ndarray) -> np.ndarray:
    """Length of a polyline up to each of its points."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


def _places(points: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Places at lengths along a polyline."""
    at = _along(points)
    return np.stack([np.interp(along, at, column) for column in points.T], axis=-1)


def _plain(points: np.ndarray) -> np.ndarray:
    """Points without those of rounding, and without repeated ones."""
    flat = np.ptp(points[:, 2]) < 1e-9
    if flat:
        line = shapely.simplify(shapely.linestrings(points[:, :2]), _LATTICE)
        plane = shapely.get_coordinates(line)
        points = np.column_stack([plane, np.full(len(plane), points[0, 2])])
    moved = np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9
    return points[np.append(True, moved)]


def _turns(points: np.ndarray, window: float):
    """Pieces i and j, and the cosine between them, for all that are within a window."""
    steps = np.diff(points, axis=0)
    length = np.linalg.norm(steps, axis=1)
    tangents, along = steps / length[:, None], np.append(0.0, np.cumsum(length))
    for lag in range(1, len(steps)):
        first = np.arange(len(steps) - lag)
        # From the end of the piece to the start of the later one.
        first = first[along[first + lag] - along[first + 1] <= window + 1e-9]
        if not len(first):
            return
        yield first, first + lag, np.einsum("ij,ij->i", tangents[first], tangents[first + lag])


def largest_turn(points: np.ndarray, window: float) -> float:
    """Largest angle, degrees, between two pieces of a polyline (n, 3) within a window."""
    least = min((cosine.min() for _, _, cosine in _turns(_plain(points), window)), default=1.0)
    return float(np.degrees(np.arccos(np.clip(least, -1.0, 1.0))))


def folds(points: np.ndarray, window: float, turn: float = 90.0) -> np.ndarray:
    """Beginnings and ends (k, 2), mm along a polyline (n, 3), of its folds."""
    points = _plain(points)
    along, limit = _along(points), np.cos(np.radians(turn) + _SLACK)
    pairs = [
        np.stack([first[cosine < limit], last[cosine < limit]], axis=1)
        for first, last, cosine in _turns(points, window)
    ]
    both = np.concatenate([np.zeros((0, 2), dtype=int), *pairs])
    # The shortest part that turns so far: the latest beginning of each end, and the reverse.
    both = both[np.lexsort((-both[:, 0], both[:, 1]))]
    both = both[np.unique(both[:, 1], return_index=True)[1]]
    both = both[np.lexsort((both[:, 1], both[:, 0]))]
    both = both[np.unique(both[:, 0], return_index=True)[1]]
    merged: list[list[float]] = []
    for begin, end in np.stack([along[both[:, 0] + 1], along[both[:, 1]]], axis=1).tolist():
        if merged and begin <= merged[-1][1] + 1e-9:
            merged[-1][1] = max(merged[-1][1], end)
        else:
            merged.append([begin, end])
    return np.array(merged).reshape(-1, 2)


def free_runs(length: float, bends: np.ndarray) -> np.ndarray:
    """Lengths (k + 1,) of the runs before, between and behind the folds (k, 2) of a strand."""
    return np.append(bends[:, 0], length) - np.append(0.0, bends[:, 1])


def outside_share(points: np.ndarray, width: float, section: Any, step: float = 1.0) -> float:
    """Share of the width of a strand (n, 3), mean over its length, outside a section."""
    along = _along(points)
    count = max(int(np.ceil(along[-1] / step)), 8)
    at = (np.arange(count) + 0.5) * along[-1] / count
    piece = np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(points) - 2)
    ways = np.diff(points[:, :2], axis=0)[piece]
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    across = 0.5 * width * np.stack([-ways[:, 1], ways[:, 0]], axis=1)
    middle = _places(points, at)[:, :2]
    lines = shapely.linestrings(np.stack([middle - across, middle + across], axis=1))
    whole = shapely.contains_properly(section, lines)
    inside = np.where(whole, width, 0.0)
    inside[~whole] = shapely.length(shapely.intersection(lines[~whole], section))
    return float(1.0 - inside.mean() / width)


def crossings(lines: Sequence[np.ndarray], reach: float) -> list[np.ndarray]:
    """Places (k, 2) where each polyline of a layer crosses any, farther than a reach from ends."""
    start = np.concatenate([np.zeros((0, 2)), *(line[:-1, :2] for line in lines)])
    end = np.concatenate([np.zeros((0, 2)), *(line[1:, :2] for line in lines)])
    strand = np.repeat(np.arange(len(lines)), [len(line) - 1 for line in lines])
    along = np.concatenate([np.zeros(0), *(_along(line)[:-1] for line in lines)])
    total = np.array([_along(line)[-1] for line in lines])
    pieces = shapely.linestrings(np.stack([start, end], axis=1))
    a, b = shapely.STRtree(pieces).query(pieces, predicate="intersects")
    a, b = a[a < b], b[a < b]
    ways = end - start
    cross = ways[a, 0] * ways[b, 1] - ways[a, 1] * ways[b, 0]
    # Pieces along each other lie over each other, and do not cross.
    size = np.linalg.norm(ways, axis=1)
    slanted = np.abs(cross) > 1e-3 * size[a] * size[b]
    a, b, cross = a[slanted], b[slanted], cross[slanted]
    gap = start[b] - start[a]
    share = (gap[:, 0] * ways[b, 1] - gap[:, 1] * ways[b, 0]) / cross
    place = start[a] + share[:, None] * ways[a]
    here = along[a] + share * size[a]
    there = along[b] + np.linalg.norm(place - start[b], axis=1)
    inner = (np.minimum(here, total[strand[a]] - here) > reach) & (
        np.minimum(there, total[strand[b]] - there) > reach
    )
    # The pieces of one bend meet without crossing.
    inner &= (strand[a] != strand[b]) | (np.abs(here - there) > reach)
    places: list[list[np.ndarray]] = [[] for _ in lines]
    seen: dict[tuple[int, int], list[float]] = {}
    for k in np.flatnonzero(inner)[np.argsort(here[inner])].tolist():
        pair = (int(strand[a[k]]), int(strand[b[k]]))
        # At a corner two pieces cross the same line: that is one place.
        if any(abs(here[k] - other) < 0.02 for other in seen.setdefault(pair, [])[-2:]):
            continue
        seen[pair].append(here[k])
        for number in set(pair):
            places[number].append(place[k])
    return [np.array(group).reshape(-1, 2) for group in places]


def _neighbours(lines: Sequence[np.ndarray], width: float) -> list[tuple[float, float, int]]:
    """Lengths over and close, and the stack, of each polyline of a layer."""
    step = 0.2 * width
    counts = [max(int(np.ceil(_along(line)[-1] / step)), 2) for line in lines]
    along = [(np.arange(n) + 0.5) / n * _along(x)[-1] for x, n in zip(lines, counts, strict=True)]
    place = np.concatenate([_places(x, s)[:, :2] for x, s in zip(lines, along, strict=True)])
    strand, at = np.repeat(np.arange(len(lines)), counts), np.concatenate(along)
    pairs = cKDTree(place).query_pairs(0.9 * width, output_type="ndarray")
    # What is near by being next along the same strand is left out.
    apart = (strand[pairs[:, 0]] != strand[pairs[:, 1]]) | (
        np.abs(at[pairs[:, 0]] - at[pairs[:, 1]]) > 3.0 * width
    )
    pairs = np.concatenate([pairs[apart], pairs[apart][:, ::-1]])
    distance = np.linalg.norm(place[pairs[:, 0]] - place[pairs[:, 1]], axis=1)
    near = distance < 0.5 * width
    over = np.bincount(pairs[near, 0], minlength=len(place)) > 0
    close = np.bincount(pairs[:, 0], minlength=len(place)) > 0
    others = np.unique(np.stack([pairs[near, 0], strand[pairs[near, 1]]], axis=1), axis=0)
    stack = 1 + np.bincount(others[:, 0].astype(int), minlength=len(place))
    result = []
    for number, line in enumerate(lines):
        mine, size = strand == number, _along(line)[-1] / counts[number]
        result.append((size * over[mine].sum(), size * close[mine].sum(), int(stack[mine].max())))
    return result


def measure(
    strands: Sequence[np.ndarray], rules: Rules, section: Callable[[float], Any] | None = None
) -> list[Measured]:
    """Measure strands (n, 3) of any heights against the section of the part at a height.

    Without a section nothing is outside. Strands that leave their height, on curved layers, are
    measured alone.
    """
    result = []
    for points in strands:
        line = _plain(points)
        bends = folds(points, rules.window, rules.turn)
        length = float(_along(line)[-1])
        share = 0.0
        if section is not None and np.ptp(line[:, 2]) < 1e-9:
            region = section(round(float(line[0, 2]), 4))
            shapely.prepare(region)
            share = outside_share(line, rules.width, region)
        runs = free_runs(length, bends)
        turn = largest_turn(points, rules.window)
        result.append(Measured(line, length, turn, bends, float(runs.max()), share))
        result[-1].before_cut = length - rules.tail
    height = np.array([strand.points[0, 2] for strand in result]).round(3)
    flat = np.array([np.ptp(strand.points[:, 2]) < 1e-9 for strand in result], dtype=bool)
    for level in np.unique(height[flat]).tolist():
        mine = np.flatnonzero(flat & (height == level)).tolist()
        lines = [result[k].points for k in mine]
        for k, places, beside in zip(
            mine,
            crossings(lines, 0.5 * rules.width),
            _neighbours(lines, rules.width),
            strict=True,
        ):
            result[k].crossings = places
            result[k].over, result[k].close, result[k].stack = beside
    return result


def broken(strand: Measured, rules: Rules) -> dict[str, str]:
    """Say what is wrong with a strand, by the name of the rule."""
    wrong = {}
    if len(strand.folds):
        x, y, _ = strand.at([strand.folds[0].mean()])[0]
        wrong["folds"] = f"turns by {strand.turn:.0f} degrees at ({x:.1f}, {y:.1f}) mm"
    if strand.free < rules.length - 0.01:
        wrong["run"] = f"has {strand.free:.1f} mm free of folds"
    if strand.outside > rules.outside:
        wrong["outside"] = f"lies with {strand.outside:.1%} of its width outside the part"
    if len(strand.crossings):
        x, y = strand.crossings[0]
        wrong["crossings"] = f"crosses {len(strand.crossings)} times, as at ({x:.1f}, {y:.1f}) mm"
    # A crossing at a right angle lies over by a width, one at 30 degrees by two.
    explained = 2.0 * rules.width * (1 + len(strand.crossings))
    if strand.over > explained:
        wrong["over"] = f"lies over fibre along {strand.over:.1f} mm"
    elif strand.close > rules.close * strand.length + 2.0 * explained:
        wrong["over"] = f"lies close to fibre along {strand.close:.1f} mm"
    if strand.before_cut < rules.held - 0.01:
        wrong["cut"] = f"is cut with {max(strand.before_cut, 0.0):.1f} mm held"
    if strand.after_start < rules.held - 0.01:
        wrong["start"] = f"is held along {strand.after_start:.1f} mm of its start"
    return wrong
