"""Flat layers across the build direction."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, read_only
from ccfem.base.checks import check_choices, check_number
from ccfem.base.errors import InputError
from ccfem.base.plain import plain_dataclass
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.round_walls import RoundWall
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.facets import border_edges, counter_clockwise
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import FlatLayer, Layer, Plane, plane_frame
from ccfem.slicing.layers.level_cut import chain, cut_at_zero, on_edges, patch_edges, wall_edges
from ccfem.slicing.layers.slicer import Vector, check_heights

_TOP = 1e-3
"""Share of the part's height below its top where a height that cuts nothing lies on it."""
_SNAP = 2e-6
"""Nodes nearer to the plane than this share of the part's size are taken to lie on it [Chen et al.
2021, section 5]: a plane through mesh nodes would otherwise cut slivers."""

_COUNT = 12
"""Layers where nothing else is asked for: those of the Loop of Chen et al. 2021."""

_MOST = 100_000
"""Layers above which their number is taken for a mistake."""

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@plain_dataclass
class Planar:
    """Flat layers across the build direction, at the middle of slabs or at given heights.

    At most one of the three is given; without any there are 12 layers.

    Attributes
    ----------
    count : int, optional
        Number of layers, at the middle of equal slabs.
    thickness : float, mm, optional
        Height of a slab. As many slabs as fit are stacked from the bottom up. The rest at the top,
        less than one slab, belongs to the last layer and is printed in matrix, without fibre.
    heights : tuple of float, mm, optional
        Heights ``points @ direction`` of the layers themselves.
    axis : {"build", "x", "y", "z"}
        What the layers lie across: the build direction of the part, or an axis of its mesh.
    """

    count: int | None = None
    thickness: float | None = None
    heights: tuple[float, ...] | None = None
    axis: Literal["build", "x", "y", "z"] = "build"

    shorthand: ClassVar[str] = "axis"

    def __post_init__(self) -> None:
        check_choices(self)
        given = [n for n in ("count", "thickness", "heights") if getattr(self, n) is not None]
        if len(given) > 1:
            raise InputError(
                "planar layers need one of count, thickness and heights; got "
                f"{' and '.join(given)}: choose one"
            )
        if not given:
            object.__setattr__(self, "count", _COUNT)
        if self.count is not None:
            check_number("the number of layers", self.count, at_least=1, at_most=_MOST)
        if self.heights is not None:
            object.__setattr__(self, "heights", _rising(self.heights))

    def __call__(self, stress: PartStress, build: Vector, machine: Machine) -> tuple[Layer, ...]:
        """Cut a part into flat layers; the stress has no influence."""
        self.check(stress.mesh, build, machine)  # before thousands of layers are cut
        return self.cut(stress.mesh, build)

    def check(self, mesh: TetMesh, build: Vector, machine: Machine) -> FloatArray:
        """Refuse layers nearer to each other than a strand of a machine is high; their heights."""
        stack = self._stack(mesh, plane_frame(_AXES.get(self.axis, build)))
        check_heights(stack, machine)
        return stack

    def cut(self, mesh: TetMesh, build: Vector = (0.0, 0.0, 1.0)) -> tuple[Layer, ...]:
        """Cut a mesh into flat layers.

        Parameters
        ----------
        build : tuple of 3 floats, default z
            Build direction.

        Returns
        -------
        tuple of Layer
            From the bottom to the top. Heights between two disconnected parts give no layer.

        Raises
        ------
        InputError
            When a height lies outside the part or on its top, or a slab is higher than the part.
        """
        frame = plane_frame(_AXES.get(self.axis, build))
        cells = _CellsByHeight.of(mesh, frame)
        stack = self._stack(mesh, frame)
        # A layer stands for what is nearer to it than to the others.
        edges = [cells.lowest, *(0.5 * (stack[1:] + stack[:-1])).tolist(), cells.highest]
        layers = [
            _cut_plane(cells, Plane(frame, float(height)), k, edges[k + 1] - edges[k])
            for k, height in enumerate(stack)
        ]
        if layers[-1] is None:
            cells.check_top(float(stack[-1]))
        return tuple(layer for layer in layers if layer is not None)

    def sections(
        self, mesh: TetMesh, build: Vector = (0.0, 0.0, 1.0)
    ) -> Iterator[tuple[int, FlatLayer]]:
        """Yield the sections of a mesh, with the place of their layers: `cut` without triangles.

        Each is cut when it is asked for, and those between the same nodes only once as far as they
        are equal: hundreds of layers of a prism need little more memory than one.
        """
        frame = plane_frame(_AXES.get(self.axis, build))
        cells = _CellsByHeight.of(mesh, frame)
        stack = self._stack(mesh, frame).tolist()
        for k, height in enumerate(stack):
            section = _section(cells, Plane(frame, height))
            if section is not None:
                yield k, section
            elif k == len(stack) - 1:
                cells.check_top(height)

    def _stack(self, mesh: TetMesh, frame: FloatArray) -> FloatArray:
        """Heights of the layers along the build direction, rising, mm; all of them in the part."""
        level = mesh.points[np.unique(mesh.corners)] @ frame[2]
        lowest, highest = float(level.min()), float(level.max())
        if self.heights is None:
            return slice_heights(lowest, highest, self.count, self.thickness)
        stack = np.array(self.heights)
        outside = stack[(stack < lowest) | (stack > highest)]
        if len(outside):
            raise InputError(
                f"layer height {outside[0]:g} mm lies outside the part, which reaches from "
                f"{lowest:g} to {highest:g} mm along the build direction"
            )
        return stack


def _rising(heights: Sequence[float]) -> tuple[float, ...]:
    """Heights of layers in order, mm; an error unless they are finite and all different."""
    rising = np.sort(np.asarray(heights, dtype=float))
    if not len(rising) or not np.isfinite(rising).all():
        raise InputError("give at least one layer height, a finite number in mm")
    again = rising[1:][np.diff(rising) == 0.0]
    if len(again):
        raise InputError(
            f"each layer height must be given once; got {again[0]:g} mm more than once: a layer "
            "there has room for its fibre once"
        )
    return tuple(rising.tolist())


def slice_heights(
    lowest: float, highest: float, count: int | None = None, thickness: float | None = None
) -> FloatArray:
    """Heights of layers at the middle of equal slabs, (count,), mm.

    Parameters
    ----------
    lowest, highest : float, mm
        Extent of the part along the build direction.
    count : int, optional
        Number of layers.
    thickness : float, mm, optional
        Height of a slab instead of their number: as many as fit, from the lowest up.
    """
    size = highest - lowest
    if (count is None) == (thickness is None):
        raise InputError("give either the number of layers or their thickness, not both or none")
    if count is not None:
        return lowest + (np.arange(count, dtype=np.float64) + 0.5) * size / count
    assert thickness is not None
    # A slab as high as the part is one, whatever the rounding of its ends.
    slabs = int(np.floor(size / thickness + 1e-9)) if thickness > 0.0 else 0
    if slabs < 1:
        raise InputError(
            f"layer thickness must be above 0 and at most the part's height {size:g} mm; got "
            f"{thickness:g}"
        )
    return lowest + (np.arange(slabs, dtype=np.float64) + 0.5) * thickness


@dataclass(frozen=True)
class _Border:
    """Border of all sections between the same nodes: as `Layer` has it, with the ends of edges."""

    nodes: IntArray
    loops: tuple[IntArray, ...]
    patches: Mapping[str, IntArray]
    walls: tuple[tuple[RoundWall, IntArray], ...]


@dataclass(frozen=True)
class _CellsByHeight:
    """Cells of a mesh whose nodes are at heights `level` (n,), in the order of their lowest corner.

    `low` (c,) are these corners, and `tall` the height of the tallest cell. Layers that cut the
    same edges of the mesh share the arrays that say so, in `known`, and their border.
    """

    mesh: TetMesh
    level: FloatArray
    order: IntArray
    low: FloatArray
    tall: float
    lowest: float
    highest: float
    snap: float
    known: dict[bytes, IntArray] = field(default_factory=dict)
    borders: dict[bytes, _Border] = field(default_factory=dict)

    @classmethod
    def of(cls, mesh: TetMesh, frame: FloatArray) -> "_CellsByHeight":
        """Sort the cells of a mesh by their heights in a frame."""
        level = mesh.points @ frame[2]
        corners = level[mesh.corners]
        low, high = corners.min(axis=1), corners.max(axis=1)
        order = np.argsort(low, kind="stable")
        ends = float((high - low).max()), float(low.min()), float(high.max())
        snap = _SNAP * float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
        return cls(mesh, level, order, low[order], *ends, snap)

    def once(self, values: IntArray) -> IntArray:
        """Take values that another layer has, too, from there."""
        digest = hashlib.sha256(values.tobytes()).digest() + str(values.shape).encode()
        return self.known.setdefault(digest, read_only(values, int))

    def signed(self, height: float) -> FloatArray:
        """Heights of the nodes over a plane, (n,); 0 for those that are taken to lie on it."""
        signed = self.level - height
        signed[np.abs(signed) < self.snap] = 0.0
        return signed

    def met(self, signed: FloatArray, height: float) -> tuple[IntArray, bytes]:
        """Cells, ascending, that reach to a plane, and a digest of the sides of their corners."""
        ends = height - self.tall - 2.0 * self.snap, height + 2.0 * self.snap
        near = np.sort(self.order[slice(*np.searchsorted(self.low, ends))])
        side = np.sign(signed[self.mesh.corners[near]]).astype(np.int8)
        meets = (side.min(axis=1) <= 0) & (side.max(axis=1) >= 0)
        near, side = near[meets], side[meets]
        return near, hashlib.sha256(near.tobytes() + side.tobytes()).digest()

    def border(self, sides: bytes, triangles: IntArray, nodes: IntArray) -> _Border:
        """Border of triangles whose points lie on edges of the mesh."""
        if sides not in self.borders:
            edges = border_edges(triangles, len(nodes))
            about = (self.mesh, edges, nodes)
            self.borders[sides] = _Border(
                self.once(nodes), chain(edges), patch_edges(*about), wall_edges(*about)
            )
        return self.borders[sides]

    def check_top(self, height: float) -> None:
        """Refuse a height at the top of the part, where nothing is cut."""
        if self.highest - height < _TOP * (self.highest - self.lowest):
            raise InputError(
                f"layer height {height:g} mm lies on the top of the part, where nothing is cut: "
                "lay it at least half a strand height lower"
            )


def _onto(points: FloatArray, plane: Plane) -> FloatArray:
    """Points of nodes that were taken to lie on a plane, moved onto it."""
    normal = plane.frame[2]
    return points + (plane.height - points @ normal)[:, None] * normal


def _cut_plane(cells: _CellsByHeight, plane: Plane, index: int, thickness: float) -> Layer | None:
    """Layer where a mesh meets a plane; None nowhere."""
    signed = cells.signed(plane.height)
    near, sides = cells.met(signed, plane.height)
    cut = cut_at_zero(cells.mesh, signed, near)
    if cut is None:
        return None
    points = _onto(cut.points, plane)
    triangles = counter_clockwise(plane.project(points), cut.triangles)
    border = cells.border(sides, triangles, cut.nodes)
    return Layer(
        points=points,
        triangles=cells.once(triangles),
        cell=cells.once(cut.cell),
        nodes=border.nodes,
        weights=cut.weights,
        loops=border.loops,
        flat=plane,
        index=index,
        thickness=thickness,
        patches=border.patches,
        walls=border.walls,
    )


def _section(cells: _CellsByHeight, plane: Plane) -> FlatLayer | None:
    """Section where a mesh meets a plane, equal to that of its layer; None nowhere."""
    signed = cells.signed(plane.height)
    near, sides = cells.met(signed, plane.height)
    border = cells.borders.get(sides)
    if border is None:
        cut = cut_at_zero(cells.mesh, signed, near)
        if cut is None:
            return None
        triangles = counter_clockwise(plane.project(_onto(cut.points, plane)), cut.triangles)
        border = cells.border(sides, triangles, cut.nodes)
    points = plane.project(_onto(on_edges(border.nodes, signed, cells.mesh.points)[0], plane))
    return FlatLayer(plane.frame, plane.height, points, border.loops, border.walls)
