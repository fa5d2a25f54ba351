"""What is known before a solve, against what is known of boxes."""

import numpy as np
import pytest

import ccfem
from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison.plot.part_picture import part_page, part_picture
from ccfem.fem.elasticity import BodyForce, Force, Pressure, Problem, Support, Traction
from ccfem.fem.elasticity.problem import PointForce
from ccfem.fem.elasticity.solve_cost import solve_costs
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine

PLA = isotropic(3500.0, 0.35)


HELD = (Support("x_min"),)


def checked(loads, supports=HELD, patches=None, **machine):
    mesh = box_mesh((40.0, 20.0, 10.0), (8, 4, 2))
    mesh = mesh.with_patches(patches(mesh) if patches else {})
    problem = Problem(mesh, PLA, supports, {"pull": tuple(loads)}, order=1)
    return ccfem.check(Case("box", "A box", problem, machine=Machine(**machine)))


def test_patches_of_a_box_are_as_long_as_it_is():
    found = checked([Force("x_max", (0.0, 0.0, 5.0))])
    rows = {row.name: row for row in found.patches}
    for name, area, centre, normal in (
        ("x_min", 200.0, (0.0, 10.0, 5.0), (-1.0, 0.0, 0.0)),
        ("x_max", 200.0, (40.0, 10.0, 5.0), (1.0, 0.0, 0.0)),
        ("z_max", 800.0, (20.0, 10.0, 10.0), (0.0, 0.0, 1.0)),
    ):
        row = rows[name]
        assert row.area == pytest.approx(area)
        assert row.centre == pytest.approx(centre)
        assert row.normal == pytest.approx(normal)
        assert row.pieces == 1
    assert rows["x_min"].facets == 2 * 4 * 2
    assert rows["x_min"].carries == "support xyz"
    assert rows["x_max"].carries == "force of pull"
    assert found.mistakes == ()
    assert list(found.to_frame()["patch"][:2]) == ["x_max", "x_min"]
    assert "8.0 cm^3" in str(found).replace("8 cm^3", "8.0 cm^3")
    assert "nothing keeps this part from being solved" in str(found)


def test_two_ends_are_two_pieces():
    both = checked(
        [Force("ends", (1.0, 0.0, 0.0))],
        (Support("z_min"),),
        lambda mesh: {"ends": np.concatenate([mesh.patches["x_min"], mesh.patches["x_max"]])},
    )
    (row,) = (row for row in both.patches if row.name == "ends")
    assert row.pieces == 2
    assert row.normal == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)


def test_resultants_and_where_they_act():
    """Statics: a force at the middle of its patch, pressure inward, a couple of two points."""
    force = checked([Force("x_max", (0.0, 0.0, 5.0))]).loads[0]
    assert force.resultant == pytest.approx([0.0, 0.0, 5.0])
    # Anywhere on the line of action through the middle of the end, (40, 10).
    assert force.point[:2] == pytest.approx([40.0, 10.0])
    pressure = checked([Pressure("z_max", 0.5)]).loads[0]
    assert pressure.resultant == pytest.approx([0.0, 0.0, -0.5 * 800.0])
    assert pressure.point == pytest.approx([20.0, 10.0, 10.0])
    turned = checked([PointForce((40.0, 20.0, 10.0), (0.0, 3.0, 0.0))]).loads[0]
    assert turned.point == pytest.approx([40.0, 20.0, 10.0])
    assert turned.moment == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_a_pressure_on_both_sides_is_doubted():
    def sheet(mesh):
        return {"sheet": np.concatenate([mesh.patches["z_min"], mesh.patches["z_max"]])}

    found = checked([Pressure("sheet", 2.0), Force("x_max", (1.0, 0.0, 0.0))], patches=sheet)
    assert any("pressure on sheet has no resultant" in line for line in found.warnings)
    assert found.loads[0].size == 0.0


def test_a_load_on_held_nodes_is_a_mistake():
    found = checked([Traction("x_min", (0.0, 1.0, 0.0))])
    assert any("acts on held nodes alone" in line for line in found.mistakes)
    part = checked([Traction("y_min", (0.0, 1.0, 0.0))])
    assert part.mistakes == ()
    # Of 9 columns of nodes the first is held; the outer ones carry half of an inner one: 1 / 16.
    assert part.loads[0].held == pytest.approx(1.0 / 16.0)
    assert any("6% of traction on y_min acts on held" in line for line in part.warnings)


def test_weight_at_supports_is_no_mistake():
    """An eighth of the box lies at the held end, and hands its weight to the support."""
    found = checked([BodyForce((0.0, 0.0, -0.001)), Force("x_max", (1.0, 0.0, 0.0))])
    assert found.mistakes == ()
    assert not any("held nodes" in line for line in found.warnings)
    weight = found.loads[0]
    assert weight.what == "body force"
    assert weight.resultant == pytest.approx([0.0, 0.0, -8.0])
    assert weight.point == pytest.approx([20.0, 10.0, 5.0])


def test_patches_that_overlap_are_named():
    def half(mesh):
        return {"half": mesh.patches["x_min"][:4]}

    found = checked([Force("half", (1.0, 0.0, 0.0)), Force("x_max", (1.0, 0, 0))], patches=half)
    (line,) = (line for line in found.warnings if "share" in line)
    assert "'half' (loaded) and 'x_min' (held) share 4 of 4 facets" in line


def test_all_mistakes_come_at_once():
    found = checked(
        [Force("x_max", (0.0, 0.0, 0.0)), Force("x_max", (0.0, 0.0, 5.0))],
        (Support("x_min", components="x"),),
    )
    assert len(found.mistakes) == 2
    assert "is free to" in found.mistakes[0]
    assert "a load must not be zero" in found.mistakes[1]


def test_a_table_without_rows_is_left_out():
    said = str(checked([Force("x_max", (0.0, 0.0, 0.0))]))
    assert "a load must not be zero" in said
    assert "DataFrame" not in said


def test_a_part_file_names_all_its_mistakes(tmp_path):
    path = tmp_path / "part.toml"
    path.write_text(
        'mesh = "none.msh"\ntitel = "x"\nbuild = "w"\n[patches.a]\nrule = "ring"\n'
        '[[supports]]\npatch = "a"\ncomponent = "x"\n[[loads.pull]]\nkind = "push"\n'
        "[machine]\nfibre_width = -1.0\nminimum_radius = 'a'\n"
    )
    with pytest.raises(InputError, match="and 7 more: ccfem check names them all") as caught:
        ccfem.check(path)
    said = "\n".join(caught.value.mistakes)
    for word in (
        "no key 'titel'; it has: ",
        "build must be 'x'",
        "machine.minimum_radius must be a number",
        "needs a material: name one of",
        "patches.a must be a table with rule one of",
        "no key 'component'",
        "loads.pull[0] must be a table with kind one of",
        "none.msh does not exist",
    ):
        assert word in said, word


def test_unknowns_are_those_of_the_solve():
    mesh = box_mesh((40.0, 20.0, 10.0), (4, 2, 1))
    problem = Problem(mesh, PLA, (Support("x_min"),), {"a": (Force("x_max", (1, 0, 0)),)})
    linear, quadratic = solve_costs(problem)
    assert linear.unknowns == 3 * 5 * 3 * 2
    assert quadratic.unknowns == 3 * len(mesh.quadratic().points)


def test_the_picture_shows_patches_loads_and_supports():
    found = checked([Force("x_max", (0.0, 0.0, 5.0))])
    figure = part_picture(found)
    words = {text.get_text() for axes in figure.axes for text in axes.texts}
    assert {"x_min", "x_max", "pull: 5 N"} <= words
    page = part_page(found)
    assert '"x_max"' in page
    assert "http" not in page
    assert "</script>" not in page.split("<script>")[1].split("</script></body>")[0]


@pytest.mark.parametrize(
    ("machine", "said"),
    [
        ({"fibre_width": 50.0}, "machine.fibre_width = 50 mm is wider than the part, 20 mm"),
        (
            {"minimum_length": 1e4},
            "machine.minimum_length: strands must be 10000 mm long, but no layer has",
        ),
        ({"held_length": 1e4}, "machine.held_length, 10000 mm, and 42 mm from the cutter: strands"),
        ({"minimum_length": 42.0}, None),
    ],
)
def test_a_machine_that_no_fibre_of_the_part_suits_is_warned_of(machine, said):
    found = checked([Force("x_max", (0.0, 0.0, 5.0))], **machine)
    about = [line for line in found.warnings if line.startswith("machine.")]
    assert [line.startswith(said) for line in about] == [True] * (said is not None)
    assert found.mistakes == ()


def test_a_picture_shows_what_is_held_from_its_side_alone():
    flat = checked([Force("x_max", (5.0, 0.0, 0.0))], (Support("z_min"),))
    figure = part_picture(flat)
    above, below = figure.axes
    marks = [
        [each for each in axes.collections if each.get_sizes().size] for axes in (above, below)
    ]
    assert [sum(len(each.get_offsets()) for each in those) for those in marks] == [0, 12]
    width, height = figure.get_size_inches()
    assert height < 0.4 * width
    for axes in (above, below):
        (word,) = (each for each in axes.texts if "pull" in each.get_text())
        (shaft,) = (each for each in axes.texts if not each.get_text())
        forward = np.subtract(shaft.xy, shaft.xyann)
        assert np.dot(forward, word.xyann) < 0.0
        assert word.get_ha() == ("right" if forward[0] > 0.0 else "left")
