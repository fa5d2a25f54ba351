import numpy as np
import pytest

from ccfem.base.tensor import strain_to_voigt
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.recovery import cell_strain, cell_stress, nodal_stress, strain_at_nodes


def mesh(order):
    linear = box_mesh((3.0, 2.0, 1.5), (3, 2, 2))
    return linear if order == 1 else linear.quadratic()


def quadratic_field(points):
    """Return u = (x^2 + y z, x y - z^2, z x) and its Voigt strain."""
    x, y, z = points.T
    u = np.stack([x**2 + y * z, x * y - z**2, z * x], axis=1)
    return u, np.stack([2 * x, x, x, -2 * z, y + z, z + y], axis=1)


@pytest.mark.parametrize("order", [1, 2])
def test_uniform_strain_is_recovered_everywhere(order):
    part = mesh(order)
    gradient = np.random.default_rng(0).normal(size=(3, 3))
    u = part.points @ gradient.T
    strain = strain_to_voigt(0.5 * (gradient + gradient.T))
    stiffness = np.diag(np.arange(1.0, 7.0))
    np.testing.assert_allclose(cell_strain(part, u), np.tile(strain, (len(part.cells), 1)))
    s = stiffness @ strain
    expected = np.array([[s[0], s[5], s[4]], [s[5], s[1], s[3]], [s[4], s[3], s[2]]])
    for got in (cell_stress(part, u, stiffness), nodal_stress(part, u, stiffness)):
        np.testing.assert_allclose(got, np.broadcast_to(expected, got.shape), atol=1e-12)


def test_linear_strain_is_exact_on_quadratic_cells():
    part = mesh(2)
    u, strain = quadratic_field(part.points)
    np.testing.assert_allclose(strain_at_nodes(part, u), strain[part.cells], atol=1e-12)
    _, at_centroid = quadratic_field(part.points[part.corners].mean(axis=1))
    np.testing.assert_allclose(cell_strain(part, u), at_centroid, atol=1e-12)
    nodal = nodal_stress(part, u, np.eye(6))
    rows, columns = [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]
    np.testing.assert_allclose(nodal[:, rows, columns], strain, atol=1e-12)


def test_nodal_stress_weighs_cells_by_volume():
    # Two cells on one face, the second twice as tall: the shared nodes see (s1 + 2 s2) / 3.
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -1], [0, 0, 2.0]])
    part = TetMesh(points, np.array([[0, 2, 1, 3], [0, 1, 2, 4]]))
    assert part.volumes.tolist() == pytest.approx([1 / 6, 1 / 3])
    u = np.zeros((5, 3))
    u[3, 2], u[4, 2] = -1.0, 6.0  # e33 = 1 in the first cell, 3 in the second
    nodal = nodal_stress(part, u, np.eye(6))[:, 2, 2]
    np.testing.assert_allclose(nodal, [7 / 3, 7 / 3, 7 / 3, 1.0, 3.0])


def test_stiffness_per_cell_is_used_cell_by_cell():
    part = mesh(1)
    u, _ = quadratic_field(part.points)
    factor = np.arange(1.0, len(part.cells) + 1.0)
    stiffness = factor[:, None, None] * np.eye(6)
    one = cell_stress(part, u, np.eye(6))
    np.testing.assert_allclose(cell_stress(part, u, stiffness), factor[:, None, None] * one)
