"""Concentric strands: rings along the border, and lines along the middle of the remaining strip."""

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.geometry.medial_axis import MedialAxis, medial_axis
from ccfem.geometry.offsets import inset, rings
from ccfem.geometry.polylines import is_closed, line_length, runs, straight_pieces
from ccfem.geometry.shapes import Region, corners_only

_LEAST_GAP = 0.5
"""Narrowest strip, in pitches, that gets a strand, which then overlaps its neighbours: the sum of
gap and overlap is then smallest."""
_SAME = 1e-4
"""Distance, in widths, below which neighbouring points of a ring are the same."""
_STRAIGHT = 0.03
"""Deviation, in pitches, up to which points of a middle line are left out."""


def shells(
    section: Region, width: float, pitch: float, count: int, closest: float
) -> tuple[list[FloatArray], Region]:
    """Rings along every border of a section, and the region inside them.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    width : float, mm
        Width of a strand; the first ring lies half of it inside the border.
    count : int
        Number of rings. Parts thinner than twice as many are filled by them.
    pitch, closest
        As in `concentric`.

    Returns
    -------
    lines : list of (k, 2) arrays, mm
        Closed rings, and open lines along the middle of parts without room for rings.
    interior : shapely (Multi)Polygon, mm
        The rest of the section, half a pitch inside the innermost rings.
    """
    section = corners_only(section)
    if count == 0:
        return [], section
    interior = inset(section, 0.5 * width + (count - 0.5) * pitch)
    parts = shapely.get_parts(interior)  # without parts whose width is only rounding error
    wide = ~shapely.is_empty(shapely.buffer(parts, -1e-3 * pitch, join_style="mitre"))
    interior = interior if wide.all() else shapely.multipolygons(parts[wide])
    return concentric(section, pitch, closest, 0.5 * width, count), interior


def concentric(
    section: Region,
    pitch: float,
    closest: float,
    first: float | None = None,
    count: int | None = None,
    walls: bool = True,
) -> list[FloatArray]:
    """Fill a section with rings parallel to its border.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    pitch : float, mm
        Distance of neighbouring rings.
    closest : float
        Least distance between opposite sides of a ring, in pitches. A ring is cut short where the
        section is narrower.
    first : float, mm, optional
        Distance of the first ring to the border; default half a pitch.
    count : int, optional
        Number of rings; by default as many as fit.
    walls : bool, default True
        Whether the border is that of the part, which no strand may exceed. The border of other
        strands may be overlapped where the section is narrower than a pitch.

    Returns
    -------
    list of (k, 2) arrays, mm
        Closed rings from the border inwards, then lines along the middle of the remaining strips;
        lines round a hole are closed.
    """
    first = 0.5 * pitch if first is None else first
    section = corners_only(section)
    if shapely.is_empty(section):
        return []
    lines: list[FloatArray] = []
    level = 0
    while count is None or level < count:
        level_rings = rings(_without_channels(section, first + level * pitch, closest * pitch))
        if not level_rings:
            break
        lines += level_rings
        level += 1
    if count is not None and not _narrow(section, first, pitch, closest, count):
        return lines
    axis = medial_axis(section, 0.5 * min(pitch, 2.0 * first))
    return lines + _middle_lines(axis, lines, pitch, closest, first, count, walls)


def _without_channels(section: Region, distance: float, width: float) -> Region:
    """Part of a section inside a distance, without channels narrower than a width.

    As `inset`, but corners stay sharp: strands fill them, at the cost of lying closer there.
    """
    radius = 0.4995 * width
    core = shapely.buffer(section, -(distance + radius), join_style="mitre")
    if core.is_empty:
        return core
    core = shapely.buffer(core, radius, join_style="mitre")
    core = shapely.intersection(core, shapely.buffer(section, -distance, join_style="mitre"))
    parts = shapely.get_parts(core)  # without lines that a common border leaves
    parts = parts[(shapely.get_dimensions(parts) == 2) & (shapely.area(parts) > 1e-6 * width**2)]
    return shapely.remove_repeated_points(shapely.multipolygons(parts), _SAME * width)


def _narrow(section: Region, first: float, pitch: float, closest: float, count: int) -> bool:
    """Whether some part of the section is too narrow for `count` rings, apart from its corners."""
    depth = first + (count - 1 + 0.5 * closest) * pitch
    core = shapely.buffer(section, -depth, join_style="mitre")
    reached = shapely.buffer(core, 1.05 * depth + 0.1 * pitch, join_style="mitre")
    rest = shapely.difference(section, reached)
    return not shapely.is_empty(rest)


def _middle_lines(
    axis: MedialAxis,
    shells: list[FloatArray],
    pitch: float,
    closest: float,
    first: float,
    count: int | None,
    walls: bool,
) -> list[FloatArray]:
    """Lines along the medial axis of a section, where the rings leave a strip.

    Between the innermost rings on both sides of the axis there is a strip at most two pitches wide.
    A strand is laid along its middle if it is at least half a pitch wide; with a `count`, only if
    there is room for fewer rings. Parameters as in `concentric`.
    """
    pieces = []
    degree = np.bincount([end for s in axis.segments for end in s.ends if end >= 0])
    for segment in axis.segments:
        points, depth = segment.points, segment.radius - first
        wanted = _wanted(depth, pitch, closest, count)
        if walls:
            wanted &= depth >= -1e-3 * pitch
        if not segment.closed:
            free = degree[list(segment.ends)] == 1
            points, wanted = _to_the_end(points, depth if walls else segment.radius, wanted, free)
        pieces += _runs(points, wanted)
    if not pieces:
        return []
    tree = shapely.STRtree(shapely.linestrings(straight_pieces(shells)))
    lines = []
    for piece in pieces:
        # Not where rings are nearer than strands may be.
        near, _ = tree.query(
            shapely.points(piece), predicate="dwithin", distance=(closest - 1e-3) * pitch
        )
        clear = np.ones(len(piece), dtype=bool)
        clear[near] = False
        lines += _runs(piece, clear)
    tolerance = _STRAIGHT * pitch
    lines = [shapely.get_coordinates(shapely.LineString(x).simplify(tolerance)) for x in lines]
    return [line for line in lines if line_length(line) >= pitch]


def _to_the_end(
    points: FloatArray, depth: FloatArray, wanted: BoolArray, free: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Line extended straight at its free ends, up to the end of the strip that it lies in."""
    before, after = points[:1], points[-1:]
    if free[0]:
        way = points[0] - points[1]
        before = before + max(depth[0], 0.0) * way / np.linalg.norm(way)
    if free[1]:
        way = points[-1] - points[-2]
        after = after + max(depth[-1], 0.0) * way / np.linalg.norm(way)
    wanted = np.concatenate([wanted[:1] & free[0], wanted, wanted[-1:] & free[1]])
    return np.concatenate([before, points, after]), wanted


def _wanted(depth: FloatArray, pitch: float, closest: float, count: int | None) -> BoolArray:
    """Where along the axis a strand is laid; `depth` is the distance to the first ring."""
    room = depth / pitch + 0.5  # in pitches, from the outer edge of the first ring's share
    fitting = np.maximum(np.floor(room + 0.5 - 0.5 * closest + 1e-3), 0.0)
    strip = 2.0 * (room - fitting)
    wanted = strip >= max(_LEAST_GAP, 2.0 * closest - 1.0) - 1e-6
    return wanted if count is None else wanted & (fitting < count)


def _runs(line: FloatArray, wanted: BoolArray) -> list[FloatArray]:
    """Pieces of a polyline between neighbouring wanted points; one that goes all round stays so."""
    if wanted.all():
        return [line]
    closed = len(line) > 2 and is_closed(line)
    if closed and wanted[0]:
        start = int(np.argmin(wanted))
        line = np.concatenate([line[start:-1], line[: start + 1]])
        wanted = np.concatenate([wanted[start:-1], wanted[: start + 1]])
    return [line[a:b] for a, b in runs(wanted) if b - a > 1]
