"""A whole part as it is printed, in flat or curved layers: one sequence of steps for both."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ccfem.base.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    RowBuffer,
    freeze,
    in_brief,
    shared_rows,
)
from ccfem.base.errors import InputError
from ccfem.base.row_blocks import RowBlocks
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.polylines import extent, starts_segment, step_lengths
from ccfem.machine.machine import Machine
from ccfem.paths.plastic.plastic import SOLID, Plastic
from ccfem.paths.splitting.printed_strands import SHORT, PrintedStrands, printed_strands
from ccfem.paths.toolpaths import FIBRE, MATRIX, Toolpaths
from ccfem.printing.bed_layout import BedLayout, Place
from ccfem.printing.curved_stack import curved_stack
from ccfem.printing.flat_stack import flat_stack
from ccfem.printing.laid_layer import COORDINATE_DIGITS, Stack
from ccfem.printing.poses import (
    Obstacles,
    check_tilt,
    cleared,
    contact_words,
    poses,
    touched_length,
)
from ccfem.printing.support import SupportLayers
from ccfem.slicing.layers import Layer
from ccfem.slicing.layers.layer import curved_layers, plane_frame
from ccfem.slicing.layers.slicer import NO_FIELD, Vector, standing

_UP = np.array([0.0, 0.0, 1.0])
_TOGETHER = 1_000_000
"""Points whose steps are measured at a time: those of a large print fill memory."""


@dataclass(frozen=True)
class Standing:
    """A part that stands on the bed: its name, and corners of the box round its lines, mm."""

    name: str
    low: tuple[float, float]
    high: tuple[float, float]


@dataclass(frozen=True)
class PrintPlan:
    """All layers of a print, of one part or several, from the bed to the top.

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
    room : (K,) array, optional
        Width that each line of matrix fills, over that of the machine's lines; by default 1, less
        in gaps. Its section stays that of `laid` (`ccfem.printing.part_moves.line_sizes`).
    short : (K,) bool array, optional
        Which lines of matrix take the place of strands that are too short for the cutter.
    sparse : (K,) bool array, optional
        Which lines are sparse infill; by default none.
    dropped, ended : float, mm
        As in `PrintedStrands`.
    warnings : tuple of str
        What is doubtful, one line each.
    outside : float, mm
        Length of strands outside the part, whose volume is not the part's.
    trims : (t, 3) array, mm
        Layer of this plan, X and Y of each place where a strand crosses the part's border: there
        the knife comes behind the print.
    touched : tuple of 3 floats, mm
        Length of the paths on curved layers along which the head touches what is printed: layer by
        layer, in the order chosen, and as it leans.
    standing : tuple of Standing
        The parts on the bed, where it was laid out for them.
    stack : (K,) int array, optional
        Stack of layers that each path belongs to: those of parts with the same layers are one, with
        a block of its own beside the parts. By default all are one.
    pauses : tuple of int
        Layers before which the print halts.
    first : int
        Layer with which the file begins; those below are printed already.
    """

    paths: Toolpaths
    top: FloatArray
    thickness: FloatArray
    laid: FloatArray = None  # type: ignore[assignment]
    room: FloatArray = None  # type: ignore[assignment]
    short: BoolArray = None  # type: ignore[assignment]
    dropped: float = 0.0
    trims: FloatArray = None  # type: ignore[assignment]
    outside: float = 0.0
    warnings: tuple[str, ...] = ()
    ended: float = 0.0
    touched: tuple[float, float, float] = (0.0, 0.0, 0.0)
    standing: tuple[Standing, ...] = ()
    pauses: tuple[int, ...] = ()
    first: int = 0
    sparse: BoolArray = None  # type: ignore[assignment]
    stack: IntArray = None  # type: ignore[assignment]

    __repr__ = in_brief

    def __post_init__(self) -> None:
        if self.laid is None:
            whole = np.repeat(self.thickness[self.paths.layer], np.diff(self.paths.offsets))
            object.__setattr__(self, "laid", whole)
        if self.room is None:
            object.__setattr__(self, "room", np.ones(len(self.paths)))
        for name in ("short", "sparse", "stack"):
            if getattr(self, name) is None:
                object.__setattr__(self, name, np.zeros(len(self.paths), dtype=bool))
        if self.trims is None:
            object.__setattr__(self, "trims", np.zeros((0, 3)))
        freeze(self, trims=float, top=float, thickness=float, laid=float)
        kinds = {"room": float, "short": bool, "sparse": bool, "stack": np.int64}
        for name, kind in kinds.items():
            object.__setattr__(self, name, shared_rows(getattr(self, name), kind))

    @property
    def copies(self) -> int:
        """Number of parts on the bed."""
        return max(len(self.standing), 1)

    @property
    def lowest(self) -> BoolArray:
        """Mask (K,) of the paths on the lowest layer of their stack, which lies on the bed."""
        first = np.full(int(self.stack.max(initial=0)) + 1, len(self.top))
        np.minimum.at(first, self.stack, self.paths.layer)
        return np.asarray(self.paths.layer == first[self.stack])

    def volume(self, machine: Machine) -> float:
        """Volume of matrix and of fibre inside the parts, mm^3."""
        begins = starts_segment(self.paths.offsets)[:-1]
        matrix = np.repeat(self.paths.kind == MATRIX, np.diff(self.paths.offsets))[:-1] & begins
        volume = 0.0
        for first in range(0, len(matrix), _TOGETHER):
            some = slice(first, min(first + _TOGETHER, len(matrix)))
            steps = step_lengths(self.paths.points[first : some.stop + 1])
            volume += float((steps[matrix[some]] * self.laid[some][matrix[some]]).sum())
        fibre = float(self.paths.lengths[self.paths.kind == FIBRE].sum())
        return machine.matrix_width * volume + machine.strand_area * (fibre - self.outside)


def check_machine(machine: Machine) -> None:
    """Raise where a machine cannot print: a speed of 0, or strands that its cutter cannot lay."""
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
    strands: PrintedStrands | Toolpaths,
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    support: SupportLayers | bool = False,
    spin: float = 0.0,
    plastic: Plastic = SOLID,
    build: Vector = (0.0, 0.0, 1.0),
) -> PrintPlan:
    """Plan the print of a whole part.

    The part stands in the middle of the bed, on its support or on its lowest point. No strand is
    cut here. Within a layer matrix comes before fibre, and the next path is always the one with the
    nearest end.

    Flat layers of fibre lie at the heights that they were planned at, as high as the filament's
    section needs (`Machine.strand_height`). The space below, between and above them is filled with
    matrix layers of equal height, as few as `Machine.matrix_height` allows, so that the part gets
    its full height; the lowest is that of `Process.first_layer_height`. A matrix layer is walls and
    a zigzag of the section at its middle, which turns from one matrix layer to the next, or sparse
    infill (`Plastic`); over fibre it lays what the strands leave (`ccfem.printing.laid_layer`). A
    fibre layer holds fibre, and lines of matrix in place of strands that are too short for the
    cutter; a layer without fibre is left out.

    Curved layers cannot be moved or divided, so that each holds both: rings of matrix of the local
    layer height, less the share of the volume that the fibre takes, then the fibre. A layer of
    support is printed just before the layer of the part at its level. If the head would touch other
    pieces while above a piece of a layer, that piece is printed first if possible
    (`ccfem.printing.curved_stack`). The head stands along the normal of the layer, as far as
    `Kinematics.tilt_limit` allows, and leans where it would still touch something
    (`ccfem.printing.poses`); remaining contact is stated in the warnings. The nozzle is at the
    top of a layer, half its thickness above its middle.

    Parameters
    ----------
    strands : PrintedStrands, or Toolpaths
        Planned paths are first split into the strands that are printed (`printed_strands`).
    layers : sequence of Layer
        That the fibre lies on, all flat, or some of them curved and from the first printed to the
        last.
    mesh : TetMesh
        The part.
    support : bool or SupportLayers, default False
        Below flat layers whether columns of matrix, as pads are, stand below what would be laid in
        air (`ccfem.printing.support.overhang`). Below curved ones their support, or False; the part
        stands as it does there.
    spin : float, degrees
        Turn about the vertical (`ccfem.printing.bed_layout.BedLayout`).
    plastic : Plastic
        Walls, skins, infill and seam of flat layers. Default: solid.
    build : tuple of 3 floats
        Build direction of curved layers. If they face downwards from there, the part stands along
        their mean normal (`standing`).

    Raises
    ------
    InputError
        As `printed_strands`, and where flat layers are nearer to each other or to the part's ends
        than their height allows, strands stand higher than the matrix above them, the head of a
        machine of three axes would touch the layer that it lays, or the part does not fit on the
        bed; and for curved layers whose support is asked for, but not given.
    """
    if isinstance(strands, Toolpaths):
        strands = printed_strands(strands, layers, mesh, machine)
    if support is True and curved_layers(layers):
        raise InputError(NO_FIELD)
    below = None if isinstance(support, bool) else support
    place = _place(layers, mesh, machine, below, spin, build)
    about = (strands, layers, mesh, machine, place)
    if curved_layers(layers):
        stack = curved_stack(*about, below, build)
    else:
        stack = flat_stack(*about, bool(support), plastic)
    plan = _joined(stack, strands)
    check_tilt(plan.paths.normals, machine)
    check_bed(plan, machine)
    return plan if stack.obstacles is None else _leaning(plan, stack.obstacles, machine)


def _place(
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    support: SupportLayers | None,
    spin: float,
    build: Vector,
) -> Place:
    """Stand a part, with its support, in the middle of the bed."""
    if support is not None:
        upright = plane_frame(support.columns.up.tolist())
    elif curved_layers(layers):
        upright = plane_frame(standing(layers, build))
    else:
        upright = layers[0].plane.frame
    axes = BedLayout(spin).frame(upright)
    corners = mesh.points[np.unique(mesh.corners)] @ axes.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    bottom = float(low[2])
    if support is not None:
        bottom = min(bottom, float((support.columns.mesh.points @ axes[2]).min()))
    middle = 0.5 * (low[:2] + high[:2] - machine.gcode.bed[:2])
    return Place(axes, np.append(middle, bottom), spin)


def _joined(stack: Stack, strands: PrintedStrands) -> PrintPlan:
    """Plan of layers that are made one after the other: none is kept beside the plan."""
    columns: dict[str, RowBlocks | RowBuffer] = {
        "laid": RowBlocks(float),
        "room": RowBuffer(float),
        "short": RowBuffer(bool),
        "sparse": RowBuffer(bool),
    }
    trims, sizes = [np.zeros((0, 3))], list[tuple[int, float, float]]()
    warnings = list(strands.warnings)
    outside = 0.0

    def paths() -> Iterator[Toolpaths]:
        nonlocal outside
        for number, layer in enumerate(stack.layers):
            for name, column in columns.items():
                column.append(getattr(layer, name))
            trims.append(np.insert(layer.trims, 0, number, axis=1))
            sizes.append((len(layer.paths), layer.height, layer.thickness))
            if layer.warning:
                warnings.append(f"at {layer.height:.4g} mm {layer.warning}")
            outside += layer.outside
            yield layer.paths

    joined = Toolpaths.concatenate(paths())
    count, height, thickness = np.array(sizes).reshape(-1, 3).T
    of_layers: dict[str, Any] = {name: column.rows() for name, column in columns.items()}
    return PrintPlan(
        replace(joined, layer=np.repeat(np.arange(len(count)), count.astype(int))),
        np.maximum.accumulate([round(top, COORDINATE_DIGITS) for top in height.tolist()]),
        thickness,
        trims=np.concatenate(trims),
        dropped=strands.dropped,
        outside=outside,
        warnings=(*warnings, *stack.remarks),
        ended=strands.ended,
        **of_layers,
    )


def _leaning(plan: PrintPlan, obstacles: Obstacles, machine: Machine) -> PrintPlan:
    """Let the head stand along the normals of a plan, and lean where it would touch something."""
    paths = plan.paths
    axes = poses(paths.normals, _UP, machine)
    level = replace(paths, layer=obstacles.layer[paths.layer])
    before = touched_length(level, axes, obstacles.by_layer, machine)
    leaned = cleared(paths, axes, obstacles.by_step, machine)
    touched = (before, leaned.before, leaned.after)
    upright = machine.kinematics.kind == "three_axes"
    return replace(
        plan,
        paths=paths if upright else replace(paths, normals=leaned.axes),
        touched=touched,
        warnings=(*plan.warnings, *contact_words(touched, leaned.place)),
    )


def check_bed(plan: PrintPlan, machine: Machine) -> None:
    """Check that everything lies in the space that the printer reaches."""
    points, bed = plan.paths.points, np.array(machine.gcode.bed)
    if not len(points):
        raise InputError("there is nothing to print: the part is thinner than a line of matrix")
    low, high = extent(points)
    reach = np.append(high[:2], high[2] + machine.gcode.lift)
    if (low < 0.0).any() or (reach > bed).any():
        size = np.append((high - low)[:2], reach[2])
        raise InputError(
            f"the part needs {size[0]:.4g} x {size[1]:.4g} x {size[2]:.4g} mm, but the printer has "
            f"{bed[0]:g} x {bed[1]:g} x {bed[2]:g} mm: turn it, or set bed in [machine.gcode]"
        )
