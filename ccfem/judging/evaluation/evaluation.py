"""The evaluator: every index of a set of paths, for each layer and in total."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.checks import check_number
from ccfem.base.display import Shown
from ccfem.base.errors import InputError
from ccfem.base.parallel import in_processes, one_blas_thread
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity import PartStress
from ccfem.fem.materials import Material, named_material
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.geometry.shapes import Region, corners_only
from ccfem.judging.evaluation import indices, layer_paths
from ccfem.judging.evaluation.indices.alignment import AlignmentSamples
from ccfem.judging.evaluation.indices.curvature import CurvatureSamples
from ccfem.judging.evaluation.sensitivity import strand_lamina
from ccfem.judging.virtual_testing import Strand
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import chart_of
from ccfem.paths.repeated import repeated_layers
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import SAME_DECIMALS, Layer, flat_layers, stress_on
from ccfem.slicing.slicers.planar import Planar

if TYPE_CHECKING:
    import pandas as pd

COLUMNS: tuple[layer_paths.Column, ...] = tuple(
    column for module in indices.named().values() for column in module.COLUMNS
)
"""Every index in the order of the tables."""

_ROUNDING = 1e-3
"""Rounding, mm, of coordinates in path files."""
_DOWN = 0.01
"""Least cosine to the way down of a face that looks down: upright walls are bent by rounding."""


@dataclass(frozen=True)
class FibreSamples:
    """Samples along the fibre of one layer, from which curves are drawn."""

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
        One value a layer, then the total. NaN only where `Column.range` says so, and on layers
        where an index was not taken; `COLUMNS` says what each value is.
    samples : tuple of FibreSamples
        Of the layers where every index was taken.
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

    @property
    def taken_on_some(self) -> int:
        """Number of layers on which every index was taken; 0 where it was on all."""
        return len(self.samples) if len(self.samples) < len(self.layers) else 0

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


@one_blas_thread
def evaluate(
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    stress: PartStress,
    machine: Machine,
    strand: Strand | None = None,
    build: Sequence[float] | None = None,
    most: int | None = None,
    filled: float = 1.0,
    of_layers: Sequence[Mapping[str, float]] | None = None,
) -> Evaluation:
    """Evaluate the fibre paths of a part.

    Sampling distances scale with the fibre width of the machine.

    Parameters
    ----------
    toolpaths : Toolpaths
        Paths of other kinds than fibre count in the print time only.
    layers : sequence of Layer
        Flat or curved, among them every layer that has a path. What is measured in the plane of
        a flat layer is measured in the chart of a curved one (`ccfem.paths.fields.chart`), with the
        lengths of the paths in space.
    strand : Strand, optional
        How stiff the fibre is in the index of stiffness alignment; by default as in the virtual
        test. It counts where `stress` knows the material of the part.
    build : sequence of 3 floats, optional
        Build direction. The head's tilt on curved layers is measured from it, and flat layers
        normal to it serve for comparison (`across_flat`). Default: mean normal of the layers.
    most : int, at least 1, optional
        Layers, evenly spread over the stack, on which indices are taken that some layers of many
        tell: means and quantiles of angles, distances and coverage. Sums, and all that the limits
        of a machine bound, are always of all layers. Default: all layers.
    filled : float, default 1
        Share of the part's volume that is filled (`Problem.filled`), for the mass of the matrix.
    of_layers : sequence of mappings, optional
        What `layer_indices` returns for the same part; by default taken here.

    Raises
    ------
    InputError
        When there is no layer, a path lies on none of the layers, or `most` is below 1.
    """
    if most is not None:
        check_number("most", most, at_least=1)
    layers = tuple(layers)
    if not layers:
        raise InputError("expected at least one layer to evaluate; got none: slice the part")
    _check_layers(toolpaths, layers)
    whole = _spread_over(len(layers), most)
    material = _material(layers, stress, machine, strand or Strand())
    basis = layer_paths.Basis(machine, material, filled=filled)
    if of_layers is None:
        of_layers = layer_indices(layers, stress, machine, strand, build, most, filled)
    rows, along_fibre = _rows(toolpaths, layers, stress, basis, build, whole)
    rows = [{**row, **more} for row, more in zip(rows, of_layers, strict=True)]
    nan = float("nan")
    return Evaluation(
        np.array([layer.index for layer in layers]),
        {column.name: np.array([row.get(column.name, nan) for row in rows]) for column in COLUMNS},
        tuple(along_fibre),
    )


def layer_indices(
    layers: Sequence[Layer],
    stress: PartStress,
    machine: Machine,
    strand: Strand | None = None,
    build: Sequence[float] | None = None,
    most: int | None = None,
    filled: float = 1.0,
) -> list[dict[str, float]]:
    """Take the indices that are the same for all paths: of each layer, then of all together.

    The parameters are those of `evaluate`.
    """
    material = _material(layers, stress, machine, strand or Strand())
    about = (layer_paths.Basis(machine, material, filled=filled), build)
    whole = _spread_over(len(layers), most)
    return _rows(Toolpaths.empty(), layers, stress, *about, whole, by_layer=True)[0]


def _rows(
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    stress: PartStress,
    basis: layer_paths.Basis,
    build: Sequence[float] | None,
    whole: BoolArray,
    by_layer: bool = False,
) -> tuple[list[dict[str, float]], list[FibreSamples]]:
    """Take the indices of each layer and of all, and the samples of layers where `whole` is set.

    They are those that depend on the paths, or else, with `by_layer`, all others.
    """
    machine, fibre = basis.machine, toolpaths.of_kind(FIBRE).layer
    late = fibre[fibre < np.maximum.accumulate(fibre)]
    stack, upright = layer_paths.printed(layers, build), _upright(layers, build)
    area = np.array([float(layer.areas.sum()) for layer in layers])
    sampled = 1.0 if whole.all() else float(area[whole].sum() / area.sum())

    below: list[Region | None] = [None] * len(layers)
    if not by_layer:
        beneath = in_processes(
            lambda k: _below(k, layers, stress.mesh, machine), layers, shared=[layers]
        )
        below = list(beneath)
    behind = [int(np.count_nonzero(late == layer.index)) for layer in layers]
    more = [
        (round(layer.thickness, SAME_DECIMALS), count, under and corners_only(under))
        for layer, count, under in zip(layers, behind, below, strict=True)
    ]
    source = repeated_layers(toolpaths, layers, more)
    shared = [toolpaths, stress, machine, stack, below]
    rows: list[dict[str, float]] = [{} for _ in layers]
    total: dict[str, float] = {}
    along_fibre: list[FibreSamples] = []
    for kinds in _passes(len(layers), by_layer):
        origin = _origins(kinds, source, whole)

        def measured(
            k: int,
            kinds: Mapping[str, ModuleType] = kinds,
            origin: Sequence[Mapping[str, int]] = origin,
        ) -> dict[str, tuple[Any, dict[str, float]]]:
            names = [name for name, at in origin[k].items() if at == k]
            if not names:
                return {}
            on_layer = toolpaths.on_layer(layers[k].index)
            about = (stress, machine, below[k], behind[k], stack, upright)
            # What it is searched by fills memory where there are many: it goes with a copy.
            layer = copy(layers[k]) if len(layers) > _TOGETHER else layers[k]
            view = _view(on_layer, layer, *about)
            samples = {name: kinds[name].sample(view) for name in names}
            return {name: (taken, _indices(name, taken, basis)) for name, taken in samples.items()}

        pools = {name: layer_paths.Pool() for name in kinds}
        again = {(name, at) for k, of in enumerate(origin) for name, at in of.items() if at < k}
        kept: dict[tuple[str, int], tuple[Any, dict[str, float]]] = {}
        results = in_processes(measured, range(len(layers)), shared=[layers, *shared])
        for k, taken in enumerate(results):
            kept |= {(name, k): one for name, one in taken.items() if (name, k) in again}
            samples = {}
            for name, at in origin[k].items():
                samples[name], values = taken[name] if at == k else kept[name, at]
                rows[k] |= values
                pools[name].add(samples[name])
            if "alignment" in samples:
                along_fibre.append(FibreSamples(samples["curvature"], samples["alignment"]))
        del kept
        for name, pooled in pools.items():  # one kind at a time: each fills memory
            total |= _indices(name, pooled.samples(), replace(basis, sampled=sampled))
    return [*rows, total], along_fibre


def _origins(
    kinds: Mapping[str, ModuleType], source: IntArray, whole: BoolArray
) -> list[dict[str, int]]:
    """Position of the layer that each one has its samples of, by their kind: its own, or earlier.

    Some are only taken where `whole` is set.
    """
    origin: list[dict[str, int]] = [{} for _ in source]
    for name, kind in kinds.items():
        first: dict[int, int] = {}
        for k, group in enumerate(source.tolist()):
            if whole[k] or not getattr(kind, "ON_SOME_LAYERS", False):
                by_paths = getattr(kind, "BY_PATHS", False)
                origin[k][name] = first.setdefault(group, k) if by_paths else k
    return origin


def _spread_over(count: int, most: int | None) -> BoolArray:
    """Mask of some of the layers of a stack, evenly spread, the first and the last among them."""
    chosen = np.zeros(count, dtype=bool)
    wanted = count if most is None else min(most, count)
    chosen[np.linspace(0, count - 1, wanted).round().astype(np.int64)] = True
    return chosen


_TOGETHER = 60
"""Layers up to which all samples are taken at once."""


def _passes(layers: int, by_layer: bool) -> list[dict[str, ModuleType]]:
    """Return the indices that take samples, by the layer alone or not, in passes over the layers.

    Of many layers those with large samples (`LARGE`) have passes of their own.
    """
    kinds = {
        name: kind
        for name, kind in indices.named().items()
        if hasattr(kind, "sample") and getattr(kind, "BY_LAYER", False) == by_layer
    }
    if layers <= _TOGETHER:
        return [kinds]
    large = [{name: kind} for name, kind in kinds.items() if getattr(kind, "LARGE", False)]
    rest = {name: kind for name, kind in kinds.items() if not getattr(kind, "LARGE", False)}
    return [*large, rest]


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
    if build is None:
        up = np.sum([layer.areas @ layer.normals for layer in layers], axis=0)
    else:
        up = np.asarray(build, dtype=np.float64)
    return np.asarray(up / max(float(np.linalg.norm(up)), 1e-300))


def _below(layer: Layer, layers: Sequence[Layer], mesh: TetMesh, machine: Machine) -> Region | None:
    """Find what the fibre of a flat layer lies on: the flat layer under it, or the matrix between.

    Empty where nothing is there. None where all of it lies on something: on the bed, and where the
    part does not widen between the matrix and the layer. None for curved layers.
    """
    if layer.flat is None:
        return None
    height, up = layer.flat.height, layer.plane.frame[2]
    level = height - 0.5 * (machine.strand_height + machine.highest_matrix(0.0))
    under = [other for other in flat_layers(layers) if other.plane.height < height]
    lower = max(under, key=lambda other: other.plane.height, default=None)
    if lower is not None and lower.plane.height >= level:
        return lower.plane.polygon
    bed = float((mesh.points @ up)[mesh.corners].min())
    if level <= bed or not _widens(mesh, up, level, height):
        return None
    sections = Planar(heights=(level,)).cut(mesh, tuple(up.tolist()))
    return sections[0].plane.polygon if sections else shapely.Polygon()


def _widens(mesh: TetMesh, up: FloatArray, low: float, high: float) -> bool:
    """Whether a face of a part looks down between two heights."""
    _, normal = mesh.facet_areas(mesh.boundary)
    height = (mesh.points @ up)[mesh.boundary]
    down = (normal @ up < -_DOWN) & (height.max(axis=1) > low) & (height.min(axis=1) < high)
    return bool(down.any())


def _view(
    toolpaths: Toolpaths,
    layer: Layer,
    stress: PartStress,
    machine: Machine,
    below: Region | None,
    late: int,
    stack: layer_paths.Printed | None,
    build: FloatArray,
) -> layer_paths.LayerPaths:
    """See the paths of one layer in every way that an index may need."""
    chart = chart_of(layer)
    flat, paths = chart.flat, layer_paths.plane_paths(chart.flattened(toolpaths), chart.flat)
    fibre = toolpaths.select(toolpaths.kind == FIBRE)
    inside = fibre if layer.flat is None else _in_space(paths.in_part)
    about = (layer, stress_on(flat, stress), stress, machine, below, late, stack, build)
    return layer_paths.LayerPaths(toolpaths, fibre, inside, paths, *about)


def _in_space(paths: layer_paths.PlanePaths) -> Toolpaths:
    """Paths of a flat layer as toolpaths."""
    lines = np.split(paths.points, paths.offsets[1:-1]) if len(paths) else []
    return Toolpaths.from_plane(lines, paths.layer, paths.closed.tolist())


def _material(
    layers: Sequence[Layer], stress: PartStress, machine: Machine, strand: Strand
) -> Material:
    """Material of a part that is full of strands, fibre along axis 1."""
    if stress.material is None:
        return named_material("c_fram")
    section = machine.fibre_width * float(np.mean([layer.thickness for layer in layers]))
    return strand_lamina(stress.material, strand.rho / section)


def _indices(source: str, samples: object, basis: layer_paths.Basis) -> dict[str, float]:
    """Value of each of `COLUMNS` that is made of the samples of a module."""
    values: dict[str, float] = {}
    for name, kind in indices.named().items():
        if getattr(kind, "SAMPLES", name) == source:
            values |= kind.indices(samples, basis)
    return values
