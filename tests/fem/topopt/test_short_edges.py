"""Short edges of an outline are left out; walls and points to keep stay."""

import numpy as np
import pytest
import shapely

from ccfem.body.meshing.planform import extrude
from ccfem.fem.topopt.flat_part import without_short_edges

WHOLE = shapely.box(0, 0, 40, 20)
CUT = shapely.Polygon(
    [(0, 0), (40, 0), (40, 12), (39.9995, 12.0005), (25, 17), (24.9995, 17.001), (5, 20), (0, 20)]
)


def test_only_what_is_short_is_left_out():
    found = without_short_edges(CUT, WHOLE, np.zeros((0, 2)), 0.05)
    corners = shapely.get_coordinates(found.exterior)[:-1].tolist()
    for wall in ([0, 0], [40, 0], [40, 12], [5, 20], [0, 20]):
        assert wall in corners
    assert len(corners) == 6
    assert shapely.symmetric_difference(found, CUT).area < 0.02
    kept = without_short_edges(CUT, WHOLE, np.array([[39.9995, 12.0005], [40.0, 12.0]]), 0.05)
    assert [39.9995, 12.0005] in shapely.get_coordinates(kept.exterior).tolist()
    assert shapely.equals(without_short_edges(found, WHOLE, np.zeros((0, 2)), 0.05), found)


def test_its_mesh_has_no_slivers():
    before, after = (
        extrude(outline, 2.0, 2.0, 1)
        for outline in (CUT, without_short_edges(CUT, WHOLE, np.zeros((0, 2)), 0.05))
    )
    flattest = [float(mesh.aspects.max()) for mesh in (before, after)]
    assert flattest[0] > 1000.0
    assert flattest[1] < 20.0
    assert after.volumes.sum() == pytest.approx(before.volumes.sum(), rel=1e-4)
