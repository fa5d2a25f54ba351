"""Which part of each layer of matrix is sparse infill; all else of it is solid."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.offsets import inset
from ccfem.geometry.shapes import Region, corners_only
from ccfem.machine.machine import Machine
from ccfem.paths.plastic.plastic import Plastic
from ccfem.paths.splitting.slabs import Slab
from ccfem.slicing.layers.layer import Layer, Plane
from ccfem.slicing.slicers.planar import Planar

_ANCHOR = 2.0
"""Distance, in line widths, by which skins reach beyond what they cover, to lie on infill."""
_SLIVER = 0.2
"""Width, in line widths, below which what is not covered is no face that needs a skin."""
_NARROW = 2.0
"""Width, in line widths, below which a region is filled solid rather than sparsely."""
_ARC = 8
"""Segments per quarter circle."""

NOTHING = shapely.Polygon()


class MatrixSection(NamedTuple):
    """A layer of matrix: its slab, the section at its middle, and the sparse part of that, mm."""

    slab: Slab
    section: Region
    sparse: Region = NOTHING


def matrix_sections(
    slabs: Sequence[Slab],
    fibre: Sequence[Layer],
    mesh: TetMesh,
    up: FloatArray,
    plastic: Plastic,
    machine: Machine,
) -> tuple[Plane | None, dict[int, MatrixSection]]:
    """Cut all layers of matrix, and find where their infill is sparse.

    A layer is solid

    * in its walls: within so many line widths of its border;
    * in skins: what is not covered by so many layers of matrix above and below;
    * near fibre: where fibre may lie on a layer, at most so many layers of matrix above or below;
    * where the rest is too narrow, or smaller than a cell of the infill.

    Parameters
    ----------
    slabs : sequence of Slab
        From the bed to the top.
    fibre : sequence of Layer
        Flat layers that may get fibre, all of it inside their sections.
    up : (3,) array
        Build direction.

    Returns
    -------
    plane : Plane or None
        One of the sections' planes; None without any.
    sections : dict of int to MatrixSection
        By the number of the slab; in the plane's coordinates.
    """
    of_matrix = [k for k, slab in enumerate(slabs) if slab.fibre is None]
    middles = tuple(0.5 * (slabs[k].lower + slabs[k].upper) for k in of_matrix)
    if not middles:
        return None, {}
    cut, plane = dict[int, Region](), None
    for k, layer in Planar(heights=middles).sections(mesh, up.tolist()):
        cut[of_matrix[k]], plane = corners_only(layer.polygon), plane or layer
    sections = {k: MatrixSection(slabs[k], section) for k, section in cut.items()}
    if plastic.solid:
        return plane, sections
    ordered = [cut.get(k, NOTHING) for k in of_matrix]
    areas = [(layer.plane.height, corners_only(layer.plane.polygon)) for layer in fibre]
    width = machine.matrix_width

    @cache
    def covered(around: tuple[Region, ...]) -> Region:
        return shapely.intersection_all(around)

    @cache
    def sparse(section: Region, around: tuple[Region, ...], near: tuple[Region, ...]) -> Region:
        reach = 0.5 * _SLIVER * width
        skin = shapely.buffer(shapely.difference(section, covered(around)), -reach, quad_segs=_ARC)
        solid = [shapely.buffer(skin, reach + _ANCHOR * width, quad_segs=_ARC)]
        solid += [shapely.buffer(area, machine.fibre_width, quad_segs=_ARC) for area in near]
        inner = shapely.difference(inset(section, plastic.walls * width), shapely.union_all(solid))
        half = 0.5 * _NARROW * width
        opened = shapely.buffer(shapely.buffer(inner, -half, quad_segs=_ARC), half, quad_segs=_ARC)
        least = (width / plastic.density) ** 2
        parts = [part for part in shapely.get_parts(opened) if part.area > least]
        return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)

    def near_fibre(slab: Slab) -> tuple[Region, ...]:
        reach = (plastic.fibre_skins - 0.5) * machine.highest_matrix(0.0)
        half = 0.5 * machine.strand_height
        near = (
            area
            for height, area in areas
            if height - half - slab.upper < reach and slab.lower - height - half < reach
        )
        return tuple(dict.fromkeys(near))

    count = len(ordered)
    for place, k in enumerate(of_matrix):
        window = range(place - plastic.skins, place + plastic.skins + 1)
        # In their order: that of a set differs from one run of Python to the next.
        around = tuple(dict.fromkeys(ordered[j] if 0 <= j < count else NOTHING for j in window))
        if k in sections and NOTHING not in around:
            slab, section, _ = sections[k]
            sections[k] = MatrixSection(slab, section, sparse(section, around, near_fibre(slab)))
    return plane, sections


def sparse_share(places: FloatArray, plane: Plane, sections: Sequence[MatrixSection]) -> FloatArray:
    """Tell which places (k, 3), mm, lie in sparse infill: 1 there, and 0 elsewhere, (k,).

    Sections are in their order; each layer of matrix fills what layers of fibre below it leave.
    """
    height, share = places @ plane.frame[2], np.zeros(len(places))
    flat, below = plane.project(places), -np.inf
    order = np.argsort(height, kind="stable")
    for slab, _, sparse in sections:
        low, high = np.searchsorted(height[order], [below, slab.upper])
        inside, below = order[low:high], slab.upper
        if not sparse.is_empty:
            shapely.prepare(sparse)
            share[inside] = shapely.contains_xy(sparse, *np.ascontiguousarray(flat[inside].T))
    return share
