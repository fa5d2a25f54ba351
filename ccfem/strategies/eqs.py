"""Lines equally spaced from one streamline of the principal stress: a strategy to compare with.

One of the three ways that Wang et al. 2021 show beside their own, after V. S.
Papapetrou, C. Patel, A. Y. Tamijani, Stiffness-based optimization framework for the topology and
fiber paths of continuous fiber composites, Composites Part B 183 (2020) 107681 (EQS).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import shapely

from ccfem.arrays import FloatArray
from ccfem.errors import InputError
from ccfem.fields.streamlines import streamlines
from ccfem.geometry.own_way import until_itself
from ccfem.geometry.shapes import Region, open_lines
from ccfem.layers.layer import Layer
from ccfem.layers.layer_stress import LayerStress
from ccfem.machine.machine import Machine
from ccfem.planning.infill import SPACING, check_fill, long_enough
from ccfem.planning.strategy import Amount
from ccfem.tensor import in_plane, strongest_in_plane
from ccfem.toolpaths import Toolpaths

__all__ = ["Eqs"]

_STEP = 0.25
"""Step along the seed line, in fibre widths."""
_CANDIDATES = 20
"""Most stressed places whose streamlines are compared."""
_OFF = 0.005
"""Largest deviation from the distance, in fibre widths."""


@dataclass(frozen=True)
class Eqs:
    """A seed line along the stress, and lines at whole multiples of the spacing from it.

    The seed line is the longest of the streamlines through the twenty most stressed places of the
    layer, or the one through a given point; it stops where it comes within a fibre width of itself,
    and does not wind round a hole again and again. The others are iso-lines of the Euclidean
    distance from it, to its sides and round its ends: exactly parallel, whatever voids lie between.
    Distance measured within the section would lay them across every member that leads away from the
    seed line, and break them behind every hole, where two fronts meet. Away from the seed line the
    stress has no influence.

    Attributes
    ----------
    spacing : float, default 1
        Distance of neighbouring lines in fibre widths, at least 1.
    seed : tuple of 2 floats, mm, optional
        Point in the plane of the layer that the seed line goes through.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    """

    spacing: float = 1.0
    seed: tuple[float, float] | None = None
    minimum_length: float | None = None

    amount: ClassVar[Amount] = SPACING
    in_plane: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"seed": {"seed": (0.0, 0.0)}}

    def __post_init__(self) -> None:
        check_fill(self)
        if self.seed is not None and not np.isfinite(self.seed).all():
            raise InputError(f"eqs.seed must be a point in mm; got {self.seed}")

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        width = machine.fibre_width
        region = shapely.buffer(layer.plane.polygon, -0.5 * width)
        seed = self._seed_line(layer, stress, region, _STEP * width)
        if len(seed) < 2:
            return Toolpaths.empty()
        lines = _iso_lines(seed, region, self.spacing * width, _OFF * width)
        return long_enough(Toolpaths.from_plane(lines, layer), self.minimum_length, machine)

    def _seed_line(
        self, layer: Layer, stress: LayerStress, region: Region, step: float
    ) -> FloatArray:
        """Longest candidate (n, 2); empty where no candidate lies in the region."""
        plane = in_plane(stress.nodal, layer.plane.frame)
        if self.seed is None:
            value, _, _ = strongest_in_plane(plane[layer.triangles].mean(axis=1))
            middles = layer.plane.points[layer.triangles].mean(axis=1)
            order = np.argsort(-np.abs(value), kind="stable")
            starts = middles[order[shapely.contains_xy(region, middles[order])]][:_CANDIDATES]
        else:
            starts = np.array([self.seed])
        lines = streamlines(layer.plane.points, layer.triangles, plane, starts, step)
        width = step / _STEP
        lines = [
            until_itself(line, start, width) for line, start in zip(lines, starts, strict=True)
        ]
        if not lines:
            return np.zeros((0, 2))
        return lines[int(np.argmax([len(line) for line in lines]))]


def _iso_lines(seed: FloatArray, region: Region, pitch: float, off: float) -> list[FloatArray]:
    """Lines (k, 2), mm, at whole multiples of a pitch from a seed line, clipped to a region."""
    curve = shapely.simplify(shapely.LineString(seed), 0.5 * off)
    lines = open_lines(shapely.intersection(curve, region))
    farthest = shapely.hausdorff_distance(region, curve)
    for level in range(1, int(farthest / pitch) + 1):
        distance = level * pitch
        # Of arcs by chords: as many that these are off by no more than half of what is allowed.
        quarter = int(np.ceil(0.25 * np.pi / np.sqrt(off / distance)))
        around = shapely.boundary(shapely.buffer(curve, distance, quad_segs=max(quarter, 4)))
        lines += open_lines(shapely.intersection(around, region))
    return lines
