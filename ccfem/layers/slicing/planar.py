"""Flat layers across the build direction."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from ccfem.arrays import FloatArray, IntArray
from ccfem.elasticity.part_stress import PartStress
from ccfem.errors import InputError
from ccfem.layers.layer import Layer
from ccfem.layers.pitch import check_pitch
from ccfem.layers.plane import Plane, plane_frame
from ccfem.layers.slicer import Vector
from ccfem.machine.machine import Machine
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["Planar", "slice_heights"]

_SNAP = 2e-6
"""Nodes nearer to the plane than this share of the part's size are taken to lie on it [Chen et al.
2021, section 5]: a plane through mesh nodes would otherwise cut slivers."""

_COUNT = 12
"""Layers where nothing else is asked for: those of the Loop of Chen et al. 2021."""


@dataclass(frozen=True)
class Planar:
    """Flat layers across the build direction, at the middle of slabs or at given heights.

    At most one of the three is given; without any there are 12 layers.

    Attributes
    ----------
    count : int, optional
        Number of layers, at the middle of equal slabs.
    thickness : float, mm, optional
        Height of a slab; the last one may stand out at the top.
    heights : tuple of float, mm, optional
        Heights ``points @ direction`` of the layers themselves.
    """

    count: int | None = None
    thickness: float | None = None
    heights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        given = [n for n in ("count", "thickness", "heights") if getattr(self, n) is not None]
        if len(given) > 1:
            raise InputError(
                "planar layers need one of count, thickness and heights; got "
                f"{' and '.join(given)}: choose one"
            )
        if not given:
            object.__setattr__(self, "count", _COUNT)
        if self.count is not None and self.count < 1:
            raise InputError(f"the number of layers must be at least 1; got {self.count}")
        if self.heights is not None:
            heights = tuple(sorted(float(height) for height in self.heights))
            if not heights or not np.isfinite(heights).all():
                raise InputError("give at least one layer height, a finite number in mm")
            if (np.diff(heights) == 0.0).any():
                again = heights[int(np.flatnonzero(np.diff(heights) == 0.0)[0])]
                raise InputError(
                    f"each layer height must be given once; got {again:g} mm more than once: a "
                    "layer there has room for its fibre once"
                )
            object.__setattr__(self, "heights", heights)

    def __call__(self, stress: PartStress, build: Vector, machine: Machine) -> tuple[Layer, ...]:
        """Cut a part into flat layers; the stress has no influence.

        Raises
        ------
        InputError
            As of `cut`, and when layers are nearer than a strand of the machine is high.
        """
        layers = self.cut(stress.mesh, build)
        check_pitch(layers, machine)
        return layers

    def cut(self, mesh: TetMesh, build: Vector = (0.0, 0.0, 1.0)) -> tuple[Layer, ...]:
        """Cut a mesh into flat layers.

        Parameters
        ----------
        mesh : TetMesh
        build : tuple of 3 floats, default z
            Build direction.

        Returns
        -------
        tuple of Layer
            From the bottom to the top. Heights between two disconnected parts give no layer.

        Raises
        ------
        InputError
            When a height lies outside the part, or a slab is higher than the part.
        """
        frame = plane_frame(build)
        level = mesh.points @ frame[2]
        lowest, highest = float(level[mesh.corners].min()), float(level[mesh.corners].max())
        if self.heights is None:
            stack = slice_heights(lowest, highest, self.count, self.thickness)
        else:
            stack = np.array(self.heights)
        if stack[0] < lowest or stack[-1] > highest:
            outside = stack[0] if stack[0] < lowest else stack[-1]
            raise InputError(
                f"layer height {outside:g} mm lies outside the part, which reaches from "
                f"{lowest:g} to {highest:g} mm along the build direction"
            )
        edges = np.concatenate([[lowest], 0.5 * (stack[1:] + stack[:-1]), [highest]])
        layers = (
            _cut(mesh, Plane(frame, float(h)), level, k, float(edges[k + 1] - edges[k]))
            for k, h in enumerate(stack)
        )
        return tuple(layer for layer in layers if layer is not None)


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
        Height of a slab instead of their number; the last one may stand out at the top.
    """
    size = highest - lowest
    if (count is None) == (thickness is None):
        raise InputError("give either the number of layers or their thickness, not both or none")
    if count is not None:
        return lowest + (np.arange(count, dtype=np.float64) + 0.5) * size / count
    assert thickness is not None
    if not 0.0 < thickness <= size:
        raise InputError(
            f"layer thickness must be above 0 and at most the part's height {size:g} mm; got "
            f"{thickness:g}"
        )
    slabs = int(np.ceil(size / thickness - 0.5 - 1e-9))
    return lowest + (np.arange(slabs, dtype=np.float64) + 0.5) * thickness


def _cut(
    mesh: TetMesh, plane: Plane, level: FloatArray, index: int, thickness: float
) -> Layer | None:
    frame, height = plane.frame, plane.height
    snap = _SNAP * float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    signed = level - height
    signed[np.abs(signed) < snap] = 0.0
    corners = mesh.corners
    values = signed[corners]
    crossing = np.flatnonzero((values.min(axis=1) <= 0.0) & (values.max(axis=1) >= 0.0))
    lines, cell = _cut_cells(corners[crossing], signed, mesh.points)
    if not len(cell):
        return None
    # An edge of the mesh is one number: smaller node * n + larger node.
    keys, inverse = np.unique(lines, return_inverse=True)
    a, b = np.divmod(keys, len(mesh.points))
    fall = signed[a] - signed[b]
    weights = np.divide(signed[a], fall, out=np.zeros(len(a)), where=fall != 0.0)
    points = (1.0 - weights)[:, None] * mesh.points[a] + weights[:, None] * mesh.points[b]
    points += (height - points @ frame[2])[:, None] * frame[2]
    triangles, cell = _drop_repeated(inverse.reshape(-1, 3), crossing[cell])
    triangles = _counter_clockwise(points @ frame[:2].T, triangles)
    border = _border_edges(triangles, len(points))
    nodes = np.stack([a, b], axis=1)
    return Layer(
        points=points,
        triangles=triangles,
        cell=cell,
        nodes=nodes,
        weights=weights,
        loops=_chain(border),
        flat=plane,
        index=index,
        thickness=thickness,
        patches=_patch_edges(mesh, border, nodes, points),
    )


@njit(cache=True)
def _cut_cells(
    cells: IntArray, signed: FloatArray, points: FloatArray
) -> tuple[IntArray, IntArray]:
    """Triangles (t, 3) of mesh-edge keys, and the row of `cells` that each comes from."""
    n = len(points)
    where = np.empty((4, 3))
    lines = np.empty((2 * len(cells), 3), np.int64)
    source = np.empty(2 * len(cells), np.int64)
    found = 0
    key = np.empty(4, np.int64)
    for row in range(len(cells)):
        cell = cells[row]
        corners = 0
        below = 0
        above = 0
        for i in range(4):
            if signed[cell[i]] == 0.0:
                key[corners] = cell[i] * n + cell[i]
                corners += 1
            elif signed[cell[i]] < 0.0:
                below += 1
            else:
                above += 1
        # A face in the plane belongs to the cell above it only.
        if corners == 3 and above == 0:
            continue
        if corners == 4 or corners + below * above < 3:
            continue
        on = corners
        for i in range(4):
            for j in range(i + 1, 4):
                p, q = cell[i], cell[j]
                if signed[p] * signed[q] < 0.0:
                    key[corners] = min(p, q) * n + max(p, q)
                    w = signed[p] / (signed[p] - signed[q])
                    where[corners] = (1.0 - w) * points[p] + w * points[q]
                    corners += 1
        if corners == 3:
            lines[found] = key[:3]
            source[found] = row
            found += 1
        elif on == 0:
            # Four crossings in the order (i, j) of a 2-2 split: 0-1-3-2 is the cyclic order. The
            # quad is split along its shorter diagonal [Chen et al. 2021, section 5].
            if ((where[0] - where[3]) ** 2).sum() <= ((where[1] - where[2]) ** 2).sum():
                a, b, c, d = key[0], key[1], key[3], key[2]
            else:
                a, b, c, d = key[1], key[3], key[2], key[0]
            lines[found, 0], lines[found, 1], lines[found, 2] = a, b, c
            lines[found + 1, 0], lines[found + 1, 1], lines[found + 1, 2] = a, c, d
            source[found] = source[found + 1] = row
            found += 2
    return lines[:found], source[:found]


def _drop_repeated(triangles: IntArray, cell: IntArray) -> tuple[IntArray, IntArray]:
    """Drop triangles with a repeated corner, which snapping leaves."""
    a, b, c = triangles.T
    keep = (a != b) & (b != c) & (a != c)
    return triangles[keep], cell[keep]


def _counter_clockwise(plane: FloatArray, triangles: IntArray) -> IntArray:
    a, b, c = np.moveaxis(plane[triangles], 1, 0)
    u, v = b - a, c - a
    clockwise = u[:, 0] * v[:, 1] < u[:, 1] * v[:, 0]
    turned = triangles.copy()
    turned[clockwise] = triangles[clockwise][:, [0, 2, 1]]
    return turned


def _border_edges(triangles: IntArray, n: int) -> IntArray:
    """Directed edges (e, 2) that only one triangle has; the material lies on their left."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    key = edges.min(axis=1) * n + edges.max(axis=1)
    _, first, count = np.unique(key, return_index=True, return_counts=True)
    return edges[first[count == 1]]


def _chain(border: IntArray) -> tuple[IntArray, ...]:
    """Chain directed edges to closed loops; each edge is used once where loops touch."""
    leaving: dict[int, list[int]] = {}
    for start, end in border.tolist():
        leaving.setdefault(start, []).append(end)
    loops = []
    for start in sorted(leaving):
        while leaving[start]:
            loop = [start]
            following = leaving[start].pop()
            while following != start:
                loop.append(following)
                following = leaving[following].pop()
            loops.append(np.array(loop, dtype=np.int64))
    return tuple(loops)


def _patch_edges(
    mesh: TetMesh, border: IntArray, nodes: IntArray, points: FloatArray
) -> dict[str, IntArray]:
    """Border edges (k, 2) that lie on each patch of the mesh."""
    ends = nodes[border].reshape(-1, 4)
    patches = {}
    for name, facets in mesh.patches.items():
        belongs = np.zeros(len(mesh.points), dtype=bool)
        belongs[facets] = True
        candidates = np.flatnonzero(belongs[ends].all(axis=1))
        known = {tuple(f) for f in np.sort(facets, axis=1).tolist()}
        kept = [k for k in candidates.tolist() if _on_facet(ends[k].tolist(), known)]
        patches[name] = border[kept].reshape(-1, 2)
    return patches


def _on_facet(ends: list[int], facets: set[tuple[int, ...]]) -> bool:
    """Whether the mesh nodes that carry a border edge span one of the facets."""
    nodes = tuple(sorted(set(ends)))
    if len(nodes) == 3:
        return nodes in facets
    return len(nodes) == 2 and any(set(nodes) <= set(f) for f in facets)
