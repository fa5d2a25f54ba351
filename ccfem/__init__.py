"""ccfem: finite elements and stress-driven toolpaths for printing continuous fibre.

Units are mm, N and MPa everywhere, angles in degrees at the interface.

The data flow, in which each arrow is one function or one small callable object::

    TetMesh -> Problem -> StressField -> Layers -> Strategy -> Toolpaths -> Evaluation

These functions are here, from ``ccfem.read`` to ``ccfem.compare``. The types of their arguments and
results are in the subpackages: ``ccfem.strategies.Isocurve``, ``ccfem.fem.elasticity.Force``.

Examples
--------
>>> import ccfem
>>> case = ccfem.read("bar", element_size=5.0)
>>> stress = ccfem.solve(case.problem)["pull"]
>>> layers = ccfem.slice(stress, 2, case.build)
>>> paths = ccfem.plan(ccfem.strategies.Zigzag(spacing=4.0), layers, stress, case.machine)
>>> evaluation = ccfem.evaluate(paths, layers, stress, case.machine)
"""

import importlib
from typing import TYPE_CHECKING, Any

from ccfem.base import display
from ccfem.base.lazy_modules import MOVED, find_moved, imported

if TYPE_CHECKING:
    from ccfem.cases.case import Case
    from ccfem.cases.inspection.body_faces import faces
    from ccfem.cases.inspection.part_check import check
    from ccfem.cases.reading import read
    from ccfem.comparison.engine import compare
    from ccfem.comparison.files import save
    from ccfem.comparison.result import Comparison
    from ccfem.comparison.studies import Study, study
    from ccfem.fem.elasticity import Problem, solve
    from ccfem.judging.evaluation import evaluate
    from ccfem.judging.virtual_testing import virtual_test
    from ccfem.judging.virtual_testing.calibration import calibrate
    from ccfem.judging.virtual_testing.progressive_failure import breaking_load
    from ccfem.machine import Machine
    from ccfem.papers.reproduce import reproduce
    from ccfem.paths.planning import plan
    from ccfem.slicing.slicers import slice
    from ccfem.workbench.opening import open

__all__ = [
    "Case",
    "Comparison",
    "Machine",
    "Problem",
    "Study",
    "breaking_load",
    "calibrate",
    "check",
    "compare",
    "evaluate",
    "faces",
    "open",
    "plan",
    "read",
    "reproduce",
    "save",
    "slice",
    "solve",
    "study",
    "virtual_test",
]

__version__: str

find_moved()
display.drawn_by("ccfem.comparison.plot.values")

_HOMES = {
    "Case": "cases",
    "Comparison": "comparison",
    "Machine": "machine",
    "Problem": "fem.elasticity",
    "Study": "comparison.studies",
    "breaking_load": "judging.virtual_testing.progressive_failure",
    "calibrate": "judging.virtual_testing.calibration",
    "check": "cases.inspection",
    "compare": "comparison",
    "evaluate": "judging.evaluation",
    "faces": "cases.inspection",
    "open": "workbench",
    "plan": "paths.planning",
    "read": "cases",
    "reproduce": "papers.reproduce",
    "save": "comparison",
    "slice": "slicing.slicers",
    "solve": "fem.elasticity",
    "study": "comparison.studies",
    "virtual_test": "judging.virtual_testing",
}
"""Package of each name; it is imported when the name is first used."""

_PACKAGES = frozenset(
    {
        *("base", "body", "cases", "comparison", "fem", "geometry", "judging", "machine"),
        *("papers", "paths", "printing", "slicing", "strategies", "workbench"),
    }
)
"""Wings, available without a separate import."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("ccfem")
    if name in _HOMES:
        return getattr(imported(f"ccfem.{_HOMES[name]}"), name)
    if name in _PACKAGES or name in MOVED:
        return imported(f"ccfem.{name}")
    raise AttributeError(f"module 'ccfem' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*__all__, *_PACKAGES, "__version__"})
