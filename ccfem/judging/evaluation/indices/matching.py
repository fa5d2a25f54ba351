"""Matching rate: how much of fibre and stress agree in direction to within an angle.

T. Wang et al., Load-dependent path planning method for 3D printing of continuous fiber reinforced
plastics, Composites Part A 140 (2021) 106181, compares patterns by the share of vectors that match
within an angle, without saying of what vectors; `READINGS` are the ways to read it.

The direction of a stress is that of its in-plane principal value of the larger size, tension or
compression, as for `agreement`; it is a line and has no sign. Where the two sizes are within 2 %
(`strongest`), as in pure shear, under equal tension, or without stress, there is none, and the
place does not count. `alignment` differs: it measures from the larger value, so from the tension.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, read_only
from ccfem.base.checks import check_known
from ccfem.base.errors import InputError
from ccfem.base.tensor import in_plane, strongest, strongest_in_plane
from ccfem.geometry.polylines import starts_segment, subdivide
from ccfem.geometry.shapes import INSIDE, section_places
from ccfem.judging.evaluation.indices.alignment import AlignmentSamples, sample_alignment
from ccfem.judging.evaluation.layer_paths import Basis, Column, PlanePaths, plane_paths, pool
from ccfem.judging.evaluation.sensitivity import acute
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import LayerStress

PLACE = 50
"""Of these columns in tables: the smaller, the farther to the left."""

SAMPLES = "alignment"
"""Indices whose samples are taken for these, too."""


Reading = Literal["path", "energy", "stress_nearest", "stress_best"]
READINGS: tuple[Reading, ...] = get_args(Reading)

THRESHOLDS = read_only(np.arange(5.0, 91.0, 5.0))
"""Angles, degrees, at which the curve is given."""

_ANGLES = (10, 30)
_ROUNDING = 1e-6
"""Angles above a threshold by no more than this, degrees, are at it."""
_WEAK, _STRONG = 0.01, 0.99
"""Stresses below this share of this quantile by area are left out of the readings by stress."""

_PATH = (
    "between it and the direction of the in-plane principal stress of the larger size, tension or "
    "compression, is at most {} degrees (samples as for angle_mean, links in the section included; "
    "where both sizes are within 2 % there is no direction, and the sample does not count)"
)
_NONE = "NaN where no fibre lies in the part at a stress that has a direction"

COLUMNS = (
    *(
        Column(
            f"matching_path_{a}",
            "1",
            f"Share of the fibre's length where the angle {_PATH.format(a)}. Equal to aligned_{a} "
            "where tension prevails.",
            f"0 to 1, 1 is best; {_NONE}",
        )
        for a in _ANGLES
    ),
    *(
        Column(
            f"matching_energy_{a}",
            "1",
            f"As matching_path_{a}, each sample weighted with the size of that principal stress "
            "too.",
            f"0 to 1, 1 is best; {_NONE}",
        )
        for a in _ANGLES
    ),
)


@dataclass(frozen=True)
class MatchingSamples:
    """Angles between fibre and stress."""

    angle: FloatArray  # (s,), degrees: in [0, 90]; infinite for a stress that meets no fibre
    weight: FloatArray  # (s,): length of fibre, mm, or area, mm^2, that a sample stands for
    size: FloatArray  # (s,), MPa: larger absolute principal value in the plane


def matching_rate(
    paths: Toolpaths,
    stresses: Sequence[LayerStress],
    reading: Reading = "path",
    thresholds: FloatArray = THRESHOLDS,
    links: bool = True,
    step: float = 1.0,
    reach: float = 1.0,
) -> FloatArray:
    """Return the matching rate of the fibre of one layer, or of several together.

    Parameters
    ----------
    stresses : sequence of LayerStress
        Of the layers that count, one or more.
    reading : {"path", "energy", "stress_nearest", "stress_best"}
        "path": share of the fibre's length. "energy": the same, each length weighted with the size
        of the stress there. "stress_nearest": share of the stress vectors by area, each compared
        with the nearest piece of fibre, however far away (of equally near pieces, with the best).
        There is one vector a triangle of the layer; those below 1 % of the 99th percentile by area
        are left out. "stress_best": the same, but each vector is compared with the piece within
        `reach` that matches best; with no such piece it matches at no angle.
    thresholds : (k,) array, degrees
        Angles T; an angle of T matches.
    links : bool, default True
        Whether links inside the section count; those outside it or over a void never do.
    step : float, mm
        Distance of the samples along the fibre for the readings by path (`Machine.fibre_width`).
    reach : float, mm
        For "stress_best".

    Returns
    -------
    (k,) array in [0, 1]
        Chance is T / 90. NaN where nothing counts: no fibre in the part ("path", "energy") or no
        stress with a direction.

    Raises
    ------
    InputError
        For an unknown reading, or no layer.
    """
    if not len(stresses):
        raise InputError("a matching rate needs the stress of at least one layer; got none")
    samples = [
        sample_matching(plane_paths(paths, s.layer), s, reading, links, step, reach)
        for s in stresses
    ]
    return matching_curve(pool(samples), reading, thresholds)


def sample_matching(
    paths: PlanePaths,
    stress: LayerStress,
    reading: Reading = "path",
    links: bool = True,
    step: float = 1.0,
    reach: float = 1.0,
) -> MatchingSamples:
    """Angles between the fibre and the stress of one layer; parameters as in `matching_rate`."""
    check_known("reading of the rate", reading, READINGS)
    lines = paths.in_part if links else paths.strands
    if reading in ("path", "energy"):
        return along_fibre(sample_alignment(lines, stress, step))
    points, direction, size, area = _stress_vectors(stress)
    starts, ends = _segments_inside(lines, max(step, reach))
    angle = np.full(len(points), np.inf)
    if len(starts) and len(points):
        tree = shapely.STRtree(shapely.linestrings(np.stack([starts, ends], axis=1)))
        places = shapely.points(points)
        vector, piece = (
            tree.query_nearest(places)
            if reading == "stress_nearest"
            else tree.query(places, predicate="dwithin", distance=reach)
        )
        tangent = np.arctan2(*(ends - starts).T[::-1])
        turned = acute(tangent[piece] - direction[vector])
        np.minimum.at(angle, vector, np.degrees(turned))
    return MatchingSamples(angle, area, size)


def along_fibre(samples: AlignmentSamples) -> MatchingSamples:
    """Angles at samples along the fibre, where the stress has a direction."""
    across, defined = strongest(samples.largest, samples.smallest)
    angle = np.degrees(np.where(across, 0.5 * np.pi - samples.angle, samples.angle))
    size = np.maximum(np.abs(samples.largest), np.abs(samples.smallest))
    return MatchingSamples(angle[defined], samples.length[defined], size[defined])


def _stress_vectors(stress: LayerStress) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Centroids (v, 2), directions, radians, sizes, MPa, and areas of triangles with a direction.

    The stress is the nodal one, at the centroid.
    """
    layer = stress.layer
    plane = in_plane(stress.nodal, layer.plane.frame)[layer.triangles].mean(axis=1)
    value, direction, defined = strongest_in_plane(plane)
    centres = layer.plane.points[layer.triangles].mean(axis=1)
    return centres[defined], direction[defined], np.abs(value[defined]), layer.areas[defined]


def _segments_inside(paths: PlanePaths, longest: float) -> tuple[FloatArray, FloatArray]:
    """Both ends (s, 2) of the straight pieces of the fibre that lie in the section."""
    points, offsets, _ = subdivide(paths.points, paths.offsets, longest)
    first = np.flatnonzero(starts_segment(offsets))
    starts, ends = points[first], points[first + 1]
    inside = section_places(0.5 * (starts + ends), paths.layer.plane.polygon) == INSIDE
    return starts[inside], ends[inside]


def matching_curve(
    samples: MatchingSamples, reading: Reading = "path", thresholds: FloatArray = THRESHOLDS
) -> FloatArray:
    """Share of the samples within each angle, (k,); see `matching_rate`."""
    angle, weight = samples.angle, samples.weight
    if reading == "energy":
        weight = weight * samples.size
    elif reading in ("stress_nearest", "stress_best") and weight.sum() > 0.0:
        strong = np.quantile(samples.size, _STRONG, weights=weight, method="inverted_cdf")
        weight = np.where(samples.size >= _WEAK * strong, weight, 0.0)
    total = float(weight.sum())
    if not total > 0.0:
        return np.full(len(thresholds), np.nan)
    limits = np.asarray(thresholds, dtype=np.float64) + _ROUNDING
    return np.array([float(weight[angle <= limit].sum()) for limit in limits]) / total


def matching_indices(samples: AlignmentSamples, _: Basis | None = None) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    rates = along_fibre(samples)
    limits = np.array(_ANGLES, dtype=np.float64)
    return {
        f"matching_{reading}_{angle}": float(value)
        for reading in ("path", "energy")
        for angle, value in zip(_ANGLES, matching_curve(rates, reading, limits), strict=True)
    }


indices = matching_indices
