"""What is accepted of a solve, what is refused, and what the refusal says."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import SolveError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.elasticity.conjugate_gradient import ROUNDING
from ccfem.fem.elasticity.plausibility import incompressibility
from ccfem.fem.elasticity.system import prepare
from ccfem.fem.materials import isotropic

LOAD = 1e-4
"""Force, N, under which slender plates and soft roots move by less than their size."""


def beam(length, width, height, size, poisson=0.3, layers=1):
    """Cantilever of quadratic cells under a force downward at its end."""
    divisions = (round(length / size), round(width / size), layers)
    mesh = box_mesh((length, width, height), divisions).quadratic()
    material = isotropic(3500.0, poisson)
    loads = {"tip": (Force("x_max", (0.0, 0.0, -LOAD)),)}
    return Problem(mesh, material, (Support("x_min"),), loads)


def tip(field):
    """Displacement of the end under a newton."""
    end = np.unique(field.mesh.facet_nodes(field.mesh.patch("x_max")))
    return -field.displacement[end, 2].mean() / LOAD


@pytest.mark.parametrize("backend", ["superlu", "two-level"])
@pytest.mark.parametrize("size", [(100.0, 20.0, 1.0), (200.0, 20.0, 1.0)])
def test_slender_plates_are_solved(size, backend):
    # Refused before: their residual is 1e-7 of the load, which is tiny beside what cancels in the
    # equations. Kirchhoff's plate lies between the beams with E and E / (1 - nu^2).
    field = solve(beam(*size, 2.0), backend)["tip"]
    length, width, height = size
    beam_tip = length**3 / (3.0 * 3500.0 * width * height**3 / 12.0)
    assert 0.91 * beam_tip < tip(field) < beam_tip
    record = field.record
    assert record.residual > 1e-8
    assert record.backward_error < ROUNDING
    assert record.energy_error < 1e-5


@pytest.mark.parametrize("backend", ["superlu", "two-level"])
def test_a_soft_root_is_solved(backend):
    # A millionth of the stiffness over the first 10 of 40 mm: the rest hangs on it as a rigid
    # body, and the tip moves as it does on the soft root alone, a short beam under F and F * 30.
    part = beam(40.0, 10.0, 10.0, 2.5, layers=4)
    soft = part.mesh.points[part.mesh.corners].mean(axis=1)[:, 0] < 10.0
    whole = solve(replace(part, density=np.where(soft, 1e-6, 1.0)), backend)["tip"]
    lower = solve(replace(part, density=np.where(soft, 1e-4, 1.0)), backend)["tip"]
    assert whole.record.energy_error < 1e-5
    assert tip(whole) / tip(lower) == pytest.approx(100.0, rel=0.005)


def test_a_nearly_incompressible_block_is_solved():
    fields = [solve(beam(40.0, 10.0, 10.0, 5.0, nu, 2))["tip"] for nu in (0.499, 0.499999)]
    assert tip(fields[1]) == pytest.approx(tip(fields[0]), rel=0.02)
    assert fields[1].record.energy_error < 1e-6


@pytest.mark.parametrize("backend", ["superlu", "two-level"])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-8])
def test_the_energy_error_is_bounded(backend, tolerance):
    part = beam(20.0, 4.0, 4.0, 2.0, layers=2)
    system = prepare(part)
    matrix = system.assemble()
    rhs = system.held.right_hand_side(matrix, system.forces["tip"])
    solver = system.factorise(matrix, backend)
    found = solver.solve(rhs, tolerance=tolerance)
    dense = solver.matrix.toarray()
    exact = np.linalg.solve(dense, rhs)
    error = found.values - exact
    true = np.sqrt(error @ dense @ error / (exact @ dense @ exact))
    bound = solver.energy_error(rhs, found)
    if backend == "two-level":
        assert true <= bound <= 4.0 * true
    else:  # both are rounding
        assert max(true, bound) < 1e-11
    assert found.backward_error == pytest.approx(
        np.linalg.norm(rhs - dense @ found.values)
        / (dense.diagonal().max() * np.linalg.norm(found.values) + np.linalg.norm(rhs))
    )


def test_a_poor_factorisation_is_refined():
    part = beam(20.0, 4.0, 4.0, 2.0)
    system = prepare(part)
    matrix = system.assemble()
    rhs = system.held.right_hand_side(matrix, system.forces["tip"])
    solver = system.factorise(matrix, "superlu")
    rough = replace(solver, apply=lambda r: solver.apply(r) * (1.0 + 1e-6))
    exact = np.linalg.solve(solver.matrix.toarray(), rhs)
    np.testing.assert_allclose(rough.solve(rhs).values, exact, atol=1e-9 * np.abs(exact).max())
    assert rough.solve(rhs).residual < 1e-11


@pytest.mark.parametrize(
    ("change", "cure"),
    [
        ({}, "the part is slender, or held at very little"),
        ({"height": 0.002}, "as long as high: check that all lengths are in mm"),
        ({"poisson": 0.4999}, "nearly incompressible, .* take a Poisson's ratio of 0.49 or less"),
        ({"density": 1e-6}, r"1e\+06 times as stiff as the softest: raise the least density"),
    ],
)
def test_a_refusal_names_the_cause_and_the_cure(change, cure, monkeypatch):
    monkeypatch.setattr(sys.modules["ccfem.fem.elasticity.statics"], "_ENERGY", 1e-30)
    part = beam(8.0, 3.0, change.get("height", 3.0), 1.0, change.get("poisson", 0.3))
    if "density" in change:
        factor = np.ones(len(part.mesh.cells))
        factor[0] = change["density"]
        part = replace(part, density=factor)
    with pytest.raises(SolveError, match=f"energy of the error may be .*{cure}"):
        solve(part)


def test_incompressibility_is_the_bulk_over_the_shear_modulus():
    for nu in (0.0, 0.3, 0.45, 0.499):
        expected = 2.0 * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))
        assert incompressibility(isotropic(7.0, nu).stiffness) == pytest.approx(expected)
