"""Loads, supports, regions and combinations of part files."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

import ccfem.cases.part_file
from ccfem.base.errors import InputError
from ccfem.body.files import write_mesh
from ccfem.body.files.surface import Surface
from ccfem.body.mesh import box_mesh
from ccfem.body.mesh.patches import Plane
from ccfem.cases.inspection import check
from ccfem.cases.part_file import REGIONS, check_before_meshing, read_part
from ccfem.cases.part_loads import LOADS, SUPPORTS
from ccfem.cases.part_writing import part_text
from ccfem.comparison.plot.part_picture import support_marks
from ccfem.fem.elasticity import (
    Bearing,
    BodyForce,
    Centrifugal,
    Displacement,
    EdgeSupport,
    Force,
    Foundation,
    Gravity,
    LocalSupport,
    Moment,
    NodeForces,
    NodeSupport,
    Pin,
    PointForce,
    PointSpring,
    PointSupport,
    PressingSupport,
    Pressure,
    RigidPatch,
    SlidingSupport,
    Spring,
    Support,
    Temperature,
    TiedPatch,
    Traction,
    prepare,
    solve,
)
from ccfem.fem.elasticity.statics import support_sets

EXAMPLE = Path(ccfem.__file__).parent / "cases" / "examples" / "loads_and_supports.toml"

PART = """
mesh = "body.npz"
order = 1
material = { modulus = 1000, poisson = 0.0, mass_density = 2.0, expansion = 1e-4 }
"""
HELD = '[[supports]]\npatch = "x_min"\n'
PULLED = '[[loads.pull]]\nkind = "force"\npatch = "x_max"\nvector = [10, 0, 0]\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a body of 20 x 2 x 1 mm."""
    folder = tmp_path_factory.mktemp("part")
    write_mesh(box_mesh((20.0, 2.0, 1.0), (10, 2, 1)), folder / "body.npz")
    return folder


def read(folder, text):
    path = folder / "part.toml"
    path.write_text(text)
    return read_part(path).problem


def test_the_example_balances():
    """Supports carry the loads; pin and spring and guide, heat and motion carry no resultant."""
    problem = read_part(EXAMPLE).problem
    assert [region.material.name for region in problem.regions] == ["brass"]
    fields_of = solve(problem)
    assert list(fields_of) == ["press", "weight", "heat", "lifted", "hot"]
    volumes = fields_of["weight"].mesh.volumes  # quadratic cells, which follow round walls
    bush = problem.regions[0].cells
    mass = 1.14e-9 * volumes.sum() + (8.5e-9 - 1.14e-9) * volumes[bush].sum()  # tonnes
    wanted = {"press": 0.05 * 80 * 6, "weight": 9810 * mass, "heat": 0.0, "lifted": 0.0}
    wanted["hot"] = 1.5 * wanted["press"] + 1.35 * wanted["weight"]
    for name, field in fields_of.items():
        np.testing.assert_allclose(field.reactions.sum(axis=0), [0, wanted[name], 0], atol=1e-4)
    end = np.isclose(problem.mesh.points[:, 0], 80.0)
    np.testing.assert_allclose(fields_of["lifted"].displacement[: len(end)][end, 1], 0.2)
    parts = [fields_of["press"], fields_of["weight"], fields_of["heat"]]
    total = sum(k * f.displacement for k, f in zip((1.5, 1.35, 1.0), parts, strict=True))
    np.testing.assert_allclose(fields_of["hot"].displacement, total, atol=1e-12)


def test_supports_are_those_of_the_file(folder):
    text = """
[[supports]]
kind = "held"
patch = "x_min"
components = "x"
[[supports]]
kind = "edge"
patches = ["x_min", "y_min"]
components = "y"
value = [0, 0, 0]
[[supports]]
kind = "point"
point = [0, 0, 0]
components = "z"
[[supports]]
kind = "nodes"
name = "ends"
points = [[0, 0, 0], [0, 2, 0]]
components = "z"
[[supports]]
kind = "local"
patch = "y_min"
points = [[0, 0, 0], [1, 0, 0]]
system = "cylindrical"
components = "xz"
[[supports]]
kind = "sliding"
patch = "y_max"
normal = "-y"
value = 0.1
[[supports]]
kind = "rigid"
patch = "x_max"
components = ""
rotations = "x"
angle = [1, 0, 0]
centre = [20, 1, 0.5]
[[supports]]
kind = "pin"
patch = "z_min"
point = [10, 1, 0]
axis = [0, 0, 2]
slides = true
[[supports]]
kind = "spring"
patch = "z_max"
stiffness = [1, 0, 2.5]
[[supports]]
kind = "point_spring"
point = [20, 0, 0]
stiffness = [0, 3, 0]
[[supports]]
kind = "foundation"
patch = "z_max"
normal = 4
tangential = 0.5
[[supports]]
kind = "pressing"
patch = "y_min"
normal = "-y"
[[supports]]
kind = "tied"
patch = "z_min"
to = "x_min"
within = 0.1
"""
    problem = read(folder, PART + text + PULLED)
    assert problem.supports == (
        Support("x_min", "x"),
        EdgeSupport(("x_min", "y_min"), "y"),
        PointSupport((0.0, 0.0, 0.0), "z"),
        NodeSupport("ends", ((0.0, 0.0, 0.0), (0.0, 2.0, 0.0)), "z"),
        LocalSupport("y_min", ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), "cylindrical", "xz"),
        SlidingSupport("y_max", "-y", 0.1),
        RigidPatch("x_max", "", "x", angle=(1.0, 0.0, 0.0), centre=(20.0, 1.0, 0.5)),
        Pin("z_min", (10.0, 1.0, 0.0), (0.0, 0.0, 2.0), slides=True),
        Spring("z_max", (1.0, 0.0, 2.5)),
        PointSpring((20.0, 0.0, 0.0), (0.0, 3.0, 0.0)),
        Foundation("z_max", 4.0, 0.5),
        PressingSupport("y_min", "-y"),
        TiedPatch("z_min", "x_min", 0.1),
    )
    assert len(problem.supports) == len(SUPPORTS)


VOLUME = """
[[loads.push]]
kind = "body_force"
vector = [0.01, 0, 0]
[[loads.weight]]
kind = "gravity"
acceleration = [-10, 0, 0]
[[loads.heavy]]
kind = "gravity"
acceleration = [-10, 0, 0]
mass_density = 4.0
[[loads.heat]]
kind = "temperature"
change = 10
[[loads.moved]]
kind = "displacement"
patch = "x_min"
vector = [0.1, 0, 0]
[combinations.both]
weight = 2
heat = 1.5
"""


def test_loads_stretch_a_bar_as_they_should(folder):
    """A bar of length L under q N/mm^3 grows by q L^2 / 2 E, under heat by a T L."""
    problem = read(folder, PART.replace("order = 1", "order = 2") + HELD + VOLUME)
    assert dict(problem.loads) == {
        "push": (BodyForce((0.01, 0.0, 0.0)),),
        "weight": (Gravity((-10.0, 0.0, 0.0)),),
        "heavy": (Gravity((-10.0, 0.0, 0.0), 4.0),),
        "heat": (Temperature(10.0),),
        "moved": (Displacement("x_min", (0.1, 0.0, 0.0)),),
    }
    found = solve(problem)
    ends = problem.mesh.points[:, 0] == 20.0
    tip = {name: field.displacement[ends, 0].mean() for name, field in found.items()}
    weight = -2.0e-9 * 1e4 * 20.0**2 / (2 * 1000.0)
    assert tip["push"] == pytest.approx(0.01 * 20.0**2 / (2 * 1000.0))
    assert tip["weight"] == pytest.approx(weight)
    assert tip["heavy"] == pytest.approx(2 * weight)
    assert tip["heat"] == pytest.approx(1e-4 * 10 * 20, rel=0.01)  # held across at its root
    assert tip["moved"] == pytest.approx(0.1)
    assert tip["both"] == pytest.approx(2 * tip["weight"] + 1.5 * tip["heat"])


def test_weights_are_of_load_cases_and_combinations(folder):
    path = folder / "weighted.toml"
    path.write_text(PART + HELD + VOLUME + "[weights]\npush = 1.0\nboth = 0.5\n")
    assert dict(read_part(path).weights) == {"push": 1.0, "both": 0.5}
    assert "[weights]" in part_text(read_part(path), "body.npz")


def test_regions_are_of_another_material(folder):
    """Two bars end to end: F L / E A of each."""
    regions = """
[regions.soft]
rule = "box"
lower = [10, -inf, -inf]
upper = [inf, inf, inf]
material = { modulus = 250, poisson = 0.0 }
[regions.middle]
rule = "cylinder"
point = [-5, 1, 0.5]
axis = "y"
radius = 9
material = "pla"
"""
    problem = read(folder, PART + HELD + PULLED + regions.split("[regions.middle]")[0])
    ends = problem.mesh.points[:, 0] == 20.0
    tip = solve(problem)["pull"].displacement[ends, 0].mean()
    assert tip == pytest.approx(10.0 / 2.0 * (10 / 1000 + 10 / 250))
    both = read(folder, PART + HELD + PULLED + regions)
    centre = both.mesh.points[both.mesh.cells].mean(axis=1)
    near = np.hypot(centre[:, 0] + 5, centre[:, 2] - 0.5) <= 9
    np.testing.assert_array_equal(both.regions[1].cells, np.flatnonzero(near))
    assert both.regions[1].material.name == "pla"


def test_the_documentation_shows_every_kind_and_key():
    described = ccfem.cases.part_file.ALL_KEYS
    for kind, make in {**SUPPORTS, **LOADS, **REGIONS}.items():
        assert f'"{kind}"' in described
        for key in fields(make):
            assert key.name in described, (kind, key.name)


BOX = '[regions.a]\nrule = "box"\nlower = [0, 0, 0]\nupper = [9, 9, 9]\nmaterial = "pla"\n'
ALL = BOX.replace("9", "20")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            PULLED + HELD + "kind = 'glued'\n",
            r"supports\[0\] must be a table with kind one of held, edge",
        ),
        (
            PULLED + HELD + "kind = 'edge'\n",
            r"supports\[0\] has no key 'patch'; it has: patches, comp",
        ),
        (
            PULLED + HELD + "kind = 'pin'\naxis = 'z'\n",
            r"supports\[0\] needs the key 'point'; its keys",
        ),
        (
            PULLED + HELD + "kind = 'foundation'\nnormal = -1\n",
            r"supports\[0\]: stiffness of the found",
        ),
        (
            PULLED + HELD + "kind = 'spring'\nstiffness = 5\n",
            r"stiffness must be a list of 3, each a numb",
        ),
        (
            PULLED + HELD + "kind = 'sliding'\nnormal = 'w'\n",
            r"supports\[0\]: normal of the sliding supp",
        ),
        (
            PULLED + HELD + "kind = 'point_spring'\n",
            r"supports\[0\] has no key 'patch'; it has: point, s",
        ),
        (HELD + VOLUME.replace("change = 10", ""), r"loads.heat\[0\] needs the key 'change'"),
        (HELD + VOLUME.replace("[-10, 0, 0]", "9.81", 1), "acceleration must be a list of 3"),
        (HELD + VOLUME.replace("heat = 1.5", "cold = 1"), "combinations.both names no load case '"),
        (HELD + VOLUME.replace("heat = 1.5", "heat = '1'"), "combinations.both.heat must be a num"),
        (HELD + VOLUME.replace("heat = 1.5", "heat = inf"), "combinations.both.heat must be fini"),
        (
            HELD + VOLUME.replace("s.both", "s.heat"),
            "combinations.heat has the name of a load case",
        ),
        (
            HELD + VOLUME + "[combinations.none]\n",
            "combinations.none must be a table of load cases",
        ),
        (HELD + PULLED + "[weights]\npush = 1\n", "weights names no load case 'push'; there are"),
        (HELD + PULLED + "[weights]\npull = -1\n", "weights.pull must be .*above 0; got -1"),
        (HELD + PULLED + "[weights]\npull = nan\n", "weights.pull must be a finite number"),
        (HELD + PULLED + "[weights]\npull = '1'\n", "weights.pull must be a finite number"),
        (HELD + PULLED + "[regions.a]\nrule = 'ball'\n", "regions.a must be a table with rule one"),
        (HELD + PULLED + BOX.replace('material = "pla"', ""), "regions.a needs the key 'material'"),
        (HELD + PULLED + BOX.replace('"pla"', '"pls"'), "no material named 'pls'"),
        (HELD + PULLED + BOX.replace('"pla"', "3"), "regions.a.material must be a string or a ta"),
        (HELD + PULLED + BOX.replace('"pla"', "{modulus = 3}"), "regions.a.material needs the key"),
        (HELD + PULLED + BOX.replace("[9, 9, 9]", "[9, -9, 9]"), "lower must lie below upper"),
        (
            HELD + PULLED + BOX.replace("[0, 0, 0]", "[-9, 0, 0]").replace("[9,", "[-1,"),
            "region 'a': box .* holds the centre of no cell; the part lies between",
        ),
        (HELD + PULLED + ALL + ALL.replace("s.a", "s.b"), "regions 'a' and 'b' share 120 cells"),
    ],
)
def test_what_does_not_fit_is_one_line(folder, text, message):
    with pytest.raises(InputError, match=message) as caught:
        read(folder, PART + text)
    assert "\n" not in str(caught.value)
    assert "part.toml" in str(caught.value)


def test_what_only_the_solve_can_know_is_one_line(folder):
    for text, message in [
        (PART.replace(", mass_density = 2.0", "") + HELD + VOLUME, "needs the mass density of mat"),
        (PART.replace(", expansion = 1e-4", "") + HELD + VOLUME, "needs the expansion of material"),
        (PART + HELD + VOLUME.replace("x_min", "x_max"), "moves patch 'x_max' by .* hold nothing"),
    ]:
        with pytest.raises(InputError, match=message):
            solve(read(folder, text))


def test_every_kind_is_weighed_on_a_surface_before_it_is_meshed():
    """A box of 20 x 2 x 1 mm as a surface: what a mesh of it could carry passes, the rest not."""
    box = box_mesh((20.0, 2.0, 1.0), (2, 1, 1))
    surface = Surface(box.points, box.boundary)
    rules = {"left": Plane("x", "min"), "right": Plane("x", "max"), "below": Plane("y", "min")}
    loads = (
        Force("right", (1.0, 0.0, 0.0)),
        Traction("right", (1.0, 0.0, 0.0)),
        Pressure("right", 1.0),
        Moment("right", (0.0, 0.0, 1.0)),
        PointForce((20.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        NodeForces(((20.0, 0.0, 0.0), (20.0, 2.0, 0.0)), ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))),
        Centrifugal(10.0, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        BodyForce((0.0, 0.0, -1.0)),
        Gravity((0.0, 0.0, -9810.0)),
        Temperature(20.0),
        Displacement("right", (0.1, 0.0, 0.0)),
    )
    assert {type(load) for load in loads} | {Bearing} == set(LOADS.values())
    others = (
        EdgeSupport(("left", "below")),
        PointSupport((20.0, 0.0, 0.0)),
        NodeSupport("tip", ((20.0, 0.0, 0.0),)),
        LocalSupport("right", ((1.0, 1.0, 0.0), (0.0, 1.0, 0.0))),
        SlidingSupport("below"),
        RigidPatch("right"),
        Pin("right", (20.0, 1.0, 0.5), "z"),
        Spring("right", (1.0, 1.0, 1.0)),
        PointSpring((20.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
        Foundation("right", 1.0, 1.0),
        PressingSupport("below"),
        TiedPatch("below", "left", 50.0),
    )
    assert {type(each) for each in others} | {Support} == set(SUPPORTS.values())
    for other in others:
        cases = {"all": loads}
        check_before_meshing(surface, 1.0, rules, (Support("left"), other), cases)
    with pytest.raises(InputError, match="free to"):
        check_before_meshing(surface, 1.0, rules, (SlidingSupport("left"),), {"all": loads})
    turned = {"all": (Bearing("right", (0.0, 1.0, 0.0)), *loads)}
    with pytest.raises(InputError, match="bearing"):
        check_before_meshing(surface, 1.0, rules, (Support("left"),), turned)


OWN_SUPPORTS = """
[[supports]]
patch = "x_min"

[[supports]]
patch = "x_max"
case = "between"

[[loads.hanging]]
kind = "body_force"
vector = [0.5, 0, 0]

[[loads.between]]
kind = "body_force"
vector = [0.5, 0, 0]
"""


def test_a_load_case_may_have_supports_of_its_own(folder):
    # A bar under its weight b: b L^2 / (2 E) at its free end, b L^2 / (8 E) in the middle where
    # both ends are held, and then each end carries half of it.
    problem = read(folder, PART.replace("order = 1", "order = 2") + OWN_SUPPORTS)
    fields_of = solve(problem)
    assert list(fields_of) == ["hanging", "between"]
    hanging, between = (fields_of[name].displacement[:, 0] for name in fields_of)
    assert hanging.max() == pytest.approx(0.5 * 400.0 / 2000.0, rel=1e-9)
    assert between.max() == pytest.approx(0.5 * 400.0 / 8000.0, rel=1e-9)
    ends = fields_of["between"].mesh.points[:, 0] == 20.0
    assert fields_of["hanging"].reactions[ends].sum() == pytest.approx(0.0, abs=1e-9)
    assert fields_of["between"].reactions[ends, 0].sum() == pytest.approx(-10.0, rel=1e-9)
    assert fields_of["hanging"].problem.supports == (Support("x_min"),)


def test_supports_of_cases_are_written_and_read_again(folder):
    text = PART + OWN_SUPPORTS.replace('"between"', '["between", "hanging"]')
    (folder / "part.toml").write_text(text)
    case = read_part(folder / "part.toml")
    written = part_text(case, "body.npz")
    (folder / "again.toml").write_text(written)
    again = read_part(folder / "again.toml").problem
    assert again.case_supports == case.problem.case_supports
    assert again.case_supports["hanging"] == (Support("x_max"),) == again.case_supports["between"]
    # What both cases have is one set of supports.
    assert len(support_sets(again)) == 1


def test_a_case_in_which_supports_alone_move_is_written_and_read_again(folder):
    """Between grips: 1000 MPa times the area, 2 mm^2, times the strain of 0.1 / 20."""
    moving = '[[supports]]\npatch = "x_max"\ncomponents = "x"\nvalue = [0.1, 0, 0]\n'
    (folder / "part.toml").write_text(PART + HELD + moving + "[loads]\ngrips = []\n")
    case = read_part(folder / "part.toml")
    (folder / "again.toml").write_text(part_text(case, "body.npz"))
    again = read_part(folder / "again.toml").problem
    assert again.loads == case.problem.loads == {"grips": ()}
    field = solve(again)["grips"]
    ends = field.mesh.points[:, 0] == 20.0
    assert field.reactions[ends, 0].sum() == pytest.approx(10.0, rel=1e-6)
    with pytest.raises(InputError, match="no support moves"):
        solve(read(folder, PART + HELD + "[loads]\ngrips = []\n"))


def test_check_says_in_which_load_case_a_patch_is_held(folder):
    text = PART + OWN_SUPPORTS
    (folder / "part.toml").write_text(text)
    found = check(folder / "part.toml")
    carries = {row.name: row.carries for row in found.patches}
    assert carries["x_max"] == "support xyz in between"
    assert carries["x_min"] == "support xyz"
    assert [row.case for row in found.loads] == ["hanging", "between"]
    assert not found.mistakes
    # A patch may be loaded in one case and held in another.
    (folder / "part.toml").write_text(
        text + '[[loads.hanging]]\nkind = "force"\npatch = "x_max"\nvector = [1, 0, 0]\n'
    )
    assert not [line for line in check(folder / "part.toml").warnings if "share" in line]
    # One mark a facet, four on each end.
    assert len(support_marks(found)) == 8
    assert len(support_marks(found, "hanging")) == 4


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (OWN_SUPPORTS.replace('"between"', '"betwen"', 1), r"names no load case 'betwen'.*between"),
        (OWN_SUPPORTS.replace('case = "between"', "case = 3"), r"supports\[1\].case must be the"),
        (OWN_SUPPORTS.replace('case = "between"', "case = []"), r"supports\[1\].case must be the"),
        (OWN_SUPPORTS + "[combinations.sum]\nhanging = 1\nbetween = 1\n", "whose supports differ"),
    ],
)
def test_wrong_cases_of_supports_are_one_line(folder, text, message):
    with pytest.raises(InputError, match=message) as error:
        read(folder, PART + text)
    assert len(error.value.mistakes) == 1


def test_a_case_that_nothing_holds_is_named(folder):
    text = PART + OWN_SUPPORTS.replace("[[supports]]", '[[supports]]\ncase = "between"', 1)
    problem = read(folder, text)
    with pytest.raises(InputError, match="load case 'hanging': the part has no support"):
        solve(problem)
    with pytest.raises(InputError, match="load cases between have supports of their own"):
        prepare(problem)
    found = check(folder / "part.toml")
    assert [line.split(":")[0] for line in found.mistakes] == ["load case 'hanging'"]


def test_supports_of_cases_are_tried_before_meshing():
    box = box_mesh((20.0, 2.0, 1.0), (2, 1, 1))
    surface = Surface(box.points, box.boundary)
    rules = {"left": Plane("x", "min"), "right": Plane("x", "max")}
    loads = {name: (Force("right", (1, 0, 0)),) for name in ("up", "down")}
    own = {"up": (Support("left"),)}
    with pytest.raises(InputError, match="no support"):
        check_before_meshing(surface, 1.0, rules, (), loads, own)
    own["down"] = (SlidingSupport("left"),)
    with pytest.raises(InputError, match="free"):
        check_before_meshing(surface, 1.0, rules, (), loads, own)
