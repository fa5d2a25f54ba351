"""Stretches of other plans in exchange for what carries less: a bent beam shows which those are."""

from functools import partial

import numpy as np
import pytest

from ccfem.judging.virtual_testing import Strand
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.strategies.fibre_aware import cut_and_move
from ccfem.strategies.fibre_aware.cut_and_move import exchanged
from ccfem.strategies.fibre_aware.judges import Goal, stiffness_judge
from ccfem.strategies.fibre_aware.prune import prune

MACHINE = Machine(minimum_length=10.0)


def rows(layers, heights, link=False):
    """Straight rows along the beam; one at y = 0 would lie where it is stretched most."""
    x = np.linspace(3.0, 57.0, 60)
    lines = [np.column_stack([x, np.full(60, y)]) for y in heights]
    marked = [np.append(np.full(59, link), False)] * len(lines)
    on_layers = (Toolpaths.from_plane(lines, layer, link=marked) for layer in layers)
    return Toolpaths.concatenate(on_layers)


def exchange(beam, paths, *plans):
    stress, layers = beam
    length = float(paths.lengths.sum())
    judge = stiffness_judge(stress, MACHINE, Strand(), layers)

    def cut(toolpaths, tests):
        return prune(toolpaths, stress, length, MACHINE, rounds=tests)

    kept, tested = exchanged(paths, plans, stress.mesh, MACHINE, judge, cut)
    assert tested.value == pytest.approx(judge(kept).value, rel=1e-6)
    return kept


def stretch(paths):
    """Sum of the squared stretch of straight rows, up to a factor: moment times distance."""
    x, y = paths.points[:, 0].copy(), paths.points[:, 1]
    first, last = x[paths.offsets[:-1]], x[paths.offsets[1:] - 1]
    third = np.abs((60.0 - first) ** 3 - (60.0 - last) ** 3) / 3.0
    return float(third @ (12.0 - y[paths.offsets[:-1]]) ** 2)


def test_what_is_stretched_least_goes_for_what_is_stretched_most(bent_beam):
    """The stretch is that of a beam: the moment falls to the tip, the distance to the axis."""
    paths = rows(bent_beam[1], (0.5, 1.5, 9.0, 10.0))
    other = exchange(bent_beam, paths, rows(bent_beam[1], np.arange(0.5, 12.0)))
    assert float(other.lengths.sum()) == pytest.approx(float(paths.lengths.sum()), rel=0.01)
    assert stretch(other) > 1.1 * stretch(paths)
    ratios = [virtual_test(one, bent_beam[0], span=()).ratio for one in (paths, other)]
    assert ratios[1] > 1.01 * ratios[0]
    # Rows half a width from each other would share one width.
    for index in range(4):
        y = np.unique(np.round(other.on_layer(index).points[:, 1], 6))
        assert np.diff(y).min() >= 1.0


@pytest.mark.parametrize(
    ("plan", "link"),
    [((13.5, 17.5), False), ((0.9, 3.1), False), ((2.5, 3.5), True)],
    ids=["worth_less", "no_room", "links"],
)
def test_nothing_is_taken_that_gains_nothing(bent_beam, plan, link):
    paths = rows(bent_beam[1], (0.5, 1.5, 2.5) if not link else (0.5, 9.0))
    assert exchange(bent_beam, paths, rows(bent_beam[1], plan, link)) is paths


def test_only_plans_that_were_much_too_long_are_exchanged(bent_beam, monkeypatch):
    stress, layers = bent_beam
    monkeypatch.setattr(cut_and_move, "exchanged", lambda *about: (Toolpaths.empty(), about[-2]))
    half, row = rows(layers, (0.5,)), float(rows(layers, (0.5,)).lengths.sum())
    planned = partial(cut_and_move.prune_and_move, layers=layers, part=Goal.of(stress))
    about = {"machine": MACHINE, "strand": Strand(), "how": cut_and_move.Cutting(1)}
    for heights_of, gone in (((0.5, 1.5), True), ((0.5,), False)):
        plans = [rows(layers, (9.0,)), rows(layers, heights_of)]
        kept = planned(plans, length=row, **about)
        assert len(kept) == (0 if gone else len(half))
