"""How much the paths wind: length over the length of the simplified path, and paths over 40 mm."""

from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.polylines import lengths
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, PlanePaths

PLACE = 20
"""Of these columns in tables: the smaller, the farther to the left."""

BY_PATHS = True
"""Equal paths in equal sections have the same samples."""

ON_SOME_LAYERS = True
"""Of a stack of many layers some are enough."""


TOLERANCES = (0.001, 0.8, 1.0, 1.2)
"""Tolerances of the simplification in bead widths (Plocher et al. 2022; unit not stated there)."""

LONG = 40.0
"""Least length, mm, of continuous fibre that the cutter of Plocher et al. 2022 can lay."""

_FORMULA = (
    "of the sinuosity of each path: its length over that of its simplification by Douglas and "
    "Peucker, mean of the four tolerances 0.001, 0.8, 1 and 1.2 fibre widths; closed paths are "
    "simplified in two halves, from the start to the point farthest from it and back."
)
_NONE = "NaN without fibre"

COLUMNS = (
    Column(
        "sinuosity", "1", f"Mean weighted by length {_FORMULA}", f">= 1, 1 is straight; {_NONE}"
    ),
    Column("sinuosity_mean", "1", f"Mean over paths {_FORMULA}", f">= 1, 1 is straight; {_NONE}"),
    Column(
        "over_40_count",
        "1",
        "Share of the number of fibre paths that are longer than 40 mm.",
        f"0 to 1, 1 is best; {_NONE}",
    ),
    Column(
        "over_40_length",
        "1",
        "Share of the fibre's length in paths longer than 40 mm.",
        f"0 to 1, 1 is best; {_NONE}",
    ),
)

_ROUNDING = 1e-9
"""A path is over 40 mm when it is longer by more than this share."""


@dataclass(frozen=True)
class SinuositySamples:
    """Length (k,), mm, and sinuosity (k,) of each fibre path."""

    length: FloatArray
    sinuosity: FloatArray


def sample_sinuosity(paths: PlanePaths, width: float) -> SinuositySamples:
    """Sinuosity of the paths of a layer, with the fibre width, mm, as unit of the tolerances."""
    return SinuositySamples(paths.lengths, path_sinuosity(paths.points, paths.offsets, width))


def path_sinuosity(points: FloatArray, offsets: IntArray, width: float) -> FloatArray:
    """Sinuosity index SI of polylines.

    Parameters
    ----------
    points : (P, 2) array, mm
    offsets : (K + 1,) int array
        As in `ccfem.geometry.polylines`; every polyline has at least two points and a length. One
        whose ends coincide is closed.
    width : float, mm
        Bead width b: the unit of `TOLERANCES`.

    Returns
    -------
    (K,) array
        >= 1; 1 for a straight polyline. Plocher, Wioland and Panesar (2022), table 2.
    """
    count = len(offsets) - 1
    if not count:
        return np.zeros(0)
    pieces, owner = _open_lines(points, offsets)
    total = lengths(points, offsets)
    sinuosity = np.zeros(count)
    for tolerance in TOLERANCES:
        simple = shapely.simplify(pieces, tolerance * width, preserve_topology=False)
        sinuosity += total / np.bincount(owner, shapely.length(simple), count)
    return np.maximum(sinuosity / len(TOLERANCES), 1.0)


def _open_lines(points: FloatArray, offsets: IntArray) -> tuple[FloatArray, IntArray]:
    """Open lines, with the polyline each belongs to; closed polylines are halved."""
    sizes = np.diff(offsets)
    line = np.repeat(np.arange(len(sizes)), sizes)
    start, end = points[offsets[:-1]], points[offsets[1:] - 1]
    ring: BoolArray = np.asarray(
        (np.abs(start - end) <= _ROUNDING * (1.0 + np.abs(start))).all(axis=1)
    )
    away = ((points - start[line]) ** 2).sum(axis=1)
    away[~ring[line]] = -1.0
    # The first of the farthest points of each polyline.
    order = np.lexsort((np.arange(len(points)), -away, line))
    farthest = order[offsets[:-1]]
    halved: BoolArray = ring & (farthest > offsets[:-1]) & (farthest < offsets[1:] - 1)
    copies = np.ones(len(points), dtype=np.int64)
    copies[farthest[halved]] = 2
    index = np.repeat(np.arange(len(points)), copies)
    second = np.zeros(len(index), dtype=np.int64)
    # The second copy of a farthest point starts the second half.
    later = np.concatenate([[False], index[1:] == index[:-1]])
    second[later] = 1
    part = np.cumsum(second | np.concatenate([[0], np.diff(line[index])]))
    first = np.concatenate([[True], np.diff(part) > 0])
    lines: FloatArray = shapely.linestrings(points[index], indices=part)
    return lines, line[index][first]


def sinuosity_indices(samples: SinuositySamples, _: Basis | None = None) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    length = samples.length
    if not len(length):
        return {column.name: float("nan") for column in COLUMNS}
    over = length > LONG * (1.0 + _ROUNDING)
    return {
        "sinuosity": float(np.average(samples.sinuosity, weights=length)),
        "sinuosity_mean": float(samples.sinuosity.mean()),
        "over_40_count": float(over.mean()),
        "over_40_length": float(length[over].sum() / length.sum()),
    }


def sample(paths: LayerPaths) -> SinuositySamples:
    """Take the samples of one layer."""
    return sample_sinuosity(paths.plane, paths.machine.fibre_width)


indices = sinuosity_indices
