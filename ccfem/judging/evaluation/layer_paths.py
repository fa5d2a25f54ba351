"""What an index is, and what it may need: the paths of one layer, seen in every way."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, RowBuffer, read_only
from ccfem.fem.elasticity import PartStress
from ccfem.fem.materials import Material
from ccfem.geometry.polylines import lengths, merge_repeated, starts_segment
from ccfem.geometry.shapes import INSIDE, Region, cut_at_section
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress, curved_layers

# The fibre paths of one flat layer in its plane: what every index is computed from.


_REPEATED = 1e-6
"""Points nearer than this, mm, to the one before them are the same point."""

Samples = TypeVar("Samples")


@dataclass(frozen=True)
class PlanePaths:
    """Fibre paths of one layer in its plane coordinates."""

    layer: Layer
    points: FloatArray  # (P, 2), mm: without repeated neighbouring points
    # (K + 1,): path k holds ``points[offsets[k]:offsets[k + 1]]``, at least two points
    offsets: IntArray
    closed: BoolArray  # (K,)
    # (P,): whether the step from each point to the next one of its path is a link, as in
    # `Toolpaths`. Default: none is.
    link: BoolArray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.link is None:
            object.__setattr__(self, "link", np.zeros(len(self.points), dtype=np.bool_))

    @cached_property
    def lengths(self) -> FloatArray:
        """Length of each path, (K,), mm."""
        return lengths(self.points, self.offsets)

    @cached_property
    def strands(self) -> "PlanePaths":
        """The paths without their links: each is cut into its strands."""
        return _without(self, self.link)

    @cached_property
    def in_part(self) -> "PlanePaths":
        """The paths without the parts of their links that lie outside the section or over a void.

        Fibre that lies outside without being a link stays.
        """
        if not self.link.any():
            return self
        first = np.flatnonzero(self.link)
        start, end = self.points[first], self.points[first + 1]
        pieces = cut_at_section(start, end, self.layer.plane.polygon)
        away = np.zeros(len(self.points), dtype=bool)
        away[first[pieces.step[pieces.begin == 0.0]]] = (pieces.place != INSIDE)[
            pieces.begin == 0.0
        ]
        cut = pieces.begin > 0.0
        step, share = pieces.step[cut], pieces.begin[cut, None]
        after = first[step]
        # Stable, so that the cuts of a step come after its first point, in their order.
        order = np.argsort(np.concatenate([np.arange(len(away)), after]), kind="stable")
        points = np.concatenate([self.points, (1.0 - share) * start[step] + share * end[step]])
        away = np.concatenate([away, (pieces.place != INSIDE)[cut]])
        link = np.concatenate([self.link, np.ones(len(after), dtype=bool)])
        new = np.concatenate([[0], np.cumsum(np.bincount(after, minlength=len(self.points)) + 1)])
        offsets = new[self.offsets]
        return _without(
            PlanePaths(self.layer, points[order], offsets, self.closed, link[order]), away[order]
        )

    def __len__(self) -> int:
        return len(self.closed)


def plane_paths(toolpaths: Toolpaths, layer: Layer) -> PlanePaths:
    """Fibre paths of `toolpaths` on a flat layer; paths of no length are left out."""
    paths = toolpaths.select((toolpaths.layer == layer.index) & (toolpaths.kind == FIBRE))
    points, offsets, kept_points = merge_repeated(
        layer.plane.project(paths.points), paths.offsets, _REPEATED
    )
    # The last of the points merged starts the step to the next one.
    link = paths.link[np.append(kept_points, len(paths.points))[1:] - 1]
    sizes = np.diff(offsets)
    kept = sizes > 1
    mask = np.repeat(kept, sizes)
    return PlanePaths(
        layer,
        points[mask],
        np.concatenate([[0], np.cumsum(sizes[kept])]).astype(np.int64),
        paths.closed[kept],
        link[mask],
    )


def _without(paths: PlanePaths, dropped: BoolArray) -> PlanePaths:
    """Paths without the steps that the points in a (P,) mask start; their pieces are open."""
    if not dropped.any():
        return paths
    order = _from_gaps(paths, dropped)
    points, link = paths.points[order], paths.link[order]
    step = starts_segment(paths.offsets) & ~dropped[order]
    kept = step | np.concatenate([[False], step[:-1]])
    last = ~step[kept]
    path = np.repeat(np.arange(len(paths)), np.diff(paths.offsets))
    whole = paths.closed & (np.bincount(path, dropped, len(paths)) == 0)
    return PlanePaths(
        paths.layer,
        points[kept],
        np.concatenate([[0], np.flatnonzero(last) + 1]),
        whole[path[kept][last]],
        (link & step)[kept],
    )


def _from_gaps(paths: PlanePaths, dropped: BoolArray) -> IntArray:
    """Order of the points, (P,), in which closed paths begin after a step that is dropped."""
    order = np.arange(len(paths.points))
    for k in np.flatnonzero(paths.closed).tolist():
        first, last = int(paths.offsets[k]), int(paths.offsets[k + 1]) - 1
        gaps = np.flatnonzero(dropped[first:last])
        if len(gaps):
            ring = np.roll(np.arange(first, last), -(gaps[0] + 1))
            order[first : last + 1] = np.append(ring, ring[0])
    return order


def pool(parts: Iterable[Samples]) -> Samples:
    """Join samples (dataclasses of arrays) of several layers into those of the whole part."""
    pooled = Pool()
    for part in parts:
        pooled.add(part)
    return pooled.samples()


class LayerSamples:
    """Frozen dataclass of arrays, all of which are read-only: what an index takes of a layer."""

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            object.__setattr__(self, name, read_only(values))


_MANY = 2**19
"""Values from which equal ones are one, with the length of all."""


class Pool:
    """Samples of one kind, layer after layer: none is kept beside those of all.

    Of many values whose names a class of samples gives in `with_length`, with those of their
    lengths, equal ones are kept once: layers that repeat others add nothing.
    """

    def __init__(self) -> None:
        self._kind: Any = None
        self._columns: dict[str, RowBuffer] = {}
        self._most: dict[str, int] = {}

    def add(self, samples: Any) -> None:
        """Add those of a layer."""
        self._kind = type(samples)
        for field in fields(samples):
            values = getattr(samples, field.name)
            if field.name not in self._columns:
                empty = RowBuffer(values.dtype, *values.shape[1:], share=False)
                self._columns[field.name] = empty
            self._columns[field.name].append(values)
        for name, length in getattr(samples, "with_length", {}).items():
            if len(self._columns[name]) > self._most.get(name, _MANY):
                self._merge(name, length)

    def _merge(self, name: str, length: str) -> None:
        """Keep equal values of a column once, with the sum of their lengths."""
        values, weight = self._columns[name].rows(), self._columns[length].rows()
        values, number = np.unique(values, return_inverse=True)
        self._columns[name].append(values)
        self._columns[length].append(np.bincount(number, weight, len(values)))
        self._most[name] = max(_MANY, 2 * len(values))

    def samples(self) -> Any:
        """Those of all layers; afterwards there are none."""
        return self._kind(**{name: column.rows() for name, column in self._columns.items()})


# A stack of curved layers as points, in the order in which they are printed.


COARSE = 2.0
"""Distance, mm, between points that represent printed material, and between fibre samples."""


@dataclass(frozen=True)
class Printed:
    """Points of all layers, those of the first ones first."""

    points: FloatArray  # (n, 3), mm
    index: FloatArray  # (n,): of the layer
    build: FloatArray  # (3,): unit vector


def printed(layers: Sequence[Layer], build: Sequence[float] | None = None) -> Printed | None:
    """Sample a stack of layers; None where all are flat.

    Parameters
    ----------
    build : sequence of 3 floats, optional
        Build direction; by default the mean normal of the layers.
    """
    if not curved_layers(layers):
        return None
    stack = sorted(layers, key=lambda layer: layer.index)
    points = [np.concatenate([k.points, k.points[k.triangles].mean(axis=1)]) for k in stack]
    index = np.repeat(
        [layer.index for layer in stack], [len(layer_points) for layer_points in points]
    )
    every = np.concatenate(points)
    # Keep the point of each cube that is printed first.
    _, first = np.unique(np.floor(every / COARSE).astype(np.int64), axis=0, return_index=True)
    first = np.sort(first)
    up = np.zeros(3)
    if build is None:
        for layer in stack:
            up += layer.areas @ layer.normals
    else:
        up += np.asarray(build, dtype=np.float64)
    size = float(np.linalg.norm(up))
    up = up / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    return Printed(np.ascontiguousarray(every[first]), index[first].astype(np.float64), up)


@dataclass(frozen=True)
class LayerPaths:
    """Paths of one layer, with what they lie on."""

    toolpaths: Toolpaths  # every path of the layer, of all kinds, in the order of printing
    fibre: Toolpaths  # those of fibre
    inside: Toolpaths  # fibre without its links; of a curved layer all of it
    plane: PlanePaths  # the fibre in the plane of a flat layer, or in the chart of a curved one
    layer: Layer
    layer_stress: LayerStress  # on the flat layer, or on the chart
    stress: PartStress
    machine: Machine
    # Shapely (Multi)Polygon: what is under a flat layer, empty where nothing is; None where all of
    # it lies on something.
    below: Region | None
    late: int  # paths that are printed after paths of a higher layer
    stack: Printed | None  # all layers as they are printed, where they are curved
    build: FloatArray  # (3,): unit vector of the build direction


@dataclass(frozen=True)
class Basis:
    """What indices refer to."""

    machine: Machine
    material: Material  # of a part that is full of strands
    sampled: float = 1.0  # share of the layers' area on which samples were taken
    filled: float = 1.0  # share of the part's volume that is filled


# What an index is: name, unit, formula and range, for tables and their glossaries.


@dataclass(frozen=True)
class Column:
    """One index of the evaluation.

    Attributes
    ----------
    name : str
        Key in `Evaluation` and header of tables.
    unit : str
        "1" for a pure number.
    formula : str
        What is computed, in one or two sentences.
    range : str
        Values that it can take, which of them are good, and when it is NaN.
    """

    name: str
    unit: str
    formula: str
    range: str
