"""Auxiliary lines beside a part: skirt, brim, priming block, and a bar for a first strand."""

from dataclasses import dataclass
from itertools import chain

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import extent
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE
from ccfem.printing.laid_layer import COORDINATE_DIGITS
from ccfem.printing.poses import poses
from ccfem.printing.print_plan import PrintPlan

GAP = 4.0
"""Distance from the part to the block and the bar, mm, with an upright head. Our choice."""
_UP = np.array([0.0, 0.0, 1.0])
_BAR_LINES = 3
"""Lines of matrix under the first strand."""
_BAR_MORE = 20.0
"""Length of the bar beyond the distance from cutter to nozzle, mm."""


@dataclass(frozen=True)
class Beside:
    """Lines beside the parts, each (n, 2), mm.

    Attributes
    ----------
    skirt : tuple of arrays
        Loops round the first layer, the outermost first; those of the brim come last.
    blocks : tuple of tuples of arrays
        For each stack of layers the loops of its block from its contour inwards, or lines to and
        fro; on each matrix layer as many as its volume needs, at least two.
    bar : tuple of arrays
        Lines of the bar, on each matrix layer below the first strand.
    strand : (2, 2) array or None
        The first strand, on the bar.
    """

    skirt: tuple[FloatArray, ...] = ()
    blocks: tuple[tuple[FloatArray, ...], ...] = ((),)
    bar: tuple[FloatArray, ...] = ()
    strand: FloatArray | None = None


def beside(plan: PrintPlan, machine: Machine) -> Beside:
    """Choose the places of the auxiliary lines beside a part.

    Returns
    -------
    Beside
        The blocks are left of the parts and of fibre that leaves them, the bar in front of them,
        and the skirt round all of them.
    """
    process, width = machine.process, machine.matrix_width
    low, high = (end[:2] for end in extent(plan.paths.points))
    half = 0.5 * width
    aside = _head_aside(plan, machine)
    low, high = low - half - aside, high + half + aside
    stacks = int(plan.stack.max(initial=0)) + 1
    blocks: list[list[FloatArray]] = [[] for _ in range(stacks)]
    bar: list[FloatArray] = []
    strand = None
    if process.prime != "none":
        right, middle = low[0] - GAP, 0.5 * (low[1] + high[1])
        sizes = [_block_size(plan, stack, machine) for stack in range(stacks)]
        long = 4.0 * process.prime_size if process.prime == "line" else 0.0
        front = middle - 0.5 * (sum(max(size, long) + width for size in sizes) - width)
        for stack, size in enumerate(sizes):
            deep = max(size, long)
            blocks[stack] = _block(right, front + 0.5 * deep, size, machine)
            front += deep + width
    if process.prime != "none" and bool((plan.paths.kind == FIBRE).any()):
        long = machine.tail + _BAR_MORE
        left = 0.5 * (low[0] + high[0] - long)
        front = low[1] - GAP - (_BAR_LINES - 0.5) * width
        for k in range(_BAR_LINES):
            ends = np.array([[left, front + k * width], [left + long, front + k * width]])
            bar.append(ends[:: -1 if k % 2 else 1].round(COORDINATE_DIGITS))
        strand = np.array([[left, 0.0], [left + long, 0.0]])
        strand[:, 1] = front + 0.5 * (_BAR_LINES - 1) * width
        strand = strand.round(COORDINATE_DIGITS)
    skirt = _skirt(plan, (*chain.from_iterable(blocks), *bar), machine)
    return Beside(tuple(skirt), tuple(map(tuple, blocks)), tuple(bar), strand)


def _head_aside(plan: PrintPlan, machine: Machine) -> float:
    """Reach of a tilting head beyond its tip, mm."""
    axes = poses(plan.paths.normals, _UP, machine)
    if not len(axes) or axes[:, 2].min() > 1.0 - 1e-9:
        return 0.0
    half = np.radians(machine.head_angle)
    tilt = float(np.arccos(axes[:, 2].min()))
    return machine.head_length / float(np.cos(half)) * float(np.sin(min(tilt + half, np.pi / 2)))


def _block_size(plan: PrintPlan, stack: int, machine: Machine) -> float:
    """Side of the block of a stack, mm: on its lowest layer it holds the primed volume."""
    process, width = machine.process, machine.matrix_width
    if process.prime != "block":
        return process.prime_size
    mine = plan.stack == stack
    layers, kinds = plan.paths.layer[mine], plan.paths.kind[mine]
    matrix = np.setdiff1d(layers, layers[kinds == FIBRE])
    least = float(plan.thickness[matrix].min(initial=machine.highest_line))
    # Loops over the whole block hold its volume but for half a line round it.
    return float(max(process.prime_size, np.sqrt(1.01 * process.prime_volume / least) + width))


def _block(right: float, middle: float, size: float, machine: Machine) -> list[FloatArray]:
    """Lines of a block, given its right side, the middle of that and its size."""
    process, width = machine.process, machine.matrix_width
    if process.prime == "block":
        insets = (np.arange(max(int(0.5 * size / width), 1)) + 0.5) * width
        half = 0.5 * size - insets[insets < 0.5 * size]
        corners = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1], [1, -1]])
        centre = np.array([right - 0.5 * size, middle])
        return [(centre + reach * corners).round(COORDINATE_DIGITS) for reach in half.tolist()]
    lines = []
    for k in range(int(max(size // width, 2.0))):
        x = right - (k + 0.5) * width
        ends = np.array([[x, middle - 2.0 * size], [x, middle + 2.0 * size]])
        lines.append(ends[:: -1 if k % 2 else 1].round(COORDINATE_DIGITS))
    return lines


def _skirt(plan: PrintPlan, others: tuple[FloatArray, ...], machine: Machine) -> list[FloatArray]:
    """Loops round the first layer and the lines beside it, and the loops that touch it."""
    process, width = machine.process, machine.matrix_width
    lines = [line[:, :2] for line in plan.paths.select(plan.lowest)]
    skirt: list[FloatArray] = []
    if process.skirt_loops:
        points = np.concatenate([*lines, *others])
        hull = shapely.convex_hull(shapely.MultiPoint(points))
        for k in range(process.skirt_loops)[::-1]:
            far = process.skirt_gap + process.brim_loops * width + (k + 0.5) * width
            skirt += _ring(shapely.buffer(hull, far + 0.5 * width))
    closed = [line for line in lines if len(line) > 3 and (line[0] == line[-1]).all()]
    if process.brim_loops and closed:
        section = shapely.union_all([shapely.Polygon(line) for line in closed])
        for k in range(process.brim_loops)[::-1]:
            skirt += _ring(shapely.buffer(section, (k + 1) * width))
    return skirt


def _ring(region: Region) -> list[FloatArray]:
    """Outer borders of a region, rounded."""
    return [
        shapely.get_coordinates(part.exterior).round(COORDINATE_DIGITS)
        for part in shapely.get_parts(region)
    ]
