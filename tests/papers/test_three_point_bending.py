import numpy as np
import pytest
import shapely
from scipy import ndimage

from ccfem.fem.plates import solve_plane
from ccfem.papers.plocher_2022.plates import (
    three_point_bending,
    three_point_bending_problem,
)


@pytest.fixture(scope="module")
def beam():
    return three_point_bending()


def test_mask_is_one_symmetric_piece_of_the_volume(beam):
    assert beam.mask.shape == (60, 204)
    np.testing.assert_array_equal(beam.mask, beam.mask[:, ::-1])
    assert ndimage.label(beam.mask)[1] == 1
    assert beam.mask.mean() == pytest.approx(0.6, abs=0.01)


def test_density_is_that_of_the_prototype(beam):
    # Grey 0.18 in the addendum of specification 004, A17.
    assert beam.design.grey == pytest.approx(0.18, abs=0.01)
    assert beam.design.volume_fraction == pytest.approx(0.6, abs=1e-6)
    field = solve_plane(three_point_bending_problem())["bend"]
    assert beam.design.compliance[-1] > 2.0 * field.strain_energy


def test_polygon_is_the_mask(beam):
    polygon, size = beam.polygon, beam.size
    assert polygon.is_valid
    height, width = beam.mask.shape
    x, y = np.meshgrid((np.arange(width) + 0.5) * size, (height - 0.5 - np.arange(height)) * size)
    inside = shapely.contains_xy(polygon, x, y)
    assert (inside & beam.mask).sum() > 0.97 * (inside | beam.mask).sum()
    voids = ndimage.label(np.pad(~beam.mask, 1, constant_values=True))[1] - 1
    assert len(polygon.interiors) == voids
    mirrored = shapely.transform(polygon, lambda p: p * [-1.0, 1.0] + [width * size, 0.0])
    assert polygon.symmetric_difference(mirrored).area < 0.005 * polygon.area


def test_supports_and_loads_lie_on_the_part(beam):
    points = shapely.points(np.vstack([beam.supports, beam.loads]))
    assert (shapely.distance(beam.polygon, points) < 1e-6).all()
    np.testing.assert_allclose(beam.loads[:, 0] + beam.loads[::-1, 0], 204 * beam.size)
    np.testing.assert_allclose(beam.loads[:, 1], 60 * beam.size)


def test_size_scales_the_part():
    small, large = three_point_bending(0.5), three_point_bending(1.0)
    np.testing.assert_array_equal(small.mask, large.mask)
    assert large.polygon.area == pytest.approx(4.0 * small.polygon.area, rel=1e-6)
