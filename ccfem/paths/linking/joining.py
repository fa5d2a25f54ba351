"""Joining polylines end to end into fewer, longer ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.geometry.polylines import line_length
from ccfem.geometry.shapes import Region, strings
from ccfem.paths.linking.possible_links import (
    CLEARANCE,
    CLOSING_TURN,
    Link,
    cut_back,
    possible_links,
    shortened,
)


@dataclass(frozen=True)
class Joint:
    """A connection of two ends of polylines.

    Ends are numbered: polyline k starts with end 2 k and stops with end 2 k + 1.

    Attributes
    ----------
    first, second : int
        The ends.
    between : (n, 2) array, mm
        Points between them, from `first` to `second`, ends not included.
    marked : bool, default False
        Whether the joint is marked as a link.
    """

    first: int
    second: int
    between: FloatArray
    marked: bool = False


class Joined(NamedTuple):
    """Polylines joined to longer ones, and which steps of them are links.

    Attributes
    ----------
    lines : list of (n, 2) arrays, mm
        A chain of joints that returns to its start gives a closed polyline, first point repeated.
    link : list of (n,) bool arrays
        Whether the step from each point to the next is a link that is marked as one.
    """

    lines: list[FloatArray]
    link: list[BoolArray]


def join(lines: Sequence[FloatArray], joints: Sequence[Joint]) -> Joined:
    """Join polylines at their ends, each in one joint at most; closed ones have none."""
    partner: dict[int, tuple[int, FloatArray, bool]] = {}
    for joint in joints:
        partner[joint.first] = (joint.second, joint.between, joint.marked)
        partner[joint.second] = (joint.first, joint.between[::-1], joint.marked)
    joined = Joined([], [])
    done = np.zeros(len(lines), dtype=bool)
    ends = [end for end in range(2 * len(lines)) if end not in partner]
    for start in [*ends, *range(0, 2 * len(lines), 2)]:
        if done[start // 2]:
            continue
        parts, link = [], []
        end: int | None = start
        while end is not None and not done[end // 2]:
            done[end // 2] = True
            parts.append(lines[end // 2] if end % 2 == 0 else lines[end // 2][::-1])
            link.append(np.zeros(len(parts[-1]), dtype=bool))
            end, between, marked = partner.get(end ^ 1, (None, np.zeros((0, 2)), False))
            if end is not None:
                link[-1][-1] = marked  # the step off the strand
                parts.append(between)
                link.append(np.full(len(between), marked))
        if end is not None:  # back at the start
            parts.append(parts[0][:1])
            link.append(np.zeros(1, dtype=bool))
        joined.lines.append(np.concatenate(parts))
        joined.link.append(np.concatenate(link))
    return joined


def link_ends(
    lines: Sequence[FloatArray],
    section: Region,
    limit: float,
    width: float,
    turn_cost: float = 1.0,
    along_boundary: bool = True,
    radius: float = 0.0,
    enough: float = np.inf,
    one_by_one: bool = False,
) -> Joined:
    """Join ends that lie near each other by links inside the section.

    A link is straight; or, between neighbouring ends on the boundary, it follows the boundary half
    a strand's width inside it. Links are taken in the order of their cost: their length, plus
    `turn_cost` mm for every right angle that the path turns at its ends. A link crosses nothing and
    stays 0.9 widths away from all strands but the two that it joins.

    With a radius, curves that keep it (`smooth_links`) are taken first. Straight links and those
    along the boundary have corners: they only join paths shorter than `enough` to others, and are
    marked as links.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    section : shapely (Multi)Polygon
    limit : float, mm
        Longest link.
    width : float, mm
        Of a strand.
    turn_cost : float, mm, default 1.0
    along_boundary : bool, default True
        Whether links may follow the boundary; otherwise all are straight.
    radius : float, mm, default 0
        Least radius of a turn. With 0 any turn is allowed, and no smooth links are made.
    enough : float, mm, default inf
        With a radius: length above which a path gets no link with corners.
    one_by_one : bool, default False
        Whether a path is continued at both ends until it is long enough before the next one is
        started, from short strands to long ones. Strands side by side then become zigzags.
    """
    links = possible_links(lines, section, limit, width, turn_cost, along_boundary, radius)
    # Rounding must not decide between equal costs: straight links precede those on the boundary.
    size = [line_length(line) if one_by_one else 0.0 for line in lines]
    cost = [link.cost + size[link.first // 2] + size[link.second // 2] for link in links]
    keys = [
        (not x.smooth, round(c, 6), x.first, x.second) for x, c in zip(links, cost, strict=True)
    ]
    links = [links[k] for k in sorted(range(len(links)), key=keys.__getitem__)]
    needed, apart = enough if radius > 0.0 else np.inf, CLEARANCE * width
    return _accept(list(lines), links, apart, needed, radius > 0.0, one_by_one)


def _accept(
    lines: list[FloatArray],
    links: list[Link],
    clearance: float,
    enough: float,
    mark: bool,
    one_by_one: bool,
) -> Joined:
    """Take links greedily, cheapest first, as long as they keep clear of everything else."""
    if not links:
        return join(lines, [])
    paths = strings([link.path for link in links])
    owners = np.array([[link.first // 2, link.second // 2] for link in links])
    taken: set[int] = set()
    accepted: list[Any] = []
    joints = []
    chain = np.arange(len(lines))
    length = np.array([line_length(line) for line in lines])  # of chains, at their numbers
    far = np.arange(2 * len(lines)) ^ 1  # other end of the chain of each end of a chain

    def take(k: int, most_long: int) -> bool:
        link, path = links[k], paths[k]
        if link.first in taken or link.second in taken:
            return False
        # Links with corners serve chains that are too short by themselves.
        long = np.count_nonzero(length[chain[owners[k]]] >= enough)
        if not link.smooth and long > most_long:
            return False
        closes = chain[link.first // 2] == chain[link.second // 2]
        if closes and link.turn > CLOSING_TURN:
            return False
        if accepted and shapely.dwithin(path, np.array(accepted), clearance).any():
            return False
        cut = {owner: cut_back(lines[owner], link, owner) for owner in owners[k].tolist()}
        if min(len(line) for line in cut.values()) < 2:
            return False
        inner = shapely.linestrings(shortened(link.path))
        if shapely.intersects(inner, strings(list(cut.values()))).any():
            return False
        for owner, line in cut.items():
            length[chain[owner]] += line_length(line) - line_length(lines[owner])
            lines[owner] = line
        # Both chains are one: its length, its ends.
        into, gone = chain[owners[k]]
        length[into] += float(path.length) + (0.0 if closes else length[gone])
        chain[chain == gone] = into
        taken.update((link.first, link.second))
        accepted.append(path)
        marked = mark and not link.smooth
        joints.append(Joint(link.first, link.second, link.path[1:-1], marked))
        one, other = far[link.first], far[link.second]
        far[one], far[other] = other, one
        return True

    # Links with corners come last, first those between two paths that are too short. A smooth link
    # needs no second try: whatever blocked it is still there.
    rounds = [(k, 0) for k in range(len(links))]
    if mark:
        rounds += [(k, 1) for k, _ in rounds if not links[k].smooth]
    at_end: dict[int, list[int]] = {}
    for k in range(len(links)) if one_by_one else ():
        for end in (links[k].first, links[k].second):
            at_end.setdefault(end, []).append(k)
    for k, most_long in rounds:
        grown = k if take(k, most_long) and not links[k].smooth and not most_long else None
        while grown is not None and one_by_one:
            tips = far[links[grown].first], far[links[grown].second]
            further = sorted({j for tip in tips for j in at_end.get(int(tip), ())})
            grown = next((j for j in further if take(j, 0)), None)
    return join(lines, joints)
