import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ccfem.base.tensor import rotate_stiffness, strain_to_voigt
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.assembly import add_blocks, assemble, cell_gradients, pattern
from ccfem.fem.elasticity.held import rigid_modes
from ccfem.fem.materials import isotropic, transversely_isotropic


def random_mesh(order, seed=0):
    """Return a box with its inner nodes shaken."""
    generator = np.random.default_rng(seed)
    mesh = box_mesh((3.0, 2.0, 1.5), (3, 2, 2))
    inner = np.setdiff1d(np.arange(len(mesh.points)), mesh.boundary)
    points = mesh.points.copy()
    points[inner] += generator.uniform(-0.15, 0.15, (len(inner), 3))
    mesh = TetMesh(points, mesh.cells, mesh.patches)
    return mesh if order == 1 else mesh.quadratic()


def random_stiffness(count, seed=0):
    """Return random symmetric positive definite stiffness matrices."""
    square = np.random.default_rng(seed).normal(size=(count, 6, 6))
    return square @ square.transpose(0, 2, 1) + 6.0 * np.eye(6)


@pytest.mark.parametrize("order", [1, 2])
def test_rigid_motion_has_no_force(order):
    mesh = random_mesh(order)
    matrix = assemble(mesh, random_stiffness(len(mesh.cells)))
    forces = matrix @ rigid_modes(mesh.points)
    assert np.abs(forces).max() < 1e-12 * np.abs(matrix.data).max()


@pytest.mark.parametrize("order", [1, 2])
def test_energy_of_uniform_strain(order):
    mesh = random_mesh(order)
    stiffness = random_stiffness(len(mesh.cells))
    gradient = np.random.default_rng(1).normal(size=(3, 3))
    strain = strain_to_voigt(0.5 * (gradient + gradient.T))
    u = (mesh.points @ gradient.T).reshape(-1)
    energy = mesh.volumes @ np.einsum("i,mij,j->m", strain, stiffness, strain)
    assert u @ (assemble(mesh, stiffness) @ u) == pytest.approx(energy, rel=1e-12)


def test_energy_of_linear_strain_is_exact_on_quadratic_cells():
    # u = (x^2 + y z, x y - z^2, z x) on the box (0, a) x (0, b) x (0, c), isotropic. Strain:
    # e11 = 2 x, e22 = x, e33 = x; g23 = -2 z, g13 = y + z, g12 = z + y. Then
    # int e:C:e = (lam 16 + 2 mu 6) int x^2 + mu int (4 z^2 + 2 (y + z)^2).
    a, b, c = 3.0, 2.0, 1.5
    mesh = random_mesh(2)
    material = isotropic(10.0, 0.3)
    lam, mu = material.stiffness[0, 1], material.stiffness[3, 3]
    x, y, z = mesh.points.T
    u = np.stack([x**2 + y * z, x * y - z**2, z * x], axis=1).reshape(-1)
    volume = a * b * c
    xx, yy, zz, yz = a * a / 3, b * b / 3, c * c / 3, b * c / 4
    exact = (16 * lam + 12 * mu) * xx + mu * (4 * zz + 2 * (yy + 2 * yz + zz))
    got = u @ (assemble(mesh, material.stiffness) @ u)
    assert got == pytest.approx(volume * exact, rel=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_the_order_of_nodes_and_cells_does_not_count(order):
    mesh, generator = random_mesh(order), np.random.default_rng(3)
    stiffness, density = (
        random_stiffness(len(mesh.cells)),
        generator.uniform(0.1, 1, len(mesh.cells)),
    )
    number, turn = generator.permutation(len(mesh.points)), generator.permutation(len(mesh.cells))
    points = np.empty_like(mesh.points)
    points[number] = mesh.points
    mixed = assemble(TetMesh(points, number[mesh.cells][turn]), stiffness[turn], density[turn])
    assert mixed.has_sorted_indices
    rows = (3 * number[:, None] + np.arange(3)).reshape(-1)
    plain = assemble(mesh, stiffness, density).toarray()
    np.testing.assert_allclose(
        mixed.toarray()[np.ix_(rows, rows)], plain, rtol=0, atol=1e-12 * plain.max()
    )


@pytest.mark.parametrize("order", [1, 2])
def test_agrees_with_scikit_fem(order):
    skfem = pytest.importorskip("skfem")
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    linear = random_mesh(1)
    mesh = linear if order == 1 else linear.quadratic()
    own = assemble(mesh, isotropic(7.0, 0.3).stiffness).toarray()
    element = skfem.ElementTetP1() if order == 1 else skfem.ElementTetP2()
    basis = skfem.Basis(
        skfem.MeshTet(np.ascontiguousarray(linear.points.T), np.ascontiguousarray(linear.cells.T)),
        skfem.ElementVector(element),
    )
    peer = linear_elasticity(*lame_parameters(7.0, 0.3)).assemble(basis).toarray()
    # Both number their unknowns in their own way: match them by place and component.
    ours = np.empty(basis.N, dtype=int)
    for table in (basis.nodal_dofs, basis.edge_dofs):
        for row, unknowns in enumerate(table):
            distance = np.linalg.norm(
                basis.doflocs.T[unknowns][:, None] - mesh.points[None], axis=2
            )
            ours[unknowns] = 3 * distance.argmin(axis=1) + row % 3
    assert len(np.unique(ours)) == len(own)
    np.testing.assert_allclose(own[np.ix_(ours, ours)], peer, atol=1e-12 * np.abs(peer).max())


@pytest.mark.parametrize("order", [1, 2])
def test_matrix_is_symmetric_and_its_rows_are_sorted(order):
    mesh = random_mesh(order)
    matrix = assemble(mesh, random_stiffness(len(mesh.cells)))
    assert abs(matrix - matrix.T).max() < 1e-13 * np.abs(matrix.data).max()
    for start, stop in zip(matrix.indptr[:-1], matrix.indptr[1:], strict=True):
        assert (np.diff(matrix.indices[start:stop]) > 0).all()


def test_pattern_joins_the_nodes_that_share_a_cell():
    mesh = random_mesh(1)
    where = pattern(mesh)
    joined = {(int(i), int(j)) for cell in mesh.cells for i in cell for j in cell}
    rows = np.repeat(np.arange(len(mesh.points)), np.diff(where.indptr))
    assert set(zip(rows.tolist(), where.indices.tolist(), strict=True)) == joined
    for node in (0, 7):
        entries = where.touching[where.start[node] : where.start[node + 1]]
        assert (mesh.cells[entries // 4, entries % 4] == node).all()


@pytest.mark.parametrize("order", [1, 2])
def test_density_scales_each_cell(order):
    mesh = random_mesh(order)
    stiffness = isotropic(5.0, 0.2).stiffness
    density = np.random.default_rng(2).uniform(0.1, 1.0, len(mesh.cells))
    scaled = assemble(mesh, density[:, None, None] * stiffness)
    difference = assemble(mesh, stiffness, density, pattern(mesh)) - scaled
    assert abs(difference).max() < 1e-13 * np.abs(scaled.data).max()


@given(st.integers(0, 10_000))
@settings(max_examples=10, deadline=None)
def test_turning_mesh_and_material_turns_the_matrix(seed):
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    mesh = random_mesh(1, seed)
    stiffness = transversely_isotropic(20.0, 3.0, 0.3, 1.5).stiffness
    matrix = assemble(mesh, stiffness)
    turned = assemble(TetMesh(mesh.points @ turn.T, mesh.cells), rotate_stiffness(stiffness, turn))
    expected = turn @ matrix.data @ turn.T
    np.testing.assert_allclose(turned.data, expected, atol=1e-12 * np.abs(expected).max())


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_gradients_differentiate_linear_fields(seed):
    generator = np.random.default_rng(seed)
    mesh = random_mesh(1, seed)
    slope, shift = generator.normal(size=(3, 3)), generator.normal(size=3)
    u = mesh.points @ slope.T + shift
    gradient = u[mesh.cells].transpose(0, 2, 1) @ cell_gradients(mesh)
    np.testing.assert_allclose(gradient, np.broadcast_to(slope, gradient.shape), atol=1e-11)


def test_element_matrices_are_added_where_they_belong():
    mesh = random_mesh(1)
    matrix = assemble(mesh, np.eye(6))
    before = matrix.toarray()
    blocks = np.random.default_rng(3).normal(size=(5, 12, 12))
    cells = mesh.cells[[0, 3, 3, 8, 20]]
    add_blocks(matrix, cells, blocks)
    for nodes, block in zip(cells, blocks, strict=True):
        unknowns = (3 * nodes[:, None] + np.arange(3)).reshape(-1)
        before[np.ix_(unknowns, unknowns)] += block
    np.testing.assert_allclose(matrix.toarray(), before, atol=1e-13)


def test_stiffness_of_the_wrong_number_of_cells_is_refused():
    mesh = random_mesh(1)
    with pytest.raises(ValueError, match="stiffness must have shape"):
        assemble(mesh, np.stack([np.eye(6)] * 3))
