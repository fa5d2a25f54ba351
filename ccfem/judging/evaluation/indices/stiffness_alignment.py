"""How much stiffness the direction of the fibre keeps: agreement and the index PI."""

from typing import Literal

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_known
from ccfem.base.tensor import strongest
from ccfem.fem.materials import Material
from ccfem.judging.evaluation.indices.alignment import AlignmentSamples
from ccfem.judging.evaluation.layer_paths import Basis, Column
from ccfem.judging.evaluation.sensitivity import OffAxis, acute, plane_compliance

PLACE = 60
"""Of these columns in tables: the smaller, the farther to the left."""

SAMPLES = "alignment"
"""Indices whose samples are taken for these, too."""


Reading = Literal["weighted", "literal", "harmonic"]
READINGS: tuple[Reading, ...] = ("weighted", "literal", "harmonic")

_CURVE = (
    "f is the stiffness under tension at an angle to the fibre over the largest at any angle, of "
    "the part's own material full of strands: its matrix, and EA / (W h) more along the fibre, "
    "with EA of a strand, the fibre width W and the mean thickness h of the layers (c_fram where "
    "only the stress of a part is known); the angle is the one to the direction of the larger "
    "absolute in-plane principal stress (samples as for angle_mean)"
)
_NONE = (
    "NaN where no fibre lies in the part at a stress of which one absolute principal value is at "
    "least 2 % the larger"
)

COLUMNS = (
    Column(
        "agreement",
        "1",
        "1 - a / 90 with the angle a in degrees between the fibre and the direction of the larger "
        "absolute in-plane principal stress, tension or compression; mean over the fibre's length "
        "(samples as for angle_mean; those of which both absolute values are within 2 % have no "
        "direction and do not count).",
        f"0 to 1, 1 is best, 0.5 is chance; {_NONE}",
    ),
    Column(
        "stiffness_alignment",
        "1",
        f"Mean of f over the fibre's length, weighted with 1 + e^3: {_CURVE}; e is the strain "
        "energy density with the fibre along that direction, over its 99.5th percentile and at "
        "most 1. PI of Plocher et al. 2022, weighted.",
        f"0 to 1, 1 is best; {_NONE}",
    ),
    Column(
        "stiffness_alignment_harmonic",
        "1",
        "Sum of e over the sum of e / f along the fibre (see stiffness_alignment): strain energy "
        "of the same stress with the best direction everywhere, over that with the fibre as laid.",
        f"0 to 1, 1 is best; {_NONE}",
    ),
)

_CAP = 0.995
"""Quantile of the energies that counts as the largest: at point loads the energy is infinite."""


def agreement(angle: FloatArray) -> FloatArray:
    """Agreement 1 - |angle| / 90 degrees of lines (...,), radians, in [0, 1]."""
    return 1.0 - acute(angle) / (0.5 * np.pi)


def performance_index(
    factor: FloatArray,
    energy: FloatArray,
    reading: Reading = "weighted",
    weight: FloatArray | None = None,
) -> float:
    """Stiffness-alignment index PI of Plocher et al. (2022), eq. 3.

    Parameters
    ----------
    factor : (s,) array in (0, 1]
        f of each sample; of several layers, their mean.
    energy : (s,) array >= 0
        Strain energy of the sample with the fibre along the principal direction.
    reading : {"weighted", "literal", "harmonic"}
        ``sum f w / sum w`` with ``w = 1 + e^3``; ``mean(f e^3) + 1``, as printed; or
        ``sum E / sum (E / f)``, which is ours: E / f is the energy of the benchmark's stress in the
        turned material. e is `energy` over its 99.5th percentile, at most 1.
    weight : (s,) array, optional
        What each sample stands for; default equal.

    Returns
    -------
    float
        NaN without a sample that counts.
    """
    check_known("reading of the index", reading, READINGS)
    weight = np.ones(len(factor)) if weight is None else weight
    if not len(factor) or not weight.sum() > 0.0 or not energy.max() > 0.0:
        return float("nan")
    if reading == "harmonic":
        return float((weight * energy).sum() / (weight * energy / factor).sum())
    top = float(np.quantile(energy, _CAP, method="inverted_cdf"))
    relative = np.minimum(energy / (top if top > 0.0 else energy.max()), 1.0)
    if reading == "literal":
        return float(np.average(factor * relative**3, weights=weight)) + 1.0
    return float(np.average(factor, weights=weight * (1.0 + relative**3)))


def stiffness_alignment_indices(samples: AlignmentSamples, material: Material) -> dict[str, float]:
    """Values of `COLUMNS`, for fibre along axis 1 of a material."""
    curve = OffAxis(material)
    across, defined = strongest(samples.largest, samples.smallest)
    if not defined.any():
        return {column.name: float("nan") for column in COLUMNS}
    high, low = samples.largest[defined], samples.smallest[defined]
    turned = across[defined]
    first, second = np.where(turned, low, high), np.where(turned, high, low)
    s = plane_compliance(material)
    energy = 0.5 * (s[0, 0] * first**2 + s[1, 1] * second**2) + s[0, 1] * first * second
    angle = np.where(turned, 0.5 * np.pi - samples.angle[defined], samples.angle[defined])
    factor, length = curve(angle), samples.length[defined]
    return {
        "agreement": float(np.average(agreement(angle), weights=length)),
        "stiffness_alignment": performance_index(factor, energy, "weighted", length),
        "stiffness_alignment_harmonic": performance_index(factor, energy, "harmonic", length),
    }


def indices(samples: AlignmentSamples, basis: Basis) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    return stiffness_alignment_indices(samples, basis.material)
