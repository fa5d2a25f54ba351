"""Law of amounts: every strategy lays any length between its least and its most, on all layers."""

import numpy as np
import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.paths.planning.equal_fibre import extremes, layer_lengths, plan_to_lengths
from ccfem.paths.planning.strategy import LengthStrategy
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create, named

MACHINE = Machine(minimum_length=25.0)
JOINTS = ("winding",)
"""Strategies that need a hole at a joint."""
SLOW = ("eqs", "mps", "streamline", "svt")
WIDE = Machine(fibre_width=1.5, minimum_length=25.0)
"""Of strategies that take long to plan: where fibre is wide there are fewer strands."""


def machine_of(name):
    return WIDE if name in (*SLOW, "pruned", "stream_function", "stripes") else MACHINE


@pytest.fixture(scope="module")
def cantilever():
    """A short cantilever, bent in its plane."""
    mesh = box_mesh((60.0, 30.0, 3.0), (12, 6, 1))
    load = {"bend": (Force("x_max", (0.0, -100.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("x_min"),), load, order=1)
    return solve(problem)["bend"], Planar(count=2).cut(mesh)


@pytest.mark.parametrize("name", sorted(set(named()) - set(JOINTS)))
def test_any_length_between_the_least_and_the_most_is_laid(cantilever, name):
    """Lengths at random, and what lies beyond both ends."""
    (stress, layers), machine = cantilever, machine_of(name)
    quick = {"evaluations": 5, "phases": 1} if name == "stream_function" else {}
    strategy = create(name, quick)
    if isinstance(strategy, LengthStrategy):
        natural = strategy.natural_length(layers, machine)
        least, most, known = 0.3 * natural, 1.2 * natural, ()
    else:
        known = extremes(strategy, layers, stress, machine)
        least, most = (one.length_per_layer for one in known)
    assert 0.0 < least < most
    shares = np.sort(np.random.default_rng(len(name)).random(1 if name in SLOW else 2))
    wanted = [least + share * (most - least) for share in shares]
    found = plan_to_lengths(strategy, layers, stress, machine, wanted, known)
    for one, length in zip(found, wanted, strict=True):
        assert one.reached
        assert 0.99 * length <= one.length_per_layer <= length * (1.0 + 1e-9)
        assert one.toolpaths.lengths.min() >= machine.minimum_length * (1.0 - 1e-3)
        assert (layer_lengths(one.toolpaths, layers) > 0.0).all()
    if known:
        short, long = plan_to_lengths(
            strategy, layers, stress, machine, (0.5 * least, 2.0 * most), known
        )
        assert (short.length_per_layer, long.length_per_layer) == pytest.approx((least, most))
        assert "its least" in short.note
        assert "its most" in long.note
        assert not short.reached
        assert not long.reached


@pytest.mark.parametrize("name", ["grid", "mat", "mps", "contour_zigzag"])
def test_thin_infill_leaves_the_shells_where_they_are(cantilever, name):
    """Rings half a width inside the border and at every width further in; the rest is thinned."""
    stress, layers = cantilever
    width = MACHINE.fibre_width
    shells = 2 if name == "contour_zigzag" else 3
    single = {"joined": False} if name == "contour_zigzag" else {}
    dense, thin = (
        plan(create(name, {"spacing": spacing, **single}), layers, stress, MACHINE)
        for spacing in (1.0, 5.0)
    )
    depths = np.array([_depth(path) for path in thin]) / width
    rings = depths < shells - 0.25
    assert sorted(set(np.round(depths[rings], 2))) == [0.5 + k for k in range(shells)]
    assert (depths[~rings] > shells - 0.01).all()
    assert 0.0 < thin.lengths[~rings].sum() < 0.4 * dense.lengths.sum()
    assert thin.closed[rings].all()


def _depth(path):
    """Least distance of a path from the border of the cantilever."""
    x, y = path[:, 0], path[:, 1]
    return min(x.min(), 60.0 - x.max(), y.min(), 30.0 - y.max())
