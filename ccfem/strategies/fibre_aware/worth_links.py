"""Links chosen by their gain: they make paths long enough, and are fibre themselves.

If the shortest links were taken first, strands that need none would be joined, and others would be
left without a partner. Here the gain of a link is the worth of the best stretches of the joined
path, less that of the two paths it joins. The links of largest gain are taken first, one by one.
Then strands that are still too short get partners from others, where the total worth increases.
"""

import heapq
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.geometry.polylines import line_length
from ccfem.geometry.shapes import Region, strings
from ccfem.paths.linking.joining import Joined, Joint, join
from ccfem.paths.linking.possible_links import (
    CLEARANCE,
    CLOSING_TURN,
    Link,
    cut_back,
    cut_start,
    possible_links,
    shortened,
)
from ccfem.strategies.fibre_aware.path_profile import Profile

_HOPE = 0.5
"""Factor on the gain of a chain that is too short, besides its share of the length that it needs:
joined to another one it may become long enough."""

_ROUNDS, _TRIES = 2, 24
"""Rounds in which partners are changed, and number of changes tried in each."""

_EQUAL = 1e-6
"""Difference, as a share of all gains, up to which two gains are equal."""

_BESIDE, _ALONG, _REACH = 0.95, 0.7, 0.2
"""Distance in widths and cosine of the angle up to which a link lies beside a strand that it joins,
where it adds no stiffness; and length, mm, to both sides over which directions are taken."""


def link_by_worth(
    lines: Sequence[FloatArray],
    section: Region,
    limit: float,
    width: float,
    radius: float,
    enough: float,
    worth: Callable[[Sequence[FloatArray]], Sequence[Profile]],
    cheapest: float = 0.1,
) -> Joined:
    """Join ends that lie near each other by the links of largest gain.

    Links are those of `ccfem.paths.linking.joining.link_ends` with the same clearance. Links with
    corners are marked, and join only strands that are too short.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    limit : float, mm
        Longest link.
    width : float, mm
        Of a strand.
    radius : float, mm
        Least radius of a turn.
    enough : float, mm
        Length that a path needs.
    worth : callable
        Returns the profiles of given lines, one for each.
    cheapest : float in [0, 1], default 0.1
        Share of the lines, those worth least, that sets the price of length.
    """
    possible = possible_links(lines, section, limit, width, radius=radius)
    links = sorted(possible, key=lambda x: (not x.smooth, round(x.cost, 6), x.first, x.second))
    if not links:
        return join(lines, [])
    along = worth([*lines, *(link.path for link in links)])
    on_lines, between = along[: len(lines)], along[len(lines) :]
    price = _price(on_lines, cheapest)
    shares = _beside_none(lines, links, between, width)
    choice = _Choice(
        lines,
        links,
        [(profile.value - price) * profile.step for profile in on_lines],
        [(p.value * x - price) * p.step for p, x in zip(between, shares, strict=True)],
        enough,
        CLEARANCE * width,
    )
    best = choice.greedy(())
    for _ in range(_ROUNDS):
        better = choice.changed(best)
        if better is None:
            break
        best = better
    joints = [
        Joint(x.first, x.second, x.path[1:-1], not x.smooth) for x in (links[k] for k in best.taken)
    ]
    return join(best.lines, joints)


def _price(along: Sequence[Profile], cheapest: float) -> float:
    """Largest worth per length in the cheapest part of lines; never quite zero."""
    value = np.concatenate([profile.value for profile in along])
    length = np.repeat(
        [profile.step for profile in along], [len(profile.value) for profile in along]
    )
    order = np.argsort(value, kind="stable")
    total = np.cumsum(length[order])
    place = int(np.searchsorted(total, cheapest * total[-1]))
    return max(float(value[order][place]), 1e-3 * float(value.max()))


def _beside_none(
    lines: Sequence[FloatArray], links: Sequence[Link], along: Sequence[Profile], width: float
) -> list[FloatArray]:
    """For the pieces of each link 1, or 0 where they lie beside a strand that the link joins."""
    counts = [len(profile.value) for profile in along]
    of = np.repeat(np.arange(len(links)), counts)
    middle = np.concatenate(
        [(np.arange(len(profile.value)) + 0.5) * profile.step for profile in along]
    )
    path = strings([link.path for link in links])[of]
    places, way = shapely.line_interpolate_point(path, middle), _direction(path, middle)
    clear = np.ones(len(of), dtype=bool)
    for side in (0, -1):
        tips = [link.first if side == 0 else link.second for link in links]
        heads = [lines[end // 2][:: -1 if end % 2 else 1] for end in tips]
        left = [cut_start(x, link.path[side]) for x, link in zip(heads, links, strict=True)]
        whole = np.array([len(line) > 1 for line in left])[of]
        strand = strings([x if len(x) > 1 else y for x, y in zip(left, heads, strict=True)])[of]
        at = shapely.line_locate_point(strand, places)
        near = whole & (at > 1e-3) & (shapely.distance(strand, places) < _BESIDE * width)
        clear &= ~(near & (np.abs((way * _direction(strand, at)).sum(axis=1)) > _ALONG))
    return np.split(clear.astype(float), np.cumsum(counts)[:-1])


def _direction(lines: Any, at: FloatArray) -> FloatArray:
    """Return unit vectors (k, 2) along lines at arc lengths."""
    ends = [
        shapely.line_interpolate_point(lines, np.maximum(at + x * _REACH, 0.0)) for x in (-1, 1)
    ]
    step = shapely.get_coordinates(ends[1]) - shapely.get_coordinates(ends[0])
    return np.asarray(step / np.maximum(np.linalg.norm(step, axis=1), 1e-9)[:, None])


@dataclass(frozen=True)
class _Chain:
    """Joined lines: gains of their pieces, from the first end to the last."""

    pieces: FloatArray
    length: float
    first: int
    last: int
    gain: float

    def read(self, end: int, last: bool, off: float) -> FloatArray:
        """Pieces ordered with one end of the chain last or first, without `off` mm at that end."""
        pieces = self.pieces if (self.last == end) == last else self.pieces[::-1]
        count = round(off)
        return pieces[: len(pieces) - count] if last else pieces[count:]


@dataclass(frozen=True)
class _Taken:
    """Links taken, the lines cut back to them, the gain, and the ends of chains too short."""

    taken: list[int]
    lines: list[FloatArray]
    gain: float
    short: list[int]


class _Choice:
    """Possible links, and the gains of the pieces of lines and links."""

    def __init__(
        self,
        lines: Sequence[FloatArray],
        links: Sequence[Link],
        gains: Sequence[FloatArray],
        between: Sequence[FloatArray],
        enough: float,
        clearance: float,
    ) -> None:
        self.lines, self.links, self.between = list(lines), links, between
        self.enough = enough
        self.off = [(self._off(x.first, x.path[0]), self._off(x.second, x.path[-1])) for x in links]
        self.length = [line_length(link.path) for link in links]
        paths = strings([link.path for link in links])
        one, other = shapely.STRtree(paths).query(paths, predicate="dwithin", distance=clearance)
        self.near: list[set[int]] = [set() for _ in links]
        for a, b in zip(one.tolist(), other.tolist(), strict=True):
            self.near[a].add(b)
        self.at: dict[int, list[int]] = {}
        for k, link in enumerate(links):
            for end in (link.first, link.second):
                self.at.setdefault(end, []).append(k)
        self.alone = {
            k: self.chain(pieces, line_length(self.lines[k]), 2 * k, 2 * k + 1)
            for k, pieces in enumerate(gains)
        }
        self.equal = _EQUAL * sum(float(np.maximum(pieces, 0.0).sum()) for pieces in gains)

    def _off(self, end: int, place: FloatArray) -> float:
        """Length, mm, by which a link that leaves a line at a place shortens it."""
        line = self.lines[end // 2][:: -1 if end % 2 else 1]
        left = cut_start(line, place)
        return 0.0 if left is line else line_length(line) - line_length(left)

    def chain(self, pieces: FloatArray, length: float, first: int, last: int) -> _Chain:
        """Chain with the gain of its best stretches, or a reduced one where it is too short."""
        if length >= self.enough:
            gain = Profile(0, pieces, 1.0, 0.0).kept(0.0, self.enough, 0.0)[1]
        else:
            gain = _HOPE * length / self.enough * max(float(pieces.sum()), 0.0)
        return _Chain(pieces, length, first, last, gain)

    def greedy(self, begun: Iterable[int]) -> _Taken:
        """Take the links given first, then those of largest gain, one by one."""
        state = _State(self)
        for k in begun:
            joined = state.joined(k, whatever=True)
            if joined is not None:
                state.take(k, joined[1])
        heap: list[tuple[int, int]] = []

        def offer(some: Iterable[int]) -> None:
            for k in some:
                joined = state.joined(k)
                if joined is not None and joined[0] > self.equal:
                    heapq.heappush(heap, (-round(joined[0] / self.equal), k))

        offer(range(len(self.links)))
        while heap:
            gain, k = heapq.heappop(heap)
            joined = state.joined(k)
            if joined is None or joined[0] <= self.equal:
                continue
            if -round(joined[0] / self.equal) > gain:  # gain has fallen since it was offered
                offer([k])
                continue
            for end in state.take(k, joined[1]):
                offer(self.at.get(end, ()))
        return state.taken()

    def changed(self, before: _Taken) -> _Taken | None:
        """Try every partner for each chain that is too short: the best choice, if it is better."""
        best, better = before, None
        for k in sorted({k for end in before.short for k in self.at.get(end, ())})[:_TRIES]:
            ends = {self.links[k].first, self.links[k].second}
            rest = [
                j
                for j in before.taken
                if j not in self.near[k] and not ends & {self.links[j].first, self.links[j].second}
            ]
            choice = self.greedy([k, *rest])
            if choice.gain > best.gain + self.equal:
                best = better = choice
        return better


class _State:
    """Chains while links are taken."""

    def __init__(self, choice: _Choice) -> None:
        self.choice, self.lines = choice, list(choice.lines)
        self.chains, self.of = dict(choice.alone), np.arange(len(choice.lines))
        self.used: set[int] = set()
        self.barred: BoolArray = np.zeros(len(choice.links), dtype=bool)
        self.links: list[int] = []

    def joined(self, k: int, whatever: bool = False) -> tuple[float, _Chain] | None:
        """Gain of a link, and the chain that it makes; None where it cannot be taken.

        With `whatever`, lengths and corners do not matter.
        """
        choice, link = self.choice, self.choice.links[k]
        if self.barred[k] or link.first in self.used or link.second in self.used:
            return None
        one, other = (self.chains[int(self.of[end // 2])] for end in (link.first, link.second))
        closes = one is other
        if closes and link.turn > CLOSING_TURN:
            return None
        short = min(one.length, other.length) < choice.enough
        if not (link.smooth or short or whatever):
            return None
        off = choice.off[k]
        pieces = [one.read(link.first, True, off[0]), choice.between[k]]
        length = one.length + choice.length[k] - sum(off)
        if closes:
            pieces[0] = pieces[0][round(off[1]) :]
            chain = choice.chain(np.concatenate(pieces), length, one.first, one.last)
            return chain.gain - one.gain, chain
        pieces.append(other.read(link.second, False, off[1]))
        ends = one.first + one.last - link.first, other.first + other.last - link.second
        chain = choice.chain(np.concatenate(pieces), length + other.length, *ends)
        return chain.gain - one.gain - other.gain, chain

    def take(self, k: int, chain: _Chain) -> tuple[int, ...]:
        """Take a link unless it crosses what it joins; return the ends of a chain that grew."""
        link = self.choice.links[k]
        owners = sorted({link.first // 2, link.second // 2})
        cut = {owner: cut_back(self.lines[owner], link, owner) for owner in owners}
        self.barred[k] = True
        if min(len(line) for line in cut.values()) < 2:
            return ()
        inner = shapely.linestrings(shortened(link.path))
        if shapely.intersects(inner, strings(list(cut.values()))).any():
            return ()
        for owner, line in cut.items():
            self.lines[owner] = line
        self.links.append(k)
        self.used.update((link.first, link.second))
        self.barred[list(self.choice.near[k])] = True
        into, gone = (int(self.of[end // 2]) for end in (link.first, link.second))
        self.chains[into] = chain
        if into == gone:
            return ()
        self.of[self.of == gone] = into
        del self.chains[gone]
        return chain.first, chain.last

    def taken(self) -> _Taken:
        """Return the links taken so far."""
        enough = self.choice.enough
        gain = sum(chain.gain for chain in self.chains.values() if chain.length >= enough)
        short = [
            end
            for chain in self.chains.values()
            if chain.length < enough
            for end in (chain.first, chain.last)
        ]
        return _Taken(self.links, self.lines, gain, short)
