"""Strands that cross themselves or each other on a layer."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.geometry.intersections import find_crossings
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, PlanePaths

PLACE = 130
"""Of these columns in tables: the smaller, the farther to the left."""


COLUMNS = (
    Column(
        "crossings",
        "1",
        "Number of places at which two different paths of a layer cross: one goes from one side "
        "of the other to its other side. Touching is no crossing.",
        ">= 0, 0 is best",
    ),
    Column(
        "self_crossings",
        "1",
        "Number of places at which a path crosses itself.",
        ">= 0, 0 is best",
    ),
)


@dataclass(frozen=True)
class CrossingSamples:
    """Crossings between paths (1,) and of paths with themselves (1,) on a layer."""

    between: FloatArray
    own: FloatArray


def sample_crossings(paths: PlanePaths) -> CrossingSamples:
    """Count the crossings on a layer (see `ccfem.geometry.intersections.find_crossings`)."""
    pairs = find_crossings(paths.points, paths.offsets, paths.closed)
    line = np.searchsorted(paths.offsets, pairs, side="right")
    with_itself = int((line[:, 0] == line[:, 1]).sum())
    return CrossingSamples(
        np.array([float(len(pairs) - with_itself)]), np.array([float(with_itself)])
    )


def crossing_indices(samples: CrossingSamples) -> dict[str, float]:
    """Values of `COLUMNS`."""
    return {
        "crossings": float(samples.between.sum()),
        "self_crossings": float(samples.own.sum()),
    }


def sample(paths: LayerPaths) -> CrossingSamples:
    """Take the samples of one layer."""
    return sample_crossings(paths.plane)


def indices(samples: CrossingSamples, _: Basis) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    return crossing_indices(samples)
