"""Paths of one layer of a print, matrix or fibre, in the order of printing."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.geometry.polylines import is_closed, line_length, merge_repeated, pack
from ccfem.geometry.shapes import Region, strings
from ccfem.machine.machine import Machine
from ccfem.paths.linking.print_order import nearest_end_order
from ccfem.paths.toolpaths import FIBRE, MATRIX, SUPPORT, Toolpaths
from ccfem.printing.matrix_flow import pad_flow, with_flow
from ccfem.printing.matrix_lines import MatrixFill
from ccfem.printing.slabs import LOW

COORDINATE_DIGITS = 3
"""Decimals of coordinates, mm."""

SHORT = 1e-6
"""Share of the cutter's distance by which a path may be too short through rounding."""


@dataclass(frozen=True)
class Below:
    """Fibre layers since the last layer of matrix.

    Attributes
    ----------
    strands : list of (n, 2) arrays, mm
    sections : list of float, mm^2
        Of each strand.
    height : float, mm
        Of these layers.
    """

    strands: list[FloatArray] = field(default_factory=list)
    sections: list[float] = field(default_factory=list)
    height: float = 0.0


@dataclass(frozen=True)
class LaidLayer:
    """Paths of a layer, and the fate of the strands planned on it.

    Attributes
    ----------
    laid : (P,) array, mm
        Height of matrix, a line wide, on the step from each point.
    short : (K,) bool array
        Lines of matrix in place of strands that are too short for the cutter.
    dropped, outside : float, mm
        Length that is left out, and length outside the part.
    """

    paths: Toolpaths
    laid: FloatArray
    short: BoolArray
    warning: str = ""
    dropped: float = 0.0
    outside: float = 0.0


def matrix_layer(
    fill: MatrixFill,
    pads: Sequence[FloatArray],
    below: Below,
    number: int,
    height: float,
    thickness: float,
    machine: Machine,
) -> LaidLayer:
    """Lay matrix over the layers below, and pads.

    Parameters
    ----------
    pads : sequence of (n, 2) arrays, mm
        Lines of pads.
    height, thickness : float, mm
        Top of the layer over the bed, and its own height.
    """
    found, which = _printed(fill.lines, height, number, MATRIX)
    heights, warning = np.zeros(0), ""
    strands = (below.strands, below.height, machine, below.sections)
    if len(found):
        shares = np.array(fill.widths)[which] / machine.matrix_width
        found, heights, warning = with_flow(found, fill.section, thickness, *strands, shares)
    pad, _ = _printed(pads, height, number, SUPPORT)
    if len(pad):
        pad, high = pad_flow(pad, thickness, *strands)
        found, heights = Toolpaths.concatenate([found, pad]), np.append(heights, high)
    warning = f"at {height:.4g} mm {warning}" if warning else ""
    return LaidLayer(found, heights, np.zeros(len(found), dtype=bool), warning)


def fibre_layer(
    lines: Sequence[FloatArray],
    border: Region,
    below: Below,
    number: int,
    height: float,
    thickness: float,
    machine: Machine,
) -> tuple[LaidLayer, Below]:
    """Lay strands (n, 2), with matrix instead of those too short; also return the new `Below`.

    Parameters are those of `matrix_layer`, and the border of the part on the layer.
    """
    by_matrix, whole = _sorted_by_length(lines, machine)
    dropped = sum(map(line_length, lines)) - sum(map(line_length, by_matrix + whole))
    outside = float(shapely.length(shapely.difference(strings(whole), border)).sum())
    few, _ = _printed(by_matrix, height, number, MATRIX)
    found = Toolpaths.concatenate([few, _printed(whole, height, number, FIBRE)[0]])
    heights = np.full(len(found.points), thickness)
    short = found.kind == MATRIX
    sections = [machine.matrix_width * thickness] * len(by_matrix)
    sections += [machine.strand_area] * len(whole)
    after = Below(
        below.strands + by_matrix + whole, below.sections + sections, below.height + thickness
    )
    return LaidLayer(found, heights, short, "", dropped, outside), after


def _sorted_by_length(
    lines: Sequence[FloatArray], machine: Machine
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Strands that are replaced by matrix, and those that the cutter allows.

    Where strands are left out, and in layers too low for a line of matrix, the matrix above fills
    their place.
    """
    limit = max(machine.tail, machine.minimum_length) * (1.0 - SHORT)
    whole = [line for line in lines if line_length(line) >= limit]
    if machine.process.short == "error" and len(whole) < len(lines):
        raise InputError(
            f"process.turns cuts strands into pieces below the {limit:g} mm that the cutter "
            "allows: set it to 'pad', or process.short to 'matrix'"
        )
    if machine.process.short != "matrix" or machine.strand_height < LOW:
        return [], whole
    return [line for line in lines if line_length(line) < limit], whole


def _printed(
    lines: Sequence[FloatArray], height: float, number: int, kind: int
) -> tuple[Toolpaths, IntArray]:
    """Paths of one layer in printer coordinates, in the order of printing; and their lines."""
    points, offsets = pack(lines)
    points = points.round(COORDINATE_DIGITS) + 0.0
    points, offsets, *_ = merge_repeated(points, offsets)
    pieces = np.split(points, offsets[1:-1]) if len(offsets) > 1 else []
    which = np.array([k for k, line in enumerate(pieces) if len(line) > 1], dtype=np.int64)
    lines = [pieces[k] for k in which.tolist()]
    if not lines:
        return Toolpaths.empty(), which
    order, backward, _ = nearest_end_order(
        np.array([line[0] for line in lines]), np.array([line[-1] for line in lines])
    )
    lines = [
        lines[k][::-1] if back else lines[k]
        for k, back in zip(order.tolist(), backward.tolist(), strict=True)
    ]
    points, offsets = pack(lines)
    height = round(height, COORDINATE_DIGITS)
    points = np.column_stack([points, np.full(len(points), height)])
    paths = Toolpaths(
        points=points,
        normals=np.broadcast_to([0.0, 0.0, 1.0], points.shape),
        offsets=offsets,
        layer=np.full(len(lines), number),
        kind=np.full(len(lines), kind),
        closed=np.array([is_closed(line) for line in lines]),
    )
    return paths, which[order]
