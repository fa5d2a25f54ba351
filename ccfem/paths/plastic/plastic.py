"""What the plastic of a part is printed as: walls, skins, infill and seam."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from ccfem.base.checks import check_choices, check_fields, check_number
from ccfem.base.errors import InputError

MOST_WALLS = 100
LEAST_DENSITY, MOST_DENSITY = 0.05, 0.6
"""Densities of infill for which its lines stand apart, and its moduli are known."""


@dataclass(frozen=True)
class Plastic:
    """Walls, skins, infill and seam, in a part file ``[plastic]``.

    The default is a solid part.

    Attributes
    ----------
    infill : {"solid", "lines", "grid", "gyroid"}
        What fills the part inside walls and skins, where no fibre is near. Lines turn by 90 degrees
        from layer to layer; a grid has both directions on each layer; a gyroid winds upwards.
    density : float
        Share of its volume that infill other than solid fills, 0.05 to 0.6.
    walls : int
        Lines along the border of every layer, round holes too, at least 1.
    skins : int
        Solid layers below every face that looks up, and above every face that looks down.
    fibre_skins : int
        Solid layers below and above every layer of fibre, at least 1.
    seam : {"any", "behind", "corner"}
        Where a wall begins and ends: where its polygon does, at its largest Y on the bed, or at its
        sharpest outer corner.
    """

    infill: Literal["solid", "lines", "grid", "gyroid"] = "solid"
    density: float = 0.2
    walls: int = 1
    skins: int = 3
    fibre_skins: int = 1
    seam: Literal["any", "behind", "corner"] = "any"

    def __post_init__(self) -> None:
        check_choices(self)
        check_number("density", self.density, at_least=LEAST_DENSITY, at_most=MOST_DENSITY)
        check_fields(self, "walls", "fibre_skins", at_least=1, at_most=MOST_WALLS)
        check_fields(self, "skins", at_least=0, at_most=MOST_WALLS)
        for name in ("walls", "skins", "fibre_skins"):
            if not isinstance(getattr(self, name), int):
                raise InputError(f"{name} must be a whole number; got {getattr(self, name)}")

    @cached_property
    def solid(self) -> bool:
        """Whether the whole part is filled."""
        return self.infill == "solid"

    def about(self) -> str:
        """Return what it is, in words."""
        walls = f"{self.walls} wall{'s' * (self.walls > 1)}"
        if self.solid:
            return f"{walls}, solid"
        skins = f"{self.skins} skin{'s' * (self.skins != 1)}"
        return f"{walls}, {skins}, {self.density:.0%} {self.infill}"

    def spacing(self, width: float) -> float:
        """Distance, mm, of parallel lines a width thick, or period of a gyroid.

        A gyroid of period 1 has ``GYROID`` of lines in a unit of volume.
        """
        factor = {"lines": 1.0, "grid": 2.0, "gyroid": GYROID}.get(self.infill, self.density)
        return factor * width / self.density


GYROID = 2.458
"""Length of the lines of a gyroid of period 1 on a unit of area, mean over the height.

PrusaSlicer takes 2.44 (``FillGyroid::DensityAdjust``)."""

SOLID = Plastic()
"""The plastic where nothing is said of it."""
