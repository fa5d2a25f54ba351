"""Texts of the command line turned into names, numbers and parameters.

A text that cannot be read raises `InputError`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from ccfem.base.checks import check_known
from ccfem.base.errors import InputError
from ccfem.base.toml import assignment


def option(metavar: str, text: str, *names: str, **more: Any) -> Any:
    """Option of a command that takes a value; named as its parameter is, unless names are given."""
    return typer.Option(*names, metavar=metavar, help=text, **more)


def argument(metavar: str, text: str) -> Any:
    """Argument of a command."""
    return typer.Argument(metavar=metavar, help=text)


def path_of(text: str | Path) -> Path:
    """Path of an option; an empty text would be the current folder."""
    if not str(text).strip():
        raise typer.BadParameter("it must not be empty: name one, or . for here")
    return Path(text)


def names_of(text: str) -> tuple[str, ...]:
    """Split names separated by commas."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def drawings_of(text: str | None) -> tuple[str, ...]:
    """Read the formats of drawings that are asked for."""
    names = tuple(name.lower() for name in names_of(text or ""))
    for name in names:
        check_known("format of drawings", name, ("svg", "dxf"))
    return names


def numbers_of(text: str) -> tuple[float, ...]:
    """Split numbers separated by commas."""
    try:
        return tuple(float(number) for number in names_of(text))
    except ValueError:
        raise InputError(f"expected numbers separated by commas; got '{text}'") from None


def parameters_by_strategy(
    texts: Sequence[str], only: str | None = None
) -> dict[str, dict[str, Any]]:
    """Parameters of strategies, each as ``strategy.name=value``; of one alone, also ``name=value``.

    A parameter that is a table takes one entry at a time: ``pruned.base.floor=0.3``.

    Parameters
    ----------
    only : str, optional
        The one strategy that there is.
    """
    by_strategy: dict[str, dict[str, Any]] = {} if only is None else {only: {}}
    for text in texts:
        path, value = assignment(text)
        owner, dot, name = path.partition(".")
        if not dot:
            owner, name = only or "", path
        if not owner or not name:
            raise InputError(f"--set expects STRATEGY.NAME=VALUE; got '{text}'")
        if only not in (None, owner):
            raise InputError(
                f"--set expects a parameter of {only}, the one strategy here; got '{text}': "
                f"write {name}=VALUE or {only}.{name}=VALUE"
            )
        table = by_strategy.setdefault(owner, {})
        *outer, last = name.split(".")
        for key in outer:
            table = table.setdefault(key, {})
            if not isinstance(table, dict):
                raise InputError(f"--set {text}: {owner}.{key} has a value already: give one only")
        table[last] = value
    return by_strategy
