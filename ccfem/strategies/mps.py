"""Strands along lines of the maximum principal stress, and parallel to them: MPS.

J. Plocher, J.-B. Wioland, A. Panesar, Additive manufacturing with fibre-reinforcement: design
guidelines and investigation into the influence of infill patterns, Rapid Prototyping Journal 28
(2022) 1241.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, Literal

import numpy as np
import shapely

from ccfem.arrays import FloatArray, read_only
from ccfem.elasticity.stress_field import LayerStress
from ccfem.errors import InputError
from ccfem.fields.streamlines import streamlines
from ccfem.geometry.guide_fit import fitted_guides
from ccfem.geometry.guides import spaced_guides
from ccfem.geometry.medial_axis import medial_axis
from ccfem.geometry.parallel_strands import grow, lengthened
from ccfem.geometry.shells import shells
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.planning.strategy import Amount
from ccfem.raster.bitmap import bitmap
from ccfem.raster.guides import stress_guides
from ccfem.raster.patterns import inside_shells, stress_regions
from ccfem.raster.plan import RasterPlan, raster_plan
from ccfem.tensor import in_plane
from ccfem.toolpaths import Toolpaths

__all__ = ["Mps"]

_STEP = 0.5
_APART = 2.0
_SHORTEST = 6.0
_AT_BORDER = 1.5
_BEYOND = 4.0
"""Of guides, in pitches: step along the streamline, least distance from one to the next, least
length, distance to the shells up to which an end is taken for one at the border, and by how much it
is then made longer, so that the strands parallel to it reach a slanted border too."""


@dataclass(frozen=True)
class Mps:
    """Shells along the border, and inside strands parallel to streamlines of the stress.

    The streamlines follow the principal stress of the largest size in the plane of the layer, and
    move aside by up to half a spacing, so that whole strands fit beside them. Strands lie at whole
    multiples of the spacing from them, each along the nearest streamline, until they meet;
    concentric strands fill what stays open.

    Attributes
    ----------
    spacing : float, default 1
        Distance of neighbouring strands in fibre widths, at least 1.
    shells : int, default 3
        Number of rings along every border.
    seeds : "segments", "ends" or tuple of points, default "segments"
        Where the streamlines start: at the middle of each segment of the medial axis inside the
        shells; at the middle of each patch that carries a load or a support (the paper); or at
        points (x, y), mm, in the plane of the layer.
    closest : float, default 0.6
        Least distance of strands in spacings; where they come nearer than 1 they overlap, which
        leaves smaller gaps. 1 for no overlap.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    mode : {"polyline", "raster"}, default "polyline"
        Polylines; or paths of pixels a spacing wide, as in the paper: see `ccfem.raster`.
    """

    spacing: float = 1.0
    shells: int = 3
    seeds: Literal["segments", "ends"] | tuple[tuple[float, float], ...] = "segments"
    closest: float = 0.6
    minimum_length: float | None = None
    mode: Literal["polyline", "raster"] = "polyline"

    amount: ClassVar[Amount] = Amount("spacing", most=1.0, least=20.0)
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "ends": {"seeds": "ends"},
        "raster": {"mode": "raster"},
        "raster_ends": {"mode": "raster", "seeds": "ends"},
    }

    def __post_init__(self) -> None:
        if self.mode not in ("polyline", "raster"):
            raise InputError(f"mps.mode must be polyline or raster; got {self.mode!r}")
        if not 1.0 <= self.spacing < float("inf"):
            raise InputError(f"mps.spacing must be at least 1 fibre width; got {self.spacing}")
        if self.shells < 0:
            raise InputError(f"mps.shells must be at least 0; got {self.shells}")
        if isinstance(self.seeds, str) and self.seeds not in ("segments", "ends"):
            raise InputError(
                f"mps.seeds must be 'segments', 'ends' or a list of points; got {self.seeds!r}"
            )
        if not 0.5 <= self.closest <= 1.0:
            raise InputError(f"mps.closest must lie between 0.5 and 1; got {self.closest}")
        if self.minimum_length is not None and not 0.0 <= self.minimum_length < float("inf"):
            raise InputError(
                f"mps.minimum_length must be a finite number >= 0; got {self.minimum_length}"
            )

    @property
    def on_axes(self) -> bool:
        """Whether paths keep to the axes of the layer."""
        return self.mode == "raster"

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        if self.mode == "raster":
            plan = self.raster(layer, stress, machine)
            return plan.toolpaths(layer, machine, self.minimum_length)
        pitch = self.spacing * machine.fibre_width
        rings, interior = shells(
            layer.polygon, machine.fibre_width, pitch, self.shells, self.closest
        )
        guides = self._guides(layer, stress, interior, pitch)
        paths = Toolpaths.from_plane(rings + grow(guides, interior, pitch, self.closest), layer)
        least = machine.minimum_length if self.minimum_length is None else self.minimum_length
        return paths.select(paths.lengths >= least)

    def raster(self, layer: Layer, stress: LayerStress, machine: Machine) -> RasterPlan:
        """Plan one layer on a bitmap of pixels a spacing wide, whatever the mode."""
        image = bitmap(layer.polygon, self.spacing * machine.fibre_width)
        inside = inside_shells(image.mask, self.shells)
        points = None
        if self.seeds == "ends":
            points = _patch_middles(layer, stress.part.problem.held_or_loaded)
        elif self.seeds != "segments":
            points = np.array(self.seeds, dtype=np.float64).reshape(-1, 2)
        guides = stress_guides(image, inside, layer, stress, points)
        return raster_plan(image, stress_regions(image.mask, guides, self.shells))

    def _guides(
        self, layer: Layer, stress: LayerStress, interior: Any, pitch: float
    ) -> list[FloatArray]:
        """Streamlines inside the shells, moved aside so that whole strands fit beside them."""
        if shapely.is_empty(interior):
            return []
        seeds = self._seeds(layer, stress, interior, pitch)
        curves = streamlines(
            layer.plane_points,
            layer.triangles,
            in_plane(stress.nodal, layer.frame),
            seeds,
            _STEP * pitch,
        )
        guides = spaced_guides(curves, seeds, interior, _APART * pitch, _SHORTEST * pitch)
        guides = fitted_guides(guides, interior, pitch)
        return [
            lengthened(guide, interior, _AT_BORDER * pitch, _BEYOND * pitch) for guide in guides
        ]

    def _seeds(self, layer: Layer, stress: LayerStress, interior: Any, pitch: float) -> FloatArray:
        """Points (k, 2) inside the shells that streamlines start from, the first before others."""
        if self.seeds == "segments":
            return _middles(interior, pitch)
        if self.seeds == "ends":
            points = _patch_middles(layer, stress.part.problem.held_or_loaded)
        else:
            points = np.array(self.seeds, dtype=np.float64).reshape(-1, 2)
        # Points outside go to the nearest place inside, a little off the border.
        inner = shapely.buffer(interior, -0.1 * pitch, join_style="mitre")
        return shapely.get_coordinates(
            [
                shapely.shortest_line(inner, point).interpolate(0.0)
                for point in shapely.points(points)
            ]
        )


@lru_cache(maxsize=32)
def _middles(interior: Any, pitch: float) -> FloatArray:
    """Middle of each segment or point of the medial axis, that of the largest clearance first.

    A closed one has four: its place of the largest clearance, and those a quarter of the way round
    from each to the next.
    """
    axis = medial_axis(interior, 0.5 * pitch)
    found: list[tuple[float, FloatArray]] = []
    for segment in axis.segments:
        steps = np.linalg.norm(np.diff(segment.points, axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        places = np.array([0.5 * along[-1]])
        if segment.closed:
            widest = along[np.argmax(segment.radius)]
            places = (widest + np.array([0.0, 0.25, 0.5, 0.75]) * along[-1]) % along[-1]
        points = np.stack([np.interp(places, along, x) for x in segment.points.T], axis=1)
        found += zip(np.interp(places, along, segment.radius), points, strict=True)
    ends = {end for segment in axis.segments for end in segment.ends}
    lone = [k for k in range(len(axis.nodes)) if k not in ends]  # discs and squares
    found += zip(axis.radius[lone], axis.nodes[lone], strict=True)
    # Equal ones of a symmetric part keep the order of the axis, which puts the longest first.
    found.sort(key=lambda item: -round(item[0] / (0.01 * pitch)))
    return read_only(np.reshape([point for _, point in found], (-1, 2)))


def _patch_middles(layer: Layer, patches: tuple[str, ...]) -> FloatArray:
    """Node or middle of an edge nearest to the middle of each named patch, (k, 2).

    Of several that are equally near, as on the border of a hole, the first.
    """
    found: list[FloatArray] = []
    for name in patches:
        edges = layer.patches.get(name, np.zeros((0, 2), dtype=np.int64))
        if len(edges):
            nodes = layer.plane_points[np.unique(edges)]
            places = np.concatenate([nodes, layer.plane_points[edges].mean(axis=1)])
            gap = np.linalg.norm(places - nodes.mean(axis=0), axis=1)
            found.append(places[np.argmin(np.round(gap, 6))])
    return np.array(found, dtype=np.float64).reshape(-1, 2)
