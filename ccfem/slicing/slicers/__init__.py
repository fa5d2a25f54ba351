"""Slicers: each turns a part into layers. One module a slicer."""

from collections.abc import Mapping, Sequence
from typing import Any

from ccfem.base import plugins
from ccfem.base.checks import check_instance
from ccfem.base.errors import InputError, shown
from ccfem.base.toml import assignment
from ccfem.fem.elasticity.stress_field import PartStress
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.slicer import Slicer, Vector
from ccfem.slicing.slicers.planar import Planar

__all__ = ["as_slicer", "create", "from_text", "named", "slice", "split"]


def named() -> Mapping[str, type[Slicer]]:
    """Every slicer by name: modules of this package and entry points ``ccfem.slicers``."""
    return plugins.discovered(__name__, "ccfem.slicers")


def create(name: str, parameters: Mapping[str, Any] | None = None) -> Slicer:
    """Make a slicer from its name and parameters."""
    return plugins.create("slicer", named(), name, parameters)


def from_text(text: str) -> Slicer:
    """Make a slicer from a text, ``method:name=value,name=value``.

    A value without a name belongs to the parameter that the slicer names in `shorthand`:
    ``planar:z`` is ``planar:axis=z``.
    """
    method, _, rest = (part.strip() for part in text.partition(":"))
    parameters = {}
    for setting in (word.strip() for word in rest.split(",") if word.strip()):
        if "=" in setting:
            name, value = assignment(setting)
        else:
            name, value = getattr(named().get(method), "shorthand", ""), setting
        if not name:
            raise InputError(f"slicer '{method}' expects NAME=VALUE; got '{setting}': name it")
        parameters[name] = value
    return create(method, parameters)


def split(text: str) -> tuple[str, ...]:
    """Split slicings separated by commas; ``name=value`` belongs to the slicing before it."""
    words: list[str] = []
    for word in (word.strip() for word in text.split(",")):
        if not word:
            continue
        if words and "=" in word and ":" not in word.partition("=")[0]:
            words[-1] += f"{',' if ':' in words[-1] else ':'}{word}"
        else:
            words.append(word)
    return tuple(words)


def as_slicer(layers: "int | Sequence[float] | str | Slicer") -> Slicer:
    """Make a slicer from one of the short forms.

    A number of flat layers, their heights in mm, the name of a slicer with parameters as in
    `from_text`, or a slicer itself.
    """
    if isinstance(layers, str):
        return from_text(layers)
    if isinstance(layers, type) or callable(layers):
        check_instance("slicer", layers)
        assert isinstance(layers, Slicer)
        return layers
    if isinstance(layers, int):
        return Planar(count=layers)
    try:
        return Planar(heights=tuple(layers))
    except TypeError:
        raise InputError(
            "layers must be their number, their heights in mm, or a slicer or its name, as "
            f"'planar:z'; got {shown(layers)}: give one of these"
        ) from None


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

    Returns
    -------
    tuple of Layer
        From the first printed to the last.
    """
    return as_slicer(layers)(stress, build, Machine() if machine is None else machine)


def __getattr__(name: str) -> Any:
    return plugins.by_class(__name__, name)
