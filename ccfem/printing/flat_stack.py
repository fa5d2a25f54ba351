"""Flat layers as they are printed: fibre where it was planned, matrix in all that is left, pads."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.base.parallel import in_processes, repeating
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.hatch import zigzag
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.polylines import line_length
from ccfem.geometry.shapes import Region, open_lines, strings
from ccfem.machine.machine import Machine
from ccfem.paths.plastic.plastic import Plastic
from ccfem.paths.splitting.printed_strands import PrintedStrands, height_over, sections_of
from ccfem.paths.splitting.slabs import Slab, check_cover, slabs_of
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.bed_layout import Place, spun
from ccfem.printing.laid_layer import Below, LaidLayer, Stack, fibre_layer, matrix_layer
from ccfem.printing.matrix_lines import MatrixFill, matrix_fills
from ccfem.printing.support.overhang import overhang
from ccfem.slicing.layers import Layer


def flat_stack(
    strands: PrintedStrands,
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    place: Place,
    support: bool,
    plastic: Plastic,
) -> Stack:
    """Lay fibre on its flat layers, and matrix in all that they leave, from the bed to the top."""
    upright = layers[0].plane.frame
    bottom = float(place.origin[2])
    top = float((mesh.points[np.unique(mesh.corners)] @ place.axes.T)[:, 2].max())
    used = [layer for layer in layers if layer.index in strands.layers]

    def seen(region: Region) -> Region:
        """Region on the bed of one in the plane of the layers."""
        turn = place.axes[:2] @ upright[:2].T
        return shapely.transform(
            region, lambda points: (points @ turn.T if place.spin else points) - place.origin[:2]
        )

    same = strands.repeated(used)
    sections = sections_of([layer for layer in used if same[layer.index] == layer.index], mesh)
    # Layers that are cut down to regions do not show where the part's own sections differ.
    if any(layer.weights.ndim > 1 for layer in used):
        sections = sections_of(used, mesh)
        same = strands.repeated(used, sections)
    first = sorted(set(same.values()))
    borders = {index: seen(section) for index, section in sections.items()}
    placed = _Strands(strands, place, borders)
    above = in_processes(
        lambda index: height_over(placed.lines(index), borders[index], machine), first
    )
    height_of = dict(zip(first, above, strict=True))
    over = {index: height_of[at] for index, at in same.items()}
    slabs = slabs_of(used, bottom, top, machine, over)
    fills = matrix_fills(slabs, layers, mesh, place, spun(machine, place.spin), plastic)
    hanging = overhang(mesh, place.axes[2], machine) if support else None
    in_air = _NONE if hanging is None else seen(hanging.region)
    laid = _layers(slabs, fills, placed, same, in_air, bottom, machine)
    return Stack(laid, tuple(check_cover(slabs, machine)))


@dataclass(frozen=True)
class _Strands:
    """Strands as they are printed, where the part stands, and its borders by layers repeated."""

    printed: PrintedStrands
    place: Place
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
        return [self.place.from_above(path) for path in paths.on_layer(index)]

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
        size = (slab.upper - bottom, slab.height, machine)
        if slab.fibre is not None:
            k = slab.fibre
            return fibre_layer(strands.fibre(k), strands.short(k), strands.borders[same[k]], *size)
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
        return layer.at(slabs[number].upper - bottom)

    return repeating(laid, [what(number) for number in range(len(slabs))], again)


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
