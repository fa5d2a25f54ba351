"""Fibre that turns too tightly, cut where it is worth least."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.judging.evaluation import evaluate
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.strategies.fibre_aware.path_profile import Profile
from ccfem.strategies.fibre_aware.prune import prune
from ccfem.strategies.fibre_aware.shortening import shorten, shorten_bent, tight_share
from ccfem.strategies.isocurve import Isocurve

MACHINE = Machine(minimum_length=10.0)


def hairpin(at, turn=1.5, leg=30.0):
    """Two straight legs and the half circle between them."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 25)
    arc = np.column_stack([at[0] + leg + turn * np.cos(angle), at[1] + turn * np.sin(angle)])
    ends = np.array([[at[0], at[1] - turn], [at[0], at[1] + turn]])
    return np.concatenate([ends[:1], arc, ends[1:]])


def even(paths, values):
    """Profiles of paths that are each worth the same all along."""
    counts = np.ceil(paths.lengths).astype(int)
    return [
        Profile(k, np.full(n, value), length / n, 0.0)
        for k, (n, value, length) in enumerate(zip(counts, values, paths.lengths, strict=True))
    ]


def test_all_bends_go_and_all_legs_stay(bent_beam):
    layer = bent_beam[1][0]
    paths = Toolpaths.from_plane([hairpin((10.0, y)) for y in (4.0, 10.0, 16.0)], layer)
    assert tight_share(paths, MACHINE) > 0.05
    left = shorten_bent(paths, even(paths, (1.0, 2.0, 3.0)), 1e3, MACHINE, 0.0)
    assert tight_share(left, MACHINE) == 0.0
    assert len(left) == 6
    # Bends of 1.5 pi mm; the last width of a strand has no curvature, and pieces are a mm long.
    gone = paths.lengths.sum() - left.lengths.sum()
    assert 3 * (1.5 * np.pi - 2.0) < gone < 3 * (1.5 * np.pi + 4.0)


def test_the_bends_of_most_value_stay(bent_beam):
    layer = bent_beam[1][0]
    paths = Toolpaths.from_plane([hairpin((10.0, y)) for y in (4.0, 10.0, 16.0)], layer)
    whole = tight_share(paths, MACHINE)
    left = shorten_bent(paths, even(paths, (1.0, 3.0, 2.0)), 1e3, MACHINE, 0.4 * whole)
    assert 0.2 * whole < tight_share(left, MACHINE) <= 0.4 * whole
    assert len(left) == 5
    assert left.lengths.max() == pytest.approx(paths.lengths[1])
    whole = left.offsets[np.argmax(left.lengths)]
    assert left.points[whole, 1] == pytest.approx(8.5)


def test_legs_too_short_to_stand_alone_go_with_their_bend(bent_beam):
    layer = bent_beam[1][0]
    paths = Toolpaths.from_plane([hairpin((10.0, 10.0), leg=8.0), hairpin((30.0, 10.0))], layer)
    left = shorten_bent(paths, even(paths, (5.0, 1.0)), 1e3, MACHINE, 0.0)
    assert len(left) == 2
    assert left.points[:, 0].min() > 29.0


def test_a_ring_is_cut_at_bends_over_its_start_too(bent_beam):
    layer = bent_beam[1][0]
    turn = hairpin((15.0, 10.0))
    ring = np.concatenate([turn, [[13.5, 10.0]], turn[:1]])
    paths = Toolpaths.from_plane([ring], layer)
    assert paths.closed[0]
    for origin in (0.0, 20.0, 40.0):
        n = int(np.ceil(paths.lengths[0]))
        profile = Profile(0, np.ones(n), paths.lengths[0] / n, origin)
        left = shorten_bent(paths, [profile], 1e3, MACHINE, 0.0)
        assert tight_share(left, MACHINE) == 0.0
        assert left.lengths.sum() > 46.0


def test_share_is_that_of_the_evaluator(bent_beam):
    stress, layers = bent_beam
    paths = plan(Isocurve(cap=50.0), layers, stress, MACHINE)
    judged = 1.0 - evaluate(paths, layers, stress, MACHINE).total["curvature_ok"]
    assert 0.0 < tight_share(paths, MACHINE) == pytest.approx(judged, abs=1e-12)
    assert tight_share(Toolpaths.empty(), MACHINE) == 0.0


def test_fibre_that_carries_nothing_loses_its_bends_alone(bent_beam):
    layer = bent_beam[1][0]
    paths = Toolpaths.from_plane([hairpin((10.0, y)) for y in (4.0, 10.0)], layer)
    left = shorten_bent(paths, even(paths, (0.0, 0.0)), 1e3, MACHINE, 0.0)
    assert tight_share(left, MACHINE) == 0.0
    assert len(left) == 4


def test_fibre_that_does_harm_goes_with_its_bends(bent_beam):
    layer = bent_beam[1][0]
    paths = Toolpaths.from_plane([hairpin((10.0, y)) for y in (4.0, 10.0)], layer)
    left = shorten_bent(paths, even(paths, (-1.0, 2.0)), 1e3, MACHINE, 0.0)
    assert len(left) == 2
    assert left.points[:, 1].min() > 8.0


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_pruned_fibre_keeps_to_the_share(bent_beam, share):
    stress, layers = bent_beam
    turns = [hairpin((4.0, y), leg=40.0) for y in (5.0, 12.0, 19.0)]
    paths = Toolpaths.concatenate(Toolpaths.from_plane(turns, layer) for layer in layers)
    length = share * paths.lengths.sum()
    left = prune(paths, stress, length, MACHINE, tight=0.01)
    assert tight_share(left, MACHINE) <= 0.01 < tight_share(paths, MACHINE)
    assert 0.9 * length < left.lengths.sum() <= length
    assert left.lengths.min() >= 10.0 * (1.0 - 1e-9)


def test_a_share_above_one_is_refused(bent_beam):
    stress, layers = bent_beam
    paths = Toolpaths.from_plane([hairpin((4.0, 5.0))], layers[0])
    with pytest.raises(InputError, match="tight must be at least 0 and at most 1"):
        prune(paths, stress, 10.0, MACHINE, tight=1.1)


@pytest.mark.parametrize("tight", [0.0, 1.0])
@pytest.mark.parametrize(("length", "strands"), [(40.0, 1), (80.0, 2), (200.0, 3)])
def test_fibre_that_carries_nothing_stays_where_there_is_room(bent_beam, length, strands, tight):
    """Plans are compared at equal length, also where less fibre than that is stretched."""
    rows = [np.array([[10.0, y], [50.0, y]]) for y in (4.0, 10.0, 16.0)]
    paths = Toolpaths.from_plane(rows, bent_beam[1][0])
    left = shorten_bent(paths, even(paths, (0.0, 1.0, 0.0)), length, MACHINE, tight)
    assert len(left) == strands
    np.testing.assert_allclose(left.lengths, 40.0)
    assert 10.0 in left.points[:, 1]


def test_room_too_short_for_a_path_gets_the_part_of_it_that_is_worth_most(bent_beam):
    rows = [np.array([[10.0, y], [50.0, y]]) for y in (4.0, 10.0)]
    paths = Toolpaths.from_plane(rows, bent_beam[1][0])
    falling = [Profile(0, np.ones(40), 1.0, 0.0), Profile(1, np.linspace(0.3, 0.1, 40), 1.0, 0.0)]
    equal = [Profile(k, np.full(40, 1.0), 1.0, 0.0) for k in range(2)]
    for along, ends in ((falling, (10.0, 25.0)), (equal, None)):
        left = shorten_bent(paths, along, 55.0, MACHINE, 1.0)
        np.testing.assert_allclose(np.sort(left.lengths), [15.0, 40.0])
        if ends:
            np.testing.assert_allclose(left.points[-2:, 0], ends)
    # A part below the 10 mm of the machine is none.
    assert shorten_bent(paths, equal, 49.0, MACHINE, 1.0).lengths.sum() == pytest.approx(40.0)


@pytest.mark.parametrize(
    ("length", "lengths"), [(75.0, [60, 15]), (80.0, [60, 15]), (85.0, [60, 15, 10]), (69.0, [60])]
)
def test_room_is_filled_with_stretches_shorter_than_it_too(bent_beam, length, lengths):
    """Two stretches that are worth the same: 80 mm must not lay less than 75 mm do."""
    rows = [np.array([[10.0, y], [70.0, y]]) for y in (4.0, 10.0)]
    paths = Toolpaths.from_plane(rows, bent_beam[1][0])
    value = np.zeros(60)
    value[5:20] = value[35:50] = np.repeat([1.0, 0.8, 1.0], [2, 11, 2])
    along = [Profile(0, np.full(60, 1.5), 1.0, 0.0), Profile(1, value, 1.0, 0.0)]
    left = shorten(paths, along, length, 10.0, cut_cost=0.0)
    np.testing.assert_allclose(np.sort(left.lengths)[::-1], lengths)
