"""Paths of matrix that fill the layers of a support."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_number
from ccfem.base.parallel import in_threads
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.shapes import Region, areas
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import Chart, IdentityChart
from ccfem.paths.toolpaths import MATRIX, Toolpaths
from ccfem.printing.support.matched_layers import SupportLayers
from ccfem.slicing.layers.layer import Layer, Plane, plane_frame

_ON = 1e-6
"""Distance from a facet, mm, seen from above, within which a point lies below it."""
_BESIDE = 0.01
"""Share of a layer of support that may lie below the layer of the part that it is beside."""


def support_paths(
    support: SupportLayers, machine: Machine, spacing: float = 3.0, layers: Sequence[Layer] = ()
) -> Toolpaths:
    """Fill the layers of a support with rings, open enough to be broken off or dissolved.

    Distances are those seen along the build direction: on a tilted layer they are longer. As below
    flat layers, the last `Process.support_interface` layers below the part are full, those nearer
    to it than `Process.support_gap` are left out, and the others are `Process.support_clearance`
    clear of the layers of the part that they are beside.

    Parameters
    ----------
    machine : Machine
        Its `matrix_width`, and how support is laid.
    spacing : float, default 3
        Distance of the rings in widths; 1 fills the layers.
    layers : sequence of Layer
        Of the part, which ``support.before`` counts; by default the support is clear of none.

    Returns
    -------
    Toolpaths
        Closed paths of matrix, in the frame of the part, from the border of each layer inwards.
        Their `layer` is the number of the layer of the support: those with
        ``support.before[number] == k`` are printed before layer k of the part.
    """
    check_number("spacing", spacing, at_least=1.0)
    numbered = [replace(layer, index=k) for k, layer in enumerate(support.layers)]
    columns, width = support.columns, machine.matrix_width
    frame = plane_frame(tuple(columns.up.tolist()))
    heads = (columns.mesh.points @ frame.T)[columns.mesh.patches["part"]]

    def filled(layer: Layer) -> Toolpaths:
        seen, number = _from_above(layer, frame), int(support.before[layer.index])
        wide, solid = _regions(layer, seen, frame, heads, machine)
        if number < len(layers):
            wide = _clear_of(layers[number], wide, frame, machine.process.support_clearance)
        rings = []
        solid = areas(shapely.intersection(solid, wide))
        for region, pitch in ((shapely.difference(wide, solid), spacing * width), (solid, width)):
            with np.errstate(divide="ignore", invalid="ignore"):  # mitres of edges nearly in line
                levels = offset_rings(region, 0.5 * width, pitch, width)
            rings += [ring for level in levels for ring in level]
        paths = Toolpaths.from_plane(rings, seen.flat)
        paths = replace(paths, kind=np.full(len(paths), MATRIX, dtype=paths.kind.dtype))
        return seen.lifted(paths)

    return Toolpaths.concatenate(in_threads(filled, numbered))


def _from_above(layer: Layer, frame: FloatArray) -> Chart:
    """Look at a layer along the build direction: none of a support lies upside down to it."""
    lengths = np.ones((len(layer.triangles), 2))
    if layer.flat is not None:
        return IdentityChart(layer, layer, lengths)
    seen = layer.points @ frame.T * [1.0, 1.0, 0.0]
    flat = replace(layer, points=seen, flat=Plane(np.eye(3), 0.0), walls=())
    return Chart(layer, flat, lengths)


def _regions(
    layer: Layer, seen: Chart, frame: FloatArray, heads: FloatArray, machine: Machine
) -> tuple[Region, Region]:
    """Regions of a layer that are laid, and that are full, in the plane that it is seen in.

    Parameters
    ----------
    heads : (f, 3, 3) array, mm
        Corners of the facets that hang over, along the axes of the build direction.
    """
    process, whole = machine.process, areas(seen.flat.plane.polygon)
    room = _room_above(layer.points @ frame.T, heads)
    places = seen.flat.plane.points
    high = layer.local_thickness
    wide = whole
    if process.support_gap:
        # The top of the layer is as far below the part as the gap.
        left = room - 0.5 * high - process.support_gap
        wide = _not_below(places, layer.triangles, left, whole)
    near = process.support_gap + process.support_interface * high - room
    return wide, _not_below(places, layer.triangles, near, whole)


def _room_above(points: FloatArray, heads: FloatArray) -> FloatArray:
    """Height from points (n, 3), mm, up to the lowest facet (f, 3, 3) above each."""
    tree = shapely.STRtree(shapely.polygons(heads[:, :, :2]))
    places = shapely.points(points[:, :2])
    point, facet = tree.query(places, predicate="dwithin", distance=_ON)
    bare = np.setdiff1d(np.arange(len(points)), point)
    if len(bare):  # beside all by rounding, or by an edge that was collapsed
        point = np.append(point, bare)
        facet = np.append(facet, tree.nearest(places[bare]))
    a, b, c = np.moveaxis(heads[facet], 1, 0)
    normal = np.cross(b - a, c - a)
    off = np.einsum("ij,ij->i", normal[:, :2], points[point, :2] - a[:, :2])
    rise = a[:, 2] - off / normal[:, 2] - points[point, 2]
    room = np.full(len(points), np.inf)
    # A point is on its own facet, not on one that lies below it.
    above = rise > -_ON
    np.minimum.at(room, point[above], rise[above])
    return np.where(np.isfinite(room), np.maximum(room, 0.0), 0.0)


def _not_below(
    points: FloatArray, triangles: np.ndarray, values: FloatArray, whole: Region
) -> Region:
    """Part of triangles (t, 3) between points (n, 2) where values (n,), linear in each, are >= 0.

    `whole` is the region of all triangles.
    """
    value, corners = values[triangles], points[triangles]
    if (value >= 0.0).all():
        return whole
    inside, after = value >= 0.0, np.roll(value, -1, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip(np.nan_to_num(value / (value - after)), 0.0, 1.0)
    crossing = corners + share[:, :, None] * (np.roll(corners, -1, axis=1) - corners)
    places = np.stack([corners, crossing], axis=2).reshape(-1, 6, 2)
    used = np.stack([inside, inside != (after >= 0.0)], axis=2).reshape(-1, 6)
    some = used.any(axis=1)
    places, used = places[some], used[some]
    # Places that are none are those before them, round each triangle.
    last = np.maximum.accumulate(np.where(used, np.arange(6), -1), axis=1)
    last = np.where(last < 0, last[:, -1:], last)
    pieces = shapely.polygons(np.take_along_axis(places, last[:, :, None], axis=1))
    return areas(shapely.union_all(pieces[shapely.area(pieces) > 0.0]))


def _clear_of(layer: Layer, wide: Region, frame: FloatArray, clearance: float) -> Region:
    """Part of a region that is clear of a layer of the part, where it is beside that."""
    corners = (layer.points @ frame.T)[layer.triangles][:, :, :2]
    shapes = shapely.polygons(corners)
    beside = shapely.union_all(shapes[shapely.area(shapes) > 0.0])
    if shapely.intersection(wide, beside).area > _BESIDE * wide.area:
        return wide  # below it
    return areas(shapely.difference(wide, shapely.buffer(beside, clearance)))
