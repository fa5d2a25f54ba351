"""Paths of one layer of a print, matrix or fibre, in the order of printing."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.geometry.polylines import merge_repeated, pack, starts_segment, subdivide
from ccfem.geometry.shapes import Region, Shapes, bends, strings
from ccfem.machine.machine import Machine
from ccfem.paths.linking.print_order import nearest_end_order
from ccfem.paths.splitting.printed_strands import border_crossings
from ccfem.paths.splitting.slabs import StrandDensity
from ccfem.paths.toolpaths import FIBRE, MATRIX, SUPPORT, Toolpaths
from ccfem.printing.matrix_lines import MatrixFill
from ccfem.printing.poses import Obstacles

# Flow of matrix over fibre: lines are laid so that the layer comes out exactly full.
#
# Strands do not fill the layer that they lie in, and where they cross they stand higher than it.
# The matrix above fills up to its own top. At a place x with rho mm of strand per mm^2 its
# height is
#
# t(x) = h_m + h_f - A rho(x),
#
# with the heights h_m of the matrix layer and h_f of the fibre below it, and the section A of a
# strand. The whole layer is then scaled, by at most a tenth, so that its volume is the free volume
# of its section: a zigzag does not pass exactly once everywhere.


_PIECE = 2.0
"""Longest piece, mm, over which the height is constant."""
_STEP = 0.05
"""Steps in which the height changes along a line, over that of the layer."""
_MISPLACED = 2.0
"""Matrix that a compact file lays elsewhere along a line, at most, in mm of a line as high as its
layer. Our choice."""
_STRETCH = 1e3
"""Of the way along lines, so that what is laid elsewhere is the distance from a simplified line."""
_SCALE = 1.1
"""Largest factor by which a layer is scaled. If lines miss a tenth of a section, as between walls
nearer than a line is wide, more flow would not reach it either. Our choice."""
_THIN, _TOO_THIN = 0.01, 0.1
"""Shares of a layer's lines that may be thinner, because fibre below stands too high: without a
warning, and with one. Our choice."""


@dataclass(frozen=True)
class Below:
    """Fibre since the last layer of matrix: strands (n, 2), mm, sections, mm^2, and height, mm."""

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

    def density(self, places: FloatArray, machine: Machine) -> FloatArray:
        """Volume of strands per area, mm, round places (k, 2)."""
        if not self.strands:
            return np.zeros(len(places))
        density = StrandDensity.of(self.strands, self.sections, machine.fibre_width, places)
        return density.at(places)


def with_flow(
    paths: Toolpaths,
    section: Region,
    height: float,
    below: Below,
    machine: Machine,
    shares: FloatArray | None = None,
    sparse: BoolArray | None = None,
) -> tuple[Toolpaths, FloatArray, str]:
    """Lines of a matrix layer with the height that each of their steps lays.

    Parameters
    ----------
    paths : Toolpaths
        Of one layer of matrix.
    section : shapely (Multi)Polygon, mm
        What the layer has to fill, in the plane of the paths; without sparse infill.
    height : float, mm
        Of the layer.
    below : Below
        Fibre directly below it.
    shares : (K,) array, optional
        Width of each path over that of the machine; by default 1.
    sparse : (K,) bool array, optional
        Paths of sparse infill, which end in the section, and are not scaled; by default none.

    Returns
    -------
    paths : Toolpaths
        With a point wherever the height changes by a twentieth.
    share : (P,) array, mm
        Height of matrix, a line wide, on the step from each point; 0 at the end of a line.
    warning : str
        Where strands stand higher on more than a hundredth; else empty.

    Raises
    ------
    InputError
        Where strands stand higher than the matrix above them on more than a tenth of the layer.
    """
    points, offsets, segment = subdivide(paths.points, paths.offsets, _PIECE)
    start = np.flatnonzero(starts_segment(offsets))
    length = np.linalg.norm(points[start + 1] - points[start], axis=1)
    middle = 0.5 * (points[start] + points[start + 1])[:, :2]
    way = paths.link[segment]
    length[way[start]] = 0.0  # nothing is laid there
    shares = np.ones(len(paths)) if shares is None else shares
    sparse = np.zeros(len(paths), dtype=bool) if sparse is None else sparse
    volume = height + below.height - below.density(middle, machine)
    least = min(machine.least_line, height)
    warning = _check(volume, length, height, below.height, least, machine)
    wanted = np.maximum(volume, least)
    if machine.gcode.compact:
        last = np.searchsorted(start, offsets[1:]) - 1
        wanted = _evened(wanted / height, length, last) * height
    level = np.full(len(points), -1)
    level[start] = np.round(wanted / (_STEP * height)).astype(np.int64)
    level[way] = -2
    kept, share, long = _in_runs(_begins_level(level, segment), start, wanted, length)
    if machine.gcode.compact:
        share = share.round(6)  # equal heights are exactly equal
    line = np.searchsorted(np.searchsorted(kept, offsets), np.arange(len(kept)), "right") - 1
    share *= shares[line]
    scaled = ~sparse[line]
    room = _room(section, height, below, paths.select(sparse), machine)
    scale = room / (machine.matrix_width * (share * long)[scaled].sum())
    share[scaled] *= np.clip(scale, 1.0 / _SCALE, _SCALE)
    # No line thinner than the machine prints; those in gaps are narrower instead.
    share = np.where(long > 0.0, np.maximum(share, least * shares[line]), 0.0)
    fewer = replace(
        paths,
        points=points[kept],
        normals=np.broadcast_to(paths.normals[0], (len(kept), 3)),
        offsets=np.searchsorted(kept, offsets),
        link=way[kept],
    )
    return fewer, share, warning


def _in_runs(
    keep: BoolArray, start: IntArray, wanted: FloatArray, length: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Points at which runs begin, and the mean of a height over each run, with its length."""
    kept = np.flatnonzero(keep)
    run = (np.cumsum(keep) - 1)[start]
    long = np.asarray(np.bincount(run, length, len(kept)), dtype=np.float64)
    mean = np.bincount(run, wanted * length, len(kept)) / np.maximum(long, 1e-300)
    return kept, mean, long


def _room(
    section: Region, height: float, below: Below, sparse: Toolpaths, machine: Machine
) -> float:
    """Volume, mm^3, that strands and the ends of sparse infill leave to the lines of a layer."""
    height = height + below.height
    inside = shapely.length(shapely.intersection(strings(below.strands), section))
    room = section.area * height - float(inside @ np.asarray(below.sections))
    return room - machine.matrix_width * height * _ends_inside(sparse, section)


def _begins_level(level: IntArray, segment: IntArray) -> BoolArray:
    """Mark points that are kept: of neighbouring pieces at one height level only the first."""
    keep = np.append(True, np.diff(segment) > 0)
    keep[1:] |= level[1:] != level[:-1]
    return keep


def _ends_inside(sparse: Toolpaths, section: Region) -> float:
    """Length, mm, of lines of sparse infill that end in a section, within it."""
    if not len(sparse):
        return 0.0
    ends, solid = _laid_lines(sparse), shapely.force_2d(section)
    shapely.prepare(solid)
    ends = ends[shapely.intersects(ends, solid)]  # the ends of lines: few of their steps
    return float(shapely.length(shapely.intersection(ends, section)).sum())


def _laid_lines(paths: Toolpaths) -> Shapes:
    """Lines of matrix, without the ways between them on which nothing is laid."""
    start = np.flatnonzero(starts_segment(paths.offsets) & ~paths.link)
    ends = np.stack([paths.points[start], paths.points[start + 1]], axis=1)
    return shapely.linestrings(ends[:, :, :2])


def _evened(share: FloatArray, length: FloatArray, last: IntArray) -> FloatArray:
    """Heights of steps (s,) in as few runs of one height as `_MISPLACED` allows.

    What is laid up to a place, over the way to there, is a line that is simplified.

    Parameters
    ----------
    share, length : (s,) arrays
        Height of each step over that of the layer, and its length, mm.
    last : (K,) int array
        Steps that paths end with: no run goes on from one path to the next.
    """
    along, lengths = (np.append(0.0, np.cumsum(column)) for column in (length, share * length))
    curve = np.column_stack([_STRETCH * along, lengths])
    at = bends(curve, last[:-1] + 1, _MISPLACED)
    run = np.diff(lengths[at]) / np.maximum(np.diff(along[at]), 1e-300)
    return np.repeat(run, np.diff(at))


def pad_flow(
    paths: Toolpaths, height: float, below: Below, machine: Machine
) -> tuple[Toolpaths, FloatArray]:
    """Lines of pads, with the height that strands on the pads below leave to each step.

    Parameters and results are those of `with_flow`; nothing is scaled, and nothing refused.
    """
    points, offsets, _ = subdivide(paths.points, paths.offsets, _PIECE)
    after = np.minimum(np.arange(len(points)) + 1, len(points) - 1)
    middle = 0.5 * (points + points[after])[:, :2]
    volume = height + below.height - below.density(middle, machine)
    finer = replace(
        paths,
        points=points,
        normals=np.broadcast_to(paths.normals[0], (len(points), 3)),
        offsets=offsets,
        link=np.zeros(len(points), dtype=bool),
    )
    return finer, np.maximum(volume, min(machine.least_line, height))


def _check(
    volume: FloatArray,
    length: FloatArray,
    height: float,
    below: float,
    least: float,
    machine: Machine,
) -> str:
    """Refuse strands that stand higher than the matrix above them on too much of the layer."""
    thin = length[volume < least].sum() / length.sum()
    if thin <= _THIN:
        return ""
    order = np.argsort(volume, kind="stable")
    share = np.cumsum(length[order]) / length.sum()
    missing = least - float(volume[order[np.searchsorted(share, 0.01)]])
    cure = "" if machine.process.stacks == "end" else ", or set process.stacks = 'end'"
    message = (
        f"strands stand higher than the {height:.3g} mm of matrix above them on {thin:.0%} of the "
        f"layer; {height + missing:.3g} mm would do: lay fibre layers at least "
        f"{height + below + missing:.3g} mm apart{cure}"
    )
    if thin > _TOO_THIN:
        raise InputError(message)
    return message


COORDINATE_DIGITS = 3
"""Decimals of coordinates, mm."""


@dataclass(frozen=True)
class LaidLayer:
    """Paths of a layer in the order of printing, on the bed.

    Attributes
    ----------
    height, thickness : float, mm
        Top of the layer over the bed, and its own height.
    laid : (P,) array, mm
        Height of matrix, a line wide, on the step from each point.
    room : (K,) array, optional
        Width that each line of matrix fills, over that of the machine's lines; by default 1.
    short : (K,) bool array, optional
        Lines of matrix in place of strands that are too short for the cutter; by default none.
    sparse : (K,) bool array, optional
        Lines of sparse infill; by default none.
    outside : float, mm
        Length of fibre outside the part.
    trims : (t, 2) array, mm
        Where strands cross the part's border.
    """

    paths: Toolpaths
    height: float
    thickness: float
    laid: FloatArray
    room: FloatArray = None  # type: ignore[assignment]
    short: BoolArray = None  # type: ignore[assignment]
    sparse: BoolArray = None  # type: ignore[assignment]
    warning: str = ""
    outside: float = 0.0
    trims: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))

    def __post_init__(self) -> None:
        count = len(self.paths)
        for name, default in (("room", 1.0), ("short", False), ("sparse", False)):
            if getattr(self, name) is None:
                object.__setattr__(self, name, np.full(count, default))

    def at(self, height: float) -> "LaidLayer":
        """Lay the same, flat, at another height, mm."""
        points = self.paths.points.copy()
        points[:, 2] = round(height, COORDINATE_DIGITS)
        return replace(self, paths=replace(self.paths, points=points), height=height)


def matrix_layer(
    fill: MatrixFill,
    pads: Sequence[FloatArray],
    below: Below,
    height: float,
    thickness: float,
    machine: Machine,
) -> LaidLayer:
    """Lay matrix over the layers below, and lines of pads; `height` is the top over the bed, mm."""
    solid = fill.lines[: len(fill.lines) - fill.sparse]
    ways = [np.zeros(len(line), dtype=bool) for line in solid] + fill.ways
    matrix, which = _printed(fill.lines, height, MATRIX, ways)
    sparse = which >= len(fill.lines) - fill.sparse
    heights, warning = np.zeros(0), ""
    room = np.array(fill.widths)[which] / machine.matrix_width
    if len(matrix):
        matrix, heights, warning = with_flow(
            matrix, fill.solid, thickness, below, machine, room, sparse
        )
    pad, _ = _printed(pads, height, SUPPORT)
    if len(pad):
        pad, high = pad_flow(pad, thickness, below, machine)
        matrix, heights = Toolpaths.concatenate([matrix, pad]), np.append(heights, high)
        room = np.append(room, np.ones(len(pad)))
        sparse = np.append(sparse, np.zeros(len(pad), dtype=bool))
    size = (height, thickness, heights, room)
    return LaidLayer(matrix, *size, sparse=sparse, warning=warning)


def fibre_layer(
    lines: Sequence[FloatArray],
    by_matrix: Sequence[FloatArray],
    border: Region,
    height: float,
    thickness: float,
    machine: Machine,
) -> LaidLayer:
    """Lay strands (n, 2), and matrix in place of those too short.

    Parameters are those of `matrix_layer`, and the border of the part on the layer.
    """
    outside = float(shapely.length(shapely.difference(strings(lines), border)).sum())
    kinds = np.repeat([FIBRE, MATRIX], [len(lines), len(by_matrix)])
    fibre, _ = _printed([*lines, *by_matrix], height, kinds)
    return LaidLayer(
        fibre,
        height,
        thickness,
        np.full(len(fibre.points), thickness),
        short=fibre.kind == MATRIX,
        outside=outside,
        trims=border_crossings([*lines, *by_matrix], border),
    )


def _printed(
    lines: Sequence[FloatArray],
    height: float,
    kind: int | IntArray,
    ways: Sequence[BoolArray] | None = None,
) -> tuple[Toolpaths, IntArray]:
    """Paths of one flat layer on the bed, in the order of printing; and their lines."""
    points, offsets = pack(lines)
    points = points.round(COORDINATE_DIGITS) + 0.0
    points, offsets, kept = merge_repeated(points, offsets)
    which = np.flatnonzero(np.diff(offsets) > 1)
    if not len(which):
        return Toolpaths.empty(), which
    link = np.zeros(len(points), dtype=bool)
    if ways is not None:
        # The step from a point is that to the next one that is kept.
        link = np.concatenate(ways)[np.append(kept[1:], sum(map(len, ways))) - 1]
        link[offsets[1:] - 1] = False
    paths = Toolpaths(
        points=np.column_stack([points, np.full(len(points), round(height, COORDINATE_DIGITS))]),
        normals=np.broadcast_to([0.0, 0.0, 1.0], (len(points), 3)),
        offsets=offsets,
        layer=np.zeros(len(offsets) - 1, dtype=np.int64),
        kind=np.broadcast_to(kind, len(offsets) - 1),
        closed=np.zeros(len(offsets) - 1, dtype=bool),
        link=link,
    )
    paths, order, _ = in_order(paths.select(np.diff(offsets) > 1))
    return paths, which[order]


def in_order(paths: Toolpaths) -> tuple[Toolpaths, IntArray, IntArray]:
    """Paths in the order of printing: matrix before fibre, and of each the nearest end next.

    Also where they, and their points, were before.
    """
    if not len(paths):
        return paths, paths.layer, np.zeros(0, dtype=np.int64)
    starts, ends = (paths.points[at] for at in (paths.offsets[:-1], paths.offsets[1:] - 1))
    parts, ways = [], []
    for part in (paths.kind != FIBRE).nonzero()[0], (paths.kind == FIBRE).nonzero()[0]:
        nearest, backward, _ = nearest_end_order(starts[part], ends[part])
        parts.append(part[nearest])
        ways.append(backward)
    order, turned = np.concatenate(parts), np.concatenate(ways).tolist()
    rows = [
        np.arange(paths.offsets[k], paths.offsets[k + 1])[:: -1 if back else 1]
        for k, back in zip(order.tolist(), turned, strict=True)
    ]
    # The step on from a point of a path that is turned round is the one that led to it.
    steps = [np.roll(row, -1) if back else row for row, back in zip(rows, turned, strict=True)]
    at = np.concatenate(rows)
    sorted_paths = Toolpaths(
        points=paths.points[at],
        normals=paths.normals[at],
        offsets=np.append(0, np.cumsum(np.diff(paths.offsets)[order])),
        layer=paths.layer[order],
        kind=paths.kind[order],
        closed=(starts == ends).all(axis=1)[order],
        link=paths.link[np.concatenate(steps)],
    )
    return sorted_paths, order, at


@dataclass(frozen=True)
class Stack:
    """The layers of a print and what is to be said of them.

    Attributes
    ----------
    layers : iterable of LaidLayer
        From the first printed to the last; each may be made when it is asked for.
    remarks : tuple of str
        What is doubtful, one line each.
    obstacles : Obstacles, optional
        What a head may touch beside its tip. None over flat layers, the one difference in what is
        asked of a plan: all that is printed lies below the tip, whatever the order.
    """

    layers: Iterable[LaidLayer]
    remarks: tuple[str, ...]
    obstacles: Obstacles | None = None
