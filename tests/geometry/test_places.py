"""Places about a section with a window, and about two pieces."""

import numpy as np
import pytest
import shapely

from ccfem.geometry.shapes import INSIDE, OUTSIDE, VOID, cut_at_section, section_places

FRAME = shapely.box(0.0, 0.0, 60.0, 40.0).difference(shapely.box(20.0, 15.0, 40.0, 25.0))


def test_points_in_the_section_in_its_window_and_outside():
    points = np.array([[5, 5], [30, 20], [70, 20], [30, 39], [20.1, 15.1], [60, 40], [-1, 20]])
    expected = [INSIDE, VOID, OUTSIDE, INSIDE, VOID, INSIDE, OUTSIDE]
    assert section_places(points, FRAME).tolist() == expected
    # Rounding of coordinates is inside; more is not.
    edge = np.array([[60.00005, 10.0], [60.001, 10.0], [20.00005, 20.0], [20.001, 20.0]])
    assert section_places(edge, FRAME).tolist() == [INSIDE, OUTSIDE, INSIDE, VOID]


def test_an_island_in_a_window_is_inside_and_a_gap_between_pieces_is_outside():
    island = FRAME.union(shapely.box(28.0, 18.0, 32.0, 22.0))
    assert section_places(np.array([[30.0, 20.0], [25.0, 20.0]]), island).tolist() == [INSIDE, VOID]
    apart = shapely.box(0, 0, 10, 10).union(shapely.box(20, 0, 30, 10))
    assert section_places(np.array([[15.0, 5.0], [25.0, 5.0]]), apart).tolist() == [OUTSIDE, INSIDE]


def test_a_step_through_a_window_and_out_is_cut_where_it_crosses():
    starts, ends = np.array([[10.0, 20.0], [5.0, 5.0]]), np.array([[70.0, 20.0], [5.0, 9.0]])
    pieces = cut_at_section(starts, ends, FRAME)
    assert pieces.step.tolist() == [0, 0, 0, 0, 1]
    assert pieces.place.tolist() == [INSIDE, VOID, INSIDE, OUTSIDE, INSIDE]
    length = np.hypot(*(ends - starts).T)[pieces.step] * (pieces.end - pieces.begin)
    assert length == pytest.approx([10.0, 20.0, 20.0, 10.0, 4.0], abs=3e-4)


def test_pieces_fill_their_steps_and_agree_with_exact_intersections():
    rng = np.random.default_rng(3)
    starts, ends = rng.uniform(-20.0, 80.0, (2, 200, 2))
    pieces = cut_at_section(starts, ends, FRAME, tolerance=1e-7)
    length = np.hypot(*(ends - starts).T)
    piece = length[pieces.step] * (pieces.end - pieces.begin)
    assert np.bincount(pieces.step, piece) == pytest.approx(length)
    lines = shapely.linestrings(np.stack([starts, ends], axis=1))
    void = shapely.box(20.0, 15.0, 40.0, 25.0)
    for place, area in ((INSIDE, FRAME), (VOID, void)):
        exact = shapely.length(shapely.intersection(lines, area))
        found = np.bincount(pieces.step, piece * (pieces.place == place))
        assert found == pytest.approx(exact, abs=1e-5)


def test_steps_along_the_boundary_and_of_no_length():
    edge = cut_at_section(np.array([[0.0, 0.0]]), np.array([[60.0, 0.0]]), FRAME)
    assert edge.place.tolist() == [INSIDE]
    none = cut_at_section(np.zeros((0, 2)), np.zeros((0, 2)), FRAME)
    assert len(none.step) == 0
