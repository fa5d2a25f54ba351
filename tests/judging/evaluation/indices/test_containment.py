"""Fibre a known way outside the part."""

import numpy as np
import pytest

from ccfem.judging.evaluation.indices.containment import containment_indices, sample_containment


def indices(paths):
    values = containment_indices(sample_containment(paths))
    return values["outside_length"], values["outside_depth"]


def test_inside_and_on_the_edge_is_inside(pulled):
    edge = [[0, 0], [60, 0], [60, 40], [0, 40], [0, 0]]
    assert indices(pulled.plane([[5, 5], [55, 35]], edge)) == (0.0, 0.0)
    assert indices(pulled.plane()) == (0.0, 0.0)
    # Rounding of coordinates is not outside.
    assert indices(pulled.plane(np.array(edge) + 5e-5)) == (0.0, 0.0)


def test_a_strand_that_leaves_the_part(pulled):
    length, depth = indices(pulled.plane([[30, 35], [30, 47]]))
    assert length == pytest.approx(7.0, abs=2e-4)
    assert depth == pytest.approx(7.0, abs=1e-4)


def test_a_strand_all_outside(pulled):
    length, depth = indices(pulled.plane([[0, -3], [60, -3]], [[5, 5], [9, 9]]))
    assert length == pytest.approx(60.0)
    assert depth == pytest.approx(3.0)


def test_the_depth_in_a_hole_is_that_of_the_worst_place_between_the_points(framed):
    assert framed.layers[0].plane.polygon.area == pytest.approx(60.0 * 40.0 - 20.0 * 10.0)
    length, depth = indices(framed.plane([[5, 20], [55, 20]]))
    assert length == pytest.approx(20.0, abs=3e-4)
    assert depth == pytest.approx(5.0, abs=2e-4)
    # Along the diagonal of the window the worst place is its middle.
    length, depth = indices(framed.plane([[20, 15], [40, 25]]))
    assert depth == pytest.approx(5.0, abs=2e-4)
    assert length == pytest.approx(np.hypot(20.0, 10.0), abs=1e-3)


def test_beyond_two_hundredths_of_a_millimetre(framed):
    length, depth = indices(framed.plane([[10, 15.02], [50, 15.02]], [[2, 2], [58, 2]]))
    assert length == pytest.approx(20.0, abs=3e-4)
    assert depth == pytest.approx(0.02, abs=1e-4)
