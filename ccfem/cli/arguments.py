"""Texts of the command line turned into names, numbers and parameters."""

import tomllib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ccfem.errors import InputError

if TYPE_CHECKING:
    from ccfem.layers.slicer import Slicer

__all__ = [
    "assignment",
    "names_of",
    "numbers_of",
    "parameters_by_strategy",
    "parameters_of",
    "slicer_of",
]


def names_of(text: str) -> tuple[str, ...]:
    """Split names with commas between."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def numbers_of(text: str) -> tuple[float, ...]:
    """Split numbers with commas between."""
    try:
        return tuple(float(number) for number in names_of(text))
    except ValueError:
        raise InputError(f"expected numbers with commas between; got '{text}'") from None


def assignment(text: str) -> tuple[str, Any]:
    """Split ``name=value``; the value is read as TOML, or else as a plain string."""
    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not name:
        raise InputError(f"expected NAME=VALUE; got '{text}': write for example cap=90")
    try:
        return name, tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return name, value


def parameters_by_strategy(texts: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Parameters of several strategies, each as ``strategy.name=value``.

    Raises
    ------
    InputError
        When a text names no strategy, or has no ``=``.
    """
    found: dict[str, dict[str, Any]] = {}
    for text in texts:
        path, value = assignment(text)
        strategy, dot, name = path.partition(".")
        if not dot:
            raise InputError(f"--set expects STRATEGY.NAME=VALUE; got '{text}'")
        found.setdefault(strategy, {})[name] = value
    return found


def parameters_of(strategy: str, texts: Sequence[str]) -> dict[str, Any]:
    """Parameters of one strategy, each as ``name=value`` or ``strategy.name=value``.

    Raises
    ------
    InputError
        When a text names another strategy, or has no ``=``.
    """
    found = {}
    for text in texts:
        path, value = assignment(text)
        owner, dot, name = path.rpartition(".")
        if dot and owner != strategy:
            raise InputError(
                f"--set expects a parameter of {strategy}, the one strategy here; got '{text}': "
                f"write {name}=VALUE or {strategy}.{name}=VALUE"
            )
        found[name] = value
    return found


def slicer_of(text: str) -> "Slicer":
    """Slicer with its parameters, written ``method:name=value,name=value``.

    Raises
    ------
    InputError
        For an unknown slicer, parameter or value.
    """
    from ccfem.layers.slicing import create

    method, _, rest = text.partition(":")
    return create(method.strip(), dict(assignment(one) for one in names_of(rest)))
