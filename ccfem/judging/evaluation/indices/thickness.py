"""The thickness of layers."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, is_shared
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, LayerSamples

PLACE = 145
"""Of these columns in tables: the smaller, the farther to the left."""

BY_LAYER = True
"""Whatever the paths are."""


COLUMNS = (
    Column("thickness_5", "mm", "5th percentile by area of the layers' thickness.", "> 0"),
    Column("thickness_95", "mm", "95th percentile by area of the layers' thickness.", "> 0"),
)


@dataclass(frozen=True)
class ThicknessSamples(LayerSamples):
    """Areas, mm^2, and their thickness, mm: (t,) arrays, of triangles or of an even layer."""

    area: FloatArray
    thickness: FloatArray


def sample(paths: LayerPaths) -> ThicknessSamples:
    """Take the samples of one layer."""
    layer = paths.layer
    if is_shared(layer.local_thickness):  # those of hundreds of flat layers would fill memory
        first = layer.local_thickness[layer.triangles[:1]].mean(axis=1)
        return ThicknessSamples(layer.areas.sum(keepdims=True), first)
    return ThicknessSamples(layer.areas, layer.local_thickness[layer.triangles].mean(axis=1))


def indices(samples: ThicknessSamples, _: Basis) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    low, high = _quantiles(samples.thickness, samples.area)
    return {"thickness_5": low, "thickness_95": high}


def _quantiles(values: FloatArray, weight: FloatArray) -> tuple[float, float]:
    """5th and 95th percentile by weight."""
    if not weight.sum() > 0.0:
        return float("nan"), float("nan")
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weight[order]) / weight.sum()
    low, high = np.minimum(np.searchsorted(below, (0.05, 0.95)), len(values) - 1)
    return float(values[order[low]]), float(values[order[high]])
