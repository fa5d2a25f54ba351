"""Lines of matrix layers: walls, zigzag or infill inside them, and lines in the gaps."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import contourpy
import numpy as np
import shapely
from scipy.spatial import Voronoi

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.parallel import in_processes
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.hatch import zigzag
from ccfem.geometry.offsets import inset, offset_rings, rings
from ccfem.geometry.polylines import along_line, between, is_closed, line_length, points_along
from ccfem.geometry.shapes import Region, bands, open_lines, strings
from ccfem.machine.machine import Machine
from ccfem.paths.linking.joining import Joined, Joint, join
from ccfem.paths.plastic.plastic import SOLID, Plastic
from ccfem.paths.plastic.sparse_regions import NOTHING, MatrixSection, matrix_sections
from ccfem.paths.splitting.slabs import Slab
from ccfem.printing.bed_layout import Place
from ccfem.slicing.layers.layer import Layer

# Lines of sparse infill, clipped to a region; those of all layers of a part fit each other.
#
# Ends of neighbouring lines are joined along the border of the region.


_STEPS = 32
"""Steps of the grid on which a gyroid is contoured, in a period."""
_SIMPLER = 1e-3
"""Distance, in periods, up to which points of a gyroid's lines are left out."""


def parallel_lines(region: Region, pitch: float, angle: float) -> list[FloatArray]:
    """Parallel lines (k, 2), mm, whose distances from the origin are multiples of a pitch > 0.

    The angle, radians, is that to the first axis.
    """
    if region.is_empty:
        return []
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    corners = shapely.get_coordinates(region)
    low, high = (corners @ across).min(), (corners @ across).max()
    ends = np.array([(corners @ along).min() - 1.0, (corners @ along).max() + 1.0])
    offsets = pitch * np.arange(np.ceil(low / pitch), np.floor(high / pitch) + 1.0)
    lines = offsets[:, None, None] * across + ends[:, None] * along
    return open_lines(shapely.intersection(shapely.linestrings(lines), region))


def gyroid_lines(region: Region, height: float, period: float) -> list[FloatArray]:
    """Lines (k, 2), mm, in which a plane at a height, mm, cuts a gyroid of a period > 0, mm.

    The surface is ``sin x cos y + sin y cos z + sin z cos x = 0`` with coordinates in ``period / 2
    pi`` (Schoen, Infinite periodic minimal surfaces, NASA TN D-5541, 1970, in the usual nodal
    approximation).
    """
    if region.is_empty:
        return []
    step, turn = period / _STEPS, 2.0 * np.pi / period
    low = np.floor(np.array(region.bounds[:2]) / step) - 1.0
    high = np.ceil(np.array(region.bounds[2:]) / step) + 1.0
    x, y = (step * np.arange(low[k], high[k] + 1.0) for k in (0, 1))
    u, v, w = turn * x[None, :], turn * y[:, None], turn * height
    field = np.sin(u) * np.cos(v) + np.sin(v) * np.cos(w) + np.sin(w) * np.cos(u)
    lines = contourpy.contour_generator(x, y, field).lines(0.0)
    drawn = [shapely.LineString(line) for line in lines if len(line) > 1]
    drawn = shapely.simplify(np.array(drawn, dtype=object), _SIMPLER * period)
    return open_lines(shapely.intersection(drawn, region))


_ON_BORDER = 1e-6
"""Distance from the border of a region, mm, up to which a line ends on it."""


def border_joints(
    lines: Sequence[FloatArray], region: Region, longest: float
) -> list[tuple[int, int, FloatArray]]:
    """Ways along the border of a region that join the ends of lines clipped to it.

    Only ends that follow each other on a ring are joined, the nearest first, so that no way crosses
    a line or is longer than `longest`, mm; none of the lines becomes a ring. Returns two ends, of
    which line k has 2 k and 2 k + 1, and the points (k, 2) between them.
    """
    ends = np.array([line[[0, -1]] for line in lines]).reshape(-1, 2)
    ways: list[tuple[float, int, int, FloatArray]] = []
    for ring in rings(region):
        border, points = shapely.LineString(ring), shapely.points(ends)
        mine = np.flatnonzero(shapely.distance(points, border) < _ON_BORDER)
        place = shapely.line_locate_point(border, points[mine])
        order = np.argsort(place, kind="stable")
        mine, place, whole = mine[order], place[order], line_length(ring)
        twice = np.concatenate([ring[:-1], ring])
        for k in range(len(mine) if len(mine) > 1 else 0):
            following = (k + 1) % len(mine)
            start, end = place[k], place[following] + (whole if following <= k else 0.0)
            if end - start <= longest:
                way = between(twice, start, end)[1:-1]
                ways.append((end - start, int(mine[k]), int(mine[following]), way))
    joined = np.arange(len(lines))
    free, joints = np.ones(len(ends), dtype=bool), []
    for _, a, b, way in sorted(ways, key=lambda one: one[:3]):
        if free[a] and free[b] and joined[a // 2] != joined[b // 2]:
            free[[a, b]] = False
            joined[joined == joined[a // 2]] = joined[b // 2]
            joints.append((a, b, way))
    return joints


_DIRECTED = 0.1
"""Least size of the mean direction of infill, from 0 for none to 1 for parallel lines."""
_OVERLAP = 0.25
"""Overlap of the ends of zigzag and infill with what lies round them, in line widths. Our
choice."""
_OFF = 2e-3
"""Ends of a way between lines of infill, mm, on which it may touch what they end on."""
_EVEN, _ROUNDS = 2e-3, 3
"""Share by which the density of infill may be off in the mean of all layers, and how often its
spacing is changed for that."""


@dataclass(frozen=True)
class MatrixFill:
    """Lines that fill a layer of matrix, on the bed.

    Attributes
    ----------
    section : shapely (Multi)Polygon, mm
    solid : shapely (Multi)Polygon, mm
        What of it is filled; the rest has sparse infill.
    lines : list of (n, 2) arrays, mm
    widths : list of float, mm
        Of each line; less than the machine's in gaps.
    sparse : int
        Number of lines of sparse infill; they are the last ones.
    ways : list of (n,) bool arrays
        Which steps of each of these are ways to a neighbour, on which nothing is laid.
    """

    section: Region = field(default_factory=shapely.Polygon)
    solid: Region = field(default_factory=shapely.Polygon)
    lines: list[FloatArray] = field(default_factory=list)
    widths: list[float] = field(default_factory=list)
    sparse: int = 0
    ways: list[BoolArray] = field(default_factory=list)


def matrix_fills(
    slabs: Sequence[Slab],
    fibre: Sequence[Layer],
    mesh: TetMesh,
    place: Place,
    machine: Machine,
    plastic: Plastic = SOLID,
) -> list[MatrixFill | None]:
    """Find the lines that fill each slab, from the bed up; None for a slab of fibre.

    The zigzag turns from one layer of matrix to the next. `fibre` are flat layers that may get
    fibre.
    """
    width, profile = machine.matrix_width, machine.gcode
    of_matrix = [k for k, slab in enumerate(slabs) if slab.fibre is None]
    fills: list[MatrixFill | None] = [None] * len(slabs)
    for k in of_matrix:
        fills[k] = MatrixFill()
    plane, sections = matrix_sections(slabs, fibre, mesh, place.axes[2], plastic, machine)
    if plane is None:
        return fills

    def on_bed(points: FloatArray) -> FloatArray:
        return place.from_above(plane.to_space(points))  # at any height

    def filled(section: Region, sparse: Region, angle: float, phase: float) -> MatrixFill:
        solid = section if sparse.is_empty else shapely.difference(section, sparse)
        lines, widths = _solid_lines(section, solid, float(np.radians(angle)), plastic, machine)
        infill = _joined_infill(sparse, phase, spacing, lines, plastic, machine)
        drawn = [_begun(on_bed(line), plastic.seam, width) for line in lines]
        return MatrixFill(
            shapely.transform(section, on_bed),
            shapely.transform(solid, on_bed),
            drawn + [on_bed(line) for line in infill.lines],
            widths + [width] * len(infill.lines),
            len(infill.lines),
            infill.link,
        )

    spacing = _even_spacing(list(sections.values()), slabs[0].lower, plastic, width)
    # Skins on lines of no one direction: over a gyroid along its axes, where gaps are shortest.
    even = 0.0 if plastic.infill == "gyroid" else profile.matrix_angle
    # Layers of equal section, filled in the same directions, are filled once.
    asked: dict[int, tuple[Region, Region, float, float]] = {}
    below = NOTHING, 0.0
    for number, k in enumerate(of_matrix):
        if k in sections:
            slab, section, sparse = sections[k]
            height = _middle_height(slab, slabs[0].lower)
            angle = (profile.matrix_angle + profile.matrix_turn * number) % 360.0
            if shapely.difference(below[0], sparse).area > width**2:
                angle = _across(_infill_lines(*below, spacing, plastic, machine), even)
            phase = {"lines": number % 2, "gyroid": height}.get(plastic.infill, 0.0)
            asked[k] = (section, sparse, angle, 0.0 if sparse.is_empty else float(phase))
            below = asked[k][1], asked[k][3]
    unequal = list(dict.fromkeys(asked.values()))
    made = dict(zip(unequal, in_processes(filled, *zip(*unequal, strict=True)), strict=True))
    for k, key in asked.items():
        fills[k] = made[key]
    return fills


def _solid_lines(
    section: Region, solid: Region, angle: float, plastic: Plastic, machine: Machine
) -> tuple[list[FloatArray], list[float]]:
    """Walls, zigzag and lines in gaps that fill the solid part of a section, and their widths."""
    width = machine.matrix_width
    # In a narrower gap a line of the least height would be higher than its shape allows.
    narrow = machine.least_line / machine.line_shape
    walls = offset_rings(section, 0.5 * width, width, width, plastic.walls)
    if solid is section:
        inside = zigzag(section, (plastic.walls + 0.5 - _OVERLAP) * width, width, width, angle)
    else:
        rest = shapely.intersection(solid, inset(section, plastic.walls * width))
        inside = zigzag(rest, (0.5 - _OVERLAP) * width, width, width, angle)
    lines = [ring for level in walls for ring in level] + inside
    gaps, widths = gap_lines(solid, lines, width, narrow)
    return lines + gaps, [width] * len(lines) + widths


def _middle_height(slab: Slab, bottom: float) -> float:
    """Height of the middle of a slab over the bed, mm."""
    return 0.5 * (slab.lower + slab.upper) - bottom


def _even_spacing(
    sections: Sequence[MatrixSection], bottom: float, plastic: Plastic, width: float
) -> float:
    """Distance of lines of infill, mm, with which all layers together have their density.

    How long the lines of a gyroid are changes with the height, and layers near fibre are few: over
    these, not over all heights, its period is right in the mean.
    """
    spacing = plastic.spacing(width)
    layers = [one for one in sections if not one.sparse.is_empty]
    if plastic.infill != "gyroid" or not layers:
        return spacing
    slabs, _, regions = zip(*layers, strict=True)
    high = np.array([slab.upper - slab.lower for slab in slabs])
    wanted = plastic.density * float(high @ shapely.area(regions))

    def length(slab: Slab, sparse: Region) -> float:
        lines = gyroid_lines(sparse, _middle_height(slab, bottom), spacing)
        return float(shapely.length(strings(lines)).sum()) if lines else 0.0

    for _ in range(_ROUNDS):
        lengths = list(in_processes(length, slabs, regions))
        ratio = width * float(high @ lengths) / wanted
        spacing *= np.clip(ratio, 0.8, 1.25)
        if abs(ratio - 1.0) < _EVEN:
            break
    return float(spacing)


def _joined_infill(
    sparse: Region,
    phase: float,
    spacing: float,
    solid: Sequence[FloatArray],
    plastic: Plastic,
    machine: Machine,
) -> Joined:
    """Lines of sparse infill, joined where the way along the wall is sooner gone than over it.

    None of the ways meets a solid line, as those of a skin beside the infill.
    """
    lines, profile = _infill_lines(sparse, phase, spacing, plastic, machine), machine.gcode
    lift = profile.lift / profile.lift_speed + profile.retract / profile.retract_speed
    joints = border_joints(lines, _up_to_walls(sparse, machine), 2.0 * lift * machine.travel_speed)
    if not joints:
        return join(lines, [])
    ends = [end for line in lines for end in (line[0], line[-1])]
    ways = [np.concatenate([ends[a][None], way, ends[b][None]]) for a, b, way in joints]
    along = [along_line(way)[-1] for way in ways]
    inner = [between(way, _OFF, far - _OFF) for way, far in zip(ways, along, strict=True)]
    tree = shapely.STRtree(strings(solid))
    met, _ = tree.query(strings(inner), predicate="dwithin", distance=0.5 * _OFF)
    off = np.ones(len(joints), dtype=bool)
    off[met] = False
    free = [joint for joint, kept in zip(joints, off.tolist(), strict=True) if kept]
    return join(lines, [Joint(a, b, way, marked=True) for a, b, way in free])


def _up_to_walls(sparse: Region, machine: Machine) -> Region:
    """Region in which lines of sparse infill lie: they end on what lies round them."""
    return shapely.buffer(sparse, _OVERLAP * machine.matrix_width)


def _infill_lines(
    sparse: Region, phase: float, spacing: float, plastic: Plastic, machine: Machine
) -> list[FloatArray]:
    """Lines of sparse infill.

    The phase is the height of a gyroid, mm, and 0 or 1 for lines of the one or the other direction.
    """
    if sparse.is_empty:
        return []
    region = _up_to_walls(sparse, machine)
    if plastic.infill == "gyroid":
        return gyroid_lines(region, phase, spacing)
    angle = float(np.radians(machine.gcode.matrix_angle))
    turns = (0.0, 1.0) if plastic.infill == "grid" else (phase,)
    angles = [angle + 0.5 * np.pi * turn for turn in turns]
    return [line for direction in angles for line in parallel_lines(region, spacing, direction)]


def _across(lines: Sequence[FloatArray], angle: float) -> float:
    """Direction, degrees, of skins that bridge infill: across most of its lines, if it has one."""
    steps = np.concatenate([np.diff(line, axis=0) for line in lines])
    # Directions without a sign are averaged at twice their angle.
    twice = (steps @ np.array([1.0, 1.0j])) ** 2 / np.linalg.norm(steps, axis=1)
    if abs(twice.sum()) < _DIRECTED * np.abs(twice).sum():
        return angle
    return float(np.degrees(0.5 * np.angle(twice.sum())) + 90.0) % 180.0


def _begun(line: FloatArray, seam: str, width: float) -> FloatArray:
    """Line on the bed that begins at its seam, if it is closed."""
    if seam == "any" or not is_closed(line):
        return line
    ring, turn = line[:-1], np.zeros(len(line) - 1)
    if seam == "corner":
        # Corners are rounded: they turn between places a line width before and behind.
        along = along_line(line)
        before, after = (
            points_along(line, along, (along[:-1] + off) % along[-1]) for off in (-width, width)
        )
        into, out = ring - before, after - ring
        cross = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0]
        turn = np.arctan2(cross, np.einsum("ij,ij->i", into, out)).round(2)
    first = int(np.lexsort((ring[:, 0], -ring[:, 1].round(3), -turn))[0])
    turned = np.roll(ring, -first, axis=0)
    return np.concatenate([turned, turned[:1]])


# Lines of matrix that a contour and a zigzag leave out: in narrow walls and beside holes.


_NARROW = 0.3
"""Least width of a gap that gets a line, in line widths. Our choice."""
_SMALL = 1.0
"""Least area of a gap and length of a line in it, in squares of a line width and in widths."""
_STEP = 0.2
"""Distance between points on the border of a gap, in line widths."""
_OPPOSITE = 0.8
"""Least chord between opposite points of the border, over twice the distance to the middle: a line
through the middle ends before it branches into corners."""
_ARC = 4
"""Segments per quarter circle."""


def gap_lines(
    section: Region, lines: Sequence[FloatArray], width: float, narrow: float = 0.0
) -> tuple[list[FloatArray], list[float]]:
    """Lines along the middle of the gaps that lines of a width leave in a section.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    lines : sequence of (n, 2) arrays, mm
        Lines that fill it so far.
    width : float, mm
        Of a line, > 0.
    narrow : float, mm
        Least width of a gap that gets a line, if that is more than 0.3 line widths.

    Returns
    -------
    lines : list of (n, 2) arrays, mm
        The parts of the medial axes of the gaps that pass between opposite sides.
    widths : list of float, mm
        Of the gap along each line, its mean.
    """
    # All at once: GEOS stumbles over the union of thousands of buffers.
    together = shapely.multilinestrings(strings(lines))
    (covered,) = bands([together], 0.5 * width, quad_segs=_ARC)
    gaps = shapely.difference(section, covered)
    reach = 0.5 * max(narrow, _NARROW * width)
    wide = shapely.buffer(gaps, -reach, quad_segs=_ARC)
    opened = shapely.intersection(shapely.buffer(wide, 1.01 * reach, quad_segs=_ARC), gaps)
    filling: list[FloatArray] = []
    widths: list[float] = []
    for gap in shapely.get_parts(opened):
        if gap.geom_type != "Polygon" or gap.area < _SMALL * width**2:
            continue
        border = gap.boundary
        shapely.prepare(border)
        for line in _middle(gap, _STEP * width):
            drawn = shapely.simplify(shapely.LineString(line), 0.02 * width)
            if drawn.length >= _SMALL * width:
                points = shapely.get_coordinates(drawn)
                middle = shapely.points(shapely.get_coordinates(shapely.segmentize(drawn, width)))
                filling.append(points)
                widths.append(2.0 * float(shapely.distance(middle, border).mean()))
    return filling, widths


def _middle(gap: shapely.Polygon, step: float) -> list[FloatArray]:
    """Lines of the medial axis of a polygon that pass between its opposite sides."""
    rings = shapely.get_rings(shapely.segmentize(gap, step))
    points = np.concatenate([shapely.get_coordinates(ring)[:-1] for ring in rings])
    if len(np.unique(points, axis=0)) < 4:
        return []
    diagram = Voronoi(points)
    ridges = np.array(diagram.ridge_vertices)
    sides = points[diagram.ridge_points[(ridges >= 0).all(axis=1)]]
    ends = diagram.vertices[ridges[(ridges >= 0).all(axis=1)]]
    chord = np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1)
    radius = np.linalg.norm(ends - sides[:, :1], axis=2).max(axis=1)
    facing = chord >= _OPPOSITE * 2.0 * radius
    edges = shapely.linestrings(ends[facing])
    shapely.prepare(gap)
    edges = edges[shapely.contains_properly(gap, edges)]
    return open_lines(np.array([shapely.line_merge(shapely.multilinestrings(list(edges)))]))
