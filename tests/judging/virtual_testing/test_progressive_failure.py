"""The breaking load: energy of fracture, analytic breaks, the elastic start, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from flat_paths import flat_paths

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.progressive_failure import (
    _largest_principal,
    band_width,
    breaking_load,
)
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Strand

LENGTH, AREA, MODULUS = 20.0, 16.0, 2000.0


def bar(cells=2, matrix=30.0, weak=1.0, poisson=0.0, pull=None):
    """Bar along x of square section, pulled by its end, with one weak layer of cells."""
    mesh = box_mesh((LENGTH, 4.0, 4.0), (5 * cells, cells, cells))
    layer = np.floor(mesh.centres[:, 0] / LENGTH * 5 * cells) == 5 * cells // 2
    moved = (Support("x_max", "x", (1.0, 0.0, 0.0)),) if pull is None else ()
    problem = Problem(
        mesh,
        isotropic(MODULUS, poisson, tensile_strength=matrix),
        (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"), *moved),
        {"pull": () if pull is None else (Force("x_max", pull),)},
        order=1,
        strength=np.where(layer, weak, 1.0),
    )
    return solve(problem)["pull"]


def strands(*places):
    return flat_paths([[[0.0, *place], [LENGTH, *place]] for place in places])


@pytest.mark.parametrize("cells", [2, 4])
def test_a_crack_takes_the_energy_of_fracture_whatever_the_cells(cells):
    """Of a bar whose middle layer of cells is weak: the work that its opening takes, G_f A."""
    softening, strength = 30.0, 0.8 * 30.0
    curve = breaking_load(
        None, bar(cells, weak=0.8), softening=softening, band=False, stop=0.1
    ).curve
    assert curve.load == pytest.approx(strength * AREA, rel=1e-4)
    force, width = curve.force[1:-1], LENGTH / (5 * cells)
    opening = curve.displacement[1:-1] - force * (LENGTH - width) / (MODULUS * AREA)
    # Each event takes half the stiffness that it costs, times the square of the opening; in the end
    # a thousandth of the stiffness is left.
    stiffness = np.append(force / opening, 1e-3 * MODULUS * AREA / width)
    spent = -0.5 * float(np.diff(stiffness) @ opening**2)
    assert spent == pytest.approx(softening * strength**2 / MODULUS * AREA, rel=5e-3)
    assert curve.force[-1] < 0.1 * curve.load


def test_strands_break_a_bar_at_the_analytic_load():
    """At the strain that breaks them; over 5 mm of each the matrix then carries on alone."""
    axial, count = Strand().stiffness(MODULUS), 2
    paths = strands((1.3, 2.0), (2.7, 2.0))
    curve = breaking_load(paths, bar(matrix=1e3), Strand(strength=50.0), band=False).curve
    assert (curve.first, curve.force[0]) == ("fibre", 0.0)
    analytic = 50.0 / axial * (MODULUS * AREA + count * axial)
    assert curve.force[1] == pytest.approx(analytic, rel=1e-6)
    assert curve.broken[2] >= 5.0 * count * (1.0 - 1e-9)
    assert (curve.broken_at[curve.broken_at >= 0] > 0).all()
    # Both broke at once: the stiffness fell.
    assert curve.force[2] / curve.displacement[2] < 0.97 * curve.force[1] / curve.displacement[1]


def test_before_anything_fails_the_part_is_that_of_the_virtual_test():
    part, paths = bar(poisson=0.3, pull=(80.0, 0.0, 0.0)), strands((1.0, 1.0), (3.0, 3.0))
    bare, fibre = (breaking_load(each, part, band=False).curve for each in (None, paths))
    before, after = (curve.force[1] / curve.displacement[1] for curve in (bare, fibre))
    assert after / before == pytest.approx(virtual_test(paths, part, span=()).ratio, rel=1e-5)
    again = breaking_load(paths, part, band=False).curve
    for name in ("force", "displacement", "cracks", "broken", "cracked_at", "broken_at"):
        np.testing.assert_array_equal(getattr(again, name), getattr(fibre, name))


def test_the_band_is_of_weaker_and_stronger_strands():
    part, paths = bar(matrix=1e3), strands((2.0, 2.0))
    broken = breaking_load(paths, part, softening=20.0)
    assert broken.band[0] <= broken.load <= broken.band[1]
    for curve, share in ((broken.low, 0.85), (broken.curve, 1.0), (broken.high, 1.15)):
        assert curve.force[1] == pytest.approx(share * 105.0 / 8000.0 * 40000.0, rel=1e-5)


def test_largest_principal_stress_and_width_of_a_crack():
    stress = np.random.default_rng(1).normal(size=(50, 6))
    stress[0], stress[1] = 0.0, [2.0, 2.0, 2.0, 0.0, 0.0, 0.0]
    tensor = stress[:, [[0, 5, 4], [5, 1, 3], [4, 3, 2]]]
    largest = np.linalg.eigvalsh(tensor)[:, -1]
    np.testing.assert_allclose(_largest_principal(stress), largest, atol=1e-7)
    # The cell of three edges along the axes, of length 2: a crack across one takes all of that.
    gradients = 0.5 * np.array([[-1, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    normals = np.array([[1.0, 0.0, 0.0], np.full(3, 3**-0.5)])
    widths = band_width(np.stack([gradients, gradients]), normals)
    np.testing.assert_allclose(widths, [2.0, 2.0 / 3**0.5])


def test_refusals():
    part = bar()
    fine = solve(replace(part.problem, mesh=part.mesh.quadratic(), order=2))["pull"]
    with pytest.raises(InputError, match="linear cells; got quadratic ones"):
        breaking_load(None, fine)
    with pytest.raises(InputError, match=r"half the size of the largest cells, 2\.24 mm; got 1 mm"):
        breaking_load(None, part, softening=1.0, band=False)
    with pytest.raises(InputError, match="nothing breaks under this load"):
        breaking_load(None, bar(pull=(-80.0, 0.0, 0.0)), band=False)
