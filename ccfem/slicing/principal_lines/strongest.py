"""The principal stress of the largest size, tension or compression, and its direction."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, read_only


@dataclass(frozen=True)
class Strongest:
    """Principal stress of the largest size, per cell.

    Attributes
    ----------
    value : (m,) array, MPa
        Negative where compression is larger.
    direction : (m, 3) array
        Unit vectors, lines without a sign; zero where there is no stress.
    distinct : (m,) array in [0, 1]
        ``(|first| - |second|) / |first|`` of the principal values sorted by size: near 0 the
        direction is ill-defined. 0 where there is no stress.
    """

    value: FloatArray
    direction: FloatArray
    distinct: FloatArray

    def __post_init__(self) -> None:
        for name in ("value", "direction", "distinct"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def strongest_stress(stress: FloatArray) -> Strongest:
    """Find the principal stress of the largest size (Fang et al. 2024, section 2.1).

    Parameters
    ----------
    stress : (m, 3, 3) array, MPa
    """
    values, directions = np.linalg.eigh(stress)
    order = np.argsort(-np.abs(values), axis=1, kind="stable")
    row = np.arange(len(values))
    first, second = values[row, order[:, 0]], values[row, order[:, 1]]
    size = np.abs(first)
    direction = directions[row, :, order[:, 0]] * (size > 0.0)[:, None]
    gap = size - np.abs(second)
    distinct = np.divide(gap, size, out=np.zeros(len(size)), where=size > 0.0)
    return Strongest(first, direction, distinct)
