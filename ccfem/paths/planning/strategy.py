"""The protocols that strategies follow, and a plan that one of them made."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from ccfem.base.arrays import in_brief
from ccfem.base.checks import member_name
from ccfem.fem.elasticity import PartStress
from ccfem.fem.elasticity.stress_field import WeightedCases, solved
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress


@dataclass(frozen=True)
class Amount:
    """The parameter of a strategy that sets how much fibre it lays.

    Attributes
    ----------
    parameter : str
        Name of the field.
    most, least : float
        Values that lay the most and the least fibre.
    beyond : tuple of (str, float), default ()
        Further parameters, each with the value that lays the most. If the first parameter at its
        most lays too little, these change in turn from the strategy's own values to that value.
    """

    parameter: str
    most: float
    least: float
    beyond: tuple[tuple[str, float], ...] = ()


class LayerPlanner(Protocol):
    """Plans the paths of one layer."""

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer."""
        ...


@runtime_checkable
class LayerStrategy(Protocol):
    """A frozen dataclass whose fields are the parameters, called for each layer with data.

    A strategy that works in the plane of a layer has a class variable ``in_plane = True``: `plan`
    then passes curved layers laid flat. A strategy that cannot plan on curved layers at all, such
    as one that solves the part again layer by layer, has ``flat_layers_only = True``: `plan`
    refuses curved layers before any work.

    Attributes
    ----------
    amount : Amount
        The parameter that sets how much fibre is laid.
    variants : mapping of str to parameters, optional
        Further parameter sets, by a short name, that the tests common to all strategies also run:
        ``{"literal": {"fit": "literal"}}``, one for each branch that the defaults never take. A
        point in them must be the origin, about which these tests rotate their part.
    direction : str, optional
        The parameter, in degrees, that sets a direction independent of the stress.
    ignores_stress : bool, default False
        Whether its paths are the same under any load.
    by_layer : bool, default False
        Whether its paths follow from the section, the patches and the stress of a layer alone: of
        many layers those that are alike are then planned once (`ccfem.paths.planning.alike`).
    crosses : bool, default False
        Whether strands cross each other on purpose.
    folds : bool, default False
        Whether strands may fold (`ccfem.paths.folds`), as those of published patterns that turn
        back by design. Strands of all others are led round folds or cut there.
    on_axes : bool, default False
        Whether paths follow the axes of the layer, as paths of pixels do, and so do not rotate with
        the part.
    """

    amount: ClassVar[Amount]

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer."""
        ...


@runtime_checkable
class PartStrategy(Protocol):
    """A frozen dataclass like a `LayerStrategy`, which sees the whole part before its layers."""

    amount: ClassVar[Amount]

    def for_part(
        self, stress: PartStress, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Prepare what all layers share, and return the planner of each layer."""
        ...


@runtime_checkable
class LengthStrategy(PartStrategy, Protocol):
    """A `PartStrategy` that takes the length of fibre itself, so that no search is needed."""

    def natural_length(self, layers: Sequence[Layer], machine: Machine) -> float:
        """Length that its parameters ask for, mm per layer, known without planning."""
        ...

    def to_lengths(
        self,
        stress: PartStress,
        layers: Sequence[Layer],
        machine: Machine,
        lengths: Sequence[float],
    ) -> "Sequence[tuple[Strategy, LayerPlanner]]":
        """Plan to several lengths, mm per layer; one plan is cut for several where that is as good.

        Returns
        -------
        sequence of (Strategy, LayerPlanner)
            For each length, the strategy that lays it and the planner of the layers. No plan lays
            more than asked for; if even the whole plan is too short, it is taken as a whole.
        """
        ...


@runtime_checkable
class CasesStrategy(LengthStrategy, Protocol):
    """A `LengthStrategy` that plans for several load cases at once."""

    def for_cases(
        self,
        cases: WeightedCases,
        layers: Sequence[Layer],
        machine: Machine,
        lengths: Sequence[float],
    ) -> "Sequence[tuple[Strategy, LayerPlanner]]":
        """Plan for all cases; lengths and result as in `to_lengths`."""
        ...


Strategy = LayerStrategy | PartStrategy


# Toolpaths of a part planned to a length of fibre.


@dataclass(frozen=True)
class Planned:
    """Toolpaths of a part, and the strategy that made them.

    Attributes
    ----------
    strategy : Strategy
        With the values found (for most layers, see `note`).
    length_per_layer : float, mm
        Fibre length divided by the number of layers.
    note : str
        Empty, or one line: which layers have another value, or why the wanted length was missed.
    reached : bool
        Whether the plan lays the wanted length within the tolerance
        (`ccfem.paths.planning.equal_fibre`).
    """

    strategy: Strategy
    toolpaths: Toolpaths
    length_per_layer: float
    note: str = ""
    reached: bool = True

    __repr__ = in_brief


# Common parts of strategies that plan all layers of a part at once, to a share of its area.


def full_length(layers: Sequence[Layer], machine: Machine) -> float:
    """Length of fibre that covers a layer side by side, mm, mean over the layers."""
    return float(np.mean([layer.areas.sum() for layer in layers])) / machine.fibre_width


class ByCoverage:
    """A `CasesStrategy` that plans for one load case as for several, by a coverage.

    That is the length of fibre over that which fills all layers.
    """

    coverage: float

    def natural_length(self, layers: Sequence[Layer], machine: Machine) -> float:
        """Length that the coverage asks for, mm per layer."""
        return self.coverage * full_length(layers, machine)

    def to_lengths(
        self: CasesStrategy,
        stress: PartStress,
        layers: Sequence[Layer],
        machine: Machine,
        lengths: Sequence[float],
    ) -> "Sequence[tuple[Strategy, LayerPlanner]]":
        """Plan for one load case by `for_cases`."""
        cases = WeightedCases.of(solved(stress, member_name(self)))
        return self.for_cases(cases, layers, machine, lengths)


@dataclass(frozen=True)
class WholePart:
    """Paths of all layers of a part, returned layer by layer: a `LayerPlanner`."""

    toolpaths: Toolpaths

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Paths of one layer."""
        return self.toolpaths.on_layer(layer.index)
