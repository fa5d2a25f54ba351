import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.fem.elasticity import PointForce, Support
from ccfem.fem.materials import plane_stress
from ccfem.fem.plates import PlaneProblem, raster_mesh
from ccfem.fem.topopt import Simp, outline, part_shape


def disc(shape, x, y, radius):
    """Image of a disc with grey pixels on its rim."""
    rows, columns = np.indices(shape)
    distance = np.hypot(columns + 0.5 - x, shape[0] - rows - 0.5 - y)
    return np.clip(radius + 0.5 - distance, 0.0, 1.0)


@settings(max_examples=10, deadline=None)
@given(x=st.floats(15.0, 25.0), y=st.floats(12.0, 18.0), size=st.floats(0.3, 3.0))
def test_disc(x, y, size):
    found = outline(disc((30, 40), x, y, 9.0), size)
    assert found.area == pytest.approx(np.pi * (9.0 * size) ** 2, rel=0.02)
    assert found.centroid.distance(shapely.Point(x * size, y * size)) < 0.1 * size
    true = shapely.Point(x * size, y * size).buffer(9.0 * size, quad_segs=64)
    assert found.symmetric_difference(true).area < 0.04 * true.area


def test_full_domain_is_kept_to_the_corners():
    found = outline(np.ones((10, 20)), 2.0, threshold=0.5)
    assert found.symmetric_difference(shapely.box(0, 0, 40, 20)).area < 1e-3 * 800.0


def test_half_plane_keeps_its_straight_sides():
    density = np.ones((20, 30))
    density[:, 15:] = 0.0
    found = outline(density, threshold=0.5)
    assert found.symmetric_difference(shapely.box(0, 0, 15, 20)).area < 0.5


def test_holes_stay_small_ones_close_and_specks_go():
    density = 1.0 - disc((40, 60), 20.0, 20.0, 8.0)
    density[30, 45] = 0.0
    density = np.pad(density, ((0, 0), (0, 20)))
    density[5, 72] = 1.0
    found = outline(density, threshold=0.5)
    assert found.geom_type == "Polygon"
    assert len(found.interiors) == 1
    assert shapely.Polygon(found.interiors[0]).area == pytest.approx(np.pi * 64.0, rel=0.03)


def test_hairs_are_cut():
    density = np.zeros((20, 40))
    density[:, :10] = density[:, 30:] = 1.0
    density[10] = 0.9
    left = outline(density, threshold=0.5, keep=np.array([[2.0, 10.0]]))
    assert left.bounds[2] < 13.0
    with pytest.raises(InputError, match="falls apart"):
        outline(density, threshold=0.5, keep=np.array([[2.0, 10.0], [38.0, 10.0]]))


def test_exact_domain_replaces_the_pixels():
    inside = disc((30, 30), 15.0, 15.0, 12.0) > 0.5
    domain = shapely.Point(15.0, 15.0).buffer(12.0, quad_segs=64)
    found = outline(np.where(inside, 1.0, 0.0), threshold=0.5, domain=domain, inside=inside)
    assert found.symmetric_difference(domain).area < 1e-3 * domain.area
    stairs = outline(np.where(inside, 1.0, 0.0), threshold=0.5, inside=inside)
    assert stairs.area == pytest.approx(inside.sum(), rel=0.02)


@settings(max_examples=10, deadline=None)
@given(share=st.floats(0.3, 0.7))
def test_share_of_the_volume(share):
    rows, columns = np.indices((30, 60))
    density = 0.5 + 0.4 * np.sin(columns / 7.0) * np.cos(rows / 9.0)
    found = outline(density, 0.5, share)
    # Pieces and holes below the opening go: the largest piece holds no more than the share.
    assert found.area <= 1.02 * share * 15.0 * 30.0
    assert found.is_valid


def test_bad_images_are_refused():
    with pytest.raises(InputError, match=r"\(H, W\) image"):
        outline(np.ones(5))
    with pytest.raises(InputError, match=r"volume_fraction must be above 0 and at most 1; got 1.5"):
        outline(np.ones((5, 5)), volume_fraction=1.5)
    with pytest.raises(InputError, match=r"threshold must be above 0 and below 1; got 0.0"):
        outline(np.ones((5, 5)), threshold=0.0)
    with pytest.raises(InputError, match="outline is empty"):
        outline(np.zeros((5, 5)), threshold=0.5)


def test_shape_of_a_design_on_part_of_a_raster():
    mask = np.ones((20, 40), dtype=bool)
    mask[:6, :6] = False
    mesh = raster_mesh(mask, 0.5, (100.0, -50.0))
    loads = {"tip": (PointForce((120.0, -45.0, 0.0), (0.0, -1.0, 0.0)),)}
    stiffness = plane_stress(1.0, 1.0, 0.3, 1.0 / 2.6)
    problem = PlaneProblem(mesh, stiffness, 1.0, (Support("x_min"),), loads)
    design = Simp(0.5, radius=0.8, max_iterations=60)(problem)
    part = part_shape(design)
    assert part.geom_type == "Polygon"
    assert part.area == pytest.approx(0.5 * mesh.areas.sum(), rel=0.03)
    x, y = mesh.centres.T
    inside = shapely.contains_xy(part, x, y)
    filled = design.filled()
    assert (inside & filled).sum() > 0.9 * (inside | filled).sum()
    assert part.distance(shapely.Point(120.0, -45.0)) < 0.75
    assert part.bounds[0] == pytest.approx(100.0, abs=1e-6)
    exact = shapely.box(100.0, -50.0, 120.0, -40.0) - shapely.box(100.0, -43.0, 103.0, -40.0)
    assert part_shape(design, domain=exact).symmetric_difference(part).area < 0.01 * part.area


def test_a_design_that_falls_apart_is_refused():
    mesh = raster_mesh(np.ones((10, 40), dtype=bool))
    loads = {"tip": (PointForce((40.0, 5.0, 0.0), (1.0, 0.0, 0.0)),)}
    stiffness = plane_stress(1.0, 1.0, 0.3, 1.0 / 2.6)
    problem = PlaneProblem(mesh, stiffness, 1.0, (Support("x_min"),), loads)
    gap = np.abs(mesh.centres[:, 0] - 20.0) < 3.0
    design = Simp(0.5, radius=1.5, max_iterations=3, minimum_stiffness=1e-6)(problem, void=gap)
    with pytest.raises(InputError, match="falls apart"):
        part_shape(design)
