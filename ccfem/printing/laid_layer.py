"""Paths of one layer of a print, matrix or fibre, in the order of printing."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.polylines import is_closed, merge_repeated, pack
from ccfem.geometry.shapes import Region, strings
from ccfem.machine.machine import Machine
from ccfem.paths.linking.print_order import nearest_end_order
from ccfem.paths.splitting.printed_strands import border_crossings
from ccfem.paths.toolpaths import FIBRE, MATRIX, SUPPORT, Toolpaths
from ccfem.printing.matrix_flow import pad_flow, with_flow
from ccfem.printing.matrix_lines import MatrixFill

COORDINATE_DIGITS = 3
"""Decimals of coordinates, mm."""


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

    def under(
        self,
        lines: Sequence[FloatArray],
        by_matrix: Sequence[FloatArray],
        thickness: float,
        machine: Machine,
    ) -> "Below":
        """Fibre layers with a further one on top: its strands, and matrix in place of short ones.

        Lines are (n, 2) arrays, mm.
        """
        sections = [machine.matrix_width * thickness] * len(by_matrix)
        sections += [machine.strand_area] * len(lines)
        return Below(
            [*self.strands, *by_matrix, *lines], self.sections + sections, self.height + thickness
        )


@dataclass(frozen=True)
class LaidLayer:
    """Paths of a layer in the order of printing.

    Attributes
    ----------
    laid : (P,) array, mm
        Height of matrix, a line wide, on the step from each point.
    room : (K,) array
        Width that each line of matrix fills, over that of the machine's lines.
    short : (K,) bool array
        Lines of matrix in place of strands that are too short for the cutter.
    sparse : (K,) bool array
        Lines of sparse infill.
    outside : float, mm
        Length of fibre outside the part.
    trims : (t, 3) array, mm
        As of `ccfem.printing.print_plan.PrintPlan`.
    """

    paths: Toolpaths
    laid: FloatArray
    room: FloatArray
    short: BoolArray
    sparse: BoolArray
    warning: str = ""
    outside: float = 0.0
    trims: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))


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
    solid = fill.lines[: len(fill.lines) - fill.sparse]
    ways = [np.zeros(len(line), dtype=bool) for line in solid] + fill.ways
    matrix, which = _printed(fill.lines, height, number, MATRIX, ways)
    sparse = which >= len(fill.lines) - fill.sparse
    heights, warning = np.zeros(0), ""
    room = np.array(fill.widths)[which] / machine.matrix_width
    strands = (below.strands, below.height, machine, below.sections)
    if len(matrix):
        matrix, heights, warning = with_flow(matrix, fill.solid, thickness, *strands, room, sparse)
    pad, _ = _printed(pads, height, number, SUPPORT)
    if len(pad):
        pad, high = pad_flow(pad, thickness, *strands)
        matrix, heights = Toolpaths.concatenate([matrix, pad]), np.append(heights, high)
        room = np.append(room, np.ones(len(pad)))
        sparse = np.append(sparse, np.zeros(len(pad), dtype=bool))
    warning = f"at {height:.4g} mm {warning}" if warning else ""
    return LaidLayer(matrix, heights, room, np.zeros(len(matrix), dtype=bool), sparse, warning)


def fibre_layer(
    lines: Sequence[FloatArray],
    by_matrix: Sequence[FloatArray],
    border: Region,
    number: int,
    height: float,
    thickness: float,
    machine: Machine,
) -> LaidLayer:
    """Lay strands (n, 2), and matrix in place of those too short.

    Parameters are those of `matrix_layer`, and the border of the part on the layer.
    """
    outside = float(shapely.length(shapely.difference(strings(lines), border)).sum())
    few, _ = _printed(by_matrix, height, number, MATRIX)
    fibre = Toolpaths.concatenate([few, _printed(lines, height, number, FIBRE)[0]])
    heights = np.full(len(fibre.points), thickness)
    short = fibre.kind == MATRIX
    places = border_crossings([*lines, *by_matrix], border)
    trims = np.column_stack([np.full(len(places), number), places])
    none = np.zeros(len(fibre), dtype=bool)
    return LaidLayer(fibre, heights, np.ones(len(fibre)), short, none, "", outside, trims)


def _printed(
    lines: Sequence[FloatArray],
    height: float,
    number: int,
    kind: int,
    ways: Sequence[BoolArray] | None = None,
) -> tuple[Toolpaths, IntArray]:
    """Paths of one layer in printer coordinates, in the order of printing; and their lines."""
    points, offsets = pack(lines)
    points = points.round(COORDINATE_DIGITS) + 0.0
    points, offsets, kept = merge_repeated(points, offsets)
    pieces = np.split(points, offsets[1:-1]) if len(offsets) > 1 else []
    which = np.array([k for k, line in enumerate(pieces) if len(line) > 1], dtype=np.int64)
    lines = [pieces[k] for k in which.tolist()]
    if not lines:
        return Toolpaths.empty(), which
    order, backward, _ = nearest_end_order(
        np.array([line[0] for line in lines]), np.array([line[-1] for line in lines])
    )
    turned = list(zip(order.tolist(), backward.tolist(), strict=True))
    lines = [lines[k][::-1] if back else lines[k] for k, back in turned]
    link = None
    if ways is not None and any(way.any() for way in ways):
        # The step from a point is that to the next one that is kept.
        step = np.concatenate(ways)[np.append(kept[1:], sum(map(len, ways))) - 1]
        steps = [np.split(step, offsets[1:-1])[k][:-1] for k in which.tolist()]
        link = np.concatenate(
            [np.append(steps[k][::-1] if back else steps[k], False) for k, back in turned]
        )
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
        link=link,  # type: ignore[arg-type]
    )
    return paths, which[order]
