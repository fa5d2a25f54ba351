"""Parallel lines across a section, and their linking into few paths."""

from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray, repeated
from ccfem.geometry.offsets import inset, rings
from ccfem.geometry.shapes import Region


@dataclass(frozen=True)
class Hatch:
    """Parallel lines clipped to a section, in coordinates rotated so that they run along x.

    Line s runs from its left end ``2 s`` to its right end ``2 s + 1``.

    Attributes
    ----------
    ends : (2 s, 2) array, mm
        Left and right end of each line.
    row : (s,) int array
        Which of the parallel lines each piece belongs to.
    pitch : float, mm
        Distance between the rows.
    angle : float, radians
        Direction of the lines in the coordinates of the section.
    border : tuple of (k, 2) arrays, mm
        Rings of the section, material on the left.
    ring : (2 s,) int array
        The ring that each end lies on.
    position : (2 s,) array
        Position on the ring: segment number plus the share of the segment.
    """

    ends: FloatArray
    row: IntArray
    pitch: float
    angle: float
    border: tuple[FloatArray, ...]
    ring: IntArray
    position: FloatArray

    def to_section(self, points: FloatArray) -> FloatArray:
        """Points (..., 2) in the coordinates of the section, mm."""
        return points @ _turn(self.angle)

    @property
    def lines(self) -> list[FloatArray]:
        """The lines as (2, 2) arrays in the coordinates of the section, alternately reversed."""
        pairs = self.to_section(self.ends).reshape(-1, 2, 2)
        odd = self.row % 2 == 1
        pairs[odd] = pairs[odd, ::-1]
        return list(pairs)


def _turn(angle: float) -> FloatArray:
    """Matrix that rotates row vectors by `angle`."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def hatch(section: Region, angle: float, pitch: float) -> Hatch:
    """Clip parallel lines to a section.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    angle : float, radians
        Direction of the lines to the first axis.
    pitch : float, mm
        Distance between the lines, > 0; the first one is half of it inside the section's extent.

    Returns
    -------
    Hatch
        Without lines for an empty section. A line through a vertex counts as passing above it,
        so that every row enters and leaves the section equally often.
    """
    border = tuple(ring @ _turn(-angle) for ring in rings(section))
    if not border:
        none = np.zeros(0, dtype=np.int64)
        return Hatch(np.zeros((0, 2)), none, pitch, angle, (), none, np.zeros(0))
    a = np.concatenate([ring[:-1] for ring in border])
    b = np.concatenate([ring[1:] for ring in border])
    ring, number = repeated(np.array([len(ring) - 1 for ring in border]))
    lowest = float(a[:, 1].min()) + 0.5 * pitch
    # Rows that an edge crosses: those from `first` up to, not including, `end`.
    level_a, level_b = np.ceil((a[:, 1] - lowest) / pitch), np.ceil((b[:, 1] - lowest) / pitch)
    first = np.minimum(level_a, level_b).astype(np.int64)
    count = np.abs(level_a - level_b).astype(np.int64)
    edge, row = repeated(count)
    row = row + first[edge]
    # Where each edge crosses its rows; sorted by row, crossings alternate between entering and
    # leaving.
    y = lowest + pitch * row
    t = np.clip((y - a[edge, 1]) / (b[edge, 1] - a[edge, 1]), 0.0, 1.0)
    x = a[edge, 0] + t * (b[edge, 0] - a[edge, 0])
    order = np.lexsort((x, row))
    return Hatch(
        ends=np.stack([x, y], axis=1)[order],
        row=row[order][::2],
        pitch=pitch,
        angle=angle,
        border=border,
        ring=ring[edge][order],
        position=(number[edge] + t)[order],
    )


def link_hatch(lines: Hatch, section: Region, width: float) -> list[FloatArray]:
    """Link the ends of hatch lines into as few paths as a sweep finds.

    A link joins two consecutive ends on a border ring, so that no link crosses a line or another
    link. It is straight if that stays in the section, and otherwise follows the border. Where the
    border is nearly parallel to the lines, the longer line ends early, so that the link does not
    lie on it. Ends of one row (at both sides of a hole or notch) are linked only if the link keeps
    `width` from the next row.

    Paths are (k, 2) arrays, mm, in the coordinates of the section.
    """
    if not len(lines.row):
        return []
    links = _links(lines, section, width)
    sweeps = (_sweep(lines, links, *way) for way in ((1, 0), (1, 1), (-1, 0), (-1, 1)))
    chains = min(sweeps, key=len)
    return [lines.to_section(_polyline(lines, links, chain)) for chain in chains]


def zigzag(
    section: Region, distance: float, width: float, pitch: float, angle: float
) -> list[FloatArray]:
    """Linked hatch lines, (k, 2) arrays in mm, at least `distance` inside a section.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    distance : float, mm
        From the border to the nearest line or link.
    width : float, mm
        Minimum distance between strands; parts narrower than it stay empty.
    pitch : float, mm
        Distance between the lines.
    angle : float, radians
        Direction of the lines to the first axis.
    """
    inner = inset(section, distance, width)
    return link_hatch(hatch(inner, angle, pitch), inner, width)


Links = list[dict[int, FloatArray]]
"""For each end, the ends that it may be linked to, with the points (k, 2) from one to the other."""

_FLATTEST = 1.5
"""Longest run of a straight link along the lines, in pitches: 34 degrees to the lines."""


def _links(lines: Hatch, section: Region, width: float) -> Links:
    """All links that keep the rules of `link_hatch`."""
    order = np.lexsort((lines.position, lines.ring))
    links: Links = [{} for _ in order]
    arcs: list[tuple[int, int, FloatArray]] = []
    ring = lines.ring[order]
    starts = np.flatnonzero(np.concatenate([[True], ring[1:] != ring[:-1]]))
    # Ends that follow each other on a ring of the border.
    for members in np.split(order, starts[1:]):
        for e, f in zip(members.tolist(), np.roll(members, -1).tolist(), strict=True):
            if e // 2 != f // 2:
                arcs.append((e, f, _border_between(lines, e, f)))
    if not arcs:
        return links
    pairs = np.array([arc[:2] for arc in arcs])
    chords = lines.ends[pairs]
    clipped = _clipped(lines, pairs)
    grown = shapely.buffer(section, 1e-6, join_style="mitre")
    shapely.prepare(grown)
    short = shapely.covers(grown, shapely.linestrings(lines.to_section(clipped)))
    straight = shapely.covers(grown, shapely.linestrings(lines.to_section(chords)))
    for k, (e, f, between) in enumerate(arcs):
        if lines.row[e // 2] == lines.row[f // 2]:
            # Two ends of one row: only where the border between them keeps clear of the next row.
            rise = np.abs(between[:, 1] - lines.ends[e, 1]).max(initial=0.0)
            if rise > lines.pitch - width or f in links[e]:
                continue
        if short[k]:
            link = clipped[k]
        elif straight[k]:
            link = chords[k]
        else:
            link = np.concatenate([chords[k, :1], between, chords[k, 1:]])
        links[e][f], links[f][e] = link, link[::-1]
    return links


def _clipped(lines: Hatch, pairs: IntArray) -> FloatArray:
    """Straight links (n, 2, 2) between ends; too flat ones cut off up to half the longer line."""
    chords = lines.ends[pairs]
    side = np.where(pairs % 2 == 1, 1.0, -1.0)
    x = chords[:, :, 0] * side
    middle = 0.5 * (x + lines.ends[pairs ^ 1, 0] * side)
    limit = x.min(axis=1, keepdims=True) + _FLATTEST * lines.pitch
    same_side = side[:, :1] == side[:, 1:]
    chords[:, :, 0] = np.where(same_side, np.minimum(x, np.maximum(limit, middle)), x) * side
    return chords


def _border_between(lines: Hatch, e: int, f: int) -> FloatArray:
    """Border vertices between end e and the next end f on its ring."""
    ring, p, q = lines.border[lines.ring[e]][:-1], lines.position[e], lines.position[f]
    first, last = int(np.floor(p)) + 1, int(np.ceil(q)) - 1
    if q > p:
        return ring[first : last + 1]
    return np.concatenate([ring[first:], ring[: last + 1]])


def _sweep(lines: Hatch, links: Links, direction: int, side: int) -> list[list[int]]:
    """Chains of ends (entry, exit, entry, ...), following links to the rows ahead first.

    The sweep goes up (direction 1) or down (-1). A chain starts at the left end (side 0) or the
    right end (1) of a line.
    """
    row = (direction * lines.row).tolist()
    used = [False] * len(row)
    chains = []
    for seed in np.argsort(row, kind="stable").tolist():
        if used[seed]:
            continue
        used[seed] = True
        chain = [2 * seed + side, 2 * seed + 1 - side]
        for _ in range(2):
            _follow_links(chain, links, row, used)
            chain.reverse()
        chains.append(chain)
    return _merge(chains, links)


def _follow_links(chain: list[int], links: Links, row: list[int], used: list[bool]) -> None:
    """Lengthen a chain at its end as far as there are links to unused lines."""
    while True:
        free = [f for f in links[chain[-1]] if not used[f // 2]]
        if not free:
            return
        best = max(free, key=lambda f: row[f // 2])
        used[best // 2] = True
        chain += [best, best ^ 1]


def _merge(chains: list[list[int]], links: Links) -> list[list[int]]:
    """Join chains whose ends may be linked to each other."""
    merged: list[list[int]] = []
    for chain in chains:
        k = 0
        while k < len(merged):
            other = merged[k]
            if other[0] in links[chain[-1]] or other[0] in links[chain[0]]:
                other = other[::-1]
            if other[-1] in links[chain[-1]]:
                chain = chain[::-1]
            if other[-1] in links[chain[0]]:
                chain = other + chain
                del merged[k]
                k = 0
            else:
                k += 1
        merged.append(chain)
    return merged


def _polyline(lines: Hatch, links: Links, chain: list[int]) -> FloatArray:
    """Points of a chain of ends, (k, 2), mm, in turned coordinates."""
    joints = [links[e][f] for e, f in zip(chain[1:-1:2], chain[2::2], strict=True)]
    return np.concatenate([lines.ends[chain[:1]], *joints, lines.ends[chain[-1:]]])
