from dataclasses import replace

import numpy as np
import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support, Traction
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.several_cases import cases_failure, specimens, virtual_tests
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar


@pytest.fixture(scope="module")
def plate():
    """A square plate, 24 x 24 x 4 mm, without Poisson effect, pulled along x or along y."""
    mesh = box_mesh((24.0, 24.0, 4.0), (8, 8, 2))
    supports = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
    loads = {
        "along_x": (Traction("x_max", (5.0, 0.0, 0.0)),),
        "along_y": (Traction("y_max", (0.0, 2.0, 0.0)),),
    }
    material = isotropic(3500.0, 0.0, tensile_strength=35.0)
    problem = Problem(mesh, material, supports, loads, order=1)
    layers = Planar(count=4).cut(mesh)
    lines = [np.array([[0.0, y], [24.0, y]]) for y in np.arange(1.0, 24.0, 2.0)]
    paths = Toolpaths.concatenate(Toolpaths.from_plane(lines, layer) for layer in layers)
    return problem, layers, paths


def test_fibre_along_one_pull_does_nothing_for_the_other(plate):
    problem, _, paths = plate
    cases = WeightedCases.of(solve(problem, tolerance=1e-10))
    found = virtual_tests(paths, cases)
    # Bars in parallel along x: 1 + rho L / V; along y without Poisson effect nothing.
    exact = 1.0 + 4.0 * paths.lengths.sum() / (24.0 * 24.0 * 4.0)
    assert found.names == ("along_x", "along_y")
    np.testing.assert_allclose(found.ratios, [exact, 1.0], rtol=0.01)
    first, second = specimens(cases)
    assert first.solver is second.solver


def test_a_case_is_tested_as_alone_also_with_other_supports(plate):
    problem, _, paths = plate
    turned = replace(
        problem, supports=(Support("x_max"),), loads={"push": (Force("x_min", (-90.0, 30.0, 0.0)),)}
    )
    fields = {**solve(problem), **solve(turned)}
    cases = WeightedCases.of(fields, {"along_y": 1.0, "push": 3.0})
    found = virtual_tests(paths, cases)
    alone = [
        virtual_test(paths, one, span=()).ratio
        for one in (solve(problem)["along_y"], solve(turned)["push"])
    ]
    np.testing.assert_allclose(found.ratios, alone, rtol=1e-9)


def test_on_quadratic_cells_every_case_is_accurate_to_the_square_of_its_energy(plate):
    """Held against a factorisation of the part, and solves to rounding."""
    problem, _, paths = plate
    loads = {
        "along_x": problem.loads["along_x"],
        "bend": (Force("x_max", (0.0, 3.0, -1.0)),),
    }
    problem = replace(problem, mesh=problem.mesh.quadratic(), loads=loads)
    cases = WeightedCases.of(solve(problem, "two-level"))
    exact = virtual_tests(paths, specimens(cases, "superlu"), tolerance=1e-10)
    full, near = (virtual_tests(paths, cases, energy=energy) for energy in (0.0, 1e-3))
    np.testing.assert_allclose(near.ratios, exact.ratios, rtol=1e-6)
    iterations = [[test.solution.record.iterations for test in some.tests] for some in (near, full)]
    assert sum(iterations[0]) < 0.7 * sum(iterations[1])


@pytest.mark.parametrize(("strength", "case"), [(86.0, "along_x"), (400.0, "along_y")])
def test_part_fails_in_the_case_of_the_least_multiple(plate, strength, case):
    # Along x 5 MPa / R in the matrix and 4 mm^2 of that in a strand; along y 2 of 35 MPa.
    problem, _, paths = plate
    cases = WeightedCases.of(solve(problem, tolerance=1e-10))
    strand = Strand(strength=strength)
    tested = virtual_tests(paths, cases, strand)
    found = cases_failure(tested, strand)
    ratio = tested.ratios[0]
    first = min(strength / (4.0 * 5.0 / ratio), 35.0 / (5.0 / ratio))
    # The strain is not quite uniform on these cells: the highest mean over 5 mm counts.
    assert found.factors[0] == pytest.approx(first, rel=0.06)
    assert found.factors[1] == pytest.approx(17.5, rel=0.01)
    assert (found.case, found.factor) == (case, min(found.factors))
