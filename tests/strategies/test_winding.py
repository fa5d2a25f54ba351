"""Strands that wind: on a plate with two bolts, flat and rolled up, and on published layers."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.mesh.patches import Cylinder, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.cases.bodies import T_BRACKET_HOLES as WALLS
from ccfem.fem.elasticity import Bearing, Force, GivenStress, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.printing.export.robot_waypoints import read_layer_waypoints
from ccfem.slicing.slicers import Planar
from ccfem.slicing.slicers.surfaces import Surfaces
from ccfem.strategies import create
from ccfem.strategies.winding_curves.piece import joint_loops

HOLES = np.array([[20.0, 15.0], [60.0, 15.0]])
MACHINE = Machine()


@pytest.fixture(scope="module")
def link():
    """80 x 30 x 4 mm with two holes of radius 5; one held, the other pulled away from it."""
    outline = shapely.box(0.0, 0.0, 80.0, 30.0)
    for centre in HOLES:
        outline = outline.difference(shapely.Point(centre).buffer(5.0, quad_segs=12))
    rules = {
        "held": Cylinder((20.0, 15.0, 0.0), "z", 5.0),
        "pulled": Cylinder((60.0, 15.0, 0.0), "z", 5.0, half="x"),
    }
    mesh = patches_from_rules(extrude(outline, 4.0, 2.5), rules)
    pull = {"pull": (Bearing("pulled", (300.0, 0.0, 0.0)),)}
    return solve(Problem(mesh, isotropic(3500.0, 0.35), (Support("held"),), pull))["pull"]


def rounds(path):
    """How many holes a closed path goes round."""
    ring = shapely.Polygon(path[:, :2])
    return sum(ring.contains(shapely.Point(centre).buffer(4.9)) for centre in HOLES)


def test_every_strand_is_closed_and_goes_once_round_both_bolts(link):
    layers = Planar(count=2).cut(link.mesh)
    paths = plan(create("winding"), layers, link, MACHINE)
    assert paths.closed.all()
    assert [rounds(path) for path in paths] == [2] * len(paths)
    # Between a hole and the border there are 10 mm: 4 or 5 strands of 2.2 mm.
    assert all(3 <= len(paths.on_layer(k)) <= 5 for k in (0, 1))


def test_without_the_cut_each_bolt_has_rings_of_its_own(link):
    layers = Planar(count=1).cut(link.mesh)
    even = {"weight": "even", "isotropy": 100.0, "smoothness": 0.0}
    paths = plan(create("winding", {**even, "cut": False}), layers, link, MACHINE)
    assert min(rounds(path) for path in paths) == 1
    paths = plan(create("winding", even), layers, link, MACHINE)
    assert {rounds(path) for path in paths} == {2}


def test_even_weight_and_no_stress_term_keep_the_spacing(link):
    layers = Planar(count=1).cut(link.mesh)
    given = {"weight": "even", "isotropy": 100.0, "smoothness": 0.0, "spacing": 2.0}
    paths = plan(create("winding", given), layers, link, MACHINE)
    lines = [shapely.LineString(path[:, :2]) for path in paths]
    away = [
        min(other.distance(shapely.Point(point)) for other in lines if other is not line)
        for line in lines
        for point in shapely.get_coordinates(line)[::4]
    ]
    # 60 % of the length keeps what was asked for, or as near as a whole number of strands allows.
    assert np.quantile(away, 0.4) > 1.5


def test_even_strands_keep_seven_tenths_of_the_spacing_and_leave_less_bare(link):
    layers = Planar(count=1).cut(link.mesh)
    found = {}
    for even in (False, True):
        paths = plan(
            create("winding", {"even": even, "minimum_length": 15.0}), layers, link, MACHINE
        )
        lines = [shapely.LineString(path[:, :2]) for path in paths]
        nearest = min(a.distance(b) for k, a in enumerate(lines) for b in lines[:k])
        covered = shapely.union_all([line.buffer(0.75 * 2.2) for line in lines])
        found[even] = nearest, covered.intersection(layers[0].plane.polygon).area, paths
    assert found[False][0] < 1.4
    assert found[True][0] > 0.7 * 2.2 * 0.98
    assert found[True][1] > 1.02 * found[False][1]
    assert found[False][2].closed.all()
    assert not found[True][2].closed.all()


def test_on_a_rolled_layer_strands_wind_as_on_the_flat_one(link):
    """The field lives on the surface: rolled up with its stress, it gets the same strands."""
    radius = 30.0
    mesh = link.mesh
    flat = Planar(count=1).cut(mesh)[0]
    angle = (flat.points[:, 0] - 40.0) / radius
    points = np.column_stack([radius * np.sin(angle), flat.points[:, 1], radius * np.cos(angle)])
    curved = replace(flat, points=points, flat=None)
    turn = (mesh.points[:, 0] - 40.0) / radius
    stress = GivenStress(
        mesh,
        rolled(link.stress, turn[mesh.cells].mean(axis=1)),
        rolled(link.nodal, turn),
        link.held_or_loaded,
        link.loaded,
    )
    # By the stress: lines would be traced through the flat mesh, which knows nothing of the roll.
    strategy = create("winding", {"weight": "stress"})
    expected = plan(strategy, [flat], link, MACHINE)
    found = plan(strategy, [curved], stress, MACHINE)
    assert len(found) == len(expected)
    np.testing.assert_allclose(found.lengths, expected.lengths, rtol=0.01)
    size = np.linalg.norm(found.points[:, [0, 2]], axis=1)
    np.testing.assert_allclose(size, radius, atol=0.1)
    # Sizes beyond the roll's chords: normals point out of the cylinder.
    out = found.points[:, [0, 2]] / size[:, None]
    assert (np.einsum("pd,pd->p", found.normals[:, [0, 2]], out) > 0.99).all()


def test_fields_that_a_layer_keeps_are_those_of_the_same_parameters(link):
    """Another spacing takes the field over; another isotropy, joint or stress does not."""
    known = Planar(count=1).cut(link.mesh)
    plan(create("winding"), known, link, MACHINE)
    other = replace(link.problem, loads={"pull": (Force("pulled", (50.0, 300.0, 0.0)),)})
    for given, stress in (
        ({"spacing": 3.0}, link),
        ({"isotropy": 1.0}, link),
        ({"joints": ["pulled"]}, link),
        ({}, solve(other)["pull"]),
    ):
        strategy = create("winding", given)
        fresh = plan(strategy, Planar(count=1).cut(link.mesh), stress, MACHINE)
        found = plan(strategy, known, stress, MACHINE)
        np.testing.assert_array_equal(found.points, fresh.points)


def rolled(stress, angle):
    c, s, o = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    turn = np.stack([c, o, s, o, o + 1.0, o, -s, o, c], axis=-1).reshape(-1, 3, 3)
    return turn @ stress @ np.swapaxes(turn, 1, 2)


def test_a_part_without_holes_at_its_joints_is_refused_in_one_line():
    mesh = box_mesh((60.0, 24.0, 3.0), (15, 6, 1))
    pull = {"pull": (Force("x_max", (300.0, 0.0, 0.0)),)}
    stress = solve(Problem(mesh, isotropic(3500.0, 0.3), (Support("x_min"),), pull))["pull"]
    with pytest.raises(InputError, match="none of x_max, x_min is one") as caught:
        plan(create("winding"), Planar(count=1).cut(mesh), stress, MACHINE)
    assert "\n" not in str(caught.value)


def test_one_joint_is_wound_round_and_unknown_ones_are_named(link):
    layers = Planar(count=1).cut(link.mesh)
    paths = plan(create("winding", {"joints": ["pulled"]}), layers, link, MACHINE)
    assert paths.closed.all()
    assert all(shapely.Polygon(path[:, :2]).contains(shapely.Point(HOLES[1])) for path in paths)
    with pytest.raises(InputError, match="no patch named 'pushed'"):
        plan(create("winding", {"joints": ["pushed"]}), layers, link, MACHINE)
    with pytest.raises(InputError, match="joined must be at least 1"):
        create("winding", {"joined": 0})


@pytest.mark.skipif("CCFEM_FANG2024" not in os.environ, reason="data of the authors")
def test_measures_of_a_published_layer_are_those_found_by_others(tmp_path):
    """One published layer of the T-bracket: four closed strands, 352 mm long (median of all)."""
    folder = Path(os.environ["CCFEM_FANG2024"])
    with np.load(folder / "TBracket-solid.npz") as archive:
        mesh = TetMesh(archive["V"], archive["T"])
    mesh = patches_from_rules(mesh, WALLS)
    strands = folder / "TBracket" / "toolpath" / "30.txt"
    place = np.loadtxt(strands)[::25, :3]
    files = sorted((folder / "TBracket" / "matrixLayer").glob("*.obj"))
    corner = {file: points_of(file) for file in files}
    nearest = min(files, key=lambda file: np.median(distance(place, corner[file])))
    (tmp_path / nearest.name).write_bytes(nearest.read_bytes())
    m, n = len(mesh.cells), len(mesh.points)
    stress = GivenStress(mesh, np.zeros((m, 3, 3)), np.zeros((n, 3, 3)))
    (layer,) = Surfaces(str(tmp_path))(stress, (0.0, 1.0, 0.0), MACHINE)
    assert set(joint_loops(layer, ["base_left", "base_right", "head"])) == {
        "base_left",
        "base_right",
        "head",
    }
    paths = read_layer_waypoints(strands, layer)
    assert len(paths) == 4
    assert paths.closed.all()
    assert np.median(paths.lengths) == pytest.approx(352.0, rel=0.05)


def points_of(file):
    rows = [line.split()[1:4] for line in file.read_text().splitlines() if line.startswith("v ")]
    return np.array(rows, dtype=float)


def distance(points, others):
    return cKDTree(others).query(points)[0]
