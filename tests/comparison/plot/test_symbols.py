"""Symbols stand outside of the part, where they are seen, and spread over what they mark."""

import numpy as np

from ccfem.comparison.plot.symbols import arrow_outside, spread


def square(height):
    """Two triangles of a square of 2 mm at a height."""
    a, b, c, d = ([x, y, height] for x, y in ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)))
    return np.array([[a, b, c], [a, c, d]])


SLAB = np.concatenate([square(5.0), square(2.0)])
"""Upper and lower side of a slab of 3 mm."""


def test_what_pulls_begins_at_the_part_and_what_presses_ends_there():
    for height, force, wanted, presses in (
        (5.0, 7.0, (5.0, 8.0), False),
        (5.0, -7.0, (8.0, 5.0), True),
        (2.0, 7.0, (-1.0, 2.0), True),
        (4.0, 7.0, (5.0, 8.0), False),  # at a pin within: out where that is nearer
        (4.0, -7.0, (8.0, 5.0), True),
        (3.0, -7.0, (2.0, -1.0), False),
    ):
        place = np.array([1.2, 0.7, height])
        ends, free_tail = arrow_outside(place, np.array([0, 0, force]), 3.0, SLAB)
        np.testing.assert_allclose(ends, [[1.2, 0.7, z] for z in wanted])
        assert free_tail is presses


def test_a_force_along_a_face_begins_there():
    ends, presses = arrow_outside(np.array([1.2, 0.7, 5.0]), np.array([4.0, 0, 0]), 3.0, SLAB)
    np.testing.assert_allclose(ends, [[1.2, 0.7, 5.0], [4.2, 0.7, 5.0]])
    assert not presses


def test_places_are_spread_over_all():
    line = np.stack([np.arange(11.0), np.zeros(11), np.zeros(11)], axis=1)
    assert sorted(spread(line, 3).tolist()) == [0, 5, 10]
    assert len(spread(line[:2], 5)) == 2
