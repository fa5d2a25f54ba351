"""Layers of the support of a part, matched to the part's own, and the matrix that fills them.

They are levels of the field of the part continued into the space below it, down to a flat bed.
Kipping and Schueppstuhl 2023 (Materials 16, 998), section 2.5, fill part and support at once, with
vectors that point up near the bed. Here the field of the part is held where it touches the support,
so that the support cannot bend the part's layers, and the bed has one value: layers end flat there
exactly, and no weights have to be chosen.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
import shapely

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.base.parallel import in_threads
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.assembly import cell_gradients
from ccfem.fem.elasticity.direct import superlu
from ccfem.fem.elasticity.stress_field import PartStress
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.shapes import Region, areas
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import Chart, IdentityChart
from ccfem.paths.toolpaths import MATRIX, Toolpaths
from ccfem.printing.support.meshed_columns import ColumnMesh, column_mesh
from ccfem.slicing.guidance.bounded_gradient import Bounds, bounded
from ccfem.slicing.guidance.energies import gradient_energy
from ccfem.slicing.layers.layer import Layer, Plane, curved_layers, plane_frame
from ccfem.slicing.layers.slicer import Slicer, Vector, standing
from ccfem.slicing.layers.sublayers import layers_within
from ccfem.slicing.principal_lines.tracing import mean_edge

_TURNED_UP = (0.2, 6.0)
"""Length of the gradient, in the part's, within which cells are turned up again."""


@dataclass(frozen=True)
class SupportField:
    """A field whose level surfaces are layers of the support.

    Attributes
    ----------
    values : (n,) array
        At the nodes of the columns; those of the part where they touch it.
    gradient : (m, 3) array, 1/mm
        In the cells.
    bed : float
        Value on the bed.
    inverted : float
        Share of the volume where layers lie upside down.
    """

    values: FloatArray
    gradient: FloatArray
    bed: float
    inverted: float

    def __post_init__(self) -> None:
        freeze(self, values=float, gradient=float)


def support_field(
    columns: ColumnMesh,
    part: FloatArray,
    slope: float,
    step: float,
    origin: float,
    most_inverted: float = 0.0,
) -> SupportField:
    """Continue the field of a part.

    Parameters
    ----------
    part : (p,) array
        Field at the nodes of the part.
    slope : float, 1/mm
        Mean length of its gradient: that of the support is as near to it as can be, upwards.
    step : float
        Of the value from layer to layer.
    origin : float
        Value of the lower side of a layer. The bed has this value, or one whole steps from it.
    most_inverted : float, default 0
        Where layers lie upside down in a larger share of the volume, the field is changed, as
        little as it takes, until they do not, or as far as that can be done.
    """
    mesh = columns.mesh
    cells, n, m = mesh.corners, len(mesh.points), len(mesh.cells)
    gradients = cell_gradients(mesh)
    matrix = gradient_energy(gradients, cells, mesh.volumes, n)
    rows = np.repeat(np.arange(3 * m).reshape(m, 1, 3), 4, axis=1)
    difference = sp.csr_array(
        (gradients.ravel(), (rows.ravel(), np.repeat(cells.ravel(), 3))), shape=(3 * m, n)
    )
    fall = sp.csr_array(difference.T * np.repeat(mesh.volumes, 3))
    held = np.zeros(n)
    above, stands = columns.node >= 0, columns.below[:, 0] >= 0
    held[stands] = np.einsum("kc,kc->k", columns.share[stands], part[columns.below[stands]])
    held[above] = part[columns.node[above]]
    fixed = above | stands | columns.on_bed
    on_bed = columns.on_bed & ~above & ~stands
    used = np.zeros(n, dtype=bool)
    used[cells] = True
    free = np.flatnonzero(used & ~fixed)
    solve_free = superlu(matrix[free][:, free]) if len(free) else None

    def solved(target: FloatArray, boundary: FloatArray) -> FloatArray:
        values = boundary.copy()
        if solve_free is not None:
            source = fall @ target.ravel() - matrix @ boundary
            values[free] = solve_free(source[free])
        return values

    target = np.broadcast_to(slope * columns.up, (m, 3))
    # The solution is linear in the value on the bed, whose best is that of a parabola.
    without = solved(target, held)
    lift = solved(np.zeros((m, 3)), on_bed.astype(np.float64))
    bed = origin
    if on_bed[used].any():
        stiff = float(lift @ (matrix @ lift))
        best = float(lift @ (fall @ target.ravel() - matrix @ without)) / max(stiff, 1e-300)
        bed = origin + step * round((best - origin) / step)
    boundary = held + bed * on_bed

    def field_of(aim: FloatArray) -> SupportField:
        values = solved(aim, boundary)
        gradient = (difference @ values).reshape(m, 3)
        down = gradient @ columns.up < 0.0
        inverted = float(mesh.volumes[down].sum() / mesh.volumes.sum())
        return SupportField(values, gradient, bed, inverted)

    bounds = Bounds(_TURNED_UP[0] * slope, _TURNED_UP[1] * slope, columns.up)
    return bounded(target, bounds, field_of, lambda field: field.inverted <= most_inverted)


# Layers at its levels.


_CARRIED = 45.0
"""Degrees from upright up to which flat layers carry themselves."""
_LIFT = 10
"""Layers of support below the lowest point of curved layers [Kipping and Schueppstuhl, table 1]."""
_HIGHER = 1.4
"""... times this as often as it takes for none to lie upside down, so many times at most:"""
_TIMES = 5
_INVERTED = 5e-4
"""Share of the volume of the support in which layers may lie upside down."""
_RANGE = (0.57, 1.43)
"""Thickness in the support, in that of the part's layers: 0.2 to 0.5 mm for 0.35 [ditto]."""
_SHORTEST = 0.3
_LEAST_AREA = 1.0
"""Shortest edge of the layers' triangles, in mean edges of the part; smallest piece, mm^2."""


@dataclass(frozen=True)
class SupportLayers:
    """Support of a part, in layers.

    Attributes
    ----------
    layers : tuple of Layer
        From the bed up. Their cells and nodes are those of ``columns.mesh``.
    before : (k,) int array
        Number of the part's layer at the same level; where it has none, as below its first, of the
        next above. A layer of support is printed just before it.
    columns : ColumnMesh
        The space that they fill, with its volume and where it touches.
    field : SupportField
        Whose levels they are.
    thickness : float, mm
        Mean by area.
    """

    layers: tuple[Layer, ...]
    before: IntArray
    columns: ColumnMesh
    field: SupportField
    thickness: float

    def __post_init__(self) -> None:
        freeze(self, before=int)

    def __repr__(self) -> str:
        return (
            f"SupportLayers: {len(self.layers)} layers of {self.thickness:.3g} mm, "
            f"{self.columns.volume:.4g} mm^3, {self.columns.contact:.4g} mm^2 of the part on them"
        )

    def layers_before(self, number: int) -> tuple[Layer, ...]:
        """Layers of support that are printed just before a layer of the part."""
        return tuple(self.layers[k] for k in np.flatnonzero(self.before == number).tolist())


def support_layers(
    mesh: TetMesh,
    layers: Sequence[Layer],
    build: Vector = (0.0, 0.0, 1.0),
    field: FloatArray | None = None,
    step: float | None = None,
    angle: float | None = None,
    lift: float | None = None,
) -> SupportLayers:
    """Lay support below a part, in layers that continue its own.

    The field whose levels are the part's layers is continued into the space below, where it ends
    flat on the bed: see `support_field`. Where layers would be thinner or thicker than 0.57 to 1.43
    of the part's, some are left out or put in between.

    Parameters
    ----------
    mesh : TetMesh
        The part.
    layers : sequence of Layer
        Of the part, from the first printed to the last.
    build : tuple of 3 floats, default z
        Build direction.
    field : (n,) array, optional
        At the nodes of the part: its layers lie where this has certain values. Only flat layers
        need none; `slice_with_support` knows that of a slicer.
    step : float, optional
        Of the field from layer to layer, by default the commonest.
    angle : float, degrees, optional
        Faces that lean over by more than this, from upright, are supported: by default 45 for flat
        layers, and 0, all that look down, for curved ones.
    lift : float, mm, optional
        Height of the lowest point of the part above the bed: by default 0 for flat layers, and for
        curved ones 10 layers, in which they become flat, or as many more as that takes.

    Raises
    ------
    InputError
        Without a field for curved layers; where nothing hangs over; where layers of the support
        would lie upside down.
    """
    if not layers:
        raise InputError("support is laid below layers; got none: cut the part into layers first")
    flat = not curved_layers(layers)
    if field is None:
        first = layers[0].flat
        if not flat or first is None:
            raise InputError(
                "support below curved layers needs the field they were cut from: slice by spatial "
                "or load_oriented (from Python: slice_with_support), or leave it out"
            )
        field = mesh.points @ first.frame[2]
    levels = np.array([float(np.median(layer.interpolate(field))) for layer in layers])
    rise = np.diff(levels)
    step = float(step or (np.median(rise) if len(rise) else layers[0].thickness))
    nominal = float(np.mean([layer.thickness for layer in layers]))
    angle = (_CARRIED if flat else 0.0) if angle is None else angle
    lifts = [_LIFT * nominal * _HIGHER**k for k in range(_TIMES + 1)] if not flat else [0.0]
    for height in lifts if lift is None else [lift]:
        columns = column_mesh(mesh, build, angle, height)
        origin = float(levels[0]) - 0.5 * step
        field_below = support_field(columns, field, step / nominal, step, origin, _INVERTED)
        if field_below.inverted <= _INVERTED:
            break
    else:
        raise InputError(
            f"support layers lie upside down in {100.0 * field_below.inverted:.2g} % of the "
            f"support: raise lift, over which the lowest layers flatten, above {height:.3g} mm"
        )
    thinnest, thickest = (share * nominal for share in _RANGE)
    cut = layers_within(
        columns.mesh,
        field_below.values,
        step,
        thinnest,
        thickest,
        _SHORTEST * mean_edge(mesh),
        _LEAST_AREA,
        origin,
    )
    medians = [float(np.median(layer.interpolate(field_below.values))) for layer in cut.layers]
    before = np.searchsorted(levels, np.array(medians) - 1e-3 * step)
    area = np.array([float(layer.areas.sum()) for layer in cut.layers])
    thick = np.array([layer.thickness for layer in cut.layers])
    mean = float(area @ thick / area.sum()) if len(area) else 0.0
    return SupportLayers(cut.layers, before, columns, field_below, mean)


def slice_with_support(
    slicer: Slicer,
    stress: PartStress,
    build: Vector = (0.0, 0.0, 1.0),
    machine: Machine | None = None,
    angle: float | None = None,
    lift: float | None = None,
) -> tuple[tuple[Layer, ...], SupportLayers]:
    """Cut a part into layers, and the support below it.

    Parameters
    ----------
    slicer : Slicer
        Of flat layers, or one that says the field of its layers (`slice`).
    build : tuple of 3 floats, default z
        Where curved layers look down from there, the support is laid below the part as it stands
        along their mean normal (`standing`): ``support.columns.up``.
    angle, lift : float, optional
        As of `support_layers`.

    Returns
    -------
    layers : tuple of Layer
    support : SupportLayers
    """
    sliced: Any = slicer.slice(stress, build) if hasattr(slicer, "slice") else None
    if sliced is None:
        layers = slicer(stress, build, Machine() if machine is None else machine)
        return layers, support_layers(stress.mesh, layers, build, None, None, angle, lift)
    if getattr(sliced, "inverted", 0.0) > 0.0:
        raise InputError(
            f"layers lie upside down in {100.0 * sliced.inverted:.2g} % of the part, where no "
            "support carries them: raise load_oriented.blend, or leave it out"
        )
    layers, up = sliced.layers, standing(sliced.layers, build)
    values = sliced.field.values if curved_layers(layers) else None
    step = None if values is None else sliced.step
    return layers, support_layers(stress.mesh, layers, up, values, step, angle, lift)


# Paths of matrix that fill the layers.


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

    Heads (f, 3, 3), mm, are the facets that hang over, along the axes of the build direction.
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
