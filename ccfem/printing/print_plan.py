"""A whole part as it is printed: layers of matrix below, between and above the layers of fibre."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy.ndimage import label

from ccfem.base.arrays import BoolArray, FloatArray, freeze, in_brief
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.hatch import zigzag
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.polylines import along_line, line_length, points_along, starts_segment
from ccfem.geometry.shapes import Region, open_lines, strings
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
from ccfem.printing.matrix_lines import MatrixFill, matrix_fills
from ccfem.printing.slabs import Slab, check_cover, slabs_of
from ccfem.printing.strand_density import StrandDensity
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
            room = above.upper - slab.lower - machine.least_line
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


# Strands that leave the part: on pads, cut at its border, or refused.


def turned(
    lines: list[FloatArray], border: Region, layer: int, machine: Machine
) -> tuple[list[FloatArray], FloatArray]:
    """Strands of a layer by what `Process.turns` says, and where they cross its border."""
    crossings = border_crossings(lines, border)
    if not len(crossings) or machine.process.turns == "pad":
        return lines, crossings
    if machine.process.turns == "inside":
        raise InputError(
            f"strands leave fibre layer {layer} in {len(crossings)} places, but process.turns is "
            "'inside': plan without loops outside (svt: links = 'none'), or set it to 'pad' or "
            "'cut'"
        )
    return cut_at_border(lines, border), np.zeros((0, 2))


# Pads under fibre without a part below it: columns of matrix down to the bed or the part.


_MORE = 1.0
"""Width by which a pad extends beyond the strands on it, mm. Our choice."""
_CLEAR = 0.7
"""Distance from a pad to the part, mm (Aura)."""
_SHARE = 0.25
"""Share of a pad that is filled (Aura)."""
_SOLID = 2
"""Number of solid layers of matrix under a strand. Our choice."""
_SPAN = 2.0
"""Longest way over the gap between a pad and the part, mm. A bent strand may hang over 3 mm, and
lines of matrix do not reach every corner of pad and part."""
_ARC = 4
"""Segments per quarter circle in the borders of pads."""
_NONE = shapely.Polygon()


def pad_regions(
    sections: Sequence[Region | None], strands: Sequence[Sequence[FloatArray]], machine: Machine
) -> list[tuple[Region, Region]]:
    """Regions where each layer of matrix needs pads, and where they are solid.

    Parameters
    ----------
    sections : sequence of (Multi)Polygon or None, mm
        Of all layers from the bed to the top: section of a layer of matrix, None of one of fibre.
    strands : sequence of sequences of (n, 2) arrays, mm
        Fibre on each of them.

    Returns
    -------
    list of (Region, Region)
        All of the pads, and their solid part; empty on layers of fibre.
    """
    reach, half = 0.5 * machine.fibre_width + _MORE, 0.5 * machine.matrix_width
    # Where a section is narrower than a line, nothing is laid.
    sections = [one and _opened(one, half) for one in sections]
    wide: Region = _NONE
    along: Region = _NONE
    recent: list[Region] = []
    found: list[tuple[Region, Region]] = []
    for k in range(len(sections))[::-1]:
        section = sections[k]
        if section is None:
            below = next((one for one in sections[:k][::-1] if one is not None), None)
            if below is not None and len(strands[k]):
                free = shapely.difference(strings(strands[k]), below)
                along = free_area(_along_border(free, below), reach)
                recent = [shapely.union(free_area(free, reach), _union(recent[:1])), *recent[1:]]
            found.append((_NONE, _NONE))
            continue
        wide = _union([wide, *recent[:1]])
        if wide.is_empty:
            found.append((_NONE, _NONE))
        else:
            # Clear of the part, except below strands that run along its border.
            room = shapely.buffer(section, _CLEAR, quad_segs=_ARC)
            room = shapely.union(shapely.difference(room, along), section)
            solid = _union(recent[:_SOLID])
            found.append((shapely.difference(wide, room), shapely.difference(solid, room)))
        recent, along = [_NONE, *recent[: _SOLID - 1]], _NONE
    return found[::-1]


def _opened(section: Region, half: float) -> Region:
    """Part of a section that lines of twice that width reach."""
    inner = shapely.buffer(section, -half, quad_segs=_ARC)
    return shapely.buffer(inner, half, quad_segs=_ARC)


def _along_border(free: shapely.Geometry, below: Region) -> shapely.Geometry:
    """Pieces of lines that run on in the gap between a pad and the part."""
    near = shapely.intersection(free, shapely.buffer(below, _CLEAR, quad_segs=_ARC))
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


def border_crossings(lines: Sequence[FloatArray], section: Region) -> FloatArray:
    """Places (k, 2) where strands cross the border of a section."""
    if not len(lines):
        return np.zeros((0, 2))
    found = shapely.intersection(strings(lines), shapely.boundary(section))
    return np.asarray(shapely.get_coordinates(found))


def cut_at_border(lines: Sequence[FloatArray], section: Region) -> list[FloatArray]:
    """Pieces of strands (n, 2) inside a section; rings go on through their first point."""
    found: list[FloatArray] = []
    for line in lines:
        if section.covers(shapely.LineString(line)):
            found.append(line)
            continue
        pieces = shapely.intersection(shapely.LineString(line), section)
        found += open_lines(np.array([pieces]))
    return found


# Strands that would stack higher than the matrix above them end alternately where they cross.
#
# Where bundles of strands cross or join, their strands lie on top of each other. The matrix above
# levels them as long as they are not higher than it. Where they are, pieces of strands are left
# out, one in each stack at a time, that which stands most in the way first: of neighbours in a
# bundle one ends and the other goes on.


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
    return max(most + machine.least_line - machine.strand_height, 0.0)


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
