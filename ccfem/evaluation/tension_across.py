"""Tension across layers beside that of flat ones.

H. Kipping, T. Schueppstuhl, Materials 16 (2023) 998: layers are weakest across, so they are to be
square to the least principal stress.
"""

from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray, read_only
from ccfem.elasticity.part_stress import PartStress
from ccfem.evaluation.column import Column
from ccfem.layers.layer import Layer

__all__ = ["COLUMNS", "TensionSamples", "sample_tension", "tension_indices"]

_STEPS = 8
"""Steps on a quarter turn between the planes that are tried for the best."""
_BLOCK = 2048
"""Tensors that are turned to all planes at a time: few enough for the memory near the processor."""
_NONE = "NaN without tension"

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
)


@dataclass(frozen=True)
class TensionSamples:
    """Samples of a layer.

    Attributes
    ----------
    tensor : (t, 3, 3) array
        Of the triangles where there is tension: stress times area, N.
    tension : (t,) array, N
        Largest principal value.
    flat : (t,) array, N
        What acts along the build direction, 0 where negative.
    """

    tensor: FloatArray
    tension: FloatArray
    flat: FloatArray

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            object.__setattr__(self, name, read_only(values))


def sample_tension(layer: Layer, stress: PartStress, build: FloatArray) -> TensionSamples:
    """Take the samples of one layer; `build` is a unit vector."""
    tensor = stress.stress[layer.cell] * layer.areas[:, None, None]
    values = np.linalg.eigvalsh(tensor)
    pulled = values[:, 2] > 0.0
    flat = np.maximum(tensor @ build @ build, 0.0)
    return TensionSamples(tensor[pulled], values[pulled, 2], flat[pulled])


def tension_indices(samples: TensionSamples) -> dict[str, float]:
    """Values of `COLUMNS`."""
    total = float(samples.tension.sum())
    if not total > 0.0:
        return dict.fromkeys(("across_flat", "across_best"), float("nan"))
    tried = _around(np.linalg.eigh(samples.tensor.sum(axis=0))[1].T)
    return {
        "across_flat": float(samples.flat.sum()) / total,
        "across_best": float(_acting_along(tried, samples.tensor).min()) / total,
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
    """Directions (k, 3) even over half a sphere, their own mirror images in the planes of axes."""
    found = []
    for height in np.linspace(0.0, 0.5 * np.pi, _STEPS + 1):
        count = max(round(_STEPS * np.cos(height)), 1)
        turn = np.linspace(0.0, 2.0 * np.pi, 4 * count, endpoint=False)
        out = np.cos(height)
        ring = [out * np.cos(turn), out * np.sin(turn), np.full(len(turn), np.sin(height))]
        found.append(np.stack(ring, axis=1))
    return np.concatenate(found) @ axes
