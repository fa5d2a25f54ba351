"""Sections as their corners alone."""

import numpy as np
import pytest
import shapely
from shapely import affinity

from ccfem.cases import create_case
from ccfem.geometry.shapes import areas, corners_only
from ccfem.slicing.slicers.planar import Planar

L_SHAPE = shapely.Polygon([(0, 0), (30, 0), (30, 10), (10, 10), (10, 30), (0, 30)])


def test_points_on_straight_sides_go_and_corners_stay():
    hole = shapely.Point(5, 5).buffer(3, quad_segs=8)
    section = L_SHAPE - hole
    fine = affinity.rotate(shapely.segmentize(section, 0.7), 33.0, origin=(0, 0))
    found = corners_only(fine)
    assert [len(ring.coords) - 1 for ring in (found.exterior, *found.interiors)] == [6, 32]
    assert found.symmetric_difference(fine).area < 1e-6


def test_neither_start_of_the_ring_nor_order_of_parts_matters():
    turned = shapely.Polygon(np.roll(np.array(L_SHAPE.exterior.coords)[:-1], 3, axis=0))
    far = affinity.translate(turned, 100.0, 0.0)
    one = corners_only(shapely.MultiPolygon([L_SHAPE, far]))
    other = corners_only(shapely.MultiPolygon([far, turned]))
    assert one == other
    assert one.area == 2.0 * L_SHAPE.area


def test_a_section_of_no_width_is_empty():
    assert corners_only(shapely.Polygon()).is_empty
    assert corners_only(shapely.Polygon([(0, 0), (5, 0), (9, 0)])).is_empty


def test_layers_of_an_extruded_part_are_equal():
    case = create_case("open_hole", element_size=4.0)
    layers = Planar(count=4).cut(case.problem.mesh, case.build)
    assert not layers[0].plane.polygon.equals_exact(layers[1].plane.polygon, 0.0)
    assert len({corners_only(layer.plane.polygon) for layer in layers}) == 1


def test_lines_in_a_region_stop_no_further_operation():
    """A union that leaves a line where areas touch, cut with a union of nothing."""
    square, line = shapely.box(0.0, 0.0, 2.0, 3.0), shapely.LineString([(2.0, 0.0), (5.0, 0.0)])
    mixed = shapely.geometrycollections([square, line])
    both = shapely.intersection(areas(shapely.union_all([])), areas(mixed))
    assert both.is_empty
    assert areas(mixed).area == pytest.approx(6.0)
