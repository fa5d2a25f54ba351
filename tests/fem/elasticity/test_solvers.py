import gc
import importlib.util
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ccfem.base.errors import InputError, SolveError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import solvers
from ccfem.fem.elasticity.assembly import assemble
from ccfem.fem.elasticity.direct import supernodes
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.solvers import BACKENDS, choose, factorise, preconditioned_cg
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.system import prepare
from ccfem.fem.materials import isotropic, transversely_isotropic

MODULES = {"pypardiso": "pypardiso", "cholmod": "sksparse"}


def installed(backend):
    return backend not in MODULES or importlib.util.find_spec(MODULES[backend]) is not None


def system(order=1, divisions=(8, 4, 3), material=None):
    mesh = box_mesh((8.0, 3.0, 2.0), divisions)
    mesh = mesh if order == 1 else mesh.quadratic()
    supports = (Support("x_min"), Support("y_min", "y"))
    loads = {
        "down": (Force("x_max", (0.0, 0.0, -1.0)),),
        "pull": (Force("x_max", (1.0, 0.5, 0.0)),),
    }
    return prepare(Problem(mesh, material or isotropic(100.0, 0.3), supports, loads))


def equations(prepared):
    """Return the reduced matrix, the right-hand side of "down", points and parents of the rows."""
    matrix = prepared.assemble()
    reduced = prepared.held.reduce(matrix)
    rhs = prepared.held.right_hand_side(matrix, prepared.forces["down"])
    return reduced, rhs, prepared.problem.mesh.points[prepared.held.nodes]


@pytest.mark.parametrize("divisions", [(1, 1, 1), (4, 2, 2), (9, 6, 5)])
def test_a_factor_kept_by_supernodes_solves_as_a_dense_one(divisions):
    prepared = system(1, divisions)
    matrix, _, _ = equations(prepared)
    solver = prepared.factorise(prepared.assemble(), "superlu", solves=100)
    assert solver.apply.__name__ == "solve"  # of the supernodes
    rhs = np.random.default_rng(0).normal(size=matrix.shape[0])
    exact = np.linalg.solve(matrix.toarray(), rhs)
    # Stored in single precision, it needs two or three iterations for what a direct solver gives.
    size = np.abs(exact).max()
    np.testing.assert_allclose(solver.apply(rhs), exact, atol=1e-5 * size)
    solution = solver.solve(rhs, tolerance=1e-12)
    np.testing.assert_allclose(solution.values, exact, atol=1e-10 * size)
    assert 1 <= solution.iterations <= 3
    stiffer = solver.refactorise(2.0 * matrix)
    np.testing.assert_allclose(stiffer.apply(rhs), 0.5 * exact, atol=1e-5 * size)


def test_pivots_off_the_diagonal_are_left_to_superlu():
    matrix = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    factor = splu(sp.csc_array(matrix), permc_spec="NATURAL")
    assert supernodes(factor) is None


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("backend", BACKENDS)
def test_backends_agree_with_a_dense_solve(backend, order):
    if not installed(backend):
        pytest.skip(f"{backend} is not installed")
    if backend == "two-level" and order == 1:
        pytest.skip("two levels need a quadratic mesh")
    prepared = system(order, (4, 2, 2))
    matrix, rhs, _ = equations(prepared)
    solver = prepared.factorise(prepared.assemble(), backend)
    assert solver.backend == backend
    solution = solver.solve(rhs, tolerance=1e-10)
    exact = np.linalg.solve(matrix.toarray(), rhs)
    np.testing.assert_allclose(solution.values, exact, atol=1e-8 * np.abs(exact).max())
    assert solution.residual <= 1e-10
    assert solution.residual == pytest.approx(
        np.linalg.norm(rhs - matrix @ solution.values) / np.linalg.norm(rhs)
    )
    assert (solution.iterations == 0) == solver.exact


@pytest.mark.parametrize("backend", ["amg", "two-level"])
def test_multigrid_needs_few_iterations_whatever_the_size(backend):
    counts = []
    for divisions in ((8, 6, 4), (20, 12, 8)):
        prepared = system(1 if backend == "amg" else 2, divisions)
        _, rhs, _ = equations(prepared)
        solver = prepared.factorise(prepared.assemble(), backend)
        counts.append(solver.solve(rhs).iterations)
    assert max(counts) <= 40
    assert counts[1] <= 1.6 * counts[0]


def test_amg_copes_with_fibres_that_are_stiff_one_way():
    material = transversely_isotropic(73200.0, 4100.0, 0.33, 2200.0)
    prepared = system(1, (16, 6, 4), material)
    matrix, rhs, points = equations(prepared)
    solution = factorise(matrix, points, "amg").solve(rhs)
    assert solution.iterations < 100


def test_a_good_start_saves_iterations():
    prepared = system(1, (12, 6, 4))
    matrix, rhs, points = equations(prepared)
    solver = factorise(matrix, points, "amg")
    cold = solver.solve(rhs)
    assert solver.solve(rhs, cold.values).iterations == 0
    assert 0 < solver.solve(rhs, 0.999 * cold.values).iterations < cold.iterations


@pytest.mark.parametrize("backend", ["superlu", "amg"])
def test_a_kept_factorisation_preconditions_a_changed_matrix(backend):
    prepared = system(1, (8, 6, 4))
    matrix, rhs, points = equations(prepared)
    solver = factorise(matrix, points, backend)
    mesh = prepared.problem.mesh
    factor = np.random.default_rng(0).uniform(0.5, 2.0, len(mesh.cells))
    stiffness = factor[:, None, None] * isotropic(100.0, 0.3).stiffness
    changed = prepared.held.reduce(assemble(mesh, stiffness))
    solution = preconditioned_cg(changed, rhs, solver, tolerance=1e-10)
    exact = np.linalg.solve(changed.toarray(), rhs)
    np.testing.assert_allclose(solution.values, exact, atol=1e-8 * np.abs(exact).max())
    assert 0 < solution.iterations < 60


def test_unknown_backend_lists_the_known():
    matrix, _, points = equations(system())
    with pytest.raises(InputError, match="no backend named 'mumps'; there are: auto, pypardiso"):
        factorise(matrix, points, "mumps")


@pytest.mark.parametrize("backend", sorted(MODULES))
def test_a_missing_backend_names_its_cure(backend, monkeypatch):
    monkeypatch.setattr(solvers, "find_spec", lambda name: None)
    matrix, _, points = equations(system())
    with pytest.raises(InputError, match=rf"backend '{backend}' is not installed: .*install"):
        factorise(matrix, points, backend)


def test_two_levels_need_a_quadratic_mesh():
    matrix, _, points = equations(system())
    with pytest.raises(InputError, match="quadratic"):
        factorise(matrix, points, "two-level")


def test_the_choice_follows_size_order_and_what_is_installed(monkeypatch):
    monkeypatch.setattr(solvers, "find_spec", lambda name: None)
    assert choose(1_000, 1).backend == choose(1_000, 2).backend == "superlu"
    assert choose(20_000, 1).backend == choose(20_000, 1, solves=10).backend == "amg"
    assert choose(20_000, 2).backend == "two-level"
    monkeypatch.setattr(solvers, "find_spec", lambda name: name == "sksparse" or None)
    assert choose(20_000, 1).backend == "amg"
    assert choose(20_000, 1, solves=10).backend == "cholmod"
    monkeypatch.setattr(solvers, "find_spec", lambda name: True)
    assert choose(20_000, 1, solves=10).backend == "pypardiso"
    assert choose(500_000, 1, solves=10).backend == "amg"
    assert choose(20_000, 1, neighbours=14.0).backend == "amg"
    assert choose(20_000, 1, neighbours=11.0).backend == "pypardiso"
    assert choose(41_000, 1, neighbours=11.0).backend == "amg"
    assert choose(500_000, 1, neighbours=11.0).backend == "amg"
    assert choose(20_000, 2, neighbours=11.0).backend == "two-level"
    assert "one or two cells high" in choose(20_000, 1, neighbours=11.0).because
    assert "10 load cases" in choose(20_000, 1, solves=10).because


def test_the_record_names_the_rule_that_chose_the_backend(monkeypatch):
    problem = replace(system().problem, order=1)
    assert next(iter(solve(problem).values())).record.backend_because == "at most 6,000 unknowns"
    asked = next(iter(solve(problem, "amg").values())).record
    assert (asked.backend, asked.backend_because) == ("amg", "asked for")


def test_thin_parts_are_told_by_the_neighbours_of_a_node(monkeypatch):
    monkeypatch.setattr(solvers, "_SMALL", 0)
    chosen = []
    monkeypatch.setattr(
        solvers,
        "_maker",
        lambda backend, *_: chosen.append(backend) or (lambda matrix: lambda rhs: rhs),
    )
    monkeypatch.setattr(solvers, "find_spec", lambda name: True)
    for layers in (1, 2, 3, 4):
        prepared = system(1, (40, 30, layers))
        prepared.factorise(prepared.assemble())
    assert chosen == ["pypardiso", "pypardiso", "amg", "amg"]


@pytest.mark.parametrize("solves", [1, 5])
@pytest.mark.parametrize("divisions", [(20, 12, 8), (40, 15, 1)])
def test_both_multigrids_solve_thick_and_thin_parts(solves, divisions):
    prepared = system(1, divisions)
    matrix, rhs, points = equations(prepared)
    found = factorise(matrix, points, "amg", solves=solves).solve(rhs, tolerance=1e-10)
    exact = factorise(matrix, points, "superlu").solve(rhs).values
    np.testing.assert_allclose(found.values, exact, atol=1e-7 * np.abs(exact).max())
    assert found.iterations <= (60 if divisions[2] > 1 else 150)


@pytest.mark.parametrize("backend", ["superlu", "amg"])
def test_a_missed_tolerance_is_an_error_with_the_residual(backend):
    matrix, rhs, points = equations(system())
    wrong = replace(factorise(matrix, points, backend), apply=lambda rhs: 0.0 * rhs)
    with pytest.raises(SolveError, match=rf"{backend}: relative residual 1\.0e\+00 after"):
        wrong.solve(rhs)


@pytest.mark.parametrize("backend", [b for b in ("superlu", "pypardiso") if installed(b)])
def test_a_singular_matrix_is_an_error(backend):
    points = np.eye(3)
    blocks = sp.bsr_array(np.kron(np.eye(3), np.ones((3, 3))), blocksize=(3, 3))
    with pytest.raises(SolveError, match=f"{backend}: "):
        factorise(blocks, points, backend).solve(np.arange(9.0))


def test_automatic_choice_goes_on_with_a_direct_backend(monkeypatch):
    monkeypatch.setattr(solvers, "_SMALL", 0)
    monkeypatch.setattr(solvers, "find_spec", lambda name: None)
    monkeypatch.setattr(
        "ccfem.fem.elasticity.multigrid.smoothed_aggregation",
        lambda matrix, points, frugal: lambda rhs: 0 * rhs,
    )
    problem = replace(system().problem, order=1)
    fields = solve(problem)
    assert {field.record.backend for field in fields.values()} == {"superlu"}
    with pytest.raises(SolveError, match="amg"):
        solve(problem, "amg")


def reduced_by(prepared, factor):
    """Return the reduced matrix with a factor on the stiffness of each cell."""
    stiffness = factor[:, None, None] * isotropic(100.0, 0.3).stiffness
    return prepared.held.reduce(assemble(prepared.problem.mesh, stiffness))


@pytest.mark.parametrize("backend", BACKENDS)
def test_refactorising_solves_with_the_new_matrix(backend):
    if not installed(backend):
        pytest.skip(f"{backend} is not installed")
    prepared = system(2 if backend == "two-level" else 1, (4, 2, 2))
    _, rhs, _ = equations(prepared)
    solver = prepared.factorise(prepared.assemble(), backend)
    numbers = np.random.default_rng(1)
    for _ in range(3):
        factor = numbers.uniform(1e-3, 1.0, len(prepared.problem.mesh.cells))
        changed = reduced_by(prepared, factor)
        solver = solver.refactorise(changed)
        assert solver.backend == backend
        assert solver.matrix is changed
        found = solver.solve(rhs, tolerance=1e-10).values
        exact = np.linalg.solve(changed.toarray(), rhs)
        np.testing.assert_allclose(found, exact, atol=1e-8 * np.abs(exact).max())


@pytest.mark.parametrize("backend", [b for b in ("superlu", "pypardiso") if installed(b)])
def test_refactorising_checks_pattern_and_residual(backend):
    prepared = system(1, (4, 2, 2))
    matrix, rhs, points = equations(prepared)
    solver = factorise(matrix, points, backend)
    nodes = np.random.default_rng(2).permutation(len(points))
    unknowns = (3 * nodes[:, None] + np.arange(3)).reshape(-1)
    shuffled = matrix.tocsr()[unknowns][:, unknowns]
    for other in (equations(system(1, (5, 2, 2)))[0], shuffled.tobsr((3, 3))):
        with pytest.raises(InputError, match=r"pattern of the one before .* use factorise"):
            solver.refactorise(other)
    solver = solver.refactorise(2.0 * matrix)
    exact = np.linalg.solve(2.0 * matrix.toarray(), rhs)
    np.testing.assert_allclose(solver.solve(rhs).values, exact, atol=1e-9 * np.abs(exact).max())
    other = replace(solver, matrix=5.0 * matrix)  # a factor of another matrix than it says
    with pytest.raises(SolveError, match=rf"{backend}: relative residual 1\.5e\+00 after"):
        other.solve(rhs)


needs_pardiso = pytest.mark.skipif(not installed("pypardiso"), reason="pypardiso is not installed")


@needs_pardiso
def test_pardiso_orders_once_and_refuses_a_spent_factor(monkeypatch):
    from pypardiso import PyPardisoSolver

    gc.collect()  # what other tests left
    phases, call = [], PyPardisoSolver._call_pardiso

    def watched(solver, matrix, rhs):
        phases.append(solver.phase)
        return call(solver, matrix, rhs)

    monkeypatch.setattr(PyPardisoSolver, "_call_pardiso", watched)
    matrix, rhs, points = equations(system(1, (4, 2, 2)))
    first = factorise(matrix, points, "pypardiso")
    second = first.refactorise(2.0 * matrix)
    second.solve(rhs)
    with pytest.raises(SolveError, match="a later matrix took the place"):
        first.solve(rhs)
    assert phases == [11, 22, 22, 33]
    del first
    gc.collect()
    assert -1 not in phases
    del second
    gc.collect()
    assert phases == [11, 22, 22, 33, -1]


@needs_pardiso
def test_pardiso_goes_on_after_a_matrix_that_is_not_positive_definite():
    matrix, rhs, points = equations(system(1, (4, 2, 2)))
    solver = factorise(matrix, points, "pypardiso")
    with pytest.raises(SolveError, match="not positive definite"):
        solver.refactorise(-1.0 * matrix)
    found = solver.refactorise(2.0 * matrix).solve(rhs).values
    np.testing.assert_allclose(found, factorise(2.0 * matrix, points).solve(rhs).values)


@needs_pardiso
def test_pardiso_serves_threads():
    matrix, rhs, points = equations(system(1, (8, 4, 3)))
    solver = factorise(matrix, points, "pypardiso")
    sides = [k * rhs for k in range(1, 41)]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda side: solver.solve(side).values, sides))
    for side, values in zip(sides, found, strict=True):
        np.testing.assert_allclose(matrix @ values, side, atol=1e-9 * np.abs(side).max())
