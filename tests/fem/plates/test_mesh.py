import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.fem.plates.mesh import PlaneMesh, Sheet, raster_mesh


def test_triangles_have_areas_and_neighbours():
    mesh = PlaneMesh([[0, 0], [2, 0], [2, 1], [0, 1]], [[0, 1, 2], [0, 2, 3]])
    np.testing.assert_allclose(mesh.areas, 1.0)
    np.testing.assert_array_equal(mesh.neighbours, [[0, 1]])
    assert len(mesh.boundary) == 4
    assert not mesh.congruent
    np.testing.assert_array_equal(mesh.nearest_nodes([[1.9, 0.9], [0, 0.1]]), [2, 0])


@pytest.mark.parametrize(
    ("points", "cells", "patches", "message"),
    [
        (np.zeros((3, 3)), [[0, 1, 2]], {}, r"shape \(n, 2\)"),
        (np.zeros((3, 2)), [[0, 1]], {}, r"\(m, 3\) or \(m, 4\)"),
        (np.zeros((3, 2)), [[0, 1, 3]], {}, "nodes 0 to 2"),
        (np.zeros((3, 2)), [[0, 1, 2]], {"a": [0, 1]}, "edges by their ends"),
    ],
)
def test_bad_meshes_are_refused(points, cells, patches, message):
    with pytest.raises(InputError, match=message):
        PlaneMesh(points, cells, patches)


def test_inner_edges_and_unknown_patches_are_refused():
    mesh = raster_mesh(np.ones((2, 2), dtype=bool))
    centre = mesh.nearest_nodes([[1.0, 1.0], [1.0, 0.0]])
    with pytest.raises(InputError, match="inside the part"):
        Sheet(mesh, np.ones(4)).facet_areas(centre[None])
    with pytest.raises(InputError, match="no patch named 'left'"):
        mesh.patch("left")
