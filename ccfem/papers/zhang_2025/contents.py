"""What of Zhang et al. 2025 can be made again: strands on the T-bracket, theirs and ours.

What the paper claims is taken from its abstract.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.progress import Progress, silent
from ccfem.body.mesh.patches import Cylinder, unit_vector
from ccfem.cases.bodies import T_BRACKET_HOLES
from ccfem.fem.elasticity import PartStress, StressField
from ccfem.judging.evaluation import evaluate
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strands import carrying_strands
from ccfem.machine import Machine
from ccfem.papers.contents import Contents, WhenAsked, table, write_claims
from ccfem.papers.fang_2024.authors import (
    authors_layers,
    authors_mesh,
    authors_strands as sparse_strands,
    authors_stress,
)
from ccfem.paths.planning import plan
from ccfem.paths.planning.given_paths import GivenPaths
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.path_table import read_strands
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.spatial import Spatial
from ccfem.slicing.slicers.through_strands import ThroughStrands
from ccfem.strategies import create

# Figures of strands and layers: the same measures for ours and for the published ones.


WIDTH = 1.1
"""Of the strands of the paper, mm."""
SHORTEST = 42.0
"""Shortest strand that a cutter behind the nozzle allows, mm, as in Chen et al. 2021."""
_INDEX_OF = {
    "coverage": "coverage",
    "coverage of tension": "coverage_stress",
    "angle": "angle_mean",
    "within 10": "aligned_10",
    "within 10, by tension": "aligned_stress_10",
    "spacing, 5 %": "spacing_5",
    "spacing, median": "spacing_50",
    "on fibre": "on_fibre",
}


def measured(
    paths: Toolpaths, layers: Sequence[Layer], stress: PartStress, machine: Machine
) -> dict[str, float]:
    """Measure strands.

    Returns
    -------
    coverage, coverage of tension
        Share of the layers within half a width of a strand, by area and by the tension there.
    angle, angle by tension, within 10, within 10, by tension
        Mean angle to the largest stress in the layer, degrees, by length and by the tension there,
        and the share of the strands' length within 10 degrees of it, likewise.
    spacing, 5 %, spacing, median
        Distance to the neighbour, mm.
    on fibre
        Share of the length that lies on other fibre.
    metres, strands
        A layer with fibre.
    long
        Share of the length in strands of at least 42 mm.
    """
    evaluated = evaluate(paths, layers, stress, machine)
    total, samples = evaluated.total, [of_layer.alignment for of_layer in evaluated.samples]
    angle = np.degrees(np.concatenate([one.angle for one in samples]))
    tension = np.concatenate([one.length * np.maximum(one.largest, 0.0) for one in samples])
    known = ~np.isnan(angle)
    count, length = len(np.unique(paths.layer)), paths.lengths
    return {
        **{name: float(total[column]) for name, column in _INDEX_OF.items()},
        "angle by tension": float(np.average(angle[known], weights=tension[known])),
        "metres": 1e-3 * float(length.sum()) / count,
        "strands": len(paths) / count,
        "long": float(length[length >= SHORTEST].sum() / length.sum()),
    }


def angles_to_axes(
    layers: Sequence[Layer], holes: Mapping[str, Cylinder], reach: float
) -> dict[str, float]:
    """Mean angle, degrees, by area, between layers' normals and the axes of holes near these.

    Parameters
    ----------
    holes : mapping of str to Cylinder
        Walls, whole or in part.
    reach : float, mm
        Distance from the wall up to which a triangle of a layer counts; it lies beside the hole,
        not above it, where its layer has a border on the wall.

    Returns
    -------
    dict of str to float
        By hole; NaN where no layer reaches it.
    """
    return {name: _angle_to_axis(layers, hole, reach) for name, hole in holes.items()}


def _angle_to_axis(layers: Sequence[Layer], hole: Cylinder, reach: float) -> float:
    point, axis = np.asarray(hole.point), unit_vector(hole.axis, "axis of a hole")
    total = np.zeros(2)
    for layer in layers:
        border = np.concatenate(layer.loops)
        at_wall = np.abs(_from_axis(layer.points[border], point, axis) - hole.radius) < 0.1 * reach
        if not at_wall.any():
            continue
        level = (layer.points[border][at_wall] - point) @ axis
        middle = layer.points[layer.triangles].mean(axis=1)
        away = _from_axis(middle, point, axis) - hole.radius
        height = (middle - point) @ axis
        near = (away < reach) & (height > level.min() - reach) & (height < level.max() + reach)
        cosine = np.abs(layer.normals[near] @ axis)
        angle = np.degrees(np.arccos(np.minimum(cosine, 1.0)))
        total += [float(angle @ layer.areas[near]), float(layer.areas[near].sum())]
    return float(total[0] / total[1]) if total[1] else float("nan")


def _from_axis(places: FloatArray, point: FloatArray, axis: FloatArray) -> FloatArray:
    """Distance of places (n, 3) from an axis, mm."""
    away = places - point
    return np.asarray(np.linalg.norm(away - (away @ axis)[:, None] * axis, axis=1))


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
    "stripes, folds, 2.16 m": ("stripes", {"folds": True, "density": 0.643}),
    "isocurve": ("isocurve", {}),
}
"""Plans of ours on their layers: strategy and parameters. The third has as much fibre a layer as
those strands of the authors that are long enough for the cutter."""
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
    "angle by tension": ".2f",
    "within 10": ".0%",
    "spacing, 5 %": ".2f",
    "spacing, median": ".2f",
    "on fibre": ".2%",
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
