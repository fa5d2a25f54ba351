"""Tension across layers, compared with that across flat layers.

H. Kipping, T. Schueppstuhl, Materials 16 (2023) 998: layers are weakest along their normal, so this
should be the direction of the least principal stress.
"""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, LayerSamples

PLACE = 150
"""Of these columns in tables: the smaller, the farther to the left."""

BY_LAYER = True
"""Whatever the paths are."""

LARGE = True
"""Its samples take megabytes a layer."""

ON_SOME_LAYERS = True
"""Of a stack of many layers some are enough."""


_STEPS = 8
"""Steps on a quarter turn between the planes that are tried for the best."""
_BLOCK = 2048
"""Tensors that are turned to all planes at a time: few enough for the processor's cache."""
_NONE = "NaN without tension"
_NO_LEAST = "NaN without tension, or where the lesser principal stresses are equal everywhere"
_EQUAL = 1e-6
"""Difference of principal stresses, over the tension, that counts as rounding error."""

COLUMNS = (
    Column(
        "across_flat",
        "1",
        "across_tension as it would be for flat layers along the build direction.",
        f"0 to 1, 0 is best; {_NONE}",
    ),
    Column(
        "across_best",
        "1",
        "across_tension as it would be for flat layers along that direction, of some "
        "170 about the principal axes of the mean stress, for which it is least.",
        f"0 to 1, 0 is best; {_NONE}",
    ),
    Column(
        "least_angle",
        "degrees",
        "Angle between the normal of the layers and the direction of the least principal stress, "
        "mean over the layers' area, weighted by the difference of the two lesser principal "
        "stresses, up to the tension: where they are equal, every direction across is the least.",
        f"0 to 90, 0 is best; {_NO_LEAST}",
    ),
    Column(
        "least_angle_flat",
        "degrees",
        "least_angle as it would be for flat layers along the build direction.",
        f"0 to 90, 0 is best; {_NO_LEAST}",
    ),
    Column(
        "least_angle_best",
        "degrees",
        "least_angle as it would be for flat layers along the direction of across_best.",
        f"0 to 90, 0 is best; {_NO_LEAST}",
    ),
)


@dataclass(frozen=True)
class TensionSamples(LayerSamples):
    """Samples of a layer."""

    tensor: FloatArray  # (t, 3, 3): of the triangles where there is tension: stress times area, N
    tension: FloatArray  # (t,), N: largest principal value
    flat: FloatArray  # (t,), N: tension along the build direction; 0 where that is in compression
    gap: FloatArray  # (t,), N: difference of the two lesser principal values, at most `tension`
    least: FloatArray  # (t, 3): unit vector along the least principal stress
    # (t,), degrees: from `least` to the normal of the layer, and from `least` to the build
    # direction
    angle: FloatArray
    angle_flat: FloatArray


def sample(paths: LayerPaths) -> TensionSamples:
    """Take the samples of one layer."""
    layer, stress, build = paths.layer, paths.stress, paths.build
    tensor = stress.stress[layer.cell] * layer.areas[:, None, None]
    values, axes = np.linalg.eigh(tensor)
    pulled = values[:, 2] > 0.0
    flat = np.maximum(tensor @ build @ build, 0.0)
    least = axes[pulled, :, 0]
    return TensionSamples(
        tensor[pulled],
        values[pulled, 2],
        flat[pulled],
        np.minimum(values[pulled, 1] - values[pulled, 0], values[pulled, 2]),
        least,
        _angle(np.einsum("td,td->t", least, layer.normals[pulled])),
        _angle(least @ build),
    )


def _angle(cosine: FloatArray) -> FloatArray:
    """Angle, degrees, between lines, whose direction has no sign."""
    return np.asarray(np.degrees(np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))))


def indices(samples: TensionSamples, _: Basis) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    total = float(samples.tension.sum())
    if not total > 0.0:
        return {column.name: float("nan") for column in COLUMNS}
    tried = _around(np.linalg.eigh(samples.tensor.sum(axis=0))[1].T)
    acting = _acting_along(tried, samples.tensor)
    best = tried[int(np.argmin(acting))]
    angles = (samples.angle, samples.angle_flat, _angle(samples.least @ best))
    gap = float(samples.gap.sum())
    gap = gap if gap > _EQUAL * total else float("nan")
    ours, flat, least = (float(samples.gap @ angle) / gap for angle in angles)
    return {
        "across_flat": float(samples.flat.sum()) / total,
        "across_best": float(acting.min()) / total,
        "least_angle": ours,
        "least_angle_flat": flat,
        "least_angle_best": least,
    }


def _acting_along(directions: FloatArray, tensor: FloatArray) -> FloatArray:
    """Sum (k,), N, of the tension of tensors (t, 3, 3) along each direction (k, 3)."""
    products = np.einsum("ki,kj->kij", directions, directions).reshape(-1, 9).T
    rows = tensor.reshape(-1, 9)
    total = np.zeros(len(directions))
    for start in range(0, len(rows), _BLOCK):
        total += np.maximum(rows[start : start + _BLOCK] @ products, 0.0).sum(axis=0)
    return total


def _around(axes: FloatArray) -> FloatArray:
    """Directions (k, 3) evenly over half a sphere, symmetric about the planes of the axes."""
    neighbours = []
    for height in np.linspace(0.0, 0.5 * np.pi, _STEPS + 1):
        count = max(round(_STEPS * np.cos(height)), 1)
        turn = np.linspace(0.0, 2.0 * np.pi, 4 * count, endpoint=False)
        out = np.cos(height)
        ring = [out * np.cos(turn), out * np.sin(turn), np.full(len(turn), np.sin(height))]
        neighbours.append(np.stack(ring, axis=1))
    return np.concatenate(neighbours) @ axes
