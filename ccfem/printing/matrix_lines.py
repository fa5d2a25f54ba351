"""Lines of matrix layers: a contour, a zigzag inside it, and lines in the gaps."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from scipy.spatial import Voronoi

from ccfem.base.arrays import FloatArray
from ccfem.base.parallel import in_processes
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.hatch import zigzag
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.shapes import Region, corners_only, open_lines, strings
from ccfem.machine.machine import Machine
from ccfem.paths.splitting.slabs import Slab
from ccfem.slicing.slicers.planar import Planar

_OVERLAP = 0.25
"""Overlap of the ends of the zigzag with the contour, in line widths. Our choice."""


@dataclass(frozen=True)
class MatrixFill:
    """Lines that fill a layer of matrix, on the bed.

    Attributes
    ----------
    lines : list of (n, 2) arrays, mm
    widths : list of float, mm
        Of each line; less than the machine's in gaps.
    """

    section: Region = field(default_factory=shapely.Polygon)
    lines: list[FloatArray] = field(default_factory=list)
    widths: list[float] = field(default_factory=list)


def matrix_fills(
    slabs: Sequence[Slab],
    mesh: TetMesh,
    frame: FloatArray,
    origin: FloatArray,
    machine: Machine,
) -> list[MatrixFill | None]:
    """Find the lines that fill each slab of matrix; None for a slab of fibre.

    The zigzag turns from one layer of matrix to the next.

    Parameters
    ----------
    slabs : sequence of Slab
        From the bed to the top.
    mesh : TetMesh
        The part.
    frame : (3, 3) array
        Rows are the axes of the bed in the frame of the mesh.
    origin : (2,) array, mm
        Subtracted from X and Y along these axes.
    """
    width, profile = machine.matrix_width, machine.gcode
    # In a narrower gap a line of the least height would be higher than its shape allows.
    narrow = machine.least_line / machine.line_shape
    of_matrix = [k for k, slab in enumerate(slabs) if slab.fibre is None]
    fills: list[MatrixFill | None] = [None] * len(slabs)
    for k in of_matrix:
        fills[k] = MatrixFill()
    middles = tuple(0.5 * (slabs[k].lower + slabs[k].upper) for k in of_matrix)

    layers = Planar(heights=middles).cut(mesh, frame[2]) if middles else ()

    def on_bed(points: FloatArray) -> FloatArray:
        return layers[0].plane.to_space(points) @ frame[:2].T - origin  # at any height

    def filled(section: Region, angle: float) -> MatrixFill:
        contours = offset_rings(section, 0.5 * width, width, width, 1)
        inside = zigzag(section, (1.5 - _OVERLAP) * width, width, width, float(np.radians(angle)))
        lines = [ring for level in contours for ring in level] + inside
        gaps, widths = gap_lines(section, lines, width, narrow)
        return MatrixFill(
            shapely.transform(section, on_bed),
            [on_bed(line) for line in lines + gaps],
            [width] * len(lines) + widths,
        )

    # Layers of equal section, filled in the same direction, are filled once.
    asked = [
        (
            corners_only(layer.plane.polygon),
            (profile.matrix_angle + profile.matrix_turn * layer.index) % 360.0,
        )
        for layer in layers
    ]
    unequal = list(dict.fromkeys(asked))
    made = dict(zip(unequal, in_processes(filled, *zip(*unequal, strict=True)), strict=True))
    for layer, key in zip(layers, asked, strict=True):
        fills[of_matrix[layer.index]] = made[key]
    return fills


# Lines of matrix that a contour and a zigzag leave out: in narrow walls and beside holes.


_NARROW = 0.3
"""Least width of a gap that gets a line, in line widths. Our choice."""
_SMALL = 1.0
"""Least area of a gap and length of a line in it, in squares of a line width and in widths."""
_STEP = 0.2
"""Distance between points on the border of a gap, in line widths."""
_OPPOSITE = 0.8
"""Least chord between opposite points of the border, over twice the distance to the middle: a line
through the middle ends before it branches into corners."""
_ARC = 4
"""Segments per quarter circle."""


def gap_lines(
    section: Region, lines: Sequence[FloatArray], width: float, narrow: float = 0.0
) -> tuple[list[FloatArray], list[float]]:
    """Lines along the middle of the gaps that lines of a width leave in a section.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    lines : sequence of (n, 2) arrays, mm
        Lines that fill it so far.
    width : float, mm
        Of a line, > 0.
    narrow : float, mm
        Least width of a gap that gets a line, if that is more than 0.3 line widths.

    Returns
    -------
    lines : list of (n, 2) arrays, mm
        The parts of the medial axes of the gaps that pass between opposite sides.
    widths : list of float, mm
        Of the gap along each line, its mean.
    """
    # GEOS stumbles over the union of thousands of buffers, and its buffer of all may be invalid.
    covered = shapely.buffer(shapely.multilinestrings(strings(lines)), 0.5 * width, quad_segs=_ARC)
    gaps = shapely.difference(section, shapely.make_valid(covered))
    reach = 0.5 * max(narrow, _NARROW * width)
    wide = shapely.buffer(gaps, -reach, quad_segs=_ARC)
    opened = shapely.intersection(shapely.buffer(wide, 1.01 * reach, quad_segs=_ARC), gaps)
    filling: list[FloatArray] = []
    widths: list[float] = []
    for gap in shapely.get_parts(opened):
        if gap.geom_type != "Polygon" or gap.area < _SMALL * width**2:
            continue
        border = gap.boundary
        shapely.prepare(border)
        for line in _middle(gap, _STEP * width):
            drawn = shapely.simplify(shapely.LineString(line), 0.02 * width)
            if drawn.length >= _SMALL * width:
                points = shapely.get_coordinates(drawn)
                middle = shapely.points(shapely.get_coordinates(shapely.segmentize(drawn, width)))
                filling.append(points)
                widths.append(2.0 * float(shapely.distance(middle, border).mean()))
    return filling, widths


def _middle(gap: shapely.Polygon, step: float) -> list[FloatArray]:
    """Lines of the medial axis of a polygon that pass between its opposite sides."""
    rings = shapely.get_rings(shapely.segmentize(gap, step))
    points = np.concatenate([shapely.get_coordinates(ring)[:-1] for ring in rings])
    if len(np.unique(points, axis=0)) < 4:
        return []
    diagram = Voronoi(points)
    ridges = np.array(diagram.ridge_vertices)
    sides = points[diagram.ridge_points[(ridges >= 0).all(axis=1)]]
    ends = diagram.vertices[ridges[(ridges >= 0).all(axis=1)]]
    chord = np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1)
    radius = np.linalg.norm(ends - sides[:, :1], axis=2).max(axis=1)
    facing = chord >= _OPPOSITE * 2.0 * radius
    edges = shapely.linestrings(ends[facing])
    shapely.prepare(gap)
    edges = edges[shapely.contains_properly(gap, edges)]
    return open_lines(np.array([shapely.line_merge(shapely.multilinestrings(list(edges)))]))
