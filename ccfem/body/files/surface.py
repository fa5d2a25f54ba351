"""Closed triangulated surfaces: from files (STL, OBJ, PLY, 3MF), and to try rules on."""

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray, IntArray, freeze, read_only
from ccfem.base.checks import FARTHEST, check_number
from ccfem.base.errors import InputError
from ccfem.base.whole import existing_file
from ccfem.body.isolated.process import ChildError, read_isolated
from ccfem.body.mesh.tet_mesh import CellMesh
from ccfem.geometry.facets import areas_and_normals

SUFFIXES = (".3mf", ".obj", ".ply", ".stl")
_NOTHING = 1e-12
"""Volume over area and diagonal that counts as none."""


@dataclass(frozen=True)
class Surface:
    """A closed surface of triangles (t, 3), outward, between points (n, 3), mm.

    One that is open, has no triangle, or encloses nothing is an `InputError`.
    """

    points: FloatArray
    triangles: IntArray

    def __post_init__(self) -> None:
        freeze(self, points=float, triangles=int)
        if self.points.ndim != 2 or self.points.shape[1] != 3 or not len(self.triangles):
            raise InputError(
                f"a surface needs points (n, 3) and triangles (t, 3); got {self.points.shape} "
                f"and {self.triangles.shape}: give a triangulated surface"
            )
        _check_near(self.points)
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.points):
            raise InputError(
                f"triangles must name points 0 to {len(self.points) - 1}; got "
                f"{self.triangles.min()} to {self.triangles.max()}: repair the file"
            )
        _check_closed(self.points, self.triangles)
        size = float(np.linalg.norm(np.ptp(self.points[self.triangles], axis=(0, 1))))
        area = float(areas_and_normals(self.points, self.triangles)[0].sum())
        if abs(self.volume) <= _NOTHING * size * area:
            raise InputError(
                f"the surface encloses no volume ({abs(self.volume):.3g} mm^3): give the outside "
                "of a solid, each wall once"
            )
        if self.volume < 0.0:
            object.__setattr__(self, "triangles", read_only(self.triangles[:, ::-1], np.int64))

    @property
    def volume(self) -> float:
        """Volume inside the surface, mm^3."""
        a, b, c = np.moveaxis(self.points[self.triangles] - self.points.mean(axis=0), 1, 0)
        return float(np.einsum("ij,ij->", np.cross(a, b), c)) / 6.0


def is_surface(path: str | os.PathLike[str]) -> bool:
    """Whether the name of a file is that of a surface."""
    return Path(path).suffix.lower() in SUFFIXES


def read_surface(path: str | os.PathLike[str], scale: float = 1.0) -> Surface:
    """Read a closed surface.

    Parameters
    ----------
    path : path
        STL, OBJ, PLY or 3MF; polygons are cut into triangles, equal points merged. Of a 3MF file
        it is all that it builds, in mm by its unit.
    scale : float, default 1
        Factor on the coordinates, to make them mm.

    Raises
    ------
    InputError
        When the file is missing or holds no surface, or the surface is open; it says how many
        edges are open and where.
    """
    path = existing_file(path, "surface file")
    if not is_surface(path):
        raise InputError(
            f"cannot tell the format of surface file {path}: its name must end in "
            f"{', '.join(SUFFIXES)}"
        )
    check_number("surface scale", scale, above=0.0)
    try:
        reader = "three_mf" if path.suffix.lower() == ".3mf" else "vtk_files"
        arrays = read_isolated(f"{reader}:read_surface", path)
    except ChildError as error:
        raise InputError(
            f"{path} is not a surface that can be read: {error}: export it again as binary STL"
        ) from None
    with np.errstate(over="ignore"):  # what overflows is refused as infinite
        points = arrays["points"] * scale
    try:
        return Surface(*_merged_points(points, arrays["triangles"]))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def write_stl(path: Path, points: FloatArray, triangles: IntArray) -> None:
    """Write triangles as binary STL, without normals: readers make them of the order of corners."""
    facets = np.zeros(
        len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")]
    )
    facets["corners"] = points[triangles]
    path.write_bytes(bytes(80) + np.array(len(facets), "<u4").tobytes() + facets.tobytes())


def _merged_points(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Merge points that agree to 1e-6 of the size; drop triangles that lose a side by it."""
    points, triangles = np.asarray(points), np.asarray(triangles, dtype=np.int64)
    _check_near(points)
    size = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    _, first, place = np.unique(
        np.round(points / (1e-6 * size)).astype(np.int64),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    triangles = place.reshape(-1)[triangles]
    a, b, c = triangles.T
    return points[first], triangles[(a != b) & (b != c) & (c != a)]


def _check_near(points: FloatArray) -> None:
    """Raise on coordinates that are not finite, or so large that their squares overflow."""
    if not np.isfinite(points).all():
        raise InputError("surface points must be finite; got NaN or infinity: repair the file")
    if len(points) and np.abs(points).max() > FARTHEST:
        raise InputError(
            f"surface points must lie within {FARTHEST:g} mm; got a coordinate of "
            f"{np.abs(points).max():.3g} mm: repair the file, or correct its scale"
        )


def _check_closed(points: FloatArray, triangles: IntArray) -> None:
    """Raise unless every edge joins triangles that run along it in opposite directions."""
    directed = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    edges, place, counts = np.unique(
        np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    odd = np.flatnonzero(counts % 2)
    if len(odd):
        middle = points[edges[odd]].mean(axis=1)
        low, high = _place(middle.min(axis=0)), _place(middle.max(axis=0))
        raise InputError(
            f"the surface is open: {len(odd)} edges belong to an odd number of triangles, the "
            f"first at {_place(middle[0])}, all within {low} to {high} mm: close the holes in the "
            "program that made it"
        )
    forward = np.where(directed[:, 0] < directed[:, 1], 1, -1)
    turned = np.flatnonzero(np.bincount(place.reshape(-1), weights=forward))
    if len(turned):
        at = _place(points[edges[turned[0]]].mean(axis=0))
        raise InputError(
            f"the surface's triangles do not all face outward: {len(turned)} edges are traversed "
            f"twice in one direction, the first at {at} mm: unify the normals"
        )


def _place(point: FloatArray) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"


# The boundary of a part that has no cells yet, to try rules of patches on.


_MOST = 400_000
"""Triangles at which a surface is fine enough."""
_SIDES = np.array([[0, 1], [1, 2], [2, 0]])


class Shell(CellMesh):
    """A closed surface of triangles, outward, as the only cells of a mesh; one rigid body."""

    dimension = 3
    sizes = (3,)
    kinds = "triangles"

    @property
    def facets(self) -> IntArray:
        """Sides of the triangles."""
        return self.cells[:, _SIDES].reshape(-1, 2)

    @cached_property
    def boundary(self) -> IntArray:
        """All triangles."""
        return self.cells

    @cached_property
    def neighbours(self) -> IntArray:
        """Pairs of triangles in a row: what a surface encloses hangs together."""
        row = np.arange(len(self.cells))
        return read_only(np.stack([row[:-1], row[1:]], axis=1), int)

    def facet_areas(self, facets: IntArray) -> tuple[FloatArray, FloatArray]:
        """Areas (k,), mm^2, and unit normals (k, 3) of triangles (k, 3)."""
        return areas_and_normals(self.points, facets)


def refined(
    points: ArrayLike, triangles: ArrayLike, length: float
) -> tuple[FloatArray, IntArray, IntArray]:
    """Cut triangles (t, 3) until no side is longer than a length, mm, or there are very many.

    A closed surface stays closed. Returns points, triangles, and the triangle that each is a piece
    of.
    """
    points = np.asarray(points, dtype=np.float64)
    triangles = np.asarray(triangles, dtype=np.int64)
    origin = np.arange(len(triangles))
    while len(triangles) < _MOST:
        sides = np.sort(triangles[:, _SIDES].reshape(-1, 2), axis=1)
        edges, place = np.unique(sides, axis=0, return_inverse=True)
        ends = points[edges]
        long = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) > length
        if not long.any():
            break
        middle = np.where(long, len(points) + np.cumsum(long) - 1, -1)
        points = np.concatenate([points, ends[long].mean(axis=1)])
        triangles, parent = _split_triangles(triangles, middle[place.reshape(-1)].reshape(-1, 3))
        origin = origin[parent]
    return points, triangles, origin


def _split_triangles(triangles: IntArray, middle: IntArray) -> tuple[IntArray, IntArray]:
    """Cut triangles at the middles (t, 3) of their sides, -1 for a side that stays; parents."""
    count = (middle >= 0).sum(axis=1)
    pieces, parents = [triangles[count == 0]], [np.flatnonzero(count == 0)]

    def add(rows: IntArray, *corners: tuple[IntArray, IntArray, IntArray]) -> None:
        for corner in corners:
            pieces.append(np.stack(corner, axis=1))
            parents.append(rows)

    for k in range(3):
        order = [k, (k + 1) % 3, (k + 2) % 3]
        rows = np.flatnonzero((count == 1) & (middle[:, k] >= 0))
        (a, b, c), (m, *_) = triangles[rows][:, order].T, middle[rows][:, order].T
        add(rows, (a, m, c), (m, b, c))
        rows = np.flatnonzero((count == 2) & (middle[:, k] < 0))
        (a, b, c), (_, m, n) = triangles[rows][:, order].T, middle[rows][:, order].T
        add(rows, (m, c, n), (a, b, m), (a, m, n))
    rows = np.flatnonzero(count == 3)
    (a, b, c), (m, n, o) = triangles[rows].T, middle[rows].T
    add(rows, (a, m, o), (m, b, n), (o, n, c), (m, n, o))
    return np.concatenate(pieces), np.concatenate(parents)
