"""Cells that are refined by their estimated error."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import (
    Force,
    NodeSupport,
    PointForce,
    PointSupport,
    Problem,
    Region,
    Support,
    refine,
    solve,
)
from ccfem.fem.materials import isotropic


@pytest.fixture(scope="module")
def bent():
    """A cantilever of 40 x 10 x 4 mm on a coarse mesh."""
    return Problem(
        box_mesh((40.0, 10.0, 4.0), (10, 3, 2)),
        isotropic(1000.0, 0.3),
        (Support("x_min"),),
        {"tip": (Force("x_max", (0.0, 0.0, -10.0)),)},
    )


def test_the_true_error_falls_where_cells_are_added(bent):
    """Against the energy on a mesh of 8 times as many quadratic cells."""
    fine = replace(bent, mesh=box_mesh((40.0, 10.0, 4.0), (20, 6, 4)), order=2)
    exact = solve(fine)["tip"].strain_energy
    before = solve(bent)["tip"]
    finer = refine(bent, 0.05)
    after = solve(finer)["tip"]
    assert before.record.error > 0.07
    assert after.record.error <= 0.05
    assert exact - after.strain_energy < 0.3 * (exact - before.strain_energy)
    # Cells are added at the clamp, where the stress is singular, and not at the tip.
    centre = finer.mesh.points[finer.mesh.corners].mean(axis=1)[:, 0]
    assert np.count_nonzero(centre < 10.0) > 3 * np.count_nonzero(centre > 30.0)
    assert len(finer.mesh.cells) < len(fine.mesh.cells) / 2


def test_what_cells_have_goes_with_them(bent):
    centre = bent.mesh.points[bent.mesh.corners].mean(axis=1)
    soft = Region(isotropic(500.0, 0.3), np.flatnonzero(centre[:, 0] < 20.0))
    density = np.where(centre[:, 2] < 2.0, 1.0, 0.5)
    finer = refine(replace(bent, regions=(soft,), density=density, order=1), 0.6)
    assert len(finer.mesh.cells) > len(bent.mesh.cells)
    centre = finer.mesh.points[finer.mesh.corners].mean(axis=1)
    np.testing.assert_array_equal(finer.regions[0].cells, np.flatnonzero(centre[:, 0] < 20.0))
    np.testing.assert_array_equal(finer.density, np.where(centre[:, 2] < 2.0, 1.0, 0.5))


def test_nodes_that_carry_force_are_not_refined_about(bent):
    """Boussinesq: under a force at a point the displacement grows as one over the distance."""
    tip = PointForce((40.0, 5.0, 4.0), (0.0, 0.0, -10.0))
    with pytest.raises(InputError, match="got point force in load case 'tip'"):
        refine(replace(bent, loads={"tip": (tip,)}), 0.05)
    corners = ((0.0, 0.0, 0.0), (0.0, 10.0, 0.0), (0.0, 0.0, 4.0))
    with pytest.raises(InputError, match="got node support in load case 'tip'"):
        refine(replace(bent, supports=(NodeSupport("feet", corners),)), 0.05)
    # Supports at points that only keep a balanced part in place carry nothing.
    points = (
        PointSupport((0.0, 0.0, 0.0), "xyz"),
        PointSupport((40.0, 0.0, 0.0), "yz"),
        PointSupport((0.0, 10.0, 0.0), "z"),
    )
    down, up = (0.0, 0.0, -5.0), (0.0, 0.0, 10.0)
    loads = (Force("x_min", down), Force("x_max", down), Force("z_max", up))
    placed = replace(bent, supports=points, loads={"bent": loads}, order=1)
    assert len(refine(placed, 0.4).mesh.cells) > len(bent.mesh.cells)


def test_what_is_fine_enough_or_may_not_grow_stays(bent):
    assert refine(bent, 0.5).mesh is bent.mesh
    assert refine(bent, 0.01, most_cells=400).mesh is bent.mesh
    quadratic = refine(replace(bent, mesh=bent.mesh.quadratic()), 0.5)
    assert (quadratic.mesh.order, quadratic.order) == (1, 2)
    with pytest.raises(InputError, match="error to refine to must be above 0 and below 1"):
        refine(bent, 0.0)
