"""Lengths of links by place, and what links do to the other indices."""

import numpy as np
import pytest

from ccfem.judging.evaluation import evaluate
from ccfem.judging.evaluation.indices.links import link_indices, sample_links
from ccfem.machine import Machine

# 5 mm in the part, 20 mm over the window, 5 mm in the part; later 5 in, 15 out, 5 in.
LINE = [[5, 20], [15, 20], [45, 20], [55, 20], [55, 30], [65, 30], [65, 35], [55, 35], [5, 35]]
LINKS = [1, 4, 5, 6]


def indices(paths):
    return link_indices(sample_links(paths))


def total(part, *lines, links=None):
    paths = part.paths(*lines, links=links)
    return evaluate(paths, part.layers, part.stress, Machine()).total


def test_lengths_of_a_path_by_hand(framed):
    values = indices(framed.plane(LINE, [[2, 2], [50, 2]], links=[LINKS, []]))
    assert values["links"] == 2.0
    assert values["link_inside"] == pytest.approx(20.0, abs=1e-3)
    assert values["link_over_void"] == pytest.approx(20.0, abs=1e-3)
    assert values["link_outside"] == pytest.approx(15.0, abs=1e-3)


def test_a_link_over_the_start_of_a_closed_path_is_one(framed):
    ring = [[5, 5], [55, 5], [55, 35], [5, 35], [5, 5]]
    values = indices(framed.plane([[2, 2], [9, 2]], ring, links=[[0], [0, 3]]))
    assert values["links"] == 2.0
    assert indices(framed.plane(ring, links=[[0, 2]]))["links"] == 2.0


def test_no_links(framed):
    assert set(indices(framed.plane(LINE)).values()) == {0.0}
    assert set(indices(framed.plane()).values()) == {0.0}


def test_lengths_add_up_to_the_links_whatever_the_way(framed):
    rng = np.random.default_rng(5)
    lines = [rng.uniform([-10, -10], [70, 50], (30, 2)) for _ in range(3)]
    links = [np.flatnonzero(rng.random(29) < 0.5) for _ in lines]
    values = indices(framed.plane(*lines, links=links))
    steps = [np.hypot(*np.diff(line, axis=0).T) for line in lines]
    length = sum(step[link].sum() for step, link in zip(steps, links, strict=True))
    places = ("link_inside", "link_over_void", "link_outside")
    assert sum(values[name] for name in places) == pytest.approx(length)
    runs = sum(1 + (np.diff(link) > 1).sum() for link in links)
    assert values["links"] == runs
    # A subdivided path has the same links.
    middle = [0.5 * (line[:-1] + line[1:]) for line in lines]
    finer = [
        np.concatenate([np.stack([line[:-1], half], axis=1).reshape(-1, 2), line[-1:]])
        for line, half in zip(lines, middle, strict=True)
    ]
    both = [np.concatenate([2 * link, 2 * link + 1]) for link in links]
    assert indices(framed.plane(*finer, links=both)) == pytest.approx(values, abs=1e-6)


def test_links_beyond_the_part_change_no_index_of_the_fibre_in_it(framed):
    """Strands joined by links count as the strands and what of the links is in the part."""
    strands = [[[5, 20], [15, 20], [20, 20]], [[40, 20], [55, 20], [55, 30], [60, 30]]]
    strands.append([[60, 35], [55, 35], [5, 35]])
    joined, alone = total(framed, LINE, links=[LINKS]), total(framed, *strands)
    of_all_fibre = {
        *("fibre_length", "paths", "cuts", "length_min", "length_median", "length_max"),
        *("long_enough_count", "long_enough_length", "print_time", "mean_speed", "sinuosity"),
        *("sinuosity_mean", "over_40_count", "over_40_length", "turns_45", "turns_90"),
        *("links", "link_inside", "link_over_void", "link_outside", "free_span", "free_length"),
        # A link over a hole hangs there; the order and the mass are of all fibre too.
        *("free_span", "free_length", "print_time_nearest", "fibre_mass"),
        *("matrix_length", "matrix_mass"),
    }
    for name in set(joined) - of_all_fibre:
        # The cut of a link lies 0.0001 mm beyond the border, which is still inside.
        # What is sampled along the strands lies elsewhere where they are cut.
        near = 0.02 if name == "fibre_fraction_99" else 1e-3
        assert joined[name] == pytest.approx(alone[name], rel=1e-3, abs=near, nan_ok=True), name
    assert joined["fibre_length"] == pytest.approx(135.0)
    assert joined["paths"] == 1.0


def test_fibre_that_leaves_the_part_without_being_a_link_is_told_apart(framed):
    values = total(framed, LINE, links=[[1]])
    assert values["outside_length"] == pytest.approx(15.0, abs=1e-3)
    assert values["outside_depth"] == pytest.approx(5.0, abs=1e-3)
    assert values["link_outside"] == 0.0
    values = total(framed, LINE, links=[LINKS])
    assert values["outside_length"] == values["outside_depth"] == 0.0


def test_a_tight_turn_outside_the_part_bends_no_fibre_in_it(framed):
    t = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 40)
    turn = np.stack([62.0 + 1.5 * np.cos(t), 32.0 + 1.5 * np.sin(t)], axis=1)
    line = np.concatenate([[[5.0, 30.5]], turn, [[5.0, 33.5]]])
    steps = np.arange(1, len(turn))
    marked, plain = total(framed, line, links=[steps]), total(framed, line)
    assert marked["curvature_max"] == pytest.approx(0.0, abs=1e-9)
    assert plain["curvature_max"] == pytest.approx(1.0 / 1.5, rel=0.05)
    # Straight, the strands have no vertex that could bend too much; the turn has hardly any other.
    assert np.isnan(marked["curvature_ok_native"])
    assert plain["curvature_ok_native"] < 0.2
