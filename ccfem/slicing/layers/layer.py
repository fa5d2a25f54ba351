"""A layer: the surface on which a strategy plans its paths, flat or curved, and its stress."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray, freeze, read_only, shared_rows
from ccfem.base.checks import check_known
from ccfem.base.display import Shown
from ccfem.base.errors import InputError
from ccfem.base.tensor import in_axes
from ccfem.body.mesh.round_walls import RoundWall, moved_onto
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.facets import connected, sides_at
from ccfem.geometry.locate import Nearest, Simplices, nearest_on_triangles
from ccfem.geometry.shapes import Region

SAME_DECIMALS = 9
"""Decimals of heights and coordinates, mm, in which those that are the same agree: only rounding
differs."""

# The plane of a flat layer: its frame and height, and coordinates in it.


@dataclass(frozen=True)
class Plane:
    """A plane normal to a build direction.

    Attributes
    ----------
    frame : (3, 3) array
        Rows: the two in-plane unit vectors and the normal (build direction), right-handed.
    height : float, mm
        ``points @ frame[2]`` of all points of the plane.
    """

    frame: FloatArray
    height: float

    def __post_init__(self) -> None:
        freeze(self, frame=float)

    def project(self, points: FloatArray) -> FloatArray:
        """Plane coordinates (..., 2) of points (..., 3), mm."""
        return points @ self.frame[:2].T

    def to_space(self, coordinates: FloatArray) -> FloatArray:
        """Points (..., 3) of plane coordinates (..., 2), mm."""
        return coordinates @ self.frame[:2] + self.height * self.frame[2]


def plane_frame(direction: Sequence[float]) -> FloatArray:
    """Right-handed frame of the planes normal to a build direction.

    Parameters
    ----------
    direction : sequence of 3 floats
        Build direction; need not be of unit length.

    Returns
    -------
    (3, 3) array
        Rows: two in-plane unit vectors and the unit normal. Along z they are x, y, z; along y
        x, -z, y (the tool frame of Chen et al. 2021); along x y, z, x.
    """
    normal = np.asarray(direction, dtype=np.float64)
    length = float(np.linalg.norm(normal)) if normal.shape == (3,) else 0.0
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(f"build direction must be three numbers, not all 0; got {direction}")
    normal = normal / length
    axis = int(np.argmax(np.abs(normal)))
    first = np.array([1.0, 0.0, 0.0]) if axis != 0 else np.array([0.0, 1.0, 0.0])
    first -= (first @ normal) * normal
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first), normal])


@dataclass(frozen=True)
class Layer(Shown):
    """A layer of the part, flat or curved.

    Attributes
    ----------
    points : (n, 3) array, mm
        In the frame of the mesh.
    triangles : (t, 3) int array
        Counter-clockwise seen from above, that is looking against the normals.
    cell : (t,) int array
        Tetrahedron that each triangle was cut from.
    nodes : (n, 2) or (n, 4) int array
        Ends of the mesh edge that each point lies on (the same node twice if it lies on a node), or
        the corners of the cell that it lies in.
    weights : (n,) array in [0, 1], or (n, 4) array
        ``points = (1 - weights) * mesh.points[nodes[:, 0]] + weights * mesh.points[nodes[:, 1]]``;
        with four nodes, the weight of each.
    loops : tuple of (k,) int arrays
        Boundary loops as point indices, material on the left, without repeating the first point.
    index : int
        Position in the stack, 0 at the bottom.
    thickness : float, mm
        Share of the part's height that this layer represents; for a curved layer, its mean.
    patches : mapping of name to (k, 2) int arrays
        Boundary edges (point indices) that lie on each named patch of the mesh.
    flat : Plane, optional
        The plane that all points lie in; None where the layer is curved. Methods that work in a
        plane use the flat view `plane`.
    local_thickness : (n,) array, mm, optional
        Thickness at each point; by default `thickness` everywhere.
    turns : (t, 3, 3) array, optional
        For the flat view of a curved layer. Rows are the axes, in the frame of the mesh, that the
        x, y and normal of each triangle represent. Tensors are rotated by it (`stress_on`).
    point_turns : (n, 3, 3) array, optional
        The same at the points.
    walls : tuple of RoundWall and (k, 2) int array
        Round walls, and the boundary edges (point indices) that are chords of each.
    outline : tuple of (k, 2) arrays, mm, optional
        For the flat view of a curved layer: its boundary loops along round walls, in the chart.
    """

    points: FloatArray
    triangles: IntArray
    cell: IntArray
    nodes: IntArray
    weights: FloatArray
    loops: tuple[IntArray, ...]
    index: int
    thickness: float
    patches: Mapping[str, IntArray] = field(default_factory=dict)
    flat: Plane | None = None
    local_thickness: FloatArray = None  # type: ignore[assignment]
    turns: FloatArray | None = None
    point_turns: FloatArray | None = None
    walls: tuple[tuple[RoundWall, IntArray], ...] = ()
    outline: tuple[FloatArray, ...] = ()

    def __post_init__(self) -> None:
        local = self.local_thickness
        if local is None:
            local = np.broadcast_to(float(self.thickness), len(self.points))
        object.__setattr__(self, "local_thickness", shared_rows(local))
        freeze(self, points=float, triangles=int, cell=int, nodes=int, weights=float, patches=int)
        freeze(self, turns=float, point_turns=float)
        object.__setattr__(self, "loops", tuple(read_only(x, np.int64) for x in self.loops))

    def __repr__(self) -> str:
        shape = "curved" if self.flat is None else f"flat at {self.flat.height:.6g} mm"
        return (
            f"Layer {self.index}, {shape}: {len(self.points)} points, {len(self.triangles)} "
            f"triangles, {len(self.loops)} boundary loops"
        )

    def interpolate(self, nodal: FloatArray) -> FloatArray:
        """Values at the layer's points, (n, ...), of a field given at the mesh nodes."""
        if self.weights.ndim == 2:
            return np.asarray(np.einsum("nk,nk...->n...", self.weights, nodal[self.nodes]))
        w = self.weights.reshape((-1,) + (1,) * (nodal.ndim - 1))
        return (1.0 - w) * nodal[self.nodes[:, 0]] + w * nodal[self.nodes[:, 1]]

    def nearest(self, points: FloatArray) -> Nearest:
        """Places of the layer that are nearest to points (q, 3), mm."""
        return nearest_on_triangles(self.points, self.triangles, points)

    def values_at(self, places: Nearest, values: FloatArray) -> FloatArray:
        """Values at places of the layer, (q, ...), of a field given at its points."""
        corners = values[self.triangles[places.triangle]]
        return np.asarray(np.einsum("qk,qk...->q...", places.weights, corners))

    def normals_at(self, places: Nearest) -> FloatArray:
        """Return the normals of the layer at places of it, (q, 3), of length 1."""
        normals = self.values_at(places, self.point_normals)
        return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)

    @property
    def _across(self) -> FloatArray:
        """Cross product of two sides of each triangle, (t, 3): twice its area, along its normal."""
        a, b, c = np.moveaxis(self.points[self.triangles], 1, 0)
        return np.cross(b - a, c - a)

    @cached_property
    def areas(self) -> FloatArray:
        """Area of each triangle, (t,), mm^2."""
        return read_only(0.5 * np.linalg.norm(self._across, axis=1))

    @property
    def normals(self) -> FloatArray:
        """Unit normal of each triangle, (t, 3), upwards; zero where a triangle has no area.

        They are not kept: those of hundreds of layers fill memory.
        """
        return np.asarray(self._across / np.maximum(2.0 * self.areas, 1e-300)[:, None])

    @cached_property
    def point_normals(self) -> FloatArray:
        """Unit normal at each point, (n, 3): area-weighted mean of the triangles round it."""
        total = np.zeros_like(self.points)
        for axis in range(3):
            share = np.repeat(self._across[:, axis], 3)
            total[:, axis] = np.bincount(self.triangles.ravel(), share, minlength=len(total))
        size = np.linalg.norm(total, axis=1, keepdims=True)
        return read_only(total / np.maximum(size, 1e-300))

    @cached_property
    def component(self) -> IntArray:
        """Number of the connected piece of each triangle, (t,), from 0."""
        t = self.triangles
        piece = connected(np.concatenate([t[:, :2], t[:, 1:]]), len(self.points))
        _, number = np.unique(piece[t[:, 0]], return_inverse=True)
        return read_only(number, int)

    @cached_property
    def plane_triangles(self) -> Simplices:
        """Its triangles in its plane, to be searched for points."""
        return Simplices.of(self.plane.points, self.triangles)

    @cached_property
    def plane(self) -> "FlatLayer":
        """The layer seen in its plane; an error where it is curved."""
        if self.flat is None:
            raise InputError(
                f"layer {self.index} is curved and lies in no plane: choose a planar slicing, or "
                "what works on curved layers"
            )
        points = self.flat.project(self.points)
        about = (points, self.loops, self.walls, self.outline)
        return FlatLayer(self.flat.frame, self.flat.height, *about)


def curved_layers(layers: Sequence[Layer]) -> tuple[Layer, ...]:
    """Those of some layers that lie in no plane."""
    return tuple(layer for layer in layers if layer.flat is None)


def flat_layers(layers: Iterable[Layer]) -> tuple[Layer, ...]:
    """Those of some layers that lie in a plane."""
    return tuple(layer for layer in layers if layer.flat is not None)


@dataclass(frozen=True)
class FlatLayer(Plane):
    """A flat layer in the coordinates of its plane.

    Attributes
    ----------
    points : (n, 2) array, mm
        Plane coordinates of the layer's points.
    loops : tuple of (k,) int arrays
        Boundary loops of the layer.
    walls, outline
        As of the layer.
    """

    points: FloatArray
    loops: tuple[IntArray, ...]
    walls: tuple[tuple[RoundWall, IntArray], ...] = ()
    outline: tuple[FloatArray, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze(self, points=float)

    @cached_property
    def rings(self) -> tuple[FloatArray, ...]:
        """Plane coordinates (k, 2) of the boundary loops, along round walls where they lie on some.

        The first point is not repeated.
        """
        return self.outline or rounded_rings(self, self.points, self.loops, self.walls)

    @cached_property
    def polygon(self) -> Region:
        """Section: a valid (Multi)Polygon with holes, mm."""
        rings = [shapely.Polygon(ring) for ring in self.rings if len(ring) > 2]
        outer = [ring for ring in rings if ring.exterior.is_ccw]
        holes = [ring for ring in rings if not ring.exterior.is_ccw]
        section = shapely.union_all([shapely.make_valid(ring) for ring in outer])
        if holes:
            section = section.difference(shapely.union_all([shapely.make_valid(h) for h in holes]))
        return section


# Holes of a layer, identified by the patches that their edges lie on.


def holes_on(layer: Layer, patches: Iterable[str]) -> list[shapely.Polygon]:
    """Holes of a flat layer whose edge touches one of the patches, as shapely Polygons."""
    touched: set[int] = set()
    for name in patches:
        check_known("patch", name, sorted(layer.patches))
        touched |= set(layer.patches[name].ravel().tolist())
    rings = [shapely.Polygon(ring) for ring in layer.plane.rings if len(ring) > 2]
    loops = [loop for loop in layer.loops if len(loop) > 2]
    return [
        ring
        for ring, loop in zip(rings, loops, strict=True)
        if not ring.exterior.is_ccw and touched & set(loop.tolist())
    ]


# Stress on a layer: all that planning on it needs to know about the part.


@dataclass(frozen=True)
class LayerStress(Shown):
    """Stress on a layer.

    Attributes
    ----------
    cell : (t, 3, 3) array, MPa
        Stress of the tetrahedron that each triangle was cut from.
    nodal : (n, 3, 3) array, MPa
        Stress at the layer's points.
    held_or_loaded : tuple of str, default none
        Names of the part's patches that carry a support or a load.
    """

    layer: Layer
    cell: FloatArray
    nodal: FloatArray
    held_or_loaded: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"LayerStress on {self.layer!r}"

    def __post_init__(self) -> None:
        freeze(self, cell=float, nodal=float)


def stress_on(layer: Layer, stress: PartStress) -> LayerStress:
    """Stress of a part on one of its layers, in the axes of the layer (`Layer.turns`)."""
    cell, nodal = stress.stress[layer.cell], layer.interpolate(stress.nodal)
    if layer.turns is not None and layer.point_turns is not None:
        cell, nodal = in_axes(cell, layer.turns), in_axes(nodal, layer.point_turns)
    return LayerStress(layer, cell, nodal, stress.held_or_loaded)


# Borders of sections along the round walls that they cut, in place of the mesh's chords.


_SAGITTA = 0.005
"""Largest distance, mm, of the sides of a ring from the wall that they follow."""
_LEAST = 24
"""Sides of a full circle, at least."""
_ALONG = 1e-9
"""Sine of the angle between the axis of a cylinder and the normal of the plane, up to which the
section is a circle."""
_MOST = 64
"""Pieces that a side is cut into, at most."""


def rounded_rings(
    plane: Plane,
    points: FloatArray,
    loops: Sequence[IntArray],
    walls: Sequence[tuple[RoundWall, IntArray]],
) -> tuple[FloatArray, ...]:
    """Boundary loops of a section with the runs on round walls as the walls have them.

    Parameters
    ----------
    points : (n, 2) array, mm
        Plane coordinates of the section's points.
    loops : sequence of (k,) int arrays
        Boundary loops as point indices.
    walls : sequence of RoundWall and (k, 2) int array
        Round walls, and the boundary edges that are chords of each.

    Returns
    -------
    tuple of (k, 2) arrays, mm
        Plane coordinates of each loop, within 0.005 mm of its walls; the first point is not
        repeated. Their points turn with the part, and are equal for equal walls on all layers.
    """
    of_edge = _by_edge(walls)
    rings = []
    for loop in loops:
        sides = zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
        wall = np.array([of_edge.get(side, -1) for side in sides])
        rings.append(points[loop] if (wall < 0).all() else _ring(plane, points[loop], wall, walls))
    return tuple(rings)


def charted_rings(
    points: FloatArray,
    image: FloatArray,
    triangles: IntArray,
    turns: FloatArray,
    loops: Sequence[IntArray],
    walls: Sequence[tuple[RoundWall, IntArray]],
) -> tuple[FloatArray, ...]:
    """Boundary loops of a curved layer in its chart, along the round walls where they lie on some.

    Places between the points of a chord are moved onto the wall within the triangle's plane, and
    into the chart as the triangle is.

    Parameters
    ----------
    points : (n, 3) array, mm
        Of the layer.
    image : (n, 2) array, mm
        The same in the chart.
    triangles : (t, 3) int array
    turns : (t, 3, 3) array
        First two rows: what the map of each triangle makes x and y of; last: its unit normal.
    loops, walls
        As of `rounded_rings`.

    Returns
    -------
    tuple of (k, 2) arrays, mm
        Each loop in the chart; the first point is not repeated.
    """
    round_walls = [wall for wall, _ in walls]
    of_edge = _by_edge(walls)
    rings = []
    for loop in loops:
        edges = np.column_stack([loop, np.roll(loop, -1)])
        wall = np.array([of_edge.get(edge, -1) for edge in map(tuple, edges.tolist())])
        if (wall < 0).all():
            rings.append(image[loop])
            continue
        turn = turns[sides_at(edges, triangles)[0]]
        # Points with chords of one wall on both sides lie on mesh edges, which are chords too.
        inner = (wall >= 0) & (wall == np.roll(wall, 1))
        corners = points[loop].copy()
        corners[inner] = moved_onto(round_walls, wall[inner], corners[inner], planes=turn[inner, 2])
        following = np.roll(corners, -1, axis=0)
        middle = 0.5 * (corners + following)
        sagitta = np.linalg.norm(
            moved_onto(round_walls, wall, middle, planes=turn[:, 2]) - middle, axis=1
        )
        count = np.where(wall < 0, 1, np.clip(np.ceil(np.sqrt(sagitta / _SAGITTA)), 1, _MOST))
        first = np.repeat(np.arange(len(loop)), count.astype(int))
        share = np.concatenate([np.arange(n) / n for n in count.astype(int)])[:, None]
        places = (1.0 - share) * corners[first] + share * following[first]
        between = share[:, 0] > 0.0
        places[between] = moved_onto(
            round_walls, wall[first[between]], places[between], planes=turn[first[between], 2]
        )
        away = places - points[loop[first]]
        rings.append(image[loop[first]] + np.einsum("kij,kj->ki", turn[first, :2], away))
    return tuple(rings)


def _by_edge(walls: Sequence[tuple[RoundWall, IntArray]]) -> dict[tuple[int, int], int]:
    """Return the number of the wall of each boundary edge, in both senses."""
    return {
        (start, end): k
        for k, (_, edges) in enumerate(walls)
        for start, end in np.concatenate([edges, edges[:, ::-1]]).tolist()
    }


def _ring(
    plane: Plane, corners: FloatArray, wall: IntArray, walls: Sequence[tuple[RoundWall, IntArray]]
) -> FloatArray:
    """Ring of corners (k, 2) whose sides lie on walls (k,), -1 for none."""
    changes = np.flatnonzero(wall != np.roll(wall, 1))
    if not len(changes):
        return _wall_curve(plane, np.concatenate([corners, corners[:1]]), walls[wall[0]][0])[:-1]
    pieces = []
    # From one change of wall to the next; each run leaves its last point to the next one.
    for start, stop in zip(changes, np.append(changes[1:], changes[0] + len(corners)), strict=True):
        run = corners[np.arange(start, stop + 1) % len(corners)]
        k = wall[start]
        pieces.append((run if k < 0 else _wall_curve(plane, run, walls[k][0]))[:-1])
    return np.concatenate(pieces)


def _wall_curve(plane: Plane, run: FloatArray, wall: RoundWall) -> FloatArray:
    """Curve (k, 2) of a wall from the first to the last point of a run (k, 2) of chords."""
    along = np.linalg.norm(np.cross(wall.direction, plane.frame[2]))
    if wall.slope == 0.0 and wall.direction.any() and along < _ALONG:
        start = run[0] if wall.start is None else plane.project(wall.start)
        return _arc(run, plane.project(wall.centre), wall.radius, start)
    closed = np.array_equal(run[0], run[-1])
    inner = _onto_wall(plane, run[:-1] if closed else run[1:-1], wall)
    run = np.concatenate([inner, inner[:1]] if closed else [run[:1], inner, run[-1:]])
    # As many points between two as keep the sides near the wall: their distance falls by squares.
    middle = 0.5 * (run[1:] + run[:-1])
    sagitta = np.linalg.norm(_onto_wall(plane, middle, wall) - middle, axis=1)
    count = np.clip(np.ceil(np.sqrt(sagitta / _SAGITTA)), 1, _MOST).astype(int)
    share = np.concatenate([np.arange(n) / n for n in count])[:, None]
    first = np.repeat(np.arange(len(count)), count)
    between = _onto_wall(plane, (1.0 - share) * run[first] + share * run[first + 1], wall)
    between[share[:, 0] == 0.0] = run[:-1]
    return np.concatenate([between, run[-1:]])


def _arc(run: FloatArray, centre: FloatArray, radius: float, start: FloatArray) -> FloatArray:
    """Arc (k, 2) of a circle along a run: even steps from end to end, or round from a start."""
    half = np.arccos(max(1.0 - _SAGITTA / radius, np.cos(np.pi / _LEAST)))
    if np.array_equal(run[0], run[-1]):
        arm = start - centre
        ring = shapely.Polygon(run)
        turn = 2.0 * np.pi if ring.exterior.is_ccw else -2.0 * np.pi
        count = 4 * int(np.ceil(np.pi / 4.0 / half))
        # Half a step on: at the start itself corners meet ties of patterns along the axes.
        angle = np.arctan2(arm[1], arm[0]) + turn * (np.arange(count + 1) + 0.5) / count
        return np.asarray(centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    arm = run - centre
    angle = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
    count = max(int(np.ceil(abs(angle[-1] - angle[0]) / (2.0 * half) - 1e-9)), 1)
    inner = np.linspace(angle[0], angle[-1], count + 1)[1:-1]
    places = centre + radius * np.stack([np.cos(inner), np.sin(inner)], axis=1)
    return np.concatenate([run[:1], places, run[-1:]])


def _onto_wall(plane: Plane, places: FloatArray, wall: RoundWall) -> FloatArray:
    """Places (k, 2) moved onto a wall within the plane."""
    flat = np.tile(plane.frame[2], (len(places), 1))
    space = plane.to_space(places)
    moved = moved_onto([wall], np.zeros(len(places), dtype=np.int64), space, planes=flat)
    return np.asarray(plane.project(moved))
