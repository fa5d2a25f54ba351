"""Toolpaths: the polylines that every strategy returns and every index is computed from."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ccfem.base.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    RowBuffer,
    freeze,
    read_only,
    shared_rows,
)
from ccfem.base.display import Shown
from ccfem.base.row_blocks import RowBlocks
from ccfem.geometry.polylines import extent, step_lengths
from ccfem.slicing.layers.layer import Layer

KINDS = ("fibre", "matrix", "support", "travel")
FIBRE, MATRIX, SUPPORT, TRAVEL = range(4)

_COLUMNS: dict[str, tuple[Any, ...]] = {
    "points": (float, 3),
    "normals": (float, 3),
    "layer": (np.int64,),
    "kind": (np.int64,),
    "closed": (bool,),
    "link": (bool,),
}
"""Arrays of paths that are joined as they are: their kind and the shape of a row."""

_TOGETHER = 200_000
"""Points whose steps are measured at a time."""


@dataclass(frozen=True)
class Toolpaths(Shown):
    """Polylines of a whole part, stored as one array of points with offsets (as in CSR).

    Attributes
    ----------
    points : (P, 3) array, mm
        In the frame of the mesh. A closed path repeats its first point at its end.
    normals : (P, 3) array
        Unit normal of the layer at each point.
    offsets : (K + 1,) int array
        Path k holds ``points[offsets[k]:offsets[k + 1]]``.
    layer : (K,) int array
        Index of the layer (`Layer.index`) that each path lies on.
    kind : (K,) int array
        FIBRE, MATRIX, SUPPORT or TRAVEL (index into `KINDS`).
    closed : (K,) bool array
        Whether the path is a closed curve.
    link : (P,) bool array, optional
        Whether the step from each point to the next one of its path is a link: fibre that only
        joins two strands and is not meant to carry load. False at the last point of a path.
        Default: no step is a link.
        A strategy marks links that may leave the section or cross a void, as `svt` does, since
        these are evaluated separately. Short links inside the section that follow the border or the
        field, as those of `isocurve` and `zigzag`, count as fibre and are not marked. Of matrix it
        is a way to the next line, on which nothing is laid.
    """

    points: FloatArray
    normals: FloatArray
    offsets: IntArray
    layer: IntArray
    kind: IntArray
    closed: BoolArray
    link: BoolArray = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        length = float(self.of_kind(FIBRE).lengths.sum())
        return (
            f"Toolpaths: {len(self)} paths on {len(np.unique(self.layer))} layers, "
            f"{length:.0f} mm of fibre"
        )

    def __post_init__(self) -> None:
        if self.link is None:
            object.__setattr__(self, "link", np.broadcast_to(np.False_, len(self.points)))
        freeze(self, points=float, offsets=int, layer=int, kind=int, closed=bool)
        # Flat layers have one normal, and most paths no link.
        object.__setattr__(self, "normals", shared_rows(self.normals))
        object.__setattr__(self, "link", shared_rows(self.link, bool))
        count = len(self.layer)
        if self.points.shape != self.normals.shape or self.points.ndim != 2:
            raise ValueError(
                f"points and normals must both have shape (P, 3); got {self.points.shape} "
                f"and {self.normals.shape}"
            )
        if self.offsets.shape != (count + 1,) or self.offsets[-1] != len(self.points):
            raise ValueError("offsets must have one entry more than there are paths and end at P")
        if self.link.shape != (len(self.points),) or self.link[self.offsets[1:] - 1].any():
            raise ValueError("link must have shape (P,), and be false at the end of every path")
        if len(self.points) and not np.isfinite(extent(self.points)).all():
            raise ValueError("points must be finite; got NaN or infinity")

    @classmethod
    def empty(cls) -> "Toolpaths":
        """No path at all."""
        none = np.zeros(0, dtype=np.int64)
        start = np.zeros(1, dtype=np.int64)
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), start, none, none, none.astype(bool))

    @classmethod
    def from_plane(
        cls,
        lines: Sequence[FloatArray],
        layer: Layer,
        closed: Sequence[bool] | None = None,
        link: Sequence[BoolArray] | None = None,
    ) -> "Toolpaths":
        """Fibre paths on one flat layer from polylines in its plane coordinates.

        Parameters
        ----------
        lines : sequence of (n_i, 2) arrays, mm
            Polylines with at least two points; others are dropped.
        layer : Layer
            A flat layer.
        closed : sequence of bool, optional
            By default a line is closed when its last point equals its first.
        link : sequence of (n_i,) bool arrays, optional
            Which steps of each line are links; by default none.
        """
        keep = [k for k, line in enumerate(lines) if len(line) >= 2]
        if not keep:
            return cls.empty()
        points = layer.plane.to_space(np.concatenate([lines[k] for k in keep]))
        ends = [np.array_equal(lines[k][0], lines[k][-1]) for k in keep]
        return cls(
            points=points,
            normals=np.broadcast_to(layer.plane.frame[2], points.shape),
            offsets=np.concatenate([[0], np.cumsum([len(lines[k]) for k in keep])]),
            layer=np.full(len(keep), layer.index),
            kind=np.full(len(keep), FIBRE),
            closed=np.array(ends if closed is None else [closed[k] for k in keep]),
            link=np.concatenate([link[k] if link else np.zeros(len(lines[k]), bool) for k in keep]),
        )

    @classmethod
    def in_space(
        cls,
        lines: Sequence[FloatArray],
        normals: Sequence[FloatArray],
        layer: Layer,
        kind: int = FIBRE,
    ) -> "Toolpaths":
        """Paths on one layer, flat or curved, from polylines in space.

        Parameters
        ----------
        lines : sequence of (n_i, 3) arrays, mm
            Polylines with at least two points; others are dropped. A line is closed when its last
            point equals its first.
        normals : sequence of (n_i, 3) arrays
            Unit normal of the layer at each of their points.
        kind : int, default FIBRE
        """
        keep = [k for k, line in enumerate(lines) if len(line) >= 2]
        if not keep:
            return cls.empty()
        return cls(
            points=np.concatenate([lines[k] for k in keep]),
            normals=np.concatenate([normals[k] for k in keep]),
            offsets=np.concatenate([[0], np.cumsum([len(lines[k]) for k in keep])]),
            layer=np.full(len(keep), layer.index),
            kind=np.full(len(keep), kind),
            closed=np.array([np.array_equal(lines[k][0], lines[k][-1]) for k in keep]),
        )

    @classmethod
    def concatenate(cls, parts: Iterable["Toolpaths"]) -> "Toolpaths":
        """All paths of `parts`, in their order; none is kept while the next one is made."""
        columns: dict[str, RowBuffer | RowBlocks] = {
            name: RowBuffer(kind, *shape) for name, (kind, *shape) in _COLUMNS.items()
        }
        columns["points"] = RowBlocks(float, 3)
        sizes = [np.zeros(1, dtype=np.int64)]
        for part in parts:
            sizes.append(np.diff(part.offsets))
            for name, column in columns.items():
                column.append(getattr(part, name))
        if not len(columns["layer"]):
            return cls.empty()
        joined = {name: column.rows() for name, column in columns.items()}
        return cls(offsets=np.cumsum(np.concatenate(sizes)), **joined)

    def __getstate__(self) -> dict[str, Any]:
        """Send only the fields to other processes, not what is stored beside them."""
        return {column.name: getattr(self, column.name) for column in fields(self)}

    def __len__(self) -> int:
        return len(self.layer)

    def __iter__(self) -> Iterator[FloatArray]:
        """Iterate over the paths as (n_i, 3) arrays, mm."""
        for start, end in zip(self.offsets[:-1], self.offsets[1:], strict=True):
            yield self.points[start:end]

    def select(self, wanted: BoolArray) -> "Toolpaths":
        """Only the paths where the (K,) mask `wanted` is true."""
        wanted = np.asarray(wanted, dtype=bool)
        if wanted.all():
            return self
        chosen = np.flatnonzero(wanted)
        if len(chosen) and chosen[-1] - chosen[0] + 1 == len(chosen):
            return self._between(int(chosen[0]), int(chosen[-1]) + 1)
        return self.with_points(np.repeat(wanted, np.diff(self.offsets)))

    def with_points(self, wanted: BoolArray) -> "Toolpaths":
        """Paths of the points where the (P,) mask `wanted` is true; those without any are left out.

        No path may end in a link then.
        """
        before = np.concatenate([[0], np.cumsum(wanted)])[self.offsets]
        stays = np.diff(before) > 0
        return replace(
            self,
            points=self.points[wanted],
            normals=self.normals[wanted],
            offsets=np.append(0, before[1:][stays]),
            layer=self.layer[stays],
            kind=self.kind[stays],
            closed=self.closed[stays],
            link=self.link[wanted],
        )

    def _between(self, first: int, last: int) -> "Toolpaths":
        """Paths one after the other, which share their memory with all."""
        paths = slice(first, last)
        points = slice(int(self.offsets[first]), int(self.offsets[last]))
        return replace(
            self,
            points=self.points[points],
            normals=self.normals[points],
            offsets=self.offsets[first : last + 1] - self.offsets[first],
            layer=self.layer[paths],
            kind=self.kind[paths],
            closed=self.closed[paths],
            link=self.link[points],
        )

    def on_layer(self, index: int) -> "Toolpaths":
        """Only the paths of one layer."""
        return self.select(self.layer == index)

    def of_kind(self, kind: int) -> "Toolpaths":
        """Only the paths of one kind (FIBRE, MATRIX, SUPPORT or TRAVEL)."""
        return self.select(self.kind == kind)

    @cached_property
    def lengths(self) -> FloatArray:
        """Length of each path, (K,), mm."""
        if not len(self):
            return read_only(np.zeros(0))
        # Some paths at a time: those of a large print fill memory.
        edges = np.searchsorted(self.offsets, np.arange(0, len(self.points), _TOGETHER))
        total = np.zeros(len(self))
        for first, last in pairwise(np.unique([*edges.tolist(), len(self)]).tolist()):
            ends = self.offsets[first : last + 1]
            steps = np.zeros(ends[-1] - ends[0])
            step_lengths(self.points[ends[0] : ends[-1]], steps[1:])
            steps[ends[:-1] - ends[0]] = 0.0
            total[first:last] = np.add.reduceat(steps, ends[:-1] - ends[0])
        return read_only(total)
