"""A whole part as it is printed: layers of matrix below, between and above the layers of fibre."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from ccfem.arrays import BoolArray, FloatArray, freeze, in_brief
from ccfem.errors import InputError
from ccfem.geometry.hatch import zigzag
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.polylines import (
    is_closed,
    line_length,
    merge_repeated,
    pack,
    starts_segment,
)
from ccfem.geometry.shapes import Region, strings
from ccfem.layers import Layer
from ccfem.layers.plane import Plane
from ccfem.layers.slicing.planar import Planar
from ccfem.linking.print_order import nearest_end_order
from ccfem.machine.machine import Machine
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.printing.matrix_flow import pad_flow, with_flow
from ccfem.printing.pads import pad_lines, pad_regions
from ccfem.printing.slabs import LOW, Slab, check_cover, slabs_of
from ccfem.printing.turns import turned
from ccfem.toolpaths import FIBRE, MATRIX, SUPPORT, Toolpaths

__all__ = ["COORDINATE_DIGITS", "PrintPlan", "check_machine", "plan_print"]

COORDINATE_DIGITS = 3
"""Decimals of coordinates, mm."""

_OVERLAP = 0.25
"""Overlap of the ends of the zigzag with the contour, in line widths. Our choice."""

_SHORT = 1e-6
"""Share of the cutter's distance by which a path may be too short through rounding."""


@dataclass(frozen=True)
class PrintPlan:
    """All layers of a part, from the bed to the top.

    Attributes
    ----------
    paths : Toolpaths
        Matrix and fibre in the order of printing, in the coordinates of the printer: X and Y on
        its bed, Z the height of the nozzle, which is the top of a layer. `Toolpaths.layer` counts
        the layers of this plan. Coordinates are rounded to 0.001 mm.
    top, thickness : (S,) arrays, mm
        Of each layer.
    laid : (P,) array, mm, optional
        Height of the matrix, a line wide, that is laid on the step from each point of the paths;
        by default the thickness of its layer. Of no meaning for fibre, and at the ends of paths.
    short : (K,) bool array, optional
        Which lines of matrix take the place of strands that are too short for the cutter.
    dropped : float, mm
        Length of strands that are too short and left out.
    warnings : tuple of str
        What is doubtful, one line each.
    outside : float, mm
        Length of strands outside the part, whose volume is not the part's.
    trims : (t, 3) array, mm
        Layer of this plan, X and Y of each place where a strand crosses the part's border: there
        the knife comes behind the print.
    """

    paths: Toolpaths
    top: FloatArray
    thickness: FloatArray
    laid: FloatArray = None  # type: ignore[assignment]
    short: BoolArray = None  # type: ignore[assignment]
    dropped: float = 0.0
    trims: FloatArray = None  # type: ignore[assignment]
    outside: float = 0.0
    warnings: tuple[str, ...] = ()

    __repr__ = in_brief

    def __post_init__(self) -> None:
        if self.laid is None:
            whole = np.repeat(self.thickness[self.paths.layer], np.diff(self.paths.offsets))
            object.__setattr__(self, "laid", whole)
        if self.short is None:
            object.__setattr__(self, "short", np.zeros(len(self.paths), dtype=bool))
        if self.trims is None:
            object.__setattr__(self, "trims", np.zeros((0, 3)))
        freeze(self, trims=float, top=float, thickness=float, laid=float, short=bool)

    def volume(self, machine: Machine) -> float:
        """Volume of matrix and of fibre inside the part, mm^3."""
        points, start = self.paths.points, np.flatnonzero(starts_segment(self.paths.offsets))
        steps = np.linalg.norm(points[start + 1] - points[start], axis=1)
        matrix = np.repeat(self.paths.kind == MATRIX, np.diff(self.paths.offsets))[start]
        laid = float((steps * self.laid[start])[matrix].sum())
        fibre = float(self.paths.of_kind(FIBRE).lengths.sum())
        return machine.matrix_width * laid + machine.strand_area * (fibre - self.outside)


def check_machine(machine: Machine) -> None:
    """Raise where a machine cannot print: a speed of 0, or strands that its cutter cannot lay.

    Raises
    ------
    InputError
    """
    for name in ("fibre_speed", "matrix_speed", "travel_speed", "matrix_height"):
        unused = name == "fibre_speed" and machine.speeds is not None
        if getattr(machine, name) == 0.0 and not unused:
            raise InputError(f"machine.{name} must be above 0 to print; got 0: set it in [machine]")
    if machine.minimum_length < machine.tail * (1.0 - _SHORT):
        raise InputError(
            f"machine.minimum_length is {machine.minimum_length:g} mm, but the cutter lies "
            f"{machine.tail:g} mm before the nozzle, so that no shorter path can be "
            "cut: raise minimum_length in [machine] to it, or set the printer's own cutter_distance"
        )


def plan_print(
    toolpaths: Toolpaths, layers: Sequence[Layer], mesh: TetMesh, machine: Machine
) -> PrintPlan:
    """Plan the print of a whole part.

    Fibre layers lie at the heights that they were planned at, as high as the filament's section
    needs (`Machine.strand_height`). The space below, between and above them is filled with matrix
    layers of equal height, as few as `Machine.matrix_height` allows, so that the part gets its full
    height. A matrix layer is a contour and a zigzag of the section at its middle, which turns from
    one matrix layer to the next; over fibre it lays what the strands leave
    (`ccfem.printing.matrix_flow`). A fibre layer holds fibre, and lines of matrix in place of
    strands that are too short for the cutter (`Process.short`); a layer without fibre is left out.
    The lowest layer is that of `Process.first_layer_height`. Within a layer the next path is always
    the one with the nearest end. The part stands in the
    middle of the bed.

    Parameters
    ----------
    toolpaths : Toolpaths
        Fibre; paths of other kinds are left out.
    layers : sequence of Layer
        Flat layers that the fibre lies on.
    mesh : TetMesh
        The part.
    machine : Machine

    Raises
    ------
    InputError
        Where fibre lies on a layer that is not given, is too short and `Process.short` says so,
        layers are nearer to each other or to the part's ends than their height allows, strands
        stand higher than the matrix above them, or the part does not fit on the bed.
    """
    fibre = toolpaths.of_kind(FIBRE)
    _check_fibre(fibre, layers, machine)
    frame = layers[0].plane.frame
    corners = mesh.points[np.unique(mesh.corners)] @ frame.T
    lowest, highest = corners.min(axis=0), corners.max(axis=0)
    laid = [layer for layer in layers if layer.index in fibre.layer]
    slabs = slabs_of(laid, float(lowest[2]), float(highest[2]), machine)
    matrix_slabs = [slab for slab in slabs if slab.fibre is None]
    origin = 0.5 * (lowest[:2] + highest[:2] - machine.gcode.bed[:2])
    matrix = iter(_matrix_lines(matrix_slabs, mesh, frame, origin, machine))
    filled = [next(matrix) if slab.fibre is None else None for slab in slabs]
    borders = _borders(laid, frame, origin)
    on_slab: list[list[FloatArray]] = []
    trims, dropped, outside = [np.zeros((0, 3))], 0.0, 0.0
    for number, slab in enumerate(slabs):
        lines = []
        if slab.fibre is not None:
            lines = [path @ frame[:2].T - origin for path in fibre.on_layer(slab.fibre)]
            planned = sum(map(line_length, lines))
            lines, crossings = turned(lines, borders[slab.fibre], slab.fibre, machine)
            dropped += planned - sum(map(line_length, lines))
            trims.append(np.column_stack([np.full(len(crossings), number), crossings]))
        on_slab.append(lines)
    pads = pad_regions([one and one[0] for one in filled], on_slab, machine)
    printed, flow, short = [], [], []
    warnings: list[str] = []
    strands: list[FloatArray] = []  # since the last layer of matrix
    sections: list[float] = []
    below = 0.0
    for number, slab in enumerate(slabs):
        height, thickness = slab.upper - float(lowest[2]), slab.upper - slab.lower
        if slab.fibre is None:
            section, lines = filled[number]  # type: ignore[misc]
            found = _printed(lines, height, number, MATRIX)
            heights = np.zeros(0)
            if len(found):
                found, heights, warning = with_flow(
                    found, section, thickness, strands, below, machine, sections
                )
                warnings += [f"at {height:.4g} mm {warning}"] if warning else []
            pad = _printed(pad_lines(*pads[number], machine), height, number, SUPPORT)
            if len(pad):
                pad, high = pad_flow(pad, thickness, strands, below, machine, sections)
                found, heights = Toolpaths.concatenate([found, pad]), np.append(heights, high)
            strands, sections, below = [], [], 0.0
            few = np.zeros(len(found), dtype=bool)
        else:
            lines = on_slab[number]
            by_matrix, whole = _sorted_by_length(lines, machine)
            dropped += sum(map(line_length, lines)) - sum(map(line_length, by_matrix + whole))
            border = borders[slab.fibre]
            outside += float(shapely.length(shapely.difference(strings(whole), border)).sum())
            parts = (_printed(by_matrix, height, number, MATRIX),)
            parts += (_printed(whole, height, number, FIBRE),)  # type: ignore[assignment]
            found = Toolpaths.concatenate(parts)
            heights = np.full(len(found.points), thickness)
            few = found.kind == MATRIX
            sections += [machine.matrix_width * thickness] * len(by_matrix)
            sections += [machine.strand_area] * len(whole)
            strands, below = strands + by_matrix + whole, below + thickness
        printed.append(found)
        flow.append(heights)
        short.append(few)
    paths = Toolpaths.concatenate(printed)
    paths = replace(paths, points=paths.points.round(COORDINATE_DIGITS) + 0.0)
    plan = PrintPlan(
        paths,
        np.array([slab.upper - lowest[2] for slab in slabs]).round(COORDINATE_DIGITS),
        np.array([slab.upper - slab.lower for slab in slabs]),
        np.concatenate(flow),
        np.concatenate(short),
        dropped,
        np.concatenate(trims),
        outside,
        (*warnings, *check_cover(slabs, machine)),
    )
    _check_bed(plan, machine)
    return replace(plan, warnings=(*_short_strands(plan), *plan.warnings))


def _short_strands(plan: PrintPlan) -> list[str]:
    """Say what became of strands that are too short for the cutter, if there are any."""
    by_matrix = plan.paths.lengths[plan.short]
    said = []
    if len(by_matrix):
        said.append(f"{by_matrix.sum():.1f} mm in {len(by_matrix)} strands are laid as matrix")
    if plan.dropped > 1e-3:
        said.append(f"{plan.dropped:.1f} mm are left out and filled with matrix")
    return [f"too short for the cutter: {'; '.join(said)}"] if said else []


def _check_fibre(fibre: Toolpaths, layers: Sequence[Layer], machine: Machine) -> None:
    """Check that every path lies on a given layer and is long enough for the cutter."""
    if not layers:
        raise InputError("a print needs at least one layer; got none: give those of the plan")
    missing = set(fibre.layer.tolist()) - {layer.index for layer in layers}
    if missing:
        raise InputError(
            f"fibre lies on layer {min(missing)}, which is not among the layers given: "
            "give those that it was planned on"
        )
    limit = max(machine.tail, machine.minimum_length)
    short = fibre.lengths < limit * (1.0 - _SHORT)
    if short.any() and machine.process.short == "error":
        raise InputError(
            f"fibre paths must be no shorter than the {limit:g} mm that the cutter allows; "
            f"{int(short.sum())} of {len(fibre)} are, the shortest {fibre.lengths.min():.4g} mm: "
            "plan with machine.minimum_length of at least that, or set process.short = 'matrix'"
        )


def _borders(layers: Sequence[Layer], frame: FloatArray, origin: FloatArray) -> dict[int, Region]:
    """Sections of layers on the bed, by their index."""

    def on_bed(points: FloatArray, plane: Plane) -> FloatArray:
        return plane.to_space(points) @ frame[:2].T - origin

    return {
        layer.index: shapely.transform(
            layer.plane.polygon, lambda points, plane=layer.plane: on_bed(points, plane)
        )
        for layer in layers
    }


def _sorted_by_length(
    lines: list[FloatArray], machine: Machine
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Strands that matrix is laid instead of, and those that the cutter allows.

    Of a strand that is left out, and in layers too low for a line of matrix, the matrix above fills
    the place.
    """
    limit = max(machine.tail, machine.minimum_length) * (1.0 - _SHORT)
    whole = [line for line in lines if line_length(line) >= limit]
    if machine.process.short == "error" and len(whole) < len(lines):
        raise InputError(
            f"process.turns cuts strands into pieces below the {limit:g} mm that the cutter "
            "allows: set it to 'pad', or process.short to 'matrix'"
        )
    if machine.process.short != "matrix" or machine.strand_height < LOW:
        return [], whole
    return [line for line in lines if line_length(line) < limit], whole


def _matrix_lines(
    slabs: Sequence[Slab],
    mesh: TetMesh,
    frame: FloatArray,
    origin: FloatArray,
    machine: Machine,
) -> list[tuple[Region, list[FloatArray]]]:
    """Section and lines (n, 2) of each matrix layer on the bed: a contour, a zigzag inside it."""
    width, profile = machine.matrix_width, machine.gcode
    lines: list[tuple[Region, list[FloatArray]]] = [(shapely.Polygon(), []) for _ in slabs]
    middles = tuple(0.5 * (slab.lower + slab.upper) for slab in slabs)
    for layer in Planar(heights=middles).cut(mesh, frame[2]) if middles else ():
        plane = layer.plane
        angle = np.radians(profile.matrix_angle + profile.matrix_turn * layer.index)
        contours = offset_rings(plane.polygon, 0.5 * width, width, width, 1)
        inside = zigzag(plane.polygon, (1.5 - _OVERLAP) * width, width, width, float(angle))
        found = [ring for level in contours for ring in level] + inside

        def on_bed(points: FloatArray, plane: Plane = plane) -> FloatArray:
            return plane.to_space(points) @ frame[:2].T - origin

        section = shapely.transform(plane.polygon, on_bed)
        lines[layer.index] = section, [on_bed(line) for line in found]
    return lines


def _printed(lines: list[FloatArray], height: float, number: int, kind: int) -> Toolpaths:
    """Paths of one layer in printer coordinates, rounded, in the order of printing."""
    points, offsets = pack(lines)
    points = points.round(COORDINATE_DIGITS) + 0.0
    points, offsets, *_ = merge_repeated(points, offsets)
    lines = [line for line in np.split(points, offsets[1:-1]) if len(line) > 1]
    if not lines:
        return Toolpaths.empty()
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
    return Toolpaths(
        points=points,
        normals=np.broadcast_to([0.0, 0.0, 1.0], points.shape),
        offsets=offsets,
        layer=np.full(len(lines), number),
        kind=np.full(len(lines), kind),
        closed=np.array([is_closed(line) for line in lines]),
    )


def _check_bed(plan: PrintPlan, machine: Machine) -> None:
    """Check that everything lies in the space that the printer reaches."""
    points, bed = plan.paths.points, np.array(machine.gcode.bed)
    if not len(points):
        raise InputError("there is nothing to print: the part is thinner than a line of matrix")
    reach = np.append(points.max(axis=0)[:2], points[:, 2].max() + machine.gcode.lift)
    if (points.min(axis=0) < 0.0).any() or (reach > bed).any():
        size = np.append(np.ptp(points, axis=0)[:2], reach[2])
        raise InputError(
            f"the part needs {size[0]:.4g} x {size[1]:.4g} x {size[2]:.4g} mm, but the printer has "
            f"{bed[0]:g} x {bed[1]:g} x {bed[2]:g} mm: turn it, or set bed in [machine.gcode]"
        )
