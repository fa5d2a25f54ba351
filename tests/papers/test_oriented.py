"""Oriented stiffness against rotated materials, averages over directions, and the textbook."""

import numpy as np
import pytest
from flat_paths import flat_paths

from ccfem.base.errors import InputError
from ccfem.base.tensor import rotate_stiffness, to_voigt
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import Material, isotropic, transversely_isotropic
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.papers.chen_2021.virtual_test import (
    fibre_share,
    oriented_problem,
    oriented_ratio,
    oriented_stiffness,
)

CARBON = transversely_isotropic(73200.0, 4100.0, 0.33, 2200.0)
PLA = isotropic(3000.0, 0.35)


def axes(direction):
    """Right-handed axes with the first along `direction`."""
    a = direction / np.linalg.norm(direction)
    b = np.cross(a, [0.3, -0.5, 0.8])
    b /= np.linalg.norm(b)
    return np.stack([a, b, np.cross(a, b)], axis=1)


def fourth(direction):
    a = direction / np.linalg.norm(direction)
    m = to_voigt(np.outer(a, a))
    return np.outer(m, m)


def test_one_direction_is_the_rotated_material():
    for direction in np.random.default_rng(0).normal(size=(20, 3)):
        expected = rotate_stiffness(CARBON.stiffness, axes(direction))
        found = oriented_stiffness(fourth(direction), CARBON)
        np.testing.assert_allclose(found, expected, atol=1e-9 * expected.max())


def test_a_distribution_is_the_average_of_rotated_materials():
    directions = np.random.default_rng(1).normal(size=(7, 3))
    average = np.mean([fourth(a) for a in directions], axis=0)
    expected = np.mean([rotate_stiffness(CARBON.stiffness, axes(a)) for a in directions], axis=0)
    np.testing.assert_allclose(
        oriented_stiffness(average, CARBON), expected, atol=1e-9 * expected.max()
    )


def test_other_symmetries_are_refused():
    stiffness = np.array(CARBON.stiffness)
    stiffness[5, 5] *= 1.1
    with pytest.raises(InputError, match="must be transversely isotropic about axis 1"):
        oriented_stiffness(fourth(np.array([1.0, 0, 0])), Material("odd", stiffness))


def pulled():
    """Bar pulled along x with fibres along it, and its strands."""
    mesh = box_mesh((8.0, 2.0, 2.0), (8, 2, 2))
    supports = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
    problem = Problem(mesh, PLA, supports, {"pull": (Force("x_max", (100.0, 0.0, 0.0)),)})
    at = np.arange(0.1, 2.0, 0.2)
    paths = flat_paths([[[0.0, y, z], [8.0, y, z]] for y in at for z in at])
    return problem, cut_strands(paths, mesh)


def test_share_is_fibre_volume_over_cell_volume():
    problem, strands = pulled()
    volumes = problem.mesh.volumes
    share = fibre_share(strands, volumes, 0.01)
    assert share @ volumes == pytest.approx(0.01 * strands.total)
    assert fibre_share(strands, volumes, 1.0).max() == 1.0


def test_an_evenly_filled_bar_follows_the_rule_of_mixtures():
    problem, strands = pulled()
    # Strands that fill the bar completely leave nothing but fibre material in every cell.
    full = oriented_problem(problem, strands, CARBON, 1.0)
    np.testing.assert_allclose(full.stiffness, np.broadcast_to(CARBON.stiffness, (192, 6, 6)),
                               rtol=1e-9, atol=1e-6)  # fmt: skip
    u = solve(full)["pull"].displacement
    np.testing.assert_allclose(
        u[problem.mesh.patch("x_max"), 0], 100.0 * 8.0 / (4.0 * 73200.0), rtol=1e-7
    )
    ratio, field = oriented_ratio(strands, solve(problem)["pull"], CARBON, 1.0)
    assert ratio == pytest.approx(73200.0 / 3000.0, rel=1e-7)
    np.testing.assert_allclose(field.displacement, u, atol=1e-10)
    partly = oriented_problem(problem, strands, CARBON, 0.01)
    share = fibre_share(strands, problem.mesh.volumes, 0.01)
    expected = PLA.stiffness + share[:, None, None] * (CARBON.stiffness - PLA.stiffness)
    np.testing.assert_allclose(partly.stiffness, expected, rtol=1e-9, atol=1e-6)
