"""Parts on one bed, and copies of them, printed together, and where they stand."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.geometry.polylines import extent
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, MATRIX, Toolpaths
from ccfem.printing.bed_layout import BedLayout
from ccfem.printing.beside import GAP, beside
from ccfem.printing.laid_layer import COORDINATE_DIGITS
from ccfem.printing.poses import poses
from ccfem.printing.print_plan import PrintPlan, Standing, check_bed

# Boxes laid out in rows on a bed, the most compact way first.


def shelves(sizes: FloatArray, gap: float, room: FloatArray) -> Iterator[FloatArray]:
    """Ways to lay boxes out in rows, one behind the other.

    The deepest boxes come first, each row from left to right, as long as the first few of them
    together. (Next-fit decreasing height: Coffman et al. 1980, SIAM J. Comput. 9, 808.)

    Parameters
    ----------
    sizes : (n, 2) array, mm
    gap : float, mm
        Least distance of two boxes.
    room : (2,) array, mm
        Size beyond which no way is of use.

    Yields
    ------
    (n, 2) array, mm
        Corner of each box with the least coordinates, from that of all; in order of half the
        perimeter of the box round all.
    """
    order = np.lexsort([np.arange(len(sizes)), -sizes[:, 1]])
    ways = []
    for length in (np.cumsum(sizes[order, 0] + gap) - gap).tolist():
        if length > room[0]:
            break
        corners = _in_rows(sizes, order.tolist(), gap, max(length, float(sizes[:, 0].max())))
        extent = (corners + sizes).max(axis=0)
        if (extent <= room).all():
            ways.append((float(extent.sum().round(6)), float(extent[1].round(6)), corners))
    for *_, corners in sorted(ways, key=lambda way: way[:2]):
        yield corners


def _in_rows(sizes: FloatArray, order: list[int], gap: float, length: float) -> FloatArray:
    """Corners (n, 2) of boxes in rows of at most a length."""
    corners = np.zeros_like(sizes)
    x, y, depth = 0.0, 0.0, 0.0
    for k in order:
        width, deep = sizes[k].tolist()
        if x > 0.0 and x + width > length + 1e-6:
            x, y, depth = 0.0, y + depth + gap, 0.0
        corners[k] = x, y
        x, depth = x + width + gap, max(depth, deep)
    return corners


_UP = np.array([0.0, 0.0, 1.0])
_ROUNDING = 1e-6
"""Rounding of places on the bed, mm."""
_THICKNESS_DIGITS = 6
"""Decimals of the thickness of layers that are one."""


@dataclass(frozen=True)
class _Spots:
    """Which part (n,) stands where, as a shift (n, 2) from the middle of the bed, mm."""

    of: IntArray
    shift: FloatArray


@dataclass(frozen=True)
class _Part:
    """A part that is laid out: a plan that needs as much room, and its stack of layers."""

    border: PrintPlan
    layout: BedLayout
    stack: int
    name: str


def arranged(
    plans: Sequence[PrintPlan],
    layouts: Sequence[BedLayout],
    machine: Machine,
    names: Sequence[str] = ("",),
) -> PrintPlan:
    """Print plans together, each at its place on the bed and as often as it is wanted.

    Copies of a part are the same plan several times. Parts without a centre are laid out in rows
    (`ccfem.printing.together`), as far apart as a part from the block beside it, with room for the
    brims of both, and for a head that leans over curved layers. They are printed together, the
    lowest layer of all next: of layers at one height first the matrix of all parts, then their
    fibre, so that there is one change of tools for all parts of the same layers. The nozzle travels
    above all of them, so that no head touches a part. Skirt and bar are laid once, and a block
    for all parts of the same layers.

    Parameters
    ----------
    plans : sequence of PrintPlan
        Each of one part in the middle of the bed.
    layouts : sequence of BedLayout
        Of each part; its spin is in its plan already.
    names : sequence of str
        Of the parts, for messages.

    Raises
    ------
    InputError
        For parts that do not fit, with how many do; for a part that is not on the bed at its place,
        or too near to another; and where the head would come lower beside its neighbours than it
        is known.
    """
    count = sum(layout.count for layout in layouts)
    stacks = _stacks(plans)
    if count == 1:
        place = _only_place(plans[0], layouts[0], machine)
        spots = _Spots(np.zeros(1, dtype=np.int64), place[None])
    else:
        room = max(GAP, *(_head_room(plan, machine) for plan in plans))
        borders = [_borders(plan, machine) for plan in plans]
        parts = [_Part(*one) for one in zip(borders, layouts, stacks, names, strict=True)]
        brim = machine.process.brim_loops * machine.matrix_width
        spots = _fitting(parts, room + 2.0 * brim, machine)
    moved = count > 1 or layouts[0].centre is not None
    whole = _merged(plans, spots, stacks) if moved else plans[0]
    standing = [
        Standing(names[part], *((end[:2] + shift).tolist() for end in _ends(plans[part])))
        for part, shift in zip(spots.of.tolist(), spots.shift, strict=True)
    ]
    whole = replace(whole, standing=tuple(standing), warnings=_said(plans, names, count))
    if count > 1:
        check_bed(whole, machine)
    return whole


def _said(plans: Sequence[PrintPlan], names: Sequence[str], count: int) -> tuple[str, ...]:
    """Say what is doubtful in all plans."""
    if len(plans) > 1:
        named = zip(names, plans, strict=True)
        return tuple(f"{name}: {line}" for name, plan in named for line in plan.warnings)
    remark = f"{count} copies, of all of which are fibre, matrix, time and file; "
    remark += "indices, virtual test and remarks on strands are of one"
    return (*([remark] if count > 1 else []), *plans[0].warnings)


def _ends(plan: PrintPlan) -> tuple[FloatArray, FloatArray]:
    """Least and largest coordinates (3,) of the lines of a plan."""
    return extent(plan.paths.points)


def _only_place(plan: PrintPlan, layout: BedLayout, machine: Machine) -> FloatArray:
    """Shift of one part to its place on the bed."""
    if layout.centre is None:
        return np.zeros(2)
    _check_centre(plan, layout.centre, machine)
    return np.array(layout.centre) - 0.5 * np.array(machine.gcode.bed[:2])


def _check_centre(plan: PrintPlan, place: tuple[float, float], machine: Machine) -> None:
    """Refuse a place of a part that is in the middle of the bed so far."""
    bed = np.array(machine.gcode.bed[:2])
    low, high = _reach(plan, machine)
    least, most = 0.5 * bed - low, 1.5 * bed - high
    if (least > most + _ROUNDING).any():
        return  # it has no place at all, which is said when it is printed
    if (place < least - _ROUNDING).any() or (place > most + _ROUNDING).any():
        raise InputError(
            f"with its middle at {_place(place)} mm the part, or what is printed beside it, lies "
            f"beside the bed of {_place(bed)} mm: choose X from {least[0]:.4g} to {most[0]:.4g} "
            f"and Y from {least[1]:.4g} to {most[1]:.4g}"
        )


def _place(place: Iterable[float]) -> str:
    """Two numbers as they are said."""
    return ", ".join(f"{value:.6g}" for value in place)


def _head_room(plan: PrintPlan, machine: Machine) -> float:
    """Distance that a head needs from parts that are printed as far as this one, mm.

    Flat layers lie as high as all that is printed. On curved ones the tip of the head is lower, and
    its cone reaches aside as far as the others are higher; it leaves along its own axis, by which
    it goes away from what stands beside it.
    """
    paths = plan.paths
    lower = plan.top[np.repeat(paths.layer, np.diff(paths.offsets))] - paths.points[:, 2]
    if (paths.normals[:, 2] > 1.0 - 1e-9).all():
        return 0.0
    length, half = machine.head_length, np.radians(machine.head_angle)
    if lower.max() > length:
        raise InputError(
            f"on curved layers the tip of the head comes {lower.max():.1f} mm below what is "
            f"printed of the part beside it, but machine.head_length says no more than {length:g} "
            "mm of the head: print one part at a time"
        )
    tilt = np.arccos(np.clip(poses(paths.normals, _UP, machine)[:, 2], -1.0, 1.0))
    side = np.minimum(tilt + half, 0.5 * np.pi)
    whole = length * (np.sin(side) / np.cos(half) + np.sin(tilt))
    return float(np.minimum(lower * np.tan(np.minimum(side, 1.57)), whole).max())


def outline(low: FloatArray, high: FloatArray, layer: float, fibre: bool) -> PrintPlan:
    """Plan of the lines round a box (3,) on the bed, at its top: as much room as a part needs.

    Its layers of matrix are at least `layer` mm high; `fibre` says whether that comes as far.
    """
    turns = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
    ring = np.column_stack([low[:2] + turns * (high - low)[:2], np.full(5, high[2])])
    kinds = [MATRIX, FIBRE] if fibre else [MATRIX]
    paths = Toolpaths(
        points=np.tile(ring, (len(kinds), 1)),
        normals=np.tile(_UP, (5 * len(kinds), 1)),
        offsets=5 * np.arange(len(kinds) + 1),
        layer=np.arange(len(kinds)),
        kind=np.array(kinds),
        closed=np.ones(len(kinds), dtype=bool),
    )
    return PrintPlan(paths, np.full(len(kinds), high[2]), np.full(len(kinds), layer))


def _borders(plan: PrintPlan, machine: Machine) -> PrintPlan:
    """Plan that needs as much room as another, with little in it.

    Rings of its first layer, for the brim; a line through all that is farthest out in it, for the
    skirt; and the box round all, for what stands beside.
    """
    paths = plan.paths
    fibre = paths.of_kind(FIBRE)
    first = paths.on_layer(int(paths.layer.min()))
    hull = shapely.get_coordinates(shapely.convex_hull(shapely.MultiPoint(first.points)))[:-1]
    border = np.column_stack([hull, np.full(len(hull), first.points[0, 2])])
    skirt = Toolpaths(
        points=border,
        normals=np.tile(_UP, (len(border), 1)),
        offsets=np.array([0, len(border)]),
        layer=np.zeros(1, dtype=np.int64),
        kind=np.full(1, MATRIX),
        closed=np.zeros(1, dtype=bool),
    )
    rings = first.select(first.closed)
    matrix = np.setdiff1d(paths.layer, fibre.layer)
    least = float(plan.thickness[matrix].min(initial=machine.highest_line))
    box = outline(paths.points.min(axis=0), paths.points.max(axis=0), least, False).paths
    parts = [skirt, replace(rings, layer=0 * rings.layer), replace(box, layer=box.layer + 1)]
    if len(fibre):
        ends = (fibre.points.min(axis=0), fibre.points.max(axis=0), least, True)
        inner = outline(*ends).paths.of_kind(FIBRE)
        parts.append(replace(inner, layer=inner.layer + 1))
    return PrintPlan(Toolpaths.concatenate(parts), np.full(3, box.points[0, 2]), np.full(3, least))


# Where parts stand: in rows, on the bed with all that is laid beside them.


def _fitting(parts: Sequence[_Part], gap: float, machine: Machine) -> _Spots:
    """Spots of all parts; raise `InputError` where there are none."""
    spots = _fit(parts, gap, machine)
    if spots is not None:
        return spots
    counts = [part.layout.count for part in parts]
    before = np.cumsum([0, *counts[:-1]])
    fits, fails = 0, sum(counts)
    while fails - fits > 1:  # the first so many of them
        some = (fits + fails) // 2
        left = np.clip(some - before, 0, counts).tolist()
        few = [
            replace(part, layout=replace(part.layout, copies=(k,)))
            for part, k in zip(parts, left, strict=True)
            if k
        ]
        fits, fails = (fits, some) if _fit(few, gap, machine) is None else (some, fails)
    bed = machine.gcode.bed
    raise InputError(
        f"{' and '.join(_words(part, machine) for part in parts)} do not fit on the bed of "
        f"{bed[0]:g} x {bed[1]:g} mm, {gap:.3g} mm apart and with what is printed beside them; "
        f"{fits or 'none'} fit{'s' * (fits < 2)}: ask for fewer, or turn the part (--turn)"
    )


def _words(part: _Part, machine: Machine) -> str:
    """Say how many of a part are wanted, and its size."""
    low, high = _ends(part.border)
    size, layout = high - low + machine.matrix_width, part.layout
    many = " x ".join(str(number) for number in layout.copies) + " copies" * (layout.count > 1)
    place = "" if layout.centre is None else f" with their middle at {_place(layout.centre)}"
    return f"{many} of {part.name}{', ' * bool(part.name)}{size[0]:.4g} x {size[1]:.4g} mm{place}"


def _fit(parts: Sequence[_Part], gap: float, machine: Machine) -> _Spots | None:
    """Spots of parts where they and what lies beside them are on the bed, or None.

    Parts without a centre are moved out of the middle of the bed as little as needed.
    """
    bed, plans = np.array(machine.gcode.bed[:2]), [part.border for part in parts]
    stacks = [part.stack for part in parts]
    free = [k for k, part in enumerate(parts) if part.layout.centre is None]
    groups = [*([free] if free else []), *([k] for k in range(len(parts)) if k not in free)]
    others = [next(_ways(parts, group, gap, machine), None) for group in groups[1:]]
    placed = [spots for spots in others if spots is not None]
    if len(placed) < len(others):
        return None
    for first in _ways(parts, groups[0], gap, machine):
        every = [first, *placed]
        spots = _Spots(
            *(np.concatenate([getattr(one, x) for one in every]) for x in ("of", "shift"))
        )
        if placed:
            _check_apart(parts, spots, gap, machine)
        low, high = _reach(_merged(plans, spots, stacks), machine)
        least, most = -low, bed - high
        shift = np.clip(0.0, least, np.maximum(most, least)) * (len(groups) == 1 and bool(free))
        if (shift >= least - _ROUNDING).all() and (shift <= most + _ROUNDING).all():
            return _Spots(spots.of, (spots.shift + shift).round(COORDINATE_DIGITS))
    return None


def _check_apart(parts: Sequence[_Part], spots: _Spots, gap: float, machine: Machine) -> None:
    """Refuse parts at given places that are nearer to each other than a gap."""
    ends = [_ends(part.border) for part in parts]
    low, high = (np.array([end[k][:2] for end in ends])[spots.of] + spots.shift for k in (0, 1))
    free = np.maximum(low[None] - high[:, None], low[:, None] - high[None]).max(axis=2)
    free[np.diag_indices(len(free))] = np.inf
    free -= machine.matrix_width
    one, other = np.unravel_index(free.argmin(), free.shape)
    if free[one, other] < gap - _ROUNDING:
        names = [parts[int(spots.of[k])].name for k in (one, other)]
        raise InputError(
            f"{names[0]} and {names[1]} stand {max(float(free[one, other]), 0.0):.3g} mm apart, "
            f"but need {gap:.3g}: give other centres (bed.centre), or none at all"
        )


def _ways(
    parts: Sequence[_Part], group: Sequence[int], gap: float, machine: Machine
) -> Iterator[_Spots]:
    """Ways to lay out a group of parts in rows, the most compact first.

    The middle of all is that of the bed, or where the one part of a group is wanted.
    """
    bed, width = np.array(machine.gcode.bed[:2]), machine.matrix_width
    of, inner, first, sizes = [], [], [], []
    for k in group:
        low, high = _ends(parts[k].border)
        size = (high - low)[:2] + width
        copies = parts[k].layout.copies
        grid = (1, 1) if len(copies) == 1 else copies
        places = np.array([(x, y) for y, x in product(range(grid[1]), range(grid[0]))])
        for _ in range(copies[0] if len(copies) == 1 else 1):
            of.append(np.full(len(places), k))
            inner.append(places * (size + gap))
            first.append(np.tile(low[:2], (len(places), 1)))
            sizes.append(np.array(grid) * (size + gap) - gap)
    owner, lows, lengths = np.concatenate(of), np.concatenate(first), [len(one) for one in of]
    centre = parts[group[0]].layout.centre
    for corners in shelves(np.array(sizes), gap, bed):
        at = np.repeat(corners, lengths, axis=0) + np.concatenate(inner)
        shift, order = at - lows, np.lexsort(at.T.round(COORDINATE_DIGITS))
        if centre is None:
            shift += 0.5 * (bed + width - (corners + sizes).max(axis=0))
        else:
            shift += np.array(centre) - 0.5 * (bed + shift.min(axis=0) + shift.max(axis=0))
        yield _Spots(owner[order], shift[order])


def _reach(plan: PrintPlan, machine: Machine) -> tuple[FloatArray, FloatArray]:
    """Least and largest place of the carriage (2,) in a print, beside the part too."""
    around, fibre = beside(plan, machine), plan.paths.of_kind(FIBRE).points[:, :2]
    if around.strand is not None:
        fibre = np.concatenate([fibre, around.strand])
    blocks = chain.from_iterable(around.blocks)
    lines = (plan.paths.points[:, :2], *around.skirt, *blocks, *around.bar)
    places = np.concatenate([*lines, fibre - np.array(machine.gcode.offset[:2])])
    return places.min(axis=0), places.max(axis=0)


# One plan of all: layer by layer, what is lowest next.


def _levels(plan: PrintPlan) -> FloatArray:
    """Rows (S, 4) that layers have in common which are printed as one, in their order.

    These are the top, which of the layers with this top, whether it has fibre, and the thickness.
    """
    top = plan.top.round(COORDINATE_DIGITS)
    same = np.arange(len(top)) - np.searchsorted(top, top)
    fibre = np.isin(np.arange(len(top)), plan.paths.layer[plan.paths.kind == FIBRE])
    return np.column_stack([top, same, fibre, plan.thickness.round(_THICKNESS_DIGITS)])


def _stacks(plans: Sequence[PrintPlan]) -> list[int]:
    """Find the stack of layers of each plan, that with the lowest one first."""
    levels = [_levels(plan)[:, [0, 3]] for plan in plans]
    known = sorted({tuple(level.ravel().tolist()) for level in levels})
    return [known.index(tuple(level.ravel().tolist())) for level in levels]


def _merged(plans: Sequence[PrintPlan], spots: _Spots, stacks: Sequence[int]) -> PrintPlan:
    """Plan of all parts, each shifted from where it is.

    On every layer matrix comes first at all spots, then fibre; every second time the way goes back.
    """
    count = len(spots.of)
    tops, sizes = (np.concatenate([getattr(p, x) for p in plans]) for x in ("top", "thickness"))
    levels = np.concatenate([_levels(plan) for plan in plans])
    _, first, number = np.unique(levels, axis=0, return_index=True, return_inverse=True)
    edges = np.cumsum([len(plan.top) for plan in plans])[:-1]
    numbers = np.split(number.ravel(), edges)
    renamed = [
        replace(plan.paths, layer=layers[plan.paths.layer])
        for plan, layers in zip(plans, numbers, strict=True)
    ]
    paths = renamed[0] if len(renamed) == 1 else Toolpaths.concatenate(renamed)
    fibre = paths.kind == FIBRE
    at = [np.flatnonzero(spots.of == k) for k in range(len(plans))]
    begins = np.cumsum([0, *(len(plan.paths) for plan in plans)])
    pairs = list(zip(begins[:-1], begins[1:], at, strict=True))
    which = np.concatenate([np.repeat(np.arange(i, j), len(here)) for i, j, here in pairs])
    spot = np.concatenate([np.tile(here, j - i) for i, j, here in pairs])
    # Matrix and fibre of each layer are one pass over the spots.
    _, turn = np.unique(np.column_stack([paths.layer, fibre]), axis=0, return_inverse=True)
    back = turn.ravel()[which] % 2 == 1
    way = np.where(back, count - 1 - spot, spot)
    order = np.lexsort([which, way, fibre[which], paths.layer[which]])
    which, spot = which[order], spot[order]
    lengths = np.diff(paths.offsets)[which]
    offsets = np.append(0, np.cumsum(lengths))
    rows = np.arange(offsets[-1]) + np.repeat(paths.offsets[which] - offsets[:-1], lengths)
    shift = np.column_stack([spots.shift[spot], np.zeros(len(spot))])
    points = (paths.points[rows] + np.repeat(shift, lengths, axis=0)).round(COORDINATE_DIGITS)

    def column(name: str) -> NDArray[Any]:
        parts = [getattr(plan, name) for plan in plans]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def total(name: str) -> float:
        return float(sum(getattr(plans[k], name) for k in spots.of.tolist()))

    trims = [
        np.column_stack(
            [numbers[k][plans[k].trims[:, 0].astype(int)], plans[k].trims[:, 1:] + place]
        )
        for k, place in zip(spots.of.tolist(), spots.shift, strict=True)
    ]
    touched = np.sum([plans[k].touched for k in spots.of.tolist()], axis=0)
    return PrintPlan(
        Toolpaths(
            points=points + 0.0,
            normals=paths.normals[rows],
            offsets=offsets,
            layer=paths.layer[which],
            kind=paths.kind[which],
            closed=paths.closed[which],
            link=paths.link[rows],
        ),
        tops[first],
        sizes[first],
        laid=column("laid")[rows],
        room=column("room")[which],
        short=column("short")[which],
        sparse=column("sparse")[which],
        stack=np.array(stacks)[spots.of[spot]],
        trims=np.concatenate(trims),
        dropped=total("dropped"),
        ended=total("ended"),
        outside=total("outside"),
        touched=(float(touched[0]), float(touched[1]), float(touched[2])),
    )
