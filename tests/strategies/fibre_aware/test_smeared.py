from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.tensor import rotate_stiffness
from ccfem.fem.elasticity.problem import Support
from ccfem.fem.elasticity.statics import solve
from ccfem.strategies.fibre_aware.smeared import UPPER, SmearedPart, on_linear_cells

ANGLE = 0.3


def along(angle):
    return np.array([np.cos(angle) ** 2, np.sin(angle) ** 2, np.cos(angle) * np.sin(angle)])


def uniform(part, stiffness, angle):
    q = along(angle)
    return np.broadcast_to(stiffness * np.outer(q, q), (len(part.mesh.cells), 3, 3))


def test_fibre_along_uniform_tension_adds_its_stiffness(pulled_bar):
    # A bar in parallel with its fibre: stiffness ratio 1 + EA m / E.
    stress, layers = pulled_bar
    part = SmearedPart.of(stress, layers[0].plane.frame)
    found = part.solve(lambda strain: uniform(part, 7000.0, 0.0), tolerance=1e-10)
    assert part.ratio(found.work) == pytest.approx(1.0 + 7000.0 / 3500.0, rel=1e-8)


def test_agrees_with_an_assembled_stiffness(bent_beam):
    # The same fibre as a stiffness of the cells, solved by the solver of the elasticity package.
    stress, layers = bent_beam
    part = SmearedPart.of(stress, layers[0].plane.frame)
    upper = uniform(part, 4000.0, ANGLE)[:, *UPPER]
    found = part.solve(lambda strain: upper, tolerance=1e-10)
    fibre = np.zeros((6, 6))
    fibre[0, 0] = 4000.0
    c, s = np.cos(ANGLE), np.sin(ANGLE)
    axes = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    total = stress.problem.material.stiffness + rotate_stiffness(fibre, axes)
    cells = np.broadcast_to(total, (len(stress.mesh.cells), 6, 6))
    assembled = solve(replace(stress.problem, stiffness=cells), tolerance=1e-10)["tip"]
    np.testing.assert_allclose(
        found.displacement, assembled.displacement, atol=1e-8 * np.abs(assembled.displacement).max()
    )
    assert found.work == pytest.approx(2.0 * assembled.strain_energy, rel=1e-9)


def test_knowing_the_fibre_halves_the_iterations(bent_beam):
    # The solution is that of the factorised part. Without knowing the fibre, the condition grows
    # as its stiffness over that of the matrix.
    stress, layers = bent_beam
    exact, multigrid = (
        SmearedPart.of(stress, layers[0].plane.frame, backend) for backend in ("superlu", "amg")
    )

    def fibre(strain):
        return uniform(exact, 40000.0, ANGLE)

    wanted = exact.solve(fibre, tolerance=1e-8)
    plain = multigrid.solve(fibre, tolerance=1e-8)
    known = multigrid.with_fibre(fibre, plain.strain).solve(fibre, tolerance=1e-8)
    assert known.work == pytest.approx(wanted.work, rel=1e-8)
    assert known.iterations <= plain.iterations // 2
    assert exact.with_fibre(fibre, plain.strain) is exact


def test_fibre_in_tension_only_leaves_what_is_pressed(bent_beam):
    stress, layers = bent_beam
    part = SmearedPart.of(stress, layers[0].plane.frame)
    q = along(0.0)

    def one_sided(strain):
        return uniform(part, 4000.0, 0.0) * (strain @ q > 0.0)[:, None, None]

    found = part.solve(one_sided, tolerance=1e-9)
    both = part.solve(lambda strain: uniform(part, 4000.0, 0.0), tolerance=1e-9)
    assert 1.0 < part.ratio(found.work) < part.ratio(both.work)
    # Equilibrium of the one-sided fibre itself: its energy equals the work that the load has left.
    system, u = part.specimen.system, found.displacement.reshape(-1)
    matrix = float(u @ (part.specimen.matrix @ u))
    stretch = np.maximum(found.strain @ q, 0.0)
    fibre = 4000.0 * float(part.mesh.volumes @ stretch**2)
    assert matrix + fibre == pytest.approx(float(system.forces["tip"].reshape(-1) @ u), rel=1e-7)


def test_moving_support_instead_of_a_force(pulled_bar):
    stress, layers = pulled_bar
    problem = stress.problem
    supports = (*problem.supports, Support("x_max", "x", (0.1, 0.0, 0.0)))
    moved = solve(replace(problem, supports=supports, loads={"move": ()}))["move"]
    part = SmearedPart.of(moved, layers[0].plane.frame)
    assert not part.forced
    found = part.solve(lambda strain: uniform(part, 7000.0, 0.0), tolerance=1e-10)
    assert part.ratio(found.work) == pytest.approx(3.0, rel=1e-8)


def test_quadratic_cells_become_linear(bent_beam):
    stress, _ = bent_beam
    quadratic = solve(replace(stress.problem, mesh=stress.mesh.quadratic()))["tip"]
    linear = on_linear_cells(quadratic)
    assert linear.mesh.order == 1
    np.testing.assert_array_equal(linear.mesh.points, stress.mesh.points)
    np.testing.assert_allclose(linear.displacement, stress.displacement, atol=1e-7)
    assert on_linear_cells(stress) is stress
