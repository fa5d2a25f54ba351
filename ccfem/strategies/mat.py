"""MAT: shells, strands along the medial axis, and concentric strands in the rest.

J. Plocher, J.-B. Wioland, A. Panesar, Additive manufacturing with fibre-reinforcement: design
guidelines and investigation into the influence of infill patterns, Rapid Prototyping Journal 28
(2022) 1241.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from ccfem.base.arrays import FloatArray
from ccfem.geometry.medial_fill import medial_fill
from ccfem.geometry.shapes import Region
from ccfem.geometry.shells import shells
from ccfem.machine.machine import Machine
from ccfem.paths.planning.infill import Infill, Turns, check_shells
from ccfem.paths.raster.bitmap import Bitmap
from ccfem.paths.raster.patterns import Regions, medial_regions
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress


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
