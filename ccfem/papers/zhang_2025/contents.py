"""What of Zhang et al. 2025 can be made again: strands on the T-bracket, theirs and ours.

What the paper claims is taken from its abstract.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.base.errors import InputError
from ccfem.base.progress import Progress, silent
from ccfem.body.mesh.patches import Cylinder
from ccfem.cases.bodies import T_BRACKET_HOLES
from ccfem.fem.elasticity import StressField
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strands import carrying_strands
from ccfem.judging.virtual_testing.virtual_test import virtual_test
from ccfem.machine import Machine
from ccfem.papers.contents import Contents, WhenAsked, table, write_claims
from ccfem.papers.fang_2024.authors import (
    authors_layers,
    authors_mesh,
    authors_strands as sparse_strands,
    authors_stress,
)
from ccfem.papers.zhang_2025.measures import SHORTEST, WIDTH, angles_to_axes, measured
from ccfem.paths.planning import plan
from ccfem.paths.planning.given_paths import GivenPaths
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.path_table import read_strands
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.spatial import Spatial
from ccfem.slicing.slicers.through_strands import ThroughStrands
from ccfem.strategies import create

# The authors' strands on the T-bracket, and where they lie on the layers rebuilt from them.
#
# The data set has the strands of this part as lines, without its layers. The part is that of Fang
# et al. 2024, whose solid is recovered from their own layers.


DATA = "CCFEM_ZHANG2025"
"""Environment variable that names the folder of the published data."""
BUILD = (0.0, 1.0, 0.0)


def authors_folder() -> Path:
    """Folder of the strands of the T-bracket."""
    named = os.environ.get(DATA)
    if not named:
        raise InputError(f"set {DATA} to the folder of the data of Zhang et al. 2025")
    return Path(named) / "T-bracket" / "StripPath"


def authors_strands(folder: Path) -> Toolpaths:
    """Read the strands, numbered by the layers of their files."""
    return read_strands(folder, np.eye(3), np.array(BUILD))


def strands_on(layers: tuple[Layer, ...], strands: Toolpaths) -> Toolpaths:
    """Move strands onto the layers that were laid through them."""
    numbers = np.unique(strands.layer).tolist()
    return Toolpaths.concatenate(
        [
            GivenPaths(strands.on_layer(number), "the authors' strands").on([layer]).toolpaths
            for number, layer in zip(numbers, layers, strict=True)
        ]
    )


EXPECTED = Path(__file__).with_name("expected.toml")
"""Claims of the paper, with the ranges that count as reproduced."""

MACHINE = Machine(fibre_width=WIDTH, minimum_length=SHORTEST)
"""Whose strands are those of the paper, and whose cutter that of Chen et al. 2021."""

HOLES = {
    name: wall
    for name, wall in T_BRACKET_HOLES.items()
    if isinstance(wall, Cylinder) and wall.half is None
}
"""Walls of the holes of the T-bracket, each whole."""

AUTHORS, LONG, SPARSE = "authors", "authors, 42 mm and more", "authors 2024, sparse"
OURS: dict[str, tuple[str, dict[str, Any]]] = {
    "stripes": ("stripes", {}),
    "stripes, folds": ("stripes", {"folds": True}),
    "isocurve": ("isocurve", {}),
}
"""Plans of ours on their layers, as dense as they are by default: strategy and parameters."""
ROWS = (AUTHORS, LONG, *OURS, SPARSE)

SLICINGS = {"spatial": 0.0, "spatial, hole_weight 10": 10.0}
"""Weight of layers square to the axes of holes, within two widths of them."""


@dataclass(frozen=True)
class Study:
    """The part, the authors' layers and strands, and what each set of strands is worth."""

    progress: Progress = silent

    @cached_property
    def stress(self) -> StressField:
        """Walls of the base held, a bolt pulling the head, on linear cells."""
        self.progress("solving the part", 0.0)
        return authors_stress(authors_mesh(), order=1)

    @cached_property
    def published(self) -> Toolpaths:
        """Strands as published."""
        return authors_strands(authors_folder())

    @cached_property
    def layers(self) -> tuple[Layer, ...]:
        """Layers of the authors, rebuilt."""
        self.progress("rebuilding the authors' layers", 0.0)
        return ThroughStrands(str(authors_folder()))(self.stress, BUILD, MACHINE)

    @cached_property
    def _specimen(self) -> Specimen:
        return Specimen.of(self.stress)

    @cached_property
    def strands(self) -> Mapping[str, Mapping[str, float]]:
        """Figures of each set of strands, computed when they are first asked for."""
        return WhenAsked(ROWS, self._row, self.progress, "planning and testing")

    @cached_property
    def angles(self) -> dict[str, dict[str, float]]:
        """Angle of layers to the axes of holes within two widths of them: theirs and ours."""
        stacks = {"authors": self.layers}
        for name, weight in SLICINGS.items():
            slicer = Spatial(hole_weight=weight, hole_reach=2.0 * WIDTH)
            stacks[name] = slicer.slice(self.stress, BUILD).layers
        return {name: angles_to_axes(layers, HOLES, 2.0 * WIDTH) for name, layers in stacks.items()}

    @cached_property
    def _theirs(self) -> Toolpaths:
        return strands_on(self.layers, self.published)

    def _paths(self, name: str) -> Toolpaths:
        """Strands of a row that lie on the authors' layers."""
        if name == AUTHORS:
            return self._theirs
        if name == LONG:
            return self._theirs.select(self._theirs.lengths >= SHORTEST)
        strategy, parameters = OURS[name]
        return plan(create(strategy, parameters), self.layers, self.stress, MACHINE)

    def _row(self, name: str) -> dict[str, float]:
        if name == SPARSE:
            layers = authors_layers(self.stress)
            paths = sparse_strands(layers)
        else:
            layers, paths = self.layers, self._paths(name)
        given = GivenPaths(paths)
        strands = carrying_strands(paths, given, layers, self.stress.mesh, MACHINE)
        tested = virtual_test(strands, self._specimen, span=())
        return {**measured(paths, layers, self.stress, MACHINE), "stiffness": tested.ratio}


_COLUMNS = {
    "metres": ".2f",
    "strands": ".0f",
    "long": ".0%",
    "coverage": ".3f",
    "coverage of tension": ".3f",
    "angle": ".1f",
    "within 10": ".0%",
    "spacing, 5 %": ".2f",
    "spacing, median": ".2f",
    "on fibre": ".1%",
    "stiffness": ".3f",
}


def strands_table(study: Study) -> str:
    """Markdown table of all sets of strands."""
    rows = [
        (name, *(f"{study.strands[name][key]:{how}}" for key, how in _COLUMNS.items()))
        for name in ROWS
    ]
    return f"""{table(("strands", *_COLUMNS), rows)}
Metres and strands are those of a layer with fibre, `long` the share of the metres in strands of at
least {SHORTEST:g} mm, the stiffness that of the virtual test over the part without fibre. The
authors' layers are rebuilt from their strands, which therefore lie on no others. `stripes` lays no
strand that is shorter than {SHORTEST:g} mm.
"""


def layers_table(study: Study) -> str:
    """Markdown table of the angles of layers to the axes of holes."""
    rows = [
        (name, *(f"{angles[hole]:.1f}" for hole in HOLES)) for name, angles in study.angles.items()
    ]
    return f"""{table(("layers", *(f"{hole}, degrees" for hole in HOLES)), rows)}
Mean angle between layers and the axis of a hole within two widths of its wall, by area.
"""


def quantities(study: Study) -> dict[str, float]:
    """Every quantity that `EXPECTED` may name."""
    values = {
        f"{name}: {key}": value for name in ROWS for key, value in study.strands[name].items()
    }
    for name, angles in study.angles.items():
        values |= {f"{name}: degrees to {hole}": angle for hole, angle in angles.items()}
    for name in (AUTHORS, "stripes"):
        over = study.strands[name]["stiffness"] / study.strands[SPARSE]["stiffness"]
        values[f"{name}: stiffness over sparse"] = over
    return values


def write_all(folder: Path, progress: Progress = silent) -> None:
    """Run the study, and write tables, a picture and claims into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    study = Study(progress)
    text = f"{strands_table(study)}\n{layers_table(study)}"
    (folder / "tables.md").write_text(text, encoding="utf-8")
    print(f"\n{text}\n{write_claims(folder, quantities(study), EXPECTED)}")


def _table(make: Callable[[Study], str]) -> Callable[[Callable[[], Study]], str]:
    return lambda study: make(study())


CONTENTS = Contents(
    title="Zhang et al. 2025, dense strands on curved layers",
    seconds=400.0,
    whole=write_all,
    run=Study,
    tables={"strands": _table(strands_table), "layers": _table(layers_table)},
    needs=DATA,
)
