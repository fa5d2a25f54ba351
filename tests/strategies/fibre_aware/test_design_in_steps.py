"""Fields for much fibre, designed for less of it first."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.studies import confirmed_gain
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import printed_pla
from ccfem.machine import Machine
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware.heights import middle_layers
from ccfem.strategies.fibre_aware.stream_design import design, designed_in_steps
from ccfem.strategies.fibre_aware.stream_start import start_fields
from ccfem.strategies.stream_function import StreamFunction

MACHINE = Machine()


@pytest.fixture(scope="module")
def lever():
    mesh = confirmed_gain.lever(size=3.5)
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
