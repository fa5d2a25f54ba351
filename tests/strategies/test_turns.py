"""Turns that the machine's fibre cannot follow: what each value of `turns` leaves of them."""

from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
import shapely

from ccfem.body.mesh.patches import Box, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.geometry.polylines import line_length
from ccfem.judging.evaluation import evaluate
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.paths.planning.infill import with_turns
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create, named

MACHINE = Machine(fibre_width=1.8)
"""Where fibre is wide there are fewer strands to plan, which turn alike."""
WITH_TURNS = sorted(name for name, kind in named().items() if hasattr(kind, "turns"))
NEEDS_JOINTS = {"winding"}
TESTED = {"pruned": {}, "stream_function": {"evaluations": 3, "phases": 1}}
"""Strategies that choose by virtual tests which bends stay, up to 1 %, with quick parameters."""
ALONE = {"pruned": {"base": {"cap": 60.0}}, "stream_function": {"inset": 0.6}}
"""Parameters with which these test no plain plans, and perhaps take one, beside their own."""
MOVES = {
    "plain": np.eye(3),
    "turned": np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]),
    "mirrored": np.diag([1.0, -1.0, 1.0]),
}


def star():
    angle = np.pi * np.arange(10) / 5.0
    radius = np.where(np.arange(10) % 2, 18.0, 40.0)
    corners = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return shapely.Polygon(corners).buffer(-1.0).buffer(1.0)


def gear():
    angle = 2.0 * np.pi * np.arange(399) / 400.0
    radius = 28.0 + 4.0 * np.sign(np.sin(12.0 * angle))
    teeth = shapely.Polygon(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    return teeth.buffer(0.6).buffer(-0.6).difference(shapely.Point(0.0, 0.0).buffer(8.0))


def ring():
    return shapely.Point(0.0, 0.0).buffer(30.0).difference(shapely.Point(9.0, 4.0).buffer(16.0))


@cache
def part(shape, move):
    """Stress and the one layer of a shape, held at its left and pulled at its right."""
    outline, a = shape(), MOVES[move]
    x0, y0, x1, y1 = outline.bounds
    left = Box((x0 - 1.0, y0 - 1.0, -1.0), (x0 + 4.0, y1 + 1.0, 3.0))
    right = Box((x1 - 4.0, y0 - 1.0, -1.0), (x1 + 1.0, y1 + 1.0, 3.0))
    mesh = patches_from_rules(extrude(outline, 2.0, 5.0), {"left": left, "right": right})
    cells = mesh.cells[:, [1, 0, 2, 3]] if np.linalg.det(a) < 0.0 else mesh.cells
    mesh = replace(mesh, points=mesh.points @ a.T, cells=cells)
    pull = (Force("right", tuple(a @ np.array([300.0, -60.0, 0.0]))),)
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("left"),), {"pull": pull}, order=1)
    return solve(problem)["pull"], Planar(count=1).cut(mesh)


@cache
def planned(name, shape, move, turns="cut"):
    """Paths of a strategy, quick where it is slow, on the layer of a part."""
    more = {} if shape is gear else ALONE.get(name, {})
    strategy = create(name, {"turns": turns, **TESTED.get(name, {}), **more})
    stress, layers = part(shape, move)
    return plan(strategy, layers, stress, MACHINE)


@pytest.mark.parametrize("name", [name for name in WITH_TURNS if name not in TESTED])
def test_by_default_strands_go_round_all_turns(name):
    kind = named()[name]
    assert {field.name: field.default for field in fields(kind)}["turns"] == "tight"
    line = np.array([(0.0, 0.0), (60.0, 0.0), (60.0, 1.0), (0.0, 1.0)])
    assert with_turns(create(name), [line], Machine()).lines[0] is line
    pieces = with_turns(create(name, {"turns": "cut"}), [line], Machine()).lines
    assert [line_length(piece) for piece in pieces] == pytest.approx([60.0, 60.0])


@pytest.mark.parametrize(("shape", "move"), [(star, "turned"), (gear, "plain"), (ring, "mirrored")])
@pytest.mark.parametrize("name", [name for name in WITH_TURNS if name not in NEEDS_JOINTS])
def test_where_turns_are_cut_nothing_bends_too_tightly(name, shape, move):
    (stress, layers), paths = part(shape, move), planned(name, shape, move)
    if len(paths):
        assert paths.lengths.min() >= MACHINE.minimum_length - 1e-6
        assert evaluate(paths, layers, stress, MACHINE).total["curvature_ok"] >= 0.99


@pytest.mark.parametrize("name", sorted(TESTED))
def test_bends_worth_most_stay_and_hardly_any_stiffness_goes(name):
    stress, layers = part(gear, "plain")
    tight, cut = (planned(name, gear, "plain", turns) for turns in ("tight", "cut"))
    shares = [
        1.0 - evaluate(paths, layers, stress, MACHINE).total["curvature_ok"]
        for paths in (tight, cut)
    ]
    assert shares[0] > 0.0  # folds, which were most of the tight bends, are not planned
    assert 0.0 <= shares[1] <= 0.01
    ratios = [virtual_test(paths, stress, span=(), machine=MACHINE).ratio for paths in (tight, cut)]
    assert ratios[1] - 1.0 > 0.8 * (ratios[0] - 1.0)


@pytest.mark.parametrize("name", ["concentric", "offset", "mat"])
def test_mirrored_parts_keep_as_much(name):
    """Where two strands meet in a turn the first is cut back: senses do not mirror."""
    found = [planned(name, ring, move).lengths.sum() for move in ("plain", "mirrored")]
    assert found[1] == pytest.approx(found[0], rel=0.01)


def test_paths_of_pixels_are_cut_too():
    stress, layers = part(ring, "plain")
    tight, cut = (
        plan(create("grid", {"mode": "raster", "turns": turns}), layers, stress, MACHINE)
        for turns in ("tight", "cut")
    )
    assert evaluate(tight, layers, stress, MACHINE).total["curvature_ok"] < 0.99
    assert evaluate(cut, layers, stress, MACHINE).total["curvature_ok"] >= 0.99
