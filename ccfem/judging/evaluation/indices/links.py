"""Fibre that is there to join strands: how much of it there is, and where it lies."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.geometry.shapes import INSIDE, OUTSIDE, VOID, cut_at_section
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, PlanePaths

PLACE = 120
"""Of these columns in tables: the smaller, the farther to the left."""

BY_PATHS = True
"""Equal paths in equal sections have the same samples."""


_PLACES = {
    "link_inside": (INSIDE, "in the section of their layer"),
    "link_over_void": (
        VOID,
        "over a hole of the section, or over any other void within its outer border: nothing holds "
        "the fibre there",
    ),
    "link_outside": (OUTSIDE, "beyond the outer border of the section, where they are cut off"),
}

COLUMNS = (
    Column(
        "links",
        "1",
        "Number of links: stretches of fibre that the strategy marks as there to join two strands.",
        ">= 0",
    ),
    *(
        Column(name, "mm", f"Length of the links that lies {where}.", ">= 0; 0 without links")
        for name, (_, where) in _PLACES.items()
    ),
)


@dataclass(frozen=True)
class LinkSamples:
    """Number of links (1,) of a layer, and lengths of them (1, 3), mm, by column."""

    count: FloatArray
    length: FloatArray


def sample_links(paths: PlanePaths) -> LinkSamples:
    """Links of a layer, cut at the boundary of its section."""
    first = np.flatnonzero(paths.link)
    if not len(first):
        return LinkSamples(np.zeros(1), np.zeros((1, 3)))
    before = np.arange(len(paths.link)) - 1
    # The step before the first one of a closed path is its last one.
    before[paths.offsets[:-1][paths.closed]] = paths.offsets[1:][paths.closed] - 2
    follows = paths.link[before[first]]
    start, end = paths.points[first], paths.points[first + 1]
    pieces = cut_at_section(start, end, paths.layer.plane.polygon)
    size = np.linalg.norm(end - start, axis=1)[pieces.step] * (pieces.end - pieces.begin)
    length = np.array([[size[pieces.place == place].sum() for place, _ in _PLACES.values()]])
    return LinkSamples(np.array([float((~follows).sum())]), length)


def link_indices(samples: LinkSamples, _: Basis | None = None) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    lengths = dict(zip(_PLACES, samples.length.sum(axis=0).tolist(), strict=True))
    return {"links": float(samples.count.sum()), **lengths}


def sample(paths: LayerPaths) -> LinkSamples:
    """Take the samples of one layer."""
    return sample_links(paths.plane)


indices = link_indices
