"""Packages whose modules are imported when they are first asked for, by one thread at a time."""

import importlib
import sys
from collections.abc import Callable
from threading import RLock
from types import ModuleType

_ALONE = RLock()
"""Packages import modules of each other: two threads that begin at different ones would each wait
for what the other has begun, or meet half of it."""


def imported(name: str) -> ModuleType:
    """Import a module, while no other thread imports one so."""
    with _ALONE:
        return importlib.import_module(name)


def submodules(package: str) -> Callable[[str], ModuleType]:
    """Return the ``__getattr__`` of a package: ``ccfem.fem.elasticity`` needs no import of its own.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    """

    def of(name: str) -> ModuleType:
        inner = f"{package}.{name}"
        # Within an import others may be begun: that goes on by itself, and waits for no one.
        within = sys._getframe(1).f_globals.get("__name__") == "importlib._bootstrap"
        if not name.startswith("_") and not within:
            try:
                return imported(inner)
            except ModuleNotFoundError as error:
                if error.name != inner:
                    raise
        raise AttributeError(f"module '{package}' has no attribute '{name}'")

    return of
