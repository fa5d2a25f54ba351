"""Fields with bounds of their gradient: along one direction the nearest one is known.

Where fields must only rise, the nearest one is that of a quadratic programme, which OSQP solves.
"""

import numpy as np
import osqp
import pytest
import scipy.sparse as sp

from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity.assembly import cell_gradients
from ccfem.slicing.guidance.bounded_gradient import Bounds
from ccfem.slicing.guidance.height_field import height_field

ALONG = np.array([1.0, 0.0, 0.0])


def test_along_one_direction_every_cell_is_clipped_by_itself():
    """Vectors along x whose length varies along x alone: any such gradient is a field."""
    mesh = box_mesh((24.0, 2.0, 2.0), (24, 2, 2))
    x = mesh.points[mesh.corners].mean(axis=1)[:, 0]
    slab = np.floor(x)
    wanted = (0.3 + 1.7 * (slab + 0.5) / 24.0)[:, None] * ALONG
    plain = height_field(mesh, wanted, 0.0)
    np.testing.assert_allclose(plain.gradient, wanted, atol=1e-9)
    kept = height_field(mesh, wanted, lengths=(0.7, 1.4))
    size = np.linalg.norm(kept.gradient, axis=1)
    assert size.min() >= 0.7
    assert size.max() <= 1.4
    unchanged = (wanted[:, 0] > 0.72) & (wanted[:, 0] < 1.38)
    clipped = np.clip(wanted[:, 0], 0.7, 1.4)
    assert np.abs(kept.gradient[:, 0] - clipped).max() < 0.03
    assert np.abs(kept.gradient[unchanged, 0] - wanted[unchanged, 0]).max() < 0.01


def test_a_field_within_the_bounds_stays():
    mesh = box_mesh((6.0, 4.0, 4.0), (6, 4, 4))
    tilted = np.broadcast_to([0.6, 0.0, 0.8], (len(mesh.cells), 3))
    found = height_field(mesh, tilted, lengths=(0.5, 2.0))
    np.testing.assert_allclose(found.gradient, tilted, atol=1e-9)


def test_what_falls_is_raised_and_what_is_long_is_shortened():
    bounds = Bounds(0.5, 2.0, ALONG)
    given = np.array([[1.0, 0.0, 0.0], [4.0, 3.0, 0.0], [0.1, 0.0, 0.1], [-1.0, 1.0, 0.0]])
    near = bounds.nearest(given)
    assert not bounds.outside(near).any()
    assert bounds.outside(given).tolist() == [False, True, True, True]
    np.testing.assert_allclose(near[0], given[0])
    np.testing.assert_allclose(near[1], [1.568, 1.176, 0.0])
    np.testing.assert_allclose(near[2], [0.36062, 0.0, 0.36062], atol=1e-4)
    np.testing.assert_allclose(near[3], [0.01, 1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("phase", [1.0, 2.0])
def test_the_nearest_field_that_rises_is_that_of_a_quadratic_programme(phase):
    mesh, least = box_mesh((12.0, 6.0, 6.0), (8, 4, 4)), 1e-3
    turn = 1.9 * np.sin(mesh.points[mesh.corners].mean(axis=1)[:, 0] / 3.0 + phase)
    wanted = np.column_stack([np.sin(turn), 0.0 * turn, np.cos(turn)])
    plain = height_field(mesh, wanted, 0.0)
    kept = height_field(mesh, wanted, 0.0, lengths=(least, 50.0))

    count, volumes = len(turn), np.repeat(mesh.volumes, 3)
    rows = np.repeat(np.arange(3 * count).reshape(count, 1, 3), 4, axis=1)
    entries = (cell_gradients(mesh).ravel(), (rows.ravel(), np.repeat(mesh.corners.ravel(), 3)))
    slope = sp.csr_matrix(entries)
    form = sp.triu(slope.T @ sp.diags(volumes) @ slope, format="csc")
    rise = sp.csc_matrix(sp.kron(sp.eye(count), plain.up[None]) @ slope)
    model, low = osqp.OSQP(), np.full(count, 0.02 * least)
    accuracy = {"eps_abs": 1e-6, "eps_rel": 1e-6, "max_iter": 100_000, "verbose": False}
    pull = slope.T @ (volumes * wanted.ravel())
    model.setup(form, -pull, rise, low, np.full(count, np.inf), **accuracy)
    solved = model.solve()
    assert solved.info.status == "solved"

    def misfit(gradient):
        return mesh.volumes @ ((gradient - wanted) ** 2).sum(axis=1)

    best = misfit((slope @ solved.x).reshape(-1, 3))
    assert misfit(kept.gradient) == pytest.approx(best, rel=1e-3)
    assert best > 1.3 * misfit(plain.gradient)
    assert (kept.gradient @ plain.up).min() > -least
