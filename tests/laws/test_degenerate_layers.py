"""Input at the edge of sense for curved layers: an answer, or one line that says the cure."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError, SolveError
from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.mesh.patches import Cylinder, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity import GivenStress
from ccfem.judging.evaluation import evaluate
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.printing.curved_stack import layer_matrix
from ccfem.slicing.layers.level_surfaces import level_surfaces
from ccfem.slicing.slicers import Spatial
from ccfem.strategies import create

MACHINE = Machine()
HOLES = np.array([[16.0, 12.0], [50.0, 12.0]])
APART = 60.0


def along_x(mesh, used=(), loaded=(), direction=(1.0, 0.0, 0.0)):
    """Tension of 1 MPa along x, or another direction."""
    unit = np.asarray(direction) / np.linalg.norm(direction)
    one = np.outer(unit, unit)
    cells, nodes = len(mesh.cells), len(mesh.points)
    return GivenStress(mesh, np.tile(one, (cells, 1, 1)), np.tile(one, (nodes, 1, 1)), used, loaded)


def link(y=0.0):
    """66 x 24 x 4 mm with two holes."""
    outline = shapely.box(0.0, 0.0, 66.0, 24.0)
    for hole in HOLES:
        outline = outline.difference(shapely.Point(hole).buffer(4.5, quad_segs=12))
    mesh = extrude(outline, 4.0, 3.0)
    return replace(mesh, points=mesh.points + np.array([0.0, y, 0.0]))


@pytest.fixture(scope="module")
def pair():
    """Two links that do not touch, bent up by 1.5 mm in the middle, and a layer through both."""
    one, other = link(), link(APART)
    points = np.concatenate([one.points, other.points])
    cells = np.concatenate([one.cells, other.cells + len(one.points)])
    height = points[:, 2].copy()
    points[:, 2] += 1.5 * np.sin(np.pi * points[:, 0] / 66.0)
    rules = {
        f"hole_{k}_{n}": Cylinder((x, y + n * APART, 0.0), "z", 4.5)
        for k, (x, y) in enumerate(HOLES)
        for n in (0, 1)
    }
    mesh = patches_from_rules(TetMesh(points, cells), rules)
    found = level_surfaces(mesh, height, np.array([2.2]), 0.5, 0.6, 5.0)
    return along_x(mesh, tuple(rules)), found.layers


def test_a_layer_of_two_pieces_gets_strands_round_the_joints_of_each(pair):
    stress, layers = pair
    assert layers[0].component.max() == 1
    paths = plan(create("winding", {"weight": "stress"}), layers, stress, MACHINE)
    middle = np.array([path[:, 1].mean() for path in paths])
    first, second = (paths.select(side) for side in (middle < 42.0, middle > 42.0))
    assert len(first) == len(second) >= 2
    np.testing.assert_allclose(np.sort(first.lengths), np.sort(second.lengths), rtol=0.01)
    for path in paths:
        ring = shapely.Polygon(path[:, :2])
        own = HOLES + np.array([0.0, APART * (path[:, 1].mean() > 42.0)])
        assert all(ring.contains(shapely.Point(hole).buffer(4.3)) for hole in own)
    total = evaluate(paths, layers, stress, MACHINE).total
    assert total["crossings"] == total["self_crossings"] == 0
    assert total["head_collision"] == 0.0
    assert total["joints_linked"] == pytest.approx(2.0)


def test_strategies_of_the_plane_and_the_matrix_fill_both_pieces(pair):
    stress, layers = pair
    for paths in (
        plan(create("concentric"), layers, stress, MACHINE),
        layer_matrix(layers, MACHINE),
    ):
        piece = np.array([path[:, 1].mean() > 42.0 for path in paths])
        laid = [paths.lengths[piece == side].sum() for side in (False, True)]
        assert laid[0] == pytest.approx(laid[1], rel=0.02)
        assert min(laid) > 500.0


def with_slivers(mesh, share):
    """Move an inner node so near to a side that a cell keeps that share of its height."""
    inside = (np.abs(mesh.points[:, 1:] - 6.0) < 3.1).all(axis=1)
    node = int(np.flatnonzero(inside & (np.abs(mesh.points[:, 0] - 20.0) < 8.0))[0])
    cell = mesh.cells[(mesh.cells == node).any(axis=1)][0]
    target = mesh.points[cell[cell != node]].mean(axis=0)
    points = mesh.points.copy()
    points[node] = target + share * (mesh.points[node] - target)
    return TetMesh(points, mesh.cells)


def test_slivers_leave_the_layers_where_they_were_or_are_named():
    """Gradients in cells without volume blow up."""
    mesh, build = box_mesh((40.0, 12.0, 12.0), (12, 4, 4)), (0.0, 0.0, 1.0)
    thin = with_slivers(mesh, 1e-3)
    assert thin.volumes.min() < 2e-3 * thin.volumes.mean()
    slicer = Spatial(lines="all", count=5)
    for direction in ((1.0, 0.0, 0.0), (1.0, 0.3, 0.2)):
        clean = slicer(along_x(mesh, direction=direction), build, MACHINE)
        found = slicer(along_x(thin, direction=direction), build, MACHINE)
        assert len(found) == len(clean) == 5
        for one, other in zip(clean, found, strict=True):
            assert other.areas.sum() == pytest.approx(one.areas.sum(), rel=0.02)
            assert np.isfinite(other.points).all()
    thinner = with_slivers(mesh, 1e-6)
    assert len(slicer(along_x(thinner), build, MACHINE)) == 5
    with pytest.raises(SolveError, match="are there cells without volume") as caught:
        slicer(along_x(thinner, direction=(1.0, 0.3, 0.2)), build, MACHINE)
    assert "\n" not in str(caught.value)


def test_a_part_without_any_joint_says_what_to_name():
    mesh = box_mesh((40.0, 12.0, 12.0), (12, 4, 4))
    with pytest.raises(InputError) as caught:
        Spatial().slice(along_x(mesh))
    assert "\n" not in str(caught.value)
    assert "joints" in str(caught.value)
    with pytest.raises(InputError, match="no patch") as caught:
        Spatial(joints=("bolt",)).slice(along_x(mesh))
    assert "\n" not in str(caught.value)
