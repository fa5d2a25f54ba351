"""Names that packages had before release 0.2: they still work, and warn of their new ones."""

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

_INDICES = (
    *("alignment", "containment", "coverage", "crossings", "curvature", "head", "links"),
    *("manufacture", "matching", "room", "sinuosity", "skin", "space", "spacing"),
    *("stiffness_alignment", "tension_across"),
)

MOVED = {
    "arrays": "base.arrays",
    "checks": "base.checks",
    "comparison.charts": "comparison.report.charts",
    "comparison.layer_view": "comparison.report.layer_view",
    "comparison.part_view": "comparison.report.part_view",
    "comparison.path_view": "comparison.report.path_view",
    "comparison.report_tables": "comparison.report.report_tables",
    "display": "base.display",
    "elasticity": "fem.elasticity",
    "errors": "base.errors",
    "evaluation": "judging.evaluation",
    **{f"evaluation.{name}": f"judging.evaluation.indices.{name}" for name in _INDICES},
    "export": "printing.export",
    "fibre_aware": "strategies.fibre_aware",
    "fields": "paths.fields",
    "guidance": "slicing.guidance",
    "inspection": "cases.inspection",
    "io": "body.files",
    "io.csv_table": "base.csv_table",
    "io.folder": "base.folder",
    "io.frd": "fem.stress_files.frd",
    "io.result_folder": "base.result_folder",
    "io.stress_data": "fem.stress_files.stress_data",
    "io.stress_file": "fem.stress_files.stress_file",
    "io.stress_table": "fem.stress_files.stress_table",
    "io.toml": "base.toml",
    "io.vtu_tensors": "fem.stress_files.vtu_tensors",
    "io.whole": "base.whole",
    "isolated": "body.isolated",
    "layers": "slicing.layers",
    "layers.slicing": "slicing.slicers",
    "linking": "paths.linking",
    "materials": "fem.materials",
    "mesh": "body.mesh",
    "mesh.facets": "geometry.facets",
    "mesh.measures": "geometry.measures",
    "meshing": "body.meshing",
    "placement": "paths.placement",
    "planning": "paths.planning",
    "plates": "fem.plates",
    "plot": "comparison.plot",
    "plugins": "base.plugins",
    "principal_lines": "slicing.principal_lines",
    "progress": "base.progress",
    "raster": "paths.raster",
    "report": "comparison.report",
    "stress_tracing": "strategies.stress_tracing",
    "studies": "comparison.studies",
    "support": "printing.support",
    "tensor": "base.tensor",
    "threads": "base.threads",
    "toolpaths": "paths.toolpaths",
    "topopt": "fem.topopt",
    "virtual_testing": "judging.virtual_testing",
    "virtual_testing.ball": "fem.elasticity.ball",
    "virtual_testing.zone": "fem.elasticity.zone",
    "winding": "strategies.winding_curves",
}
"""New name of each package and module by its old one, both below ``ccfem``."""


class _Finder(MetaPathFinder):
    """Finds a module under its old name."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a spec that yields the module of the new name, or None for any other."""
        if not name.startswith("ccfem."):
            return None
        stem = name.removeprefix("ccfem.")
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
