"""Pads under fibre without a part below it: columns of matrix down to the bed or the part."""

from collections.abc import Sequence

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.hatch import zigzag
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.polylines import line_length
from ccfem.geometry.shapes import Region, open_lines, strings
from ccfem.machine.machine import Machine

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
    machine : Machine

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
