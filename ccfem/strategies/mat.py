"""MAT: shells, strands along the medial axis, and concentric strands in the rest.

J. Plocher, J.-B. Wioland, A. Panesar, Additive manufacturing with fibre-reinforcement: design
guidelines and investigation into the influence of infill patterns, Rapid Prototyping Journal 28
(2022) 1241.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.geometry.medial_axis import MedialSegment, medial_axis
from ccfem.geometry.parallel_strands import grow
from ccfem.geometry.shapes import Region
from ccfem.geometry.shells import concentric, shells
from ccfem.machine.machine import Machine
from ccfem.paths.planning.infill import Infill, Turns, check_shells
from ccfem.paths.raster.bitmap import Bitmap
from ccfem.paths.raster.patterns import Regions, medial_regions
from ccfem.slicing.layers.layer import Layer, LayerStress


@dataclass(frozen=True)
class Mat(Infill):
    """Shells along the border, and strands along the medial axis of the region inside them.

    Further strands run parallel to the medial axis until one would touch a shell. Concentric
    strands fill the rest. A part without holes and limbs (a disc) gets concentric strands only.
    The stress is ignored.

    Attributes
    ----------
    spacing : float, default 1
        Distance between neighbouring strands inside the shells in fibre widths, at least 1.
    shells : int, default 3
        Number of rings along every border, a fibre width apart whatever the spacing.
    closest : float, default 0.6
        As in `Mps`.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    mode : {"polyline", "raster"}, default "polyline"
        Polylines; or paths of pixels one spacing wide, as in the paper: see `ccfem.paths.raster`.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`.
    """

    spacing: float = 1.0
    shells: int = 3
    closest: float = 0.6
    minimum_length: float | None = None
    mode: Literal["polyline", "raster"] = "polyline"
    turns: Turns = "tight"

    ignores_stress: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "raster": {"mode": "raster"},
        "cut": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        check_shells(self)

    def prepare(self, section: Region, machine: Machine) -> list[FloatArray]:
        """All strands: they depend on the section only."""
        width, pitch = machine.fibre_width, self.spacing * machine.fibre_width
        rings, interior = shells(section, width, width, self.shells, self.closest)
        return rings + medial_fill(interior, pitch, self.closest)

    def strands(
        self, layer: Layer, stress: LayerStress, machine: Machine, prepared: list[FloatArray]
    ) -> list[FloatArray]:
        """Strands of the layer's section."""
        return prepared

    def regions(self, image: Bitmap, layer: Layer, stress: LayerStress) -> Regions:
        """Shells, rings of pixels round the medial axis, and concentric rings."""
        return medial_regions(image.mask, self.shells)


# Strands along the medial axis of a section, and concentric strands in the rest.


_SHORTEST = 4.0
"""Segments of the medial axis shorter than this many pitches are left out."""
_BETTER = 0.05
"""Mean misfit, in pitches, by which a pair must be better than one strand on the axis."""


def medial_fill(section: Region, pitch: float, closest: float) -> list[FloatArray]:
    """Strands along the medial axis and parallel to it, and concentric strands in the rest.

    Each is a (k, 2) array, mm. If the width of the section suits an even number of strands, two run
    beside the axis and none on it. Further parallel strands are laid until one would touch the
    border. A section without a medial axis (a disc) gets concentric strands only.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
        Its border is the edge of other strands.
    pitch, closest
        As in `geometry.parallel_strands.grow`.
    """
    axis = medial_axis(section, 0.5 * pitch)
    segments = [s for s in axis.segments if s.length >= _SHORTEST * pitch]
    if not segments:
        return concentric(section, pitch, closest, walls=False)
    pair = _pair(segments, pitch)
    narrowest = min(float(s.radius.min()) for s in segments)
    count = max(int(np.floor(narrowest / pitch - (0.0 if pair else 0.5) + 1e-3)), 0)
    curves = [s.points for s in segments]
    return grow(curves, section, pitch, closest, count, whole=True, pair=pair)


def _pair(segments: Sequence[MedialSegment], pitch: float) -> bool:
    """Whether two strands half a pitch beside the axis leave less gap and overlap than one on it.

    Beside the axis there is room for `radius` / pitch strands, less half a strand if one lies on
    it. The fractional part is a gap or an overlap along the whole length.
    """
    room = np.concatenate([s.radius for s in segments]) / pitch
    weight = np.concatenate([_shares(s.points) for s in segments])
    one, two = (np.average(_misfit(room - half), weights=weight) for half in (0.5, 0.0))
    return bool(two < one - _BETTER)


def _misfit(room: FloatArray) -> FloatArray:
    """Distance of numbers of strands from whole numbers."""
    return np.abs(room - np.round(room))


def _shares(line: FloatArray) -> FloatArray:
    """Length that each point of a line stands for."""
    half = 0.5 * np.linalg.norm(np.diff(line, axis=0), axis=1)
    return np.append(half, 0.0) + np.append(0.0, half)
