"""The evaluator: every index of a set of paths, for each layer and in total."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ccfem.arrays import FloatArray, IntArray, freeze
from ccfem.display import Shown
from ccfem.elasticity.part_stress import PartStress
from ccfem.errors import InputError
from ccfem.evaluation import (
    alignment,
    containment,
    coverage,
    crossings,
    curvature,
    head,
    links,
    manufacture,
    matching,
    room,
    sinuosity,
    skin,
    space,
    spacing,
    stiffness_alignment,
    tension_across,
)
from ccfem.evaluation.alignment import AlignmentSamples
from ccfem.evaluation.column import Column
from ccfem.evaluation.containment import ContainmentSamples
from ccfem.evaluation.coverage import CoverageSamples
from ccfem.evaluation.crossings import CrossingSamples
from ccfem.evaluation.curvature import CurvatureSamples
from ccfem.evaluation.head import HeadSamples
from ccfem.evaluation.links import LinkSamples
from ccfem.evaluation.manufacture import ManufactureSamples
from ccfem.evaluation.plane_paths import PlanePaths, plane_paths, pool
from ccfem.evaluation.room import RoomSamples
from ccfem.evaluation.sensitivity import strand_lamina
from ccfem.evaluation.sinuosity import SinuositySamples
from ccfem.evaluation.skin import SkinSamples
from ccfem.evaluation.space import SpaceSamples
from ccfem.evaluation.spacing import SpacingSamples
from ccfem.evaluation.tension_across import TensionSamples
from ccfem.fields.chart import chart_of
from ccfem.geometry.nearest_on_triangles import nearest_on_triangles
from ccfem.layers.layer import Layer
from ccfem.layers.layer_stress import stress_on
from ccfem.machine.machine import Machine
from ccfem.materials import Material, named_material
from ccfem.threads import in_threads
from ccfem.toolpaths import FIBRE, Toolpaths
from ccfem.virtual_testing.strand import Strand

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["COLUMNS", "Evaluation", "FibreSamples", "evaluate"]

COLUMNS: tuple[Column, ...] = (
    *manufacture.COLUMNS,
    *sinuosity.COLUMNS,
    *curvature.COLUMNS,
    *alignment.COLUMNS,
    *matching.COLUMNS,
    *stiffness_alignment.COLUMNS,
    *spacing.COLUMNS,
    *room.COLUMNS,
    *coverage.COLUMNS,
    *containment.COLUMNS,
    *skin.COLUMNS,
    *links.COLUMNS,
    *crossings.COLUMNS,
    *space.COLUMNS,
    *tension_across.COLUMNS,
    *head.COLUMNS,
)
"""Every index in the order of the tables."""

_ROUNDING = 1e-3
"""Rounding, mm, of coordinates in path files."""


@dataclass(frozen=True)
class FibreSamples:
    """Samples along the fibre of one layer, from which curves are drawn.

    Attributes
    ----------
    curvature : CurvatureSamples
    alignment : AlignmentSamples
    """

    curvature: CurvatureSamples
    alignment: AlignmentSamples


@dataclass(frozen=True)
class Evaluation(Shown):
    """Every index of a set of paths.

    Totals are computed from the samples of all layers together; they are not means of the layers.

    Attributes
    ----------
    layers : (L,) int array
        Index of each layer.
    values : mapping of column name to (L + 1,) array
        One value a layer, then the total. NaN only where `Column.range` says so; `COLUMNS` says
        what each value is.
    samples : tuple of L FibreSamples
        Of each layer.
    """

    layers: IntArray
    values: Mapping[str, FloatArray]
    samples: tuple[FibreSamples, ...]

    def __repr__(self) -> str:
        return f"Evaluation of {len(self.layers)} layers by {len(self.values)} indices"

    def _repr_html_(self) -> str:
        return str(self.to_frame().T.to_html(float_format="{:.4g}".format))

    def __post_init__(self) -> None:
        freeze(self, layers=int, values=float)

    @property
    def total(self) -> Mapping[str, float]:
        """Each index of the whole part."""
        return {name: float(column[-1]) for name, column in self.values.items()}

    def of_layer(self, index: int) -> Mapping[str, float]:
        """Each index of one layer.

        Raises
        ------
        InputError
            When the layer was not evaluated.
        """
        row = np.flatnonzero(self.layers == index)
        if not len(row):
            known = ", ".join(str(k) for k in self.layers)
            raise InputError(f"no layer {index} was evaluated; there are: {known}")
        return {name: float(column[row[0]]) for name, column in self.values.items()}

    def to_frame(self) -> "pd.DataFrame":
        """Table with one row a layer, then the row "total"; its index is named "layer".

        ``frame.attrs["columns"]`` holds the description of each column: unit, formula, range.
        """
        import pandas as pd

        index = pd.Index([*self.layers.tolist(), "total"], name="layer", dtype=object)
        frame = pd.DataFrame(dict(self.values), index=index)
        frame.attrs["columns"] = {
            c.name: {"unit": c.unit, "formula": c.formula, "range": c.range} for c in COLUMNS
        }
        return frame


def evaluate(
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    stress: PartStress,
    machine: Machine,
    strand: Strand | None = None,
    build: Sequence[float] | None = None,
) -> Evaluation:
    """Evaluate the fibre paths of a part.

    Sampling distances scale with the fibre width of the machine.

    Parameters
    ----------
    toolpaths : Toolpaths
        Paths of other kinds than fibre count in the print time only.
    layers : sequence of Layer
        Flat or curved, among them every layer that has a path. What is measured in the plane of
        a flat layer is measured in the chart of a curved one (`ccfem.fields.chart`), with the
        lengths of the paths in space.
    stress : PartStress
    machine : Machine
    strand : Strand, optional
        How stiff the fibre is in the index of stiffness alignment; by default as in the virtual
        test. It counts where `stress` knows the material of the part.
    build : sequence of 3 floats, optional
        Build direction. The head's tilt on curved layers is measured from it, and flat layers
        normal to it serve for comparison (`across_flat`). Default: mean normal of the layers.

    Returns
    -------
    Evaluation

    Raises
    ------
    InputError
        When there is no layer, or a path lies on none of the layers.
    """
    layers = tuple(layers)
    if not layers:
        raise InputError("expected at least one layer to evaluate; got none: slice the part")
    _check_layers(toolpaths, layers)
    fibre = toolpaths.of_kind(FIBRE).layer
    late = fibre[fibre < np.maximum.accumulate(fibre)]
    stack = head.printed(layers, build)
    upright = _upright(layers, build)

    def sampled(layer: Layer) -> _Samples:
        behind = int(np.count_nonzero(late == layer.index))
        on_layer = toolpaths.on_layer(layer.index)
        below = _below(layer, layers)
        return _sample(on_layer, layer, stress, machine, below, behind, stack, upright)

    samples = in_threads(sampled, layers)
    material = _material(layers, stress, machine, strand or Strand())
    rows = [_indices(each, machine, material) for each in (*samples, _pooled(samples))]
    return Evaluation(
        np.array([layer.index for layer in layers]),
        {column.name: np.array([row[column.name] for row in rows]) for column in COLUMNS},
        tuple(FibreSamples(each.curvature, each.alignment) for each in samples),
    )


def _check_layers(toolpaths: Toolpaths, layers: Sequence[Layer]) -> None:
    """Refuse paths that do not lie on a given layer, at its height."""
    known = {layer.index: layer for layer in layers}
    for index in np.unique(toolpaths.layer).tolist():
        if index not in known:
            raise InputError(
                f"a path lies on layer {index}, but only layers {sorted(known)} were given: give "
                "the layers that the paths were planned on"
            )
        layer, points = known[index], toolpaths.on_layer(index).points
        if layer.flat is None:
            away = nearest_on_triangles(layer.points, layer.triangles, points).distance
        else:
            away = np.abs(points @ layer.flat.frame[2] - layer.flat.height)
        apart = float(away.max())
        if apart > 0.5 * layer.thickness + _ROUNDING:
            raise InputError(
                f"a path of layer {index} lies {apart:.3g} mm above or below it: give the layers "
                "that the paths were planned on"
            )


def _upright(layers: Sequence[Layer], build: Sequence[float] | None) -> FloatArray:
    """Return the unit vector of the build direction, by default the mean normal of the layers."""
    total = np.sum([layer.areas @ layer.normals for layer in layers], axis=0)
    up = total if build is None else np.asarray(build, dtype=np.float64)
    return np.asarray(up / max(float(np.linalg.norm(up)), 1e-300))


def _below(layer: Layer, layers: Sequence[Layer]) -> Layer | None:
    """Find the flat layer under a flat one; None where it is the lowest, and for curved layers."""
    if layer.flat is None:
        return None
    height = layer.flat.height
    flat = [each for each in layers if each.flat is not None and each.plane.height < height]
    return max(flat, key=lambda each: each.plane.height, default=None)


class _Samples(NamedTuple):
    """Samples of one layer, or of all layers together, from which every index is computed."""

    manufacture: ManufactureSamples
    sinuosity: SinuositySamples
    curvature: CurvatureSamples
    alignment: AlignmentSamples
    spacing: SpacingSamples
    room: RoomSamples
    coverage: CoverageSamples
    containment: ContainmentSamples
    skin: SkinSamples
    links: LinkSamples
    crossings: CrossingSamples
    space: SpaceSamples
    tension: TensionSamples
    head: HeadSamples


def _sample(
    toolpaths: Toolpaths,
    layer: Layer,
    stress: PartStress,
    machine: Machine,
    below: Layer | None,
    late: int,
    stack: head.Printed | None,
    build: FloatArray,
) -> _Samples:
    """Take the samples of one layer."""
    width = machine.fibre_width
    seen, view = toolpaths, layer
    if layer.flat is None:
        chart = chart_of(layer)
        seen, view = chart.flattened(toolpaths), chart.flat
    paths = plane_paths(seen, view)
    on_layer = stress_on(view, stress)
    made = manufacture.sample_manufacture(paths, toolpaths, machine)
    fibre = toolpaths.select(toolpaths.kind == FIBRE)
    out = skin.sample_skin(fibre, layer, stress.mesh, machine)
    if layer.flat is None:
        made = replace(made, length=fibre.lengths[fibre.lengths > 0.0])
    else:
        fibre = _in_space(paths.in_part)
    in_space = space.sample_space(fibre, layer, stress, width)
    return _Samples(
        made,
        sinuosity.sample_sinuosity(paths, width),
        curvature.sample_curvature(paths, width),
        alignment.sample_alignment(paths, on_layer, width),
        spacing.sample_spacing(paths, width),
        room.sample_room(paths, machine, below, late),
        coverage.sample_coverage(paths, on_layer, width),
        containment.sample_containment(paths, width),
        out,
        links.sample_links(paths),
        crossings.sample_crossings(paths),
        in_space,
        tension_across.sample_tension(layer, stress, build),
        head.sample_head(fibre, layer, stack, machine),
    )


def _in_space(paths: PlanePaths) -> Toolpaths:
    """Paths of a flat layer as toolpaths."""
    lines = np.split(paths.points, paths.offsets[1:-1]) if len(paths) else []
    return Toolpaths.from_plane(lines, paths.layer, paths.closed.tolist())


def _pooled(samples: Sequence[_Samples]) -> _Samples:
    """Join the samples of all layers."""
    return _Samples._make(pool(group) for group in zip(*samples, strict=True))


def _material(
    layers: Sequence[Layer], stress: PartStress, machine: Machine, strand: Strand
) -> Material:
    """Material of a part that is full of strands, fibre along axis 1."""
    if stress.material is None:
        return named_material("c_fram")
    section = machine.fibre_width * float(np.mean([layer.thickness for layer in layers]))
    return strand_lamina(stress.material, strand.rho / section)


def _indices(samples: _Samples, machine: Machine, material: Material) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    return {
        **manufacture.manufacture_indices(samples.manufacture, machine),
        **sinuosity.sinuosity_indices(samples.sinuosity),
        **curvature.curvature_indices(samples.curvature, machine),
        **alignment.alignment_indices(samples.alignment),
        **matching.matching_indices(samples.alignment),
        **stiffness_alignment.stiffness_alignment_indices(samples.alignment, material),
        **spacing.spacing_indices(samples.spacing, machine),
        **room.room_indices(samples.room),
        **coverage.coverage_indices(samples.coverage),
        **containment.containment_indices(samples.containment),
        **skin.skin_indices(samples.skin),
        **links.link_indices(samples.links),
        **crossings.crossing_indices(samples.crossings),
        **space.space_indices(samples.space),
        **tension_across.tension_indices(samples.tension),
        **head.head_indices(samples.head),
    }
