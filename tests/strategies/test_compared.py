"""Strategies of others to compare with: offset, streamline, eqs."""

import numpy as np
import pytest
import shapely
import shapely.affinity

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.body.meshing import extrude
from ccfem.cases import create_case
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.geometry.polylines import until_itself
from ccfem.judging.evaluation import evaluate
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.slicing.layers import LayerStress
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create
from ccfem.strategies.offset import _level_sets

MACHINE = Machine(fibre_width=1.0, minimum_length=5.0)


@pytest.fixture(scope="module")
def bar():
    """Stress of a bar under uniform tension along x, and its one layer, 60 x 12 mm."""
    mesh = box_mesh((60.0, 12.0, 2.0), (30, 6, 1))
    problem = Problem(
        mesh,
        isotropic(3500.0, 0.0),
        (Support("x_min"),),
        {"pull": (Force("x_max", (100.0, 0.0, 0.0)),)},
    )
    return solve(problem)["pull"], Planar(count=1).cut(mesh)


@pytest.fixture(scope="module")
def holed():
    """Stress of a plate with a round hole, pulled along x, and its one layer."""
    case = create_case("open_hole")
    (stress,) = solve(case.problem).values()
    return stress, Planar(count=1).cut(case.problem.mesh, case.build)


def test_offset_lays_all_distances_to_the_border(bar) -> None:
    paths = plan(create("offset"), bar[1], bar[0], MACHINE)
    # Rectangles at 0.5, 1.5, ..., 5.5 mm inside 60 x 12 mm.
    expected = [2 * (60 - 2 * d) + 2 * (12 - 2 * d) for d in 0.5 + np.arange(6)]
    np.testing.assert_allclose(paths.lengths, expected, atol=1e-6)
    assert paths.closed.all()


def test_offset_rings_break_apart_at_a_neck_and_are_round_at_a_notch() -> None:
    bell = shapely.union_all(
        [shapely.box(0, 0, 20, 20), shapely.box(20, 8, 40, 12), shapely.box(40, 0, 60, 20)]
    )
    lines = _level_sets(bell, 0.5, 1.0)
    sizes = np.array([np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines])
    # One ring at 0.5 and one at 1.5 mm go through the neck of 4 mm, all others come in pairs.
    assert len(lines) == 2 + 2 * 8
    np.testing.assert_allclose(sizes[2::2], sizes[3::2])
    border = shapely.boundary(bell)
    levels = np.concatenate([[0.5, 1.5], np.repeat(np.arange(2.5, 10.0), 2)])
    for line, level in zip(lines, levels, strict=True):
        samples = shapely.get_coordinates(shapely.segmentize(shapely.LineString(line), 0.2))
        distance = shapely.distance(border, shapely.points(samples))
        np.testing.assert_allclose(distance, level, atol=0.002 * level)


@pytest.mark.parametrize("degrees", [33.0, 100.0, 217.0])
def test_offset_rings_begin_at_the_same_place_however_the_section_lies(degrees) -> None:
    """Where a ring begins decides which of two equal turns is cut."""
    hole = shapely.Point(4.0, 2.0).buffer(5.0)
    section = shapely.affinity.scale(shapely.Point(0.0, 0.0).buffer(20.0), 1.4).difference(hole)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    turned = shapely.transform(section, lambda points: points @ turn.T)
    begins, others = (
        np.array(sorted(line[0].tolist() for line in lines))
        for lines in (
            _level_sets(section, 0.5, 2.0),
            [line @ turn for line in _level_sets(turned, 0.5, 2.0)],
        )
    )
    np.testing.assert_allclose(others, begins, atol=1e-6)


def test_streamlines_of_a_bar_run_along_the_pull(bar) -> None:
    paths = plan(create("streamline"), bar[1], bar[0], MACHINE)
    heights = np.sort([path[:, 1].mean() for path in paths])
    assert len(heights) in (11, 12)
    np.testing.assert_allclose(np.diff(heights), 1.0, atol=2e-3)
    for path in paths:
        assert np.ptp(path[:, 1]) < 1e-3
        assert np.ptp(path[:, 0]) > 59.0 - 0.3


def test_streamlines_follow_the_stress_and_keep_apart(holed) -> None:
    stress, layers = holed
    paths = plan(create("streamline"), layers, stress, MACHINE)
    total = evaluate(paths, layers, stress, MACHINE).total
    assert total["efficiency"] > 0.98
    strings = [shapely.linestrings(path[:, :2]) for path in paths]
    tree = shapely.STRtree(strings)
    near, _ = tree.query(strings, predicate="dwithin", distance=0.49)
    assert len(near) == len(strings)


def test_eqs_lines_of_a_straight_seed_are_straight_and_equally_spaced(bar) -> None:
    paths = plan(create("eqs", {"seed": (30.0, 4.3)}), bar[1], bar[0], MACHINE)
    heights = np.sort([path[:, 1].mean() for path in paths])
    np.testing.assert_allclose(heights, 4.3 + np.arange(-3, 8), atol=1e-3)
    for path in paths:
        assert np.ptp(path[:, 1]) < 1e-3
        assert np.ptp(path[:, 0]) == pytest.approx(59.0, abs=0.01)


def test_eqs_lines_lie_at_multiples_of_the_spacing_from_the_seed() -> None:
    """Round a quarter of a ring under stress along it: arcs about the same centre."""
    sector = shapely.Point(0, 0).buffer(30.0, quad_segs=64) - shapely.Point(0, 0).buffer(18.0)
    layer = Planar(count=1).cut(extrude(sector & shapely.box(0, 0, 40, 40), 1.0, 1.5, 1))[0]
    x, y = layer.plane.points.T
    around = np.stack([-y, x], axis=1) / np.hypot(x, y)[:, None]
    nodal = np.zeros((len(x), 3, 3))
    nodal[:, :2, :2] = around[:, :, None] * around[:, None, :]
    stress = LayerStress(layer, nodal[layer.triangles].mean(axis=1), nodal)
    paths = create("eqs", {"spacing": 2.0, "seed": (17.0, 17.0)})(layer, stress, MACHINE)
    radius = [np.linalg.norm(path[:, :2], axis=1) for path in paths]
    for each in radius:
        assert np.ptp(each) < 0.05
    off = np.sort([each.mean() for each in radius]) - np.hypot(17.0, 17.0)
    np.testing.assert_allclose(off, [-4.0, -2.0, 0.0, 2.0, 4.0], atol=0.05)


def test_eqs_lines_keep_to_their_members() -> None:
    """Two bars that cross: the lines of one end where they would run across the other."""
    cross = shapely.box(-30, -5, 30, 5) | shapely.box(-5, -30, 5, 30)
    layer = Planar(count=1).cut(extrude(cross, 1.0, 2.0, 1))[0]
    x, y = layer.plane.points.T
    nodal = np.zeros((len(x), 3, 3))
    nodal[:, 0, 0] = np.where(np.abs(y) <= 5.0, 2.0, 0.0)
    nodal[:, 1, 1] = np.where(np.abs(y) > 5.0, 1.0, 0.0)
    stress = LayerStress(layer, nodal[layer.triangles].mean(axis=1), nodal)
    paths = create("eqs", {"seed": (0.0, 0.0)})(layer, stress, MACHINE)
    level = [path for path in paths if np.ptp(path[:, 1]) < 0.1]
    upright = [path for path in paths if np.ptp(path[:, 0]) < 1.0 and np.ptp(path[:, 1]) > 10.0]
    assert len(level) in (9, 10, 11)
    assert len(upright) >= 16
    assert len(level) + len(upright) >= 0.9 * len(paths)
    assert all(np.abs(path[:, 1]).min() > 4.0 for path in upright)


@pytest.mark.parametrize("name", ["offset", "streamline", "eqs"])
def test_bad_parameters_are_refused(name) -> None:
    with pytest.raises(InputError, match="spacing"):
        create(name, {"spacing": 0.5})
    with pytest.raises(InputError, match="minimum_length"):
        create(name, {"minimum_length": -1.0})


def test_a_seed_line_stops_where_it_meets_itself() -> None:
    """An inward spiral, 2 mm from turn to turn, then 0.5 mm: what is laid keeps the width."""
    angle = np.linspace(0.0, 10.0 * np.pi, 4000)
    radius = np.where(angle < 4 * np.pi, 20.0 - angle / np.pi, 17.0 - 0.25 * angle / np.pi)
    line = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    kept = until_itself(line, line[0], 1.0)
    # At t half turns the third turn lies 5 - 0.75 t mm inside the second: 1 mm at t = 16 / 3.
    assert len(kept) == pytest.approx(4000 * 16.0 / 30.0, abs=3)
    assert until_itself(line[:1600], line[800], 1.0) == pytest.approx(line[:1600])
    ring = np.concatenate([20.0 * line[:801] / radius[:801, None]])
    ring[-1] = ring[0]
    assert len(until_itself(ring, ring[100], 1.0)) == len(ring)


@pytest.mark.parametrize("name", ["streamline", "eqs"])
def test_lines_keep_the_fibre_width(holed, name) -> None:
    stress, layers = holed
    paths = plan(create(name), layers, stress, MACHINE)
    total = evaluate(paths, layers, stress, MACHINE).total
    assert total["spacing_1"] >= 0.99
