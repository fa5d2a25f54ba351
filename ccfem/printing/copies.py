"""Copies of a part on the bed, printed together layer by layer, and where they stand."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import product

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, MATRIX, Toolpaths
from ccfem.printing.bed_layout import BedLayout
from ccfem.printing.beside import GAP, beside
from ccfem.printing.laid_layer import COORDINATE_DIGITS
from ccfem.printing.print_plan import PrintPlan, check_bed

_UP = np.array([0.0, 0.0, 1.0])
_ROUNDING = 1e-6
"""Rounding of places on the bed, mm."""


def arranged(plan: PrintPlan, layout: BedLayout, machine: Machine) -> PrintPlan:
    """Move a plan to its place on the bed, and repeat it for every copy.

    Copies stand in rows, as far apart as the part from the block beside it, with room for the brims
    of both. They are printed together: on every layer first the matrix of all copies, then their
    fibre, so that there is one change of tools a layer. The nozzle travels above all of them, so
    that no head touches a copy. Skirt, block and bar are laid once, round and beside all copies.

    Parameters
    ----------
    plan : PrintPlan
        Of one part in the middle of the bed.

    Raises
    ------
    InputError
        For copies that do not fit, with how many do; for several copies of curved layers; for a
        part that is not on the bed at its place.
    """
    centre = 0.5 * np.array(machine.gcode.bed[:2])
    if layout.count == 1:
        if layout.centre is None:
            return plan
        _check_centre(plan, layout.centre, machine)
        return _repeated(plan, (np.array(layout.centre) - centre)[None])
    check_copies(layout, bool((plan.paths.normals[:, 2] > 1.0 - 1e-9).all()))
    alone = _borders(plan, machine)
    for grid in _grids(layout):
        # Rows may be left incomplete by a number of copies.
        places = _places(alone, grid, machine)[: layout.count]
        shift = _shift(alone, places, layout, machine)
        if shift is not None:
            copied = _repeated(plan, (places + shift).round(COORDINATE_DIGITS))
            said = f"{layout.count} copies, of all of which are fibre, matrix, time and file; "
            said += "indices, virtual test and remarks on strands are of one"
            copied = replace(copied, copies=layout.count, warnings=(said, *plan.warnings))
            check_bed(copied, machine)
            return copied
    most = _most(alone, layout, machine)
    where = "" if layout.centre is None else f"their middle at {_place(layout.centre)}, "
    size, bed = np.ptp(alone.paths.points, axis=0) + machine.matrix_width, machine.gcode.bed
    raise InputError(
        f"{' x '.join(str(number) for number in layout.copies)} copies of {size[0]:.4g} x "
        f"{size[1]:.4g} mm do not fit on the bed of {bed[0]:g} x {bed[1]:g} mm, "
        f"{where}{_gap(machine):.3g} mm apart and with what is printed beside them; "
        f"{most or 'none'} fit{'s' * (most < 2)}: ask for fewer, or turn the part (--turn)"
    )


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


def check_copies(layout: BedLayout, flat: bool) -> None:
    """Refuse several copies of layers that are not flat.

    Raises
    ------
    InputError
        For these.
    """
    if layout.count > 1 and not flat:
        raise InputError(
            f"copies are printed together layer by layer, which needs flat layers; got "
            f"{layout.count} copies of curved ones, where the head would touch its neighbours: "
            "print one at a time, or choose flat layers"
        )


def outline(low: FloatArray, high: FloatArray, layer: float, fibre: bool) -> PrintPlan:
    """Plan of the lines round a box (3,) on the bed, at its top: as much room as a part needs.

    Parameters
    ----------
    layer : float, mm
        Least height of its layers of matrix.
    fibre : bool
        Whether fibre comes as far as matrix.
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


def _gap(machine: Machine) -> float:
    """Distance between copies, mm."""
    return GAP + 2.0 * machine.process.brim_loops * machine.matrix_width


def _grids(layout: BedLayout) -> list[tuple[int, int]]:
    """Numbers of copies along X and Y, the most compact grid first."""
    if len(layout.copies) == 2:
        return [(layout.copies[0], layout.copies[1])]
    count = layout.count
    rows = {-(-count // along) for along in range(1, count + 1)}
    return sorted(((-(-count // k), k) for k in rows), key=lambda grid: (sum(grid), grid[1]))


def _places(alone: PrintPlan, grid: tuple[int, int], machine: Machine) -> FloatArray:
    """Shift of each copy (n, 2) from the middle of all, row by row."""
    pitch = np.ptp(alone.paths.points[:, :2], axis=0) + machine.matrix_width + _gap(machine)
    places = np.array([(x, y) for y, x in product(range(grid[1]), range(grid[0]))], dtype=float)
    return (places - 0.5 * (np.array(grid) - 1.0)) * pitch


def _shift(
    alone: PrintPlan, places: FloatArray, layout: BedLayout, machine: Machine
) -> FloatArray | None:
    """Shift (2,) of all copies to where they and what lies beside them are on the bed, or None.

    Without a centre that is wanted it is the least one.
    """
    bed = np.array(machine.gcode.bed[:2])
    if (np.ptp(places, axis=0) + np.ptp(alone.paths.points[:, :2], axis=0) > bed).any():
        return None
    low, high = _reach(_repeated(alone, places), machine)
    if layout.centre is not None:
        least = most = np.array(layout.centre) - 0.5 * bed
    else:
        least, most = -low, bed - high
    outside = (least < -low - _ROUNDING) | (most > bed - high + _ROUNDING)
    if (outside | (least > most + _ROUNDING)).any():
        return None
    return np.clip(0.0, least, np.maximum(most, least))


def _reach(plan: PrintPlan, machine: Machine) -> tuple[FloatArray, FloatArray]:
    """Least and largest place of the carriage (2,) in a print, beside the part too."""
    around, fibre = beside(plan, machine), plan.paths.of_kind(FIBRE).points[:, :2]
    if around.strand is not None:
        fibre = np.concatenate([fibre, around.strand])
    lines = (plan.paths.points[:, :2], *around.skirt, *around.block, *around.bar)
    places = np.concatenate([*lines, fibre - np.array(machine.gcode.offset[:2])])
    return places.min(axis=0), places.max(axis=0)


def _most(alone: PrintPlan, layout: BedLayout, machine: Machine) -> int:
    """Largest number of copies that fit in full rows."""
    size = np.ptp(alone.paths.points[:, :2], axis=0) + machine.matrix_width
    room = np.array(machine.gcode.bed[:2]) + _gap(machine)
    along, rows = (int(number) for number in np.maximum(room // (size + _gap(machine)), 1))
    most = 0
    for across in range(1, along + 1):
        while rows:
            places = _places(alone, (across, rows), machine)
            if _shift(alone, places, layout, machine) is not None:
                most = max(most, across * rows)
                break
            rows -= 1
    return most


def _repeated(plan: PrintPlan, places: FloatArray) -> PrintPlan:
    """Plan of a part at every place (n, 2), shifted from where it is.

    On every layer matrix comes first at all places, then fibre; every second time the way goes
    back.
    """
    paths, count = plan.paths, len(places)
    fibre = paths.kind == FIBRE
    which, copy = np.divmod(np.arange(len(paths) * count), count)
    # Matrix and fibre of each layer are one pass over the copies.
    _, number = np.unique(np.column_stack([paths.layer, fibre]), axis=0, return_inverse=True)
    back = number.ravel()[which] % 2 == 1
    turn = np.where(back, count - 1 - copy, copy)
    order = np.lexsort([which, turn, fibre[which], paths.layer[which]])
    which, copy = which[order], copy[order]
    sizes = np.diff(paths.offsets)[which]
    offsets = np.append(0, np.cumsum(sizes))
    rows = np.arange(offsets[-1]) + np.repeat(paths.offsets[which] - offsets[:-1], sizes)
    shift = np.column_stack([places[copy], np.zeros(len(copy))])
    points = (paths.points[rows] + np.repeat(shift, sizes, axis=0)).round(COORDINATE_DIGITS)
    trims = plan.trims[np.tile(np.arange(len(plan.trims)), count)]
    trims = trims + np.repeat(np.column_stack([np.zeros(count), places]), len(plan.trims), axis=0)
    return replace(
        plan,
        paths=Toolpaths(
            points=points + 0.0,
            normals=paths.normals[rows],
            offsets=offsets,
            layer=paths.layer[which],
            kind=paths.kind[which],
            closed=paths.closed[which],
            link=paths.link[rows],
        ),
        laid=plan.laid[rows],
        room=plan.room[which],
        short=plan.short[which],
        sparse=plan.sparse[which],
        dropped=count * plan.dropped,
        ended=count * plan.ended,
        outside=count * plan.outside,
        trims=trims,
    )
