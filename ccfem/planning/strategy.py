"""What a strategy is, and how strategies are found by name."""

import dataclasses
import importlib
import os
import pkgutil
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Any, ClassVar, Protocol, runtime_checkable

from ccfem.elasticity.stress_field import LayerStress, StressField
from ccfem.errors import InputError, known_names
from ccfem.io.toml import from_table
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.toolpaths import Toolpaths

__all__ = ["Amount", "LayerStrategy", "Strategy", "create", "named", "plan"]


_MOST_THREADS = 4
"""Layers that are planned at a time; much of the work waits for the interpreter's lock."""


@dataclass(frozen=True)
class Amount:
    """The parameter of a strategy that sets how much fibre it lays.

    Attributes
    ----------
    parameter : str
        Name of the field.
    most, least : float
        Values that lay the most and the least fibre.
    """

    parameter: str
    most: float
    least: float


class LayerStrategy(Protocol):
    """Plans the paths of one layer."""

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer."""
        ...


@runtime_checkable
class Strategy(Protocol):
    """A frozen dataclass whose fields are the parameters, called with data.

    A strategy that has to see the whole part before its layers also has
    ``for_part(stress, layers, machine) -> LayerStrategy``; `plan` calls it once a part.

    Attributes
    ----------
    amount : Amount
        The parameter that sets how much fibre is laid.
    variants : mapping of str to parameters, optional
        Other parameters than the defaults, by a short name, that the laws of strategies also run:
        ``{"literal": {"fit": "literal"}}``. One for each branch that the defaults never take. A
        point in them is the origin, about which the laws turn their part.
    direction : str, optional
        The parameter, in degrees, that gives a strategy a direction of its own.
    crosses : bool, default False
        Whether strands cross each other by intention.
    on_axes : bool, default False
        Whether paths keep to the axes of the layer, as those of pixels do, and so do not turn with
        the part.
    """

    amount: ClassVar[Amount]

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer."""
        ...


def named() -> Mapping[str, type[Strategy]]:
    """Every strategy by name: the modules of this package, and entry points ``ccfem.strategies``.

    The name of a module is the name of its strategy: ``contour_zigzag`` holds ``ContourZigzag``.
    """
    import ccfem.strategies as package

    found: dict[str, type[Strategy]] = {}
    for info in pkgutil.iter_modules(package.__path__):
        if info.name == "strategy":
            continue
        module = importlib.import_module(f"{package.__name__}.{info.name}")
        found[info.name] = getattr(module, info.name.title().replace("_", ""))
    for entry in entry_points(group="ccfem.strategies"):
        found[entry.name] = entry.load()
    return found


def create(name: str, parameters: Mapping[str, Any] | None = None) -> Strategy:
    """Make a strategy from its name and parameters.

    Raises
    ------
    InputError
        For an unknown strategy or parameter, the known ones listed; for a value of a wrong type.
    """
    known = named()
    if name not in known:
        raise InputError(
            f"no strategy named '{name}'; there are: {known_names(name, sorted(known))}"
        )
    fields = {f.name for f in dataclasses.fields(known[name])}  # type: ignore[arg-type]
    for parameter in parameters or {}:
        if parameter not in fields:
            raise InputError(
                f"strategy '{name}' has no parameter '{parameter}'; it has: "
                f"{known_names(parameter, sorted(fields))}"
            )
    table = {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in (parameters or {}).items()
    }
    return from_table(known[name], table, f"strategies.{name}")


def plan(
    strategy: Strategy,
    layers: Sequence[Layer],
    stress: StressField,
    machine: Machine,
) -> Toolpaths:
    """Plan the paths of a whole part, several layers at a time.

    Parameters
    ----------
    strategy : Strategy
        Called from several threads at once, each with a layer of its own.
    layers : sequence of Layer
    stress : StressField
    machine : Machine

    Returns
    -------
    Toolpaths
        The paths of all layers, in their order.
    """
    for_part = getattr(strategy, "for_part", None)
    planner: LayerStrategy = for_part(stress, layers, machine) if for_part else strategy

    def planned(layer: Layer) -> Toolpaths:
        return planner(layer, stress.on(layer), machine)

    with ThreadPoolExecutor(min(os.cpu_count() or 1, _MOST_THREADS)) as pool:
        return Toolpaths.concatenate(pool.map(planned, layers))
