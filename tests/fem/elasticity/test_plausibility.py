"""What cannot be, or cannot be meant, of a part and its solution: refused, or said in a line."""

from dataclasses import replace

import numpy as np
import pytest

import ccfem
from ccfem.base.checks import EXPANSION, FORCE, MASS_DENSITY, MODULUS, SPRING, STRENGTH, TRACTION
from ccfem.base.errors import InputError, SolveError
from ccfem.body.mesh import box_mesh
from ccfem.body.mesh.check import coarse_wall
from ccfem.cases.case import Case
from ccfem.fem.elasticity import (
    Displacement,
    Force,
    Foundation,
    Gravity,
    PointSpring,
    PressingSupport,
    Pressure,
    Problem,
    RigidPatch,
    SlidingSupport,
    Spring,
    Support,
    Traction,
    solve,
)
from ccfem.fem.elasticity.plausibility import about_problem, check_balance
from ccfem.fem.elasticity.supports import held
from ccfem.fem.elasticity.system import prepare
from ccfem.fem.materials import isotropic
from ccfem.slicing.slicers.planar import Planar

LENGTH, AREA = 60.0, 100.0
MODULUS_OF_BAR, STRENGTH_OF_BAR = 3000.0, 52.0
SIZE = np.sqrt(LENGTH**2 + 200.0)
STRETCHED = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))


def bar(loads, supports=STRETCHED, order=1, divisions=(12, 2, 2), material=None, **more):
    """Bar of 60 x 10 x 10 mm without Poisson's effect, free to draw in."""
    mesh = box_mesh((LENGTH, 10.0, 10.0), divisions)
    if material is None:
        material = isotropic(MODULUS_OF_BAR, 0.0, "plastic", STRENGTH_OF_BAR)
    if not isinstance(loads, dict):
        loads = {"pull": (loads,)}
    return Problem(mesh, material, supports, loads, order=order, **more)


def pulled(force):
    return Force("x_max", (force, 0.0, 0.0))


@pytest.mark.parametrize(
    ("sizes", "value", "refused", "cure"),
    [
        (MODULUS, 3.5, False, "as GPa it would be 3500 MPa, so give that"),
        (MODULUS, 3.5e9, True, "as Pa it would be 3500 MPa, so give that"),
        (STRENGTH, 5.2e7, True, "as Pa it would be 52 MPa, so give that"),
        (STRENGTH, 0.052, False, "as GPa it would be 52 MPa, so give that"),
        (MASS_DENSITY, 1240.0, True, "as kg/m^3 it would be 1.24 g/cm^3, so give that"),
        (MASS_DENSITY, 1.24e-9, True, "as t/mm^3 it would be 1.24 g/cm^3, so give that"),
        (EXPANSION, 70.0, True, "as 1e-6/K it would be 7e-05 1/K, so give that"),
        (SPRING, 1e-30, True, "give it in N/mm"),
        (TRACTION, 1e5, False, "as Pa it would be 0.1 MPa, so give that"),
        (FORCE, 1e9, False, "as mN it would be 1e+06 N, so give that"),
    ],
)
def test_sizes_of_another_unit(sizes, value, refused, cure):
    if refused:
        with pytest.raises(InputError, match=r"must be .*; got") as caught:
            sizes.check("it", value)
        assert str(caught.value).endswith(cure)
    else:
        sizes.check("it", value)
        assert sizes.about("it", value).endswith(cure)


@pytest.mark.parametrize(
    ("sizes", "usual"),
    [
        (MODULUS, (10.0, 1200.0, 230e3, 9e5)),
        (STRENGTH, (1.0, 52.0, 7000.0)),
        (MASS_DENSITY, (0.1, 1.24, 7.85, 19.3)),
        (EXPANSION, (7e-5, -1e-6)),
        (SPRING, (0.0, 0.1, 1e6)),
        (FORCE, (1e-3, 1.0, -1e5)),
    ],
)
def test_sizes_of_known_materials_are_taken_without_a_word(sizes, usual):
    for value in usual:
        sizes.check("it", value)
        assert sizes.about("it", value) == ""


def test_impossible_numbers_are_refused_where_they_are_given():
    for make, message in (
        (lambda: isotropic(3.5e9, 0.35, "pla"), "modulus of material 'pla' must be"),
        (lambda: isotropic(3500.0, 0.35, "pla", 5e7), "tensile strength of material 'pla' must"),
        (lambda: isotropic(3500.0, 0.3, mass_density=1240.0), r"as kg/m\^3 it would be 1.24"),
        (lambda: isotropic(3500.0, 0.3, expansion=70.0), "expansion of material"),
        (lambda: Spring("x_min", (1e-30, 0.0, 0.0)), "stiffness of the spring on patch 'x_min'"),
        (lambda: PointSpring((0.0, 0.0, 0.0), (0.0, 1e-9, 0.0)), "stiffness of the spring at"),
        (lambda: Foundation("x_min", 1e-12), "stiffness of the foundation"),
        (lambda: RigidPatch("x_max", angle=(90.0, 0.0, 0.0)), "at most 25 degrees"),
    ):
        with pytest.raises(InputError, match=message):
            make()
    with pytest.raises(InputError, match=r"mass density of gravity must be .* got 1240"):
        solve(bar(Gravity((0.0, 0.0, -9.81), 1240.0)))


def test_stretching_beyond_linear_theory():
    """A bar grows by ``F L / (E A)``; it is said from a twentieth of its size on."""
    for share, said in ((0.049, False), (0.1, True), (9.0, True)):
        problem = bar(pulled(share * SIZE / LENGTH * MODULUS_OF_BAR * AREA))
        field = solve(problem)["pull"]
        lines = [line for line in field.findings if "linear theory" in line]
        assert bool(lines) == said
        if said:
            assert f"the part moves by {share * SIZE:.4g} mm, {share:g} times its size" in lines[0]
    with pytest.raises(InputError, match=r"moves by 2e\+05 mm, 3.24e\+03 times its size of 61.64"):
        solve(bar(pulled(1e9)))


def test_a_motion_as_a_whole_is_no_matter():
    """Springs under the middle of the load: every point moves by F / k, 200 mm."""
    spring = (Spring("x_min", (1.0, 1e3, 1e3)), *STRETCHED[1:])
    field = solve(bar(pulled(200.0), spring))["pull"]
    np.testing.assert_allclose(field.displacement[:, 0], 200.0, atol=0.1)
    assert field.findings == ()


def test_a_nearly_free_part_is_named_so():
    loose = (Spring("x_min", (1.0, 1.0, 1.0)),)
    across = Force("x_max", (0.0, 1.0, 0.0))
    with pytest.raises(InputError, match="nearly as a rigid body, so hardly anything holds it"):
        solve(bar(replace(across, vector=(0.0, 100.0, 0.0)), loose))
    field = solve(bar(across, loose))["pull"]
    assert any("nearly as a rigid body" in line for line in field.findings)


def test_stress_above_the_strength():
    """A bar under tension has ``F / A`` everywhere."""
    assert solve(bar(pulled(0.99 * STRENGTH_OF_BAR * AREA)))["pull"].findings == ()
    (line,) = solve(bar(pulled(65.0 * AREA)))["pull"].findings
    assert "von Mises stress at" in line
    assert "is 65 MPa, above the tensile strength of 52 MPa" in line
    assert line.endswith("without fibre the part fails there at 0.8 times this load")
    weak = bar(pulled(0.06 * MODULUS_OF_BAR * AREA), material=isotropic(MODULUS_OF_BAR, 0.0))
    assert any("the part strains by 0.06 at" in line for line in solve(weak)["pull"].findings)


def test_reactions_that_do_not_balance_are_refused():
    problem = bar({"bend": (Force("x_max", (1.0, 0.0, 1.0)),)}, (Support("x_min"),))
    field, forces = solve(problem)["bend"], prepare(problem).forces["bend"]
    check_balance(problem, "bend", field.displacement, forces, field.reactions, False)
    # A thousandth of the force is missing; then the force is right, at the wrong end of the bar.
    for wrong in (0.999 * field.reactions, field.reactions[::-1]):
        with pytest.raises(SolveError, match=r"'bend': the reactions leave .* do not balance"):
            check_balance(problem, "bend", field.displacement, forces, wrong, False)


def test_every_kind_of_support_balances():
    """Equilibrium holds on springs, beds, rigid and sliding patches, and where supports move."""
    load = {"down": (Pressure("z_max", 0.2), Gravity(mass_density=1.2))}
    for supports in (
        (Spring("x_min", (50.0, 50.0, 50.0)), Support("x_max", "yz"), Support("z_min", "y")),
        (Foundation("z_min", 2.0, 1.0),),
        (RigidPatch("x_min", value=(0.0, 0.0, 0.1), angle=(0.5, 0.0, 0.0)),),
        (SlidingSupport("z_min"), Support("x_min", "xy")),
        (PressingSupport("z_min"), Support("x_min", "xy")),
    ):
        reactions = solve(bar(load, supports))["down"].reactions.sum(axis=0)
        # 0.2 MPa on 60 x 10 mm, and the weight of 6 cm^3 of 1.2 g/cm^3.
        assert reactions == pytest.approx([0.0, 0.0, 120.0 + 7.2e-3 * 9.80665], abs=1e-3)


def test_loads_that_only_held_nodes_take():
    held_end = (Support("x_min"),)
    message = r"load case 'pull' \(on x_min\) acts on held nodes alone and does nothing: choose"
    for problem in (
        bar(Force("x_min", (10.0, 0.0, 0.0)), held_end),
        bar(Force("x_min", (10.0, 0.0, 0.0)), (RigidPatch("x_min"),)),
        bar(Force("x_min", (-10.0, 0.0, 0.0)), (PressingSupport("x_min"), Support("x_max", "yz"),
                                                Spring("x_max", (1.0, 0.0, 0.0)))),
    ):  # fmt: skip
        with pytest.raises(InputError, match=message):
            solve(problem)
        assert any(
            "acts on held nodes alone" in x for x in ccfem.check(Case("b", "", problem)).mistakes
        )
    # One load of two: the rest is solved, and the line comes.
    both = bar({"pull": (Force("x_min", (10.0, 0.0, 0.0)), pulled(10.0))}, held_end)
    (line,) = (x for x in solve(both)["pull"].findings if "acts on held" in x)
    assert line.startswith("load case 'pull': force on x_min acts on held nodes alone and does")


def test_a_combination_that_cancels_is_named():
    loads = {"pull": (pulled(10.0),), "push": (pulled(-10.0),)}
    problem = bar(loads, combinations={"both": {"pull": 2.0, "push": 2.0}})
    with pytest.raises(InputError, match=r"combination 'both' is zero, .* \(2 pull \+ 2 push\)"):
        solve(problem)
    assert any(
        "is zero, for its load cases" in x for x in ccfem.check(Case("b", "", problem)).mistakes
    )
    assert "both" in solve(replace(problem, combinations={"both": {"pull": 2.0, "push": 1.0}}))


def test_supports_that_move_too_far():
    drawn = (Support("x_min"), Support("x_max", "x"))
    field = solve(bar(Displacement("x_max", (30.0, 0.0, 0.0)), drawn))["pull"]
    lines = [line for line in field.findings if "linear theory" in line]
    assert lines[0].startswith(
        "load case 'pull': displacement on x_max moves by 30 mm, 49% of the size of the part"
    )
    assert len(lines) == 1
    turned = bar(pulled(1.0), (Support("x_min"), RigidPatch("x_max", "", angle=(10.0, 0.0, 0.0))))
    assert any("turns by 10 degrees" in line for line in about_problem(turned))


def test_near_incompressible_linear_cells():
    rubber = isotropic(3000.0, 0.4999)
    lines = about_problem(bar(pulled(1.0), material=rubber))
    assert any("linear cells lock" in line for line in lines)
    assert not about_problem(bar(pulled(1.0), material=rubber, order=2))
    assert not about_problem(bar(pulled(1.0), material=rubber, order="auto"))


@pytest.mark.parametrize(
    ("divisions", "single"),
    [((3, 1, 1), True), ((15, 5, 1), True), ((10, 2, 2), False), ((20, 8, 2), False)],
)
def test_cells_across_a_wall_are_counted(divisions, single):
    found = coarse_wall(box_mesh((60.0, 20.0, 6.0), divisions))
    assert (found is not None) == single
    if found is not None:
        assert found.thickness == pytest.approx(6.0)
        edges = np.linalg.norm(np.array([60.0, 20.0, 6.0]) / divisions)
        assert found.edge <= edges + 1e-9


def test_walls_with_one_cell_across():
    """Tip of a cantilever: one linear cell shows a tenth of it, and one quadratic cell all."""
    mesh = box_mesh((100.0, 20.0, 6.0), (10, 2, 1))
    load = {"tip": (Force("x_max", (0.0, 0.0, -1.0)),)}
    beam = Problem(mesh, isotropic(3500.0, 0.0), (Support("x_min"),), load, order=1)
    exact = 100.0**3 / (3.0 * 3500.0 * 20.0 * 6.0**3 / 12.0)
    poor, good = (solve(replace(beam, order=k))["tip"] for k in (1, 2))
    assert -poor.displacement[:, 2].min() < 0.2 * exact
    assert -good.displacement[:, 2].min() == pytest.approx(exact, rel=0.01)
    (line,) = (x for x in poor.findings if "one cell across" in x)
    assert line.startswith("walls of 6 mm, as at (")
    assert "too stiff where the wall bends" in line
    assert not any("one cell across" in x for x in good.findings)
    # Stretched, linear cells are exact: nothing is said once that is known.
    flat = replace(beam, loads={"tip": (Force("x_max", (9.0, 0.0, 0.0)),)})
    assert solve(replace(flat, order="auto"))["tip"].findings == ()
    long = replace(beam, mesh=box_mesh((100.0, 20.0, 6.0), (5, 1, 1)), order=2)
    assert any("too long for the stress round holes" in line for line in about_problem(long))


def test_parts_in_metres_and_inches():
    for size, said in ((0.06, "in metres, set scale = 1000"), (2.4, "in inches, set scale = 25.4"),
                       (60.0, ""), (6e4, "in micrometres, set scale = 0.001")):  # fmt: skip
        mesh = box_mesh((size, size / 6.0, size / 6.0), (6, 1, 1))
        problem = Problem(mesh, isotropic(3500.0, 0.3), (Support("x_min"),), {}, order="auto")
        lines = [line for line in about_problem(problem) if "scale" in line]
        assert [said in line for line in lines] == [True] * bool(said)


def test_the_same_words_everywhere():
    """In `check`, in `solve`, and in a comparison."""
    soft = isotropic(3.5, 0.3, "plastic")
    problem = bar(Traction("x_max", (1e-4, 0.0, 0.0)), (Support("x_min"),), material=soft)
    case = Case("bar", "A bar", problem, slicing=Planar(count=2))
    expected = (
        "modulus of material 'plastic' is 3.5 MPa, where 5 to 1e+06 MPa are usual: as GPa it would "
        "be 3500 MPa, so give that"
    )
    assert expected in about_problem(problem, held(problem))
    assert expected in ccfem.check(case).warnings
    assert expected in ccfem.solve(problem)["pull"].findings
    compared = ccfem.compare(case, ["zigzag"], strand=None)
    assert expected in compared.stress.findings


def test_layers_thinner_than_a_strand_are_seen_by_check():
    problem = bar(pulled(1.0))
    case = Case("bar", "A bar", problem, slicing=Planar(count=500))
    (line,) = (x for x in ccfem.check(case).not_planned if "layers" in x)
    assert line.startswith("layers must lie at least 0.1075 mm apart")
    assert line.endswith("use fewer layers")
    found = ccfem.check(replace(case, slicing=Planar(thickness=11.0)))
    (line,) = (x for x in found.not_planned if "thickness" in x)
    assert not found.mistakes
    assert "at most the part's height 10 mm; got 11" in line


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("bar", {"element_size": 2.5}),
        ("loop", {"element_size": 4.0}),
        ("open_hole", {"element_size": 2.0}),
        ("arm_bracket", {}),
    ],
)
def test_shipped_cases_are_not_accused(name, parameters):
    case = ccfem.read(name, **parameters)
    for problem in (case.problem, replace(case.problem, order=1)):
        assert about_problem(problem, held(problem)) == ()
    for field in solve(case.problem).values():
        assert not [line for line in field.findings if "estimated error" not in line]


def test_a_patch_inside_the_part_is_told_from_an_unknown_one():
    mesh = box_mesh((2.0, 1.0, 1.0), (2, 1, 1)).with_patches({"inner": np.zeros((0, 3), np.int64)})
    for support, said in (("inner", "patch 'inner' is empty: .* group inside"), ("in", "no patch")):
        with pytest.raises(InputError, match=said):
            Problem(mesh, isotropic(1.0, 0.3), (Support(support),), {"pull": (pulled(1.0),)})
