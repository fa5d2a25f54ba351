"""Equally spaced lines beside one streamline of the stress in each member: for comparison.

Wang et al. 2021 show three strategies beside their own; this is one of them, after V. S.
Papapetrou, C. Patel, A. Y. Tamijani, Stiffness-based optimization framework for the topology and
fiber paths of continuous fiber composites, Composites Part B 183 (2020) 107681 (EQS).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import in_plane, strongest_in_plane
from ccfem.geometry.polylines import along_line, between, line_length, points_along, until_itself
from ccfem.geometry.shapes import Region, open_lines
from ccfem.machine.machine import Machine
from ccfem.paths.fields.streamlines import streamlines
from ccfem.paths.planning import Amount
from ccfem.paths.planning.infill import SPACING, check_fill, long_enough
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress
from ccfem.strategies.stress_tracing.stress_lines import misalignment, plane_stress_at, stress_lines

_STEP = 0.25
"""Step along the seed line, in fibre widths."""
_CANDIDATES = 20
"""Number of most stressed places whose streamlines are compared."""
_OFF = 0.005
"""Largest error of the distance between lines, in fibre widths."""
_SEEDS = 100
"""Largest number of seed lines on a layer."""
_SHORTEST = 10.0
"""Shortest seed line after the first, in fibre widths."""
_CLEAR = 0.99
"""Distance that the lines of one seed keep from those of another, in spacings."""
_ALONG = 45.0
"""Largest angle, degrees, between a line and the stress; at larger ones it crosses its member."""
_BESIDE = 1.25
"""Distance, in spacings, up to which a line counts as beside the previous one."""
_PIECE = 1.0
"""Length, in fibre widths, of the pieces of a line that are kept or left out."""


@dataclass(frozen=True)
class Eqs:
    """One seed line along the stress in each member, and lines at multiples of the spacing from it.

    A seed line is the longest of the streamlines through the twenty most stressed places in the
    free part of the layer, or the one through a given point. It stops where it comes within a fibre
    width of itself, so it does not circle a hole repeatedly. The other lines are iso-lines of the
    distance from it on both sides, so they are exactly parallel. Each is kept only where it lies
    beside the previous one and within 45 degrees of the stress, so that it stays in the member.
    The next seed line is then laid in what is still free, until none is ten fibre widths long.
    Lines end where members meet: the joints stay open, as in the paper.

    Attributes
    ----------
    spacing : float, default 1
        Distance between neighbouring lines in fibre widths, at least 1.
    seed : tuple of 2 floats, mm, optional
        Point in the plane of the layer that the first seed line goes through.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    """

    spacing: float = 1.0
    seed: tuple[float, float] | None = None
    minimum_length: float | None = None

    amount: ClassVar[Amount] = SPACING
    in_plane: ClassVar[bool] = True
    by_layer: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"seed": {"seed": (0.0, 0.0)}}

    def __post_init__(self) -> None:
        check_fill(self)
        if self.seed is not None and not np.isfinite(self.seed).all():
            raise InputError(f"eqs.seed must be a point in mm; got {self.seed}")

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        width, pitch = machine.fibre_width, self.spacing * machine.fibre_width
        left = shapely.buffer(layer.plane.polygon, -0.5 * width)
        places = _stressed_places(layer, stress, left)
        lines: list[FloatArray] = []
        for k in range(_SEEDS):
            given = self.seed is not None and k == 0
            starts = np.array([self.seed]) if given else places[:_CANDIDATES]
            seed = _seed_line(layer, stress, starts, left, width)
            if len(seed) > 1 and (k == 0 or line_length(seed) >= _SHORTEST * width):
                family = _family(seed, left, pitch, width, stress)
                lines += family
                curves = shapely.multilinestrings([shapely.LineString(line) for line in family])
                around = shapely.buffer(shapely.simplify(curves, _OFF * width), _CLEAR * pitch)
                left = shapely.difference(left, around)
            elif not given:
                places = places[_CANDIDATES:]
            places = places[shapely.contains_xy(left, places)]
            if not len(places):
                break
        return long_enough(Toolpaths.from_plane(lines, layer), self.minimum_length, machine)


def _stressed_places(layer: Layer, stress: LayerStress, region: Region) -> FloatArray:
    """Middles (k, 2) of the triangles in a region, the most stressed first, mm."""
    plane = in_plane(stress.nodal, layer.plane.frame)
    value, _, _ = strongest_in_plane(plane[layer.triangles].mean(axis=1))
    middles = layer.plane.points[layer.triangles].mean(axis=1)
    order = np.argsort(-np.abs(value), kind="stable")
    return middles[order[shapely.contains_xy(region, middles[order])]]


def _seed_line(
    layer: Layer, stress: LayerStress, starts: FloatArray, region: Region, width: float
) -> FloatArray:
    """Longest streamline (n, 2) in a region through one of the start points; empty if none."""
    plane = in_plane(stress.nodal, layer.plane.frame)
    lines = streamlines(layer.plane.points, layer.triangles, plane, starts, _STEP * width)
    longest = np.zeros((0, 2))
    for line, start in zip(lines, starts, strict=True):
        whole = until_itself(line, start, width)
        if len(whole) < 2:
            continue
        pieces = open_lines(shapely.intersection(shapely.LineString(whole), region))
        if not pieces:
            continue
        seed = min(
            pieces, key=lambda piece: shapely.LineString(piece).distance(shapely.Point(start))
        )
        if line_length(seed) > (line_length(longest) if len(longest) else 0.0) + _OFF * width:
            longest = seed
    return longest


def _family(
    seed: FloatArray, region: Region, pitch: float, width: float, stress: LayerStress
) -> list[FloatArray]:
    """Lines (k, 2), mm, at whole multiples of a pitch from a seed line, along its member."""
    off = _OFF * width
    curve = shapely.simplify(shapely.LineString(seed), 0.5 * off)
    family, before = [seed], [seed]
    # The iso-lines also go round the ends of the seed line: there they cross the stress.
    for level in range(1, int(shapely.hausdorff_distance(region, curve) / pitch) + 1):
        distance = level * pitch
        # Chords stand for arcs: enough of them to use up no more than half of the allowed error.
        quarter = int(np.ceil(0.25 * np.pi / np.sqrt(off / distance)))
        around = shapely.boundary(shapely.buffer(curve, distance, quad_segs=max(quarter, 4)))
        curves = [shapely.LineString(line) for line in before]
        near = shapely.simplify(shapely.multilinestrings(curves), off)
        near = shapely.buffer(near, _BESIDE * pitch, quad_segs=4)
        beside = open_lines(shapely.intersection(around, shapely.intersection(region, near)))
        before = _along_stress(beside, stress, width)
        if not before:
            break
        family += before
    return family


def _along_stress(lines: list[FloatArray], stress: LayerStress, width: float) -> list[FloatArray]:
    """Parts of lines (n, 2) that run along the stress, or where the stress has no direction."""
    if not lines:
        return []
    counts = [max(1, round(line_length(line) / (_PIECE * width))) for line in lines]
    at = [np.linspace(0.0, line_length(line), n + 1) for line, n in zip(lines, counts, strict=True)]
    points = [points_along(line, along_line(line), a) for line, a in zip(lines, at, strict=True)]
    middles = np.concatenate([0.5 * (line_points[1:] + line_points[:-1]) for line_points in points])
    along = stress_lines(plane_stress_at(stress, middles, width))
    angle = misalignment(
        np.concatenate([np.diff(line_points, axis=0) for line_points in points]), along, 0.0
    )
    curves = []
    for line, a, angles in zip(lines, at, np.split(angle, np.cumsum(counts)[:-1]), strict=True):
        kept = np.concatenate([[False], angles <= _ALONG, [False]])
        edges = np.flatnonzero(kept[1:] != kept[:-1]).reshape(-1, 2)
        curves += [between(line, float(a[i]), float(a[j])) for i, j in edges]
    return curves
