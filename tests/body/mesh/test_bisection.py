"""Cells halved at their longest edges."""

import numpy as np

from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.mesh.bisection import bisected
from ccfem.geometry.facets import are_among


def test_pieces_fill_their_cells_and_fit_together():
    """Six times over, a tenth of the cells: no node hangs, nothing is lost, no cell gets flat."""
    mesh, generator = box_mesh((4.0, 3.0, 2.0), (2, 2, 1)), np.random.default_rng(0)
    first, areas = mesh.aspects.max(), {n: areas_of(mesh, n).sum() for n in mesh.patches}
    for _ in range(6):
        finer, parent = bisected(mesh, generator.random(len(mesh.cells)) < 0.1)
        assert finer.flaw == ""
        np.testing.assert_allclose(np.bincount(parent, finer.volumes), mesh.volumes)
        np.testing.assert_array_equal(finer.points[: len(mesh.points)], mesh.points)
        mesh = finer
    assert len(mesh.cells) > 200
    assert mesh.aspects.max() < 5 * first
    for name, area in areas.items():
        assert are_among(mesh.patches[name], mesh.boundary).all()
        np.testing.assert_allclose(areas_of(mesh, name).sum(), area)


def areas_of(mesh, name):
    return mesh.facet_areas(mesh.patches[name])[0]


def test_one_cell_is_halved_at_its_longest_edge():
    points = np.array([[0, 0, 0], [3, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    patches = {"low": np.array([[0, 2, 1]]), "side": np.array([[0, 3, 2]])}
    mesh = TetMesh(points, np.array([[0, 1, 2, 3]]), patches)
    finer, parent = bisected(mesh, np.array([True]))
    np.testing.assert_array_equal(parent, [0, 0])
    # Edges 12 and 13 are both the longest: the one or the other is cut.
    assert finer.points[4, 0] == 1.5
    assert len(finer.patches["side"]) == 1
    assert (len(finer.patches["low"]) == 2) == (finer.points[4, 1] == 0.5)
    same, parent = bisected(mesh, np.array([False]))
    np.testing.assert_array_equal(same.cells, mesh.cells)
    np.testing.assert_array_equal(parent, [0])


def test_patches_without_facets_stay_empty():
    mesh = box_mesh((2.0, 1.0, 1.0), (2, 1, 1))
    mesh = mesh.with_patches({"inside": np.zeros((0, 3), dtype=np.int64)})
    finer, _ = bisected(mesh, np.ones(len(mesh.cells), dtype=bool))
    assert finer.patches["inside"].shape == (0, 3)
