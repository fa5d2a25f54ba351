"""Slicers: each turns a part into layers. One module a slicer."""

from collections.abc import Mapping, Sequence
from typing import Any

from ccfem import plugins
from ccfem.elasticity.part_stress import PartStress
from ccfem.layers.layer import Layer
from ccfem.layers.slicer import Slicer, Vector
from ccfem.layers.slicing.planar import Planar
from ccfem.machine.machine import Machine

__all__ = ["as_slicer", "create", "named", "slice"]


def named() -> Mapping[str, type[Slicer]]:
    """Every slicer by name: the modules of this package, and entry points ``ccfem.slicers``."""
    return plugins.found(__name__, "ccfem.slicers")


def create(name: str, parameters: Mapping[str, Any] | None = None) -> Slicer:
    """Make a slicer from its name and parameters.

    Raises
    ------
    InputError
        For an unknown slicer or parameter, the known ones listed; for a value of a wrong type.
    """
    return plugins.create("slicer", named(), name, parameters)


def as_slicer(layers: "int | Sequence[float] | str | Slicer") -> Slicer:
    """Make a slicer of what short forms say.

    Parameters
    ----------
    layers : int, sequence of float, str or Slicer
        A number of flat layers, their heights in mm, the name of a slicer, or a slicer itself.
    """
    if isinstance(layers, str):
        return create(layers)
    if isinstance(layers, Slicer):
        return layers
    return Planar(count=layers) if isinstance(layers, int) else Planar(heights=tuple(layers))


def slice(
    stress: PartStress,
    layers: "int | Sequence[float] | str | Slicer" = 12,
    build: Vector = (0.0, 0.0, 1.0),
    machine: Machine | None = None,
) -> tuple[Layer, ...]:
    """Cut a part into layers.

    Parameters
    ----------
    stress : PartStress
        The part with its stress, which slicers of curved layers follow.
    layers : int, sequence of float, str or Slicer, default 12
        As in `as_slicer`.
    build : tuple of 3 floats, default z
        Build direction.
    machine : Machine, optional

    Returns
    -------
    tuple of Layer
        From the first printed to the last.
    """
    return as_slicer(layers)(stress, build, Machine() if machine is None else machine)


def __getattr__(name: str) -> Any:
    return plugins.by_class(__name__, name)
