from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.base.tensor import rotate_stiffness
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import Force, PointForce, Pressure, Problem, Support, solve
from ccfem.fem.elasticity.system import prepare
from ccfem.fem.materials import isotropic, transversely_isotropic

LOADS = {
    "down": (Force("x_max", (0.0, 0.0, -3.0)),),
    "press": (Pressure("z_max", 0.2), PointForce((8.0, 3.0, 2.0), (0.0, 1.0, 0.0))),
}


def problem(order=1, **more):
    mesh = more.pop("mesh", box_mesh((8.0, 3.0, 2.0), (6, 3, 2)))
    mesh = mesh if order == 1 else mesh.quadratic()
    parts = {"material": isotropic(100.0, 0.3), "supports": (Support("x_min"),), "loads": LOADS}
    return Problem(mesh, **{**parts, "order": order, **more})


@pytest.mark.parametrize("order", [1, 2])
def test_reactions_balance_the_loads(order):
    part = problem(order)
    for name, field in solve(part, tolerance=1e-11).items():
        applied = prepare(part).forces[name]
        points = part.mesh.points
        np.testing.assert_allclose((field.reactions + applied).sum(axis=0), 0.0, atol=1e-9)
        moment = np.cross(points, field.reactions + applied).sum(axis=0)
        np.testing.assert_allclose(moment, 0.0, atol=1e-8)
        away = points[:, 0] > 1e-9
        assert not field.reactions[away].any()


@pytest.mark.parametrize("order", [1, 2])
def test_work_of_the_loads_is_twice_the_strain_energy(order):
    part = problem(order)
    for name, field in solve(part, tolerance=1e-11).items():
        work = np.vdot(prepare(part).forces[name], field.displacement)
        assert work == pytest.approx(2.0 * field.strain_energy, rel=1e-9)


def test_strain_energy_is_the_integral_over_the_cells():
    part = problem()
    field = solve(part)["down"]
    compliance = np.linalg.inv(part.material.stiffness)
    stress = field.stress[:, [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    density = 0.5 * np.einsum("mi,ij,mj->m", stress, compliance, stress)
    assert part.mesh.volumes @ density == pytest.approx(field.strain_energy, rel=1e-8)


def test_load_cases_superpose():
    part = problem(loads={**LOADS, "both": LOADS["down"] + LOADS["press"]})
    fields = solve(part, tolerance=1e-12)
    for name in ("displacement", "stress", "nodal", "reactions"):
        down, press, both = (getattr(fields[case], name) for case in ("down", "press", "both"))
        np.testing.assert_allclose(down + press, both, atol=1e-9 * np.abs(both).max())


def test_a_moved_support_pulls_the_part():
    # Uniaxial stress: the ends move apart, the sides are free, statically determinate.
    supports = (
        Support("x_min", "x"),
        Support("y_min", "y"),
        Support("z_min", "z"),
        Support("x_max", "x", (0.08, 0.0, 0.0)),
    )
    field = solve(problem(supports=supports, loads={"pull": ()}))["pull"]
    expected = np.zeros((3, 3))
    expected[0, 0] = 100.0 * 0.01
    np.testing.assert_allclose(
        field.stress, np.broadcast_to(expected, field.stress.shape), atol=1e-9
    )
    np.testing.assert_allclose(
        field.displacement[:, 1], -0.003 * field.mesh.points[:, 1], atol=1e-12
    )
    end = np.isclose(field.mesh.points[:, 0], 8.0)
    np.testing.assert_allclose(field.reactions[end].sum(axis=0), [6.0, 0.0, 0.0], atol=1e-9)
    assert field.strain_energy == pytest.approx(0.5 * 6.0 * 0.08)


def test_density_scales_displacement_inversely():
    density = np.full(len(problem().mesh.cells), 0.25)
    full, quarter = solve(problem())["down"], solve(problem(density=density))["down"]
    np.testing.assert_allclose(quarter.displacement, 4.0 * full.displacement, rtol=1e-7)
    np.testing.assert_allclose(quarter.stress, full.stress, atol=1e-7 * np.abs(full.stress).max())


def test_axes_and_stiffness_say_the_same():
    material = transversely_isotropic(5000.0, 800.0, 0.3, 400.0)
    generator = np.random.default_rng(0)
    axes = np.linalg.qr(generator.normal(size=(len(problem().mesh.cells), 3, 3)))[0]
    by_axes = solve(problem(material=material, axes=axes))["down"]
    stiffness = rotate_stiffness(material.stiffness, axes)
    by_stiffness = solve(problem(stiffness=stiffness))["down"]
    np.testing.assert_allclose(by_axes.displacement, by_stiffness.displacement, rtol=1e-6)


def test_uniform_pressure_is_uniform_stress():
    mesh = problem().mesh
    part = replace(
        problem(),
        mesh=mesh.with_patches({"all": mesh.boundary}),
        supports=(Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z")),
        loads={"deep": (Pressure("all", 2.0),)},
    )
    field = solve(part, tolerance=1e-12)["deep"]
    expected = np.broadcast_to(-2.0 * np.eye(3), (len(mesh.points), 3, 3))
    np.testing.assert_allclose(field.nodal, expected, atol=1e-9)


def test_the_record_tells_how_the_solve_went():
    first, second = (field.record for field in solve(problem(2), "two-level").values())
    assert (first.backend, second.backend) == ("two-level", "two-level")
    assert first.unknowns == int(prepare(problem(2)).held.free.sum())
    assert min(first.iterations, second.iterations) > 0
    assert max(first.residual, second.residual) <= 1e-8
    assert min(first.assembly_seconds, first.solve_seconds) > 0.0


def test_renumbering_changes_nothing():
    part = problem()
    mesh = part.mesh
    order = np.random.default_rng(4).permutation(len(mesh.points))
    number = np.argsort(order)
    patches = {name: number[facets] for name, facets in mesh.patches.items()}
    shuffled = TetMesh(mesh.points[order], number[mesh.cells][::-1], patches)
    one, other = solve(part)["down"], solve(replace(part, mesh=shuffled))["down"]
    np.testing.assert_allclose(other.displacement, one.displacement[order], atol=1e-9)
    np.testing.assert_allclose(other.nodal, one.nodal[order], atol=1e-7)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"loads": {}}, "no load case"),
        ({"supports": ()}, "no support"),
        ({"density": np.zeros(216)}, r"density must lie in \(0, 1\]"),
        ({"density": np.ones(3)}, "must have shape"),
        ({"axes": np.full((216, 3, 3), np.nan)}, "must be finite"),
    ],
)
def test_bad_problems_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        solve(problem(**change))


def test_bad_meshes_are_refused():
    mesh = problem().mesh
    points = mesh.points.copy()
    points[3, 0] = np.nan
    with pytest.raises(InputError, match="NaN"):
        solve(replace(problem(), mesh=TetMesh(points, mesh.cells, mesh.patches)))
    cells = mesh.cells.copy()
    cells[5] = cells[5][[0, 2, 1, 3]]
    with pytest.raises(InputError, match="cell 5 of the mesh has volume -"):
        solve(replace(problem(), mesh=TetMesh(mesh.points, cells, mesh.patches)))
