"""The region that carries the load: the cells crossed by stress lines that join the joints.

G. Fang, T. Zhang, Y. Huang, Z. Zhang, K. Masania, C. C. L. Wang, Exceptional mechanical performance
by spatial printing with continuous fiber, arXiv:2311.17265, section 2.2.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, read_only
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.slicing.principal_lines.tracing import Traced, Tracer

Keep = Literal["joining", "touching", "all"]

_MOST_JOINTS = 62
_CLIP = 5.0
"""Largest weight of a cell, in means (our choice)."""


@dataclass(frozen=True)
class CriticalRegion:
    """Cells that the kept lines cross.

    Attributes
    ----------
    traced : Traced
        Every line, one from each cell.
    kept : (s,) bool array
    crossings : (m,) int array
        Number of kept lines that cross each cell.
    weight : (m,) array
        Crossings over their mean in the region, at most 5; 0 outside the region.
    """

    traced: Traced
    kept: BoolArray
    crossings: IntArray
    weight: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "kept", read_only(self.kept, np.bool_))
        object.__setattr__(self, "crossings", read_only(self.crossings, np.int64))
        object.__setattr__(self, "weight", read_only(self.weight))


def critical_region(
    mesh: TetMesh,
    direction: FloatArray,
    joints: Sequence[IntArray],
    pairs: Sequence[tuple[int, int]] | None = None,
    keep: Keep = "joining",
) -> CriticalRegion:
    """Trace a line from every cell and keep those that join the joints.

    Parameters
    ----------
    direction : (m, 3) array
        Of the strongest principal stress (`strongest_stress`).
    joints : sequence of int arrays
        Nodes on the wall of each joint.
    pairs : sequence of (int, int), optional
        Which joints a kept line joins; any two by default.
    keep : {"joining", "touching", "all"}
        Keep lines that join two joints (the paper); that reach at least one; or all of them.

    Raises
    ------
    InputError
        When no line is kept, or there are more than 62 joints.
    """
    if keep not in get_args(Keep):
        raise InputError(f"lines to keep must be one of {', '.join(get_args(Keep))}; got {keep!r}")
    if len(joints) > _MOST_JOINTS:
        raise InputError(f"at most {_MOST_JOINTS} joints are possible; got {len(joints)}")
    touching = np.zeros(len(mesh.cells), dtype=np.int64)
    # A bit a joint: cells at its wall.
    for k, nodes in enumerate(joints):
        on_wall = np.zeros(len(mesh.points), dtype=bool)
        on_wall[nodes] = True
        touching |= on_wall[mesh.corners].any(axis=1).astype(np.int64) << k
    tracer = Tracer.of(mesh, direction)
    traced = tracer.survey(np.arange(len(mesh.cells)), touching)
    kept = _kept(traced.touched, len(joints), pairs, keep)
    if not kept.any():
        raise InputError(
            f"no stress line joins two of the {len(joints)} joints: name others, or keep the lines "
            'that reach one of them (lines = "touching") or all (lines = "all")'
        )
    # Cells matter as often as kept lines cross them, over the mean, without single high values.
    crossings = tracer.crossings(traced.seeds[kept])
    mean = crossings[crossings > 0].mean()
    return CriticalRegion(traced, kept, crossings, np.minimum(crossings / mean, _CLIP))


def _kept(
    touched: IntArray, count: int, pairs: Sequence[tuple[int, int]] | None, keep: Keep
) -> BoolArray:
    if keep == "all":
        return np.ones(len(touched), dtype=bool)
    if keep == "touching":
        return np.asarray(touched != 0)
    if pairs is None:
        pairs = [(i, j) for i in range(count) for j in range(i)]
    kept = np.zeros(len(touched), dtype=bool)
    for i, j in pairs:
        both = (1 << i) | (1 << j)
        kept |= (touched & both) == both
    return kept


# The principal stress of the largest size, tension or compression, and its direction.


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
    """Find the principal stress of the largest size (Fang et al. 2024, section 2.1)."""
    values, directions = np.linalg.eigh(stress)
    order = np.argsort(-np.abs(values), axis=1, kind="stable")
    row = np.arange(len(values))
    first, second = values[row, order[:, 0]], values[row, order[:, 1]]
    size = np.abs(first)
    direction = directions[row, :, order[:, 0]] * (size > 0.0)[:, None]
    gap = size - np.abs(second)
    distinct = np.divide(gap, size, out=np.zeros(len(size)), where=size > 0.0)
    return Strongest(first, direction, distinct)
