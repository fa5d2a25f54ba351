"""How modules are found: when they are first asked for, and under names that they had before."""

import importlib
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any

_ALONE = RLock()
"""Packages import modules of each other: two threads that begin at different ones would each wait
for what the other has begun, or meet half of it."""


def imported(name: str) -> ModuleType:
    """Import a module, while no other thread imports one so."""
    with _ALONE:
        return importlib.import_module(name)


def submodules(package: str) -> Callable[[str], ModuleType]:
    """Return the ``__getattr__`` of a package: ``ccfem.fem.elasticity`` needs no import of its own.

    The package is named by its ``__name__``.
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


# Names that modules had before: they still work, or say what replaces them.


_LINES = Path(__file__).with_name("moved.txt").read_text(encoding="utf-8").splitlines()[1:]
_NAMES = {old: new for new, *names in map(str.split, _LINES) for old in names}
MOVED = {old: new for old, new in _NAMES.items() if not old.endswith("!")}
"""New name of each package and module by its old one, both below ``ccfem``."""

GONE = {
    old.rstrip("!"): f"use ccfem.{new}, for a function of its package has the old name"
    for old, new in _NAMES.items()
    if old.endswith("!")
} | {
    "cli.fitting": "use ccfem.cli.commands.calibrate, which does what its fit_material did",
    "papers.layer_traction": (
        "use ccfem.judging.virtual_testing.failure_laws.interlayer.layer_traction, which returns "
        "the averaged stress too: opening, sliding, tensor"
    ),
    "printing.curved_plan": "use ccfem.printing.print_plan.plan_print, for layers of either kind",
}
"""What replaces modules that are found under no other name."""


class _Finder(MetaPathFinder):
    """Finds a module under its old name."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a spec that yields the module of the new name, or None for any other."""
        if not name.startswith("ccfem."):
            return None
        stem = name.removeprefix("ccfem.")
        if stem in GONE:
            raise ModuleNotFoundError(f"{name} is gone: {GONE[stem]}", name=name)
        old, rest = stem, ""
        while old and old not in MOVED:
            old, _, last = old.rpartition(".")
            rest = f".{last}{rest}"
        if not old:
            return None
        loader: Any = _Loader(f"ccfem.{MOVED[old]}{rest}")
        return ModuleSpec(name, loader)


class _Loader(Loader):
    """Yields a module that has another name."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._spec: Any = None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module of the new name."""
        module = importlib.import_module(self._name)
        message = f"{spec.name} is called {self._name} now: import it by this name"
        warnings.warn(message, DeprecationWarning, stacklevel=2)
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Leave a module as it is: it ran under its new name."""
        module.__spec__ = self._spec


def find_moved() -> None:
    """Let imports find modules under their old names."""
    if not any(type(finder).__name__ == "_Finder" for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())
