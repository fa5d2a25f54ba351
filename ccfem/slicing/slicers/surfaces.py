"""Layers made by another program, one surface a file."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.body.files.layer_files import layer_files, read_layer
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.facets import border_edges
from ccfem.geometry.locate import locate, nearest_on_triangles
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.level_cut import chain
from ccfem.slicing.layers.level_surfaces import along_walls
from ccfem.slicing.layers.slicer import Vector, read_once

Sheet = tuple[FloatArray, IntArray]
"""Points (n, 3), mm, and triangles (t, 3) of a layer of another program."""


@dataclass(frozen=True)
class Surfaces:
    """Curved layers read from the OBJ files in a folder, ordered by the numbers in their names.

    Attributes
    ----------
    thickness : float, mm, default 0.5
        Thickness of the layers, which files of surfaces do not state.
    tolerance : float, mm, default 1
        Largest distance by which points may lie outside the part.
    """

    folder: str = "."
    thickness: float = 0.5
    tolerance: float = 1.0

    curved: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_fields(self, "thickness", "tolerance", above=0.0, unit="mm")

    def __call__(self, stress: PartStress, build: Vector, machine: Machine) -> tuple[Layer, ...]:
        """Read the layers, whichever side of their triangles is up; the stress does not matter."""
        sheets = facing_up(self._sheets(), build)
        return tuple(
            layer_from_surface(stress.mesh, *sheet, k, self.thickness, self.tolerance)
            for k, sheet in enumerate(sheets)
        )

    def check(self, mesh: TetMesh, build: Vector, machine: Machine) -> None:
        """Refuse files that cannot be read, and layers that miss the box of a part."""
        low, high = mesh.bounds
        for k, (points, triangles) in enumerate(self._sheets()):
            corners = points[np.unique(triangles)]
            outside = (corners < low - self.tolerance) | (corners > high + self.tolerance)
            _check_outside(outside.any(axis=1), k, self.tolerance)

    def _sheets(self) -> list[Sheet]:
        def read() -> list[Sheet]:
            return [read_layer(file) for file in layer_files(self.folder)]

        return read_once(self, self.folder, read)


def facing_up(sheets: Sequence[Sheet], build: Vector) -> list[Sheet]:
    """Turn over the sheets of a stack whose triangles face the bed.

    Sheets are in the order in which they are printed, each consistently oriented; one faces the
    next, and one that is alone the build direction.
    """
    turned = []
    for k, (points, triangles) in enumerate(sheets):
        if len(sheets) == 1:
            upward = np.broadcast_to(np.asarray(build, dtype=np.float64), points.shape)
        else:
            last = k == len(sheets) - 1
            other = nearest_on_triangles(*sheets[k - 1 if last else k + 1], points).points
            upward = points - other if last else other - points
        a, b, c = np.moveaxis(points[triangles], 1, 0)
        rise = np.einsum("td,td->", np.cross(b - a, c - a), upward[triangles].sum(axis=1))
        turned.append((points, triangles if rise >= 0.0 else triangles[:, ::-1]))
    return turned


# A layer from a surface made by another program.


_ON_PATCH = 0.6
"""Distance, mm, of both ends of a border edge from a patch up to which the edge lies on it."""


def _chords_of(mesh: TetMesh, wall: int) -> float:
    """How far the sides of a mesh's facets on a round wall are off it, mm."""
    corners = mesh.points[mesh.boundary[mesh.wall_of == wall]]
    middles = 0.5 * (corners + np.roll(corners, 1, axis=1))
    off, _ = mesh.round_walls[wall].distances(middles.reshape(-1, 3))
    return float(np.abs(off).max(initial=0.0))


_OUTSIDE = 0.01
"""Share of the points of a layer that may lie outside the part."""


def _check_outside(outside: BoolArray, index: int, tolerance: float) -> None:
    """Refuse a layer too many of whose points (n,) lie outside the part."""
    if outside.mean() > _OUTSIDE:
        raise InputError(
            f"{100 * outside.mean():.0f} % of the points of layer {index} lie more than "
            f"{tolerance:g} mm outside the part: is it in mm, and in the frame of the mesh?"
        )


def layer_from_surface(
    mesh: TetMesh,
    points: FloatArray,
    triangles: IntArray,
    index: int,
    thickness: float,
    tolerance: float = 1.0,
) -> Layer:
    """Make a curved layer from a surface in a part.

    Parameters
    ----------
    mesh : TetMesh
        The part, whose stress the layer takes.
    points : (n, 3) array, mm
    triangles : (t, 3) int array
        Consistently oriented, counter-clockwise seen from the side on which material is added.
    index : int
        Position in the stack.
    thickness : float, mm
    tolerance : float, mm, default 1
        Largest distance by which points may lie outside the part.

    Raises
    ------
    InputError
        When more than 1 % of the points lie farther outside the part.
    """
    used, triangles = np.unique(triangles, return_inverse=True)
    points, triangles = points[used], triangles.reshape(-1, 3)
    holder, weights = locate(mesh.points, mesh.corners, points, tolerance)
    outside = holder < 0
    _check_outside(outside, index, tolerance)
    kept = ~outside[triangles].any(axis=1)
    used, triangles = np.unique(triangles[kept], return_inverse=True)
    points, triangles = points[used], triangles.reshape(-1, 3)
    holder, weights = holder[used], weights[used]
    # The stress of a triangle is that of the cell that its middle lies in.
    middle = points[triangles].mean(axis=1)
    cell, _ = locate(mesh.points, mesh.corners, middle, tolerance)
    cell = np.where(cell < 0, holder[triangles[:, 0]], cell)
    border = border_edges(triangles, len(points))
    near = [wall.near(points, _chords_of(mesh, k)) for k, wall in enumerate(mesh.round_walls)]
    patches = {}
    for name, facets in mesh.patches.items():
        ends = nearest_on_triangles(mesh.points, facets, points[border.ravel()]).distance
        patches[name] = border[(ends.reshape(-1, 2) <= _ON_PATCH).all(axis=1)]
    return Layer(
        points=points,
        triangles=triangles,
        cell=cell,
        nodes=mesh.corners[holder],
        weights=weights,
        loops=chain(border),
        index=index,
        thickness=thickness,
        patches=patches,
        walls=tuple(along_walls(mesh.round_walls, near, points, triangles)),
    )
