"""MPS: strands along streamlines of the maximum principal stress, and strands parallel to them.

J. Plocher, J.-B. Wioland, A. Panesar, Additive manufacturing with fibre-reinforcement: design
guidelines and investigation into the influence of infill patterns, Rapid Prototyping Journal 28
(2022) 1241.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
import shapely
from scipy import ndimage

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import in_plane
from ccfem.geometry.medial_axis import medial_axis
from ccfem.geometry.offsets import rings
from ccfem.geometry.parallel_strands import grow, lengthened
from ccfem.geometry.polylines import (
    along_line,
    is_closed,
    line_length,
    pack,
    points_along,
    sample_midpoints,
    straight_pieces,
    until_itself,
)
from ccfem.geometry.shapes import Region, open_lines
from ccfem.geometry.shells import shells
from ccfem.machine.machine import Machine
from ccfem.paths.fields.streamlines import streamlines
from ccfem.paths.linking.joining import Joined, link_ends
from ccfem.paths.planning.infill import Infill, Turns, check_shells, with_turns
from ccfem.paths.raster.bitmap import Bitmap, depth
from ccfem.paths.raster.patterns import Regions, inside_shells, stress_regions
from ccfem.paths.raster.skeleton import segments, skeleton, thin
from ccfem.slicing.layers.layer import Layer, LayerStress

_STEP = 0.5
_APART = 2.0
_SHORTEST = 6.0
_AT_BORDER = 1.5
_BEYOND = 4.0
"""Lengths for the guides, in pitches: step along the streamline; least distance between guides;
least length of a guide; distance to the shells up to which an end counts as lying at the border;
extension of such an end, so that strands parallel to the guide reach a slanted border too."""
_LINK = 2.6
"""Longest link to a strand too short to be cut, in pitches. It reaches the second neighbour where
the border is slanted."""
_WORTH = 12.0
"""Length, in widths, below which strands are not linked: they would consist mostly of links."""


class _Inside(NamedTuple):
    """Shells of a section, the region inside, and the middles of its medial-axis segments."""

    rings: list[FloatArray]
    interior: Region
    middles: FloatArray


@dataclass(frozen=True)
class Mps(Infill):
    """Shells along the border, and strands parallel to streamlines of the stress inside them.

    The streamlines follow the in-plane principal stress of largest absolute value. They are shifted
    sideways by up to half a spacing so that whole strands fit beside them. Strands lie at whole
    multiples of the spacing from a streamline, each along the nearest one, until they meet.
    Concentric strands fill what stays open.

    Attributes
    ----------
    spacing : float, default 1
        Distance between neighbouring strands inside the shells in fibre widths, at least 1.
    shells : int, default 3
        Number of rings along every border, a fibre width apart whatever the spacing.
    seeds : "segments", "ends" or tuple of points, default "segments"
        Where the streamlines start: at the middle of each segment of the medial axis inside the
        shells; at the middle of each patch that carries a load or a support (the paper); or at
        points (x, y), mm, in the plane of the layer.
    closest : float, default 0.6
        Least distance between strands in spacings. Below 1 strands overlap where they converge,
        which leaves smaller gaps; 1 allows no overlap.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut. Strands that
        are too short are first joined to their neighbours by marked links; ends then stop a fibre
        width before the sides of other strands.
    mode : {"polyline", "raster"}, default "polyline"
        Polylines; or paths of pixels one spacing wide, as in the paper: see `ccfem.paths.raster`.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`.
    """

    spacing: float = 1.0
    shells: int = 3
    seeds: Literal["segments", "ends"] | tuple[tuple[float, float], ...] = "segments"
    closest: float = 0.6
    minimum_length: float | None = None
    mode: Literal["polyline", "raster"] = "polyline"
    turns: Turns = "tight"

    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "ends": {"seeds": "ends"},
        "raster": {"mode": "raster"},
        "printable": {"turns": "printable"},
        "cut": {"turns": "cut"},
        "raster_ends": {"mode": "raster", "seeds": "ends"},
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        check_shells(self)
        if isinstance(self.seeds, str) and self.seeds not in ("segments", "ends"):
            raise InputError(
                f"mps.seeds must be 'segments', 'ends' or a list of points; got {self.seeds!r}"
            )

    def prepare(self, section: Region, machine: Machine) -> _Inside:
        """Shells, the region inside, and the middles of its medial axis where these are seeds."""
        width, pitch = machine.fibre_width, self.spacing * machine.fibre_width
        rings, interior = shells(section, width, width, self.shells, self.closest)
        wanted = self.seeds == "segments" and not shapely.is_empty(interior)
        return _Inside(rings, interior, _middles(interior, pitch) if wanted else np.zeros((0, 2)))

    def strands(
        self, layer: Layer, stress: LayerStress, machine: Machine, prepared: _Inside
    ) -> list[FloatArray]:
        """Shells, then guides and the strands parallel to them."""
        pitch = self.spacing * machine.fibre_width
        interior = shapely.force_2d(prepared.interior)  # a copy: threads must not share a geometry
        guides = self._guides(layer, stress, interior, prepared.middles, pitch)
        return prepared.rings + grow(guides, interior, pitch, self.closest)

    def linked(self, lines: list[FloatArray], prepared: _Inside, machine: Machine) -> Joined:
        """Strands too short to be cut, joined to their neighbours by links inside the shells."""
        least = machine.shortest_strand if self.minimum_length is None else self.minimum_length
        short = any(line_length(line) < least for line in lines)
        if not short or shapely.is_empty(prepared.interior):
            return with_turns(self, lines, machine)
        width, radius = machine.fibre_width, machine.minimum_radius
        limit = _LINK * self.spacing * width
        interior = shapely.force_2d(prepared.interior)
        rings = len(prepared.rings)
        worth = [line for line in lines[rings:] if line_length(line) >= _WORTH * width]
        lines = clear_ends(lines[:rings] + worth, width, rings)
        joined = link_ends(
            lines, interior, limit, width, radius=radius, enough=least, one_by_one=True
        )
        return with_turns(self, joined.lines, machine, joined.link)

    def regions(self, image: Bitmap, layer: Layer, stress: LayerStress) -> Regions:
        """Shells of pixels, guides and rings round them."""
        inside = inside_shells(image.mask, self.shells)
        points = None if self.seeds == "segments" else self._points(layer, stress)
        guides = stress_guides(image, inside, stress, points)
        return stress_regions(image.mask, guides, self.shells)

    def _guides(
        self, layer: Layer, stress: LayerStress, interior: Region, seeds: FloatArray, pitch: float
    ) -> list[FloatArray]:
        """Streamlines inside the shells, shifted sideways so that whole strands fit beside them."""
        if shapely.is_empty(interior):
            return []
        if self.seeds != "segments":
            seeds = _moved_inside(self._points(layer, stress), interior, pitch)
        curves = streamlines(
            layer.plane.points,
            layer.triangles,
            in_plane(stress.nodal, layer.plane.frame),
            seeds,
            _STEP * pitch,
        )
        guides = spaced_guides(curves, seeds, interior, _APART * pitch, _SHORTEST * pitch)
        guides = fitted_guides(guides, interior, pitch)
        return [
            lengthened(guide, interior, _AT_BORDER * pitch, _BEYOND * pitch) for guide in guides
        ]

    def _points(self, layer: Layer, stress: LayerStress) -> FloatArray:
        """Points (k, 2) given as seeds: middles of patches, or the points themselves."""
        if self.seeds == "ends":
            return _patch_middles(layer, stress.held_or_loaded)
        return np.array(self.seeds, dtype=np.float64).reshape(-1, 2)


def _moved_inside(points: FloatArray, interior: Region, pitch: float) -> FloatArray:
    """Points (k, 2); those outside are moved to the nearest place slightly inside the border."""
    inner = shapely.buffer(interior, -0.1 * pitch, join_style="mitre")
    nearest = [shapely.shortest_line(inner, point) for point in shapely.points(points)]
    return shapely.get_coordinates([line.interpolate(0.0) for line in nearest])


def _middles(interior: Region, pitch: float) -> FloatArray:
    """Middle of each segment or lone node of the medial axis, largest clearance first.

    A closed segment has four: the place of largest clearance, and the three that lie a quarter of
    the length apart from there.
    """
    axis = medial_axis(interior, 0.5 * pitch)
    middles: list[tuple[float, FloatArray]] = []
    for segment in axis.segments:
        along = along_line(segment.points)
        places = np.array([0.5 * along[-1]])
        if segment.closed:
            widest = along[np.argmax(segment.radius)]
            places = (widest + np.array([0.0, 0.25, 0.5, 0.75]) * along[-1]) % along[-1]
        points = points_along(segment.points, along, places)
        middles += zip(np.interp(places, along, segment.radius), points, strict=True)
    ends = {end for segment in axis.segments for end in segment.ends}
    lone = [k for k in range(len(axis.nodes)) if k not in ends]  # discs and squares
    middles += zip(axis.radius[lone], axis.nodes[lone], strict=True)
    # Places of equal clearance in a symmetric part keep the order of the axis, longest first.
    middles.sort(key=lambda item: -round(item[0] / (0.01 * pitch)))
    return np.reshape([point for _, point in middles], (-1, 2))


def _patch_middles(layer: Layer, patches: tuple[str, ...]) -> FloatArray:
    """Node or edge midpoint nearest to the middle of each named patch, (k, 2).

    Where several are equally near, as on the border of a hole, the first one is taken.
    """
    middles: list[FloatArray] = []
    for name in patches:
        edges = layer.patches.get(name, np.zeros((0, 2), dtype=np.int64))
        if len(edges):
            nodes = layer.plane.points[np.unique(edges)]
            places = np.concatenate([nodes, layer.plane.points[edges].mean(axis=1)])
            gap = np.linalg.norm(places - nodes.mean(axis=0), axis=1)
            middles.append(places[np.argmin(np.round(gap, 6))])
    return np.array(middles, dtype=np.float64).reshape(-1, 2)


# Ends of strands that abut the side of another strand, cut back to a width from its middle.


_MOST = 1.25
"""Largest length cut off an end, in distances: a strand that meets another at less than about 25
degrees runs along it, not into it."""
_STEPS = 26
_ENOUGH = 0.995
"""Share of the distance that is sufficient: strands are laid to half a per cent of their width."""
_END = 1e-6
"""Distance, mm, up to which the nearest point of a strand counts as its end."""


def clear_ends(lines: Sequence[FloatArray], distance: float, first: int = 0) -> list[FloatArray]:
    """Lines whose open ends stop at a given distance from the sides of others.

    An end is cut back only as far as needed, and not at all if a cut of little more than the
    distance is not enough. Ends of other lines do not matter, since they may be joined to it.

    Parameters
    ----------
    lines : sequence of (k, 2) arrays, mm
        Closed ones repeat their first point and are not changed.
    distance : float, mm
        From the end to the middle of other lines.
    first : int, default 0
        Lines before this one are not changed.
    """
    cut = list(lines)
    tips = [
        (k, end)
        for k in range(first, len(lines))
        if not is_closed(lines[k]) and line_length(lines[k]) > 4.0 * distance
        for end in (0, -1)
    ]
    if not tips:
        return cut
    back = np.linspace(0.0, _MOST * distance, _STEPS)
    places = np.stack([_points_before_end(lines[k], end, back) for k, end in tips])
    # Room at places farther and farther back; the first with enough, between it and the one before.
    gap = _gaps(lines, places, np.array([k for k, _ in tips]), distance)
    far = gap >= _ENOUGH * distance
    for (k, end), reached, room in zip(tips, far, gap, strict=True):
        step = int(np.argmax(reached))
        if reached[step] and step:
            share = (_ENOUGH * distance - room[step - 1]) / (room[step] - room[step - 1])
            length = back[step - 1] + share * (back[step] - back[step - 1])
            cut[k] = _without_end(cut[k], end, float(length))
    return cut


def _points_before_end(line: FloatArray, end: int, back: FloatArray) -> FloatArray:
    """Points (n, 2) of a line at lengths before one of its ends."""
    head = line if end == 0 else line[::-1]
    return points_along(head, along_line(head), back)


def _without_end(line: FloatArray, end: int, length: float) -> FloatArray:
    """Line without a given length at one of its ends."""
    head = line if end == 0 else line[::-1]
    along = along_line(head)
    start = points_along(head, along, np.array([length]))
    rest = np.concatenate([start, head[along > length + _END]])
    return rest if end == 0 else rest[::-1]


def _gaps(
    lines: Sequence[FloatArray], places: FloatArray, owner: FloatArray, distance: float
) -> FloatArray:
    """Distance (t, n) of places (t, n, 2) to the sides of other lines, at most twice `distance`."""
    sides = straight_pieces(lines)
    sizes = np.array([len(line) - 1 for line in lines])
    of_side = np.repeat(np.arange(len(lines)), sizes)
    last = np.cumsum(sizes) - 1
    opened = np.array([not is_closed(line) for line in lines])
    starts, stops = np.zeros((2, len(sides)), dtype=bool)
    starts[(last - sizes + 1)[opened]], stops[last[opened]] = True, True
    flat = places.reshape(-1, 2)
    at, side = shapely.STRtree(shapely.linestrings(sides)).query(
        shapely.points(flat), predicate="dwithin", distance=2.0 * distance
    )
    foreign = of_side[side] != owner[at // places.shape[1]]
    at, side = at[foreign], side[foreign]
    way, off = sides[side, 1] - sides[side, 0], flat[at] - sides[side, 0]
    size = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
    run = np.einsum("ij,ij->i", off, way) / size
    beyond = (starts[side] & (run < _END)) | (stops[side] & (run > size - _END))
    foot = sides[side, 0] + (np.clip(run, 0.0, size) / size)[:, None] * way
    gap = np.full(len(flat), 2.0 * distance)
    near = np.linalg.norm(flat[at] - foot, axis=1)
    np.minimum.at(gap, at[~beyond], near[~beyond])
    return gap.reshape(places.shape[:2])


# Guides as lines of pixels: streamlines and the places that they start from.


_GUIDES_STEP = 0.5
_GUIDES_APART = 2.0
_GUIDES_SHORTEST = 6
"""In pixels: step along a streamline, minimum distance of guides, minimum number of pixels."""


def segment_seeds(inside: BoolArray) -> IntArray:
    """Middle pixel (k, 2) of every segment of the medial axis, the deepest first.

    A closed one has four, a quarter of the way round from each to the next, the deepest of its
    pixels first; a piece without a segment has its fork.

    Parameters
    ----------
    inside : (H, W) bool array
        Its outermost rows and columns are empty.
    """
    far = depth(inside)
    branches, forks = segments(thin(np.where(skeleton(inside), 0, -1)))
    seeds: list[IntArray] = []
    for segment in branches:
        count = len(segment.pixels)
        at = [count // 2]
        if segment.closed:
            deepest = int(far[tuple(segment.pixels.T)].argmax())
            at = [(deepest + k * count // 4) % count for k in range(4)]
        seeds += [segment.pixels[k] for k in at]
    pieces, count = ndimage.label(inside, np.ones((3, 3)))
    held = {int(pieces[tuple(pixel)]) for pixel in seeds}
    for piece in range(1, count + 1):
        if piece not in held:
            places = np.argwhere((pieces == piece) & (forks >= 0))
            seeds.append(places[0])
    seeds.sort(key=lambda pixel: (-far[tuple(pixel)], *pixel.tolist()))
    return np.array(seeds, dtype=np.int64).reshape(-1, 2)


def _guide_pixels(
    raster: Bitmap, inside: BoolArray, curves: Sequence[FloatArray], seeds: IntArray
) -> IntArray:
    """Guide (H, W) that each pixel is on, -1 for none, cut where it comes near to one before it.

    Curves are in the order of their importance, with steps of at most half a pixel; a guide holds
    the seed (k, 2) of its curve.
    """
    guides = np.full(inside.shape, -1, dtype=np.int64)
    free = inside.copy()
    for number, (curve, seed) in enumerate(zip(curves, seeds, strict=True)):
        if len(curve) < 2 or not free[tuple(seed)]:
            continue
        chain = raster.pixels(curve)
        fine = free[tuple(chain.T)]
        if (curve[0] == curve[-1]).all() and not fine.all():
            # A closed one that is cut: from a cut to the next.
            turn = -int(np.flatnonzero(~fine)[0])
            chain, fine = np.roll(chain, turn, axis=0), np.roll(fine, turn)
        middle = int(np.abs(chain - seed).sum(axis=1).argmin())
        if not fine[middle]:
            continue
        stops = np.flatnonzero(~fine)
        first = stops[stops < middle].max(initial=-1) + 1
        last = stops[stops > middle].min(initial=len(chain))
        chain = np.unique(chain[first:last], axis=0)
        if len(chain) < _GUIDES_SHORTEST:
            continue
        guides[tuple(chain.T)] = number
        free &= ndimage.distance_transform_edt(guides < 0) >= _GUIDES_APART
    return guides


def stress_guides(
    raster: Bitmap, inside: BoolArray, stress: LayerStress, points: FloatArray | None = None
) -> IntArray:
    """Guides along streamlines of the principal stress of the largest size.

    Parameters
    ----------
    inside : (H, W) bool array
        Pixels that guides stay in.
    points : (k, 2) array, mm, optional
        Where streamlines start, at the nearest pixel inside; by default `segment_seeds`.

    Returns
    -------
    (H, W) int array
        Guide of each pixel; -1 where there is none.
    """
    if not inside.any():
        return np.full(inside.shape, -1, dtype=np.int64)
    if points is None:
        seeds = segment_seeds(inside)
    else:
        _, nearest = ndimage.distance_transform_edt(~inside, return_indices=True)
        seeds = nearest[:, *raster.pixels(points).T].T.astype(np.int64)
    layer = stress.layer
    plane = in_plane(stress.nodal, layer.plane.frame)
    starts = raster.centres(seeds)
    step = _GUIDES_STEP * raster.pixel
    curves = streamlines(layer.plane.points, layer.triangles, plane, starts, step)
    return _guide_pixels(raster, inside, curves, seeds)


# Guides: curves from which parallel strands start, spaced so that whole strands fit between them.
#
# Strands lie at whole multiples of the pitch from their guide. Between the last of them and the
# border, or the strands of the next guide, a gap or overlap of up to half a pitch remains along the
# whole length. Its size depends on the position of the guide, so guides are shifted sideways.


_SHIFTS = np.array([0.0, 0.5, 0.25, -0.25, 0.125, -0.125, 0.375, -0.375])
"""Sideways shifts that are tried, in pitches, preferred ones first."""
_BETTER = 0.01
"""Mean misfit a side, in pitches, by which a shift must be better than an earlier one."""
_GUIDE_STEP = 1.0
_FAR = 30.0
"""Distance between samples along a guide, and length of the rays to both sides, in pitches."""
_ROUNDS = 3
"""Number of times that all guides are fitted, since the neighbours of a guide move too."""


def spaced_guides(
    curves: Sequence[FloatArray],
    seeds: FloatArray,
    region: Region,
    distance: float,
    least_length: float,
) -> list[FloatArray]:
    """Clip curves to a region, and cut each where it comes near itself or an earlier one.

    At most one piece of each curve, a (m, 2) array in mm, remains.

    Parameters
    ----------
    curves : sequence of (m, 2) arrays, mm
        In the order of their importance; empty ones are left out.
    seeds : (k, 2) array, mm
        Point of each curve that its guide must contain.
    region : shapely (Multi)Polygon, mm
    distance : float, mm
        Minimum distance between guides.
    least_length : float, mm
        Shorter guides are dropped.
    """
    guides: list[FloatArray] = []
    free = region
    for curve, seed in zip(curves, seeds, strict=True):
        point = shapely.Point(seed)
        if len(curve) < 2 or not shapely.intersects(free, point):
            continue
        pieces = open_lines(shapely.intersection(free, shapely.LineString(curve)))
        if not pieces:
            continue
        strings = [shapely.LineString(piece) for piece in pieces]
        nearest = int(np.argmin(shapely.distance(strings, point)))
        guide = until_itself(pieces[nearest], seed, distance)
        if line_length(guide) < least_length:
            continue
        guides.append(guide)
        free = shapely.difference(free, shapely.buffer(shapely.LineString(guide), distance))
    return guides


def fitted_guides(guides: Sequence[FloatArray], region: Region, pitch: float) -> list[FloatArray]:
    """Shift guides sideways by at most half a pitch, to minimise gaps and overlaps.

    Parameters
    ----------
    guides : sequence of (k, 2) arrays, mm
    region : shapely (Multi)Polygon, mm
        Its border is the edge of other strands.
    pitch : float, mm
        Distance of the strands beside a guide.

    Returns
    -------
    list of (k, 2) arrays, mm
        A guide that moves by half a pitch is replaced by two, half a pitch to either side: the
        strands beside it are the same, and symmetric parts stay symmetric.
    """
    border = straight_pieces(rings(region))
    shifts = np.zeros(len(guides))
    moved = list(guides)
    rays = [_rays(guide, pitch) for guide in guides]
    fixed = [_first_hits(*ray, border, pitch) for ray in rays]
    for _ in range(_ROUNDS):
        before = shifts.copy()
        for k, (start, normal) in enumerate(rays):
            others = straight_pieces([other for j, other in enumerate(moved) if j != k])
            gap, parallel, to_guide = _nearer(fixed[k], _first_hits(start, normal, others, pitch))
            shifts[k] = _best_shift(gap / pitch - np.where(to_guide, 0.0, 0.5), parallel)
            moved[k] = _shifted(guides[k], shifts[k] * pitch)
        if (shifts == before).all():
            break
    shifted = []
    for guide, shift in zip(guides, shifts, strict=True):
        ways = (-0.5, 0.5) if shift == 0.5 else (shift,)
        shifted += [_shifted(guide, way * pitch) for way in ways]
    return shifted


def _best_shift(gap: FloatArray, weight: FloatArray) -> float:
    """Shift, in pitches, of the least misfit; `gap` (2, n) in pitches, left and right."""
    total = weight.sum()
    if not total > 0.0:
        return 0.0
    best, least = 0.0, np.inf
    for shift in _SHIFTS:
        room = gap + shift * np.array([[-1.0], [1.0]])
        misfit = float((weight * np.abs(room - np.round(room))).sum() / total)
        if misfit < least - _BETTER:
            best, least = float(shift), misfit
    return best


def _rays(guide: FloatArray, pitch: float) -> tuple[FloatArray, FloatArray]:
    """Places (n, 2) along a guide, and its left normal (n, 2) there."""
    points, offsets = pack([guide])
    start, along, _, _ = sample_midpoints(points, offsets, _GUIDE_STEP * pitch)
    return start, np.column_stack([-along[:, 1], along[:, 0]])


def _first_hits(
    start: FloatArray, normal: FloatArray, pieces: FloatArray, pitch: float
) -> tuple[FloatArray, FloatArray]:
    """Distance (2, n) to the first piece on the left and on the right, and how parallel it is.

    Infinite if there is none. The second value is the squared cosine of the angle between piece and
    guide, 0 above 45 degrees.
    """
    n = len(start)
    gap, parallel = np.full((2, n), np.inf), np.zeros((2, n))
    if not len(pieces):
        return gap, parallel
    tree = shapely.STRtree(shapely.linestrings(pieces))
    for side, sign in enumerate((1.0, -1.0)):
        way = sign * normal
        rays = shapely.linestrings(np.stack([start, start + _FAR * pitch * way], axis=1))
        ray, piece = tree.query(rays, predicate="intersects")
        side_way = pieces[piece, 1] - pieces[piece, 0]
        size = np.linalg.norm(side_way, axis=1)
        across = np.einsum("ij,ij->i", way[ray], side_way[:, ::-1] * [1.0, -1.0])
        offset = pieces[piece, 0] - start[ray]
        distance = np.einsum("ij,ij->i", offset, side_way[:, ::-1] * [1.0, -1.0])
        # Distance along the ray: cross products with the piece; pieces along the ray have none.
        whole = np.abs(across) > 1e-9 * size
        ray, distance = ray[whole], (distance[whole] / across[whole])
        cosine = np.abs(across[whole]) / size[whole]
        # The nearest piece of each ray, and how parallel it is: 0 from 45 degrees on.
        order = np.lexsort((distance, ray))
        _, first = np.unique(ray[order], return_index=True)
        chosen = order[first]
        gap[side, ray[chosen]] = distance[chosen]
        square = cosine[chosen] ** 2
        parallel[side, ray[chosen]] = np.where(square > 0.5, square, 0.0)
    return gap, parallel


def _nearer(
    border: tuple[FloatArray, FloatArray], guides: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Nearer of two hits: distance, how parallel, and whether it is the second."""
    second = guides[0] < border[0]
    gap = np.where(second, guides[0], border[0])
    parallel = np.where(second, guides[1], border[1])
    return np.where(np.isfinite(gap), gap, 0.0), np.where(np.isfinite(gap), parallel, 0.0), second


def _shifted(guide: FloatArray, way: float) -> FloatArray:
    """Curve parallel to a guide, to its left by `way`, mm."""
    if way == 0.0:
        return guide
    curve = shapely.offset_curve(shapely.LineString(guide), way)
    parts = shapely.get_parts(curve)
    return shapely.get_coordinates(parts[np.argmax(shapely.length(parts))])
