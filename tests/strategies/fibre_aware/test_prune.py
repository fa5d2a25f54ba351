from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing import Specimen, Strand
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.paths.toolpaths import MATRIX, Toolpaths
from ccfem.slicing.slicers import Planar
from ccfem.strategies.fibre_aware import cut_and_move
from ccfem.strategies.fibre_aware.judges import Goal, equilibria, most_merit, stiffness_judge
from ccfem.strategies.fibre_aware.path_profile import Profile
from ccfem.strategies.fibre_aware.prune import profiles, prune
from ccfem.strategies.fibre_aware.shortening import shorten
from ccfem.strategies.isocurve import Isocurve
from ccfem.strategies.zigzag import Zigzag

MACHINE = Machine()
SHORT = Machine(minimum_length=10.0)


def gain_of(keep, gain, least, cost):
    """Gain of one choice of pieces; minus infinity where a stretch is too short."""
    ends = np.flatnonzero(np.diff(np.concatenate([[0], keep, [0]])))
    sizes = ends[1::2] - ends[::2]
    if len(sizes) and sizes.min() < least:
        return -np.inf
    return float(np.sum(gain[np.array(keep, dtype=bool)]) - cost * max(len(sizes) - 1, 0))


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(0.0, 4.0), min_size=2, max_size=9),
    st.integers(1, 4),
    st.floats(0.0, 2.0),
)
def test_best_stretches_equal_the_best_of_all_choices(value, least, cut_cost):
    price, value = 1.0, np.array(value)
    keep, gain = Profile(0, value, 1.0, 0.0).kept(price, float(least), cut_cost)
    least = min(least, len(value))
    best = max(
        gain_of(choice, value - price, least, cut_cost * price)
        for choice in product((0, 1), repeat=len(value))
    )
    assert gain == pytest.approx(best, abs=1e-9)
    chosen = gain_of(keep.astype(int), value - price, least, cut_cost * price)
    assert chosen == pytest.approx(best, abs=1e-9)


def crossing_strands(layer):
    """Strands along the tension of the bar, and strands across it, which are shortened."""
    along = [np.array([[0.0, y], [60.0, y]]) for y in (3.0, 7.0, 13.0, 17.0)]
    across = [np.array([[x, 1.0], [x, 19.0]]) for x in (10.0, 30.0, 50.0)]
    return Toolpaths.from_plane([*across, *along], layer)


def test_what_carries_nothing_goes_first(pulled_bar):
    stress, layers = pulled_bar
    paths = Toolpaths.concatenate(crossing_strands(layer) for layer in layers)
    left = prune(paths, stress, 4 * 4 * 60.0, SHORT)
    assert len(left) == 16
    np.testing.assert_array_equal(np.unique(left.points[:, 1]), [3.0, 7.0, 13.0, 17.0])
    assert left.lengths.sum() == pytest.approx(960.0)
    before, after = (virtual_test(p, stress, span=()).ratio for p in (paths, left))
    assert after == pytest.approx(before, rel=1e-9)


def test_length_and_minimum_length_are_kept(bent_beam):
    stress, layers = bent_beam
    paths = plan(Isocurve(cap=50.0), layers, stress, SHORT)
    whole = paths.lengths.sum()
    ratios = [virtual_test(paths, stress, span=()).ratio]
    for share in (0.9, 0.7, 0.4):
        left = prune(paths, stress, share * whole, SHORT)
        assert 0.93 * share * whole < left.lengths.sum() <= share * whole
        assert left.lengths.min() >= 10.0 * (1.0 - 1e-9)
        ratios.append(virtual_test(left, stress, span=()).ratio)
    assert ratios[0] > ratios[1] > ratios[2] > ratios[3] > 1.0
    # What goes first is worth least: the first tenth costs less than its share of the gain.
    assert ratios[0] - ratios[1] < 0.5 * 0.1 * (ratios[0] - 1.0)


def test_pieces_lie_on_the_paths_given(bent_beam):
    stress, layers = bent_beam
    paths = plan(Isocurve(cap=50.0), layers, stress, SHORT)
    left = prune(paths, stress, 0.6 * paths.lengths.sum(), SHORT)
    for line, layer in zip(left, left.layer, strict=True):
        others = np.concatenate(list(paths.on_layer(layer)))
        inner = line[1:-1]
        distance = np.abs(inner[:, None] - others[None]).max(axis=2).min(axis=1)
        assert distance.max(initial=0.0) < 1e-9


def test_short_enough_is_left_alone(pulled_bar):
    stress, layers = pulled_bar
    paths = crossing_strands(layers[0])
    assert prune(paths, stress, paths.lengths.sum(), SHORT) is paths


def test_other_kinds_of_paths_stay(pulled_bar):
    stress, layers = pulled_bar
    rim = Toolpaths.from_plane([np.array([[1.0, 1.0], [59.0, 1.0]])], layers[0])
    rim = replace(rim, kind=np.array([MATRIX]))
    paths = Toolpaths.concatenate([rim, crossing_strands(layers[0])])
    left = prune(paths, stress, 120.0, SHORT)
    assert left.of_kind(MATRIX).lengths.sum() == pytest.approx(58.0)
    assert left.lengths.sum() - 58.0 <= 120.0


def test_ring_is_opened_where_it_is_worth_least(pulled_bar):
    stress, layers = pulled_bar
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    ring = np.column_stack([30.0 + 8.0 * np.cos(angle), 10.0 + 8.0 * np.sin(angle)])
    ring[-1] = ring[0]
    paths = Toolpaths.from_plane([ring], layers[0])
    assert paths.closed[0]
    strands = cut_strands(paths, stress.mesh)
    # Worth nothing within 5 mm of arc of the start and end of the ring, whose seam is there.
    whole = paths.lengths[0]
    value = np.where(np.minimum(strands.arc, whole - strands.arc) < 5.0, 0.0, 1.0)
    left = shorten(paths, profiles(paths, strands, value), whole - 9.0, 10.0)
    assert len(left) == 1
    assert not left.closed[0]
    assert left.lengths[0] == pytest.approx(whole - 10.0, abs=1.5)
    assert left.points[:, 0].max() < ring[:, 0].max() - 0.5
    # Its seam in the middle of what stays: one stretch, not two.
    half = np.where(np.abs(strands.arc - 0.5 * whole) < 5.0, 0.0, 1.0)
    left = shorten(paths, profiles(paths, strands, half), whole - 9.0, 10.0)
    assert len(left) == 1
    assert left.points[:, 0].min() > ring[:, 0].min() + 0.5


def test_links_outside_the_part_stay_links(pulled_bar):
    """Else the virtual test of what is left would take them for fibre outside the part."""
    stress, layers = pulled_bar
    line = np.array([[0, 5], [60, 5], [64, 5], [64, 15], [60, 15], [0, 15]], dtype=float)
    ring = np.array([[60, 8], [64, 8], [64, 12], [60, 12], [5, 12], [5, 8], [60, 8]], dtype=float)
    link = [np.array([0, 1, 1, 1, 0, 0], bool), np.array([1, 1, 1, 0, 0, 0, 0], bool)]
    across = [np.array([[x, 2.0], [x, 18.0]]) for x in (10.0, 50.0)]
    link += [np.zeros(2, bool)] * 2
    paths = Toolpaths.concatenate(
        Toolpaths.from_plane([line, ring, *across], layer, link=link) for layer in layers
    )
    left = prune(paths, stress, paths.lengths.sum() - len(layers) * 60.0, SHORT)
    assert not left.closed.any()  # rings are opened at their links, which carry nothing
    step = np.flatnonzero(np.linalg.norm(np.diff(left.points, axis=0), axis=1) > 0.0)
    step = step[~np.isin(step, left.offsets[1:] - 1)]
    middle = 0.5 * (left.points[step] + left.points[step + 1])
    np.testing.assert_array_equal(left.link[step], middle[:, 0] > 60.0)
    assert left.link.any()
    virtual_test(left, stress, span=())


def test_points_within_straight_steps_change_no_value(bent_beam):
    """A path is worth the same wherever its points lie: its work is spread over its length."""
    stress, layers = bent_beam
    a, b, c = np.array([[1.0, 3.3], [59.0, 20.1], [40.0, 22.5]])
    share = np.sort(np.random.default_rng(4).uniform(size=17))[:, None]
    few, many = np.stack([a, b, c]), np.concatenate([[a], a + share * (b - a), [b, c]])
    of_cell = np.random.default_rng(5).uniform(size=len(stress.mesh.cells))
    found = []
    for line in (few, many):
        paths = Toolpaths.from_plane([line], layers[1])
        strands = cut_strands(paths, stress.mesh)
        found += profiles(paths, strands, of_cell[strands.cell])
        work = (of_cell[strands.cell] * strands.length).sum()
        assert found[-1].value.sum() * found[-1].step == pytest.approx(work, rel=1e-5)
    np.testing.assert_allclose(found[1].value, found[0].value, rtol=1e-5)


@pytest.mark.parametrize("noise", [0.0, 1e-13])
@pytest.mark.parametrize("load", [1.0, 1e-4, 30.0])
def test_of_equally_good_fibre_the_last_goes_whatever_the_load_and_rounding(
    pulled_bar, noise, load
):
    stress, layers = pulled_bar
    line = np.array([[1.0, 4.0], [59.0, 4.0]])
    paths = Toolpaths.from_plane([line, line + np.array([0.0, 5.0])], layers[0])
    strands = cut_strands(paths, stress.mesh)
    rough = np.random.default_rng(1).normal(size=len(strands.path))
    left = shorten(paths, profiles(paths, strands, load * (1.0 + noise * rough)), 80.0, 10.0)
    np.testing.assert_allclose(left.lengths, [58.0, 22.0], atol=1e-9)
    assert left.points[2:, 0].min() == pytest.approx(1.0)


def test_room_that_no_whole_stretch_fits_is_used(pulled_bar):
    """Two stretches worth the same: what is left of the length goes to a part of the second."""
    stress, layers = pulled_bar
    lines = [np.array([[1.0, y], [59.0, y]]) for y in (4.0, 9.0)]
    paths = Toolpaths.from_plane(lines, layers[0])
    strands = cut_strands(paths, stress.mesh)
    # The second path is worth nothing in its middle: half of it, or all of it.
    dull = (strands.path == 1) & (np.abs(strands.arc - 29.0) < 4.0)
    left = shorten(paths, profiles(paths, strands, np.where(dull, 0.0, 1.0)), 100.0, 10.0)
    assert 98.0 < left.lengths.sum() <= 100.0


def test_cuts_that_save_little_are_not_made(pulled_bar):
    stress, layers = pulled_bar
    line = np.array([[0.0, 10.0], [60.0, 10.0]])
    paths = Toolpaths.from_plane([line, line + np.array([0.0, 3.0])], layers[0])
    strands = cut_strands(paths, stress.mesh)
    # A gap of 8 mm in the first path, and an end of the second worth a little more.
    value = np.where(strands.path == 1, np.where(strands.arc > 50.0, 0.2, 1.0), 1.0)
    value = np.where((strands.path == 0) & (np.abs(strands.arc - 30.0) < 4.0), 0.1, value)
    parted = shorten(paths, profiles(paths, strands, value), 112.5, 10.0, cut_cost=0.0)
    whole = shorten(paths, profiles(paths, strands, value), 112.5, 10.0, cut_cost=20.0)
    assert len(parted) == 3
    assert len(whole) == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"length": 0.0}, "length of fibre must be above 0 mm; got 0"),
        ({"length": 10.0, "rounds": 0}, "rounds must be at least 1; got 0"),
    ],
)
def test_impossible_requests_are_refused(pulled_bar, options, message):
    stress, layers = pulled_bar
    with pytest.raises(InputError, match=message):
        prune(crossing_strands(layers[0]), stress, machine=SHORT, **options)


def beam(moved):
    """A beam clamped at one end; its other end is pushed sideways, or moved by a support."""
    mesh = box_mesh((60.0, 24.0, 4.0), (12, 5, 2))
    supports = [Support("x_min")]
    if moved:
        supports.append(Support("x_max", "y", (0.0, 0.5, 0.0)))
    loads = {"tip": () if moved else (Force("x_max", (0, 50, 0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), tuple(supports), loads, order=1)
    return solve(problem, tolerance=1e-10)["tip"], Planar(count=2).cut(mesh)


def test_tests_of_a_prepared_part_find_the_same(rng):
    """Prepared for all paths, of which half are tested; held against a factorised part."""
    stress, layers = beam(moved=False)
    paths = plan(Isocurve(cap=60.0), layers, stress, SHORT)
    chosen = cut_strands(paths.select(rng.random(len(paths)) < 0.5), stress.mesh)
    direct, iterative = (Goal.of(Specimen.of(stress, name)) for name in ("superlu", "amg"))
    prepared = iterative.knowing(paths, Strand())
    assert direct.knowing(paths, Strand()) is direct
    assert prepared.prepared
    assert not iterative.prepared
    exact, near = (equilibria(goal, chosen, tolerance=1e-5) for goal in (direct, prepared))
    assert near.ratios[0] == pytest.approx(exact.ratios[0], rel=1e-6)
    np.testing.assert_allclose(
        near.displacements[0], exact.displacements[0], atol=1e-4 * exact.displacements[0].max()
    )


@pytest.mark.parametrize("moved", [False, True])
def test_no_choice_of_strands_is_stiffer_than_the_energy_allows(moved, rng):
    stress, layers = beam(moved)
    paths, goal = plan(Isocurve(cap=60.0), layers, stress, SHORT), Goal.of(stress)
    strands = cut_strands(paths, goal.mesh)
    whole = equilibria(goal, strands, tolerance=1e-9)
    # With all strands, their own displacement has the least energy: that of the equilibrium.
    everything = most_merit(goal, strands, strands.total, whole.displacements)
    assert everything == pytest.approx(whole.ratios[0], rel=1e-6)
    bounds = []
    for _ in range(4):
        chosen = paths.select(rng.random(len(paths)) < 0.5)
        length = float(chosen.lengths.sum())
        reached = equilibria(goal, cut_strands(chosen, goal.mesh), tolerance=1e-9)
        for near in (whole, reached):
            bounds.append(most_merit(goal, strands, length, near.displacements))
            assert reached.ratios[0] < bounds[-1]
    assert min(bounds) < everything


def test_what_cannot_be_stiffer_than_other_paths_is_given_up(bent_beam, monkeypatch):
    stress, layers = bent_beam
    length, goal, judge = 4 * 150.0, Goal.of(stress), stiffness_judge(stress, SHORT)
    curves = plan(Isocurve(cap=60.0), layers, stress, SHORT)
    rows = plan(Zigzag(angle=90.0, turn=0.0), layers, stress, SHORT)
    stiff, soft = (prune(paths, goal, length, SHORT) for paths in (curves, rows))
    assert judge(soft).value < judge(stiff).value
    assert not len(prune(rows, goal, length, SHORT, least=judge(stiff)))
    np.testing.assert_array_equal(
        prune(curves, goal, length, SHORT, least=judge(soft)).points, stiff.points
    )
    monkeypatch.setattr(cut_and_move, "exchanged", lambda paths, *about: (paths, about[-2]))
    for candidates in ([curves, rows], [rows, curves]):
        about = (candidates, layers, goal, length, SHORT, Strand(), cut_and_move.Cutting(2))
        kept = cut_and_move.prune_and_move(*about)
        np.testing.assert_array_equal(kept.points, stiff.points)
