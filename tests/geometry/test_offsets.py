import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from ccfem.geometry.offsets import inset, join_rings, offset_rings, ring_from, rings


def circle(radius, segments=720):
    t = 2.0 * np.pi * np.arange(segments) / segments
    return shapely.Polygon(radius * np.stack([np.cos(t), np.sin(t)], axis=1))


def annulus(inner=10.0, outer=30.0):
    return circle(outer).difference(circle(inner))


@st.composite
def star_with_hole(draw):
    """A star-shaped section of 20 to 60 mm with a round hole in it."""
    count = draw(st.integers(5, 14))
    radii = np.array(draw(st.lists(st.floats(12.0, 30.0), min_size=count, max_size=count)))
    t = 2.0 * np.pi * np.arange(count) / count + draw(st.floats(0.0, 6.0))
    star = shapely.Polygon(radii[:, None] * np.stack([np.cos(t), np.sin(t)], axis=1))
    return star.difference(circle(draw(st.floats(0.5, 6.0)), 40))


def length(line):
    return np.linalg.norm(np.diff(line, axis=0), axis=1).sum()


def test_inset_of_a_square_keeps_its_corners():
    square = shapely.box(0.0, 0.0, 10.0, 10.0)
    assert inset(square, 2.0).equals(shapely.box(2.0, 2.0, 8.0, 8.0))


def test_opening_rounds_the_corners_by_half_the_width():
    opened = inset(shapely.box(0.0, 0.0, 10.0, 10.0), 1.0, width=2.0)
    assert opened.area == pytest.approx(64.0 - (4.0 - np.pi), rel=1e-3)
    assert inset(shapely.box(0.0, 0.0, 10.0, 10.0), 1.0).contains(opened.buffer(-1e-9))


def test_opening_removes_what_is_narrower_than_the_width():
    neck = shapely.union_all(
        [shapely.box(0, 0, 10, 10), shapely.box(9, 4.6, 21, 5.4), shapely.box(20, 0, 30, 10)]
    )
    assert inset(neck, 0.0).geom_type == "Polygon"
    assert len(shapely.get_parts(inset(neck, 0.0, width=1.0))) == 2


def test_rings_have_the_material_on_their_left():
    outer, hole = rings(annulus())
    assert shapely.LinearRing(outer).is_ccw
    assert not shapely.LinearRing(hole).is_ccw
    np.testing.assert_array_equal(outer[0], outer[-1])


def test_offset_rings_of_an_annulus_are_its_concentric_circles():
    levels = offset_rings(annulus(), 0.5, 1.0, 1.0)
    assert len(levels) == 10
    for k, level in enumerate(levels):
        assert len(level) == 2
        for ring, radius in zip(level, (29.5 - k, 10.5 + k), strict=True):
            np.testing.assert_allclose(np.hypot(*ring.T), radius, atol=0.01)


def test_count_limits_the_rings():
    assert len(offset_rings(annulus(), 0.5, 1.0, 1.0, count=3)) == 3


def test_section_thinner_than_the_width_has_no_ring():
    assert offset_rings(shapely.box(0.0, 0.0, 50.0, 0.9), 0.5, 1.0, 1.0) == []
    assert offset_rings(shapely.Polygon(), 0.5, 1.0, 1.0) == []


@settings(deadline=None, max_examples=30)
@given(star_with_hole(), st.floats(1.0, 3.0))
def test_offset_rings_keep_their_distance(section, spacing):
    levels = [
        shapely.multilinestrings([shapely.linestrings(ring) for ring in level])
        for level in offset_rings(section, 0.5, spacing, 1.0)
    ]
    border = section.boundary
    for k, level in enumerate(levels):
        depth = 0.5 + k * spacing
        assert shapely.distance(level, border) >= 0.98 * depth
        if k:
            assert shapely.distance(level, levels[k - 1]) >= 0.98 * spacing


def test_ring_from_starts_next_to_the_point_and_stays_the_same_curve():
    square = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]], dtype=float)
    ring = ring_from(square, np.array([5.0, 1.0]))
    np.testing.assert_allclose(ring, [[4, 1], [4, 4], [0, 4], [0, 0], [4, 0], [4, 1]])
    at_vertex = ring_from(square, np.array([6.0, 6.0]))
    np.testing.assert_allclose(at_vertex, [[4, 4], [0, 4], [0, 0], [4, 0], [4, 4]])


def test_joined_rings_of_an_annulus_are_two_strands():
    levels = offset_rings(annulus(), 0.5, 1.0, 1.0)
    outer, inner = join_rings(levels, np.array([30.0, 0.0]), 1.0, 1.0)
    np.testing.assert_allclose(np.hypot(*outer[0]), 29.5, atol=0.01)
    np.testing.assert_allclose(np.hypot(*outer[-1]), 20.5, atol=0.01)
    np.testing.assert_allclose(np.hypot(*inner[-1]), 19.5, atol=0.01)
    # Each ramp of chord sqrt(2^2 + 1) replaces an arc of about 2 mm, each gap lacks 1 mm.
    circles = 2.0 * np.pi * np.arange(20.5, 30.0).sum()
    assert length(outer) == pytest.approx(circles - 10 * 1.0 - 9 * (2.0 - np.sqrt(5.0)), abs=0.5)


def test_gap_between_end_and_start_of_joined_rings():
    levels = offset_rings(annulus(), 0.5, 1.0, 1.0, count=2)
    for strand in join_rings(levels, np.array([30.0, 0.0]), 1.0, 1.0):
        assert np.linalg.norm(strand[-1] - strand[0]) >= 1.0


@pytest.mark.parametrize("scale", [0.25, 3.0])
def test_joined_rings_grow_with_their_spacing(scale):
    """The innermost ring is too short for a gap and a ramp, at any size, and stays closed."""
    start, square = np.array([7.0, 3.0]), shapely.box(0.0, 0.0, 6.4, 6.4)
    strands = join_rings(offset_rings(square, 0.5, 1.0, 1.0), start, 1.0, 1.0)
    assert len(strands) == 2
    assert np.array_equal(strands[-1][0], strands[-1][-1])
    levels = offset_rings(shapely.box(0.0, 0.0, *[6.4 * scale] * 2), *scale * np.array([0.5, 1, 1]))
    grown = join_rings(levels, scale * start, scale, scale)
    assert len(grown) == len(strands)
    for one, other in zip(grown, strands, strict=True):
        np.testing.assert_allclose(one, scale * other, atol=1e-9)


@settings(deadline=None, max_examples=30)
@given(star_with_hole())
def test_joined_rings_lay_the_rings_without_crossing(section):
    levels = offset_rings(section, 0.5, 1.0, 1.0)
    loose = [ring for level in levels for ring in level]
    strands = join_rings(levels, np.array([40.0, 0.0]), 1.0, 1.0)
    curves = shapely.multilinestrings([shapely.linestrings(s) for s in strands])
    assert curves.is_simple
    assert shapely.distance(curves, section.boundary) >= 0.49
    assert section.covers(curves)
    joined = len(loose) - len(strands)
    lost = sum(map(length, loose)) - sum(map(length, strands))
    assert len(strands) <= len(loose)
    assert -1e-9 <= lost <= 4.0 * joined + len(strands) + 1e-9
