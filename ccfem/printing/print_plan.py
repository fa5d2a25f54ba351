"""A whole part as it is printed: layers of matrix below, between and above the layers of fibre."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, freeze, in_brief
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.polylines import line_length, starts_segment
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, MATRIX, Toolpaths
from ccfem.printing.laid_layer import (
    COORDINATE_DIGITS,
    SHORT,
    Below,
    LaidLayer,
    fibre_layer,
    matrix_layer,
)
from ccfem.printing.matrix_flow import THIN
from ccfem.printing.matrix_lines import MatrixFill, matrix_fills
from ccfem.printing.pads import pad_lines, pad_regions
from ccfem.printing.slabs import Slab, check_cover, slabs_of
from ccfem.printing.stacks import ended_in_stacks, height_over
from ccfem.printing.turns import turned
from ccfem.slicing.layers import Layer
from ccfem.slicing.layers.plane import Plane
from ccfem.slicing.slicers.planar import Planar


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
    ended : float, mm
        Length of strands that is left out where they would stack higher than the matrix above.
    touched : tuple of 3 floats, mm
        Length of the paths on curved layers along which the head touches what is printed: layer by
        layer, in the order chosen, and as it leans.
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
    ended: float = 0.0
    touched: tuple[float, float, float] = (0.0, 0.0, 0.0)

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
    if machine.minimum_length < machine.tail * (1.0 - SHORT):
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
    used = [layer for layer in layers if layer.index in fibre.layer]
    origin = 0.5 * (lowest[:2] + highest[:2] - machine.gcode.bed[:2])
    borders = _borders(used, mesh, frame, origin)
    kept, crossings, dropped = _turned(fibre, borders, frame, origin, machine)
    over = {index: height_over(kept[index], borders[index], machine) for index in kept}
    slabs = slabs_of(used, float(lowest[2]), float(highest[2]), machine, over)
    fills = matrix_fills(slabs, mesh, frame, origin, machine)
    strands = _on_slabs(kept, slabs, borders, machine)
    trims = [
        np.column_stack([np.full(len(crossings[slab.fibre]), number), crossings[slab.fibre]])
        for number, slab in enumerate(slabs)
        if slab.fibre is not None
    ]
    done = _layers(slabs, fills, strands, borders, float(lowest[2]), machine)
    paths = Toolpaths.concatenate(each.paths for each in done)
    plan = PrintPlan(
        paths,
        np.array([slab.upper - lowest[2] for slab in slabs]).round(COORDINATE_DIGITS),
        np.array([slab.upper - slab.lower for slab in slabs]),
        np.concatenate([each.laid for each in done]),
        np.concatenate([each.short for each in done]),
        dropped + sum(each.dropped for each in done),
        np.concatenate([np.zeros((0, 3)), *trims]),
        sum(each.outside for each in done),
        (*(each.warning for each in done if each.warning), *check_cover(slabs, machine)),
        strands.ended,
    )
    _check_bed(plan, machine)
    said = (*_short_strands(plan), *strands.warnings)
    return replace(plan, warnings=(*said, *plan.warnings))


def _turned(
    fibre: Toolpaths,
    borders: Mapping[int, Region],
    frame: FloatArray,
    origin: FloatArray,
    machine: Machine,
) -> tuple[dict[int, list[FloatArray]], dict[int, FloatArray], float]:
    """Strands on the bed by layer, where they cross its border, and the length that is cut off."""
    kept, crossings, dropped = {}, {}, 0.0
    for index, border in borders.items():
        planned = [path @ frame[:2].T - origin for path in fibre.on_layer(index)]
        kept[index], crossings[index] = turned(planned, border, index, machine)
        dropped += sum(map(line_length, planned)) - sum(map(line_length, kept[index]))
    return kept, crossings, dropped


@dataclass(frozen=True)
class _Strands:
    """Strands on each slab, and what became of the others, as in `PrintPlan`."""

    lines: list[list[FloatArray]]
    ended: float
    warnings: tuple[str, ...]


def _on_slabs(
    kept: Mapping[int, list[FloatArray]],
    slabs: Sequence[Slab],
    borders: Mapping[int, Region],
    machine: Machine,
) -> _Strands:
    """Let strands end where they stack too high, if the process says so."""
    found: list[list[FloatArray]] = []
    ended, warnings = 0.0, []
    for number, slab in enumerate(slabs):
        lines = [] if slab.fibre is None else kept[slab.fibre]
        above = slabs[min(number + 1, len(slabs) - 1)]
        if slab.fibre is not None and above.fibre is None and machine.process.stacks == "end":
            room = above.upper - slab.lower - THIN
            short = ended_in_stacks(lines, borders[slab.fibre], room, machine)
            lines, ended = short.lines, ended + short.removed
            if short.places:
                warnings.append(
                    f"{short.removed:.0f} mm of fibre layer {slab.fibre} are left out in "
                    f"{short.places} places, where strands would stack higher than the matrix above"
                )
        found.append(lines)
    return _Strands(found, ended, tuple(warnings))


def _layers(
    slabs: Sequence[Slab],
    fills: Sequence[MatrixFill | None],
    strands: _Strands,
    borders: Mapping[int, Region],
    bottom: float,
    machine: Machine,
) -> list[LaidLayer]:
    """All layers, from the bed to the top."""
    pads = pad_regions([fill and fill.section for fill in fills], strands.lines, machine)
    found, below = [], Below()
    for number, (slab, fill) in enumerate(zip(slabs, fills, strict=True)):
        size = (number, slab.upper - bottom, slab.upper - slab.lower, machine)
        if slab.fibre is None:
            assert fill is not None
            found.append(matrix_layer(fill, pad_lines(*pads[number], machine), below, *size))
            below = Below()
        else:
            lines, border = strands.lines[number], borders[slab.fibre]
            each, below = fibre_layer(lines, border, below, *size)
            found.append(each)
    return found


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
    short = fibre.lengths < limit * (1.0 - SHORT)
    if short.any() and machine.process.short == "error":
        raise InputError(
            f"fibre paths must be no shorter than the {limit:g} mm that the cutter allows; "
            f"{int(short.sum())} of {len(fibre)} are, the shortest {fibre.lengths.min():.4g} mm: "
            "plan with machine.minimum_length of at least that, or set process.short = 'matrix'"
        )


def _borders(
    layers: Sequence[Layer], mesh: TetMesh, frame: FloatArray, origin: FloatArray
) -> dict[int, Region]:
    """Sections of the part on the bed, by the index of the layer: all of it, not its regions."""

    def on_bed(points: FloatArray, plane: Plane) -> FloatArray:
        return plane.to_space(points) @ frame[:2].T - origin

    if not layers:
        return {}
    ordered = sorted(layers, key=lambda one: one.plane.height)
    sections = Planar(heights=tuple(one.plane.height for one in ordered)).cut(mesh, frame[2])
    found = {}
    for layer, whole in zip(ordered, sections, strict=True):
        found[layer.index] = shapely.transform(
            whole.plane.polygon, lambda points, plane=whole.plane: on_bed(points, plane)
        )
    return found


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
