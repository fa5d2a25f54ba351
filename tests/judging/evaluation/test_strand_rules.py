"""Rules for each strand, on a plate of 100 x 40 mm: what breaks them is known without the code."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.judging.evaluation.strand_rules import strand_verdict
from ccfem.judging.virtual_testing.strand_room import strand_parts
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers import Planar

MESH = box_mesh((100.0, 40.0, 2.0), (10, 4, 1))
LAYERS = Planar(heights=(1.0,)).cut(MESH)
MACHINE = Machine()  # a fibre 1 mm wide, least radius 3.85 mm, strands of 42 mm


def verdict(lines, by_design=False, machine=MACHINE, link=None):
    lines = [np.array(line, dtype=float) for line in lines]
    paths = Toolpaths.from_plane(lines, LAYERS[0], link=link)
    return strand_verdict(paths, LAYERS, machine, by_design)


def carrying(lines, crosses=False):
    """Length that carries in the virtual test, mm."""
    paths = Toolpaths.from_plane([np.array(line, dtype=float) for line in lines], LAYERS[0])
    strands = cut_strands(paths, MESH, 1.0, MACHINE, LAYERS, crosses)
    return float(strands.length @ strands.share)


def serpentine(piece, pitch=1.0, count=6):
    """Straight pieces joined by square hairpins."""
    rows = [[[20.0, 10.0 + k * pitch], [20.0 + piece, 10.0 + k * pitch]] for k in range(count)]
    return [point for k, row in enumerate(rows) for point in (row[::-1] if k % 2 else row)]


def test_pieces_between_hairpins_have_to_be_as_long_as_the_cutter_needs():
    assert verdict([serpentine(50.0)]).broken == ()
    (rule,) = verdict([serpentine(50.0), serpentine(15.5)]).broken
    assert rule.rule == "folds"
    assert rule.strands.tolist() == [1]
    assert "1 of 2 strands have no 42 mm free of turns by more than 90 degrees" in rule.words
    # The middle one of five hairpins, at x = 35.5 and y = 12 to 13.
    assert rule.places[0] == pytest.approx([35.5, 12.5, 1.0], abs=0.3)


def test_a_strand_holds_before_it_is_cut():
    """A row of 95 mm after a hook of 10 mm: the hook's fold lies 10 mm behind the start."""
    hook = [[20.0, 21.0], [10.0, 21.0], [10.0, 20.0], [95.0, 20.0]]
    assert verdict([hook]).broken == ()
    (rule,) = verdict([hook], machine=replace(MACHINE, held_length=16.0)).broken
    assert (rule.rule, rule.strands.tolist()) == ("held", [0])
    assert rule.places[0] == pytest.approx([10.0, 20.5, 1.0], abs=0.3)
    assert verdict([hook], machine=replace(MACHINE, held_length=5.0)).broken == ()
    # Backwards the fold lies in the tail, but the head may begin there.
    (rule,) = verdict([hook[::-1]], machine=replace(MACHINE, held_length=16.0)).broken
    assert (rule.rule, rule.strands.tolist()) == ("held", [0])
    assert verdict([hook], by_design=True, machine=replace(MACHINE, held_length=16.0)).broken == ()


def test_the_strand_that_folds_nearest_to_an_end_is_named_first():
    hooks = [
        [[10.0 + off, y + 1.0], [10.0, y + 1.0], [10.0, y], [95.0, y]]
        for off, y in ((12.0, 10.0), (6.0, 20.0))
    ]
    (rule,) = verdict(hooks, machine=replace(MACHINE, held_length=16.0)).broken
    assert (rule.rule, rule.strands.tolist()) == ("held", [1, 0])


def test_a_fold_before_the_cut_lets_go():
    """A hairpin at 90 of 151 mm, 19 mm before the cut, which is 42 mm before the end."""
    line = [[5.0, 10.0], [95.0, 10.0], [95.0, 11.0], [35.0, 11.0]]
    for held, rules in ((0.0, []), (15.0, []), (25.0, ["held"])):
        broken = verdict([line], machine=replace(MACHINE, held_length=held)).broken
        assert [rule.rule for rule in broken] == rules


def test_the_shortest_strand_holds_before_its_cut():
    assert replace(MACHINE, cutter_distance=16.0, held_length=30.0).shortest_strand == 46.0
    assert MACHINE.shortest_strand == 42.0


def test_a_published_pattern_keeps_its_turns_and_says_what_they_cost():
    judged = verdict([serpentine(15.5)], by_design=True)
    assert judged.broken == ()
    assert "1 of 1 strands turn back on themselves in 5 places, as its pattern is pub" in (
        judged.remark
    )
    assert verdict([[[5.0, 20.0], [95.0, 20.0]]]).remark == ""


def test_fibre_in_a_fold_carries_nothing():
    """A hairpin of two corners 1 mm apart turns by 180 degrees: it and its corners are the fold."""
    lost = 2.0 * 50.0 + 4.0 - carrying([serpentine(50.0, 4.0, 2)])
    # More than 90 degrees within 4 mm need both corners, 4 mm apart: at most 4 mm and a sample.
    assert 0.0 <= lost < 5.0
    lost = 2.0 * 50.0 + 2.0 - carrying([serpentine(50.0, 2.0, 2)])
    assert 2.0 <= lost < 5.0


def test_more_than_a_twentieth_of_its_width_outside_breaks_the_rule():
    for beyond, outside in ((-0.5, 0.0), (-0.46, 0.0), (-0.44, 0.1), (-0.3, 0.2), (0.0, 0.5)):
        line = [[5.0, 40.0 + beyond], [95.0, 40.0 + beyond]]
        broken = verdict([line]).broken
        assert len(broken) == (outside > 0.05)
        assert carrying([line]) == pytest.approx(90.0 * (1.0 - outside), rel=1e-6)
    assert broken[0].words.startswith("1 of 1 strands lie outside the part by more than 5% of")
    assert "the worst by 50%, at (" in broken[0].words


def test_the_width_outside_is_that_over_the_whole_length_of_a_strand():
    """A strand that leaves the part for its last 4 of 84 mm, and for 6 of 86."""
    for away, broken in ((4.0, 0), (6.0, 1)):
        assert len(verdict([[[20.0, 20.0], [100.0 + away, 20.0]]]).broken) == broken


def test_links_outside_do_not_count():
    line = [[20.0, 20.0], [95.0, 20.0], [130.0, 20.0]]
    link = [np.array([False, True, False])]
    assert [rule.rule for rule in verdict([line]).broken] == ["outside"]
    assert verdict([line], link=link).broken == ()


def test_strands_that_are_woven_carry_nothing_where_they_cross():
    """A strand across ten others, 1 mm wide: it loses 1 mm at each, and each 1 mm at it."""
    others = [[[x, 0.0], [x, 40.0]] for x in np.arange(30.0, 70.0, 4.0)]
    lines = [[[5.0, 20.0], [95.0, 20.0]], *others]
    whole = 90.0 + 10 * 40.0
    assert carrying(lines, crosses=True) == pytest.approx(whole, rel=1e-6)
    assert carrying(lines) == pytest.approx(whole - 20.0, rel=1e-3)


def test_a_machine_without_a_least_radius_folds_nothing():
    assert verdict([serpentine(15.5)], machine=replace(MACHINE, minimum_radius=0.0)).broken == ()


def test_parts_know_their_strand():
    paths = Toolpaths.from_plane([np.array([[5.0, 5.0], [95.0, 5.0]])], LAYERS[0])
    parts = strand_parts(paths, MACHINE, LAYERS)
    assert parts.beads.length.sum() == pytest.approx(90.0)
    assert parts.inside.min() == 1.0
    assert not parts.folded.any()


def test_layer_by_layer_says_what_all_at_once_do():
    layers = Planar(heights=(0.5, 1.5)).cut(MESH)
    rows = [[[10.0, y], [90.0, y]] for y in (10.0, 10.6, 39.9)]
    both = Toolpaths.concatenate(
        Toolpaths.from_plane([np.array(line) for line in lines], layer)
        for layer, lines in zip(layers, ([*rows, serpentine(15.5)], rows[1:]), strict=True)
    )
    done = strand_verdict(both, layers, MACHINE)
    at_once = strand_parts(both, MACHINE, layers)
    for mine, theirs in zip(done.parts.beads, at_once.beads, strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-12)
    for name in ("link", "inside", "folded"):
        np.testing.assert_array_equal(getattr(done.parts, name), getattr(at_once, name))
    np.testing.assert_array_equal(done.parts.folds.line, at_once.folds.line)
    assert [(rule.rule, rule.strands.tolist()) for rule in done.broken] == [
        ("folds", [3]),
        ("outside", [2, 5]),
    ]
    assert done.broken[1].places[:, 2] == pytest.approx([0.5, 1.5])
    assert strand_verdict(both, layers, MACHINE, with_parts=False).parts is None
