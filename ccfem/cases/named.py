"""How cases are found by name."""

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from typing import Any, get_type_hints

from ccfem.base import plugins
from ccfem.cases.case import Case

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
    for entry in plugins.entries("ccfem.cases"):
        found[entry.name] = entry.load()
    return found


def create_case(name: str, **parameters: Any) -> Case:
    """Make a case from its name and parameters.

    Raises
    ------
    InputError
        For an unknown case or parameter, the known ones listed; for a value of a wrong type.
    """
    cure = "or name a part file, .toml"
    return plugins.create("case", named_cases(), name, parameters, cure)
