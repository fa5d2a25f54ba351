"""The fibre paths of one flat layer in its plane: what every index is computed from."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from ccfem.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.polylines import lengths, merge_repeated
from ccfem.layers.layer import Layer
from ccfem.toolpaths import FIBRE, Toolpaths

__all__ = ["PlanePaths", "plane_paths", "pool"]

_REPEATED = 1e-6
"""Points nearer than this, mm, to the one before them are the same point."""

Samples = TypeVar("Samples")


@dataclass(frozen=True)
class PlanePaths:
    """Fibre paths of one layer in its plane coordinates.

    Attributes
    ----------
    layer : Layer
    points : (P, 2) array, mm
        Without repeated neighbouring points.
    offsets : (K + 1,) int array
        Path k holds ``points[offsets[k]:offsets[k + 1]]``, at least two points.
    closed : (K,) bool array
    """

    layer: Layer
    points: FloatArray
    offsets: IntArray
    closed: BoolArray

    @cached_property
    def lengths(self) -> FloatArray:
        """Length of each path, (K,), mm."""
        return lengths(self.points, self.offsets)

    def __len__(self) -> int:
        return len(self.closed)


def plane_paths(toolpaths: Toolpaths, layer: Layer) -> PlanePaths:
    """Fibre paths of `toolpaths` on a flat layer; paths of no length are left out."""
    paths = toolpaths.select((toolpaths.layer == layer.index) & (toolpaths.kind == FIBRE))
    points, offsets = merge_repeated(layer.to_plane(paths.points), paths.offsets, _REPEATED)
    sizes = np.diff(offsets)
    kept = sizes > 1
    return PlanePaths(
        layer,
        points[np.repeat(kept, sizes)],
        np.concatenate([[0], np.cumsum(sizes[kept])]).astype(np.int64),
        paths.closed[kept],
    )


def pool(parts: Sequence[Samples]) -> Samples:
    """Join samples (dataclasses of arrays) of several layers into those of the whole part."""
    kind: Any = type(parts[0])
    joined = {f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(kind)}
    return kind(**joined)
