"""Laws of failure: one module a law.

A module has

* ``fails(test, limits, layers)``, which takes a `VirtualTest`, the strengths of the part (`Limits`)
  and the layers of its matrix, or None, and returns a `Failure`: the load at which it happens
  first, and where; a note alone, with the reason, where it cannot judge the part;
* ``COLUMN``, a `Column` for that load in tables and CSV files, if it has one of its own.

The name of the module is what a part then fails in. Modules of other packages are found by entry
points of the group ``ccfem.failure_laws``. Nothing is registered anywhere.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from types import ModuleType

from ccfem.base import plugins

__all__ = ["named"]


@cache
def named() -> Mapping[str, ModuleType]:
    """Every law by name."""
    modules = {
        info.name: importlib.import_module(f"{__name__}.{info.name}")
        for info in pkgutil.iter_modules(__path__)
    }
    return modules | {entry.name: entry.load() for entry in plugins.entries("ccfem.failure_laws")}
