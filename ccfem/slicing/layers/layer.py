"""A layer: the triangulated surface on which a strategy plans its paths."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray, freeze, read_only
from ccfem.base.display import Shown
from ccfem.base.errors import InputError
from ccfem.body.mesh.round_walls import RoundWall
from ccfem.geometry.measures import connected
from ccfem.geometry.shapes import Region
from ccfem.slicing.layers.plane import Plane
from ccfem.slicing.layers.rounded_rings import rounded_rings


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
        if self.local_thickness is None:
            everywhere = np.full(len(self.points), float(self.thickness))
            object.__setattr__(self, "local_thickness", everywhere)
        freeze(self, points=float, triangles=int, cell=int, nodes=int, weights=float, patches=int)
        freeze(self, local_thickness=float, turns=float, point_turns=float)
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

    @cached_property
    def _across(self) -> FloatArray:
        """Cross product of two sides of each triangle, (t, 3): twice its area, along its normal."""
        a, b, c = np.moveaxis(self.points[self.triangles], 1, 0)
        return np.cross(b - a, c - a)

    @cached_property
    def areas(self) -> FloatArray:
        """Area of each triangle, (t,), mm^2."""
        return read_only(0.5 * np.linalg.norm(self._across, axis=1))

    @cached_property
    def normals(self) -> FloatArray:
        """Unit normal of each triangle, (t, 3), upwards; zero where a triangle has no area."""
        return read_only(self._across / np.maximum(2.0 * self.areas, 1e-300)[:, None])

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
    def plane(self) -> "FlatLayer":
        """The layer seen in its plane.

        Raises
        ------
        InputError
            When the layer is curved.
        """
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
