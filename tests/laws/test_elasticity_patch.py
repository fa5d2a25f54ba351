"""Patch tests: a linear displacement is reproduced to rounding on any mesh."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ccfem.base.tensor import from_voigt, rotate_stiffness, strain_to_voigt
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import Problem, SolveRecord, Traction
from ccfem.fem.elasticity.assembly import assemble
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.loads import nodal_forces
from ccfem.fem.elasticity.recovery import cell_stress
from ccfem.fem.elasticity.system import System
from ccfem.fem.materials import isotropic, transversely_isotropic


def shaken(order, seed):
    """Return a box whose inner nodes are moved at random."""
    mesh = box_mesh((3.0, 2.0, 2.0), (4, 3, 3))
    inner = np.setdiff1d(np.arange(len(mesh.points)), mesh.boundary)
    points = mesh.points.copy()
    points[inner] += np.random.default_rng(seed).uniform(-0.15, 0.15, (len(inner), 3))
    mesh = TetMesh(points, mesh.cells, mesh.patches)
    assert mesh.volumes.min() > 0.0
    return mesh if order == 1 else mesh.quadratic()


def prescribed(mesh, on_boundary, values):
    """Return the supports that hold some nodes at given values."""
    free = np.repeat(~on_boundary[:, None], 3, axis=1)
    return Held(free, np.where(free, 0.0, values), np.flatnonzero(~on_boundary))


@pytest.mark.parametrize("order", [1, 2])
@given(seed=st.integers(0, 10_000))
@settings(max_examples=8, deadline=None)
def test_linear_displacement_of_the_boundary_goes_on_inside(order, seed):
    generator = np.random.default_rng(seed)
    mesh = shaken(order, seed)
    axes = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    stiffness = rotate_stiffness(transversely_isotropic(30.0, 9.0, 0.3, 4.0).stiffness, axes)
    gradient = generator.normal(size=(3, 3))
    exact = mesh.points @ gradient.T
    low, high = mesh.bounds
    on_boundary = ((mesh.points < low + 1e-9) | (mesh.points > high - 1e-9)).any(axis=1)
    assert (~on_boundary).sum() >= 12
    supports = prescribed(mesh, on_boundary, exact)
    problem = Problem(mesh, isotropic(1.0, 0.3), (), {"none": ()})
    system = System(problem, supports, {})
    matrix = assemble(mesh, stiffness)
    rhs = supports.right_hand_side(matrix, np.zeros_like(exact))
    u = supports.expand(system.factorise(matrix, "superlu").solve(rhs, tolerance=1e-13).values)
    np.testing.assert_allclose(u, exact, atol=1e-12 * np.abs(exact).max())
    stress = from_voigt(stiffness @ strain_to_voigt(0.5 * (gradient + gradient.T)))
    got = cell_stress(mesh, u, stiffness)
    np.testing.assert_allclose(
        got, np.broadcast_to(stress, got.shape), atol=1e-11 * np.abs(stress).max()
    )


@pytest.mark.parametrize("order", [1, 2])
def test_tractions_of_a_uniform_stress_give_that_stress(order):
    # The six sides loaded, and six components of three corners held: statically determinate, so
    # the supports must take nothing up.
    mesh = shaken(order, 5)
    stress = np.array([[3.0, 0.5, -0.2], [0.5, -1.0, 0.7], [-0.2, 0.7, 2.0]])
    forces = np.zeros_like(mesh.points)
    for axis, letter in enumerate("xyz"):
        for end, sign in (("min", -1.0), ("max", 1.0)):
            traction = Traction(f"{letter}_{end}", tuple(sign * stress[:, axis]))
            forces += nodal_forces(mesh, traction)
    free = np.ones((len(mesh.points), 3), dtype=bool)
    for corner, components in (([0, 0, 0], [0, 1, 2]), ([3, 0, 0], [1, 2]), ([0, 2, 0], [2])):
        node = np.linalg.norm(mesh.points - corner, axis=1).argmin()
        free[node, components] = False
    supports = Held(free, np.zeros(free.shape), np.flatnonzero(free.any(axis=1)))
    problem = Problem(mesh, isotropic(50.0, 0.25), ())
    system = System(problem, supports, {"all": forces})
    matrix = system.assemble()
    rhs = supports.right_hand_side(matrix, forces)
    u = supports.expand(system.factorise(matrix, "superlu").solve(rhs, tolerance=1e-11).values)
    field = system.field("all", u, matrix, SolveRecord("superlu", 0, 0.0, 0.0, 0.0, rhs.size))
    assert np.abs(field.reactions).max() < 1e-11
    for got in (field.stress, field.nodal):
        np.testing.assert_allclose(got, np.broadcast_to(stress, got.shape), atol=3e-12)
