"""Lines of matrix layers: a contour, a zigzag inside it, and lines in the gaps."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.base.threads import in_threads
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.hatch import zigzag
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.printing.gap_lines import gap_lines
from ccfem.printing.slabs import Slab
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.planar import Planar

_OVERLAP = 0.25
"""Overlap of the ends of the zigzag with the contour, in line widths. Our choice."""


@dataclass(frozen=True)
class MatrixFill:
    """Lines that fill a layer of matrix, on the bed.

    Attributes
    ----------
    section : Region
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
    machine : Machine
    """
    width, profile = machine.matrix_width, machine.gcode
    of_matrix = [k for k, slab in enumerate(slabs) if slab.fibre is None]
    found: list[MatrixFill | None] = [None] * len(slabs)
    for k in of_matrix:
        found[k] = MatrixFill()
    middles = tuple(0.5 * (slabs[k].lower + slabs[k].upper) for k in of_matrix)

    def filled(layer: Layer) -> MatrixFill:
        plane = layer.plane
        angle = np.radians(profile.matrix_angle + profile.matrix_turn * layer.index)
        contours = offset_rings(plane.polygon, 0.5 * width, width, width, 1)
        inside = zigzag(plane.polygon, (1.5 - _OVERLAP) * width, width, width, float(angle))
        lines = [ring for level in contours for ring in level] + inside
        gaps, widths = gap_lines(plane.polygon, lines, width)

        def on_bed(points: FloatArray) -> FloatArray:
            return plane.to_space(points) @ frame[:2].T - origin

        return MatrixFill(
            shapely.transform(plane.polygon, on_bed),
            [on_bed(line) for line in lines + gaps],
            [width] * len(lines) + widths,
        )

    layers = Planar(heights=middles).cut(mesh, frame[2]) if middles else ()
    for layer, fill in zip(layers, in_threads(filled, layers), strict=True):
        found[of_matrix[layer.index]] = fill
    return found
