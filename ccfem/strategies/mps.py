"""MPS: strands along streamlines of the maximum principal stress, and strands parallel to them.

J. Plocher, J.-B. Wioland, A. Panesar, Additive manufacturing with fibre-reinforcement: design
guidelines and investigation into the influence of infill patterns, Rapid Prototyping Journal 28
(2022) 1241.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import in_plane
from ccfem.geometry.abutting import clear_ends
from ccfem.geometry.guide_fit import fitted_guides, spaced_guides
from ccfem.geometry.medial_axis import medial_axis
from ccfem.geometry.parallel_strands import grow, lengthened
from ccfem.geometry.polylines import along_line, line_length, points_along
from ccfem.geometry.shapes import Region
from ccfem.geometry.shells import shells
from ccfem.machine.machine import Machine
from ccfem.paths.fields.streamlines import streamlines
from ccfem.paths.linking.joining import Joined, link_ends
from ccfem.paths.planning.infill import Infill, Turns, check_shells, with_turns
from ccfem.paths.raster.bitmap import Bitmap
from ccfem.paths.raster.guides import stress_guides
from ccfem.paths.raster.patterns import Regions, inside_shells, stress_regions
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress

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
        least = machine.minimum_length if self.minimum_length is None else self.minimum_length
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
        self,
        layer: Layer,
        stress: LayerStress,
        interior: Region,
        seeds: FloatArray,
        pitch: float,
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
    found: list[tuple[float, FloatArray]] = []
    for segment in axis.segments:
        along = along_line(segment.points)
        places = np.array([0.5 * along[-1]])
        if segment.closed:
            widest = along[np.argmax(segment.radius)]
            places = (widest + np.array([0.0, 0.25, 0.5, 0.75]) * along[-1]) % along[-1]
        points = points_along(segment.points, along, places)
        found += zip(np.interp(places, along, segment.radius), points, strict=True)
    ends = {end for segment in axis.segments for end in segment.ends}
    lone = [k for k in range(len(axis.nodes)) if k not in ends]  # discs and squares
    found += zip(axis.radius[lone], axis.nodes[lone], strict=True)
    # Places of equal clearance in a symmetric part keep the order of the axis, longest first.
    found.sort(key=lambda item: -round(item[0] / (0.01 * pitch)))
    return np.reshape([point for _, point in found], (-1, 2))


def _patch_middles(layer: Layer, patches: tuple[str, ...]) -> FloatArray:
    """Node or edge midpoint nearest to the middle of each named patch, (k, 2).

    Where several are equally near, as on the border of a hole, the first one is taken.
    """
    found: list[FloatArray] = []
    for name in patches:
        edges = layer.patches.get(name, np.zeros((0, 2), dtype=np.int64))
        if len(edges):
            nodes = layer.plane.points[np.unique(edges)]
            places = np.concatenate([nodes, layer.plane.points[edges].mean(axis=1)])
            gap = np.linalg.norm(places - nodes.mean(axis=0), axis=1)
            found.append(places[np.argmin(np.round(gap, 6))])
    return np.array(found, dtype=np.float64).reshape(-1, 2)
