"""Shells, strands along the medial axis, and concentric strands in the rest: MAT.

J. Plocher, J.-B. Wioland, A. Panesar, Additive manufacturing with fibre-reinforcement: design
guidelines and investigation into the influence of infill patterns, Rapid Prototyping Journal 28
(2022) 1241.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from ccfem.elasticity.stress_field import LayerStress
from ccfem.errors import InputError
from ccfem.geometry.medial_fill import medial_fill
from ccfem.geometry.shells import shells
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.planning.strategy import Amount
from ccfem.raster.bitmap import bitmap
from ccfem.raster.patterns import medial_regions
from ccfem.raster.plan import RasterPlan, raster_plan
from ccfem.toolpaths import Toolpaths

__all__ = ["Mat"]


@dataclass(frozen=True)
class Mat:
    """Shells along the border, and strands along the medial axis of what they leave.

    Strands parallel to the medial axis follow, until the first of them would touch a shell;
    concentric strands fill the rest. A part without holes and limbs (a disc) is filled by
    concentric strands alone. The stress is unseen.

    Attributes
    ----------
    spacing : float, default 1
        Distance of neighbouring strands in fibre widths, at least 1.
    shells : int, default 3
        Number of rings along every border.
    closest : float, default 0.6
        As in `Mps`.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    mode : {"polyline", "raster"}, default "polyline"
        Polylines; or paths of pixels a spacing wide, as in the paper: see `ccfem.raster`.
    """

    spacing: float = 1.0
    shells: int = 3
    closest: float = 0.6
    minimum_length: float | None = None
    mode: Literal["polyline", "raster"] = "polyline"

    amount: ClassVar[Amount] = Amount("spacing", most=1.0, least=20.0)
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"raster": {"mode": "raster"}}

    def __post_init__(self) -> None:
        if self.mode not in ("polyline", "raster"):
            raise InputError(f"mat.mode must be polyline or raster; got {self.mode!r}")
        if not 1.0 <= self.spacing < float("inf"):
            raise InputError(f"mat.spacing must be at least 1 fibre width; got {self.spacing}")
        if self.shells < 0:
            raise InputError(f"mat.shells must be at least 0; got {self.shells}")
        if not 0.5 <= self.closest <= 1.0:
            raise InputError(f"mat.closest must lie between 0.5 and 1; got {self.closest}")
        if self.minimum_length is not None and not 0.0 <= self.minimum_length < float("inf"):
            raise InputError(
                f"mat.minimum_length must be a finite number >= 0; got {self.minimum_length}"
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
        lines, interior = shells(
            layer.polygon, machine.fibre_width, pitch, self.shells, self.closest
        )
        lines += medial_fill(interior, pitch, self.closest)
        paths = Toolpaths.from_plane(lines, layer)
        least = machine.minimum_length if self.minimum_length is None else self.minimum_length
        return paths.select(paths.lengths >= least)

    def raster(self, layer: Layer, stress: LayerStress, machine: Machine) -> RasterPlan:
        """Plan one layer on a bitmap of pixels a spacing wide, whatever the mode."""
        image = bitmap(layer.polygon, self.spacing * machine.fibre_width)
        return raster_plan(image, medial_regions(image.mask, self.shells))
