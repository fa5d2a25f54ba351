"""How well the fibre follows the tension: angle to the principal direction, and efficiency."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.tensor import in_plane, largest_in_plane
from ccfem.geometry.polylines import sample_midpoints
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, LayerSamples, PlanePaths
from ccfem.judging.evaluation.sensitivity import acute
from ccfem.slicing.layers.layer import LayerStress

PLACE = 40
"""Of these columns in tables: the smaller, the farther to the left."""

ON_SOME_LAYERS = True
"""Of a stack of many layers some are enough."""


_ANGLES = (10, 20, 30)

_SAMPLES = (
    "S is the in-plane part of the nodal stress, interpolated at the middle of every (about one "
    "fibre width long) step of a path; S1 its larger principal value, whatever its sign, and S1+ "
    "= max(S1, 0)."
)
_NONE = "NaN where no fibre lies in the part at a stress that has a direction"
_NO_TENSION = "NaN where no fibre lies in tension"

COLUMNS = (
    Column(
        "angle_mean",
        "degrees",
        f"Mean over the fibre's length of the angle between it and the direction of S1. {_SAMPLES} "
        "Where both principal values are equal, as at zero stress, there is no direction, and the "
        "sample does not count.",
        f"0 to 90, 0 is best, 45 is chance; {_NONE}",
    ),
    Column(
        "angle_mean_top_20",
        "degrees",
        "As angle_mean, over the fifth of the fibre's length that meets the highest S1+; length of "
        "equal stress at the limit counts in full.",
        f"0 to 90, 0 is best; {_NO_TENSION}",
    ),
    *(
        Column(
            f"aligned_{a}",
            "1",
            f"Share of the fibre's length with an angle below {a} degrees (see angle_mean).",
            f"0 to 1, 1 is best; {_NONE}",
        )
        for a in _ANGLES
    ),
    *(
        Column(
            f"aligned_stress_{a}",
            "1",
            f"As aligned_{a}, every sample weighted with S1+ too: fibre without tension does not "
            "count.",
            f"0 to 1, 1 is best; {_NO_TENSION}",
        )
        for a in _ANGLES
    ),
    Column(
        "efficiency",
        "1",
        "Sum of t.S.t over the sum of S1+, along the fibre with unit tangent t (see angle_mean): "
        "the part of the tension met that runs along the fibre; fibre in compression reduces it.",
        f"at most 1, which is best; negative where compression prevails; {_NO_TENSION}",
    ),
    Column(
        "no_tension",
        "1",
        "Share of the fibre's length inside the part with S1 <= 0: no direction there is in "
        "tension.",
        "0 to 1; NaN where no fibre lies in the part",
    ),
)

_ISOTROPIC = 1e-6
"""Principal values that differ by no more than this share of the larger one count as equal."""


_CRITICAL = 0.8
"""Quantile of the tension, by length, above which a sample counts as critical."""

_ROUNDING = 1e-3
"""Samples no further than this, mm, outside the section take the stress of its edge."""


@dataclass(frozen=True)
class AlignmentSamples(LayerSamples):
    """Samples along the fibre inside the part, (s,) each."""

    length: FloatArray  # mm
    angle: FloatArray  # radians in [0, pi/2]: NaN where both principal values are equal
    # MPa: in-plane principal values, S1 the larger
    largest: FloatArray
    smallest: FloatArray
    along: FloatArray  # MPa: t.S.t


def sample_alignment(paths: PlanePaths, stress: LayerStress, step: float) -> AlignmentSamples:
    """Stress along the paths of a layer, links in the part included.

    Parameters
    ----------
    stress : LayerStress
        Stress on the same layer; its nodal values are used.
    step : float, mm
        A path of length L is cut into ``max(1, round(L / step))`` equal parts and sampled in the
        middle of each. Samples outside the section (by more than 0.001 mm, the rounding of path
        files) meet no stress and are left out.
    """
    layer = paths.layer
    lines = paths.in_part
    points, tangents, length, _ = sample_midpoints(lines.points, lines.offsets, step)
    triangle, weights = layer.plane_triangles.locate(points, _ROUNDING)
    inside = triangle >= 0
    corners = in_plane(stress.nodal, layer.plane.frame)[layer.triangles[triangle[inside]]]
    s = np.einsum("qk,qkc->qc", weights[inside], corners)
    t = tangents[inside]
    largest, smallest, direction = largest_in_plane(s)
    angle = acute(np.arctan2(t[:, 1], t[:, 0]) - direction)
    size = np.maximum(np.abs(largest), np.abs(smallest))
    angle[largest - smallest <= _ISOTROPIC * size] = np.nan
    along = s[:, 0] * t[:, 0] ** 2 + s[:, 1] * t[:, 1] ** 2 + 2.0 * s[:, 2] * t[:, 0] * t[:, 1]
    return AlignmentSamples(length[inside], angle, largest, smallest, along)


def alignment_indices(samples: AlignmentSamples, _: Basis | None = None) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    length, angle = samples.length, np.degrees(samples.angle)
    tension = length * np.maximum(samples.largest, 0.0)
    known = ~np.isnan(angle)
    by_length, by_stress = length * known, tension * known
    values = {"angle_mean": _ratio(float((by_length[known] * angle[known]).sum()), by_length)}
    critical = _critical(tension, length) * by_length
    values["angle_mean_top_20"] = _ratio(float((critical[known] * angle[known]).sum()), critical)
    for name, weight in (("aligned", by_length), ("aligned_stress", by_stress)):
        for limit in _ANGLES:
            values[f"{name}_{limit}"] = _ratio(float(weight[known & (angle < limit)].sum()), weight)
    values["efficiency"] = _ratio(float((length * samples.along).sum()), tension)
    values["no_tension"] = _ratio(float(length[samples.largest <= 0.0].sum()), length)
    return values


def _critical(tension: FloatArray, length: FloatArray) -> FloatArray:
    """1 at the samples with the highest tension, S1+ times length, that make up a fifth; else 0."""
    stress = tension / np.maximum(length, 1e-300)
    if not len(stress) or not stress.max() > 0.0:
        return np.zeros(len(stress))
    # What ends exactly at the quantile lies below it.
    limit = np.quantile(stress, _CRITICAL + 1e-9, weights=length, method="inverted_cdf")
    return np.where((stress >= limit * (1.0 - 1e-6)) & (stress > 0.0), 1.0, 0.0)


def _ratio(part: float, whole: FloatArray) -> float:
    total = float(whole.sum())
    return part / total if total > 0.0 else float("nan")


def sample(paths: LayerPaths) -> AlignmentSamples:
    """Take the samples of one layer."""
    return sample_alignment(paths.plane, paths.layer_stress, paths.machine.fibre_width)


indices = alignment_indices
