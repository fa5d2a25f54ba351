"""Strands that would stack higher than the matrix above them end alternately where they cross.

Where bundles of strands cross or join, their strands lie on top of each other. The matrix above
levels them as long as they are not higher than it. Where they are, pieces of strands are left out,
one in each stack at a time, that which stands most in the way first: of neighbours in a bundle one
ends and the other goes on.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import label

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import along_line, line_length, points_along
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.printing.matrix_flow import THIN
from ccfem.printing.strand_density import StrandDensity

_STEP = 0.5
"""Distance of the places on a strand where the stack is looked at, in fibre widths."""
_ROUNDS = 40
"""Most pieces that are left out in one stack."""
_ENOUGH = 0.01
"""Share of a section that may stay too high: as much as matrix is thin without a word."""


@dataclass(frozen=True)
class Ended:
    """Strands of a layer, some of which end in stacks.

    Attributes
    ----------
    lines : list of (n, 2) arrays, mm
    removed : float, mm
        Length of the pieces that are left out.
    places : int
        Number of these pieces.
    """

    lines: list[FloatArray]
    removed: float = 0.0
    places: int = 0


def height_over(lines: Sequence[FloatArray], section: Region, machine: Machine) -> float:
    """Height of matrix over a layer of strands, mm, that levels them but for a hundredth of it."""
    if not len(lines):
        return 0.0
    density = StrandDensity.of(lines, [machine.strand_area] * len(lines), machine.fibre_width)
    high = np.sort(density.values[density.values > machine.strand_height])[::-1]
    # Half of what is let pass: lines of matrix do not see the same places as this grid.
    few = int(0.5 * _ENOUGH * section.area / density.cell**2)
    most = float(high[few]) if few < len(high) else 0.0
    return max(most + THIN - machine.strand_height, 0.0)


def ended_in_stacks(
    lines: Sequence[FloatArray], section: Region, room: float, machine: Machine
) -> Ended:
    """Let strands end where they would stack higher than there is room.

    Parameters
    ----------
    lines : sequence of (n, 2) arrays, mm
        Strands of one layer.
    section : Region
        Of the part: outside it nothing is left out.
    room : float, mm
        Height over the layer below that strands may have, spread over a fibre width or so.
    machine : Machine
        Its sections of strands, and the shortest that its cutter allows: no piece that stays is
        shorter, but for strands that were.

    Returns
    -------
    Ended
        All strands as they were where less than a hundredth of the section is too high.
    """
    kept = [np.asarray(line) for line in lines]
    removed, places = 0.0, 0
    for _ in range(_ROUNDS):
        density = StrandDensity.of(kept, [machine.strand_area] * len(kept), machine.fibre_width)
        high = density.values > room
        rows, columns = np.nonzero(high)
        if len(rows):
            middle = density.place(np.column_stack([rows, columns]))
            high[rows, columns] = shapely.contains_xy(section, *middle.T)
        if high.sum() * density.cell**2 <= _ENOUGH * section.area:
            break
        stacks, _ = label(high, np.ones((3, 3)))
        passes = _passes(kept, stacks, density, room, machine)
        if not passes:
            break
        pieces: dict[int, list[tuple[float, float]]] = {}
        taken = set()
        for _, stack, line, first, last in sorted(passes, reverse=True):
            # One in each stack; a strand is cut in one place a round, since its pieces get short.
            if stack in taken or line in pieces:
                continue
            taken.add(stack)
            pieces[line] = [(first, last)]
            removed += last - first
            places += 1
        kept = [piece for k, line in enumerate(kept) for piece in _without(line, pieces.get(k, []))]
    return Ended(kept, removed, places)


def _passes(
    lines: Sequence[FloatArray],
    stacks: FloatArray,
    density: StrandDensity,
    room: float,
    machine: Machine,
) -> list[tuple[float, int, int, float, float]]:
    """List passes through stacks that may be left out: excess, stack, strand and both ends."""
    shortest = max(machine.tail, machine.minimum_length)
    found = []
    for k, line in enumerate(lines):
        along = along_line(line)
        total = float(along[-1])
        count = max(int(np.ceil(total / (_STEP * machine.fibre_width))), 1)
        at = np.linspace(0.0, total, count + 1)
        index = density.index(points_along(line, along, at))
        stack, excess = stacks[index], density.values[index] - room
        edges = np.flatnonzero(np.diff(stack, prepend=-1, append=-1))
        for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            if stack[first] == 0:
                continue
            low, high = float(at[max(first - 1, 0)]), float(at[min(last, count)])
            # What stays is long enough for the cutter, or nothing.
            low = 0.0 if low < 1e-9 else low
            high = total if high > total - 1e-9 else high
            if 0.0 < low < shortest or 0.0 < total - high < shortest:
                continue
            gain = float(excess[first:last].clip(0.0).sum()) / (high - low)
            found.append((gain, int(stack[first]), k, low, high))
    return found


def _without(line: FloatArray, pieces: Sequence[tuple[float, float]]) -> list[FloatArray]:
    """Pieces of a strand that stay."""
    found, along, start = [], along_line(line), 0.0
    total = float(along[-1])
    for first, last in [*pieces, (total, total)]:
        if first > start:
            inner = along[(along > start + 1e-6) & (along < first - 1e-6)]
            where = np.concatenate([[start], inner, [first]])
            found.append(points_along(line, along, where))
        start = last
    return [piece for piece in found if line_length(piece) > 0.0]
