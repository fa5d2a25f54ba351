"""The head on curved layers: how far it tilts, where it would hang over, what it would run into."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.geometry.cones import earlier_in_cones
from ccfem.geometry.polylines import merge_repeated, sample_midpoints
from ccfem.judging.evaluation.layer_paths import (
    COARSE,
    Basis,
    Column,
    LayerPaths,
    LayerSamples,
    Printed,
)
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer

PLACE = 160
"""Of these columns in tables: the smaller, the farther to the left."""


_STEEP = 45.0
"""Tilt, degrees, from which a layer counts as overhanging."""
_NONE = "0 on flat layers; NaN without fibre"

COLUMNS = (
    Column(
        "tilt_mean",
        "degrees",
        "Mean over the fibre's length of the angle between the normal of its layer, along which "
        "the head stands, and the build direction.",
        f"0 to 180; {_NONE}",
    ),
    Column("tilt_95", "degrees", "95th percentile of that angle.", f"0 to 180; {_NONE}"),
    Column(
        "overhang",
        "1",
        f"Share of the fibre's length whose layer is tilted by more than {_STEEP:.0f} degrees: a "
        "head that stays upright would lay it on air.",
        f"0 to 1; {_NONE}",
    ),
    Column(
        "head_collision",
        "1",
        "Share of the fibre's length at which the head, a cone along the normal of the layer with "
        "its tip on the fibre (machine.head_angle, machine.head_length), meets a layer that was "
        f"printed before; layers are sampled every {COARSE:g} mm.",
        f"0 to 1, 0 is best; {_NONE}",
    ),
)


@dataclass(frozen=True)
class HeadSamples(LayerSamples):
    """Samples of the fibre of a layer."""

    length: FloatArray  # (s,), mm
    tilt: FloatArray  # (s,), degrees
    hits: BoolArray  # (s,)


def sample_head(
    fibre: Toolpaths, layer: Layer, stack: Printed | None, machine: Machine
) -> HeadSamples:
    """Take the samples of one layer.

    Parameters
    ----------
    fibre : Toolpaths
        On this layer.
    stack : Printed, optional
        What `printed` makes of all layers.
    """
    if stack is None or layer.flat is not None or not len(fibre):
        length = fibre.lengths
        return HeadSamples(length, np.zeros(len(length)), np.zeros(len(length), dtype=bool))
    points, offsets, _ = merge_repeated(fibre.points, fibre.offsets, 1e-6)
    middle, _, length, _ = sample_midpoints(points, offsets, COARSE)
    nearest = layer.nearest(middle)
    axis = layer.normals_at(nearest)
    tilt = np.degrees(np.arccos(np.clip(axis @ stack.build, -1.0, 1.0)))
    when = np.full(len(axis), layer.index)
    size = (machine.head_angle, machine.head_length)
    index = stack.index.astype(np.int64)
    hits = earlier_in_cones(nearest.points, axis, when, stack.points, index, *size) >= 0
    return HeadSamples(length, tilt, hits)


def head_indices(samples: HeadSamples, _: Basis | None = None) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    total = float(samples.length.sum())
    if not total > 0.0:
        return {column.name: float("nan") for column in COLUMNS}
    order = np.argsort(samples.tilt, kind="stable")
    below = np.cumsum(samples.length[order]) / total
    at = min(int(np.searchsorted(below, 0.95)), len(order) - 1)
    return {
        "tilt_mean": float(samples.length @ samples.tilt) / total,
        "tilt_95": float(samples.tilt[order][at]),
        "overhang": float(samples.length @ (samples.tilt > _STEEP)) / total,
        "head_collision": float(samples.length @ samples.hits) / total,
    }


def sample(paths: LayerPaths) -> HeadSamples:
    """Take the samples of one layer."""
    return sample_head(paths.inside, paths.layer, paths.stack, paths.machine)


indices = head_indices
