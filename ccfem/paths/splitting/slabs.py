"""The layers that a part is printed in: fibre where it was planned, matrix in all that is left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.geometry.polylines import pack, sample_midpoints
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import SAME_DECIMALS, Layer

LOW = 0.1
"""Least height of a layer of matrix, mm. Our choice."""
_SAME = 1e-6
"""Heights closer than this, mm, are the same."""


@dataclass(frozen=True)
class Slab:
    """A layer to print: its extent along the build direction, and its fibre layer if it is one."""

    lower: float
    upper: float
    fibre: int | None = None

    @property
    def height(self) -> float:
        """Its height, mm: equal ones are exactly equal."""
        return round(self.upper - self.lower, SAME_DECIMALS)


def slabs_of(
    layers: Sequence[Layer],
    bottom: float,
    top: float,
    machine: Machine,
    over: Mapping[int, float] | None = None,
) -> list[Slab]:
    """All layers to print, from the bottom to the top.

    Parameters
    ----------
    layers : sequence of Layer
        Those of fibre.
    bottom, top : float, mm
        Ends of the part along the build direction.
    over : mapping, optional
        Height of matrix, mm, that levels the strands of a fibre layer, by its index: the first
        layer of matrix over it is so high where there is room, and where the shape of its lines
        allows it (`Machine.highest_matrix`).
    """
    slabs: list[Slab] = []
    level, wanted = bottom, 0.0
    for layer in sorted(layers, key=lambda one: one.plane.height):
        lower = layer.plane.height - 0.5 * machine.strand_height
        upper = layer.plane.height + 0.5 * machine.strand_height
        if lower < level - _SAME or upper > top + _SAME:
            raise InputError(
                f"fibre layer {layer.index} at {layer.plane.height:g} mm does not fit with a fibre "
                f"height of {machine.strand_height:g} mm between {level:g} and {top:g} mm: move it "
                "with --heights, or take fewer layers"
            )
        slabs += _matrix_slabs(level, lower, machine, not slabs, wanted)
        slabs.append(Slab(lower, upper, layer.index))
        level, wanted = upper, (over or {}).get(layer.index, 0.0)
    return slabs + _matrix_slabs(level, top, machine, not slabs, wanted)


def _matrix_slabs(
    lower: float,
    upper: float,
    machine: Machine,
    first: bool,
    wanted: float = 0.0,
    on_matrix: bool = False,
) -> list[Slab]:
    """Matrix layers of equal height that fill a gap, the first of all lower; none without a gap.

    The first one over fibre is as high as wanted.
    """
    if upper - lower <= _SAME:
        return []
    # Lines over fibre reach down between its strands, and count as high as that.
    over = 0.0 if first or on_matrix else machine.strand_height
    most = machine.highest_matrix(over)
    low = min(machine.process.first_layer_height, most)
    if first and low > 0.0 and upper - lower > low + LOW:
        start = Slab(lower, lower + low)
        return [start, *_matrix_slabs(lower + low, upper, machine, False, on_matrix=True)]
    count = int(np.ceil((upper - lower) / most - _SAME))
    wanted = min(wanted, machine.highest_line - over)
    if wanted > (upper - lower) / count + _SAME:
        if upper - lower - wanted < LOW:
            return [Slab(lower, upper)]
        start = Slab(lower, lower + wanted)
        return [start, *_matrix_slabs(lower + wanted, upper, machine, False, on_matrix=True)]
    edges = np.linspace(lower, upper, count + 1).tolist()
    return [Slab(a, b) for a, b in pairwise(edges)]


def check_cover(slabs: Sequence[Slab], machine: Machine) -> list[str]:
    """Check the matrix below the first and over the last layer of fibre, and between them.

    Returns a warning for each side where it is one layer alone, and for layers of matrix that are
    lower than the machine's least line.
    """
    fibre = [k for k, slab in enumerate(slabs) if slab.fibre is not None]
    if not fibre:
        return []
    problems, least = [], machine.process.cover
    sides = {"below the first": slabs[: fibre[0]], "over the last": slabs[fibre[-1] + 1 :]}
    for side, gaps in sides.items():
        height = gaps[-1].upper - gaps[0].lower if gaps else 0.0
        if height < least - _SAME:
            raise InputError(
                f"{height:.3g} mm of matrix {side} fibre layer do not hold it; at least "
                f"{least:g} mm do: leave it without fibre (--set-fibre covered=true), move it with "
                "--heights, or set process.cover"
            )
        if len(gaps) == 1:
            problems.append(
                f"only one layer of matrix, {height:.3g} mm, {side} fibre layer: two hold it better"
            )
    heights = [slab.upper - slab.lower for slab in slabs if slab.fibre is None]
    thin = [height for height in heights if height < machine.least_line - _SAME]
    if thin:
        pitch = machine.strand_height + machine.least_line
        problems.append(
            f"{len(thin)} layer{'s' * (len(thin) > 1)} of matrix only {min(thin):.3g} mm high, "
            f"less than machine.least_line, {machine.least_line:g} mm: lay fibre layers at least "
            f"{pitch:.4g} mm apart, or with no matrix between them"
        )
    return problems


# How much fibre lies where: volume of strands per area, spread over about a fibre width.


_CELL = 0.25
_SPREAD = 0.5
"""Cell of the grid on which fibre is counted, and standard deviation of the bell curve that spreads
it, in fibre widths: strands a width apart then have the same density everywhere to 1.5 %."""


@dataclass(frozen=True)
class StrandDensity:
    """Volume of strands per area, mm, on a grid (a, b) of cells, mm, from its `low` corner on."""

    values: FloatArray
    low: FloatArray
    cell: float

    @classmethod
    def of(
        cls,
        strands: Sequence[FloatArray],
        sections: Sequence[float],
        width: float,
        places: FloatArray | None = None,
    ) -> "StrandDensity":
        """Count strands (n, 2) of some sections, mm^2, on a grid round places, or round themselves.

        `width` is that of a fibre, mm.
        """
        cell = _CELL * width
        lines, offsets = pack(strands)
        around = lines if places is None else places
        samples, _, length, line = sample_midpoints(lines, offsets, 0.5 * cell)
        low = around.min(axis=0) - 4.0 * width
        shape = tuple(np.ceil((around.max(axis=0) + 4.0 * width - low) / cell).astype(int) + 1)
        index = np.floor((samples - low) / cell).astype(int)
        inside = ((index >= 0) & (index < shape)).all(axis=1)
        flat = np.ravel_multi_index(tuple(index[inside].T), shape)
        weight = (length * np.asarray(sections)[line])[inside]
        count = np.bincount(flat, weight, int(np.prod(shape))).reshape(shape)
        spread = gaussian_filter(count / cell**2, _SPREAD / _CELL, mode="constant")
        return cls(spread, low, cell)

    def at(self, places: FloatArray) -> FloatArray:
        """Values at places (k, 2)."""
        where = (places - self.low) / self.cell - 0.5
        return np.asarray(map_coordinates(self.values, where.T, order=1, mode="nearest"))

    def index(self, places: FloatArray) -> tuple[IntArray, IntArray]:
        """Cells that places (k, 2) lie in."""
        where = np.floor((places - self.low) / self.cell).astype(np.int64)
        where = np.clip(where, 0, np.array(self.values.shape) - 1)
        return where[:, 0], where[:, 1]

    def place(self, index: IntArray) -> FloatArray:
        """Middles (k, 2) of cells (k, 2)."""
        return np.asarray(self.low + (index + 0.5) * self.cell)
