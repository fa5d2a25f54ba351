"""How cases are found by name."""

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from typing import Any, get_type_hints

from ccfem.cases.case import Case
from ccfem.checks import check_known
from ccfem.errors import InputError, known_names
from ccfem.io.toml import from_table

__all__ = ["create_case", "named_cases"]

_PACKAGE = "ccfem.cases"


def named_cases() -> Mapping[str, Callable[..., Case]]:
    """Every case by name: the modules of this package, and entry points ``ccfem.cases``.

    A module that holds a function of its own name that returns a `Case` is one; its parameters
    have defaults.
    """
    found: dict[str, Callable[..., Case]] = {}
    for info in pkgutil.iter_modules(importlib.import_module(_PACKAGE).__path__):
        module = importlib.import_module(f"{_PACKAGE}.{info.name}")
        make = getattr(module, info.name, None)
        if callable(make) and get_type_hints(make).get("return") is Case:
            found[info.name] = make
    for entry in entry_points(group="ccfem.cases"):
        found[entry.name] = entry.load()
    return found


def create_case(name: str, **parameters: Any) -> Case:
    """Make a case from its name and parameters.

    Raises
    ------
    InputError
        For an unknown case or parameter, the known ones listed; for a value of a wrong type.
    """
    known = named_cases()
    check_known("case", name, sorted(known), "or name a part file, .toml")
    fields = inspect.signature(known[name]).parameters
    for parameter in parameters:
        if parameter not in fields:
            raise InputError(
                f"case '{name}' has no parameter '{parameter}'; it has: "
                f"{known_names(parameter, fields)}"
            )
    return from_table(known[name], parameters, f"case {name}")
