"""Common base of strategies that fill a section with strands at a spacing."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.parallel import in_threads
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.even_steps import OFF, even_steps
from ccfem.geometry.polylines import along_line, angles_between, is_closed, points_along
from ccfem.geometry.shapes import Region, corners_only
from ccfem.geometry.tight_bends import tight_bends, tight_samples
from ccfem.machine.machine import Machine
from ccfem.paths.linking.joining import Joined
from ccfem.paths.planning.strategy import Amount, LayerPlanner
from ccfem.paths.planning.unfolding import off_links, part_of_line
from ccfem.paths.raster.bitmap import Bitmap, bitmap
from ccfem.paths.raster.patterns import Regions
from ccfem.paths.raster.raster_plan import RasterPlan, raster_plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress, flat_layers

SPACING = Amount("spacing", most=1.0, least=20.0)
"""Amount of a strategy whose parameter `spacing` is the distance of strands in fibre widths."""

Turns = Literal["tight", "printable", "cut"]
"""How turns tighter than the machine's minimum radius are treated. "tight": strands follow them;
"printable": they are cut if both sides are long enough for the cutter; "cut": they are all cut, and
parts that are too short are dropped."""


def check_fill(strategy: object) -> None:
    """Check the parameters of strategies with a `spacing`: also choices and a `minimum_length`."""
    check_choices(strategy)
    check_fields(strategy, "spacing", at_least=1.0, unit="fibre width")
    if hasattr(strategy, "minimum_length"):
        check_fields(strategy, "minimum_length", at_least=0.0, unit="mm")


def check_shells(strategy: object) -> None:
    """Check the parameters `shells` and `closest` of a strategy."""
    check_fields(strategy, "shells", at_least=0)
    check_fields(strategy, "closest", at_least=0.5, at_most=1.0, unit="spacings")


def long_enough(paths: Toolpaths, least: float | None, machine: Machine) -> Toolpaths:
    """Paths no shorter than `least`, mm; None for the shortest that the machine can cut."""
    return paths.select(paths.lengths >= (machine.shortest_strand if least is None else least))


def with_turns(
    strategy: Any,
    lines: Sequence[FloatArray],
    machine: Machine,
    link: Sequence[BoolArray] | None = None,
) -> Joined:
    """Cut strands at turns that the machine's fibre cannot follow, if the strategy says so.

    Parameters
    ----------
    strategy : object
        With `turns`; optionally with a `spacing` in fibre widths and a `minimum_length`.
    lines : sequence of (n_i, 2) arrays, mm
    link : sequence of (n_i,) bool arrays, optional
        Which of their steps are marked as links.
    """
    lines = list(lines)
    none = [np.zeros(len(line), dtype=bool) for line in lines]
    joined = Joined(lines, none if link is None else list(link))
    if strategy.turns == "tight":
        return joined
    width, least = machine.fibre_width, getattr(strategy, "minimum_length", None)
    least = max(machine.shortest_strand, least or 0.0)  # the cutter cannot make shorter pieces
    spacing = strategy.spacing if strategy.amount.parameter == "spacing" else 1.0
    every, radius = strategy.turns == "cut", machine.minimum_radius
    return cut_turns(joined, radius, width, least, spacing * width, every)


class Infill(ABC):
    """A strategy that lays polylines, or paths of pixels where its `mode` is "raster".

    Everything that depends only on the section of a layer is computed once for all layers of a part
    with equal sections: see `prepare`.
    """

    spacing: float
    minimum_length: float | None
    mode: Literal["polyline", "raster"]
    turns: Turns = "tight"

    amount: ClassVar[Amount] = SPACING
    in_plane: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_fill(self)

    @property
    def on_axes(self) -> bool:
        """Whether paths keep to the axes of the layer, as those of pixels do."""
        return self.mode == "raster"

    def prepare(self, section: Region, machine: Machine) -> Any:
        """Compute what layers of equal sections share; passed to `strands`, in several threads."""
        return None

    @abstractmethod
    def strands(
        self, layer: Layer, stress: LayerStress, machine: Machine, prepared: Any
    ) -> list[FloatArray]:
        """Strands (n_i, 2), mm, in the plane of a layer, however short."""

    def linked(self, lines: list[FloatArray], prepared: Any, machine: Machine) -> Joined:
        """Strands cut at turns; a strategy may also join their ends by marked links."""
        return with_turns(self, lines, machine)

    @abstractmethod
    def regions(self, image: Bitmap, layer: Layer, stress: LayerStress) -> Regions:
        """Pattern of pixels of a layer."""

    def raster(self, layer: Layer, stress: LayerStress, machine: Machine) -> RasterPlan:
        """Plan one layer on a bitmap of pixels a spacing wide, whatever the mode."""
        image = bitmap(layer.plane.polygon, self.spacing * machine.fibre_width)
        return raster_plan(image, self.regions(image, layer, stress))

    def for_part(
        self, stress: PartStress | None, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Prepare the sections of a part; `stress` is not used for that."""
        if self.mode == "raster":
            return _Prepared(self, {})
        sections = [corners_only(layer.plane.polygon) for layer in layers]
        unequal = list(dict.fromkeys(sections))
        made = in_threads(partial(self.prepare, machine=machine), unequal)
        known = dict(zip(unequal, made, strict=True))
        index = [layer.index for layer in layers]
        return _Prepared(self, {k: known[s] for k, s in zip(index, sections, strict=True)})

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        return self.for_part(None, [layer], machine)(layer, stress, machine)


@dataclass(frozen=True)
class _Prepared:
    """An infill with its prepared data for each layer of a part, by `Layer.index`."""

    infill: Infill
    known: dict[int, Any]

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        infill = self.infill
        if infill.mode == "raster":
            joined = with_turns(infill, infill.raster(layer, stress, machine).lines(), machine)
        else:
            prepared = self.known[layer.index]
            lines = infill.strands(layer, stress, machine, prepared)
            joined = infill.linked(lines, prepared, machine)
        paths = Toolpaths.from_plane(joined.lines, layer, link=joined.link)
        return long_enough(paths, infill.minimum_length, machine)


# Strands cut where they turn more tightly than the fibre can follow.
#
# A fibre that is led round a tighter turn than the machine's radius folds. Cutting it there leaves
# two strands that end beside each other. Where one of them would be too short for the cutter either
# the turn stays, and of all ways to cut a strand the one that keeps the least bent fibre is taken;
# or what is too short goes, and no bend stays.


_ONE_TURN = 3.0
"""Bends nearer to each other than this, in spacings, are one turn."""
_LONGEST = 9.0
"""Longest part of a turn, in spacings, that is left out where a strand is cut; a longer bend, as
that of a ring round a small hole, is no turn between two strands."""
_APART = 0.998
"""Distance, in widths, that the end of a cut strand keeps from the one that begins beside it."""
_TRIM = 1.5
"""Longest piece, in widths, that is taken from the end of a strand for that."""

_FIRSTS = 8
"""Turns at which a ring is tried to be cut first."""
_STUB = 0.4
"""Longest piece behind a corner, in widths, that a cut leaves out with the turn."""
_CORNER = 0.2
"""Least turn of a corner, radians."""

_Pieces = list[tuple[float, float]]
"""Start and end of each by arc length, mm."""
_Marked = tuple[FloatArray, BoolArray]
"""Points (n, d) of a line, and the mask (n,) of its steps that are links."""
_Places = Callable[[FloatArray], FloatArray]
"""Points (k, d) of a line at positions (k,) of its arc length."""


class _Turns(NamedTuple):
    """Bends of a line that are too tight, by arc length, mm.

    The strand before a turn would end at `end` (t,), and the one after it begin at `begin`; `cost`
    is the length that is bent too tightly.
    """

    end: FloatArray
    begin: FloatArray
    cost: FloatArray


def cut_turns(
    joined: Joined,
    radius: float,
    width: float,
    least: float,
    spacing: float | None = None,
    every: bool = False,
) -> Joined:
    """Cut strands at turns tighter than a radius.

    Parameters
    ----------
    joined : Joined
        Lines, and which of their steps are links.
    radius : float, mm
        Tightest turn that stays uncut. A line turns as tightly as the angle between its chords of
        a width before and behind a place, over the width, as the curvature of the evaluator does.
    width : float, mm
        Of a strand.
    least : float, mm
        No cut leaves a strand shorter than this.
    spacing : float, mm, optional
        Of the lines, where it is more than a width.
    every : bool, default False
        Whether bends of any length are cut out and pieces shorter than `least` go; otherwise turns
        stay that cannot be cut without such pieces, and so do longer bends.

    Returns
    -------
    Joined
        The pieces of each line in its order; uncut lines as they were.
    """
    pitch = width if spacing is None else spacing
    result = Joined([], [])
    for line, mark in zip(*joined, strict=True):
        if every:
            parts = _unbent(line, mark, radius, width, least)
        else:
            along = along_line(line)
            pieces = _cut_spans(line, along, radius, width, least, pitch)
            parts = [part_of_line(line, along, mark, *ends) for ends in pieces] or [(line, mark)]
        result.lines.extend(part for part, _ in parts)
        result.link.extend(marked for _, marked in parts)
    return result


def _unbent(
    line: FloatArray,
    link: BoolArray,
    radius: float,
    width: float,
    least: float,
    again: bool = False,
) -> list[_Marked]:
    """Pieces of a line that are long enough between all bends; the line itself where none is bent.

    Pieces are looked at again, just where the evaluator will look: it and the planner take points a
    little aside, so that what keeps the radius by a hair may not do so there.
    """
    along, closed = along_line(line), is_closed(line)
    a = b = np.zeros(0)
    if not again:
        a, b = tight_bends(line, along, closed, radius, width).T
    if not len(a):
        changes = np.append(False, link[1:] != link[:-1])
        ends = np.array([0, len(line)])
        stepped, _, _, _ = even_steps(line, ends, changes, width, OFF * width)
        a = b = tight_samples(stepped, closed, radius, width)
    if not len(a):
        return [(line, link)]
    pieces = _between_bends(line, along, link, a, b, width, least)
    parts = [part_of_line(line, along, link, *ends) for ends in pieces]
    return [piece for part in parts for piece in _unbent(*part, radius, width, least, True)]


def _between_bends(
    line: FloatArray,
    along: FloatArray,
    link: BoolArray,
    a: FloatArray,
    b: FloatArray,
    width: float,
    least: float,
) -> _Pieces:
    """Pieces of a line that are long enough between its bends from `a` to `b`, off links at ends.

    The end of a closed line's piece may lie beyond its length, for it runs on over the start.
    """
    size, closed, middle = float(along[-1]), is_closed(line), 0.5 * (a + b)
    # A piece is looked at in equal steps of about a width: the first may be a little shorter.
    step = width / (1.0 + 0.5 * width / least)
    stop, start = np.minimum(a + step, middle), np.maximum(b - step, middle)
    stop, start = _off_corners(stop, start, _sharp_turns(line, along, closed), _STUB * width)
    if closed:
        stop = np.append(stop[1:], stop[0] + size)
    else:
        start, stop = np.append(0.0, start), np.append(stop, size)
    start, stop = off_links(start, stop, along, link)
    kept = stop - start >= least
    start, stop = start[kept], stop[kept]
    # Of two that meet in a turn the first ends a width before the second, or that begins after it.
    places, count = _line_places(line, along, closed), len(start)
    for k in range(count if closed else count - 1):
        after = (k + 1) % count
        shorter = _room(places, float(stop[k]), -1, float(start[after]), width)
        if stop[k] - start[k] - shorter >= least:
            stop[k] -= shorter
        else:
            start[after] += _room(places, float(start[after]), 1, float(stop[k]), width)
    kept = stop - start >= least
    return list(zip(start[kept].tolist(), stop[kept].tolist(), strict=True))


def _cut_spans(
    line: FloatArray, along: FloatArray, radius: float, width: float, least: float, pitch: float
) -> _Pieces:
    """Start and end of each piece by arc length; none where nothing is cut.

    The end of a closed line's piece may lie beyond its length, for it runs on over the start.
    """
    size = float(along[-1])
    if size < least or size < 4.0 * width:
        return []
    closed = is_closed(line)
    turns = _turns(line, along, closed, radius, width, pitch)
    if not len(turns.cost):
        return []
    if not closed:
        cuts = _chosen_turns(turns, size, least)
        starts = [0.0, *turns.begin[cuts].tolist()]
        return list(zip(starts, [*turns.end[cuts].tolist(), size], strict=True)) if cuts else []
    # A ring is cut at one turn first: of a few the one from which the others keep the least bent.
    firsts = np.argsort(-np.round(turns.cost, 3), kind="stable")[:_FIRSTS]
    tried = [_ring_pieces(turns, int(first), size, least) for first in firsts]
    return min(tried, key=lambda trial: round(trial[0], 3))[1]


def _ring_pieces(turns: _Turns, first: int, size: float, least: float) -> tuple[float, _Pieces]:
    """Bent length that is kept where a ring is cut at one turn first, and its pieces."""
    begin, whole = float(turns.begin[first]), float(turns.cost.sum())
    rest = np.roll(np.arange(len(turns.cost)), -first)[1:]
    shift = np.where(turns.end[rest] < begin, size, 0.0)
    ends, begins = turns.end[rest] + shift - begin, turns.begin[rest] + shift - begin
    stop = float(turns.end[first]) - begin
    stop += size if stop <= 0.0 else 0.0
    if stop < least:
        return whole, []
    cuts = _chosen_turns(_Turns(ends, begins, turns.cost[rest]), stop, least)
    kept = whole - float(turns.cost[first] + turns.cost[rest][cuts].sum())
    starts = [0.0, *begins[cuts].tolist()]
    pieces = zip(starts, [*ends[cuts].tolist(), stop], strict=True)
    return kept, [(begin + a, begin + b) for a, b in pieces]


def _turns(
    line: FloatArray, along: FloatArray, closed: bool, radius: float, width: float, pitch: float
) -> _Turns:
    """Find the turns of a line that are tighter than a radius and short enough to be left out."""
    a, b = tight_bends(line, along, closed, radius, width).T
    if not len(a):
        return _Turns(a, a, a)
    joined = np.concatenate([[True], a[1:] - b[:-1] > _ONE_TURN * pitch - 2.0 * width])
    cost = np.add.reduceat(b - a, np.flatnonzero(joined))
    a, b = a[joined], b[np.append(joined[1:], True)]
    middle = 0.5 * (a + b)
    end, begin = np.minimum(a + width, middle), np.maximum(b - width, middle)
    end, begin = _off_corners(end, begin, _sharp_turns(line, along, closed), _STUB * width)
    kept = begin - end <= _LONGEST * pitch
    end, begin, cost = end[kept], begin[kept], cost[kept]
    places = _line_places(line, along, closed)
    for k in range(len(end)):
        end[k] -= _room(places, float(end[k]), -1, float(begin[k]), width)
    return _Turns(end, begin, cost)


def _line_places(line: FloatArray, along: FloatArray, closed: bool) -> _Places:
    """Points of a line by arc length: round and round a closed one, no farther than an end."""
    size = float(along[-1])
    return lambda at: points_along(line, along, at % size if closed else at)


def _room(places: _Places, tip: float, way: int, other: float, width: float) -> float:
    """Length to take from the tip of a strand so that it keeps off the one that starts beside it.

    It goes back along the line by `way`, -1 or 1; the other strand leaves its own tip by `-way`.
    """
    beyond = shapely.linestrings(places(np.linspace(other, other - 4.0 * way * width, 33)))
    taken = np.linspace(0.0, _TRIM * width, 25)
    clear = shapely.distance(shapely.points(places(tip + way * taken)), beyond) >= _APART * width
    return float(taken[int(np.argmax(clear))] if clear.any() else taken[-1])


def _sharp_turns(line: FloatArray, along: FloatArray, closed: bool) -> FloatArray:
    """Places of a line at which it turns by more than it may on a stub, of a ring twice round."""
    step = np.diff(line, axis=0)
    after = np.roll(step, -1, axis=0)
    corner = along[1:][angles_between(step, after) > _CORNER]
    return np.append(corner, corner + along[-1]) if closed else corner[corner < along[-1]]


def _off_corners(
    end: FloatArray, begin: FloatArray, corner: FloatArray, stub: float
) -> tuple[FloatArray, FloatArray]:
    """Move ends and beginnings to corners that they lie behind, or before, by a stub at most."""
    if not len(corner):
        return end, begin
    before = np.searchsorted(corner, end, side="right") - 1
    passed = np.where(before >= 0, end - corner[before], np.inf)
    after = np.minimum(np.searchsorted(corner, begin), len(corner) - 1)
    ahead = np.where(corner[after] >= begin, corner[after] - begin, np.inf)
    end = np.where(passed <= stub, corner[before], end)
    return end, np.where(ahead <= stub, corner[after], begin)


def _chosen_turns(turns: _Turns, size: float, least: float) -> list[int]:
    """Which turns to cut, so that the sum of the costs of the others is least."""
    count = len(turns.cost)
    starts = np.append(0.0, turns.begin)
    ends = np.append(turns.end, size)
    before = np.concatenate([[0.0, 0.0], np.cumsum(turns.cost)])  # of turns up to each start
    best = np.full(count + 2, np.inf)
    best[0] = 0.0
    source = np.zeros(count + 2, dtype=np.int64)
    for k in range(1, count + 2):
        # From a cut before to this one: the turns between stay.
        total = best[:k] + before[k] - before[1 : k + 1]
        total[ends[k - 1] - starts[:k] < least] = np.inf
        source[k] = int(np.argmin(np.round(total, 6)))
        best[k] = total[source[k]]
    if not np.isfinite(best[-1]):
        return []
    cuts = []
    k = int(source[-1])
    while k > 0:
        cuts.append(k - 1)
        k = int(source[k])
    return cuts[::-1]


# Sections without room for a path of the minimum length, unless it turns.


_WORTH_A_WORD = 0.1


def short_share(layers: Sequence[Layer], machine: Machine) -> float:
    """Share of the sections in pieces that are shorter than the minimum path length.

    The pieces are the region that the middle of a strand can reach inside the section. Their length
    is the longer side of their smallest bounding rectangle. Curved layers do not count.
    """
    half, whole, short = 0.5 * machine.fibre_width, 0.0, 0.0
    for layer in flat_layers(layers):
        section = layer.plane.polygon
        whole += section.area
        for piece in shapely.get_parts(shapely.buffer(section, -half)):
            if _extent(piece) < machine.shortest_strand:
                short += shapely.intersection(section, shapely.buffer(piece, half)).area
    return short / whole if whole else 0.0


def about_short_pieces(layers: Sequence[Layer], machine: Machine) -> str:
    """Words, starting with a semicolon, on a part that is short of room; empty if it is not."""
    share = short_share(layers, machine)
    if share < _WORTH_A_WORD:
        return ""
    return (
        f"; {share:.0%} of the section lies in pieces less than {machine.shortest_strand:.0f} mm "
        "across, the least length of a path"
    )


def _extent(piece: shapely.Polygon) -> float:
    """Longer side of the smallest bounding rectangle of a piece, mm."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(piece))
    return float(np.linalg.norm(np.diff(corners, axis=0), axis=1).max(initial=0.0))
