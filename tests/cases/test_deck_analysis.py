"""Whole analyses from decks: bars whose answers are known, CalculiX, and what is refused."""

import shutil
import sys

import numpy as np
import pytest

from benchmarks import calculix
from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.cases.inspection import check
from ccfem.cases.inspection.beginning import new_part
from ccfem.cases.part_file import read_part
from ccfem.cases.reading import read
from ccfem.fem.elasticity import (
    Gravity,
    NodeForces,
    NodeSupport,
    Pressure,
    Support,
    Temperature,
    solve,
)

LENGTH, AREA, MODULUS, DENSITY, ALPHA = 20.0, 16.0, 1000.0, 2e-9, 1e-4
BOX = box_mesh((LENGTH, 4.0, 4.0), (5, 2, 2))
FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
MATERIAL = f"""*MATERIAL, NAME=Soft
*ELASTIC
{MODULUS}, 0.
*DENSITY
{DENSITY}
*EXPANSION
{ALPHA}
*SOLID SECTION, ELSET=Eall, MATERIAL=Soft
"""
HELD = "*BOUNDARY\nfoot, 1, 3\n"


def rows(numbers):
    numbers = [str(number) for number in numbers]
    return "\n".join(", ".join(numbers[k : k + 8]) for k in range(0, len(numbers), 8)) + "\n"


def mesh_text(mesh=BOX):
    """A bar along x with sets foot, tip, corner, Eall, half and the surface end."""
    points, x = mesh.points, mesh.points[:, 0]
    order = [0, 1, 2, 3] if mesh.order == 1 else [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]
    kind = "C3D4" if mesh.order == 1 else "C3D10"
    text = "*NODE, NSET=Nall\n"
    text += "".join(f"{k}, {a!r}, {b!r}, {c!r}\n" for k, (a, b, c) in enumerate(points.tolist(), 1))
    text += f"*ELEMENT, TYPE={kind}, ELSET=Eall\n"
    for k, cell in enumerate(mesh.cells[:, order].tolist(), 1):
        text += ", ".join(map(str, [k, *(node + 1 for node in cell)])) + "\n"
    for name, chosen in (("foot", x == 0.0), ("tip", x == LENGTH), ("y0", points[:, 1] == 0.0)):
        text += f"*NSET, NSET={name}\n" + rows(np.flatnonzero(chosen) + 1)
    text += f"*NSET, NSET=corner\n{np.flatnonzero((points == 0.0).all(axis=1))[0] + 1}\n"
    text += "*ELSET, ELSET=half\n" + rows(np.flatnonzero(mesh.centres[:, 0] < LENGTH / 2) + 1)
    text += "*SURFACE, NAME=end, TYPE=ELEMENT\n"
    for k, cell in enumerate(mesh.cells[:, :4], 1):
        for number, face in enumerate(FACES, 1):
            if (x[cell[list(face)]] == LENGTH).all():
                text += f"{k}, S{number}\n"
    return text


def step(text, head="*STEP\n*STATIC\n"):
    return f"{head}{text}*END STEP\n"


def case_of(tmp_path, text, more="", mesh=BOX):
    (tmp_path / "deck.inp").write_text(mesh_text(mesh) + text)
    part = f'mesh = "deck.inp"\nanalysis = "deck"\n{more}'
    (tmp_path / "part.toml").write_text(part if "order" in more else f"{part}order = 2\n")
    return read_part(tmp_path / "part.toml")


def tip(field):
    return field.displacement[np.isclose(field.mesh.points[:, 0], LENGTH)].mean(axis=0)


def forces_on_tip(mesh=BOX, size=32.0):
    """Consistent forces of a uniform pull on the tip, as *CLOAD."""
    from ccfem.fem.elasticity import Force
    from ccfem.fem.elasticity.loads import nodal_forces

    forces = nodal_forces(mesh, Force("x_max", (size, 0.0, 0.0)))[:, 0]
    return "*CLOAD\n" + "".join(
        f"{k + 1}, 1, {float(forces[k])!r}\n" for k in np.flatnonzero(forces)
    )


@pytest.mark.parametrize("mesh", [BOX, BOX.quadratic()], ids=["linear", "quadratic"])
def test_a_bar_under_forces_at_its_nodes(tmp_path, mesh):
    text = MATERIAL + HELD + step(forces_on_tip(mesh))
    order = "order = 1\n" if mesh.order == 1 else "order = 2\n"
    case = case_of(tmp_path, text, order, mesh)
    assert case.problem.supports == (Support("foot"),)
    assert [type(load) for load in case.problem.loads["step_1"]] == [NodeForces]
    field = solve(case.problem)["step_1"]
    # N L / (E A); the deck's forces are those of a uniform traction.
    assert tip(field)[0] == pytest.approx(32.0 * LENGTH / (MODULUS * AREA), rel=1e-6)
    np.testing.assert_allclose(field.stress[:, 0, 0], 2.0, rtol=1e-6)
    np.testing.assert_allclose(field.support_forces["foot"], [-32.0, 0.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("load", ["*DSLOAD\nend, P, -2.\n", "*DSLOAD\nend, TRVEC, 2., 1, 0, 0\n"])
def test_a_bar_under_a_pressure_on_a_surface(tmp_path, load):
    case = case_of(tmp_path, MATERIAL + HELD + step(load))
    (given,) = case.problem.loads["step_1"]
    assert given.patch == "end"
    assert tip(solve(case.problem)["step_1"])[0] == pytest.approx(2.0 * LENGTH / MODULUS, rel=1e-9)


def test_pressure_on_faces_of_elements(tmp_path):
    text = mesh_text()
    lines = text[text.index("*SURFACE") :].splitlines()[1:]
    lines = "".join(line.replace("S", "P") + ", -2.\n" for line in lines)
    case = case_of(tmp_path, MATERIAL + HELD + step(f"*DLOAD\n{lines}"))
    assert {type(load) for load in case.problem.loads["step_1"]} == {Pressure}
    assert tip(solve(case.problem)["step_1"])[0] == pytest.approx(2.0 * LENGTH / MODULUS, rel=1e-9)


def test_weight_and_turning(tmp_path):
    text = MATERIAL + HELD
    text += step("*DLOAD\nEall, GRAV, 9810., 2., 0., 0.\n", "*STEP, NAME=hang\n*STATIC\n")
    text += step(
        "*DLOAD, OP=NEW\nEall, CENTRIF, 1.E6, 0., 2., 2., 0., 0., 1.\n",
        "*STEP, NAME=spin\n*STATIC\n",
    )
    case = case_of(tmp_path, text)
    (pull,) = case.problem.loads["hang"]
    assert isinstance(pull, Gravity)
    assert pull.acceleration == pytest.approx((9.81, 0.0, 0.0))
    fields = solve(case.problem)
    weight, speed = DENSITY * 9810.0, 1e6
    assert tip(fields["hang"])[0] == pytest.approx(weight * LENGTH**2 / (2.0 * MODULUS), rel=1e-6)
    assert tip(fields["spin"])[0] == pytest.approx(
        DENSITY * speed * LENGTH**3 / (3.0 * MODULUS), rel=2e-3
    )
    push = fields["spin"].support_forces["foot"][0]
    assert push == pytest.approx(-DENSITY * speed * LENGTH**2 / 2.0 * AREA, rel=1e-6)


def test_heat_of_a_held_bar(tmp_path):
    # Both ends held, nu = 0: the mean stress is E alpha times the mean of T - T0, whatever the
    # field, since the stretch of the bar is none.
    ends = "*BOUNDARY\nfoot, 1\ntip, 1\ny0, 2\ncorner, 3\n"
    ends += f"{np.argmin(abs(BOX.points - [LENGTH, 0, 0]).sum(axis=1)) + 1}, 3\n"
    ends += f"{np.argmin(abs(BOX.points - [0, 4, 0]).sum(axis=1)) + 1}, 3\n"
    start = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNall, 20.\n"
    case = case_of(tmp_path, MATERIAL + ends + start + step("*TEMPERATURE\nNall, 70.\n"))
    assert case.problem.loads["step_1"] == (Temperature(50.0),)
    uniform = solve(case.problem)["step_1"]
    np.testing.assert_allclose(uniform.stress[:, 0, 0], -MODULUS * ALPHA * 50.0, rtol=1e-9)
    warm = "".join(f"{k}, {20.0 + 5.0 * x!r}\n" for k, x in enumerate(BOX.points[:, 0].tolist(), 1))
    case = case_of(tmp_path, MATERIAL + ends + start + step(f"*TEMPERATURE\n{warm}"))
    field = solve(case.problem)["step_1"]
    mean = np.average(field.stress[:, 0, 0], weights=field.mesh.volumes)
    assert mean == pytest.approx(-MODULUS * ALPHA * 50.0, rel=1e-9)


ORTHOTROPIC = """*MATERIAL, NAME=Wood
*ELASTIC, TYPE=ENGINEERING CONSTANTS
4000., 1000., 500., 0., 0., 0., 300., 300.,
300.
"""


@pytest.mark.parametrize(
    ("orientation", "modulus"),
    [
        ("", 4000.0),
        ("*ORIENTATION, NAME=O\n0., 1., 0., -1., 0., 0.\n", 1000.0),
        ("*ORIENTATION, NAME=O\n0., 1., 0., 0., 0., 1.\n", 500.0),
        ("*ORIENTATION, NAME=O\n1., 0., 0., 0., 1., 0.\n3, 90.\n", 1000.0),
        # Axes about a far axis along z through (10, -1e6): radial is y, tangential is -x.
        ("*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL\n10., -1E6, 0., 10., -1E6, 1.\n", 1000.0),
    ],
)
def test_an_orthotropic_bar_by_its_axes(tmp_path, orientation, modulus):
    named = ", ORIENTATION=O" if orientation else ""
    text = ORTHOTROPIC + orientation + f"*SOLID SECTION, ELSET=Eall, MATERIAL=wood{named}\n"
    case = case_of(tmp_path, text + HELD + step("*DSLOAD\nend, P, -2.\n"))
    assert tip(solve(case.problem)["step_1"])[0] == pytest.approx(2.0 * LENGTH / modulus, rel=1e-4)


def test_stiffness_constants_are_placed_as_in_abaqus(tmp_path):
    # C1111, C1122, C2222, C1133, C2233, C3333, C1212, C1313, C2323, in both ways of writing them.
    c = [5.0, 1.0, 6.0, 2.0, 1.5, 7.0, 3.0, 4.0, 5.5]
    wanted = np.diag([5.0, 6.0, 7.0, 5.5, 4.0, 3.0])
    wanted[0, 1] = wanted[1, 0] = 1.0
    wanted[0, 2] = wanted[2, 0] = 2.0
    wanted[1, 2] = wanted[2, 1] = 1.5
    # Those of the anisotropic law, with the couplings at zero but for C1112 = 0.25.
    full = [*c[:6], 0.25, 0, 0, c[6], 0, 0, 0, 0, c[7], 0, 0, 0, 0, 0, c[8]]
    for kind, constants, coupling in (("ORTHO", c, 0.0), ("ANISO", full, 0.25)):
        text = f"*MATERIAL, NAME=M\n*ELASTIC, TYPE={kind}\n" + rows(100.0 * x for x in constants)
        text += "*SOLID SECTION, ELSET=Eall, MATERIAL=M\n" + HELD
        case = case_of(tmp_path, text + step("*CLOAD\ntip, 1, 1.\n"))
        wanted[0, 5] = wanted[5, 0] = coupling
        np.testing.assert_allclose(case.problem.material.stiffness, 100.0 * wanted, rtol=1e-12)


def test_two_materials_are_regions(tmp_path):
    mesh = box_mesh((LENGTH, 4.0, 4.0), (4, 2, 2))
    other = np.flatnonzero(mesh.centres[:, 0] > LENGTH / 2) + 1
    text = "*ELSET, ELSET=other\n" + rows(other) + "*MATERIAL, NAME=Hard\n*ELASTIC\n4000., 0.\n"
    text += MATERIAL.replace("Eall", "other") + "*SOLID SECTION, ELSET=half, MATERIAL=Hard\n"
    case = case_of(tmp_path, text + HELD + step("*DSLOAD\nend, P, -2.\n"), mesh=mesh)
    assert sorted(m.name for m, _ in case.problem.materials) == ["Hard", "Soft"]
    assert tip(solve(case.problem)["step_1"])[0] == pytest.approx(2.0 * (10 / 4000 + 10 / 1000))


def test_supports_by_names_ranges_values_and_single_nodes(tmp_path):
    text = MATERIAL + "*BOUNDARY\nfoot, XSYMM\ny0, 2\ncorner, 3, 3\n"
    text += step("*BOUNDARY\ntip, 1, 1, 0.5\n")
    case = case_of(tmp_path, text)
    corner = NodeSupport("corner", ((0.0, 0.0, 0.0),), "z")
    wanted = {
        Support("foot", "x"),
        Support("y0", "y"),
        corner,
        Support("tip", "x", (0.5, 0.0, 0.0)),
    }
    assert set(case.problem.supports_of("step_1")) == wanted
    field = solve(case.problem)["step_1"]
    np.testing.assert_allclose(field.stress[:, 0, 0], MODULUS * 0.5 / LENGTH, rtol=1e-8)


def test_steps_go_on_from_each_other(tmp_path):
    text = MATERIAL + HELD
    text += step("*CLOAD\ncorner, 1, 1.\ntip, 1, 1.\ntip, 1, 2.\n")
    text += step("*CLOAD\ntip, 1, 5.\n*DSLOAD\nend, P, 1.\n")
    text += step("*CLOAD, OP=NEW\ntip, 2, 1.\n*DSLOAD\nend, P, 4.\n*BOUNDARY\nfoot, 1, 1, .25\n")
    text += step("", "*STEP, PERTURBATION\n*STATIC\n*CLOAD\ntip, 3, 7.\n")
    case = case_of(tmp_path, text)
    loads = case.problem.loads
    assert list(loads) == ["step_1", "step_2", "step_3", "step_4"]
    count = np.count_nonzero(BOX.points[:, 0] == LENGTH)
    sums = {
        name: np.sum(next(load.vectors for load in of if isinstance(load, NodeForces)), axis=0)
        for name, of in loads.items()
    }
    # Within a step forces add up; a step replaces those before on the nodes that it names.
    np.testing.assert_allclose(sums["step_1"], [1.0 + 3.0 * count, 0.0, 0.0])
    np.testing.assert_allclose(sums["step_2"], [1.0 + 5.0 * count, 0.0, 0.0])
    np.testing.assert_allclose(sums["step_3"], [0.0, count, 0.0])
    np.testing.assert_allclose(sums["step_4"], [0.0, 0.0, 7.0 * count])
    assert loads["step_3"][1] == Pressure("end", 4.0)
    assert Support("foot", "xyz", (0.25, 0.0, 0.0)) in case.problem.supports_of("step_3")
    assert case.problem.supports_of("step_1") == (Support("foot"),)
    assert len(loads["step_4"]) == 1
    named = case_of(tmp_path, text, 'step = "STEP_2"\n')
    assert dict(named.problem.loads) == {"step_2": loads["step_2"]}


def test_amplitudes_count_at_the_end_of_the_step(tmp_path):
    text = MATERIAL + HELD + "*AMPLITUDE, NAME=A\n0., 0., 2., 4.\n"
    text += step("*CLOAD, AMPLITUDE=A\ncorner, 1, 3.\n", "*STEP\n*STATIC\n0.1, 1.5\n")
    (force,) = case_of(tmp_path, text).problem.loads["step_1"]
    assert force.vectors == ((9.0, 0.0, 0.0),)


def test_a_deck_in_metres(tmp_path):
    (tmp_path / "m.inp").write_text(
        mesh_text(type(BOX)(BOX.points / 1000.0, BOX.cells)).replace(str(LENGTH), "0.02")
        + "*NSET, NSET=foot\n"
        + rows(np.flatnonzero(BOX.points[:, 0] == 0.0) + 1)
        + "*MATERIAL, NAME=M\n*ELASTIC\n1.E9, 0.\n*DENSITY\n2000.\n"
        + "*SOLID SECTION, ELSET=Eall, MATERIAL=M\n"
        + HELD
        + step("*DLOAD\nEall, GRAV, 9.81, 1., 0., 0.\n")
    )
    part = 'mesh = "m.inp"\nanalysis = "deck"\nscale = 1000\norder = 2\n'
    (tmp_path / "part.toml").write_text(part)
    field = solve(read_part(tmp_path / "part.toml").problem)["step_1"]
    assert tip(field)[0] == pytest.approx(2e-9 * 9810.0 * LENGTH**2 / 2000.0, rel=1e-6)


def test_a_deck_is_a_part_by_itself(tmp_path):
    (tmp_path / "bar.inp").write_text(mesh_text() + MATERIAL + HELD + step("*DSLOAD\nend, P, 1.\n"))
    case = read(str(tmp_path / "bar.inp"))
    assert case.name == "bar"
    assert dict(case.problem.loads) == {"step_1": (Pressure("end", 1.0),)}
    checked = check(tmp_path / "bar.inp")
    assert "pressure on end" in checked.known
    assert not checked.mistakes
    new = read(new_part(tmp_path / "bar.inp", tmp_path / "new.toml"))
    assert dict(new.problem.loads) == dict(case.problem.loads)


def test_parts_and_instances_are_followed(tmp_path):
    # The bar as a part, turned by 90 degrees about z and moved: it lies along y, and so do the
    # fibres of its section's orientation; supports and loads are of the assembly.
    section = "*ORIENTATION, NAME=O\n1., 0., 0., 0., 1., 0.\n"
    section += "*SOLID SECTION, ELSET=Eall, MATERIAL=Wood, ORIENTATION=O\n"
    text = "*PART, NAME=Bar\n" + mesh_text() + section + "*END PART\n*ASSEMBLY, NAME=A\n"
    text += "*INSTANCE, NAME=B-1, PART=Bar\n3., 0., 0.\n0., 0., 0., 0., 0., 1., 90.\n"
    text += "*END INSTANCE\n*NSET, NSET=root, INSTANCE=B-1\nfoot\n*END ASSEMBLY\n" + ORTHOTROPIC
    text += "*BOUNDARY\nroot, ENCASTRE\n" + step("*DSLOAD\nB-1.end, P, -2.\n")
    (tmp_path / "deck.inp").write_text(text)
    (tmp_path / "part.toml").write_text('mesh = "deck.inp"\nanalysis = "deck"\norder = 2\n')
    field = solve(read_part(tmp_path / "part.toml").problem)["step_1"]
    far = np.isclose(field.mesh.points[:, 1], LENGTH + 3.0)
    np.testing.assert_allclose(
        field.displacement[far].mean(axis=0), [0.0, 2.0 * LENGTH / 4000.0, 0.0], atol=1e-5
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("*TIE, NAME=T\na, b\n", r"line \d+: \*TIE: the deck has no surface 'a'"),
        ("*NONSENSE\n", r"\*NONSENSE: it is not taken over"),
        ("*BOUNDARY\nfoot, 11, 11, 300.\n", r"degrees of freedom are 1 to 6"),
        ("*BOUNDARY\nnobody, 1\n", "does not have"),
        ("*BOUNDARY\n99999, 1\n", "the deck has no node '99999'"),
        ("*BOUNDARY, TYPE=VELOCITY\nfoot, 1\n", "TYPE=VELOCITY is not followed"),
        ("*BOUNDARY\nfoot, 1, 1, nan\n", "expected finite numbers"),
        ("*CLOAD\ncorner, 1, 1.\n", "it stands in no \\*STEP"),
        ("*INITIAL CONDITIONS, TYPE=STRESS\nEall, 1.\n", "only TYPE=TEMPERATURE is followed"),
        ("*SOLID SECTION, ELSET=Eall, MATERIAL=Iron\n", "the deck has no material 'IRON'"),
        ("*SOLID SECTION, ELSET=half, MATERIAL=Soft\n", "have a section already"),
        ("*SOLID SECTION, ELSET=Eall, MATERIAL=Soft, COMPOSITE\n", "COMPOSITE is not followed"),
        ("*MATERIAL, NAME=X\n*ELASTIC\n1., 0.\n2., 0., 100.\n", "depend on temperature"),
        ("*MATERIAL, NAME=X\n*ELASTIC, TYPE=LAMINA\n1., 0.\n", "TYPE=LAMINA is not followed"),
        ("*ORIENTATION, NAME=X\n0., 0., 0., 1., 0., 0.\n", "its points show no axes"),
        ("*STEP\n*STATIC, RIKS\n*END STEP\n", "RIKS is not followed"),
        ("*STEP\n*END STEP\n", "has no \\*STATIC"),
        (step("*CLOAD\ncorner, 4, 1.\n"), "solids take no moments"),
        (step("*CLOAD, USER\ncorner, 1, 1.\n"), "USER is not followed"),
        (step("*CLOAD, AMPLITUDE=X\ncorner, 1, 1.\n"), "no \\*AMPLITUDE 'X'"),
        (step("*DLOAD\nEall, P1, 1.\n"), "faces of 'Eall P1' are not on the outside"),
        (step("*DLOAD\nhalf, GRAV, 1., 1., 0., 0.\n"), "GRAV acts on a part of the cells"),
        (step("*DLOAD\nEall, P1NU, 1.\n"), "'P1NU' is not followed"),
        (step("*DSLOAD\nnone, P, 1.\n"), "no surface 'none'"),
        (step("*TEMPERATURE\nfoot, 10.\n"), "leaves nodes out"),
        (
            step("*CLOAD\ncorner, 1, 1.\n", "*STEP\n*FREQUENCY\n")
            + step("*CLOAD\ncorner, 1, 1.\n"),
            "follows 'step_2', whose supports and loads are not followed",
        ),
    ],
)
def test_what_is_not_taken_over_is_named_with_its_line(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as caught:
        case_of(tmp_path, MATERIAL + HELD + step("*CLOAD\ntip, 1, 1.\n") + text)
    assert "line " in str(caught.value)
    assert all("\n" not in line for line in caught.value.mistakes)


def test_all_mistakes_come_at_once(tmp_path):
    text = "*TIE, NAME=T\na, b\n*MPC\n" + HELD + step("*CLOAD\ncorner, 5, 1.\n")
    with pytest.raises(InputError) as caught:
        case_of(tmp_path, MATERIAL + text)
    assert len(caught.value.mistakes) == 3


def test_what_is_left_out_is_said(tmp_path):
    text = MATERIAL.replace("*DENSITY", "*PLASTIC\n1., 0.\n*DENSITY") + HELD
    text += step("*CLOAD\ntip, 1, 1.\n", "*STEP, NLGEOM\n*STATIC\n") + step("", "*STEP\n*BUCKLE\n")
    case = case_of(tmp_path, text)
    assert list(case.problem.loads) == ["step_1"]
    for words in ("*PLASTIC is left out", "without NLGEOM", "*BUCKLE is no static step"):
        assert sum(words in line for line in case.findings) == 1


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('material = "pla"\n', "got material in the part file"),
        ('step = "Step-9"\n', "no static step 'Step-9'; its steps are step_1"),
        ('[[supports]]\npatch = "foot"\n', "got supports in the part file"),
    ],
)
def test_keys_that_do_not_go_together(tmp_path, more, message):
    with pytest.raises(InputError, match=message):
        case_of(tmp_path, MATERIAL + HELD + step("*CLOAD\ntip, 1, 1.\n"), f"order = 2\n{more}")
    (tmp_path / "part.toml").write_text('mesh = "a.msh"\nanalysis = "deck"\n')
    (tmp_path / "a.msh").write_text("")
    with pytest.raises(InputError, match=r"goes with mesh, a deck"):
        read_part(tmp_path / "part.toml")
    (tmp_path / "part.toml").write_text('mesh = "deck.inp"\nstep = "a"\n')
    with pytest.raises(InputError) as caught:
        read_part(tmp_path / "part.toml")
    assert any('step goes with analysis = "deck"' in line for line in caught.value.mistakes)


def test_a_deck_of_quadratic_cells_stays_quadratic(tmp_path):
    text = MATERIAL + HELD + step("*CLOAD\ntip, 1, 1.\n")
    with pytest.raises(InputError, match="order = 1 goes with a deck of linear cells"):
        case_of(tmp_path, text, "order = 1\n", BOX.quadratic())


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
@pytest.mark.parametrize("mesh", [BOX, BOX.quadratic()], ids=["linear", "quadratic"])
def test_displacement_stress_and_reactions_are_those_of_calculix(tmp_path, mesh):
    constants = "*MATERIAL, NAME=W\n*ELASTIC, TYPE=ENGINEERING CONSTANTS\n"
    constants += "4000., 1000., 500., .3, .2, .1, 300., 250.,\n200.\n*DENSITY\n2.E-9\n"
    constants += "*EXPANSION, TYPE=ORTHO\n1.E-4, 2.E-4, 3.E-4\n"
    constants += "*ORIENTATION, NAME=O\n1., 1., 0., -1., 1., 0.\n"
    constants += "*SOLID SECTION, ELSET=Eall, MATERIAL=W, ORIENTATION=O\n"
    start = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNall, 20.\n"
    warm = "*TEMPERATURE\nNall, 30.\ntip, 45.\n"
    lines = mesh_text(mesh)
    faces = lines[lines.index("*SURFACE") :].splitlines()[1:3]
    pressure = "*DLOAD\n" + "".join(line.replace("S", "P") + ", 3.\n" for line in faces)
    pressure += "Eall, GRAV, 1.E6, 0., 1., 2.\nEall, CENTRIF, 1.E6, 1., 2., 3., 1., 1., 0.\n"
    text = lines + constants + start + "*BOUNDARY\nfoot, 1, 2\ny0, 2, 2, .01\ncorner, 3\n"
    text += step(pressure + "*CLOAD\ntip, 3, .5\ntip, 3, .25\n")
    text += step("*CLOAD\ntip, 3, -.5\n") + step(warm)
    (tmp_path / "deck.inp").write_text(text)
    rows_of = calculix.compared(tmp_path / "deck.inp")
    assert [row.split(" | ")[0] for row in rows_of] == ["step_1", "step_2", "step_3"]
    for row in rows_of:
        assert all(float(part.rstrip("%")) < 0.2 for part in row.split(" | ")[2:5])


def test_the_benchmark_says_that_calculix_is_missing(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["calculix", str(tmp_path), "--ccx", "no-such-program"])
    with pytest.raises(SystemExit, match="holds no deck"):
        calculix.main()
    (tmp_path / "a.inp").write_text("*NODE\n")
    with pytest.raises(SystemExit, match="CalculiX is not there as 'no-such-program'"):
        calculix.main()
