"""Tails that cross other strands steeply, stems that are shared, layers that are planned alike."""

import numpy as np
import pytest
import shapely

from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.slicing.layers.layer import stress_on
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.stress_tracing.band import band, extension
from ccfem.strategies.stress_tracing.frame import FREE, Frame, Member
from ccfem.strategies.stress_tracing.main_paths import MainPath, with_shared_stems
from ccfem.strategies.stress_tracing.tracks import tail_turns
from ccfem.strategies.svt import alike, apart


def straight(start, end, width, ends):
    """Straight member with parallel sides."""
    start, end = np.array(start, dtype=float), np.array(end, dtype=float)
    along = (end - start) / np.linalg.norm(end - start)
    points = start + np.arange(0.0, np.linalg.norm(end - start), 0.5)[:, None] * along
    aside = 0.5 * width * np.array([-along[1], along[0]])
    return Member(points, points + aside, points - aside, ends)


@pytest.mark.parametrize("turn", [0.5, -1.0])
def test_a_band_that_turns_keeps_its_width_and_its_inner_radius(turn):
    strip = np.column_stack([np.arange(0.0, 20.0, 0.5), *np.zeros((2, 40)), np.full(40, 3.0)])
    found = extension(np.column_stack([strip, np.ones(40)]), 40.0, turn)
    np.testing.assert_allclose(np.linalg.norm(found[:, 2:4], axis=1), 3.0, atol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(found[:, :2], axis=0), axis=1), 0.5, rtol=5e-3
    )
    heading = np.arctan2(*np.diff(found[-2:, :2], axis=0)[0, ::-1])
    assert heading == pytest.approx(turn, abs=1e-9)
    # The centre of the arc is 4 mm beyond the inner side: 7 mm aside of the middle.
    centre = [19.5, np.sign(turn) * 7.0]
    arc = found[: int(7.0 * abs(turn) / 0.5), :2]
    np.testing.assert_allclose(np.linalg.norm(arc - centre, axis=1), 7.0, rtol=1e-12)


def test_a_path_that_would_run_along_another_turns_away_from_it():
    """A diagonal meets a chord at 20 degrees; at 70 degrees it goes straight on."""
    chord = straight((0, 0), (100, 0), 8.0, (FREE, FREE))
    for angle, turns in ((20.0, True), (70.0, False)):
        way = np.array([np.cos(np.radians(angle)), -np.sin(np.radians(angle))])
        diagonal = straight(np.array([50.0, 0.0]) - 40.0 * way, (50, 0), 5.0, (FREE, 0))
        section = shapely.union_all(
            [
                shapely.box(0, -4, 100, 4),
                shapely.LineString([[50.0, 0.0] - 40.0 * way, [50, 0]]).buffer(2.5),
            ]
        )
        frame = Frame((chord, diagonal), np.array([[50.0, 0.0]]), np.array([5.0]))
        paths = [MainPath((chord,)), MainPath((diagonal,))]
        (none, no), (start, end) = tail_turns(paths, frame, 0.9, section)
        assert (none, no, start) == (0.0, 0.0, 0.0)
        # To the right, away from the direction of the chord.
        assert (end < -np.radians(10.0)) if turns else (end == 0.0)


def test_a_path_on_an_axis_of_symmetry_stays_there():
    """A post under a beam that strands of both sides bend down to: no side is better."""
    post = straight((50, -40), (50, 0), 5.0, (FREE, 0))
    sides = [straight((50 + 2 * x, -41), (50 + x, 4), 5.0, (FREE, FREE)) for x in (-3, 3)]
    section = shapely.box(0, -45, 100, 30)
    frame = Frame((post, *sides), np.array([[50.0, 0.0]]), np.array([5.0]))
    paths = [MainPath((member,)) for member in (post, *sides)]
    assert tail_turns(paths, frame, 0.9, section)[0] == (0.0, 0.0)


def test_two_paths_share_the_member_to_a_clamp():
    """Chord and diagonal run into one member: the one from above has its upper part."""
    stem = straight((0, 0), (20, 0), 10.0, (0, FREE))
    chord = straight((-40, 0), (0, 0), 6.0, (FREE, 0))
    way = np.array([np.cos(0.4), np.sin(0.4)])
    diagonal = straight(-40.0 * way, (0, 0), 4.0, (FREE, 0))
    frame = Frame((stem, chord, diagonal), np.array([[0.0, 0.0]]), np.array([5.0]))
    found = with_shared_stems([MainPath((chord, stem)), MainPath((diagonal,))], frame)
    upper, lower = (path.members[-1] for path in found)
    assert [len(path.members) for path in found] == [2, 2]
    np.testing.assert_allclose(upper.width, 6.0)
    np.testing.assert_allclose(lower.width, 4.0)
    np.testing.assert_allclose(upper.left, stem.left)
    np.testing.assert_allclose(lower.right, stem.right)
    np.testing.assert_allclose(upper.right, lower.left)
    # One that is much wider than the other is not squeezed for it.
    hair = straight(-40.0 * way, (0, 0), 1.0, (FREE, 0))
    paths = [MainPath((chord, stem)), MainPath((hair,))]
    assert with_shared_stems(paths, frame) == paths


def test_a_member_that_forks_goes_to_both_branches():
    stem = straight((0, 0), (20, 0), 10.0, (0, FREE))
    branches = [straight((-40, y), (0, 0), 4.0 if y > 0 else 6.0, (FREE, 0)) for y in (20.0, -20.0)]
    frame = Frame((stem, *branches), np.array([[0.0, 0.0]]), np.array([6.0]))
    paths = [MainPath((stem.reversed,)), *(MainPath((branch,)) for branch in branches)]
    found = with_shared_stems(paths, frame)
    assert [len(path.members) for path in found] == [2, 2]
    np.testing.assert_allclose([path.members[-1].width[0] for path in found], [4.0, 6.0])
    np.testing.assert_allclose(found[0].members[-1].left, stem.left)
    strip = band(found[0], frame)
    assert strip.middle[-1, 1] > 0.0


def test_layers_are_planned_alike_where_the_stress_has_the_same_directions():
    """A plate that is bent across its layers, and one that is pulled above and sheared below."""
    mesh = box_mesh((30.0, 10.0, 4.0), (12, 4, 4))
    layers = Planar(count=4).cut(mesh)

    def solved(*forces):
        loads = {"load": forces}
        problem = Problem(mesh, isotropic(3500.0, 0.3), (Support("x_min"),), loads, order=1)
        return solve(problem)["load"]

    bent = solved(Force("x_max", (0.0, 0.0, 20.0)))
    found = alike(layers, bent)
    assert len({layer.index for layer in found.values()}) == 1
    twisted = solved(Force("z_max", (0.0, 40.0, 0.0)), Force("z_min", (200.0, 0.0, 0.0)))
    found = alike(layers, twisted)
    first, *_, last = (stress_on(layer, twisted) for layer in layers)
    assert apart(first, first) == pytest.approx(0.0, abs=1e-12)
    assert apart(first, last) > 0.1
    assert found[layers[0].index] is not found[layers[-1].index]
