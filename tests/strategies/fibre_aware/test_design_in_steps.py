"""Fields for much fibre, designed for less of it first."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.studies import confirmed_gain
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import printed_pla
from ccfem.machine import Machine
from ccfem.paths.planning.strategy import full_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import stress_on
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import stream_function
from ccfem.strategies.fibre_aware.heights import middle_layers
from ccfem.strategies.fibre_aware.stream_design import design, designed_in_steps, first_step
from ccfem.strategies.fibre_aware.stream_start import start_fields
from ccfem.strategies.stream_function import StreamFunction

MACHINE = Machine()


@pytest.fixture(scope="module")
def lever():
    mesh = confirmed_gain.lever(size=4.5)
    load = {"planned": (Force("load", (0.0, -200.0, 0.0)),)}
    problem = Problem(mesh, printed_pla(), (Support("support"),), load, order=1)
    return solve(problem)["planned"], Planar(count=2).cut(mesh)


def posed(part, coverage):
    """Problem of the lever for a coverage, and what makes the first field of such a problem."""
    stress, layers = part
    problem, group, _ = StreamFunction(evaluations=1).designed(stress, layers, MACHINE)
    model = problem.model
    chosen = middle_layers(layers, group)

    def start(one):
        return start_fields(one, (stress,), chosen, 90.0)

    budget = 1.1 * coverage * float(model.room.sum())
    return replace(problem, model=replace(model, budget=budget)), start


def test_a_field_for_much_fibre_is_stiffer_by_way_of_less(lever):
    problem, start = posed(lever, 0.75)
    at_once = design(problem, start(problem), 32)
    found = designed_in_steps(problem, start, 17, 0.75)
    assert len(found.ratios) < 1.1 * 32
    assert found.objective.ratio > 1.005 * at_once.objective.ratio


def test_usual_amounts_are_designed_in_one_step(lever):
    problem, start = posed(lever, 0.45)
    found = designed_in_steps(problem, start, 2, 0.45)
    once = design(problem, start(problem), 2)
    np.testing.assert_array_equal(found.fields, once.fields)
    # However much of it is to be cut off.
    much = replace(problem, model=replace(problem.model, budget=2.0 * problem.model.budget))
    found, once = designed_in_steps(much, start, 2, 0.45), design(much, start(much), 2)
    np.testing.assert_array_equal(found.fields, once.fields)


def test_designs_for_several_lengths_share_their_first_step(lever, monkeypatch):
    (stress, layers), machine = lever, Machine(fibre_width=1.6)  # fewer strands than of 1 mm
    strategy, steps = StreamFunction(evaluations=2, phases=1, inset=0.6), []

    def counted(*about):
        steps.append(about)
        return first_step(*about)

    monkeypatch.setattr(stream_function, "first_step", counted)
    full = full_length(layers, machine)
    lengths = [0.6 * full, 0.8 * full, 0.8 * full]
    together = strategy.to_lengths(stress, layers, machine, lengths)
    assert len(steps) == 1
    ((_, alone),) = strategy.to_lengths(stress, layers, machine, lengths[:1])
    (_, first), (_, most), (_, again) = together
    for layer in layers:
        view = stress_on(layer, stress)
        paths = [planner(layer, view, machine) for planner in (alone, first, most, again)]
        np.testing.assert_array_equal(paths[0].points, paths[1].points)
        assert not np.array_equal(paths[1].points, paths[2].points)  # from there on by itself
        np.testing.assert_array_equal(paths[2].points, paths[3].points)


@pytest.mark.parametrize(
    ("coverage", "reach", "designs"),
    [
        (0.6, 100.0, [False, True]),
        (0.6, 52.0, [False, True]),
        # Less than the 50 mm that are laid.
        (0.6, 48.0, [False]),
        # More than that would lay strands side by side, and soften the part.
        (0.9, 100.0, [False]),
    ],
)
def test_what_a_longer_design_could_reach_is_designed_for_again(lever, coverage, reach, designs):
    _, layers = lever
    short = Toolpaths.from_plane([np.array([[0.0, 0.0], [50.0, 0.0]])], layers[0])
    asked = []

    def cut(strategy, lengths, whole):
        asked.append(whole)
        return len(lengths) * [short], reach

    length = coverage * full_length(layers, MACHINE)
    stream_function.designed_to_lengths(StreamFunction(), layers, MACHINE, [length], cut)
    assert asked == designs
