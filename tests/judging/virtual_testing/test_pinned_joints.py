"""Pinned joints against lugs whose areas and loads are known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from flat_paths import flat_paths

from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.patches import Box, Cylinder, Plane, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.comparison.tested_cases import in_all_cases
from ccfem.fem.elasticity import Bearing, Temperature
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.fem.elasticity.system import prepare
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.anchorage import PULL_OUT_STRENGTH, Anchorage
from ccfem.judging.virtual_testing.pinned_joints import PinnedJoint, about_pins, pinned_joints
from ccfem.judging.virtual_testing.strand import Limits, Strand
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar

WIDTH, DIAMETER, THICKNESS, END = 20.0, 8.0, 4.0, 12.0
TENSILE, CRUSHING = 50.0, 60.0
MATERIAL = isotropic(3000.0, 0.35, tensile_strength=TENSILE, compressive_strength=CRUSHING)


def lug(round_end=False):
    """A strip from x = -30 on, 20 mm wide, with a hole at the origin, 12 mm before its end."""
    strip = shapely.box(-30.0, -WIDTH / 2, 0.0 if round_end else END, WIDTH / 2)
    if round_end:
        strip = strip.union(shapely.Point(0.0, 0.0).buffer(WIDTH / 2, quad_segs=32))
    hole = shapely.Point(0.0, 0.0).buffer(DIAMETER / 2, quad_segs=32)
    mesh = extrude(strip.difference(hole), THICKNESS, 4.0)
    rules = {
        "hole": Cylinder((0.0, 0.0, 0.0), "z", DIAMETER / 2),
        "root": Plane("x", "min"),
        "end": Plane("x", "max", tolerance=0.5),
    }
    return patches_from_rules(mesh, rules)


def joints(mesh, load, held="root", fill=None):
    problem = Problem(mesh, MATERIAL, (Support(held),), {"pull": load}, order=1, fill=fill)
    stress = solve(problem)["pull"]
    forces = prepare(problem).forces_in("pull")
    return pinned_joints(stress, forces, 100.0, Limits.of(MATERIAL))


def test_a_pulled_lug_fails_as_in_closed_form():
    (joint,) = joints(lug(), (Bearing("hole", (100.0, 0.0, 0.0)),))
    assert joint.patch == "hole"
    np.testing.assert_allclose(joint.force, [100.0, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(joint.centre, [0.0, 0.0, THICKNESS / 2], atol=1e-3)
    assert joint.loads["bearing"] == pytest.approx(CRUSHING * DIAMETER * THICKNESS, rel=1e-3)
    net = TENSILE * (WIDTH - DIAMETER) * THICKNESS
    assert joint.loads["net section"] == pytest.approx(net, rel=1e-3)
    shear = TENSILE / np.sqrt(3.0) * 2.0 * END * THICKNESS
    assert joint.loads["shear-out"] == pytest.approx(shear, rel=1e-3)
    assert joint.mode == "bearing"
    assert joint.about == "bearing of 'hole' at 1920 N (net section 2400, shear-out 2771)"


def test_infill_is_crushed_where_the_pin_presses():
    """Filled by three tenths on one side of the pin; half of what it shears lies there too."""
    mesh = lug()
    middle = mesh.points[mesh.corners].mean(axis=1)[:, 0]
    fill = np.where(middle > 0.0, 0.3, 1.0)
    for way, share in ((1.0, 0.3), (-1.0, 1.0)):
        (joint,) = joints(mesh, (Bearing("hole", (way * 100.0, 0.0, 0.0)),), fill=fill)
        bearing = share * CRUSHING * DIAMETER * THICKNESS
        assert joint.loads["bearing"] == pytest.approx(bearing, rel=0.02)
    (joint,) = joints(mesh, (Bearing("hole", (100.0, 0.0, 0.0)),), fill=np.full(len(fill), 0.3))
    for mode, solid in (("bearing", 1920.0), ("net section", 2400.0), ("shear-out", 2771.0)):
        assert joint.loads[mode] == pytest.approx(0.3 * solid, rel=2e-3)


def test_a_round_end_is_shorter_beside_the_middle_and_a_push_stretches_nothing():
    (pulled,) = joints(lug(round_end=True), (Bearing("hole", (100.0, 0.0, 0.0)),))
    ahead = np.sqrt((WIDTH / 2) ** 2 - (1.01 * DIAMETER / 2) ** 2)  # less by its chords
    assert pulled.shear_area == pytest.approx(2.0 * ahead * THICKNESS, rel=0.02)
    (pushed,) = joints(lug(round_end=True), (Bearing("hole", (-100.0, 0.0, 0.0)),))
    assert pushed.loads["net section"] == np.inf
    assert pushed.shear_area == pytest.approx(2.0 * 30.0 * THICKNESS, rel=1e-3)
    assert pushed.mode == "bearing"
    (aside,) = joints(lug(round_end=True), (Bearing("hole", (0.0, 100.0, 0.0)),))
    assert aside.net_area == pytest.approx((WIDTH / 2 + 30.0 - DIAMETER) * THICKNESS, rel=1e-3)


def slotted():
    """The lug with a slot in place of its hole: round ends about x = 0 and x = -12."""
    slot = shapely.LineString([(-12.0, 0.0), (0.0, 0.0)]).buffer(DIAMETER / 2, quad_segs=16)
    strip = shapely.box(-40.0, -WIDTH / 2, END, WIDTH / 2)
    mesh = extrude(strip.difference(slot), THICKNESS, 4.0)
    inside = Box((-17.0, -4.5, -1.0), (4.5, 4.5, THICKNESS + 1.0), normal=None)
    mesh = patches_from_rules(mesh, {"slot": inside, "root": Plane("x", "min")})
    _, normal = mesh.facet_areas(mesh.patch("slot"))
    wall = mesh.patch("slot")[np.abs(normal[:, 2]) < 0.5]
    return mesh.with_patches({**mesh.patches, "slot": wall})


def test_a_pin_in_the_end_of_a_slot_is_judged_and_one_on_its_side_is_named():
    # Ahead of the end the lug is that of a round hole; what lies beside it is, too.
    mesh = slotted()
    (joint,) = joints(mesh, (Force("slot", (100.0, 0.0, 0.0)),))
    assert joint.loads["bearing"] == pytest.approx(CRUSHING * DIAMETER * THICKNESS, rel=2e-3)
    net = TENSILE * (WIDTH - DIAMETER) * THICKNESS
    assert joint.loads["net section"] == pytest.approx(net, rel=2e-3)
    shear = TENSILE / np.sqrt(3.0) * 2.0 * END * THICKNESS
    assert joint.loads["shear-out"] == pytest.approx(shear, rel=2e-3)
    loads = {"up": (Force("slot", (0.0, 100.0, 0.0)),)}
    problem = Problem(mesh, MATERIAL, (Support("root"),), loads, order=1)
    said = about_pins(solve(problem)["up"])
    assert said == "pins are not judged in 'slot': loaded where the wall of the hole is no cylinder"


def test_a_held_hole_is_judged_by_its_reaction_and_an_idle_one_is_not():
    pull = (Force("root", (-100.0, 0.0, 0.0)),)
    (held,) = joints(lug(), pull, "hole")
    np.testing.assert_allclose(held.force, [100.0, 0.0, 0.0], atol=1e-4)
    assert held.loads["net section"] == pytest.approx(TENSILE * 12.0 * THICKNESS, rel=1e-3)
    assert joints(lug(), pull, "end") == ()


def test_supports_beside_a_loaded_hole_do_not_relieve_its_pin():
    mesh = patches_from_rules(lug(), {"below": Plane("z", "min")})  # with the lower rim of the hole
    (joint,) = joints(mesh, (Bearing("hole", (100.0, 0.0, 0.0)),), "below")
    np.testing.assert_allclose(joint.force, [100.0, 0.0, 0.0], atol=1e-6)


def test_half_a_lug_at_its_plane_of_symmetry_bears_half():
    hole = shapely.Point(0.0, 0.0).buffer(DIAMETER / 2, quad_segs=32)
    half = shapely.box(-30.0, -WIDTH / 2, END, 0.0).difference(hole)
    rules = {
        "hole": Cylinder((0.0, 0.0, 0.0), "z", DIAMETER / 2),
        "root": Plane("x", "min"),
        "middle": Plane("y", "max"),
    }
    mesh = patches_from_rules(extrude(half, THICKNESS, 4.0), rules)
    pull = {"pull": (Force("hole", (100.0, 0.0, 0.0)),)}
    problem = Problem(mesh, MATERIAL, (Support("root"), Support("middle", "y")), pull, order=1)
    forces = prepare(problem).forces_in("pull")
    (joint,) = pinned_joints(solve(problem)["pull"], forces, 100.0, Limits.of(MATERIAL))
    whole = CRUSHING * DIAMETER * THICKNESS
    assert joint.loads["bearing"] == pytest.approx(0.5 * whole, rel=0.01)
    assert joint.loads["net section"] == pytest.approx(TENSILE * 6.0 * THICKNESS, rel=0.01)


def test_a_part_that_is_heated_says_why_its_pins_are_not_judged():
    material = isotropic(3000.0, 0.35, tensile_strength=TENSILE, expansion=7e-5)
    problem = Problem(lug(), material, (Support("hole"),), {"heat": (Temperature(40.0),)}, order=1)
    said = about_pins(solve(problem)["heat"])
    assert said.startswith("pins in holes are not judged: load case 'heat' heats the part")


def test_over_several_cases_the_least_multiple_of_a_load_counts():
    loads = {
        "pull": (Bearing("hole", (100.0, 0.0, 0.0)),),
        "push": (Bearing("hole", (-400.0, 0.0, 0.0)),),
    }
    problem = Problem(lug(), MATERIAL, (Support("root"),), loads, order=1)
    line = np.array([[-29.0, 7.0, 2.0], [5.0, 7.0, 2.0]])
    none = np.zeros(1, dtype=int)
    up = np.array([[0.0, 0.0, 1.0]] * 2)
    paths = Toolpaths(line, up, np.array([0, 2]), none, none, none.astype(bool))
    cases = WeightedCases.of(solve(problem))
    tested = in_all_cases(cut_strands(paths, problem.mesh), cases, Strand(), (), Machine())
    crushed = CRUSHING * DIAMETER * THICKNESS
    values = tested.values()
    for name in loads:
        assert values[f"pinned_joint_load[{name}]"] == pytest.approx(crushed, rel=1e-3)
    assert values["pinned_joint_factor"] == pytest.approx(crushed / 400.0, rel=1e-3)
    assert tested.weakest_pin[1] == "push"


def test_a_remark_on_the_part_without_fibre_names_the_weakest_pin():
    loads = {"pull": (Bearing("hole", (250.0, 0.0, 0.0)),)}
    stress = solve(Problem(lug(), MATERIAL, (Support("root"),), loads, order=1))["pull"]
    said = about_pins(stress)
    assert "bearing of 'hole' at 1920 N (net section 2400, shear-out 2771), of 1 hole," in said
    bare = Problem(lug(), isotropic(3000.0, 0.35), (Support("root"),), loads, order=1)
    assert about_pins(solve(bare)["pull"]) == ""  # no strength, nothing to say


def fibre(*lines):
    """Straight strands in the middle of the height, from and to places of the plane."""
    return flat_paths([[(*end, THICKNESS / 2) for end in line] for line in lines])


@pytest.fixture(scope="module")
def pulled():
    """The lug pulled by its hole, and its forces."""
    load = {"pull": (Bearing("hole", (100.0, 0.0, 0.0)),)}
    problem = Problem(lug(), MATERIAL, (Support("root"),), load, order=1)
    return solve(problem)["pull"], prepare(problem).forces_in("pull")


FLOW = PULL_OUT_STRENGTH * 2.0 * (1.0 + 0.11)
"""Force, N/mm, that a strand 1 mm wide takes up from the matrix."""


@pytest.mark.parametrize(
    ("line", "held"),
    [
        (((-25.0, 7.0), (10.0, 7.0)), 105.0),  # broken
        (((-25.0, -7.0), (1.2, -7.0)), 1.2 * FLOW),  # pulled out of what lies ahead
        (((-0.8, 7.0), (10.0, 7.0)), 0.8 * FLOW),  # and of what lies behind
        (((-6.0, 9.0), (6.0, 5.0)), 105.0 * 12.0 / np.hypot(12.0, 4.0)),  # at a slant
        (((-25.0, 7.0), (-0.5, 7.0)), 0.0),  # ends before the net section
        (((6.0, -8.0), (6.0, 8.0)), 0.0),  # across the force
    ],
)
def test_strands_beside_a_hole_hold_until_they_break_or_pull_out(pulled, line, held):
    stress, forces = pulled
    limits = Limits.of(MATERIAL, Strand(strength=105.0))
    anchorage = Anchorage.of(cut_strands(fibre(line), stress.mesh), Machine())
    (joint,) = pinned_joints(stress, forces, 100.0, limits, anchorage)
    assert joint.loads.get("strand pull-out", 0.0) == pytest.approx(held, rel=0.03)
    assert joint.mode == "bearing"  # the matrix beside the hole holds more than one strand


@pytest.mark.parametrize("place", [0.0, 0.37])
def test_several_strands_across_a_plane_hold_by_their_shorter_sides(place):
    """Each by itself: shear stress that is even times the girth and the shorter side, along it.

    Of three along x, 3, 7 and 2.5 mm are beyond the plane or before it; one at 3:4 to its normal,
    5 mm long there, counts by its cosine, .6; and one ends before it.
    """
    mesh = box_mesh((60.0, 20.0, 2.0), (17, 5, 1))
    x = 30.0 + place
    ends = [
        ([x - 3.0, 2.0], [x + 15.0, 2.0]),
        ([x - 20.0, 4.0], [x + 7.0, 4.0]),
        ([x - 2.5, 6.0], [x + 2.6, 6.0]),
        ([x - 3.0, 8.0], [x + 6.0, 20.0]),
        ([x - 20.0, 18.0], [x - 1.0, 18.0]),
    ]
    (layer,) = Planar(count=1).cut(mesh)
    lines = Toolpaths.from_plane([np.array(line) for line in ends], layer)
    anchorage = Anchorage.of(cut_strands(lines, mesh), Machine())
    whole = np.array([[-60.0, 60.0, -20.0, 20.0]])
    held = anchorage.held(np.array([x, 0.0, 1.0]), np.eye(3), whole, np.inf)
    flow = PULL_OUT_STRENGTH * 2.0 * (Machine().fibre_width + Machine().strand_height)
    assert held == pytest.approx(flow * (3.0 + 7.0 + 2.5 + 0.6 * 5.0), rel=1e-9)
    # Where strands break at the force of 4 mm, so much is what the longest of them holds.
    held = anchorage.held(np.array([x, 0.0, 1.0]), np.eye(3), whole, 4.0 * flow)
    assert held == pytest.approx(flow * (3.0 + 4.0 + 2.5 + 0.6 * 4.0), rel=1e-9)
    # The slanting one crosses the plane at y = 8 + 3 * 4 / 3.
    there = np.array([[11.99, 12.01, -20.0, 20.0]])
    held = anchorage.held(np.array([x, 0.0, 1.0]), np.eye(3), there, np.inf)
    assert held == pytest.approx(flow * 0.6 * 5.0, rel=1e-9)


def test_a_strand_holds_no_farther_than_it_carries_and_as_far_as_it_does():
    """It carries nothing up to a face of the cells, 5 mm before the plane, and then half."""
    mesh = box_mesh((60.0, 20.0, 2.0), (12, 5, 1))
    (layer,) = Planar(count=1).cut(mesh)
    line = Toolpaths.from_plane([np.array([[10.0, 3.0], [50.0, 3.0]])], layer)
    strands = cut_strands(line, mesh)
    strands = replace(strands, share=np.where(strands.middle[:, 0] < 25.0, 0.0, 0.5))
    anchorage = Anchorage(strands, 40.0)
    whole = np.array([[-60.0, 60.0, -20.0, 20.0]])
    held = anchorage.held(np.array([30.0, 0.0, 1.0]), np.eye(3), whole, np.inf)
    assert held == pytest.approx(0.5 * 40.0 * 5.0, rel=1e-9)


def test_a_hole_parts_where_matrix_and_strands_beside_it_have_gone():
    loads = {"bearing": 5.0, "net section": 2.0, "strand pull-out": 3.0, "shear-out": 4.0}
    joint = PinnedJoint("hole", np.zeros(3), np.ones(3), 8.0, 4.0, 1.0, 1.0, loads)
    assert (joint.mode, joint.load) == ("strand pull-out", 3.0)
    fewer = replace(joint, loads=loads | {"strand pull-out": 1.0})
    assert (fewer.mode, fewer.load) == ("net section", 2.0)
