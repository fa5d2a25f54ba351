"""Strategies: each turns the stress on a layer into fibre paths. One module a strategy."""

from collections.abc import Callable, Mapping
from typing import Any

from ccfem.base import plugins
from ccfem.paths.planning.strategy import Strategy

__all__ = ["create", "named"]


def named() -> Mapping[str, type[Strategy]]:
    """Every strategy by name: modules of this package and entry points ``ccfem.strategies``."""
    return plugins.discovered(__name__, "ccfem.strategies")


def create(name: str, parameters: Mapping[str, Any] | None = None) -> Strategy:
    """Make a strategy from its name and parameters.

    Raises
    ------
    InputError
        For an unknown strategy or parameter (the message lists the known ones), and for a value of
        the wrong type.
    """
    known: Mapping[str, Callable[..., Strategy]] = named()
    return plugins.create("strategy", known, name, parameters)


def __getattr__(name: str) -> Any:
    return plugins.by_class(__name__, name)
