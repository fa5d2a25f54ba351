"""Areas, volumes and connected pieces against shapely, determinants and networkx."""

import networkx as nx
import numpy as np
import shapely

from ccfem.geometry.facets import connected, signed_areas, signed_volumes

RNG = np.random.default_rng(4)


def test_areas_are_those_of_polygons_with_the_sign_of_the_turn():
    points, triangles = (
        RNG.normal(size=(30, 2)),
        RNG.permuted(np.tile(np.arange(30), (50, 1)), axis=1),
    )
    triangles = triangles[:, :3]
    rings = shapely.linearrings(points[triangles])
    wanted = shapely.area(shapely.polygons(rings)) * np.where(shapely.is_ccw(rings), 1.0, -1.0)
    np.testing.assert_allclose(signed_areas(points, triangles), wanted, atol=1e-12)


def test_volumes_are_determinants():
    points, cells = RNG.normal(size=(40, 3)), RNG.integers(0, 40, (60, 4))
    wanted = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) / 6.0
    np.testing.assert_allclose(signed_volumes(points, cells), wanted, atol=1e-12)


def test_pieces_are_connected_components():
    pairs = RNG.integers(0, 60, (35, 2))
    graph = nx.Graph(pairs.tolist())
    graph.add_nodes_from(range(60))
    found = connected(pairs, 60)
    pieces = {frozenset(np.flatnonzero(found == k).tolist()) for k in np.unique(found)}
    assert pieces == set(map(frozenset, nx.connected_components(graph)))
    assert connected(np.zeros((0, 2), dtype=np.int64), 3).tolist() == [0, 1, 2]
