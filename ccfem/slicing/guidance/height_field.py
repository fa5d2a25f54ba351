"""A scalar field whose gradient is as near as possible to given directions.

Kipping and Schueppstuhl 2023 (Materials 16, 998), section 2.4, solve a Poisson equation. Two things
are ours: the blend with one direction, which is the least that leaves no cell upside down, and the
bounds that keep the distance of layers within a range.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from ccfem.base.arrays import FloatArray, freeze
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity import cell_gradients
from ccfem.fem.elasticity.direct import superlu
from ccfem.slicing.guidance.bounded_gradient import Bounds, bounded
from ccfem.slicing.guidance.energies import gradient_energy

_LARGEST = 64.0
"""Blend above which the field is practically flat."""
_CLOSE = 0.02
"""Accuracy of the least blend."""
_BLENDS = (0.0, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 64.0)
"""Blends that are tried when the gradient is kept within bounds."""
_LEFT = 5e-4
"""Share of the volume that may stay outside the bounds."""


@dataclass(frozen=True)
class HeightField:
    """A field whose level surfaces are layers.

    Attributes
    ----------
    values : (n,) array, mm
        At the nodes, with a minimum of zero; zero at nodes that are no cell's corner.
    gradient : (m, 3) array
        In the cells; of size 1 where the layers have their nominal distance.
    up : (3,) array
        Unit vector along the mean gradient.
    blend : float
        Weight of that direction added to the given directions.
    """

    values: FloatArray
    gradient: FloatArray
    up: FloatArray
    blend: float

    def __post_init__(self) -> None:
        freeze(self, values=float, gradient=float, up=float)


def height_field(
    mesh: TetMesh,
    direction: FloatArray,
    blend: float | None = None,
    lengths: tuple[float, float] | None = None,
) -> HeightField:
    """Find the field.

    Parameters
    ----------
    direction : (m, 3) array
        Unit vectors that the gradient should follow.
    blend : float, optional
        Weight of the mean gradient of the field without blend, added to each direction. By default
        the least for which every cell rises along it, to within 0.02; with `lengths`, the least of
        eight values for which the bounds can be kept.
    lengths : tuple of 2 floats, optional
        Range in which the size of the gradient is kept in every cell, at the least cost in
        direction. The field must not fall along the mean gradient either. 0.05 % of the volume may
        stay outside.
    """
    solve = _poisson(mesh)
    plain = solve(direction)
    up = plain.up

    if lengths is None:
        if blend is not None:
            return _blended(direction, up, blend, solve)
        if not inverted_share(mesh, plain.gradient, up) > 0.0:
            return plain
        return _least_blend(mesh, direction, up, solve)
    bounds = Bounds(*lengths, up)
    field = plain
    for tried in _BLENDS if blend is None else (blend,):
        kept = bounded(_mixed(direction, up, tried), bounds, solve)
        field = HeightField(kept.values, kept.gradient, up, tried)
        rising = not inverted_share(mesh, field.gradient, up) > 0.0
        if rising and mesh.volumes @ bounds.outside(field.gradient) <= _LEFT * mesh.volumes.sum():
            break
    return field


def inverted_share(mesh: TetMesh, gradient: FloatArray, up: FloatArray) -> float:
    """Share of the volume in which the field falls along a direction."""
    down = gradient @ up < 0.0
    return float(mesh.volumes[down].sum() / mesh.volumes.sum())


def _least_blend(
    mesh: TetMesh, direction: FloatArray, up: FloatArray, solve: Callable[[FloatArray], HeightField]
) -> HeightField:
    """Field with the least blend that leaves no cell upside down, by bisection."""
    low, high = 0.0, 0.5
    field = _blended(direction, up, high, solve)
    while inverted_share(mesh, field.gradient, up) > 0.0 and high < _LARGEST:
        low, high = high, 2.0 * high
        field = _blended(direction, up, high, solve)
    while high - low > _CLOSE:
        middle = 0.5 * (low + high)
        tried = _blended(direction, up, middle, solve)
        if inverted_share(mesh, tried.gradient, up) > 0.0:
            low = middle
        else:
            high, field = middle, tried
    return field


def _blended(
    direction: FloatArray, up: FloatArray, blend: float, solve: Callable[[FloatArray], HeightField]
) -> HeightField:
    field = solve(_mixed(direction, up, blend))
    return HeightField(field.values, field.gradient, up, blend)


def _mixed(direction: FloatArray, up: FloatArray, blend: float) -> FloatArray:
    if blend == 0.0:
        return direction
    mixed = direction + blend * up
    return np.asarray(mixed / np.maximum(np.linalg.norm(mixed, axis=1), 1e-12)[:, None])


def _poisson(mesh: TetMesh) -> Callable[[FloatArray], HeightField]:
    """Return a solver of ``min sum_e V_e |grad g - v_e|^2`` for directions v: one factorisation."""
    gradients, cells, n = cell_gradients(mesh), mesh.corners, len(mesh.points)
    volume, m = mesh.volumes, len(mesh.corners)
    rows = np.repeat(np.arange(3 * m).reshape(m, 1, 3), 4, axis=1)
    places = (rows.ravel(), np.repeat(cells.ravel(), 3))
    slope = sp.csr_array((gradients.ravel(), places), shape=(3 * m, n))
    fall = sp.csr_array(slope.T * np.repeat(volume, 3))
    matrix = gradient_energy(gradients, cells, volume, n)
    used = np.unique(cells)
    # One node of each piece is held: the energy does not know the height of a piece.
    piece = connected_components(matrix, directed=False)[1]
    pinned = used[np.unique(piece[used], return_index=True)[1]]
    free = np.setdiff1d(used, pinned)
    solve_free = superlu(matrix[free][:, free])
    pieces = [used[piece[used] == number] for number in np.unique(piece[used]).tolist()]

    def solve(direction: FloatArray) -> HeightField:
        values = np.zeros(n)
        values[free] = solve_free((fall @ direction.ravel())[free])
        # Each piece stands at height 0.
        for component in pieces:
            values[component] -= values[component].min()
        gradient = (slope @ values).reshape(m, 3)
        mean = volume @ gradient
        up = mean / max(float(np.linalg.norm(mean)), 1e-300)
        return HeightField(values, gradient, up, 0.0)

    return solve
