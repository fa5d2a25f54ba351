"""The bridge of Wang et al. 2021 as one path, and parts without a frame."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.patches import Plane, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.cases import create_case
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.geometry.polylines import resample, turning_angles
from ccfem.judging.evaluation import evaluate
from ccfem.judging.evaluation.indices.matching import matching_rate
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.slicing.layers.layer import stress_on
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create
from ccfem.strategies.svt import Svt

DISC = shapely.Point(0, 0).buffer(9.0, quad_segs=32) & shapely.box(-8.9, -9, 8.9, 9)
"""With short flats to hold and pull it at."""
MACHINE = Machine(fibre_width=0.9, minimum_radius=1.5, minimum_length=5.0)
WIDE = replace(MACHINE, fibre_width=1.8, minimum_radius=3.0)


@pytest.fixture(scope="module", autouse=True)
def groups_once():
    """Find the main paths of a layer once for all strategies that differ in their links alone."""
    groups, known = Svt.groups, {}
    links = {name: getattr(Svt, name) for name in ("links", "longest_inside", "longest_over_void")}

    def once(strategy, piece, stress, machine):
        alike = replace(strategy, **links, minimum_length=strategy._shortest(machine))
        key = alike, piece.wkb, machine, id(stress)
        if key not in known:
            known[key] = stress, groups(strategy, piece, stress, machine)
        return [[line.copy() for line in group] for group in known[key][1]]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Svt, "groups", once)
        yield groups


@pytest.fixture(scope="module")
def bridge():
    case = create_case("bridge")
    stress = solve(case.problem)["down"]
    layer = Planar(count=1).cut(case.problem.mesh, case.build)[0]
    return layer, stress_on(layer, stress), case.machine


@pytest.fixture(scope="module")
def bridge_path(bridge):
    return create("svt")(*bridge)


def pulled(section):
    """Layer, and stress of a part that is pulled along x."""
    mesh = extrude(section, 1.0, 2.0, 1)
    rules = {name: Plane("x", side, 1e-6) for name, side in (("left", "min"), ("right", "max"))}
    mesh = patches_from_rules(mesh, rules)
    load = {"pull": (Force("right", (100.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(1000.0, 0.3), (Support("left"),), load)
    layer = Planar(count=1).cut(mesh)[0]
    return layer, stress_on(layer, solve(problem)["pull"])


def plane_strands(paths):
    """Strands between links, as (n, 2) arrays."""
    found = []
    for start, end in zip(paths.offsets[:-1], paths.offsets[1:], strict=True):
        laid = np.concatenate([[False], ~paths.link[start : end - 1], [False]])
        edges = np.flatnonzero(np.diff(laid.astype(int)))
        points = paths.points[start:end, :2]
        found += [points[a : b + 1] for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return found


def test_bridge_is_one_path_with_its_links_outside(bridge, bridge_path):
    layer, _, _ = bridge
    assert len(bridge_path) == 1
    starts = np.flatnonzero(bridge_path.link)
    plane = bridge_path.points[:, :2]
    links = shapely.linestrings(np.stack([plane[starts], plane[starts + 1]], axis=1))
    inner = layer.plane.polygon.buffer(-1e-6)
    assert shapely.length(shapely.intersection(links, inner)).sum() < 1e-3
    for strand in plane_strands(bridge_path):
        assert layer.plane.polygon.buffer(1e-4).covers(shapely.LineString(strand))


def test_links_outside_are_never_left_out(bridge, bridge_path):
    strict = create("svt", {"longest_inside": 0.0})(*bridge)
    np.testing.assert_array_equal(strict.points, bridge_path.points)


def test_main_paths_do_not_depend_on_links(bridge, groups_once):
    """What `groups_once` relies on."""
    layer, stress, machine = bridge
    about = layer.plane.polygon, stress, machine
    by_default = groups_once(create("svt"), *about)
    options = {"links": "none", "longest_inside": 3.0, "longest_over_void": 4.0}
    for group, same in zip(by_default, groups_once(create("svt", options), *about), strict=True):
        np.testing.assert_equal(group, same)


def test_bridge_has_arch_tie_and_four_diagonals(bridge):
    """Figure 7 of the paper: the arch with the rafters, the tie, and the diagonals between."""
    layer, stress, machine = bridge
    groups = create("svt").groups(layer.plane.polygon, stress, machine)
    assert len(groups) == 6
    reach = sorted(np.ptp(np.concatenate(group)[:, 0]) for group in groups)
    assert all(size > 170.0 for size in reach[4:])
    assert all(30.0 < size < 70.0 for size in reach[:4])


def test_bridge_is_covered_without_sharp_turns(bridge, bridge_path):
    layer, _, machine = bridge
    strands = plane_strands(bridge_path)
    beads = shapely.buffer([shapely.LineString(s) for s in strands], 0.5 * machine.fibre_width)
    covered = (
        shapely.union_all(beads).intersection(layer.plane.polygon).area / layer.plane.polygon.area
    )
    assert covered >= 0.96
    for strand in strands:
        even, offsets = resample(strand, np.array([0, len(strand)]), 0.5)
        turn = turning_angles(even, offsets, np.zeros(1, dtype=bool))
        assert (2.0 * np.sin(0.5 * turn) / 0.5).max() <= 0.26


@pytest.mark.parametrize(
    ("name", "inside"), [("suspension", 20.0), ("l_shape", 5.0)], ids=["suspension", "l_shape"]
)
def test_frames_of_the_paper_are_one_path_of_strands_side_by_side(name, inside, monkeypatch):
    case = create_case(name, element_size=3.0)
    stress = solve(case.problem)["down"]
    layers = Planar(count=1).cut(case.problem.mesh, case.build)
    strategy, made = create("svt"), []
    groups_of = type(strategy).groups
    monkeypatch.setattr(
        type(strategy), "groups", lambda *given: made.append(groups_of(*given)) or made[-1]
    )
    paths = strategy(layers[0], stress_on(layers[0], stress), case.machine)
    assert len(paths) == 1
    found = evaluate(paths, layers, stress, case.machine).total
    assert found["link_inside"] <= inside
    assert found["coverage"] >= 0.95
    # Distance to the nearest strand of the same main path, along all of them.
    apart = []
    (groups,) = made
    for group in groups:
        lines = np.array([shapely.LineString(track) for track in group])
        for k, track in enumerate(group):
            even, _ = resample(track, np.array([0, len(track)]), 0.5)
            even = even[shapely.contains_xy(layers[0].plane.polygon, *even.T)]
            others = shapely.multilinestrings(np.delete(lines, k))
            apart.append(shapely.distance(shapely.points(even), others))
    assert np.percentile(np.concatenate(apart), 5.0) >= 0.5


def test_alignment_in_the_joints_raises_the_matching_rate(bridge, bridge_path):
    """Within 5 and 10 degrees, by 1.5 points of a hundred at least."""
    unaligned = create("svt", {"aligned": False})(*bridge)
    rates = [matching_rate(paths, [bridge[1]], links=False) for paths in (bridge_path, unaligned)]
    assert (rates[0][:2] > rates[1][:2] + 0.015).all()


def test_single_strands_are_those_of_the_path(bridge, bridge_path):
    single = create("svt", {"links": "none", "minimum_length": 0.0})(*bridge)
    joined = plane_strands(bridge_path)
    assert len(single) == len(joined)
    assert single.lengths.sum() == pytest.approx(
        sum(shapely.LineString(strand).length for strand in joined), rel=1e-6
    )
    assert not single.link.any()


def test_paths_traced_over_points_lie_on_the_medial_axis():
    """The strip has one, along its middle; nothing is filled or linked."""
    layer, stress = pulled(shapely.box(0, 0, 60, 9))
    paths = create("svt", {"mode": "points"})(layer, stress, MACHINE)
    assert len(paths) == 1
    np.testing.assert_allclose(paths.points[:, 1], 4.5, atol=1e-3)
    assert np.ptp(paths.points[:, 0]) > 50.0
    assert not paths.link.any()


@pytest.fixture(scope="module")
def plate_with_hole():
    """Both ends are wide members, each forked into two beside the hole."""
    return pulled(shapely.box(-60, -12, 60, 12) - shapely.Point(0, 0).buffer(5.0))


def test_strands_flow_round_a_hole(plate_with_hole):
    """Those of both wide ends share the two members beside it: none crosses another."""
    layer, stress = plate_with_hole
    groups = create("svt").groups(layer.plane.polygon, stress, MACHINE)
    lines = [shapely.LineString(track) for group in groups for track in group]
    assert not any(a.crosses(b) for k, a in enumerate(lines) for b in lines[:k])
    through = [line for line in lines if np.ptp(line.xy[0]) > 119.0]
    assert len(through) >= 12
    # As many above the hole as below.
    assert sum(line.interpolate(0.5, normalized=True).y > 0.0 for line in through) * 2 == len(
        through
    )


def test_wide_members_are_not_laid_over_each_other(plate_with_hole):
    layer, stress = plate_with_hole
    paths = create("svt", {"links": "none"})(layer, stress, MACHINE)
    lines = np.split(paths.points[:, :2], paths.offsets[1:-1])
    beads = shapely.buffer([shapely.LineString(x) for x in lines], 0.45, cap_style="flat")
    covered = (
        shapely.union_all(beads).intersection(layer.plane.polygon).area / layer.plane.polygon.area
    )
    assert covered > 0.95
    assert paths.lengths.sum() * MACHINE.fibre_width / layer.plane.polygon.area < 1.15


@pytest.mark.parametrize("longest", [6.0, 1000.0])
def test_no_link_lies_inside_for_longer_than_is_allowed(plate_with_hole, longest):
    layer, stress = plate_with_hole
    # Strands that end in the joints are linked there, or not at all.
    strategy = create("svt", {"longest_inside": longest, "crossings": False})
    paths = strategy(layer, stress, WIDE)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], paths.link]).astype(int)))
    plane = paths.points[:, :2]
    links = [plane[a : b + 1] for a, b in zip(edges[::2], edges[1::2], strict=True)]
    inside = [shapely.LineString(x).intersection(layer.plane.polygon).length for x in links]
    assert len(plane_strands(paths)) == len(links) + len(paths)
    assert max(inside) <= longest
    if longest == 1000.0:
        assert len(paths) == 1
        assert max(inside) > 6.0
    else:
        assert len(paths) > 10


def test_no_link_lies_over_voids_where_none_may(plate_with_hole):
    layer, stress = plate_with_hole
    hole = shapely.Polygon(layer.plane.polygon.interiors[0]).buffer(-1e-3)
    over = []
    for parameters in ({}, {"longest_over_void": 0.0}):
        paths = create("svt", parameters)(layer, stress, MACHINE)
        start = np.flatnonzero(paths.link)
        steps = np.stack([paths.points[start, :2], paths.points[start + 1, :2]], axis=1)
        over.append(shapely.length(shapely.intersection(shapely.linestrings(steps), hole)).sum())
    assert over[0] > 9.0
    assert over[1] == 0.0


@pytest.mark.parametrize("section", [shapely.box(0, 0, 18, 18), DISC], ids=["square", "disc"])
def test_square_and_disc_are_filled_by_rings(section):
    layer, stress = pulled(section)
    paths = create("svt")(layer, stress, MACHINE)
    fill = paths.lengths.sum() * MACHINE.fibre_width / layer.plane.polygon.area
    assert 0.85 < fill < 1.02
    assert not paths.link.any()


def test_strip_is_one_path_of_straight_strands():
    layer, stress = pulled(shapely.box(0, 0, 60, 9))
    paths = create("svt", {"aligned": False})(layer, stress, MACHINE)
    assert len(paths) == 1
    strands = plane_strands(paths)
    assert len(strands) == 10
    for strand in strands:
        assert np.ptp(strand[:, 1]) < 1e-6
        assert np.ptp(strand[:, 0]) == pytest.approx(60.0, abs=1e-3)


def test_every_piece_of_a_section_has_its_path():
    """A fork is sliced across its prongs, 6 and 9 mm wide and 30 mm deep."""
    fork = shapely.box(0, 0, 40, 6) | shapely.box(0, 6, 6, 20) | shapely.box(31, 6, 40, 20)
    mesh = extrude(fork, 30.0, 3.0, 10)
    mesh = patches_from_rules(
        mesh, {"foot": Plane("y", "min", 1e-6), "top": Plane("y", "max", 1e-6)}
    )
    load = {"pull": (Force("top", (0.0, 0.0, 100.0)),)}
    stress = solve(Problem(mesh, isotropic(1000.0, 0.3), (Support("foot"),), load))["pull"]
    layer = Planar(count=4).cut(mesh, (0.0, 1.0, 0.0))[3]
    paths = create("svt")(layer, stress_on(layer, stress), MACHINE)
    assert len(paths) == 2
    counts = sorted(len(plane_strands(paths.select(np.arange(2) == k))) for k in range(2))
    assert counts == [7, 10]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mode", "walk"),
        ("longest_inside", -1.0),
        ("longest_over_void", -1.0),
        ("minimum_length", -1.0),
        ("spacing", 0.5),
        ("links", "inside"),
        ("turn", 180.0),
        ("width_ratio", 0.5),
    ],
)
def test_parameters_out_of_range_are_refused(name, value):
    with pytest.raises(InputError, match=f"svt.{name}"):
        create("svt", {name: value})


def test_layers_of_one_section_have_one_plan():
    """The stress differs from layer to layer, by rounding or more; the section does not."""
    mesh = box_mesh((60.0, 9.0, 4.0), (24, 4, 3))
    loads = {"bend": (Force("x_max", (0.0, 0.0, 20.0)),)}
    stress = solve(Problem(mesh, isotropic(3500.0, 0.3), (Support("x_min"),), loads, order=1))
    layers = Planar(count=3).cut(mesh)
    paths = plan(create("svt"), layers, stress["bend"], MACHINE)
    first, *others = (paths.on_layer(layer.index) for layer in layers)
    assert len(first) == 1
    for other in others:
        np.testing.assert_array_equal(other.points[:, :2], first.points[:, :2])
        np.testing.assert_array_equal(other.link, first.link)
        assert other.points[0, 2] > first.points[0, 2] + 1.0
