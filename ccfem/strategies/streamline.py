"""Evenly spaced streamlines of the principal stress, unchanged: for comparison.

Wang et al. 2021 show three strategies beside their own; this is one of them, after V. S.
Papapetrou, C. Patel, A. Y. Tamijani, Stiffness-based optimization framework for the topology and
fiber paths of continuous fiber composites, Composites Part B 183 (2020) 107681.
The lines are those of B. Jobard, W. Lefer, Creating evenly-spaced streamlines of arbitrary density,
Visualization in Scientific Computing '97, Springer (1997) 43.
"""

from dataclasses import dataclass
from typing import ClassVar

import shapely

from ccfem.base.checks import check_fields
from ccfem.base.tensor import in_plane
from ccfem.machine.machine import Machine
from ccfem.paths.fields.evenly_spaced import evenly_spaced_streamlines
from ccfem.paths.planning.infill import SPACING, check_fill, long_enough
from ccfem.paths.planning.strategy import Amount
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress

_LEAST = 0.995
"""Least distance between lines, in fibre widths. At exactly one width rounding would end lines that
run side by side."""
_TOLERANCE = 2e-3
"""Error, in fibre widths, up to which points of a streamline are left out."""


@dataclass(frozen=True)
class Streamline:
    """Streamlines of the in-plane principal stress of largest absolute value.

    Lines end where they converge, and new ones begin where they diverge. Nothing joins them, and
    joints where the direction jumps stay open. Lines too short for the cutter are dropped.

    Attributes
    ----------
    spacing : float, default 1
        Distance from existing lines at which new lines begin, in fibre widths, at least 1.
    closest : float, default 0.5
        Distance at which lines end, in spacings; never less than a fibre width.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    """

    spacing: float = 1.0
    closest: float = 0.5
    minimum_length: float | None = None

    amount: ClassVar[Amount] = SPACING
    in_plane: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_fill(self)
        check_fields(self, "closest", at_least=0.1, at_most=0.95, unit="spacings")

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        width = machine.fibre_width
        least = machine.minimum_length if self.minimum_length is None else self.minimum_length
        lines = evenly_spaced_streamlines(
            layer.plane.points,
            layer.triangles,
            in_plane(stress.nodal, layer.plane.frame),
            shapely.buffer(layer.plane.polygon, -0.5 * width),
            self.spacing * width,
            max(self.closest, _LEAST / self.spacing),
            least,
        )
        smooth = shapely.simplify([shapely.LineString(line) for line in lines], _TOLERANCE * width)
        paths = Toolpaths.from_plane([shapely.get_coordinates(line) for line in smooth], layer)
        return long_enough(paths, self.minimum_length, machine)
