"""The scalar field whose isocurves are the paths [Chen et al. 2021, section 4.2, Eq. 6]."""

from typing import Any

import numpy as np
import scipy.sparse as sparse

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import SolveError
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

    Parameters
    ----------
    surface, direction, density, weight, width, spacing_weight
        As in `fit_constrained`.

    Raises
    ------
    SolveError
        With the status of the solver if it did not find the optimum.
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
