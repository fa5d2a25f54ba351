import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from shapely import affinity

from ccfem.base.errors import InputError
from ccfem.geometry.medial_axis import _equidistant, medial_axis

PLATE = shapely.box(-60, -18, 60, 18).difference(shapely.Point(0, 0).buffer(6, quad_segs=32))
L_SHAPE = shapely.Polygon([(0, 0), (50, 0), (50, 10), (10, 10), (10, 40), (0, 40)])


def curves(axis):
    return shapely.union_all([shapely.LineString(s.points) for s in axis.segments])


def test_rectangle_has_its_spine():
    axis = medial_axis(shapely.box(0, 0, 40, 10), 0.4)
    (spine,) = axis.segments
    np.testing.assert_allclose(spine.points[:, 1], 5.0, atol=1e-9)
    np.testing.assert_allclose(spine.radius, 5.0, atol=1e-9)
    np.testing.assert_allclose(sorted(spine.points[[0, -1], 0]), [5.0, 35.0], atol=1e-9)
    assert spine.length == pytest.approx(30.0)
    assert not spine.closed
    np.testing.assert_allclose(axis.nodes[list(spine.ends)], spine.points[[0, -1]])


def test_feet_lie_left_and_right_of_the_way():
    (spine,) = medial_axis(shapely.box(0, 0, 40, 10), 0.4).segments
    forward = spine.points[-1, 0] > spine.points[0, 0]
    inner = slice(1, -1)  # at the ends the sides of the rectangle are no nearer than its ends
    np.testing.assert_allclose(spine.left[inner, 1], 10.0 if forward else 0.0, atol=1e-9)
    np.testing.assert_allclose(spine.right[inner, 1], 0.0 if forward else 10.0, atol=1e-9)
    middle = 0.5 * (spine.points[1:] + spine.points[:-1])
    np.testing.assert_allclose(spine.left[inner, 0], middle[inner, 0], atol=1e-9)


def test_corner_spurs_stay_without_rules():
    """All four bisectors of the corners, each sqrt(2) times the half width long."""
    axis = medial_axis(shapely.box(0, 0, 40, 10), 0.1, object_angle=None, prune=0.0)
    assert len(axis.segments) == 5
    spurs = sorted(s.length for s in axis.segments)[:4]
    np.testing.assert_allclose(spurs, 5.0 * np.sqrt(2.0), atol=0.15)


@pytest.mark.parametrize("angle", [0.0, 33.0, 90.0, 200.0])
def test_a_closed_axis_starts_where_it_is_widest(angle):
    """Between a circle of 10 mm and one of 3 mm, 2 mm off its middle: 9 mm wide at the far side."""
    ring = shapely.Point(0, 0).buffer(10.0, quad_segs=32)
    ring = ring.difference(shapely.Point(2, 0).buffer(3.0, quad_segs=32))
    (around,) = medial_axis(affinity.rotate(ring, angle, origin=(0, 0)), 0.4).segments
    assert around.closed
    far = -5.5 * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    np.testing.assert_allclose(around.points[[0, -1]], [far, far], atol=0.25)
    assert around.radius[0] == pytest.approx(4.5, abs=0.02)


def test_arc_chord_rule_takes_off_the_corner_spurs_too():
    rule = {"object_angle": None, "arc_chord": 1.6}
    (spine,) = medial_axis(shapely.box(0, 0, 40, 10), 0.2, **rule).segments
    np.testing.assert_allclose(spine.points[:, 1], 5.0, atol=1e-9)
    assert 30.0 - 1e-6 <= spine.length < 40.0


@pytest.mark.parametrize(
    ("part", "radius"),
    [(shapely.Point(3.0, 4.0).buffer(9.0, quad_segs=64), 9.0), (shapely.box(-1, 0, 7, 8), 4.0)],
    ids=["disc", "square"],
)
def test_disc_and_square_have_a_point(part, radius):
    axis = medial_axis(part, 0.3)
    assert axis.segments == ()
    np.testing.assert_allclose(axis.nodes, [[3.0, 4.0]], atol=1e-3)
    np.testing.assert_allclose(axis.radius, radius, atol=2e-3)


def test_misplaced_vertices_are_told():
    """Qhull puts a vertex of samples in a row, which belongs far away, at (-10.101, -10.101)."""
    sites = np.array([[x, y] for x in (-20.0, 20.0) for y in (-20.0, 20.0)])
    vertices = np.array([[0.0, 0.0], [-10.101, -10.101]])
    placed = _equidistant(vertices, np.array([3, 3]), sites, np.ones(2, dtype=bool))
    assert placed.tolist() == [True, False]


def test_ring_has_a_closed_curve():
    outer, inner = (shapely.Point(0, 0).buffer(r, quad_segs=64) for r in (20.0, 9.0))
    (loop,) = medial_axis(outer.difference(inner), 0.4).segments
    assert loop.closed
    np.testing.assert_allclose(np.hypot(*loop.points.T), 14.5, atol=5e-3)
    np.testing.assert_allclose(loop.radius, 5.5, atol=5e-3)
    assert loop.length == pytest.approx(2.0 * np.pi * 14.5, rel=1e-3)


def test_plate_with_hole_has_two_arms_and_a_loop_of_two():
    """On the axis of the plate the disc touches the hole and the sides: at x = 24."""
    axis = medial_axis(PLATE, 0.4)
    assert len(axis.segments) == 4
    assert not any(s.closed for s in axis.segments)
    places = axis.nodes[np.argsort(axis.nodes[:, 0])]
    np.testing.assert_allclose(places, [[-42, 0], [-24, 0], [24, 0], [42, 0]], atol=0.01)
    for segment in axis.segments:
        gap = shapely.distance(shapely.points(segment.points), PLATE.boundary)
        np.testing.assert_allclose(segment.radius, gap, atol=5e-3)


@pytest.mark.parametrize("part", [PLATE, affinity.translate(PLATE, 7, 3).buffer(-2.4)])
def test_symmetric_part_has_a_symmetric_axis(part):
    axis = medial_axis(part, 0.4)
    middle = part.envelope.centroid
    for x, y in ((-1, 1), (1, -1)):
        mirrored = affinity.scale(curves(axis), x, y, origin=middle)
        assert curves(axis).hausdorff_distance(mirrored) < 1e-3


@given(angle=st.floats(0.0, 360.0), x=st.floats(-50.0, 50.0))
@settings(max_examples=15, deadline=None)
def test_axis_moves_with_the_part(angle, x):
    def moved(shape):
        return affinity.translate(affinity.rotate(shape, angle, origin=(0, 0)), x, -x)

    one, other = curves(medial_axis(L_SHAPE, 0.5)), curves(medial_axis(moved(L_SHAPE), 0.5))
    assert moved(one).hausdorff_distance(other) < 0.01


def test_parts_are_told_apart_and_flat_ones_left_out():
    two = shapely.MultiPolygon([shapely.box(0, 0, 40, 10), shapely.box(50, 0, 58, 8)])
    axis = medial_axis(two, 0.4)
    assert len(axis.segments) == 1
    assert len(axis.nodes) == 3
    assert medial_axis(shapely.Polygon(), 0.4).segments == ()


def test_step_must_be_positive():
    with pytest.raises(InputError, match="step"):
        medial_axis(PLATE, 0.0)


def test_section_is_not_prepared():
    """Sections are shared by threads, and GEOS crashes where two use one that is prepared."""
    section = shapely.from_wkb(shapely.to_wkb(PLATE))
    medial_axis(section, 1.0)
    assert not shapely.is_prepared(section)


@pytest.mark.parametrize(
    "hole", [[(10, 9.5), (20.3, 10.2), (14, 10.5)], [(10, 10), (15, 14), (20, 10), (15, 12)]]
)
def test_axis_does_not_cross_a_thin_hole(hole) -> None:
    """Samples at both sides of its tip are neighbours, across the hole."""
    plate = shapely.box(0, 0, 40, 20).difference(shapely.Polygon(hole))
    for segment in medial_axis(plate, 0.45, object_angle=None, arc_chord=1.6).segments:
        assert plate.covers(shapely.LineString(segment.points))
        assert np.linalg.norm(segment.left - segment.right, axis=1).min() > 0.1
