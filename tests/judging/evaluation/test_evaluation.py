"""The evaluator as a whole: layers and total, edge cases, invariances."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial.transform import Rotation

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.judging.evaluation import COLUMNS, evaluate, evaluation, indices
from ccfem.judging.evaluation.indices import room
from ccfem.judging.virtual_testing import Strand
from ccfem.machine import Machine
from ccfem.paths.repeated import repeated_layers
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar

MACHINE = Machine()
NAMES = [column.name for column in COLUMNS]


def bent(points):
    """Plane stress that turns and grows with the place, MPa."""
    x, y = points[:, 0] / 60.0, points[:, 1] / 40.0
    tensor = np.zeros((len(points), 3, 3))
    tensor[:, 0, 0], tensor[:, 1, 1] = 1.0 + 2.0 * x, 3.0 * y - 1.0
    tensor[:, 0, 1] = tensor[:, 1, 0] = x + y - 0.5
    return tensor


WAVE = [[x, 20.0 + 8.0 * np.sin(0.2 * x)] for x in np.arange(2.0, 58.0, 0.7)]
RING = [[30.0 + 9.0 * np.cos(a), 20.0 + 9.0 * np.sin(a)] for a in np.linspace(0.0, 2.0 * np.pi, 80)]
RING[-1] = RING[0]
OUT = [[10.0, 33.0], [30.0, 34.3], [45.0, 41.0]]
SHORT = [[50.0, 5.0], [53.0, 5.0]]


def assert_same(first, second, coverage=0.006):
    """Equal indices; those of coverage (on a grid) and outside (to 0.0001 mm deep) nearly."""
    for name in NAMES:
        tolerance = coverage if name.startswith("coverage") else 1e-5
        tolerance = 2e-3 if name.startswith("outside") else tolerance
        # on the grid of coverage
        tolerance = 1e3 * coverage if name == "gap_area" else tolerance
        # of cells, which layers cut unlike, and whose axes swap where principal stresses do
        tolerance = 3.0 if name.startswith("least_angle") else tolerance
        assert first[name] == pytest.approx(second[name], rel=1e-5, abs=tolerance, nan_ok=True), (
            name
        )


@pytest.fixture(scope="module")
def part(make_part):
    return make_part(bent, count=2)


def paths_of(part, layer=0):
    return part.paths(WAVE, RING, OUT, SHORT, layer=layer)


def test_every_column_is_described_once_and_computed(part):
    assert len(set(NAMES)) == len(NAMES)
    for column in COLUMNS:
        assert column.unit
        assert column.formula.endswith(".")
        assert column.range
    total = evaluate(paths_of(part), part.layers, part.stress, MACHINE).total
    assert list(total) == NAMES


def test_samples_of_each_layer_stay(make_part, uniform):
    """A circle below, a strand at 30 degrees to the pull above."""
    part = make_part(uniform(10.0), count=2)
    t = np.linspace(0.0, 2.0 * np.pi, 400)
    ring = np.stack([30.0 + 9.0 * np.cos(t), 20.0 + 9.0 * np.sin(t)], axis=1)
    ring[-1] = ring[0]
    step = 15.0 * np.array([np.cos(np.radians(30.0)), np.sin(np.radians(30.0))])
    strand = [np.array([30.0, 20.0]) - step, np.array([30.0, 20.0]) + step]
    paths = Toolpaths.concatenate([part.paths(ring), part.paths(strand, layer=1)])
    below, above = evaluate(paths, part.layers, part.stress, MACHINE).samples
    np.testing.assert_allclose(below.curvature.curvature, 1.0 / 9.0, rtol=2e-3)
    assert below.alignment.length.sum() == pytest.approx(18.0 * np.pi, rel=2e-3)
    np.testing.assert_allclose(above.curvature.curvature, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.degrees(above.alignment.angle), 30.0)
    assert above.alignment.length.sum() == pytest.approx(30.0)
    for samples in (below.curvature, below.alignment):
        assert not any(values.flags.writeable for values in vars(samples).values())


def test_indices_in_passes_over_many_layers_are_those_taken_at_once(part, monkeypatch):
    both = Toolpaths.concatenate([paths_of(part, 0), paths_of(part, 1)])
    about = (both, part.layers, part.stress, MACHINE, None, None, 1)
    at_once = evaluate(*about)
    monkeypatch.setattr(evaluation, "_TOGETHER", 1)
    assert len(evaluation._passes(2, by_layer=False)) > 1
    in_passes = evaluate(*about)
    for name in NAMES:
        np.testing.assert_array_equal(in_passes.values[name], at_once.values[name])
    assert len(in_passes.samples) == 1


def test_indices_of_the_layers_themselves_are_those_taken_with_the_paths(part, monkeypatch):
    about = (part.layers, part.stress, MACHINE)
    alone = evaluation.layer_indices(*about)
    given = evaluate(paths_of(part), *about, of_layers=alone)
    of_layers = [kind for kind in indices.named().values() if getattr(kind, "BY_LAYER", False)]
    names = {column.name for kind in of_layers for column in kind.COLUMNS}
    assert set(alone[-1]) == names
    assert "across_best" in names
    for kind in of_layers:
        monkeypatch.setattr(kind, "BY_LAYER", False)
    with_paths = evaluate(paths_of(part), *about)
    for name in NAMES:
        np.testing.assert_array_equal(given.values[name], with_paths.values[name])


def test_table_has_a_row_a_layer_and_the_total(part):
    found = evaluate(paths_of(part), part.layers, part.stress, MACHINE)
    frame = found.to_frame()
    assert frame.index.tolist() == [0, 1, "total"]
    assert frame.index.name == "layer"
    assert frame.columns.tolist() == NAMES
    assert set(frame.attrs["columns"]) == set(NAMES)
    assert dict(frame.loc["total"]) == pytest.approx(dict(found.total), nan_ok=True)
    assert dict(frame.loc[0]) == pytest.approx(dict(found.of_layer(0)), nan_ok=True)
    with pytest.raises(InputError, match="no layer 7 was evaluated; there are: 0, 1"):
        found.of_layer(7)


def test_total_of_two_equal_layers_is_that_of_one(part):
    both = Toolpaths.concatenate([paths_of(part, 0), paths_of(part, 1)])
    found = evaluate(both, part.layers, part.stress, MACHINE)
    one, other, total = found.of_layer(0), found.of_layer(1), dict(found.total)
    assert_same(one, other, coverage=1e-9)
    lengths = ("fibre_length", "paths", "cuts", "outside_length", "free_length")
    areas = ("overlap_area", "gap_area")
    prints = ("print_time", "print_time_nearest", "fibre_mass", "matrix_length", "matrix_mass")
    for name in (*lengths, *areas, *prints):
        assert total[name] == pytest.approx(2.0 * one[name])
        total[name] = one[name]
    for name in ("crossings", "self_crossings"):
        assert total[name] == 2.0 * one[name]
        total[name] = one[name]
    assert_same(one, total)


def test_total_weighs_layers_by_their_fibre_and_their_area(part):
    found = evaluate(paths_of(part), part.layers, part.stress, MACHINE)
    one, none, total = found.of_layer(0), found.of_layer(1), found.total
    assert none["fibre_length"] == none["coverage"] == none["outside_depth"] == 0.0
    assert np.isnan([none["angle_mean"], none["spacing_50"], none["curvature_95"]]).all()
    assert total["aligned_20"] == one["aligned_20"]
    assert total["coverage"] == pytest.approx(0.5 * one["coverage"])


def test_no_path_at_all(part):
    found = evaluate(Toolpaths.empty(), part.layers, part.stress, MACHINE)
    for name in ("fibre_length", "paths", "coverage", "outside_length", "crossings"):
        assert found.total[name] == 0.0
    allowed = {c.name for c in COLUMNS if "NaN" in c.range}
    assert {name for name, value in found.total.items() if np.isnan(value)} <= allowed


def test_zero_stress(make_part, uniform):
    part = make_part(uniform(0.0))
    total = evaluate(paths_of(part), part.layers, part.stress, MACHINE).total
    nothing = {name for name, value in total.items() if np.isnan(value)}
    assert nothing == {
        "angle_mean",
        "angle_mean_top_20",
        *(f"aligned_{k}" for k in (10, 20, 30)),
        *(f"aligned_stress_{k}" for k in (10, 20, 30)),
        "efficiency",
        "coverage_stress",
        "agreement",
        "stiffness_alignment",
        "stiffness_alignment_harmonic",
        *(f"matching_{name}_{k}" for name in ("path", "energy") for k in (10, 30)),
        *("space_angle_mean", "space_angle_stress", "across_tension"),
        *("across_flat", "across_best"),
        *("least_angle", "least_angle_flat", "least_angle_best"),
        *(f"space_aligned_{k}" for k in (10, 20, 30)),
    }
    assert total["no_tension"] == 1.0
    assert {c.name for c in COLUMNS if "NaN" in c.range} >= nothing


def test_several_components(make_part, uniform):
    left, right = box_mesh((20, 10, 2), (4, 2, 1)), box_mesh((20, 10, 2), (4, 2, 1), (30, 0, 0))
    mesh = TetMesh(
        np.concatenate([left.points, right.points]),
        np.concatenate([left.cells, right.cells + len(left.points)]),
    )
    mesh = mesh.with_patches({"x_min": left.patches["x_min"]})
    part = make_part(uniform(5.0), mesh=mesh)
    lines = [[[1, 5], [19, 5]], [[31, 5], [49, 5]]]
    total = evaluate(part.paths(*lines), part.layers, part.stress, MACHINE).total
    assert total["coverage"] == pytest.approx(2.0 * (18.0 + np.pi / 4.0) / 400.0, abs=0.002)
    assert total["aligned_10"] == 1.0
    assert total["outside_length"] == 0.0
    across = evaluate(part.paths([[1, 5], [49, 5]]), part.layers, part.stress, MACHINE).total
    assert across["outside_length"] == pytest.approx(10.0, abs=1e-3)
    assert across["outside_depth"] == pytest.approx(5.0, abs=1e-3)


def test_paths_on_unknown_layers_or_off_their_height_are_refused(part):
    paths = paths_of(part, 1)
    with pytest.raises(InputError, match=r"a path lies on layer 1, but only layers \[0\] were"):
        evaluate(paths, part.layers[:1], part.stress, MACHINE)
    with pytest.raises(InputError, match="at least one layer"):
        evaluate(paths, (), part.stress, MACHINE)
    moved = replace(paths, layer=np.zeros(len(paths)))
    with pytest.raises(InputError, match="a path of layer 0 lies 1 mm above or below it"):
        evaluate(moved, part.layers, part.stress, MACHINE)


def test_a_layer_has_the_same_indices_at_any_place_in_the_list(part):
    both = Toolpaths.concatenate([paths_of(part, 0), part.paths(WAVE, layer=1)])
    up = evaluate(both, part.layers, part.stress, MACHINE)
    down = evaluate(both, part.layers[::-1], part.stress, MACHINE)
    assert down.layers.tolist() == [1, 0]
    assert dict(down.of_layer(1)) == dict(up.of_layer(1))
    assert_same(down.total, up.total, coverage=1e-9)


def test_everything_scales_with_the_fibre_width(make_part):
    # Part, paths, strand and machine twice as large: pure numbers stay, lengths double. Only the
    # 40 mm of over_40 stay too, so they are left out.
    small = make_part(bent)
    mesh = small.stress.mesh
    large = make_part(
        lambda points: bent(points / 2.0), mesh=TetMesh(2.0 * mesh.points, mesh.cells, mesh.patches)
    )
    lengths = ("fibre_width", "fibre_height", "minimum_length", "minimum_radius")
    sizes = (*lengths, "matrix_width", "matrix_height")
    twice = {name: 2.0 * getattr(MACHINE, name) for name in sizes}
    machine = replace(MACHINE, filament_area=4.0 * MACHINE.filament_area, **twice)
    first = evaluate(paths_of(small), small.layers, small.stress, MACHINE).total
    lines = [2.0 * np.array(line) for line in (WAVE, RING, OUT, SHORT)]
    thick = Strand(4.0 * Strand().rho)
    second = evaluate(large.paths(*lines), large.layers, large.stress, machine, thick).total
    factor = {"mm": 2.0, "mm^2": 4.0, "g": 8.0, "1/mm": 0.5, "1/m": 0.5, "s": 2.0}
    scaled = {c.name: first[c.name] * factor.get(c.unit, 1.0) for c in COLUMNS}
    scaled |= {name: second[name] for name in ("over_40_count", "over_40_length")}
    assert_same(second, scaled)


@st.composite
def generic_lines(draw):
    """Random polylines in and about the plate.

    Their points come from a generator: of special shapes (a length of a whole number of half steps,
    a sample right on a corner, a path back into itself) rounding decides what is sampled.
    """
    rng = np.random.default_rng(draw(st.integers(0, 10**9)))
    sizes = draw(st.lists(st.integers(2, 6), min_size=1, max_size=4))
    spread = draw(st.sampled_from([1.0, 10.0, 64.0]))
    start = rng.random((len(sizes), 1, 2)) * [60.0, 40.0]
    ends = [a + spread * (rng.random((n, 2)) - 0.5) for a, n in zip(start, sizes, strict=True)]
    # Folded back at 2 mm outside the plate: cut off there, lines would double back on its edge.
    size = np.array([64.0, 44.0])
    return [size - np.abs(size - (line + 2.0) % (2.0 * size)) - 2.0 for line in ends]


@settings(max_examples=12, deadline=None)
@given(lines=generic_lines(), seed=st.integers(0, 10**6))
def test_order_direction_and_subdivision_do_not_matter(part, lines, seed):
    rng = np.random.default_rng(seed)
    changed = []
    for k in rng.permutation(len(lines)):
        line = lines[k][:: rng.choice([-1, 1])]
        share = np.sort(rng.random((3, len(line) - 1)), axis=0)[..., None]
        extra = (1.0 - share) * line[:-1] + share * line[1:]
        line = np.concatenate([np.stack([line[:-1], *extra], axis=1).reshape(-1, 2), line[-1:]])
        changed.append(line)
    first = evaluate(part.paths(*lines), part.layers, part.stress, MACHINE).total
    second = dict(evaluate(part.paths(*changed), part.layers, part.stress, MACHINE).total)
    # The way between the paths is another one, and is no property of each path.
    for name in ("print_time", "print_time_nearest"):
        second[name] = first[name]
    assert_same(first, second, coverage=1e-4)


@settings(max_examples=8, deadline=None)
@given(lines=generic_lines(), seed=st.integers(0, 10**6))
def test_turning_and_moving_part_and_paths_changes_nothing(part, lines, seed):
    turn = Rotation.random(rng=seed).as_matrix()
    shift = np.random.default_rng(seed).normal(size=3) * 100.0
    mesh = part.stress.mesh
    moved = replace(mesh, points=mesh.points @ turn.T + shift)
    stress = replace(
        part.stress,
        problem=replace(part.stress.problem, mesh=moved),
        stress=turn @ part.stress.stress @ turn.T,
        nodal=turn @ part.stress.nodal @ turn.T,
    )
    layers = Planar(count=2).cut(moved, tuple(turn[:, 2]))
    here = part.paths(*lines)
    there = replace(here, points=here.points @ turn.T + shift, normals=here.normals @ turn.T)
    first = evaluate(here, part.layers, part.stress, MACHINE).total
    second = evaluate(there, layers, stress, MACHINE).total
    assert_same(first, second)


def test_fibre_over_a_gap_lies_on_nothing(make_part):
    """Two slabs above each other: the lower one, 1.4 mm farther down, holds nothing."""
    mesh = box_mesh((60.0, 40.0, 3.0), (12, 8, 3))
    points = np.array(mesh.points)
    points[:, 2] = np.interp(points[:, 2], [0.0, 1.0, 2.0, 3.0], [0.0, 1.5, 2.9, 4.0])
    middle = points[mesh.cells].mean(axis=1)[:, 2]
    apart = TetMesh(points, mesh.cells[(middle < 1.5) | (middle > 2.9)])
    part = make_part(bent, mesh=apart, count=2)
    paths = part.paths([[5.0, 20.0], [55.0, 20.0]], layer=1)
    for layers in (part.layers, part.layers[1:]):
        assert evaluate(paths, layers, part.stress, MACHINE).total["free_span"] == pytest.approx(
            50.0
        )
    on_bed = part.paths([[5.0, 20.0], [55.0, 20.0]])
    assert evaluate(on_bed, part.layers, part.stress, MACHINE).total["free_span"] == 0.0


def test_layers_that_repeat_others_have_the_samples_that_they_would_take(make_part, monkeypatch):
    """Equal paths in equal sections are measured once."""
    part = make_part(bent, count=5)
    lines = [[WAVE, RING], [WAVE, RING], [SHORT], [WAVE, RING], [SHORT]]
    paths = Toolpaths.concatenate(part.paths(*some, layer=k) for k, some in enumerate(lines))
    about = (paths, part.layers, part.stress, MACHINE)
    taken, sample = [], room.sample
    monkeypatch.setattr(room, "sample", lambda view: taken.append(view.layer) or sample(view))
    found = repeated_layers(paths, part.layers)
    assert found.tolist() == [0, 0, 2, 0, 2]
    repeated = evaluate(*about)
    monkeypatch.setattr(evaluation, "repeated_layers", lambda *_: np.arange(5))
    every = evaluate(*about)
    # The lowest lies on the bed, its equal on fibre.
    assert len(taken) == 3 + 5
    for name in NAMES:
        np.testing.assert_allclose(repeated.values[name], every.values[name], rtol=1e-12)


def test_a_place_that_rounds_to_zero_from_below_is_zero(make_part):
    """Layers are compared by their bytes, in which -0 is not 0."""
    part = make_part(bent, count=2)
    lines = ([[5.0, y], [55.0, y]] for y in (0.0, -1e-12))
    paths = Toolpaths.concatenate(part.paths(line, layer=k) for k, line in enumerate(lines))
    assert repeated_layers(paths, part.layers).tolist() == [0, 0]


def test_of_many_layers_some_tell_angles_and_distances(make_part):
    """What limits bound and what adds up is of all layers; the rest is that of the sample."""
    part = make_part(bent, count=5)
    lines = [WAVE, RING, OUT, SHORT]
    paths = Toolpaths.concatenate(
        part.paths(*lines[: 1 + k % 4], layer=k) for k in range(len(part.layers))
    )
    whole = evaluate(paths, part.layers, part.stress, MACHINE)
    some = evaluate(paths, part.layers, part.stress, MACHINE, most=3)
    assert (whole.taken_on_some, some.taken_on_some) == (0, 3)
    sampled = ("angle_mean", "coverage", "spacing_50", "border_50", "sinuosity", "least_angle")
    chosen = [0, 2, 4]
    for name in NAMES:
        taken = some.values[name]
        if np.isnan(taken[[1, 3]]).all() and not np.isnan(whole.values[name][[1, 3]]).all():
            np.testing.assert_array_equal(taken[chosen], whole.values[name][chosen])
        else:
            np.testing.assert_array_equal(taken, whole.values[name])
            assert name not in sampled
    kept = [part.layers[k] for k in chosen]
    of_sample = Toolpaths.concatenate(paths.on_layer(layer.index) for layer in kept)
    alone = evaluate(of_sample, kept, part.stress, MACHINE)
    for name in sampled[:-1]:
        assert some.total[name] == pytest.approx(alone.total[name])
    # Layers are equal here: gaps of five are five thirds of those of three.
    assert some.total["gap_area"] == pytest.approx(alone.total["gap_area"] * 5.0 / 3.0)
    with pytest.raises(InputError, match="most"):
        evaluate(paths, part.layers, part.stress, MACHINE, most=0)
