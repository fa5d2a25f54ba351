"""The scalar field whose isocurves are the paths [Chen et al. 2021, section 4.2, Eq. 6]."""

from typing import Any

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import dijkstra

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import SolveError
from ccfem.geometry.isocontours import Isocontours, isocontours, least_distance
from ccfem.paths.fields.layer_elements import Surface, positive_definite

_REGULARISATION = 1e-10
_ITERATIONS = 20
"""Iterations of the alternating direction method: see `fit_constrained`."""
_PENALTY = 1.0
"""Penalty of the alternating direction method, in units of the spacing weight."""
_RELAXATION = 1.7
_ACCURACY = 1e-7
"""Tolerances of the cone programme. Below, rounding error keeps one layer in five from an end."""


def fit_literal(surface: Surface, vectors: FloatArray) -> FloatArray:
    """Field whose gradient is nearest to the vectors rotated by 90 degrees.

    Minimises ``sum_f A_f |grad s - R90 u_f|^2``. The paper prints Eq. 6 without the rotation, which
    would lay the isocurves across the stress.

    Parameters
    ----------
    vectors : (t, 2) array
        u of Eq. 5, along the tension.

    Returns
    -------
    (n,) array
        At the points; its mean on every connected part is arbitrary.
    """
    turned = np.column_stack([-vectors[:, 1], vectors[:, 0]])
    metric = surface.areas[:, None, None] * np.eye(2)
    return _solve(surface, metric, surface.areas[:, None] * turned)


def fit_weighted(
    surface: Surface,
    direction: FloatArray,
    density: FloatArray,
    weight: FloatArray,
    spacing_weight: float = 0.1,
) -> FloatArray:
    """Field (n,) that follows the tension first, and the wanted density second.

    Minimises ``sum_f w_f A_f [(t . grad s)^2 + spacing_weight (n . grad s - m)^2]`` with t the
    direction, n its normal and m the wanted density of isocurves.

    Parameters
    ----------
    direction : (t, 2) array
        Oriented unit vectors.
    density : (t,) array
        m, in any unit: isocurves per mm up to a factor.
    weight : (t,) array
    spacing_weight : float, default 0.1
        Smaller values give better alignment and less even spacing.
    """
    metric, flux = _weighted_form(surface, direction, density, weight, spacing_weight)
    return _solve(surface, metric, flux)


def fit_constrained(
    surface: Surface,
    direction: FloatArray,
    density: FloatArray,
    weight: FloatArray,
    width: float,
    spacing_weight: float = 0.1,
) -> FloatArray:
    """As `fit_weighted`, subject to ``|grad s| <= 1 / width`` on every triangle.

    Isocurves at unit levels are then at least `width` apart where they cross the same triangles.
    There is no search for their number, and no hot spot sets the spacing of the whole layer. The
    convex problem is solved by the alternating direction method of multipliers (Boyd et al.,
    Foundations and Trends in Machine Learning 3 (2011) 1, section 3): one factorisation, then one
    back-substitution and one projection in each iteration. After 20 iterations the objective is
    within 1 % of the optimum (20 % on layers that the strands fit almost without misfit), and
    single triangles exceed the bound by a few per cent, so strands still have to be trimmed.

    Parameters
    ----------
    surface, direction, weight, spacing_weight
        As in `fit_weighted`.
    density : (t,) array, 1/mm
        Wanted number of isocurves per mm; capped at ``1 / width``.
    width : float, mm
    """
    target = np.minimum(density * width, 1.0)
    metric, flux = _weighted_form(surface, direction, target, weight, spacing_weight)
    penalty = _PENALTY * spacing_weight * surface.areas
    solver = _factor(surface, metric + penalty[:, None, None] * np.eye(2))
    gradient = surface.gradient_matrix
    divergence = (gradient.T * np.repeat(penalty, 2)).tocsr()
    source = surface.source(flux)
    bounded = np.zeros((len(target), 2))
    dual = np.zeros_like(bounded)
    values = np.zeros(len(source))
    for _ in range(_ITERATIONS):
        values = solver.solve(source + divergence @ (bounded - dual).ravel())
        steep = (gradient @ values).reshape(-1, 2)
        free = _RELAXATION * steep + (1.0 - _RELAXATION) * bounded + dual
        size = np.hypot(free[:, 0], free[:, 1])
        bounded = free / np.maximum(size, 1.0)[:, None]
        dual = free - bounded
    return np.asarray(values) / width


def fit_cone(
    surface: Surface,
    direction: FloatArray,
    density: FloatArray,
    weight: FloatArray,
    width: float,
    spacing_weight: float = 0.1,
) -> FloatArray:
    """Solve the problem of `fit_constrained` to seven digits as a second-order cone programme.

    It uses Clarabel through cvxpy, and serves as the reference for `fit_constrained`; it is about
    fifteen times slower.
    """
    import cvxpy

    metric, flux = _weighted_form(
        surface, direction, np.minimum(density * width, 1.0), weight, spacing_weight
    )
    # Unknowns are numbers of strands, and gradients those a width: all quantities are near 1.
    scale = width / float((surface.areas * weight).mean())
    field = cvxpy.Variable(len(surface.points))
    energy = cvxpy.quad_form(field, scale * width * surface.energy(metric), assume_PSD=True)
    gx, gy = width * surface.gradient_matrix[0::2], width * surface.gradient_matrix[1::2]
    gradient = cvxpy.vstack([gx @ field, gy @ field])
    usable = np.flatnonzero(np.abs(surface.gradients).max(axis=(1, 2)) > 0.0)
    problem = cvxpy.Problem(
        cvxpy.Minimize(energy - 2.0 * scale * (surface.source(flux) @ field)),
        [cvxpy.norm(gradient[:, usable], axis=0) <= 1.0, field[0] == 0.0],
    )
    accuracy = dict.fromkeys(("tol_feas", "tol_gap_abs", "tol_gap_rel"), _ACCURACY)
    problem.solve(solver=cvxpy.CLARABEL, **accuracy)
    if problem.status != cvxpy.OPTIMAL or field.value is None:
        raise SolveError(f"the constrained scalar field ended as '{problem.status}' (Clarabel)")
    return np.asarray(field.value)


def _weighted_form(
    surface: Surface,
    direction: FloatArray,
    density: FloatArray,
    weight: FloatArray,
    spacing_weight: float,
) -> tuple[FloatArray, FloatArray]:
    normal = np.column_stack([-direction[:, 1], direction[:, 0]])
    w = surface.areas * weight
    metric = direction[:, :, None] * direction[:, None, :]
    metric = metric + spacing_weight * normal[:, :, None] * normal[:, None, :]
    return w[:, None, None] * metric, (w * spacing_weight * density)[:, None] * normal


def _solve(surface: Surface, metric: FloatArray, flux: FloatArray) -> FloatArray:
    return np.asarray(_factor(surface, metric).solve(surface.source(flux)))


def _factor(surface: Surface, metric: FloatArray) -> Any:
    matrix = surface.energy(metric)
    small = _REGULARISATION * float(np.median(matrix.diagonal()))
    identity = sparse.eye_array(len(surface.points), format="csc")
    return positive_definite(matrix + small * identity)


# Number of isocurves that fit, and its search [Chen et al. 2021, section 4.3, Eq. 7].


def levels_at(surface: Surface, values: FloatArray, count: int) -> Isocontours:
    """Isocurves at `count` levels, half a step from the extremes [Chen et al. 2021, Eq. 7]."""
    first, step = _levels(values, count)
    return isocontours(surface.points, surface.triangles, values, first, step, surface.edges)


def unit_levels(surface: Surface, values: FloatArray) -> Isocontours:
    """Isocurves at unit steps, as many as fit, equally far from both extremes.

    The curves are therefore the same for a field and for its negative.
    """
    low, high = float(values.min()), float(values.max())
    count = int(np.floor(high - low + 0.5))
    first = 0.5 * (low + high) - 0.5 * (count - 1)
    return isocontours(surface.points, surface.triangles, values, first, 1.0, surface.edges)


def extract_levels(surface: Surface, values: FloatArray, width: float) -> Isocontours:
    """Extract the largest number of isocurves whose neighbours are more than a width apart.

    The number starts at `start_count` and grows while the smallest distance between neighbouring
    isocurves exceeds the width. Then it falls one by one until the distance exceeds the width
    again. A number is first checked on single triangles that two levels cross, and all distances
    are computed only if it passes: this changes the cost, not the result.

    Parameters
    ----------
    values : (n,) array
        The scalar field.
    width : float, mm
        W.

    Returns
    -------
    Isocontours
        Empty if not even one isocurve fits. "Neighbours" are curves of levels i and i + 1; branches
        of the same level may come nearer to each other.
    """
    if not np.ptp(values) > 0.0:
        return levels_at(surface, np.zeros(len(values)), 1)
    steepness = np.hypot(*surface.gradient(values).T)
    usable = (surface.areas > 0.0) & (steepness > 0.0)
    corners, steepness = values[surface.triangles[usable]], steepness[usable]
    low, high = corners.min(axis=1), corners.max(axis=1)

    def apart(count: int) -> float:
        first, step = _levels(values, count)
        twice = np.floor((high - first) / step) > np.ceil((low - first) / step)
        least = float((step / steepness[twice]).min(initial=np.inf))
        if least <= width:
            return least
        return least_distance(levels_at(surface, values, count), 2.0 * width, width)

    count = start_count(surface, values, width)
    distance = apart(count)
    while distance > width:
        count = int(np.ceil(count * distance / width))
        distance = apart(count)
    while count > 1 and not distance > width:
        count -= 1
        distance = apart(count)
    return levels_at(surface, values, count)


def start_count(surface: Surface, values: FloatArray, width: float) -> int:
    """Distance along mesh edges from the smallest to the largest value, in widths (Dijkstra).

    If the surface has several parts: to the farthest point of the part with the smallest value.
    """
    edges, n = surface.edges[0], len(surface.points)
    length = np.linalg.norm(surface.points[edges[:, 0]] - surface.points[edges[:, 1]], axis=1)
    graph = sparse.coo_array((length, edges.T), shape=(n, n)).tocsr()
    distance = dijkstra(graph, directed=False, indices=int(np.argmin(values)))
    highest = distance[int(np.argmax(values))]
    if not np.isfinite(highest):
        highest = distance[np.isfinite(distance)].max()
    return max(int(np.ceil(highest / width)), 1)


def _levels(values: FloatArray, count: int) -> tuple[float, float]:
    low, step = float(values.min()), float(np.ptp(values)) / count
    return low + 0.5 * step, step if step > 0.0 else 1.0
