"""Strands led round their folds or cut there, against curves known by hand."""

import sys
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
import shapely

from benchmarks.print_checks.strand_rules import folds as counted
from ccfem.body.mesh import box_mesh
from ccfem.geometry.polylines import along_line, is_closed, line_length, pack
from ccfem.geometry.tight_bends import tight_bends
from ccfem.machine import Machine
from ccfem.paths.folds import WINDOW, folds, folds_in
from ccfem.paths.linking.joining import Joined
from ccfem.paths.planning.layer_plans import plan_layers
from ccfem.paths.planning.strategy import Amount
from ccfem.paths.planning.unfolding import may_fold, part_of_line, unfolded, unfolded_paths
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers import Planar
from ccfem.strategies import create, named

MACHINE = Machine()
WIDE = shapely.box(-100.0, -100.0, 100.0, 100.0)


def corner(degrees, leg=50.0):
    turn = np.radians(degrees)
    tip = leg * np.array([np.cos(turn), np.sin(turn)])
    return np.array([[-leg, 0.0], [0.0, 0.0], tip])


def freed(*lines, section=WIDE, least=MACHINE.minimum_length, link=None):
    link = [np.zeros(len(line), dtype=bool) for line in lines] if link is None else link
    return unfolded(Joined([np.asarray(x, float) for x in lines], link), section, MACHINE, least)


def in_space(line):
    return np.column_stack([line, np.zeros(len(line))])


def count(lines):
    return folds(*pack(lines), np.array([is_closed(x) for x in lines]), MACHINE.minimum_radius)


@pytest.mark.parametrize("degrees", [100, 120, 140])
def test_corner_with_room_is_led_round_by_the_least_radius(degrees):
    """A fillet of radius r passes a corner of turn a at r / cos(a / 2) - r, or a bit farther."""
    line, radius, turn = corner(degrees), MACHINE.minimum_radius, np.radians(degrees)
    (round_,) = freed(line).lines
    np.testing.assert_array_equal(round_[[0, -1]], line[[0, -1]])
    assert not len(tight_bends(round_, along_line(round_), False, 0.98 * radius, 1.0))
    passed = shapely.distance(shapely.Point(0.0, 0.0), shapely.linestrings(round_))
    fillet = radius / np.cos(0.5 * turn) - radius
    # The sharper corner is led round outside, by less of a way.
    assert 0.999 * fillet <= passed < 1.5 * fillet if degrees < 130 else passed < fillet


def test_strands_in_corners_side_by_side_keep_their_distance():
    """Where there is no room to lead one round it is cut; none comes near to its neighbour."""
    turn = np.radians(130.0)
    inwards = 1.1 * np.array([-1.0 / np.tan(0.5 * (np.pi - turn)), 1.0])
    lines = freed(*(corner(130) + k * inwards for k in range(5)), least=10.0).lines
    assert not len(count(lines).line)
    assert len(lines) > 5
    strands = shapely.linestrings(lines[0]), *map(shapely.linestrings, lines[1:])
    for k, strand in enumerate(strands):
        others = np.delete(np.array(strands), k)
        far = shapely.difference(shapely.MultiLineString(list(others)), strand.buffer(1e-6))
        assert shapely.distance(strand, far) > 0.5
    assert sum(map(line_length, lines)) > 0.8 * 500.0


@pytest.mark.parametrize(("degrees", "turns"), [(25, 0), (40, 1)])
def test_no_strand_folds_by_a_count_that_averages_nothing(degrees, turns):
    """A corner of 40 degrees before an arc of the least radius turns by 99.5 within the window."""
    radius, turn = MACHINE.minimum_radius, np.radians(degrees)
    way = np.linspace(0.0, 1.8, 18)
    arc = radius * np.column_stack([np.sin(way), 1.0 - np.cos(way)])
    end = arc[-1] + 60.0 * np.array([np.cos(way[-1]), np.sin(way[-1])])
    line = np.concatenate([[-60.0 * np.array([np.cos(turn), -np.sin(turn)])], arc, [end]])
    assert len(counted(in_space(line), WINDOW * radius)) == turns
    narrow = shapely.LineString(line).buffer(0.5)
    for section, pieces in [(WIDE, 1), (narrow, 1 + turns)]:
        lines = freed(line, section=section).lines
        assert len(lines) == pieces
        assert not any(len(counted(in_space(x), WINDOW * radius)) for x in lines)


def test_hairpin_between_strands_is_cut_and_short_pieces_go():
    rows = [[(0.0, y), (60.0, y)] for y in (-1.0, 2.0)]
    hairpin = [(0.0, 0.0), (60.0, 0.0), (60.0, 1.0), (30.0, 1.0)]
    lines = freed(rows[0], hairpin, rows[1]).lines
    assert [len(lines), len(count(lines).line)] == [3, 0]
    assert line_length(lines[1]) == pytest.approx(60.0, abs=1.5)


def test_a_ring_that_is_too_short_once_it_is_led_round_goes():
    """A triangle of perimeter 60 whose corners are rounded by r loses 6 r tan(60) - 2 pi r."""
    triangle = 20.0 * np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.75**0.5], [0.0, 0.0]])
    (ring,) = freed(triangle, least=40.0).lines
    assert 40.0 < line_length(ring) < 58.0
    assert not freed(triangle, least=58.0).lines


def test_strands_without_folds_are_left_alone():
    lines = [corner(90), corner(30)]
    result = freed(*lines)
    for line, given in zip(result.lines, lines, strict=True):
        assert line is given


def test_pieces_begin_and_end_with_strand_not_with_link():
    """The link, 2 mm long, goes with the fold; neither piece keeps a part of it."""
    line = np.array([(0.0, 0.0), (60.0, 0.0), (60.0, 2.0), (0.0, 2.0)])
    link = np.array([False, True, False, False])
    rows = [[(0.0, y), (70.0, y)] for y in (-1.0, 1.0, 3.0)]
    plain = [np.zeros(2, dtype=bool)] * 3
    lines, marks = freed(rows[0], line, rows[1], rows[2], link=[plain[0], link, *plain[1:]])
    pieces = [(x, m) for x, m in zip(lines, marks, strict=True) if x[0, 1] in (0.0, 2.0)]
    assert len(pieces) == 2
    for points, mark in pieces:
        assert not mark.any()
        assert np.ptp(points[:, 1]) == pytest.approx(0.0)


def test_ring_stays_closed_where_it_is_led_round():
    """A drop with a tip of 120 degrees becomes a ring without a fold."""
    angle = np.radians(np.linspace(60.0, 300.0, 200))
    drop = 20.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    drop = np.concatenate([[[40.0, 0.0]], drop, [[40.0, 0.0]]])
    (ring,) = freed(drop).lines
    assert is_closed(ring)
    assert not len(count([ring]).line)
    assert line_length(ring) == pytest.approx(line_length(drop), abs=6.0)


def test_piece_of_a_ring_runs_on_over_its_start():
    ring = np.array([(0, 0), (10, 0), (10, 10), (0, 10), (0, 0)], dtype=float)
    link = np.array([False, False, True, False, False])
    part, marks = part_of_line(ring, along_line(ring), link, 25.0, 45.0)
    np.testing.assert_allclose(part, [(5, 10), (0, 10), (0, 0), (5, 0)])
    assert marks.tolist() == [True, False, False, False]


@dataclass(frozen=True)
class Hairpins:
    """A hairpin beside the wall of every layer."""

    folds: bool = False
    amount: ClassVar[Amount] = Amount("folds", 1.0, 1.0)

    def __call__(self, layer, stress, machine):
        low = layer.plane.points.min(axis=0) + 2.0
        line = low + np.array([(0.0, 0.0), (70.0, 0.0), (70.0, 1.0), (0.0, 1.0)])
        return Toolpaths.from_plane([line, line[:2] + np.array([0.0, 2.0])], layer)


def test_planning_ends_without_folds_unless_they_are_wanted(monkeypatch):
    layers = Planar(count=2).cut(box_mesh((80.0, 20.0, 4.0), (8, 2, 2)))
    monkeypatch.setattr(sys.modules[plan_layers.__module__], "stress_on", lambda *_: None)
    kept, led = (
        plan_layers(Hairpins(fold), layers, layers, None, MACHINE, fold) for fold in (True, False)
    )
    assert folds_in(kept, MACHINE).counts.tolist() == [1, 0, 1, 0]
    assert folds_in(led, MACHINE).counts.tolist() == 6 * [0]
    assert led.lengths.min() >= MACHINE.minimum_length


def test_paths_in_space_are_cut_with_their_normals():
    """On a curved layer a fold is cut out; every point keeps a unit normal."""
    layer = Planar(count=1).cut(box_mesh((80.0, 20.0, 4.0), (8, 2, 2)))[0]
    paths = Hairpins()(layer, None, MACHINE)

    class Curved:
        flat = None

    cut = unfolded_paths(paths, Curved(), MACHINE)
    assert len(cut) == 3
    assert folds_in(cut, MACHINE).counts.tolist() == [0, 0, 0]
    np.testing.assert_allclose(np.linalg.norm(cut.normals, axis=1), 1.0)


def test_only_published_patterns_may_fold():
    turning_back = {"concentric", "contour_zigzag", "fiso", "grid", "offset", "zigzag"}
    assert {name for name in named() if may_fold(create(name))} == turning_back


def test_no_curve_is_looked_for_in_a_meander(monkeypatch):
    """Hairpins every 2 mm, 4000 to a layer, took minutes and left nothing."""

    def looked_for(*_):
        raise AssertionError("a curve was looked for")

    monkeypatch.setattr("ccfem.paths.planning.unfolding.shortest_curve", looked_for)
    x = np.repeat(np.arange(100.0), 2)
    meander = np.stack([x, np.tile([0.0, 1.0, 1.0, 0.0], 50)], axis=1)
    assert not freed(meander).lines
    with pytest.raises(AssertionError, match="a curve was looked for"):
        freed(corner(120))


def test_jags_of_hundredths_of_a_width_are_left_out():
    """A straight line that wavers by .05 mm is straight again; its corners and ends stay."""
    line = np.array(
        [[0.0, 0.0], [30.0, 0.0], [30.03, 0.05], [30.06, -0.02], [30.2, 0.0], [60.0, 0.0]]
    )
    corner_after = np.vstack([line, [[60.0, 50.0]]])
    (layer,) = Planar(count=1).cut(box_mesh((80.0, 80.0, 2.0), (4, 4, 1)))
    (straight,) = unfolded_paths(Toolpaths.from_plane([corner_after + 5.0], layer), layer, MACHINE)
    off = np.abs(straight[:, 1] - 5.0)[straight[:, 0] < 64.9]
    assert off.max() < 0.051
    assert line_length(straight) == pytest.approx(110.0, abs=0.01)
    np.testing.assert_allclose(straight[[0, -2, -1], :2], [[5.0, 5.0], [65.0, 5.0], [65.0, 55.0]])


def test_jags_stay_where_a_strand_would_become_too_short_for_the_cutter():
    line = np.array([[0.0, 0.0], [20.0, 0.0], [20.05, 0.04], [20.1, 0.0], [41.9, 0.0]])
    line[-1, 0] -= line_length(line) - MACHINE.minimum_length
    (layer,) = Planar(count=1).cut(box_mesh((80.0, 80.0, 2.0), (4, 4, 1)))
    (kept,) = unfolded_paths(Toolpaths.from_plane([line + 5.0], layer), layer, MACHINE)
    assert line_length(kept) == pytest.approx(MACHINE.minimum_length, abs=1e-9)
