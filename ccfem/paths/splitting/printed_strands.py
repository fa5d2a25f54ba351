"""The strands that are printed: planned paths, cut where the printer cuts them, long enough.

The one step between a plan and all that judges, times and prints it. A strand that leaves the part
is cut at its border if `Process.turns` says so, one that would stack higher than the matrix above
can level ends there if `Process.stacks` says so, and what is then shorter than the cutter allows is
no fibre: matrix takes its place, or nothing (`Process.short`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely
from scipy.ndimage import label

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.geometry.polylines import along_line, between, is_closed, line_length, points_along, runs
from ccfem.geometry.shapes import Region, corners_only, strings
from ccfem.machine.machine import Machine
from ccfem.paths.planning.unfolding import part_of_line
from ccfem.paths.repeated import repeated_layers
from ccfem.paths.splitting.slabs import LOW, Slab, StrandDensity, slabs_of
from ccfem.paths.toolpaths import FIBRE, MATRIX, Toolpaths
from ccfem.slicing.layers import Layer
from ccfem.slicing.layers.layer import curved_layers
from ccfem.slicing.slicers.planar import Planar

SHORT = 1e-6
"""Share of the cutter's distance by which a strand may be too short through rounding."""

_NOTHING = 1e-6
"""Length, mm, of a piece that is left by rounding alone."""

Interval = tuple[float, float]
"""Arc lengths, mm, between which a piece of a strand lies; of a ring the second may exceed its
length: the piece then goes on through the first point."""


@dataclass(frozen=True)
class PrintedStrands:
    """The strands of a part as they are printed.

    Attributes
    ----------
    fibre : Toolpaths
        Strands that the cutter allows; each is laid whole and cut once.
    short : Toolpaths
        Lines of matrix (kind MATRIX) in place of strands that are too short.
    dropped : float, mm
        Length that is cut off or left out, and filled with matrix from above.
    ended : float, mm
        Length that is left out where strands would stack higher than the matrix above.
    warnings : tuple of str
        What became of the planned paths, one line each; empty where they are printed as planned.
    """

    fibre: Toolpaths
    short: Toolpaths = field(default_factory=Toolpaths.empty)
    dropped: float = 0.0
    ended: float = 0.0
    warnings: tuple[str, ...] = ()

    @property
    def layers(self) -> set[int]:
        """Indices of the layers that anything lies on."""
        return {*self.fibre.layer.tolist(), *self.short.layer.tolist()}

    def repeated(
        self, layers: Sequence[Layer], sections: Mapping[int, Region] | None = None
    ) -> dict[int, int]:
        """Index of the first of some layers that each one repeats at its own height.

        Sections of the part, by index, have to be equal where layers are regions of them.
        """
        whole = None if sections is None else [corners_only(sections[k.index]) for k in layers]
        fibre = repeated_layers(self.fibre, layers, whole).tolist()
        source = repeated_layers(self.short, layers, fibre)
        return {layer.index: layers[k].index for layer, k in zip(layers, source, strict=True)}


def printed_strands(
    toolpaths: Toolpaths, layers: Sequence[Layer], mesh: TetMesh, machine: Machine
) -> PrintedStrands:
    """Split planned paths into the strands that are printed.

    Applied to its own result it changes nothing more.

    Parameters
    ----------
    toolpaths : Toolpaths
        Fibre; paths of other kinds are left out.
    layers : sequence of Layer
        That the fibre lies on. On curved layers strands are cut nowhere, and short ones left out.
    mesh : TetMesh
        The part.

    Raises
    ------
    InputError
        Where fibre lies on a layer that is not given, is too short and `Process.short` says so, or
        leaves the part although `Process.turns` is "inside".
    """
    fibre = toolpaths.of_kind(FIBRE)
    _check_fibre(fibre, layers, machine)
    flat = not curved_layers(layers)
    used = [layer for layer in layers if layer.index in fibre.layer]
    pieces = {layer.index: _whole(fibre, layer.index) for layer in used}
    process, removed, warnings = machine.process, 0.0, list[str]()
    if flat and (process.turns != "pad" or process.stacks == "end"):
        borders = sections_of(used, mesh)
        for layer in used:
            pieces[layer.index] = _in_part(
                pieces[layer.index], borders[layer.index], layer, machine
            )
        within = _total(pieces)
        if process.stacks == "end":
            warnings = _end_in_stacks(pieces, used, borders, mesh, machine)
        removed = within - _total(pieces)
    # What leaves the part is cut off; what ends in stacks is removed.
    cut_off = float(fibre.lengths.sum()) - removed - _total(pieces)
    limit = machine.shortest_strand * (1.0 - SHORT)
    split = sorted(
        (piece for of_layer in pieces.values() for piece in of_layer), key=lambda p: p.path
    )
    split = [piece for piece in split if line_length(piece.line) > _NOTHING]
    long = [piece for piece in split if line_length(piece.line) >= limit]
    short = [piece for piece in split if line_length(piece.line) < limit]
    if short and process.short == "error":
        raise InputError(
            f"process.turns cuts strands into pieces below the {machine.shortest_strand:g} mm of "
            f"{machine.shortest_strand_by}: set it to 'pad', or process.short to 'matrix'"
        )
    # In layers too low for a line of matrix, the matrix above fills the place of short strands.
    low = max(LOW, machine.least_line)
    if not (flat and process.short == "matrix" and machine.strand_height >= low):
        cut_off += sum(line_length(piece.line) for piece in short)
        short = []
    whole = len(long) == len(fibre) and sum(len(p.line) for p in long) == len(fibre.points)
    by_matrix = _toolpaths(short, fibre, MATRIX)
    warnings = [*_about_short(by_matrix, cut_off), *warnings]
    unchanged = whole and abs(cut_off) < _NOTHING and not removed
    printed = fibre if unchanged else _toolpaths(long, fibre, FIBRE)
    return PrintedStrands(printed, by_matrix, cut_off, removed, tuple(warnings))


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
    limit = machine.shortest_strand
    short = fibre.lengths < limit * (1.0 - SHORT)
    if short.any() and machine.process.short == "error":
        raise InputError(
            f"fibre paths must be no shorter than the {limit:g} mm of "
            f"{machine.shortest_strand_by}; {int(short.sum())} of {len(fibre)} are, the shortest "
            f"{fibre.lengths.min():.4g} mm: plan for this machine, or set process.short = 'matrix'"
        )


def _about_short(by_matrix: Toolpaths, dropped: float) -> list[str]:
    """Say what became of what the cutter does not allow, if there is anything."""
    remarks = []
    if len(by_matrix):
        length = by_matrix.lengths.sum()
        remarks.append(f"{length:.1f} mm in {len(by_matrix)} strands are laid as matrix")
    if dropped > 1e-3:
        remarks.append(f"{dropped:.1f} mm are left out and filled with matrix")
    return [f"too short for the cutter: {'; '.join(remarks)}"] if remarks else []


def sections_of(layers: Sequence[Layer], mesh: TetMesh) -> dict[int, Region]:
    """Sections of the part on flat layers, in their planes, by index: all of it, not regions."""
    if not layers:
        return {}
    ordered = sorted(layers, key=lambda layer: layer.plane.height)
    heights = tuple(layer.plane.height for layer in ordered)
    whole = Planar(heights=heights).sections(mesh, ordered[0].plane.frame[2])
    return {ordered[k].index: section.polygon for k, section in whole}


# Pieces of planned paths, in space; those that nothing cuts keep their points to the last bit.


@dataclass(frozen=True)
class _Piece:
    """A piece of a planned path: its number, points (n, 3), mm, and which steps are links, (n,)."""

    path: int
    line: FloatArray
    link: BoolArray

    def between(self, interval: Interval) -> "_Piece":
        """Piece between two arc lengths; a ring goes on through its first point."""
        line, link = part_of_line(self.line, along_line(self.line), self.link, *interval)
        return _Piece(self.path, line, link)


def _whole(fibre: Toolpaths, layer: int) -> list[_Piece]:
    """Return all paths of a layer, uncut."""
    ends = fibre.offsets.tolist()
    return [
        _Piece(k, fibre.points[ends[k] : ends[k + 1]], fibre.link[ends[k] : ends[k + 1]])
        for k in np.flatnonzero(fibre.layer == layer).tolist()
    ]


def _total(pieces: Mapping[int, Sequence[_Piece]]) -> float:
    """Length of all pieces, mm."""
    return sum(line_length(piece.line) for of_layer in pieces.values() for piece in of_layer)


def _toolpaths(pieces: Sequence[_Piece], fibre: Toolpaths, kind: int) -> Toolpaths:
    """Pieces as toolpaths; a piece has the normals of its path where that is whole or flat."""
    if not pieces:
        return Toolpaths.empty()
    source = np.array([piece.path for piece in pieces])
    start, size = fibre.offsets[source], np.diff(fibre.offsets)[source]
    normals = [
        fibre.normals[a : a + n]
        if len(piece.line) == n
        else np.broadcast_to(fibre.normals[a], piece.line.shape)
        for piece, a, n in zip(pieces, start.tolist(), size.tolist(), strict=True)
    ]
    sizes = [len(piece.line) for piece in pieces]
    return Toolpaths(
        points=np.concatenate([piece.line for piece in pieces]),
        normals=np.concatenate(normals),
        offsets=np.concatenate([[0], np.cumsum(sizes)]),
        layer=fibre.layer[source],
        kind=np.full(len(pieces), kind),
        closed=np.array([is_closed(piece.line) for piece in pieces]),
        link=np.concatenate([piece.link for piece in pieces]),
    )


# Strands that leave the part: on pads, cut at its border, or refused.


def border_crossings(lines: Sequence[FloatArray], section: Region) -> FloatArray:
    """Places (k, 2) where strands (n, 2) cross the border of a section."""
    if not len(lines):
        return np.zeros((0, 2))
    crossing = shapely.intersection(strings(lines), shapely.boundary(section))
    return np.asarray(shapely.get_coordinates(crossing))


def _in_part(
    pieces: Sequence[_Piece], border: Region, layer: Layer, machine: Machine
) -> list[_Piece]:
    """Pieces of a layer by what `Process.turns` says."""
    plane = layer.plane
    turns = machine.process.turns
    lines = [plane.project(piece.line) for piece in pieces]
    crossings = np.zeros((0, 2)) if turns == "pad" else border_crossings(lines, border)
    if not len(crossings):
        return list(pieces)
    if turns == "inside":
        raise InputError(
            f"strands leave fibre layer {layer.index} in {len(crossings)} places, but "
            "process.turns is 'inside': plan without loops outside (svt: links = 'none'), or set "
            "it to 'pad' or 'cut'"
        )
    inner: list[_Piece] = []
    for piece, line in zip(pieces, lines, strict=True):
        whole = border.covers(shapely.LineString(line))
        inner += [piece] if whole else [piece.between(part) for part in inside(line, border)]
    return inner


def inside(line: FloatArray, section: Region) -> list[Interval]:
    """Arc lengths between which a strand (n, 2) lies inside a section, mm.

    Each step is cut where it meets the border; a piece is inside if its middle is. Where a strand
    crosses itself it goes on.
    """
    along = along_line(line)
    total = float(along[-1])
    steps = shapely.linestrings(np.stack([line[:-1], line[1:]], axis=1))
    places, step = shapely.get_coordinates(
        shapely.intersection(steps, shapely.boundary(section)), return_index=True
    )
    at = along[step] + np.linalg.norm(places - line[step], axis=1)
    cuts = np.unique(np.concatenate([along, at.clip(0.0, total)]))
    cuts = cuts[np.append(True, np.diff(cuts) > 1e-9)]
    middle = points_along(line, along, 0.5 * (cuts[1:] + cuts[:-1]))
    within = shapely.intersects_xy(section, *middle.T)
    pieces = [(float(cuts[a]), float(cuts[b])) for a, b in runs(within)]
    if len(pieces) > 1 and is_closed(line) and within[0] and within[-1]:
        pieces = [*pieces[1:-1], (pieces[-1][0], total + pieces[0][1])]
    return pieces


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


def _end_in_stacks(
    pieces: dict[int, list[_Piece]],
    layers: Sequence[Layer],
    borders: Mapping[int, Region],
    mesh: TetMesh,
    machine: Machine,
) -> list[str]:
    """Let pieces end where they stack too high, layer by layer, in place; say how much it was."""
    lines = {
        layer.index: [layer.plane.project(piece.line) for piece in pieces[layer.index]]
        for layer in layers
    }
    warnings = []
    for slab, above in pairwise(printed_slabs(lines, layers, borders, mesh, machine)):
        if slab.fibre is None or above.fibre is not None:
            continue
        room = above.upper - slab.lower - machine.least_line
        short = ended_in_stacks(lines[slab.fibre], borders[slab.fibre], room, machine)
        if short.places:
            planned = pieces[slab.fibre]
            pieces[slab.fibre] = [planned[k].between(part) for k, part in short.pieces]
            warnings.append(
                f"{short.removed:.0f} mm of fibre layer {slab.fibre} are left out in "
                f"{short.places} places, where strands would stack higher than the matrix above"
            )
    return warnings


def printed_slabs(
    lines: Mapping[int, Sequence[FloatArray]],
    layers: Sequence[Layer],
    borders: Mapping[int, Region],
    mesh: TetMesh,
    machine: Machine,
) -> list[Slab]:
    """Layers to print, from the bottom to the top, high enough over the strands (n, 2) of each.

    Raises
    ------
    InputError
        Where layers are nearer to each other or to the part's ends than their height allows.
    """
    up = layers[0].plane.frame[2]
    level = mesh.points[np.unique(mesh.corners)] @ up
    over = {index: height_over(lines[index], borders[index], machine) for index in lines}
    return slabs_of(layers, float(level.min()), float(level.max()), machine, over)


@dataclass(frozen=True)
class Ended:
    """Strands of a layer, some of which end in stacks.

    Attributes
    ----------
    lines : list of (n, 2) arrays, mm
    pieces : list of (int, Interval)
        Strand, and its arc lengths, of each of the lines.
    removed : float, mm
        Length of the pieces that are left out.
    places : int
        Number of these pieces.
    """

    lines: list[FloatArray]
    pieces: list[tuple[int, Interval]]
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
    pieces = [(k, (0.0, line_length(line))) for k, line in enumerate(kept)]
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
        gaps: dict[int, Interval] = {}
        taken = set()
        for _, stack, line, first, last in sorted(passes, reverse=True):
            # One in each stack; a strand is cut in one place a round, since its pieces get short.
            if stack in taken or line in gaps:
                continue
            taken.add(stack)
            gaps[line] = (first, last)
            removed += last - first
            places += 1
        pieces = [part for k, piece in enumerate(pieces) for part in _without(piece, gaps.get(k))]
        kept = [between(np.asarray(lines[k]), *part) for k, part in pieces]
    return Ended(kept, pieces, removed, places)


def _passes(
    lines: Sequence[FloatArray],
    stacks: FloatArray,
    density: StrandDensity,
    room: float,
    machine: Machine,
) -> list[tuple[float, int, int, float, float]]:
    """List passes through stacks that may be left out: excess, stack, strand and both ends."""
    shortest = machine.shortest_strand
    passes = []
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
            passes.append((gain, int(stack[first]), k, low, high))
    return passes


def _without(piece: tuple[int, Interval], gap: Interval | None) -> list[tuple[int, Interval]]:
    """Piece of a strand, or what a gap, counted from its start, leaves of it."""
    line, (start, end) = piece
    if gap is None:
        return [piece]
    left = ((start, start + gap[0]), (start + gap[1], end))
    return [(line, part) for part in left if part[1] > part[0] + _NOTHING]
