"""Plug points: families whose members are the modules of a package, and those of other packages.

One module is one member: it holds a class of its own name in capitals (``contour_zigzag`` holds
``ContourZigzag``), a frozen dataclass whose fields are the parameters. Other packages add theirs
by an entry point. Nothing is registered anywhere.
"""

import importlib
import importlib.util
import inspect
import pkgutil
import re
from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from types import ModuleType
from typing import Any, TypeVar

from ccfem.base.checks import check_known
from ccfem.base.errors import InputError, known_names
from ccfem.base.toml import from_table

Member = TypeVar("Member")


def class_name(module: str) -> str:
    """Name of the class that a module of this name holds."""
    return module.title().replace("_", "")


@cache
def entries(group: str) -> tuple[EntryPoint, ...]:
    """Entry points of a group: read once, since all installed packages are asked."""
    return tuple(entry_points(group=group))


def discovered(package: str, group: str) -> dict[str, Any]:
    """Every member by name: modules of a package, and entry points of a group."""
    members: dict[str, Any] = {}
    for info in pkgutil.iter_modules(importlib.import_module(package).__path__):
        if info.ispkg:  # what its members stand on
            continue
        module = importlib.import_module(f"{package}.{info.name}")
        members[info.name] = getattr(module, class_name(info.name))
    for entry in entries(group):
        members[entry.name] = entry.load()
    return members


def modules(package: str, group: str) -> dict[str, ModuleType]:
    """Every module of a package by name, and those of entry points of a group."""
    names = [info.name for info in pkgutil.iter_modules(importlib.import_module(package).__path__)]
    shipped = {name: importlib.import_module(f"{package}.{name}") for name in names}
    return shipped | {entry.name: entry.load() for entry in entries(group)}


def create(
    kind: str,
    known: Mapping[str, Callable[..., Member]],
    name: str,
    parameters: Mapping[str, Any] | None,
    cure: str = "",
) -> Member:
    """Make a member from its name and parameters.

    Parameters
    ----------
    kind : str
        What a member is called in messages, as "strategy".
    known : mapping of name to class or function
    parameters : mapping, optional
    cure : str, optional
        What else might have been meant by an unknown name.

    Raises
    ------
    InputError
        For an unknown member or parameter, the known ones listed; for a value of a wrong type.
    """
    check_known(kind, name, sorted(known), cure)
    taken = inspect.signature(known[name]).parameters
    table = {}
    for parameter, value in (parameters or {}).items():
        if parameter not in taken:
            raise InputError(
                f"{kind} '{name}' has no parameter '{parameter}'; it has: "
                f"{known_names(parameter, taken)}"
            )
        table[parameter] = list(value) if isinstance(value, tuple) else value
    return from_table(known[name], table, f"{kind} {name}")


def by_class(package: str, name: str) -> Any:
    """Find a member of a package by the name of its class, for attributes of the package."""
    module = re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
    if class_name(module) == name and importlib.util.find_spec(f"{package}.{module}"):
        return getattr(importlib.import_module(f"{package}.{module}"), name)
    raise AttributeError(f"module '{package}' has no attribute '{name}'")
