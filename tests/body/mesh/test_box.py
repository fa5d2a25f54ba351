import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.mesh import tet_mesh
from ccfem.body.mesh.box import box_mesh

divisions = st.tuples(*[st.integers(1, 4)] * 3)
sizes = st.tuples(*[st.floats(0.1, 50.0)] * 3)


@settings(deadline=None)  # the first boundary is compiled
@given(sizes, divisions, st.booleans())
def test_box_is_filled_and_closed(size, count, alternating):
    mesh = box_mesh(size, count, (1.0, -2.0, 3.0), alternating)
    assert mesh.volumes.min() > 0.0
    assert mesh.volumes.sum() == pytest.approx(np.prod(size))
    area, normal = mesh.facet_areas(mesh.boundary)
    x, y, z = size
    assert area.sum() == pytest.approx(2.0 * (x * y + y * z + z * x))
    np.testing.assert_allclose(area @ normal, 0.0, atol=1e-9 * area.sum())
    assert sum(len(facets) for facets in mesh.patches.values()) == len(mesh.boundary)


def test_patches_lie_on_their_sides():
    mesh = box_mesh((3.0, 2.0, 1.0), (3, 2, 2), (10.0, 0.0, 0.0))
    assert (mesh.points[mesh.patch("x_min")][..., 0] == 10.0).all()
    np.testing.assert_allclose(mesh.points[mesh.patch("y_max")][..., 1], 2.0)
    area, normal = mesh.facet_areas(mesh.patch("z_max"))
    assert area.sum() == pytest.approx(6.0)
    np.testing.assert_allclose(normal, [[0.0, 0.0, 1.0]] * len(normal))


@pytest.mark.parametrize("axis", range(3))
def test_alternating_bricks_are_their_own_mirror_image(axis):
    mesh = box_mesh((4.0, 2.0, 6.0), (4, 2, 6), alternating=True)
    size = mesh.bounds[1]
    flipped = np.where(np.arange(3) == axis, size - mesh.points, mesh.points)
    number = np.lexsort(mesh.points.T)
    other = np.empty(len(number), dtype=int)
    other[np.lexsort(flipped.T)] = number
    np.testing.assert_allclose(mesh.points[other], flipped)

    def known(cells):
        return set(map(tuple, np.sort(cells, axis=1).tolist()))

    assert known(other[mesh.cells]) == known(mesh.cells)
    plain = box_mesh((4.0, 2.0, 6.0), (4, 2, 6))
    assert known(other[plain.cells]) != known(plain.cells)


@pytest.mark.parametrize(
    ("size", "count", "message"),
    [
        ((1, 1, 0), (1, 1, 1), "size of a box must be above 0 mm; got 0"),
        ((1, 1, 1), (0, 1, 1), "divisions of a box must be at least 1; got 0"),
    ],
)
def test_empty_boxes_are_refused(size, count, message):
    with pytest.raises(InputError, match=message):
        box_mesh(size, count)


@pytest.mark.parametrize("few", [0, 10**6])
def test_points_of_a_box_are_located_in_cells_that_hold_them(few, monkeypatch):
    monkeypatch.setattr(tet_mesh, "_FEW", few)
    mesh = box_mesh((3.0, 2.0, 1.0), (3, 2, 2))
    points = np.random.default_rng(5).uniform(-0.5, 1.5, (200, 3)) * (3.0, 2.0, 1.0)
    inside = ((points >= 0.0) & (points <= (3.0, 2.0, 1.0))).all(axis=1)
    cell, weights = mesh.locate(points)
    np.testing.assert_array_equal(cell >= 0, inside)
    corners = mesh.points[mesh.corners[cell[inside]]]
    np.testing.assert_allclose(
        np.einsum("qa,qad->qd", weights[inside], corners), points[inside], atol=1e-12
    )
