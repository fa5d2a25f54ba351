"""Stress vector tracing: members of parallel strands that cross in the joints, as a single path.

T. Wang, N. Li, G. Link, J. Jelonnek, J. Fleischer, J. Dittus, D. Kupzik, Load-dependent path
planning method for 3D printing of continuous fiber reinforced plastics, Composites Part A 140
(2021) 106181. The tracks and the links are our reconstruction: the paper shows them but gives no
rule.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Any, ClassVar, Literal

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import check_fields
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.medial_axis import medial_axis
from ccfem.geometry.offsets import join_rings, offset_rings, rings
from ccfem.geometry.polylines import (
    along_line,
    inner_points,
    line_length,
    pack,
    points_along,
    resample,
)
from ccfem.geometry.shapes import Region, bands
from ccfem.geometry.symmetry import mirror_lines, reflected
from ccfem.machine.machine import Machine
from ccfem.paths.linking.single_path import link_tracks
from ccfem.paths.planning.infill import SPACING, Turns, check_fill, long_enough, with_turns
from ccfem.paths.planning.strategy import Amount, LayerPlanner
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress, flat_layers, stress_on
from ccfem.strategies.stress_tracing.band import band
from ccfem.strategies.stress_tracing.frame import ARC_CHORD, frame
from ccfem.strategies.stress_tracing.main_paths import main_paths, with_shared_stems
from ccfem.strategies.stress_tracing.stress_lines import (
    Criterion,
    misalignment,
    plane_stress_at,
    stress_lines,
)
from ccfem.strategies.stress_tracing.tracks import tail_turns, tracks

_SAMPLING = 0.5
"""Distance between the border samples for the medial axis, in fibre widths."""
_LEAST = 20.0
"""Length of the shortest spiral in an open place, in fibre widths."""

_Marked = tuple[FloatArray, BoolArray]
"""Points (n, 2) of a path, mm, and the mask (n,) of its links."""


@dataclass(frozen=True)
class Svt:
    """Parallel strands along the main load paths of a frame, joined to one path.

    The members are those of the section's medial axis. In every joint, members are joined in pairs
    to main load paths; the best pairs have little turn, little misalignment with the stress and the
    same sense of stress. Parallel strands fill the width of each main path; where it narrows they
    leave through its border. In the joints they cross the strands of other main paths, turning by
    up to 60 degrees to cross more steeply, and leave the section. Two main paths share a member
    that leads to a clamp or a load, or that forks into both. Links outside the section join the
    strands to one path for each piece of the section. A section without members (a disc, a square)
    is filled with concentric rings.

    The strategy is meant for frames of slim members. If members are wide, joints take up most of
    the section: strands fan out or overlap there, and the path is cut where a link would run
    through the section for too long.

    Attributes
    ----------
    mode : "graph" or "points", default "graph"
        "graph" joins members at the joints. "points" traces load paths over the points of the
        medial axis, as in the paper, and lays these as single strands; the parameters below are
        then ignored up to `minimum_length`. It skips joints and leaves points over, so it fills no
        section.
    spacing : float, default 1
        Distance between neighbouring strands in fibre widths, at least 1. Strands may lie
        as near as nine tenths of it where the width of a main path is no multiple of it.
    links : "outside" or "none", default "outside"
        Join all strands of a piece of the section to one path, or lay single strands.
    longest_inside : float, mm, default 6
        Links with more than this length inside the section are left out: the path is cut there.
    longest_over_void : float, mm, optional
        The same for links over holes, where nothing holds the fibre. By default these stay: strands
        leave members and turn in windows as they do outside the part.
    crossings : bool, default True
        Whether strands that end in a joint cross it and leave the section on the far side, as in
        the paper. Otherwise they stop in the middle of the joint.
    aligned : bool, default True
        Whether strands turn towards the stress in joints and near free ends. Otherwise they follow
        the medial axis there, and a smooth curve across the joint.
    filled : bool, default True
        Whether spirals fill the wide places that the main paths leave open.
    turn : float, default 75
        Largest turn, degrees, of a main path in a joint.
    width_ratio : float, default 2
        Largest ratio of the widest to the narrowest member of a main path.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`.
    """

    mode: Literal["graph", "points"] = "graph"
    spacing: float = 1.0
    links: Literal["outside", "none"] = "outside"
    longest_inside: float = 6.0
    longest_over_void: float | None = None
    crossings: bool = True
    aligned: bool = True
    filled: bool = True
    turn: float = 75.0
    width_ratio: float = 2.0
    minimum_length: float | None = None
    turns: Turns = "tight"

    amount: ClassVar[Amount] = SPACING
    flat_layers_only: ClassVar[bool] = True
    crosses: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "points": {"mode": "points"},
        "plain": {"links": "none", "crossings": False, "aligned": False, "filled": False},
        "cut": {"longest_inside": 0.0, "longest_over_void": 0.0},
        "cut_turns": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        check_fill(self)
        check_fields(self, "longest_inside", "longest_over_void", at_least=0.0, unit="mm")
        check_fields(self, "turn", above=0.0, below=180.0, unit="degrees")
        check_fields(self, "width_ratio", at_least=1.0)

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan one layer: one path for each piece of its section, or as few as possible."""
        return self._on(layer, self._plane_paths(layer, stress, machine), machine)

    def for_part(
        self, stress: PartStress, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Plan layers of the same section and the same stress directions only once."""
        return _Alike(self, stress, alike(layers, stress))

    def _on(self, layer: Layer, lines: list[_Marked], machine: Machine) -> Toolpaths:
        """Paths on a layer, without the short ones."""
        points, marks = [line for line, _ in lines], [mask for _, mask in lines]
        cut = with_turns(self, points, machine, marks)
        paths = Toolpaths.from_plane(cut.lines, layer, link=cut.link)
        return long_enough(paths, self.minimum_length, machine)

    def _plane_paths(self, layer: Layer, stress: LayerStress, machine: Machine) -> list[_Marked]:
        """Paths in the plane of a layer, with the masks of their links."""
        pieces = shapely.get_parts(layer.plane.polygon)
        return [marked for piece in pieces for marked in self._piece(piece, stress, machine)]

    def groups(
        self, piece: Region, stress: LayerStress, machine: Machine
    ) -> list[list[FloatArray]]:
        """Strands (n_i, 2), mm, of each main path of one piece of the section, not yet joined."""
        members = frame(piece, _SAMPLING * machine.fibre_width)
        criterion = Criterion(turn=self.turn)
        groups = []
        pitch = self.spacing * machine.fibre_width
        paths = main_paths(members, stress, criterion, self.width_ratio)
        if self.crossings:
            paths = with_shared_stems(paths, members)
        turns = [(0.0, 0.0)] * len(paths)
        if self.crossings:
            turns = tail_turns(paths, members, pitch, piece)
        for path, turn in zip(paths, turns, strict=True):
            strip = band(path, members, self.crossings, turn)
            follow = stress if self.aligned else None
            groups.append(tracks(strip, pitch, piece, machine.minimum_radius, follow))
        groups = made_symmetric(groups, piece, machine.fibre_width)
        lines_so_far = [line for group in groups for line in group]
        if lines_so_far and self.filled:
            width, least = (
                machine.fibre_width,
                max(self._shortest(machine), _LEAST * machine.fibre_width),
            )
            groups += blobs(piece, lines_so_far, width, pitch, least)
        return groups

    def _shortest(self, machine: Machine) -> float:
        """Length of the shortest path that is laid, mm."""
        return machine.shortest_strand if self.minimum_length is None else self.minimum_length

    def _piece(self, piece: Region, stress: LayerStress, machine: Machine) -> list[_Marked]:
        """Paths of one piece of the section, with the mask of their links."""
        if self.mode == "points":
            return _unlinked(walk(piece, stress, _SAMPLING * machine.fibre_width))
        groups = self.groups(piece, stress, machine)
        if not any(groups):
            return _unlinked(self._rings(piece, machine))
        if self.links == "none":
            return _unlinked([line for group in groups for line in group])
        width = self.spacing * machine.fibre_width
        over_void = np.inf if self.longest_over_void is None else self.longest_over_void
        longest = self.longest_inside, over_void
        path = link_tracks(groups, piece, machine.minimum_radius, width, *longest)
        parts = path.without_long_links(piece, *longest)
        return [(part.points, part.link) for part in parts]

    def _rings(self, piece: Region, machine: Machine) -> list[FloatArray]:
        """Concentric rings of a piece that has no members, joined by ramps."""
        width = machine.fibre_width
        levels = offset_rings(piece, 0.5 * width, self.spacing * width, width)
        start = rings(piece)[0][:2].mean(axis=0)
        return join_rings(levels, start, self.spacing * width, width) if levels else []


class _Alike:
    """Planner of a part that plans identical layers only once."""

    def __init__(self, svt: Svt, stress: PartStress, twins: Mapping[int, Layer]) -> None:
        self._svt, self._stress, self._twins = svt, stress, twins
        self._locks = {twin.index: Lock() for twin in twins.values()}
        self._known: dict[tuple[int, Machine], list[_Marked]] = {}

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan one layer, or take the plan of its twin."""
        twin = self._twins.get(layer.index, layer)
        key = (twin.index, machine)
        with self._locks.setdefault(twin.index, Lock()):
            if key not in self._known:
                layer_stress = stress if twin is layer else stress_on(twin, self._stress)
                self._known[key] = self._svt._plane_paths(twin, layer_stress, machine)
        return self._svt._on(layer, self._known[key], machine)


def _unlinked(lines: list[FloatArray]) -> list[_Marked]:
    return [(line, np.zeros(len(line), dtype=bool)) for line in lines]


# Spirals in the wide places of a section that the tracks of all main paths leave open.


_STEP = 0.5
"""Distance of the points of a spiral, mm."""


def rest_of(section: Region, lines: Sequence[FloatArray], width: float, reach: float) -> Region:
    """Part of a section that a disc can reach between strands.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    lines : sequence of (n, 2) arrays, mm
    width : float, mm
        Of a strand.
    reach : float, mm
        Radius of the disc.
    """
    strings = [shapely.LineString(line) for line in lines if len(line) > 1]
    covered = shapely.union_all(bands(strings, 0.5 * width, cap_style="flat"))
    rest = shapely.buffer(shapely.difference(section, covered), -reach)
    return shapely.buffer(rest, reach)


def blobs(
    section: Region, lines: Sequence[FloatArray], width: float, spacing: float, least: float
) -> list[list[FloatArray]]:
    """Fill places that strands leave open with concentric rings, joined to spirals.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    lines : sequence of (n, 2) arrays, mm
        Strands that are laid already.
    width, spacing : float, mm
        Width of a strand, and distance of neighbouring ones.
    least : float, mm
        Shorter spirals are left out.

    Returns
    -------
    list of lists of (n, 2) arrays, mm
        The spirals of each open place, largest place first. They start at the border of the section
        where they touch it.
    """
    rest = rest_of(section, lines, width, 0.5 * width)
    places = [part for part in shapely.get_parts(rest) if part.area >= least * spacing]
    border = shapely.boundary(section)
    spirals_of = []
    for place in sorted(places, key=lambda part: -part.area):
        levels = offset_rings(place, 0.5 * width, spacing, width)
        if not levels:
            continue
        nearest = shapely.shortest_line(border, shapely.centroid(place))
        start = shapely.get_coordinates(nearest)[0]
        spirals = [_even_line(line) for line in join_rings(levels, start, spacing, width)]
        spirals = [line for line in spirals if line_length(line) >= least]
        if spirals:
            spirals_of.append(spirals)
    return spirals_of


def _even_line(line: FloatArray) -> FloatArray:
    """Line in even steps; a ring is opened where it begins."""
    curve = shapely.LineString(line)
    at = np.linspace(0.0, curve.length, max(4, round(curve.length / _STEP)) + 1)
    points = shapely.get_coordinates(shapely.line_interpolate_point(curve, at))
    return points[:-2] if np.array_equal(line[0], line[-1]) else points


# Tracks of a symmetric section made exactly symmetric, if they nearly are.


_LOST = 0.5
"""Length, mm, by which the ends of a track may lie beyond the border."""


def made_symmetric(
    groups: Sequence[Sequence[FloatArray]], section: Region, near: float
) -> list[list[FloatArray]]:
    """Make tracks mirror images of each other where the section is symmetric.

    The medial axis, the mesh and the stress on it are only approximately symmetric, and tracks
    follow them, so that strands differ visibly. A group whose mirror image is not near another
    group, or itself, is not changed.

    Parameters
    ----------
    groups : sequence of sequences of (n_i, 2) arrays, mm
        Tracks of each main path.
    section : shapely (Multi)Polygon, mm
    near : float, mm
        Largest distance of a track from the mirror image of its partner.
    """
    symmetric = [list(group) for group in groups]
    for mirror in mirror_lines(section):
        images = [[reflected(line, mirror) for line in group] for group in symmetric]
        done: set[int] = set()
        for k, group in enumerate(images):
            for other in range(k, len(symmetric)):
                partners = _partners(group, symmetric[other], near)
                if other in done or k in done or partners is None:
                    continue
                done |= {k, other}
                for image, partner in enumerate(partners):
                    line = symmetric[other][partner]
                    if k == other and partner == image:
                        symmetric[k][image] = _within(
                            _middle_line(line, group[image]), line, section
                        )
                    elif k != other or partner > image:
                        symmetric[other][partner] = _within(
                            _in_direction_of(group[image], line), line, section
                        )
    return symmetric


def _partners(
    images: Sequence[FloatArray], lines: Sequence[FloatArray], near: float
) -> list[int] | None:
    """Line that each image lies on, each used once; None if some images have no line."""
    if len(images) != len(lines) or not lines:
        return None
    curves = [shapely.LineString(line) for line in lines]
    partners: list[int] = []
    for image in images:
        along = along_line(image)
        middle = points_along(image, along, 0.5 * along[-1:])[0]
        apart = shapely.distance(curves, shapely.points(middle))
        for k in np.argsort(apart, kind="stable")[:2].tolist():
            if (
                k not in partners
                and curves[k].hausdorff_distance(shapely.LineString(image)) <= near
            ):
                partners.append(k)
                break
        else:
            return None
    return partners


def _within(image: FloatArray, line: FloatArray, section: Region) -> FloatArray:
    """Image of a line, if within a nearly symmetric section; otherwise the line.

    Links begin where strands leave the section, so strands must not leave it elsewhere.
    """
    curve = shapely.LineString(image)
    if shapely.covers(section, curve):
        return image
    pieces = shapely.get_parts(shapely.intersection(curve, section))
    pieces = [piece for piece in pieces if piece.geom_type == "LineString"]
    longest = max(pieces, key=lambda piece: piece.length, default=curve)
    if not pieces or curve.length - longest.length > _LOST or shapely.is_closed(curve):
        return line
    return _in_direction_of(shapely.get_coordinates(longest), line)


def _in_direction_of(image: FloatArray, line: FloatArray) -> FloatArray:
    """Image walked the way that a line goes."""
    straight = np.linalg.norm(image[0] - line[0]) + np.linalg.norm(image[-1] - line[-1])
    crossed = np.linalg.norm(image[0] - line[-1]) + np.linalg.norm(image[-1] - line[0])
    return image if straight <= crossed else image[::-1]


def _middle_line(line: FloatArray, image: FloatArray) -> FloatArray:
    """Line half way between one and its own mirror image."""
    if np.array_equal(line[0], line[-1]):
        return line
    image = _in_direction_of(image, line)
    along, other = along_line(line), along_line(image)
    share = along / along[-1]
    both = 0.5 * (share + (1.0 - share)[::-1])
    one, two = (points_along(p, s, s[-1] * both) for p, s in ((line, along), (image, other)))
    return 0.5 * (one + two)


# Layers that share a plan: those of the same section with the same stress directions.
#
# Layers that differ only by rounding should get the same plan. If the stress turns from layer to
# layer, as in a twisted part, each layer gets its own.


_SAME = 1e-6
"""Share of its area by which a section may differ from an equal one."""
_TURNED = 0.1
"""Largest mean squared sine of the angle between the stresses on two layers that share a plan:
about 18 degrees."""
_WEAK = 0.2
"""Share of the largest mean stress below which a layer takes the plan of the most stressed one:
near the neutral plane of a part in bending, directions are random."""
_AS_LARGE = 0.99
"""Share of the largest mean stress above which a layer counts as most stressed; the first is taken.
"""
_REACH = 1.0
"""Distance, mm, from a layer up to which its stress is used."""


def alike(layers: Sequence[Layer], stress: PartStress) -> dict[int, Layer]:
    """Layer whose stress is used to plan each flat layer, by the index of the layer.

    Among layers of the same section it is the first with the largest mean stress. The same is then
    repeated for layers whose stress has other directions.
    """
    representatives: dict[int, Layer] = {}
    for group in _same_sections(layers):
        left = [stress_on(layer, stress) for layer in group] if len(group) > 1 else []
        sizes = [_mean_size(field) for field in left]
        if len(group) == 1:
            representatives[group[0].index] = group[0]
        while left:
            largest = max(sizes)
            guide = next(
                of_layer
                for of_layer, size in zip(left, sizes, strict=True)
                if size >= _AS_LARGE * largest
            )
            rest = []
            for of_layer, size in zip(left, sizes, strict=True):
                if size <= _WEAK * largest or apart(guide, of_layer) <= _TURNED:
                    representatives[of_layer.layer.index] = guide.layer
                else:
                    rest.append((of_layer, size))
            left, sizes = [of_layer for of_layer, _ in rest], [size for _, size in rest]
    return representatives


def apart(one: LayerStress, other: LayerStress) -> float:
    """Mean squared sine of the angle between the principal stresses on two layers, from 0 to 1.

    The principal stress is that of largest absolute value, weighted by both values and by area.

    Parameters
    ----------
    one, other : LayerStress
        On layers of the same section.
    """
    layer = one.layer
    middles = layer.plane.points[layer.triangles].mean(axis=1)
    first, second = (
        stress_lines(plane_stress_at(stress, middles, _REACH)) for stress in (one, other)
    )
    both = first.defined & second.defined
    weight = np.where(both, layer.areas * np.sqrt(np.abs(first.value * second.value)), 0.0)
    cosine = np.einsum("ki,ki->k", first.direction, second.direction)
    total = float(weight.sum())
    return float(weight @ (1.0 - cosine**2)) / total if total > 0.0 else 0.0


def _mean_size(stress: LayerStress) -> float:
    """Mean size of the largest principal stress over a layer, MPa."""
    layer = stress.layer
    middles = layer.plane.points[layer.triangles].mean(axis=1)
    value = np.abs(stress_lines(plane_stress_at(stress, middles, _REACH)).value)
    return float(layer.areas @ value / layer.areas.sum())


def _same_sections(layers: Sequence[Layer]) -> list[list[Layer]]:
    """Flat layers in groups of the same section."""
    sections: list[list[Layer]] = []
    for layer in flat_layers(layers):
        section = layer.plane.polygon
        for group in sections:
            other = group[0].plane.polygon
            difference = shapely.symmetric_difference(section, other).area
            if difference <= _SAME * max(section.area, 1e-300):
                group.append(layer)
                break
        else:
            sections.append([layer])
    return sections


# Main load paths as traced in the paper: a greedy walk over the points of the medial axis.
#
# It serves for comparison. The walk skips joints and leaves stray points, which break up main
# paths; `main_paths` evaluates the same criterion at the joints instead.


_LEAST_POINTS = 3
_WALK_STEP = 1.0
"""Distance, mm, of the points of the axis."""
_RULE = Criterion(90.0, 45.0, 3.0 * _WALK_STEP)


def walk(section: Region, stress: LayerStress, sampling: float) -> list[FloatArray]:
    """Trace load paths over the points of the medial axis.

    The walk starts at an end of the axis under the largest stress, or else at the point under the
    largest stress. The next point is always the one of least smoothness value, within 90 degrees of
    turn, 45 degrees of misalignment and 3 mm, without leaving the section. The walk ends if there
    is none, and new ones start until no point is left. Joints may be passed once per two members.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    sampling : float, mm
        Largest distance of the samples along the border.

    Returns
    -------
    list of (n, 2) arrays, mm
        Those of at least three points, 1 mm apart.
    """
    points, uses, ends = _points(section, sampling)
    if len(points) < _LEAST_POINTS:
        return []
    shapely.prepare(section)
    tree, plane_stress, left = (
        cKDTree(points),
        plane_stress_at(stress, points, _WALK_STEP),
        uses.copy(),
    )
    size = np.abs(stress_lines(plane_stress).value)

    def followed(path: list[int]) -> list[int]:
        """Path continued from its last point until no point is left within the limits."""
        while True:
            near = np.array(tree.query_ball_point(points[path[-1]], _RULE.distance))
            near = near[(left[near] > 0) & ~np.isin(near, path)]
            following = _next_point(path, near, points, plane_stress, section)
            if following is None:
                return path
            left[following] -= 1
            path = [*path, following]

    paths = []
    while (left > 0).any():
        # From ends that no path has used, the most stressed first; then from any point that is
        # left.
        fresh_ends = (left == uses) & ends
        first = np.flatnonzero(fresh_ends if fresh_ends.any() else left > 0)
        start = int(first[np.argmax(size[first])])
        left[start] -= 1
        path = followed([start])
        if not ends[start]:
            path = followed(path[::-1])
        if len(path) >= _LEAST_POINTS:
            paths.append(points[path])
    return paths


def _points(section: Region, sampling: float) -> tuple[FloatArray, IntArray, BoolArray]:
    """Points (n, 2) of the axis, how often each may be passed, and which are ends."""
    axis = medial_axis(section, sampling, object_angle=None, arc_chord=ARC_CHORD)
    if not axis.segments:
        return np.zeros((0, 2)), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool)
    lines, offsets = resample(*pack([segment.points for segment in axis.segments]), _WALK_STEP)
    inner = inner_points(offsets, np.array([segment.ends[0] < 0 for segment in axis.segments]))
    ends = [end for segment in axis.segments for end in segment.ends if end >= 0]
    degree = np.bincount(np.array(ends, dtype=np.int64), minlength=len(axis.nodes))
    nodes = np.flatnonzero(degree)
    points = np.concatenate([axis.nodes[nodes], lines[inner]])
    uses = np.ones(len(points), dtype=np.int64)
    uses[: len(nodes)] = np.maximum(degree[nodes] // 2, 1)
    free = np.zeros(len(points), dtype=bool)
    free[: len(nodes)] = degree[nodes] == 1
    return points, uses, free


def _next_point(
    path: list[int], near: IntArray, points: FloatArray, plane_stress: FloatArray, section: Region
) -> int | None:
    """Point of those near that a path goes on to."""
    here = path[-1]
    distance = np.linalg.norm(points[near] - points[here], axis=1)
    near, distance = near[distance > 0.0], distance[distance > 0.0]
    if not len(near):
        return None
    steps = points[near] - points[here]
    lines = stress_lines(0.5 * (plane_stress[here] + plane_stress[near]))
    alpha = beta = misalignment(steps, lines, 0.5 * _RULE.misalignment)
    if len(path) > 1:
        before = points[here] - points[path[-2]]
        cosine = steps @ before / (distance * np.linalg.norm(before))
        alpha = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    allowed = (alpha <= _RULE.turn) & (beta <= _RULE.misalignment)
    for k in np.argsort(_RULE(alpha, beta, distance), kind="stable"):
        way = shapely.LineString([points[here], points[near[k]]])
        if allowed[k] and section.covers(way):
            return int(near[k])
    return None
