"""A section as a frame: members along its medial axis, and the joints where they meet."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.geometry.facets import connected
from ccfem.geometry.medial_axis import MedialAxis, MedialSegment, medial_axis
from ccfem.geometry.shapes import Region

FREE = -1
"""Joint of an end that meets no other member."""

ARC_CHORD = 1.6
"""Largest ratio of the length along the border to its chord for the bisector of a corner; a square
corner has 1.41."""

_CONTRACTION = 1.25
"""Length, in radii of the larger joint's disc, below which a member between two joints is merged
into one joint. Two crossing members give two neighbouring junctions of the axis, one radius apart
where they are equally wide and cross at 60 degrees."""


@dataclass(frozen=True)
class Member:
    """A curve of the medial axis with the border points beside it (rails)."""

    points: FloatArray  # (m, 2), mm: along the axis
    # (m, 2), mm: points of the border nearest to each point, on both sides of the walking direction
    left: FloatArray
    right: FloatArray
    # Joints at both ends, `FREE` where there is none; a closed member has `FREE` twice.
    ends: tuple[int, int]
    closed: bool = False  # whether the member is a ring

    def __post_init__(self) -> None:
        freeze(self, points=float, left=float, right=float)

    @cached_property
    def reversed(self) -> "Member":
        """The same member in the opposite direction."""
        return Member(
            self.points[::-1], self.right[::-1], self.left[::-1], self.ends[::-1], self.closed
        )

    @property
    def width(self) -> FloatArray:
        """Distance between the rails at each point, (m,), mm."""
        return np.linalg.norm(self.left - self.right, axis=1)


@dataclass(frozen=True)
class Frame:
    """Members and joints of a section."""

    # The longest first. Empty for sections whose axis is a point: discs, squares.
    members: tuple[Member, ...]
    joints: FloatArray  # (k, 2), mm: middle of each joint
    radius: FloatArray  # (k,), mm: of the disc round the middle that holds the joint

    def __post_init__(self) -> None:
        freeze(self, joints=float, radius=float)


def ends_at(members: Sequence[Member], joint: int) -> list[tuple[int, int]]:
    """Find the ends in a joint: the number of the member, and 0 for its start or 1 for its end."""
    return [(k, side) for k, m in enumerate(members) for side in (0, 1) if m.ends[side] == joint]


def frame(section: Region, step: float) -> Frame:
    """Members and joints of a section.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    step : float, mm
        Largest distance of the samples along the border.
    """
    axis = medial_axis(section, step, object_angle=None, arc_chord=ARC_CHORD)
    joint, short = _joints(axis)
    members = []
    for segment, within in zip(axis.segments, short, strict=True):
        if not within:
            a, b = (FREE if end < 0 else int(joint[end]) for end in segment.ends)
            members.append(_member(segment, (a, b)))
    places, radius = _discs(axis, joint)
    for passed in range(len(places)):
        members = _joined_members(members, passed)
    kept = sorted({end for member in members for end in member.ends} - {FREE})
    number = {FREE: FREE} | {old: new for new, old in enumerate(kept)}
    members = [replace(m, ends=(number[m.ends[0]], number[m.ends[1]])) for m in members]
    members.sort(key=lambda member: -len(member.points))
    return Frame(tuple(members), places[kept], radius[kept])


def _joints(axis: MedialAxis) -> tuple[IntArray, BoolArray]:
    """Joint of each node of the axis, `FREE` for ends; and the mask of segments within joints."""
    ends = np.array([segment.ends for segment in axis.segments], dtype=np.int64).reshape(-1, 2)
    junction = np.bincount(ends[ends >= 0], minlength=len(axis.nodes)) > 2
    length = np.array([segment.length for segment in axis.segments])
    short = np.zeros(len(ends), dtype=bool)
    inner = np.flatnonzero((ends >= 0).all(axis=1))
    inner = inner[junction[ends[inner]].all(axis=1)]
    short[inner] = length[inner] < _CONTRACTION * axis.radius[ends[inner]].max(axis=1)
    group = connected(ends[short], len(axis.nodes))
    joint = np.full(len(axis.nodes), FREE)
    _, joint[junction] = np.unique(group[junction], return_inverse=True)
    return joint, short


def _joined_members(members: list[Member], joint: int) -> list[Member]:
    """Members, merging two that are alone in a joint; a single one becomes a ring."""
    ends = ends_at(members, joint)
    if len(ends) != 2:
        return members
    (k, side), (other, beside) = ends
    if k == other:
        ring = replace(members[k], ends=(FREE, FREE), closed=True)
        return [*members[:k], ring, *members[k + 1 :]]
    member = members[k] if side == 1 else members[k].reversed
    two = members[other] if beside == 0 else members[other].reversed
    whole = Member(
        np.concatenate([member.points, two.points]),
        np.concatenate([member.left, two.left]),
        np.concatenate([member.right, two.right]),
        (member.ends[0], two.ends[1]),
    )
    return [*(m for n, m in enumerate(members) if n not in (k, other)), whole]


def _discs(axis: MedialAxis, joint: IntArray) -> tuple[FloatArray, FloatArray]:
    """Middle (k, 2) and radius (k,) of the discs that hold the junctions of each joint, mm."""
    count = int(joint.max(initial=-1)) + 1
    places, radius = np.zeros((count, 2)), np.zeros(count)
    for k in range(count):
        nodes = axis.nodes[joint == k]
        places[k] = nodes.mean(axis=0)
        away = np.linalg.norm(nodes - places[k], axis=1)
        radius[k] = (axis.radius[joint == k] + away).max()
    return places, radius


def _member(segment: MedialSegment, ends: tuple[int, int]) -> Member:
    """Member of a segment; one without nodes at its ends is a ring."""
    middles = 0.5 * (segment.points[1:] + segment.points[:-1])
    ring = segment.closed and segment.ends[0] == FREE
    return Member(middles, segment.left, segment.right, ends, ring)
