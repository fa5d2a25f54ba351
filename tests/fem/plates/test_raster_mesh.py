import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from ccfem.base.errors import InputError
from ccfem.fem.plates.mesh import PlaneMesh, Sheet, raster_image, raster_mesh

MASKS = arrays(bool, st.tuples(st.integers(1, 6), st.integers(1, 6))).filter(lambda a: a.any())


@settings(max_examples=50, deadline=None)
@given(mask=MASKS, size=st.floats(0.1, 4.0))
def test_raster_cells_lie_on_their_pixels(mask, size):
    mesh = raster_mesh(mask, size, (3.0, -2.0))
    rows, columns = np.nonzero(mask)
    wanted = np.stack([(columns + 0.5) * size + 3.0, (len(mask) - rows - 0.5) * size - 2.0], axis=1)
    np.testing.assert_allclose(mesh.centres, wanted, atol=1e-9)
    np.testing.assert_allclose(mesh.areas, size**2, rtol=1e-9)
    assert mesh.congruent
    assert len(np.unique(mesh.points.round(6), axis=0)) == len(mesh.points)
    np.testing.assert_array_equal(np.unique(mesh.cells), np.arange(len(mesh.points)))
    lengths, normals = Sheet(mesh, np.ones(len(mesh.cells))).facet_areas(mesh.boundary)
    np.testing.assert_allclose(lengths, size, rtol=1e-9)
    np.testing.assert_allclose((lengths[:, None] * normals).sum(axis=0), 0.0, atol=1e-9)
    outward = mesh.points[mesh.boundary].mean(axis=1) - mesh.centres[mesh.boundary_cells]
    assert ((outward * normals).sum(axis=1) > 0.0).all()
    padded = np.pad(mask, 1)
    perimeter = sum(
        (padded[1:-1, 1:-1] & ~np.roll(padded, s, a)[1:-1, 1:-1]).sum()
        for a in (0, 1)
        for s in (1, -1)
    )
    assert len(mesh.boundary) == perimeter


@settings(max_examples=30, deadline=None)
@given(mask=MASKS, size=st.floats(0.1, 4.0))
def test_image_of_a_raster(mask, size):
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    cropped = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    mesh = raster_mesh(mask, size, (3.0, -2.0))
    values = np.arange(1.0, 1.0 + mask.sum())
    raster = raster_image(mesh, values)
    np.testing.assert_array_equal(raster.inside, cropped)
    np.testing.assert_array_equal(raster.image[raster.inside], values)
    assert raster.size == pytest.approx(size)
    left, low = columns[0] * size + 3.0, (len(mask) - 1 - rows[-1]) * size - 2.0
    np.testing.assert_allclose(raster.origin, [left, low], atol=1e-9)


def test_other_meshes_have_no_image():
    mesh = PlaneMesh([[0, 0], [2, 0], [2, 1], [0, 1]], [[0, 1, 2, 3]])
    with pytest.raises(InputError, match="equal squares"):
        raster_image(mesh, np.ones(1))


def test_top_row_of_the_image_is_the_upper_side():
    image = np.array([[1, 1, 1], [0, 1, 0]], dtype=bool)
    mesh = raster_mesh(image, 2.0)
    assert mesh.points[:, 1].max() == 4.0
    assert len(mesh.patch("y_max")) == 3
    assert len(mesh.patch("y_min")) == 1
    assert len(mesh.patch("x_min")) == 1
    values = np.zeros(image.shape)
    values[image] = mesh.centres[:, 1]
    np.testing.assert_array_equal(values, [[3, 3, 3], [0, 1, 0]])


def test_a_raster_needs_a_pixel():
    with pytest.raises(InputError, match="true pixel"):
        raster_mesh(np.zeros((2, 2), dtype=bool))
