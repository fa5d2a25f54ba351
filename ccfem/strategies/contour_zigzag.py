"""Baseline: contours along the border, a zigzag inside."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ccfem.elasticity.stress_field import LayerStress
from ccfem.errors import InputError
from ccfem.geometry.hatch import zigzag
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.planning.strategy import Amount
from ccfem.strategies.concentric import Concentric
from ccfem.toolpaths import Toolpaths

__all__ = ["ContourZigzag"]


@dataclass(frozen=True)
class ContourZigzag:
    """Rings along every border, and linked parallel lines in what is left.

    What commercial fibre slicers lay, and the load-independent paths that Chen et al. 2021 compare
    theirs with (table 2). The stress is unseen.

    Attributes
    ----------
    spacing : float, default 1
        Distance of the zigzag's lines in fibre widths, at least 1. The contours stay one fibre
        width apart.
    contours : int, default 2
        Number of rings along each border.
    angle, turn : float, degrees, default 45 and 90
        As in `Zigzag`.
    joined : bool, default True
        As in `Concentric`.
    """

    spacing: float = 1.0
    contours: int = 2
    angle: float = 45.0
    turn: float = 90.0
    joined: bool = True

    amount: ClassVar[Amount] = Amount("spacing", most=1.0, least=20.0)
    direction: ClassVar[str] = "angle"
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"single": {"joined": False}}

    def __post_init__(self) -> None:
        if not 1.0 <= self.spacing < float("inf"):
            raise InputError(
                f"contour_zigzag.spacing must be at least 1 fibre width; got {self.spacing}"
            )
        if self.contours < 1:
            raise InputError(
                f"contour_zigzag.contours must be at least 1; got {self.contours}: use "
                "zigzag for none"
            )

        if not np.isfinite([self.angle, self.turn]).all():
            raise InputError(
                f"contour_zigzag.angle and contour_zigzag.turn must be finite degrees; got "
                f"{self.angle} and {self.turn}"
            )

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        width = machine.fibre_width
        contours = Concentric(rings=self.contours, joined=self.joined)(layer, stress, machine)
        inside, angle = (
            (self.contours + 0.5) * width,
            np.radians(self.angle + self.turn * layer.index),
        )
        lines = zigzag(layer.polygon, inside, width, self.spacing * width, angle)
        inner = Toolpaths.from_plane(lines, layer)
        inner = inner.select(inner.lengths >= machine.minimum_length)
        return Toolpaths.concatenate([contours, inner])
