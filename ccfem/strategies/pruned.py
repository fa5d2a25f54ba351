"""Any strategy, planned with too much fibre and then relieved of what helps least.

Beyond the papers: the part is tested virtually with the fibre in it, and the stretches that do the
least work go, until the wanted length is left (`ccfem.fibre_aware.prune`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ccfem.checks import check_fields
from ccfem.elasticity.part_stress import PartStress
from ccfem.elasticity.stress_field import solved
from ccfem.errors import InputError
from ccfem.fibre_aware.prune import prune
from ccfem.layers.layer import Layer
from ccfem.layers.layer_stress import LayerStress
from ccfem.machine.machine import Machine
from ccfem.planning.equal_fibre import plan_to_length
from ccfem.planning.strategy import Amount, LayerPlanner
from ccfem.strategies import create
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.strand import RHO, Strand

__all__ = ["Pruned"]


@dataclass(frozen=True)
class Pruned:
    """The fibre of another strategy that helps most.

    The load is the one of the stress that the strategy is given; fibre is taken to carry tension
    only.

    Attributes
    ----------
    of : str, default "isocurve"
        Name of the strategy that plans.
    coverage : float, default 0.45
        Fibre length times strand width over area of the layers, in (0, 1].
    overfill : float, default 1.25
        Fibre length that is planned over that kept, at least 1.
    rounds : int, default 2
        Virtual tests; each takes off half of the excess, the last one all of it.
    rho : float, mm^2, default 4
        Axial stiffness of a strand over Young's modulus of the matrix.
    """

    of: str = "isocurve"
    coverage: float = 0.45
    overfill: float = 1.25
    rounds: int = 2
    rho: float = RHO

    amount: ClassVar[Amount] = Amount("coverage", most=0.9, least=0.1)
    flat_layers_only: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"concentric": {"of": "concentric"}}

    def __post_init__(self) -> None:
        if self.of in ("pruned", "stream_function"):
            raise InputError(f"pruned.of must be another strategy; got {self.of!r}: correct it")
        check_fields(self, "coverage", above=0.0, at_most=1.0)
        check_fields(self, "overfill", "rounds", at_least=1)
        check_fields(self, "rho", above=0.0, unit="mm^2")

    def for_part(
        self, stress: PartStress, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Plan and prune all layers of the part.

        Raises
        ------
        InputError
            Whatever the strategy that plans raises.
        """
        area = float(np.mean([layer.areas.sum() for layer in layers]))
        wanted = self.coverage * area / machine.fibre_width
        planned = plan_to_length(create(self.of), layers, stress, machine, self.overfill * wanted)
        if not len(planned.toolpaths):
            return _Planned(planned.toolpaths)
        return _Planned(
            prune(
                planned.toolpaths,
                solved(stress, "pruned"),
                wanted * len(layers),
                machine,
                Strand(self.rho),
                self.rounds,
            )
        )


@dataclass(frozen=True)
class _Planned:
    """Paths of the whole part, handed out layer by layer."""

    toolpaths: Toolpaths

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        return self.toolpaths.on_layer(layer.index)
