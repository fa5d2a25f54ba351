"""Links that a machine's fibre can follow: of a least radius, and in line with the strands.

Each link is the shortest curve of the radius (Dubins) from one strand to another. It leaves the
strands before their ends where it is then shorter, or avoids a turn.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.dubins import WORDS, shortest_curve, word_sizes
from ccfem.geometry.polylines import along_line, points_along

_CUTS = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 6.0])
"""Distances before its end at which a strand may be left, in widths."""
_HEADING = 1.0
"""Length, in widths, over which the heading of a strand is measured."""
_STEP = 0.25
"""Longest step along a link, in widths."""
_MOST_TURN = np.radians(200.0)
"""Largest total turn of a link: beyond it there is no strand to be met."""


class SmoothLink(NamedTuple):
    """A possible link: its cost and turn, the two ends, and the points from one to the other."""

    cost: float
    turn: float
    first: int
    second: int
    path: FloatArray


def smooth_links(
    lines: Sequence[FloatArray], ends: IntArray, limit: float, width: float, radius: float
) -> list[SmoothLink]:
    """Find possible links between ends that lie near each other, one for each pair.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    ends : (e,) int array
        Line k starts with end 2 k and stops with end 2 k + 1.
    limit : float, mm
        Largest distance between two ends.
    width : float, mm
        Of a strand.
    radius : float, mm
        Least radius of a link.

    Returns
    -------
    list of SmoothLink
        The cost is the length of the link plus what it cuts off the strands, mm.
    """
    if len(ends) < 2:
        return []
    cuts = _CUTS * width
    poses = np.array([_poses(lines[end // 2], int(end % 2), cuts, width) for end in ends])
    pairs = cKDTree(poses[:, 0, :2]).query_pairs(limit, output_type="ndarray")
    room = np.array([along_line(lines[end // 2])[-1] for end in ends])
    found = _best(poses, pairs, cuts, room, radius, limit + cuts[-1])
    links = []
    for (a, b), (cost, turn, one, other) in zip(pairs, found, strict=True):
        if not np.isfinite(cost):
            continue
        start, end = poses[a, int(one)].copy(), poses[b, int(other)].copy()
        end[2] += np.pi
        path = shortest_curve(start, end, radius, _STEP * width)
        if len(path) > 1:
            links.append(SmoothLink(float(cost), float(turn), int(ends[a]), int(ends[b]), path))
    return links


def _poses(line: FloatArray, side: int, cuts: FloatArray, width: float) -> FloatArray:
    """Poses (c, 3) at places before an end of a line, heading out of the line."""
    head = line if side == 0 else line[::-1]
    along = along_line(head)
    here = points_along(head, along, np.minimum(cuts, along[-1]))
    back = points_along(head, along, np.minimum(cuts + _HEADING * width, along[-1]))
    way = here - back
    # The heading of a chord is that in its middle: on a bend the end turns further by half of it.
    far = points_along(head, along, np.minimum(cuts + 2.0 * _HEADING * width, along[-1]))
    before = back - far
    bend = np.arctan2(
        before[:, 0] * way[:, 1] - before[:, 1] * way[:, 0], (before * way).sum(axis=1)
    )
    heading = np.arctan2(way[:, 1], way[:, 0]) + 0.5 * np.clip(bend, -0.3, 0.3)
    return np.column_stack([here, heading])


@njit(cache=True, nogil=True)
def _best(poses, pairs, cuts, room, radius, limit):  # type: ignore[no-untyped-def]
    """Cost, turn and cuts of the cheapest link of each pair; infinite cost if there is none."""
    result = np.empty((len(pairs), 4))
    sizes = np.empty((6, 3))
    end = np.empty(3)
    for p in range(len(pairs)):
        a, b = pairs[p, 0], pairs[p, 1]
        for column in range(4):
            result[p, column] = np.inf
        for one in range(len(cuts)):
            for other in range(len(cuts)):
                if cuts[one] > 0.4 * room[a] or cuts[other] > 0.4 * room[b]:
                    continue
                end[0], end[1] = poses[b, other, 0], poses[b, other, 1]
                end[2] = poses[b, other, 2] + np.pi
                word_sizes(poses[a, one], end, radius, sizes)
                word, length = 0, np.inf
                for w in range(6):
                    size = abs(sizes[w, 0]) + abs(sizes[w, 1]) + abs(sizes[w, 2])
                    if size < length:
                        word, length = w, size
                cost = length + cuts[one] + cuts[other]
                if not cost < result[p, 0] or length > limit + np.pi * radius:
                    continue
                turn = 0.0
                for piece in range(3):
                    if WORDS[word, piece] != 0:
                        turn += abs(sizes[word, piece]) / radius
                if turn <= _MOST_TURN:
                    result[p, 0], result[p, 1] = cost, turn
                    result[p, 2], result[p, 3] = one, other
    return result
