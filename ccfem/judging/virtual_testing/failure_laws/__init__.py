"""Laws of failure: one module a law.

A module has

* ``index(stress, limits, normal)``: how near places of the matrix are to failure, (k,), from their
  stress (k, 3, 3), MPa, averaged over a ball, the strengths of the part (`Limits`), and the unit
  normals (k, 3) of its layers, or None. It is proportional to the stress, and 1 at failure; None
  where it cannot judge the part. The load and the place of the first failure follow from it, and
  the gradient with which strategies plan for strength;
* or ``fails(test, limits, layers)``, where that is not all: it takes a `VirtualTest`, the strengths
  and the layers of the matrix, or None, and returns a `Failure`: the load at which it happens
  first, and where; a note alone, with the reason, where it cannot judge the part. Without an index
  such a law counts in tests, but is not planned for;
* ``COLUMN``, a `Column` for that load in tables and CSV files, if it has one of its own.

The name of the module is what a part then fails in. Modules of other packages are found by entry
points of the group ``ccfem.failure_laws``. Nothing is registered anywhere.
"""

from collections.abc import Mapping
from functools import cache
from types import ModuleType

from ccfem.base import plugins

__all__ = ["named"]


@cache
def named() -> Mapping[str, ModuleType]:
    """Every law by name."""
    return plugins.modules(__name__, "ccfem.failure_laws")
