import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from ccfem.geometry.hatch import hatch, link_hatch, zigzag
from ccfem.geometry.offsets import inset


@st.composite
def star_with_holes(draw):
    count = draw(st.integers(3, 14))
    radii = np.array(draw(st.lists(st.floats(12.0, 30.0), min_size=count, max_size=count)))
    t = 2.0 * np.pi * np.arange(count) / count + draw(st.floats(0.0, 6.0))
    section = shapely.Polygon(radii[:, None] * np.stack([np.cos(t), np.sin(t)], axis=1))
    for x, y, r in draw(
        st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(0.2, 4.0)), max_size=3)
    ):
        section = section.difference(shapely.Point(x, y).buffer(r))
    return section


def length(line):
    return np.linalg.norm(np.diff(line, axis=0), axis=1).sum()


def curves(lines):
    return shapely.multilinestrings([shapely.linestrings(line) for line in lines])


def test_lines_of_a_rectangle():
    lines = hatch(shapely.box(0.0, 0.0, 20.0, 4.0), 0.0, 1.0).lines
    expected = [[[0, 0.5], [20, 0.5]], [[20, 1.5], [0, 1.5]]]
    expected += [[[0, 2.5], [20, 2.5]], [[20, 3.5], [0, 3.5]]]
    np.testing.assert_allclose(lines, expected, atol=1e-12)


def test_lines_run_at_their_angle():
    for line in hatch(shapely.box(0.0, 0.0, 20.0, 4.0), np.radians(30.0), 1.0).lines:
        step = line[1] - line[0]
        assert np.tan(np.radians(30.0)) == pytest.approx(step[1] / step[0], rel=1e-9)


def test_lines_leave_out_holes():
    plate = shapely.box(0.0, 0.0, 20.0, 10.0).difference(shapely.box(5.0, 3.0, 15.0, 7.0))
    lines = hatch(plate, 0.0, 1.0).lines
    assert len(lines) == 3 + 2 * 4 + 3
    assert sum(map(length, lines)) == pytest.approx(plate.area)


def test_rows_through_vertices_enter_and_leave_equally_often():
    diamond = shapely.Polygon([(0, -2.5), (5, 0), (0, 2.5), (-5, 0)])
    lines = hatch(diamond, 0.0, 1.0).lines
    assert [length(line) for line in lines] == pytest.approx([2.0, 6.0, 10.0, 6.0, 2.0])


@settings(deadline=None, max_examples=50)
@given(star_with_holes(), st.floats(0.0, 7.0), st.floats(0.3, 1.0))
def test_lines_are_those_of_a_polygon_clipper(section, angle, pitch):
    """Against shapely's own intersection of long lines with the section."""
    found = hatch(section, angle, pitch)
    for row in np.unique(found.row):
        y = found.ends[2 * np.flatnonzero(found.row == row)[0], 1]
        ends = found.to_section(np.array([[-99.0, y], [99.0, y]]))
        clipped = shapely.intersection(shapely.linestrings(ends), section).length
        pairs = found.ends.reshape(-1, 2, 2)[found.row == row]
        assert (pairs[:, 1, 0] - pairs[:, 0, 0]).sum() == pytest.approx(clipped, abs=1e-6)


def test_linked_lines_of_a_rectangle_are_one_path():
    section = shapely.box(0.0, 0.0, 20.0, 4.0)
    (path,) = link_hatch(hatch(section, 0.0, 1.0), section, 1.0)
    assert length(path) == pytest.approx(4 * 20.0 + 3 * 1.0)


def test_plate_with_a_hole_needs_two_paths():
    plate = shapely.box(0.0, 0.0, 40.0, 20.0).difference(shapely.Point(20.0, 10.0).buffer(4.0))
    assert len(link_hatch(hatch(plate, 0.3, 1.0), plate, 1.0)) <= 2


def test_flat_links_are_cut_short():
    """A border at 2 degrees to the lines would carry links of 28 mm next to them."""
    wedge = shapely.Polygon([(0, 0), (60, 0), (60, 20), (0, 20 - 60 * np.tan(np.radians(2.0)))])
    for path in link_hatch(hatch(wedge, 0.0, 1.0), wedge, 1.0):
        step = np.diff(path, axis=0)
        along_border = np.abs(step[:, 1]) > 1e-9
        assert np.abs(step[along_border, 0]).max() <= 1.5 + 1e-9


@settings(deadline=None, max_examples=60)
@given(star_with_holes(), st.floats(0.0, 7.0), st.floats(1.0, 5.0))
def test_linked_paths_stay_inside_and_cross_nothing(section, angle, spacing):
    paths = zigzag(section, 0.5, 1.0, spacing, angle)
    if not paths:
        assert hatch(inset(section, 0.5, 1.0), angle, spacing).lines == []
        return
    laid = curves(paths)
    assert laid.is_simple
    assert section.covers(laid)
    assert shapely.distance(laid, section.boundary) >= 0.49


@settings(deadline=None, max_examples=30)
@given(star_with_holes(), st.floats(0.0, 7.0), st.floats(1.0, 3.0))
def test_every_line_is_laid_once(section, angle, pitch):
    found = hatch(section, angle, pitch)
    paths = link_hatch(found, section, 1.0)
    laid = curves(paths).buffer(1e-6)
    middles = np.array([line.mean(axis=0) for line in found.lines]).reshape(-1, 2)
    long = np.array([length(line) > 4.0 * pitch for line in found.lines], dtype=bool)
    assert shapely.covers(laid, shapely.points(middles[long])).all()
    assert len(paths) <= max(len(found.lines), 1)


def test_pieces_of_a_multipolygon_are_linked_apart():
    two = shapely.MultiPolygon([shapely.box(0, 0, 20, 10), shapely.box(30, 0, 50, 10)])
    paths = zigzag(two, 0.5, 1.0, 1.0, 0.7)
    assert len(paths) == 2
    assert two.covers(curves(paths))


def test_nothing_where_the_section_is_too_thin():
    assert zigzag(shapely.box(0.0, 0.0, 50.0, 0.9), 0.5, 1.0, 1.0, 0.0) == []
    assert zigzag(shapely.Polygon(), 0.5, 1.0, 1.0, 0.0) == []
