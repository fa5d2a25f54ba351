"""Which layers of a part get fibre, and where on them: the same for every strategy."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.errors import InputError
from ccfem.base.plain import plain_dataclass
from ccfem.body.files.surface import Surface
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.face_rules import check_box
from ccfem.body.mesh.patches import Vector, unit_vector
from ccfem.geometry.facets import border_edges, counter_clockwise, edges_left
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import Layer, Plane
from ccfem.slicing.layers.level_cut import chain

# Shapes that say where fibre may lie, and their sections with the plane of a layer.


_ARC = 16
"""Pieces of a quarter of a circle."""
_CUTS = 12
"""Sections of a patch over and below a layer, each; the reach is short by at most .3 %."""
_DIGITS = 6
"""Decimals of the ends of sections, mm, so that they meet."""
_ALONG = 1e-6
"""Sine of the angle below which an axis lies in a plane, or a normal across it."""


class Shape(Protocol):
    """A body that a layer cuts."""

    def section(self, plane: Plane, mesh: TetMesh, reach: float) -> Region:
        """Section with a plane, in its coordinates, mm; true within `reach` of the origin."""
        ...


@plain_dataclass
class InBox:
    """A box along the axes of the mesh.

    Attributes
    ----------
    lower, upper : tuple of 3 floats, mm
        Opposite corners; infinite where the box has no end.
    """

    lower: Vector
    upper: Vector

    def __post_init__(self) -> None:
        check_box(self.lower, self.upper)

    def section(self, plane: Plane, mesh: TetMesh, reach: float) -> Region:
        """Section with a plane, in its coordinates."""
        shape: Region = shapely.box(-reach, -reach, reach, reach)
        for axis in range(3):
            slope, offset = plane.frame[:2, axis], plane.height * float(plane.frame[2, axis])
            for sign, bound in ((1.0, self.lower[axis]), (-1.0, self.upper[axis])):
                if np.isfinite(bound):
                    shape = _half(shape, sign * slope, sign * (bound - offset), reach)
        return shape


@plain_dataclass
class InCylinder:
    """A cylinder without ends.

    Attributes
    ----------
    point : tuple of 3 floats, mm
        A point on the axis.
    axis : str or tuple of 3 floats
        Direction of the axis.
    radius : float, mm
        Above 0.
    """

    point: Vector
    axis: str | Vector
    radius: float

    def __post_init__(self) -> None:
        unit_vector(self.axis, "cylinder axis")
        check_fields(self, "radius", above=0.0, unit="mm")

    def section(self, plane: Plane, mesh: TetMesh, reach: float) -> Region:
        """Section with a plane, in its coordinates."""
        axis = unit_vector(self.axis, "cylinder axis")
        across = np.linalg.svd(axis[None])[2][1:]
        slope = across @ plane.frame[:2].T
        start = across @ (plane.height * plane.frame[2] - np.asarray(self.point))
        if abs(float(axis @ plane.frame[2])) > _ALONG:
            circle = shapely.Point(0.0, 0.0).buffer(self.radius, quad_segs=_ARC)
            inverse = np.linalg.inv(slope)
            shape: Region = shapely.transform(circle, lambda at: (at - start) @ inverse.T)
            return shape
        # The axis lies along the plane, whose section is a strip: how high above it is fixed.
        over = plane.frame[2] @ (plane.height * plane.frame[2] - np.asarray(self.point))
        if abs(float(over)) >= self.radius:
            return shapely.Polygon()
        half = float(np.sqrt(self.radius**2 - over**2))
        side = np.cross(plane.frame[2], axis)
        way, middle = plane.frame[:2] @ side, float(np.asarray(self.point) @ side)
        strip: Region = shapely.box(-reach, -reach, reach, reach)
        strip = _half(strip, way, middle - half, reach)
        return _half(strip, -way, -middle - half, reach)


@dataclass(frozen=True)
class NearPatch:
    """All that lies near a patch of the mesh: round a hole, or under a face.

    Attributes
    ----------
    within : float, mm
        Largest distance from the patch, above 0.
    """

    patch: str
    within: float

    def __post_init__(self) -> None:
        check_fields(self, "within", above=0.0, unit="mm")

    def section(self, plane: Plane, mesh: TetMesh, reach: float) -> Region:
        """Section with a plane, in its coordinates."""
        facets = mesh.points[mesh.patch(self.patch)[:, :3]]
        corners = plane.project(facets)
        level = facets @ plane.frame[2] - plane.height
        shapes = []
        flat = np.ptp(level, axis=1) < 10.0**-_DIGITS
        low = flat & (np.abs(level[:, 0]) < self.within)
        for at in np.unique(level[low, 0].round(_DIGITS)).tolist():
            faces = shapely.polygons(corners[low & (np.abs(level[:, 0] - at) < 10.0**-_DIGITS)])
            far = float(np.sqrt(max(self.within**2 - at**2, 0.0)))
            shapes.append(shapely.buffer(shapely.union_all(faces), far, quad_segs=_ARC))
        for at in (self.within * np.sin(0.5 * np.pi * np.arange(-_CUTS, _CUTS + 1) / _CUTS))[1:-1]:
            ends = _section_edges(corners, level - float(at))
            if len(ends):
                far = float(np.sqrt(self.within**2 - at**2))
                lines = shapely.multilinestrings(shapely.linestrings(ends))
                shapes.append(shapely.buffer(lines, far, quad_segs=_ARC))
        return shapely.union_all(shapes)


@dataclass(frozen=True)
class InBody:
    """The inside of a closed surface in the frame of the mesh, and the name of its file."""

    surface: Surface = field(repr=False)
    name: str = ""

    def section(self, plane: Plane, mesh: TetMesh, reach: float) -> Region:
        """Section with a plane, in its coordinates."""
        corners = self.surface.points[self.surface.triangles]
        ends = _section_edges(plane.project(corners), corners @ plane.frame[2] - plane.height)
        if not len(ends):
            return shapely.Polygon()
        ends = ends.round(_DIGITS)
        ends = ends[(ends[:, 0] != ends[:, 1]).any(axis=1)]
        return shapely.make_valid(shapely.build_area(shapely.union_all(shapely.linestrings(ends))))


def _half(region: Region, slope: FloatArray, least: float, reach: float) -> Region:
    """Part of a region where slope . x is at least a value."""
    steep = float(np.linalg.norm(slope))
    if steep < _ALONG:
        return region if least <= 0.0 else shapely.Polygon()
    way = np.asarray(slope) / steep
    side, start = np.array([-way[1], way[0]]), least / steep * way
    far = 4.0 * reach + abs(least) / steep
    ring = [start - far * side, start + far * side]
    ring += [start + far * (side + way), start + far * (way - side)]
    return shapely.intersection(region, shapely.Polygon(ring))


def _section_edges(corners: FloatArray, level: FloatArray) -> FloatArray:
    """Find the ends (k, 2, 2) of the sections of triangles where their level is 0."""
    # A corner on the plane counts as above it: each triangle is cut in two edges or in none.
    above = level >= 0.0
    cut = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    if not len(cut):
        return np.zeros((0, 2, 2))
    corners, level, above = corners[cut], level[cut], above[cut]
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    row, ends = np.arange(len(cut)), []
    for step in (1, 2):
        other = (alone + step) % 3
        share = level[row, alone] / (level[row, alone] - level[row, other])
        start = corners[row, alone]
        ends.append(start + share[:, None] * (corners[row, other] - start))
    return np.stack(ends, axis=1)


_SAME = 1e-6
"""Heights closer than this, mm, are the same."""


@dataclass(frozen=True)
class FibreRegion:
    """A region that gets fibre, or none.

    Attributes
    ----------
    mode : {"only", "exclude"}
        "only": fibre lies in regions of this mode alone; "exclude": none lies in this one.
    priority : int, default 1
        Where regions overlap the one with the lowest number counts, and of equal ones that which
        excludes. At least 1.
    """

    shape: Shape
    mode: Literal["only", "exclude"] = "only"
    priority: int = 1

    def __post_init__(self) -> None:
        check_choices(self)
        check_fields(self, "priority", at_least=1)


@dataclass(frozen=True)
class FibrePlaces:
    """Which layers and regions of a part get fibre.

    Of the layers that a slicer cuts those stay that all of the rules leave, in their order:
    `layers`, `from_height` and `to_height`, `every`, `between`, `covered`. The others are printed
    of matrix. A layer keeps its number and the thickness that it stands for.

    Attributes
    ----------
    layers : str or tuple of int, optional
        Numbers of layers, 0 at the bottom, or a range "FIRST:END:STEP" as of Python's slices, END
        not included and negative from the top: "2:-2" leaves two without fibre at either end.
    from_height, to_height : float, mm, optional
        Heights over the part's lowest point between which fibre lies.
    every : int, default 1
        Every how many layers.
    between : int, default 0
        Least number of matrix layers that the machine prints between two layers of fibre.
    covered : bool, default True
        Leave out layers that lie nearer to the bottom or the top of the part than
        `Process.cover`, where matrix would not hold them; and pieces of layers narrower than a
        strand.
    """

    layers: str | tuple[int, ...] | None = None
    from_height: float | None = None
    to_height: float | None = None
    every: int = 1
    between: int = 0
    covered: bool = True
    regions: tuple[FibreRegion, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, "from_height", "to_height", unit="mm")
        check_fields(self, "every", at_least=1)
        check_fields(self, "between", at_least=0)
        low, high = self.from_height, self.to_height
        if low is not None and high is not None and low > high:
            raise InputError(f"fibre from {low:g} mm to {high:g} mm is upside down: swap the two")
        if isinstance(self.layers, str):
            _slice(self.layers)

    def on(self, layers: Sequence[Layer], mesh: TetMesh, machine: Machine) -> tuple[Layer, ...]:
        """Return the layers that get fibre, cut down to the regions that do.

        Parameters
        ----------
        layers : sequence of Layer
            From the bottom to the top.
        mesh : TetMesh
            The part.

        Raises
        ------
        InputError
            Where no layer is left, and for regions on curved layers.
        """
        kept = self._with_matrix_between(self._chosen_layers(layers, mesh)[:: self.every], machine)
        if self.covered:
            kept = [layer for layer in kept if _is_covered(layer, mesh, machine)]
        if self.regions or self.covered:
            kept = [
                cut for layer in kept if (cut := self._restricted(layer, mesh, machine)) is not None
            ]
        if not kept:
            raise InputError(
                f"of {len(layers)} layers none is left for fibre ({self.about()}): choose more in "
                "[fibre], or make its regions larger"
            )
        return tuple(kept)

    def about(self) -> str:
        """Say the rules in a few words."""
        remarks = []
        if self.layers is not None:
            names = (
                self.layers if isinstance(self.layers, str) else ", ".join(map(str, self.layers))
            )
            remarks.append(f"layers {names}")
        if self.from_height is not None:
            remarks.append(f"from {self.from_height:g} mm")
        if self.to_height is not None:
            remarks.append(f"to {self.to_height:g} mm")
        if self.every > 1:
            remarks.append(f"every {self.every} layers")
        if self.between:
            remarks.append(f"{self.between} matrix layers between")
        for mode in ("only", "exclude"):
            count = sum(area.mode == mode for area in self.regions)
            if count:
                remarks.append(f"{count} regions {mode}" if count > 1 else f"1 region {mode}")
        if self.covered:
            remarks.append("covered by matrix")
        return ", ".join(remarks) or "all layers"

    def _chosen_layers(self, layers: Sequence[Layer], mesh: TetMesh) -> list[Layer]:
        """Layers by their numbers and heights."""
        known = [layer.index for layer in layers]
        if isinstance(self.layers, str):
            # Numbers of layers, not places in the sequence: a slicer may leave some out.
            wanted = set(range(max(known, default=-1) + 1)[_slice(self.layers)])
        else:
            wanted = set(known if self.layers is None else self.layers)
            missing = sorted(wanted - set(known))
            if missing:
                raise InputError(
                    f"fibre is asked for on layer {missing[0]}, but there are {min(known)} to "
                    f"{max(known)}: correct fibre.layers"
                )
        low = -np.inf if self.from_height is None else self.from_height - _SAME
        high = np.inf if self.to_height is None else self.to_height + _SAME
        return [
            layer
            for layer in layers
            if layer.index in wanted
            and (np.isinf([low, high]).all() or low <= _height(layer, mesh) <= high)
        ]

    def _with_matrix_between(self, layers: Sequence[Layer], machine: Machine) -> list[Layer]:
        """Layers with enough of matrix between them."""
        if not self.between:
            return list(layers)
        kept: list[Layer] = []
        for layer in layers:
            if not kept:
                kept.append(layer)
                continue
            gap = layer.plane.height - kept[-1].plane.height - machine.strand_height
            if np.ceil(gap / machine.matrix_height - _SAME) >= self.between:
                kept.append(layer)
        return kept

    def _restricted(self, layer: Layer, mesh: TetMesh, machine: Machine) -> Layer | None:
        """Part of a layer that gets fibre; None where nothing does."""
        if layer.flat is None:
            if self.regions:
                raise InputError(
                    f"fibre.regions work on flat layers only; layer {layer.index} is curved: "
                    "choose method = 'planar' in [slicing], or leave the regions out"
                )
            return layer
        region = self._fibre_region(layer, mesh)
        parts = shapely.get_parts(region)
        parts = parts[shapely.get_type_id(parts) == 3]
        if self.covered:
            parts = parts[~shapely.is_empty(shapely.buffer(parts, -0.5 * machine.fibre_width))]
        if not len(parts):
            return None
        if not self.regions and len(parts) == shapely.get_num_geometries(layer.plane.polygon):
            return layer
        return cut_layer(layer, shapely.multipolygons(list(parts)), mesh)

    def _fibre_region(self, layer: Layer, mesh: TetMesh) -> Region:
        """Region of a layer that gets fibre."""
        plane = layer.plane
        section = plane.polygon
        reach = float(np.abs(plane.points).max()) + 1.0
        only = any(area.mode == "only" for area in self.regions)
        region: Region = shapely.Polygon() if only else section
        for area in sorted(self.regions, key=lambda area: (-area.priority, area.mode == "exclude")):
            shape = area.shape.section(plane, mesh, reach)
            if area.mode == "only":
                region = shapely.union(region, shapely.intersection(shape, section))
            else:
                region = shapely.difference(region, shape)
        return region


def _slice(text: str) -> slice:
    """Range of a text such as "3:20:2"."""
    parts = [part.strip() for part in text.split(":")]
    try:
        numbers = [int(part) if part else None for part in parts]
        chosen = slice(*numbers)
        if len(parts) == 1 or chosen.step == 0:
            raise ValueError
    except (ValueError, TypeError):
        raise InputError(
            f"fibre.layers must be a range FIRST:END:STEP as '3:20:2', or a list; got '{text}': "
            'write "2:-2" or [0, 1, 2]'
        ) from None
    return chosen


def _levels(layer: Layer, mesh: TetMesh) -> tuple[float, float, float]:
    """Height of a flat layer, and the lowest and highest point of the part along its normal."""
    level = mesh.points[np.unique(mesh.corners)] @ layer.plane.frame[2]
    return layer.plane.height, float(level.min()), float(level.max())


def _height(layer: Layer, mesh: TetMesh) -> float:
    """Height of a flat layer over the part's lowest point."""
    if layer.flat is None:
        raise InputError(
            f"fibre.from and fibre.to work on flat layers only; layer {layer.index} is curved: "
            "choose by fibre.layers"
        )
    height, low, _ = _levels(layer, mesh)
    return height - low


def _is_covered(layer: Layer, mesh: TetMesh, machine: Machine) -> bool:
    """Whether matrix below and above a flat layer holds it."""
    if layer.flat is None:
        return True
    height, low, high = _levels(layer, mesh)
    room = min(height - low, high - height) - 0.5 * machine.strand_height
    return room >= machine.process.cover - _SAME


# A flat layer cut down to a region: its triangles, its border, and what its points stand on.


_GRID = 1e-6
"""Grid, mm, of the places where a border crosses triangles."""
_CUT_SAME = 3e-6
"""Places nearer than this, mm, are one."""
_SPECK = 1e-6
"""Least area of a triangle, mm^2."""


def cut_layer(layer: Layer, region: Region, mesh: TetMesh) -> Layer | None:
    """Cut a flat layer down to a region of its plane.

    Parameters
    ----------
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
    cut_triangles, parent = _retriangulated(triangles, crossed, beside, region)
    points, number = _points_and_numbers(shapely.get_coordinates(cut_triangles), plane.points)
    number = number.reshape(-1, 4)[:, :3]
    kept = np.concatenate([layer.triangles[whole & ~touched], counter_clockwise(points, number)])
    parent = np.concatenate([np.flatnonzero(whole & ~touched), parent])
    if not len(kept):
        return None
    # Points in use, and for each a triangle of the layer, in whose cell the stress is found.
    used, kept = np.unique(kept, return_inverse=True)
    kept = kept.reshape(-1, 3)
    owner = np.zeros(len(used), dtype=np.int64)
    owner[kept] = parent[:, None]
    place_of = np.full(len(points), -1)
    place_of[used] = np.arange(len(used))
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
        walls=tuple((wall, edges_left(edges, place_of)) for wall, edges in layer.walls),
        local_thickness=np.full(len(used), layer.thickness),
    )


def _retriangulated(
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
    for k, corners in enumerate(order):
        if len(corners) > shapely.get_num_coordinates(pieces[k]) - 1:
            pieces[k] = shapely.snap(pieces[k], shapely.multipoints(places[corners]), _GRID)
    parts, of_piece = shapely.get_parts(
        shapely.constrained_delaunay_triangles(pieces), return_index=True
    )
    return parts, parent[of_piece]


def _points_and_numbers(vertices: FloatArray, known: FloatArray) -> tuple[FloatArray, IntArray]:
    """Points, those that are known first, and the number of each found place (k, 2)."""
    from scipy.spatial import KDTree

    away, number = KDTree(known).query(vertices)
    new = away > _CUT_SAME
    places, inverse = np.unique(vertices[new].round(6), axis=0, return_inverse=True)
    number[new] = len(known) + inverse.reshape(-1)
    return np.concatenate([known, places]), number


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
    patches = {}
    for name, edges in layer.patches.items():
        lines = shapely.multilinestrings(shapely.linestrings(layer.plane.points[edges]))
        on_it = shapely.distance(middle, lines) < _CUT_SAME if len(edges) else np.zeros(len(border))
        patches[name] = border[np.asarray(on_it, dtype=bool)]
    return patches
