"""What fibre leaves open of a section, on strips whose areas are known."""

import numpy as np
import pytest
import shapely

from ccfem.body.meshing import extrude
from ccfem.judging.evaluation.layer_paths import plane_paths
from ccfem.judging.evaluation.open_places import open_places
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar


def test_narrow_gaps_and_wide_places_are_told_apart():
    """A box 40 x 10 with strands 1 wide: six side by side, a gap of .4, and 3.6 mm left open."""
    layer = Planar(count=1).cut(extrude(shapely.box(0, 0, 40, 10), 1.0, 5.0, 1))[0]
    heights = (*(np.arange(6) + 0.5), 6.9)
    lines = [np.array([[0.0, y], [40.0, y]]) for y in heights]
    paths = plane_paths(Toolpaths.from_plane(lines, layer), layer)
    found = open_places(paths, 1.0)
    assert found.narrow == pytest.approx(0.04, abs=1e-3)
    assert found.wide == pytest.approx(0.26, abs=1e-3)
    (place,) = found.places
    assert place.area == pytest.approx(104.0, rel=0.01)
    assert 7.4 < place.y < 10.0
    every = (*heights, 7.9, 8.9, 9.5)
    lines = [np.array([[0.0, y], [40.0, y]]) for y in every]
    full = open_places(plane_paths(Toolpaths.from_plane(lines, layer), layer), 1.0)
    assert full.places == ()
    assert full.narrow == pytest.approx(0.04, abs=1e-3)
