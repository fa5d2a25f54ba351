"""Scalar fields: against fields whose gradient is known."""

import numpy as np
import osqp
import pytest
import scipy.sparse as sp
from scipy.spatial import Delaunay

from ccfem.paths.fields.directed import fill_laplacian, fill_screened
from ccfem.paths.fields.layer_elements import Surface
from ccfem.paths.fields.scalar import fit_cone, fit_constrained, fit_literal, fit_weighted
from ccfem.paths.fields.tensile import orient


def annulus(inner: float = 5.0, outer: float = 15.0, size: float = 0.7) -> Surface:
    radii = np.linspace(inner, outer, int((outer - inner) / size) + 1)
    rings = []
    for k, r in enumerate(radii):
        count = int(2 * np.pi * outer / size)
        angle = 2 * np.pi * (np.arange(count) + 0.5 * (k % 2)) / count
        rings.append(np.column_stack([r * np.cos(angle), r * np.sin(angle)]))
    points = np.concatenate(rings)
    triangles = Delaunay(points).simplices
    centre = points[triangles].mean(axis=1)
    triangles = triangles[np.hypot(*centre.T) > inner]
    surface = Surface(points, triangles)
    flipped = np.where((surface.areas < 0)[:, None], triangles[:, [0, 2, 1]], triangles)
    return Surface(points, flipped)


def hoop(surface: Surface) -> np.ndarray:
    centre = surface.points[surface.triangles].mean(axis=1)
    radius = np.hypot(*centre.T)
    return np.column_stack([-centre[:, 1], centre[:, 0]]) / radius[:, None]


def test_gradients_of_linear_fields_are_exact() -> None:
    surface = annulus()
    gradient = surface.gradient(surface.points @ np.array([2.0, -3.0]) + 1.0)
    np.testing.assert_allclose(gradient, np.tile([2.0, -3.0], (len(gradient), 1)), atol=1e-10)


def test_literal_fit_of_a_uniform_field_is_linear() -> None:
    surface = annulus()
    along = np.tile([0.6, 0.8], (len(surface.triangles), 1))
    gradient = surface.gradient(fit_literal(surface, 1.7 * along))
    # 90 degrees to the left of the stress, of its size
    np.testing.assert_allclose(gradient, np.tile([-1.36, 1.02], (len(along), 1)), atol=1e-6)


@pytest.mark.parametrize("fit", ["literal", "weighted", "constrained", "cone"])
def test_hoop_tension_gives_circles(fit: str) -> None:
    surface = annulus(size=1.0)
    direction = hoop(surface)
    ones = np.ones(len(direction))
    values = {
        "literal": lambda: fit_literal(surface, direction),
        "weighted": lambda: fit_weighted(surface, direction, ones, ones),
        "constrained": lambda: fit_constrained(surface, direction, ones, ones, 1.0),
        "cone": lambda: fit_cone(surface, direction, ones, ones, 1.0),
    }[fit]()
    radius = np.hypot(*surface.points.T)
    slope, offset = np.polyfit(radius, values, 1)
    np.testing.assert_allclose(values, slope * radius + offset, atol=0.06)
    assert slope == pytest.approx(-1.0, abs=0.02)


def test_constrained_field_keeps_the_width() -> None:
    surface = annulus(size=1.0)
    random = np.random.default_rng(0)
    density = random.uniform(0.2, 3.0, len(surface.triangles))
    width = 1.3
    ones = np.ones(len(density))
    values = fit_constrained(surface, hoop(surface), density, ones, width)
    steepest = np.linalg.norm(surface.gradient(values), axis=1).max()
    assert steepest <= 1.0 / width * (1.0 + 1e-5)
    free = fit_weighted(surface, hoop(surface), density, ones)
    assert np.linalg.norm(surface.gradient(free), axis=1).max() > 1.0 / width


def misfit(surface: Surface, values: np.ndarray, density: np.ndarray, width: float) -> float:
    """What the fits make small, for hoop tension, weights of 1 and a spacing weight of 0.1."""
    gradient, along = surface.gradient(values), hoop(surface)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    uneven = np.einsum("td,td->t", gradient, across) - np.minimum(density, 1.0 / width)
    astray = np.einsum("td,td->t", gradient, along)
    return float(surface.areas @ (astray**2 + 0.1 * uneven**2))


def within_polygons(surface: Surface, density: np.ndarray, width: float, reach: float) -> float:
    """Least misfit, by OSQP, with gradients in a polygon of 16 sides, ``reach / width`` from 0."""
    gradient, along = sp.csr_matrix(surface.gradient_matrix), hoop(surface)
    count = np.repeat(np.arange(len(along)), 2), np.arange(2 * len(along))
    turned = np.column_stack([-along[:, 1], along[:, 0]])
    slope, rise = (sp.csr_matrix((way.ravel(), count)) @ gradient for way in (along, turned))
    areas = sp.diags(surface.areas)
    form = slope.T @ areas @ slope + 0.1 * rise.T @ areas @ rise
    pull = 0.1 * rise.T @ (surface.areas * np.minimum(density, 1.0 / width))
    sides = np.pi * np.arange(8) / 8
    rows = sp.vstack([np.cos(a) * gradient[0::2] + np.sin(a) * gradient[1::2] for a in sides])
    bound = np.full(rows.shape[0], reach / width)
    accuracy = {"eps_abs": 1e-7, "eps_rel": 1e-7, "max_iter": 100_000, "verbose": False}
    model = osqp.OSQP()
    model.setup(sp.triu(form, format="csc"), -pull, rows.tocsc(), -bound, bound, **accuracy)
    found = model.solve()
    assert found.info.status == "solved"
    return misfit(surface, found.x, density, width)


def test_a_bounded_field_costs_what_quadratic_programmes_enclose() -> None:
    """The disc of gradients contains one polygon, and another contains it."""
    surface, width = annulus(size=1.5), 1.3
    density = np.random.default_rng(0).uniform(0.2, 3.0, len(surface.triangles))
    ones = np.ones(len(density))
    exact, quick = (
        misfit(surface, fit(surface, hoop(surface), density, ones, width), density, width)
        for fit in (fit_cone, fit_constrained)
    )
    inner = within_polygons(surface, density, width, np.cos(np.pi / 16))
    outer = within_polygons(surface, density, width, 1.0)
    assert outer < exact < inner < 1.05 * outer
    assert quick == pytest.approx(exact, rel=0.01)


def test_the_unit_of_length_changes_no_field() -> None:
    """Millimetres or metres: the same levels, as they are numbers of strands."""
    surface = annulus(size=1.5)
    density = np.random.default_rng(2).uniform(0.2, 3.0, len(surface.triangles))
    ones = np.ones(len(density))
    small = Surface(1e-3 * surface.points, surface.triangles)
    for fit in (fit_constrained, fit_cone):
        one = fit(surface, hoop(surface), density, ones, 1.3)
        other = fit(small, hoop(surface), 1e3 * density, ones, 1.3e-3)
        np.testing.assert_allclose(other - other[0], one - one[0], atol=2e-3)


@pytest.mark.parametrize("fill", ["screened", "laplacian"])
def test_fill_carries_a_uniform_direction_over_a_gap(fill: str) -> None:
    surface = annulus()
    count = len(surface.triangles)
    centre = surface.points[surface.triangles].mean(axis=1)
    known = np.abs(centre[:, 0]) > 1.0
    sign = np.random.default_rng(1).choice([-1.0, 1.0], count)
    along = np.array([0.6, 0.8])
    direction = np.where(known[:, None], sign[:, None] * along, [1.0, 0.0])
    stress = np.full(count, 2.0)
    if fill == "screened":
        direction, size = fill_screened(surface, direction, stress, known.astype(float))
        # the regularisation of the empty gap is 1e-6 of the mass
        np.testing.assert_allclose(size, 2.0, rtol=1e-5)
    else:
        oriented = np.where(known[:, None], along, 0.0)
        direction, _ = fill_laplacian(surface, oriented, stress, known)
    np.testing.assert_allclose(np.abs(direction @ along), 1.0, atol=1e-5)


def test_neighbours_are_the_pairs_that_share_an_edge() -> None:
    surface = annulus(size=2.0)
    edges: dict[tuple[int, int], list[int]] = {}
    for t, triangle in enumerate(surface.triangles.tolist()):
        for a, b in zip(triangle, triangle[1:] + triangle[:1], strict=True):
            edges.setdefault((min(a, b), max(a, b)), []).append(t)
    expected = {tuple(sorted(pair)) for pair in edges.values() if len(pair) == 2}
    assert {tuple(sorted(pair)) for pair in surface.neighbours.tolist()} == expected
    oriented = orient(hoop(surface), surface.neighbours)
    assert len(np.unique(np.sign(np.einsum("ij,ij->i", oriented, hoop(surface))))) == 1


@pytest.mark.parametrize("length", [1.0, 3.0])
def test_screened_fill_damps_a_wave_as_its_equation_says(length: float) -> None:
    """``x - length^2 x'' = cos(k x)`` between free ends: a wave of 1 / (1 + (k length)^2)."""
    x, y = np.meshgrid(np.linspace(0.0, 20.0, 161), np.linspace(0.0, 1.0, 5))
    points = np.column_stack([x.ravel(), y.ravel()])
    surface = Surface(points, Delaunay(points).simplices)
    centre = surface.points[surface.triangles].mean(axis=1)
    wave = np.cos(2.0 * np.pi / 20.0 * centre[:, 0])
    along = np.tile([1.0, 0.0], (len(centre), 1))
    _, filled = fill_screened(surface, along, 5.0 + wave, np.ones(len(centre)), length)
    damped = wave / (1.0 + (2.0 * np.pi / 20.0 * length) ** 2)
    np.testing.assert_allclose(filled, 5.0 + damped, atol=2e-3)
