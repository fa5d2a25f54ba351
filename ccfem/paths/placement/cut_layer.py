"""A flat layer cut down to a region: its triangles, its border, and what its points stand on."""

from dataclasses import replace

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.shapes import Region
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.level_cut import border_edges, chain

_GRID = 1e-6
"""Grid, mm, of the places where a border crosses triangles."""
_SAME = 3e-6
"""Places nearer than this, mm, are one."""
_SPECK = 1e-6
"""Least area of a triangle, mm^2."""


def cut_layer(layer: Layer, region: Region, mesh: TetMesh) -> Layer | None:
    """Cut a flat layer down to a region of its plane.

    Parameters
    ----------
    layer : Layer
    region : shapely (Multi)Polygon, mm
        In the coordinates of its plane.
    mesh : TetMesh
        The part that the layer was cut from.

    Returns
    -------
    Layer or None
        The layer itself where the region covers it; None where nothing is left of it.
    """
    plane = layer.plane
    shapely.prepare(region)
    corners = plane.points[layer.triangles]
    triangles = shapely.polygons(corners)
    whole = shapely.covers(region, triangles)
    if whole.all():
        return layer
    crossed = ~whole & shapely.intersects(region, triangles)
    # Triangles beside those that are cut may get a point of theirs on an edge.
    touched = np.isin(layer.triangles, layer.triangles[crossed]).any(axis=1)
    beside = whole & touched
    found, parent = _pieces(triangles, crossed, beside, region)
    points, number = _numbered(shapely.get_coordinates(found), plane.points)
    number = number.reshape(-1, 4)[:, :3]
    kept = np.concatenate([layer.triangles[whole & ~touched], _counter_clockwise(points, number)])
    parent = np.concatenate([np.flatnonzero(whole & ~touched), parent])
    if not len(kept):
        return None
    used, kept = np.unique(kept, return_inverse=True)
    kept = kept.reshape(-1, 3)
    owner = np.zeros(len(used), dtype=np.int64)
    owner[kept] = parent[:, None]
    place = np.concatenate([layer.points, plane.to_space(points[len(layer.points) :])])[used]
    nodes, weights = _in_cells(place, layer.cell[owner], mesh)
    border = border_edges(kept, len(used))
    return replace(
        layer,
        points=place,
        triangles=kept,
        cell=layer.cell[parent],
        nodes=nodes,
        weights=weights,
        loops=chain(border),
        patches=_patches(layer, place, border),
        local_thickness=np.full(len(used), layer.thickness),
    )


def _pieces(
    triangles: FloatArray, crossed: BoolArray, beside: BoolArray, region: Region
) -> tuple[FloatArray, IntArray]:
    """Triangles that the pieces of cut triangles and of those beside them are made of."""
    cut = shapely.intersection(triangles[crossed], region, grid_size=_GRID)
    pieces, which = shapely.get_parts(cut, return_index=True)
    polygons = (shapely.get_type_id(pieces) == 3) & (shapely.area(pieces) > _SPECK)
    parent = np.flatnonzero(crossed)[which[polygons]]
    pieces = np.concatenate([pieces[polygons], triangles[beside]])
    parent = np.concatenate([parent, np.flatnonzero(beside)])
    # A point on an edge is one of both triangles that share it.
    places = np.unique(shapely.get_coordinates(pieces).round(6), axis=0)
    tree = shapely.STRtree(shapely.points(places))
    piece, near = tree.query(pieces, predicate="dwithin", distance=_GRID)
    order = np.split(near[np.argsort(piece, kind="stable")], np.cumsum(np.bincount(piece))[:-1])
    for k, those in enumerate(order):
        if len(those) > shapely.get_num_coordinates(pieces[k]) - 1:
            pieces[k] = shapely.snap(pieces[k], shapely.multipoints(places[those]), _GRID)
    parts, of_piece = shapely.get_parts(
        shapely.constrained_delaunay_triangles(pieces), return_index=True
    )
    return parts, parent[of_piece]


def _numbered(found: FloatArray, known: FloatArray) -> tuple[FloatArray, IntArray]:
    """Points, those that are known first, and the number of each found place (k, 2)."""
    from scipy.spatial import KDTree

    away, number = KDTree(known).query(found)
    new = away > _SAME
    places, inverse = np.unique(found[new].round(6), axis=0, return_inverse=True)
    number[new] = len(known) + inverse.reshape(-1)
    return np.concatenate([known, places]), number


def _counter_clockwise(points: FloatArray, triangles: IntArray) -> IntArray:
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    u, v = b - a, c - a
    clockwise = u[:, 0] * v[:, 1] < u[:, 1] * v[:, 0]
    turned = triangles.copy()
    turned[clockwise] = triangles[clockwise][:, [0, 2, 1]]
    return turned


def _in_cells(points: FloatArray, cells: IntArray, mesh: TetMesh) -> tuple[IntArray, FloatArray]:
    """Corners (n, 4) of the cells that points lie in, and the share of each."""
    nodes = mesh.corners[cells]
    corners = mesh.points[nodes]
    sides = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 2)
    share = np.linalg.solve(sides, (points - corners[:, 0])[:, :, None])[:, :, 0]
    return nodes, np.column_stack([1.0 - share.sum(axis=1), share])


def _patches(layer: Layer, points: FloatArray, border: IntArray) -> dict[str, IntArray]:
    """Edges of the new border that lie on each patch."""
    middle = shapely.points(layer.plane.project(points[border].mean(axis=1)))
    found = {}
    for name, edges in layer.patches.items():
        lines = shapely.multilinestrings(shapely.linestrings(layer.plane.points[edges]))
        on_it = shapely.distance(middle, lines) < _SAME if len(edges) else np.zeros(len(border))
        found[name] = border[np.asarray(on_it, dtype=bool)]
    return found
