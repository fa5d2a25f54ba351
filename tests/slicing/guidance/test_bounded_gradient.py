"""Fields with bounds of their gradient: along one direction the nearest one is known."""

import numpy as np

from ccfem.body.mesh import box_mesh
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
