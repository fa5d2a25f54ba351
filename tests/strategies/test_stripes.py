from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
import shapely

from ccfem.body.mesh.box import box_mesh
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity import GivenStress
from ccfem.machine import Machine
from ccfem.paths.folds import folds_in
from ccfem.paths.planning import plan
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create
from ccfem.strategies.stripes import Stripes

MACHINE = Machine()


def given(mesh, tensor, used=()):
    """Stress by a function of places (n, 3), or one tensor everywhere."""
    at = tensor if callable(tensor) else lambda places: np.tile(tensor, (len(places), 1, 1))
    return GivenStress(mesh, at(mesh.points[mesh.cells].mean(axis=1)), at(mesh.points), used, ())


def planned(mesh, tensor, used=(), **parameters):
    stress, layers = given(mesh, tensor, used), Planar(count=1).cut(mesh)
    return plan(create("stripes", parameters), layers, stress, MACHINE)


def pull(angle=0.0, size=1.0):
    way = np.array([np.cos(angle), np.sin(angle), 0.0])
    return size * np.outer(way, way)


def least_distance(paths):
    """Smallest distance of two paths in the plane, mm."""
    lines = [shapely.LineString(path[:, :2]) for path in paths]
    return min(shapely.distance(one, two) for one, two in combinations(lines, 2))


def test_a_pulled_plate_is_filled_with_straight_rows():
    used = ("x_min", "x_max")
    paths = planned(box_mesh((80.0, 20.0, 2.0), (20, 6, 1)), pull(), used)
    assert len(paths) in (19, 20)
    for path in paths:
        assert np.ptp(path[:, 1]) < 0.3
    assert paths.lengths.min() > 78.0
    assert least_distance(paths) > 0.85
    assert folds_in(paths, MACHINE).counts.sum() == 0


def test_strands_taken_over_move_to_where_another_layer_has_room():
    """A plate that widens by 1 % a mm of height: down, strands give way, and up, none is lost."""
    mesh = box_mesh((60.0, 20.0, 4.0), (15, 5, 2))
    wider = 1.0 + 0.01 * mesh.points[:, 2:]
    mesh = replace(mesh, points=np.hstack([mesh.points[:, :2] * wider, mesh.points[:, 2:]]))
    stress, layers = given(mesh, pull(), ("x_min", "x_max")), Planar(count=2).cut(mesh)
    stripes = Stripes()
    paths = plan(stripes, layers, stress, MACHINE)
    for source, layer in (layers, layers[::-1]):
        strands = paths.on_layer(source.index)
        taken = stripes.taken_over(strands, source, layer, MACHINE)
        assert (taken.layer == layer.index).all()
        lines = [shapely.LineString(layer.plane.project(path)) for path in taken]
        room = shapely.buffer(layer.plane.polygon, -0.39 * MACHINE.fibre_width)
        assert shapely.covers(room, lines).all()
        assert taken.lengths.sum() == pytest.approx(strands.lengths.sum(), rel=0.02)
        assert least_distance(taken) > 0.85
        assert folds_in(taken, MACHINE).counts.sum() == 0


def test_less_fibre_is_laid_where_the_tension_is():
    """Tension grows along the plate: half the fibre lies in its stronger half."""

    def tension(places):
        return (1.0 + places[:, 0])[:, None, None] * pull()

    mesh = box_mesh((100.0, 20.0, 2.0), (20, 6, 1))
    whole, half = (planned(mesh, tension, density=share) for share in (1.0, 0.5))
    assert half.lengths.sum() == pytest.approx(0.5 * whole.lengths.sum(), rel=0.05)
    assert half.lengths.min() >= MACHINE.minimum_length
    middle = np.array([path[:, 0].mean() for path in half])
    assert (middle > 70.0).all()


def test_strands_round_a_ring_are_circles():
    ring = shapely.Point(0.0, 0.0).buffer(22.0, quad_segs=16)
    ring = ring.difference(shapely.Point(0.0, 0.0).buffer(12.0, quad_segs=16))

    def hoop(places):
        way = np.column_stack([-places[:, 1], places[:, 0], np.zeros(len(places))])
        way /= np.linalg.norm(way, axis=1)[:, None]
        return way[:, :, None] * way[:, None, :]

    paths = planned(extrude(ring, 2.0, 2.0), hoop)
    assert paths.lengths.sum() > 0.85 * 2.0 * np.pi * 17.0 * 10.0
    for path in paths:
        assert np.ptp(np.hypot(path[:, 0], path[:, 1])) < 2.5


@pytest.mark.parametrize("tensor", [np.diag([1.0, 1.0, 0.0]), np.zeros((3, 3)), -pull()])
def test_without_a_direction_strands_follow_the_border(tensor):
    """Two equal principal stresses, none at all, and compression alone."""
    paths = planned(box_mesh((100.0, 12.0, 2.0), (25, 3, 1)), tensor)
    assert paths.lengths.sum() > 0.8 * 100.0 * 12.0
    for path in paths:
        inner = path[np.abs(path[:, 0] - 50.0) < 30.0]
        assert np.ptp(inner[:, 1]) < 1.0


def test_strands_run_into_a_border_that_is_held():
    """A short plate pulled across its long, held sides: strands end there, and follow no side."""
    mesh = box_mesh((30.0, 60.0, 2.0), (8, 16, 1))
    paths = planned(mesh, pull(0.5 * np.pi), used=("y_min", "y_max"))
    assert len(paths) in (29, 30)
    assert all(np.ptp(path[:, 0]) < 0.7 for path in paths)


def test_twenty_triangles_two_pieces_and_no_room():
    few = planned(box_mesh((50.0, 10.0, 2.0), (5, 2, 1)), pull())
    assert len(few) in (9, 10)
    one = box_mesh((60.0, 8.0, 2.0), (15, 2, 1))
    two = replace(one, points=one.points + np.array([0.0, 30.0, 0.0]))
    both = type(one)(
        np.concatenate([one.points, two.points]),
        np.concatenate([one.cells, two.cells + len(one.points)]),
    )
    paths = planned(both, pull())
    lower = np.array([path[:, 1].mean() < 20.0 for path in paths])
    assert lower.sum() in (7, 8)
    assert (~lower).sum() in (7, 8)
    assert len(planned(box_mesh((20.0, 20.0, 2.0), (4, 4, 1)), pull())) <= 4
    assert len(planned(box_mesh((60.0, 0.6, 2.0), (15, 1, 1)), pull())) == 0


def test_folds_cover_what_is_too_short_alone():
    """Rows of 30 mm are too short for the cutter; joined by links they are laid."""
    mesh = box_mesh((31.0, 24.0, 2.0), (8, 6, 1))
    used = ("x_min", "x_max", "y_min", "y_max")
    rows, joined = (planned(mesh, pull(), used=used, folds=fold) for fold in (False, True))
    assert folds_in(rows, MACHINE).counts.sum() == 0
    assert joined.lengths.sum() > 0.85 * 31.0 * 24.0
    assert joined.lengths.min() >= MACHINE.minimum_length
    assert joined.link.any()
