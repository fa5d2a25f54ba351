import numpy as np
import pytest
import shapely

from ccfem.geometry.hatch import zigzag
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.polylines import straight_pieces
from ccfem.geometry.shapes import bands, strings

WIDTH, ARC = 0.8, 4


@pytest.mark.parametrize("sides", [(15.0, 12.0), (4.5, 6.0), (5.0, 14.5)])
def test_rows_side_by_side_cover_what_their_straight_pieces_cover(sides):
    """Shapely's own buffer of these rows crosses itself; that of a single piece is a stadium."""
    section = shapely.box(0.0, 0.0, *sides)
    (wall,) = offset_rings(section, 0.5 * WIDTH, WIDTH, WIDTH, 1)
    rows = [*wall, *zigzag(section, 1.25 * WIDTH, WIDTH, WIDTH, np.radians(45.0))]
    together = shapely.multilinestrings(strings(rows))
    assert not shapely.buffer(together, 0.5 * WIDTH, quad_segs=ARC).is_valid
    (band,) = bands([together], 0.5 * WIDTH, quad_segs=ARC)
    assert band.is_valid
    pieces = shapely.linestrings(straight_pieces(rows))
    stadia = shapely.union_all(shapely.buffer(pieces, 0.5 * WIDTH, quad_segs=ARC))
    gaps, expected = (section.difference(covered).area for covered in (band, stadia))
    assert gaps == pytest.approx(expected, abs=1e-3 * section.area)


def test_lines_that_lie_apart_have_the_buffer_of_shapely():
    lines = shapely.linestrings([[[0, 0], [4, 0]], [[0, 3], [4, 3]]])
    np.testing.assert_array_equal(bands(lines, 0.5), shapely.buffer(lines, 0.5))
