"""Supports that only press, beside beams, blocks, and a quadratic programme of another program."""

from dataclasses import replace

import numpy as np
import pytest
from flat_paths import flat_paths
from scipy.optimize import nnls

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import (
    BodyForce,
    Force,
    PressingSupport,
    Pressure,
    Problem,
    SlidingSupport,
    Spring,
    Support,
    prepare,
    solve,
)
from ccfem.fem.elasticity.load_kinds import Displacement
from ccfem.fem.materials import isotropic
from ccfem.fem.topopt import Simp
from ccfem.judging.virtual_testing.equilibrium import BONDED, TENSION, equilibrium
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strands import cut_strands

SIZE = (16.0, 4.0, 3.0)
GUIDES = (Support("x_min", "x"), Support("y_min", "y"))


def block(order, lift, *more, divisions=(6, 2, 2), supports=GUIDES):
    """Block on a table, pressed on it from above and lifted at one end."""
    mesh = box_mesh(SIZE, divisions)
    mesh = mesh if order == 1 else mesh.quadratic()
    load = (Pressure("z_max", 0.02), Force("x_max", (0.3, 0.1, lift)))
    supports = (PressingSupport("z_min"), *supports, *more)
    return Problem(mesh, isotropic(100.0, 0.3), supports, {"case": load}, order=order)


def programme(matrix, held, forces):
    """Displacement (n, 3) that has least energy and sinks nowhere, by the NNLS of scipy."""
    turn = held.ties.matrix.toarray()
    images = np.column_stack([matrix @ column for column in np.ascontiguousarray(turn.T)])
    full, load = turn.T @ images, turn.T @ forces.reshape(-1)
    inner, bound = np.flatnonzero(held.free & ~held.presses), np.flatnonzero(held.presses)
    solved = np.linalg.solve(
        full[np.ix_(inner, inner)], np.column_stack([full[np.ix_(inner, bound)], load[inner]])
    )
    schur = full[np.ix_(bound, bound)] - full[np.ix_(bound, inner)] @ solved[:, :-1]
    rest = load[bound] - full[np.ix_(bound, inner)] @ solved[:, -1]
    # min 1/2 q S q - g q with q <= 0 is min |L^T z + L^-1 g| with z = -q >= 0.
    lower = np.linalg.cholesky(schur)
    back = -nnls(lower.T, -np.linalg.solve(lower, rest))[0]
    found = np.zeros(len(full))
    found[bound], found[inner] = back, solved[:, -1] - solved[:, :-1] @ back
    return (turn @ found).reshape(-1, 3)


@pytest.mark.parametrize("lift", [0.2, 0.8])
@pytest.mark.parametrize("order", [1, 2])
def test_contact_is_that_of_a_quadratic_programme(order, lift):
    # A soft spring, without which the programme has no unique solution where all is lifted.
    problem = block(order, lift, Spring("x_max", (0.0, 0.0, 1.0)))
    field, system = solve(problem)["case"], prepare(problem)
    exact = programme(system.assemble(), system.held, system.forces["case"])
    error = np.abs(field.displacement - exact).max()
    assert error < 1e-5 * np.abs(exact).max()
    back = system.held.along_pressing(field.displacement)
    assert back.max() <= 1e-7 * np.abs(exact).max()
    assert 0.1 < (back < -1e-6 * np.abs(exact).max()).mean() < 0.95
    # Nothing pulls, away from the spring.
    pressed = np.where((problem.mesh.points[:, 0] < 15.9)[:, None], field.reactions, 0.0)
    assert system.held.along_pressing(pressed).max() < 1e-6
    assert pressed[:, 2].sum() > 0.1


def test_an_iterative_backend_finds_the_same_contact_for_several_loads():
    problem = block(1, 0.8, divisions=(10, 3, 3))
    loads = {
        "one": problem.loads["case"],
        "two": (Pressure("z_max", 0.02), Force("x_max", (0, 0, -0.4))),
    }
    problem = replace(problem, loads=loads)
    exact = solve(problem, "superlu")
    for backend in ("amg", "auto"):
        found = solve(problem, backend)
        for case in loads:
            wanted = exact[case].displacement
            error = np.abs(found[case].displacement - wanted).max()
            assert error < 1e-5 * np.abs(wanted).max()


def test_a_lifted_beam_leaves_the_table_as_a_beam_does():
    """Weight w, lifted at its end by P: off over a = 2 P / w, end up by w a^4 / 24 E I.

    At the point where it leaves neither moment nor slope is left; both follow from statics of the
    lifted length (Timoshenko, Strength of Materials II, 1956, chapter 1).
    """
    length, height, young, weight = 60.0, 1.0, 100.0, 1e-5
    mesh = box_mesh((length, 1.0, height), (40, 1, 2)).quadratic()
    lift = 0.5 * weight * 36.0
    supports = (PressingSupport("z_min"), Support("x_min", "x"), Support("y_min", "y"))
    load = (BodyForce((0.0, 0.0, -weight / height)), Force("x_max", (0.0, 0.0, lift)))
    field = solve(Problem(mesh, isotropic(young, 0.0), supports, {"case": load}, order=2))["case"]
    bottom = (mesh.points[:, 2] == 0.0) & (mesh.points[:, 1] == 0.0)
    place, up = mesh.points[bottom, 0], field.displacement[bottom, 2]
    exact = weight * 36.0**4 / (24.0 * young * height**3 / 12.0)
    assert up[place.argmax()] == pytest.approx(exact, rel=0.02)
    assert length - place[up < 0.002 * exact].max() == pytest.approx(36.0, abs=5.0)
    assert field.support_forces["z_min"][2] == pytest.approx(weight * length - lift, rel=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_a_pressed_block_is_held_as_by_a_plane_that_slides(order):
    mesh = box_mesh(SIZE, (4, 2, 2))
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    mesh = replace(mesh, points=mesh.points @ turn.T)
    mesh = mesh if order == 1 else mesh.quadratic()
    sides = tuple(SlidingSupport(name) for name in ("x_min", "y_min"))
    stress = isotropic(100.0, 0.3)
    fields = [
        solve(
            Problem(mesh, stress, (*sides, own), {"case": (Pressure("z_max", 0.5),)}, order=order)
        )
        for own in (SlidingSupport("z_min"), PressingSupport("z_min"))
    ]
    one, other = (field["case"].displacement for field in fields)
    np.testing.assert_allclose(other, one, atol=1e-10)


def test_a_pulled_block_leaves_its_support():
    problem = block(1, 0.0)
    pulled = {"case": (Force("z_max", (0.0, 0.0, 1.0)),)}
    with pytest.raises(InputError, match="lifts the part off its supports that only press"):
        solve(replace(problem, loads=pulled))
    # Between two tables it rests on the other one, and what it leaves carries nothing.
    pushed = {"case": (Force("z_min", (0.0, 0.0, 1.0)),)}
    both = replace(problem, loads=pushed, supports=(*problem.supports, PressingSupport("z_max")))
    field = solve(both)["case"]
    np.testing.assert_allclose(field.support_forces["z_max"], [0.0, 0.0, -1.0], atol=1e-6)
    np.testing.assert_allclose(field.support_forces["z_min"], 0.0, atol=1e-6)


def test_the_solution_is_in_proportion_to_the_load():
    once = solve(block(1, 0.8))["case"]
    problem = block(1, 0.8)
    thrice = tuple(
        replace(load, **{name: tuple(3.0 * np.array(getattr(load, name)))})
        if (name := "vector") in vars(load)
        else replace(load, magnitude=3.0 * load.magnitude)
        for load in problem.loads["case"]
    )
    again = solve(replace(problem, loads={"case": thrice}))["case"]
    np.testing.assert_allclose(again.displacement, 3.0 * once.displacement, rtol=1e-6, atol=1e-9)


def test_a_combination_has_a_contact_of_its_own():
    problem = block(1, 0.0, Spring("x_max", (0.0, 0.0, 1.0)))
    press, lift = Pressure("z_max", 0.02), Force("x_max", (0.3, 0.1, 0.4))
    loads = {"press": (press,), "lift": (press, lift)}
    combinations = {"more": {"press": -0.5, "lift": 2.0}}
    problem = replace(problem, loads=loads, combinations=combinations)
    fields, system = solve(problem), prepare(problem)
    found = fields["more"]
    assert tuple(fields) == ("press", "lift", "more")
    assert found.loaded == ("x_max", "z_max")
    exact = programme(system.assemble(), system.held, system.forces_in("more"))
    size = np.abs(exact).max()
    assert np.abs(found.displacement - exact).max() < 1e-5 * size
    # The sum of the displacements is something else, and sinks into the table.
    added = 2.0 * fields["lift"].displacement - 0.5 * fields["press"].displacement
    assert np.abs(added - exact).max() > 0.01 * size
    assert system.held.along_pressing(found.displacement).max() <= 1e-7 * size
    # Its reactions, that of the spring among them, balance its own loads.
    vertical = found.reactions[:, 2].sum()
    assert vertical == pytest.approx(1.5 * 0.02 * 16.0 * 4.0 - 2.0 * 0.4, rel=1e-6)
    # With fibres too the forces are those of the combination.
    forces = system.forces_in("more")
    np.testing.assert_allclose(Specimen.of(found).forces, forces, atol=1e-12)


@pytest.mark.parametrize("mode", [BONDED, TENSION])
def test_contact_and_fibres_are_settled_together(mode):
    """Of the stiffness with the fibres that carry, the contact is that of the programme."""
    spring = Spring("x_max", (0.0, 0.0, 1.0))
    problem = block(1, 0.4, spring, divisions=(12, 2, 2))
    rows = [[[0.5, y, z], [15.5, y, z]] for y in (0.7, 3.1) for z in (0.3, 2.6)]
    specimen = Specimen.of(solve(problem)["case"])
    strands = cut_strands(flat_paths(rows), problem.mesh)
    found = equilibrium(specimen, strands, 400.0, mode)
    exact = programme(found.matrix, specimen.system.held, specimen.forces)
    assert np.abs(found.displacement - exact).max() < 1e-5 * np.abs(exact).max()
    assert (found.strain[found.carried > 0.0] > 0.0).all() or mode == BONDED
    # With fibre it touches in other places than without.
    other = specimen.system.held.touching(found.displacement).contact
    assert (other != specimen.held.contact).any()


def test_bad_input_is_refused():
    problem = block(1, 0.2)
    slanted = (PressingSupport("x_max", (1.0, 0.0, -1.0)), *problem.supports)
    with pytest.raises(InputError, match="must meet at right angles or smoothly"):
        solve(replace(problem, supports=slanted))
    moved = (*problem.supports, Support("x_max", "z", (0.0, 0.0, 0.1)))
    with pytest.raises(InputError, match="presses against a support while another one moves it"):
        solve(replace(problem, supports=moved))
    with pytest.raises(InputError, match=r"supports on it hold nothing"):
        solve(replace(problem, loads={"case": (Displacement("z_min", (0.0, 0.0, 0.1)),)}))
    with pytest.raises(InputError, match="is free to move along y"):
        solve(replace(problem, supports=(PressingSupport("z_min"), Support("x_min", "x"))))
    with pytest.raises(InputError, match="must have a finite length above 0"):
        PressingSupport("z_min", (0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="takes supports that hold both ways"):
        Simp(0.5)(problem)
