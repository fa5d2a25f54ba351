"""A scalar field whose gradient is as near to given directions as it can be.

Kipping and Schueppstuhl 2023 (Materials 16, 998), section 2.4: a Poisson equation. The blend with
one direction is ours: the least that leaves no cell upside down.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from ccfem.arrays import FloatArray, freeze
from ccfem.elasticity.assembly import cell_gradients
from ccfem.elasticity.direct import superlu
from ccfem.guidance.energies import gradient_energy
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["HeightField", "height_field", "inverted_share"]

_LARGEST = 64.0
"""Blend above which the field is as good as flat."""
_CLOSE = 0.02
"""Accuracy of the least blend."""


@dataclass(frozen=True)
class HeightField:
    """A field whose level surfaces are layers.

    Attributes
    ----------
    values : (n,) array, mm
        At the nodes, zero at their least; zero at nodes that no cell has as a corner.
    gradient : (m, 3) array
        In the cells; 1 where the layers keep their distance.
    up : (3,) array
        Unit vector along the mean gradient.
    blend : float
        How much of that direction was added to the directions given.
    """

    values: FloatArray
    gradient: FloatArray
    up: FloatArray
    blend: float

    def __post_init__(self) -> None:
        freeze(self, values=float, gradient=float, up=float)


def height_field(mesh: TetMesh, direction: FloatArray, blend: float | None = None) -> HeightField:
    """Find the field.

    Parameters
    ----------
    mesh : TetMesh
    direction : (m, 3) array
        Unit vectors that the gradient is to follow.
    blend : float, optional
        Weight of the mean gradient of the field without a blend, added to each direction. By
        default the least with which every cell rises along it, to 0.02.
    """
    solve = _poisson(mesh)
    plain = solve(direction)
    if blend is None:
        if not inverted_share(mesh, plain.gradient, plain.up) > 0.0:
            return plain
        return _least(mesh, direction, plain.up, solve)
    return plain if blend == 0.0 else _blended(direction, plain.up, blend, solve)


def inverted_share(mesh: TetMesh, gradient: FloatArray, up: FloatArray) -> float:
    """Share of the volume in which the field falls along a direction."""
    down = gradient @ up < 0.0
    return float(mesh.volumes[down].sum() / mesh.volumes.sum())


def _least(
    mesh: TetMesh,
    direction: FloatArray,
    up: FloatArray,
    solve: Callable[[FloatArray], HeightField],
) -> HeightField:
    """Field with the least blend that leaves no cell upside down, by bisection."""
    low, high = 0.0, 0.5
    found = _blended(direction, up, high, solve)
    while inverted_share(mesh, found.gradient, up) > 0.0 and high < _LARGEST:
        low, high = high, 2.0 * high
        found = _blended(direction, up, high, solve)
    while high - low > _CLOSE:
        middle = 0.5 * (low + high)
        tried = _blended(direction, up, middle, solve)
        if inverted_share(mesh, tried.gradient, up) > 0.0:
            low = middle
        else:
            high, found = middle, tried
    return found


def _blended(
    direction: FloatArray,
    up: FloatArray,
    blend: float,
    solve: Callable[[FloatArray], HeightField],
) -> HeightField:
    mixed = direction + blend * up
    mixed = mixed / np.maximum(np.linalg.norm(mixed, axis=1), 1e-12)[:, None]
    found = solve(mixed)
    return HeightField(found.values, found.gradient, up, blend)


def _poisson(mesh: TetMesh) -> Callable[[FloatArray], HeightField]:
    """Return what solves ``min sum_e V_e |grad g - v_e|^2`` for directions v: one factorisation."""
    gradients, cells, n = cell_gradients(mesh), mesh.corners, len(mesh.points)
    volume = mesh.volumes
    matrix = gradient_energy(gradients, cells, volume, n)
    used = np.unique(cells)
    piece = connected_components(matrix, directed=False)[1]
    pinned = used[np.unique(piece[used], return_index=True)[1]]
    free = np.setdiff1d(used, pinned)
    solve_free = superlu(matrix[free][:, free])

    def solve(direction: FloatArray) -> HeightField:
        share = volume[:, None] * np.einsum("eid,ed->ei", gradients, direction)
        source = np.bincount(cells.ravel(), share.ravel(), minlength=n).astype(np.float64)
        values = np.zeros(n)
        values[free] = solve_free(source[free])
        for each in np.unique(piece[used]).tolist():
            own = used[piece[used] == each]
            values[own] -= values[own].min()
        gradient = np.einsum("eid,ei->ed", gradients, values[cells])
        mean = volume @ gradient
        up = mean / max(float(np.linalg.norm(mean)), 1e-300)
        return HeightField(values, gradient, up, 0.0)

    return solve
