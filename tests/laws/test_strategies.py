"""Laws that every strategy has to obey; a new module in ccfem/strategies is tested by itself.

Each runs with its defaults, and with the variants that it declares in a class variable `variants`.
"""

from dataclasses import FrozenInstanceError, fields, replace
from functools import cache

import numpy as np
import pytest
import shapely

from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.judging.evaluation import evaluate
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.paths.planning.strategy import PartStrategy
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create, named

MACHINE = Machine()
NAMES = sorted(named())
VARIANTS = [
    f"{name}-{variant}" for name in NAMES for variant in getattr(named()[name], "variants", {})
]
ALL = NAMES + VARIANTS
QUICK = {"stream_function": {"evaluations": 2, "phases": 1}}
"""Parameters that none of the laws depends on, of strategies that are slow with their defaults."""

ALONE = {"pruned": {"base": {"cap": 60.0}}, "stream_function": {"inset": 0.6}}
"""Parameters with which no plain plans are tested, and perhaps taken, beside their own."""

SLOW = {
    "mat": 1.5, "mps": 1.6, "pruned": 3.0, "stream_function": 3.0, "streamline": 2.0,
    "stripes": 2.5, "svt": 1.8,
}  # fmt: skip
"""Width, mm, of the fibre of slow strategies: where it is wide there are fewer strands to plan."""

ALLOWED = {"pruned": 0.01, "stream_function": 0.01}
"""Share of the fibre that strategies may lay round tight turns where turns are cut."""


def made(name, **parameters):
    return create(name, parameters | QUICK.get(name, {}))


def with_amount(name, which):
    """Strategy of a name that lays most, or least."""
    amount = named()[name].amount
    return made(name, **ALONE.get(name, {}), **{amount.parameter: getattr(amount, which)})


def strategy_of(label):
    """Strategy of a name, or of a name and one of its variants."""
    name, _, variant = label.partition("-")
    if not variant:
        return made(name)
    parameters = named()[name].variants[variant]
    alone = {} if "of" in parameters else ALONE.get(name, {})
    return made(name, **(alone | parameters))


def machine_of(strategy):
    widths = (width for name, width in SLOW.items() if isinstance(strategy, named()[name]))
    return Machine(fibre_width=next(widths, MACHINE.fibre_width))


def plate_with_hole():
    """An elliptic plate, 76 x 56 x 4 mm, with an eccentric round hole; no symmetry in its plane.

    The origin lies in it, to the left of the hole: what is turned about it turns onto itself.
    """
    around, across = 48, 8
    box = box_mesh((1.0, 1.0, 4.0), (around, across, 2))
    share, depth, z = box.points.T
    angle = 2.0 * np.pi * share
    hole = np.stack([5.0 + 7.0 * np.cos(angle), -3.0 + 7.0 * np.sin(angle)])
    rim = np.stack([38.0 * np.cos(angle), 28.0 * np.sin(angle)])
    plane = hole + (rim - hole) * depth
    # The seam: nodes at the full turn are those at its start, one row of the grid earlier.
    column = np.arange(len(z)) % (around + 1)
    node = np.where(column == around, np.arange(len(z)) - around, np.arange(len(z)))
    kept, number = np.unique(node, return_inverse=True)
    points = np.column_stack([*plane, z])[kept]
    cells = number[box.cells]
    a, b, c, d = np.moveaxis(points[cells], 1, 0)
    inverted = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0.0
    cells[inverted] = cells[inverted][:, [0, 2, 1, 3]]
    rim_facets = number[box.patches["y_max"]]
    x = points[rim_facets, 0].mean(axis=1)
    patches = {
        "left": rim_facets[x < -30.0],
        "right": rim_facets[x > 30.0],
        "hole": number[box.patches["y_min"]],
    }
    return TetMesh(points + np.array([20.0, -6.0, 0.0]), cells, patches)


@cache
def planned_on(load=1.0, degrees=0.0):
    """Stress and layers of the plate, pulled at its edge and its hole, the whole turned about z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    mesh = plate_with_hole()
    mesh = replace(mesh, points=mesh.points @ rotation.T)
    pull = (
        Force("right", tuple(load * (rotation @ [500.0, 120.0, 0.0]))),
        Force("hole", tuple(load * (rotation @ [200.0, -100.0, 0.0]))),
    )
    held = (Support("left"),)
    problem = Problem(mesh, isotropic(3500.0, 0.35), held, {"pull": pull}, order=1)
    return solve(problem, tolerance=1e-10)["pull"], Planar(count=2).cut(mesh)


@cache
def planned(label):
    """Layers of the plate, and paths of a strategy or of a variant there."""
    if label in VARIANTS:
        return planned_again(strategy_of(label), variant=True)
    (stress, layers), strategy = planned_on(), strategy_of(label)
    return layers, plan(strategy, layers, stress, machine_of(strategy))


def paths_of(label):
    return planned(label)[1]


@cache
def planned_again(strategy, direction=0.0, variant=False, **change):
    """Layers on which a strategy is planned once more, and its paths there.

    What plans the part as a whole needs all of them; of the others the upper layer shows as much,
    and it is the one in which a direction turns from layer to layer. Of variants that is a part of
    one layer, unless they design several groups of layers.
    """
    stress, layers = planned_on(**change)
    groups = {field.name: getattr(strategy, field.name) for field in fields(strategy)}.get("groups")
    whole = (groups or 1) > 1 if variant else isinstance(strategy, PartStrategy)
    if not whole:
        layers = layers[1:]
    return layers, plan(turned_with(strategy, direction), layers, stress, machine_of(strategy))


@cache
def evaluated(label):
    """Paths on the lowest planned layer, and their indices."""
    (layer, *_), paths = planned(label)
    paths, machine = paths.on_layer(layer.index), machine_of(strategy_of(label))
    return paths, evaluate(paths, [layer], planned_on()[0], machine).total


def turned_with(strategy, turn):
    """Strategy with its own direction, where it has one, turned with the part."""
    direction = getattr(strategy, "direction", None)
    if direction is None:
        return strategy
    return replace(strategy, **{direction: getattr(strategy, direction) + turn})


def on_layers(paths, layers):
    """Paths of some layers."""
    return paths.select(np.isin(paths.layer, [layer.index for layer in layers]))


def assert_turned(layers, turned, paths, turn):
    """Turned paths on some layers are those of the part as it stood, turned."""
    paths = on_layers(paths, layers)
    assert len(turned) == len(paths)
    assert turned.lengths.sum() == pytest.approx(paths.lengths.sum(), rel=1e-3)
    for k in (layer.index for layer in layers):
        assert coincide(pieces(turned.on_layer(k)), pieces(paths.on_layer(k), turn), 0.02)


def strands(paths):
    """Straight pieces of the paths that are no links: links may lie outside and cross."""
    starts = np.ones(len(paths.points), dtype=bool)
    starts[paths.offsets[1:] - 1] = False
    starts = np.flatnonzero(starts & ~paths.link)
    plane = paths.points[:, :2]
    return shapely.linestrings(np.stack([plane[starts], plane[starts + 1]], axis=1))


def pieces(paths, turn=0.0):
    """Straight pieces of the paths, turned in the plane by an angle in degrees."""
    ends = np.concatenate([np.stack([p[:-1, :2], p[1:, :2]], axis=1) for p in paths])
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    return shapely.linestrings(ends @ np.array([[c, s], [-s, c]]))


def coincide(one, other, tolerance):
    """Whether all points of either set of pieces lie within a tolerance, mm, of the other set."""
    for these, those in ((one, other), (other, one)):
        points = shapely.points(shapely.get_coordinates(shapely.segmentize(these, 0.5)))
        near, _ = shapely.STRtree(those).query(points, predicate="dwithin", distance=tolerance)
        if len(np.unique(near)) < len(points):
            return False
    return True


@pytest.mark.parametrize("name", NAMES)
def test_strategy_is_a_value_with_defaults(name):
    strategy, kind = create(name), named()[name]
    assert strategy == create(name)
    assert hash(strategy) == hash(create(name))
    names = {field.name for field in fields(strategy)}
    assert kind.amount.parameter in names
    assert kind.amount.most != kind.amount.least
    assert getattr(kind, "direction", kind.amount.parameter) in names
    with pytest.raises(FrozenInstanceError):
        setattr(strategy, kind.amount.parameter, kind.amount.most)


@pytest.mark.parametrize("label", ALL)
def test_lays_fibre_on_every_layer(label):
    layers, paths = planned(label)
    assert np.isfinite(paths.points).all()
    heights = {layer.index: layer.plane.height for layer in layers}
    assert set(paths.layer) == set(heights)
    for path, layer in zip(paths, paths.layer, strict=True):
        np.testing.assert_allclose(path[:, 2], heights[layer], atol=1e-9)
    np.testing.assert_array_equal(np.unique(paths.normals, axis=0), [[0.0, 0.0, 1.0]])


@pytest.mark.parametrize("name", NAMES)
def test_same_input_gives_the_same_paths(name):
    """The least amount is the soonest planned; variants are planned again, turned."""
    strategy = with_amount(name, "least")
    _, paths = planned_again(strategy)
    _, again = planned_again.__wrapped__(strategy)
    np.testing.assert_array_equal(again.points, paths.points)
    np.testing.assert_array_equal(again.offsets, paths.offsets)


@pytest.mark.parametrize("name", NAMES)
def test_paths_turn_with_the_part_whatever_the_load(name):
    """A strategy with a direction of its own names its parameter, in degrees, in `direction`."""
    layers, turned = planned_again(made(name), 217.0, load=1e3, degrees=217.0)
    assert_turned(layers, turned, paths_of(name), 217.0)


@pytest.mark.parametrize("label", VARIANTS)
def test_variants_turn_with_the_part_whatever_the_load(label):
    """Paths that keep to the axes of the layer, `on_axes`, are only about as long when turned."""
    strategy, paths = strategy_of(label), paths_of(label)
    if not getattr(strategy, "on_axes", False):
        layers, turned = planned_again(strategy, 33.0, variant=True, load=1e-3, degrees=33.0)
        assert_turned(layers, turned, paths, 33.0)
        return
    _, scaled = planned_again(strategy, variant=True, load=1e-3)
    np.testing.assert_array_equal(scaled.offsets, paths.offsets)
    np.testing.assert_allclose(scaled.points, paths.points, atol=1e-3)
    _, turned = planned_again(strategy, 90.0, variant=True, degrees=90.0)
    assert turned.lengths.sum() == pytest.approx(paths.lengths.sum(), rel=0.1)


@pytest.mark.parametrize("label", ALL)
def test_paths_stay_inside_the_layer(label):
    layers, paths = planned(label)
    for layer in layers:
        allowed = shapely.buffer(layer.plane.polygon, 0.02)
        shapely.prepare(allowed)
        assert shapely.covers(allowed, strands(paths.on_layer(layer.index))).all()


@pytest.mark.parametrize("label", ALL)
def test_no_path_is_too_short_for_the_cutter(label):
    assert paths_of(label).lengths.min() >= MACHINE.minimum_length


@pytest.mark.parametrize("label", ALL)
def test_paths_cross_neither_each_other_nor_themselves(label):
    """A strategy whose strands cross by intention, in the joints of a frame, has `crosses`."""
    if getattr(strategy_of(label), "crosses", False):
        return
    layers, paths = planned(label)
    for layer in layers:
        segments = strands(paths.on_layer(layer.index))
        crossing = shapely.STRtree(segments).query(segments, predicate="crosses")
        assert crossing.shape[1] == 0


@pytest.mark.parametrize("name", [name for name in NAMES if hasattr(named()[name], "turns")])
def test_nothing_turns_too_tightly_where_turns_are_cut(name):
    """A strategy that cuts turns has a variant that does."""
    cutting = [v for v in VARIANTS if v.startswith(f"{name}-") and strategy_of(v).turns == "cut"]
    assert cutting
    for label in cutting:
        _, total = evaluated(label)
        assert total["curvature_ok"] >= 1.0 - ALLOWED.get(name, 0.0)


@pytest.mark.parametrize("label", ALL)
def test_evaluator_accepts_the_paths(label):
    paths, total = evaluated(label)
    assert total["fibre_length"] == pytest.approx(paths.lengths.sum())
    assert total["paths"] == len(paths)


@pytest.mark.parametrize("name", NAMES)
def test_amount_sets_how_much_fibre_is_laid(name):
    (layers, most), (_, least) = (
        planned_again(with_amount(name, which)) for which in ("most", "least")
    )
    assert most.lengths.sum() > 1.2 * least.lengths.sum()
    default = on_layers(paths_of(name), layers).lengths.sum()
    assert least.lengths.sum() <= default <= most.lengths.sum()
