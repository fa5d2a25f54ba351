"""Packages whose modules are imported when they are first asked for."""

import importlib
from collections.abc import Callable
from types import ModuleType


def submodules(package: str) -> Callable[[str], ModuleType]:
    """Return the ``__getattr__`` of a package: ``ccfem.fem.elasticity`` needs no import of its own.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    """

    def of(name: str) -> ModuleType:
        inner = f"{package}.{name}"
        if not name.startswith("_"):
            try:
                return importlib.import_module(inner)
            except ModuleNotFoundError as error:
                if error.name != inner:
                    raise
        raise AttributeError(f"module '{package}' has no attribute '{name}'")

    return of
