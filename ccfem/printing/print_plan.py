"""A whole part as it is printed: layers of matrix below, between and above the layers of fibre."""

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

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
from ccfem.base.parallel import in_processes, repeating
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.hatch import zigzag
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.polylines import line_length, starts_segment, step_lengths
from ccfem.geometry.shapes import Region, open_lines, strings
from ccfem.machine.machine import Machine
from ccfem.paths.plastic.plastic import SOLID, Plastic
from ccfem.paths.splitting.printed_strands import (
    SHORT,
    PrintedStrands,
    height_over,
    printed_strands,
    sections_of,
)
from ccfem.paths.splitting.slabs import Slab, check_cover, slabs_of
from ccfem.paths.toolpaths import FIBRE, MATRIX, Toolpaths
from ccfem.printing.bed_layout import BedLayout
from ccfem.printing.laid_layer import COORDINATE_DIGITS, Below, LaidLayer, fibre_layer, matrix_layer
from ccfem.printing.matrix_lines import MatrixFill, matrix_fills
from ccfem.printing.support.overhang import overhang
from ccfem.slicing.layers import Layer


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
        volume = float((step_lengths(self.paths.points)[matrix] * self.laid[:-1][matrix]).sum())
        fibre = float(self.paths.of_kind(FIBRE).lengths.sum())
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
    support: bool = False,
    spin: float = 0.0,
    plastic: Plastic = SOLID,
) -> PrintPlan:
    """Plan the print of a whole part.

    Fibre layers lie at the heights that they were planned at, as high as the filament's section
    needs (`Machine.strand_height`). The space below, between and above them is filled with matrix
    layers of equal height, as few as `Machine.matrix_height` allows, so that the part gets its full
    height. A matrix layer is walls and a zigzag of the section at its middle, which turns from
    one matrix layer to the next, or sparse infill (`Plastic`); over fibre it lays what the strands
    leave (`ccfem.printing.laid_layer`). A fibre layer holds fibre, and lines of matrix in place of
    strands that are too short for the cutter; a layer without fibre is left out. No strand is cut
    here. The lowest layer is that of `Process.first_layer_height`. Within a layer the next path is
    always the one with the nearest end. The part stands in the middle of the bed.

    Parameters
    ----------
    strands : PrintedStrands, or Toolpaths
        Planned paths are first split into the strands that are printed (`printed_strands`).
    layers : sequence of Layer
        Flat layers that the fibre lies on.
    mesh : TetMesh
        The part.
    support : bool, default False
        Whether columns of matrix, as pads are, stand below what would be laid in air
        (`ccfem.printing.support.overhang`).
    spin : float, degrees
        Turn about the vertical (`ccfem.printing.bed_layout.BedLayout`).
    plastic : Plastic
        Walls, skins, infill and seam. Default: solid.

    Raises
    ------
    InputError
        As `printed_strands`, and where layers are nearer to each other or to the part's ends than
        their height allows, strands stand higher than the matrix above them, or the part does not
        fit on the bed.
    """
    if isinstance(strands, Toolpaths):
        strands = printed_strands(strands, layers, mesh, machine)
    upright = layers[0].plane.frame
    frame = BedLayout(spin).frame(upright)
    corners = mesh.points[np.unique(mesh.corners)] @ frame.T
    lowest, highest = corners.min(axis=0), corners.max(axis=0)
    used = [layer for layer in layers if layer.index in strands.layers]
    origin = 0.5 * (lowest[:2] + highest[:2] - machine.gcode.bed[:2])

    def seen(region: Region) -> Region:
        """Region on the bed of one in the plane of the layers."""
        turn = frame[:2] @ upright[:2].T
        return shapely.transform(
            region, lambda points: (points @ turn.T if spin else points) - origin
        )

    borders = {index: seen(section) for index, section in sections_of(used, mesh).items()}
    placed = _Strands(strands, frame[:2], origin, borders)
    same = strands.repeated(used)
    first = sorted(set(same.values()))
    above = in_processes(
        lambda index: height_over(placed.lines(index), borders[index], machine), first
    )
    height_of = dict(zip(first, above, strict=True))
    over = {index: height_of[same[index]] for index in borders}
    slabs = slabs_of(used, float(lowest[2]), float(highest[2]), machine, over)
    turned = spun(machine, spin)
    fills = matrix_fills(slabs, layers, mesh, frame, origin, turned, plastic)
    hanging = overhang(mesh, frame[2], machine) if support else None
    in_air = _NONE
    if hanging is not None:
        in_air = seen(hanging.region)
    layers_laid = _layers(slabs, fills, placed, same, in_air, float(lowest[2]), machine)
    plan = _joined(layers_laid, slabs, float(lowest[2]), strands, machine)
    check_bed(plan, machine)
    return plan


def spun(machine: Machine, spin: float) -> Machine:
    """Machine whose lines of matrix keep their direction on the bed below a part that is turned."""
    if not spin:
        return machine
    angle = (machine.gcode.matrix_angle - spin) % 360.0
    return replace(machine, gcode=replace(machine.gcode, matrix_angle=angle))


@dataclass(frozen=True)
class _Strands:
    """Strands as they are printed, the axes of the bed (2, 3), its origin, and borders by layer."""

    printed: PrintedStrands
    axes: FloatArray
    origin: FloatArray
    borders: Mapping[int, Region]

    def fibre(self, index: int) -> list[FloatArray]:
        """Strands (n, 2) of a layer on the bed."""
        return self._on_bed(self.printed.fibre, index)

    def short(self, index: int) -> list[FloatArray]:
        """Lines of matrix (n, 2) in place of short strands of a layer, on the bed."""
        return self._on_bed(self.printed.short, index)

    def lines(self, index: int | None) -> list[FloatArray]:
        """All lines on a layer of fibre; nothing on one of matrix."""
        return [] if index is None else self.fibre(index) + self.short(index)

    def _on_bed(self, paths: Toolpaths, index: int) -> list[FloatArray]:
        return [path @ self.axes.T - self.origin for path in paths.on_layer(index)]

    def below(self, slabs: Sequence[Slab], number: int, machine: Machine) -> Below:
        """Fibre layers between a layer of matrix and the one below it."""
        below = Below()
        for index, height in fibre_under(slabs, number):
            below = below.under(self.fibre(index), self.short(index), height, machine)
        return below


def fibre_under(slabs: Sequence[Slab], number: int) -> list[tuple[int, float]]:
    """Fibre layers, and their heights, mm, between a layer of matrix and the one below it."""
    under: list[tuple[int, float]] = []
    for slab in slabs[:number][::-1]:
        if slab.fibre is None:
            break
        under.append((slab.fibre, slab.height))
    return under[::-1]


def _layers(
    slabs: Sequence[Slab],
    fills: Sequence[MatrixFill | None],
    strands: _Strands,
    same: Mapping[int, int],
    in_air: Region,
    bottom: float,
    machine: Machine,
) -> Iterator[LaidLayer]:
    """All layers, from the bed to the top, several at a time; what repeats is laid once.

    Layers of fibre by their index repeat those that `same` names.
    """
    sections = [fill and fill.section for fill in fills]
    of_layer = {index: strands.lines(index) for index in set(same.values())}
    lines = [[] if slab.fibre is None else of_layer[same[slab.fibre]] for slab in slabs]
    levels = [(slab.lower, slab.upper) for slab in slabs]
    pads = pad_regions(sections, lines, machine, in_air, levels)
    del lines, of_layer  # as large as all strands

    def laid(number: int) -> LaidLayer:
        slab, fill = slabs[number], fills[number]
        size = (number, slab.upper - bottom, slab.height, machine)
        if slab.fibre is not None:
            k = slab.fibre
            return fibre_layer(strands.fibre(k), strands.short(k), strands.borders[k], *size)
        assert fill is not None
        below = strands.below(slabs, number, machine)
        return matrix_layer(fill, pad_lines(*pads[number], machine), below, *size)

    def what(number: int) -> Hashable:
        slab, fill = slabs[number], fills[number]
        if slab.fibre is not None:
            return slab.height, same[slab.fibre]
        under = tuple((same[k], height) for k, height in fibre_under(slabs, number))
        return slab.height, id(fill), tuple(map(shapely.to_wkb, pads[number])), under

    def again(layer: LaidLayer, number: int) -> LaidLayer:
        return layer.at(number, slabs[number].upper - bottom)

    return repeating(laid, [what(number) for number in range(len(slabs))], again)


def _joined(
    layers: Iterable[LaidLayer],
    slabs: Sequence[Slab],
    bottom: float,
    strands: PrintedStrands,
    machine: Machine,
) -> PrintPlan:
    """Plan of layers that are made one after the other: none is kept beside the plan."""
    columns = {
        "laid": RowBuffer(float),
        "room": RowBuffer(float),
        "short": RowBuffer(bool),
        "sparse": RowBuffer(bool),
        "trims": RowBuffer(float, 3),
    }
    warnings = list(strands.warnings)
    outside = 0.0

    def paths() -> Iterator[Toolpaths]:
        nonlocal outside
        for layer, slab in zip(layers, slabs, strict=True):
            for name, column in columns.items():
                column.append(getattr(layer, name))
            if layer.warning:
                warnings.append(f"at {slab.upper - bottom:.4g} mm {layer.warning}")
            outside += layer.outside
            yield layer.paths

    joined = Toolpaths.concatenate(paths())
    of_layers: dict[str, Any] = {name: column.rows() for name, column in columns.items()}
    return PrintPlan(
        joined,
        np.array([round(slab.upper - bottom, COORDINATE_DIGITS) for slab in slabs]),  # as lines are
        np.array([slab.height for slab in slabs]),
        dropped=strands.dropped,
        outside=outside,
        warnings=(*warnings, *check_cover(slabs, machine)),
        ended=strands.ended,
        **of_layers,
    )


def check_bed(plan: PrintPlan, machine: Machine) -> None:
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


# Pads under fibre without a part below it, and under what hangs over: columns of matrix down to the
# bed or the part.


_MORE = 1.0
"""Width by which a pad extends beyond the strands on it, mm. Our choice."""
_SHARE = 0.25
"""Share of a pad that is filled (Aura)."""
_SPAN = 2.0
"""Longest way over the gap between a pad and the part, mm. A bent strand may hang over 3 mm, and
lines of matrix do not reach every corner of pad and part."""
_ARC = 4
"""Segments per quarter circle in the borders of pads."""
_SAME = 1e-6
_NONE = shapely.Polygon()


def pad_regions(
    sections: Sequence[Region | None],
    strands: Sequence[Sequence[FloatArray]],
    machine: Machine,
    in_air: Region = _NONE,
    levels: Sequence[tuple[float, float]] = (),
) -> list[tuple[Region, Region]]:
    """Regions where each layer of matrix needs pads, and where they are solid.

    Parameters
    ----------
    sections : sequence of (Multi)Polygon or None, mm
        Of all layers from the bed to the top: section of a layer of matrix, None of one of fibre.
    strands : sequence of sequences of (n, 2) arrays, mm
        Fibre on each of them.
    in_air : (Multi)Polygon, mm
        Where layers that hang over get pads, seen from above.
    levels : sequence of (float, float), mm
        Bottom and top of each layer, for the gap below layers that hang over.

    Returns
    -------
    list of (Region, Region)
        All of the pads, and their solid part; empty on layers of fibre.
    """
    reach, half = 0.5 * machine.fibre_width + _MORE, 0.5 * machine.matrix_width
    clear, solid_layers = machine.process.support_clearance, machine.process.support_interface
    # Where a section is narrower than a line, nothing is laid.
    sections = [one and _opened(one, half) for one in sections]
    wide: Region = _NONE
    along: Region = _NONE
    recent: list[Region] = []
    waiting: list[tuple[float, Region]] = []
    pads: list[tuple[Region, Region]] = []
    for k in range(len(sections))[::-1]:
        section = sections[k]
        if section is None:
            below = next((one for one in sections[:k][::-1] if one is not None), None)
            if below is not None and len(strands[k]):
                free = shapely.difference(strings(strands[k]), below)
                along = free_area(_along_border(free, below, clear), reach)
                recent = [shapely.union(free_area(free, reach), _union(recent[:1])), *recent[1:]]
            pads.append((_NONE, _NONE))
            continue
        wide = _union([wide, *recent[:1]])
        if wide.is_empty:
            pads.append((_NONE, _NONE))
        else:
            # Clear of the part, except below strands that run along its border.
            room = shapely.buffer(section, clear, quad_segs=_ARC)
            room = shapely.union(shapely.difference(room, along), section)
            solid = _union(recent[:solid_layers])
            pads.append((shapely.difference(wide, room), shapely.difference(solid, room)))
        lower = next((j for j in range(k)[::-1] if sections[j] is not None), None)
        below = section if lower is None else sections[lower]
        hangs = shapely.intersection(shapely.difference(section, below), in_air)
        if machine.process.support_gap and lower is not None and len(levels):
            # Columns end at the first layer whose top is so far below.
            waiting.append((levels[k][0] - machine.process.support_gap, hangs))
            hangs = _union([one for level, one in waiting if levels[lower][1] <= level + _SAME])
            waiting = [one for one in waiting if levels[lower][1] > one[0] + _SAME]
        recent, along = [hangs, *recent[: solid_layers - 1]], _NONE
    return pads[::-1]


def _opened(section: Region, half: float) -> Region:
    """Part of a section that lines of twice that width reach."""
    inner = shapely.buffer(section, -half, quad_segs=_ARC)
    return shapely.buffer(inner, half, quad_segs=_ARC)


def _along_border(free: shapely.Geometry, below: Region, clear: float) -> shapely.Geometry:
    """Pieces of lines that run on in the gap between a pad and the part."""
    near = shapely.intersection(free, shapely.buffer(below, clear, quad_segs=_ARC))
    lines = [line for line in open_lines(near) if line_length(line) > _SPAN]
    return strings(lines) if lines else np.array([_NONE])


def free_area(free: shapely.Geometry, reach: float) -> Region:
    """Area round lines, simplified to a twentieth of a mm."""
    return shapely.simplify(_union(shapely.buffer(free, reach, quad_segs=_ARC)), 0.05)


def _union(parts: Sequence[Region]) -> Region:
    return shapely.union_all(list(parts)) if len(parts) else _NONE


def pad_lines(wide: Region, solid: Region, machine: Machine) -> list[FloatArray]:
    """Lines (n, 2) of pads: a contour and lines far apart, close in the solid part."""
    if wide.is_empty:
        return []
    width, angle = machine.matrix_width, float(np.radians(machine.gcode.matrix_angle))
    rings = offset_rings(wide, 0.5 * width, width, width, 1)
    lines = [ring for level in rings for ring in level]
    sparse = shapely.difference(wide, solid)
    for region, pitch in ((sparse, width / _SHARE), (solid, width)):
        inside = shapely.intersection(region, shapely.buffer(wide, -0.75 * width))
        if inside.area > width**2:
            lines += zigzag(inside, 0.5 * width, width, pitch, angle)
    return lines
