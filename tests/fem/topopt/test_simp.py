from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import Force, PointForce, Problem, Support, solve
from ccfem.fem.materials import isotropic, plane_stress
from ccfem.fem.plates import PlaneMesh, PlaneProblem, raster_mesh, rotate_plane, solve_plane
from ccfem.fem.topopt import Compliance, Simp
from ccfem.fem.topopt.parametrisation import Parametrisation

UNIT = plane_stress(1.0, 1.0, 0.3, 1.0 / 2.6)


def mbb(nx, ny, stiffness=UNIT):
    """Half of the MBB beam on a raster, as in the 88 lines."""
    mesh = raster_mesh(np.ones((ny, nx), dtype=bool))
    mesh = mesh.with_patches({"roller": mesh.nearest_nodes([[nx, 0]])[:, None]})
    supports = (Support("x_min", "x"), Support("roller", "y"))
    loads = {"load": (PointForce((0.0, ny, 0.0), (0.0, -1.0, 0.0)),)}
    return PlaneProblem(mesh, stiffness, 1.0, supports, loads)


@pytest.mark.parametrize(
    ("filter", "radius", "compliance"),
    [("sensitivity", 1.5, 203.2), ("sensitivity", 2.4, 216.8), ("density", 2.4, 233.7)],
)
def test_mbb_beam_of_the_88_lines(filter, radius, compliance):
    # Andreassen et al., Struct. Multidisc. Optim. 43 (2011) 1; f 0.5, p 3, change below 0.01.
    design = Simp(0.5, 3.0, radius, filter)(mbb(60, 20))
    assert design.compliance[-1] == pytest.approx(compliance, rel=0.005)
    assert design.converged == "change"
    assert design.volume_fraction == pytest.approx(0.5, abs=1e-6)
    # What is reported is the compliance of what is returned.
    field = solve_plane(design.problem)["load"]
    assert 2.0 * field.strain_energy == pytest.approx(design.compliance[-1], rel=1e-6)


def tets():
    mesh = box_mesh((6.0, 2.0, 2.0), (6, 2, 2))
    loads = {
        "down": (Force("x_max", (0.0, 0.0, -1.0)),),
        "side": (Force("x_max", (0.2, 1.0, 0.0)),),
    }
    return Problem(mesh, isotropic(1e3, 0.3), (Support("x_min"),), loads, order=1)


def plates():
    plate = mbb(10, 6)
    angles = np.random.default_rng(2).uniform(0.0, np.pi, 60)
    fibre = rotate_plane(plane_stress(20.0, 1.0, 0.3, 0.7), angles)
    more = {"tip": (PointForce((10.0, 3.0, 0.0), (1.0, 0.5, 0.0)),)}
    cells = np.vstack([plate.mesh.cells[:, [0, 1, 2]], plate.mesh.cells[:, [0, 2, 3]]])
    triangles = PlaneMesh(plate.mesh.points, cells, plate.mesh.patches)
    return [
        plate,
        replace(plate, stiffness=fibre, loads={**plate.loads, **more}),
        replace(
            plate,
            mesh=triangles,
            stiffness=np.vstack([fibre, fibre]),
            thickness=np.linspace(0.5, 1.5, 120),
        ),
    ]


@pytest.mark.parametrize("filter", ["sensitivity", "density"])
@pytest.mark.parametrize("k", range(4))
def test_sensitivities_by_finite_differences(k, filter):
    problem = tets() if k == 3 else plates()[k]
    weights = {name: 0.5 + i for i, name in enumerate(problem.loads)}
    model = Compliance(problem, weights, "superlu")
    m = len(model.volumes)
    rng = np.random.default_rng(k)
    solid, void = np.arange(m) == 3, np.arange(m) == 7
    parameters = Simp(0.5, 3.0, 2.3, filter, minimum_stiffness=1e-3)
    space = Parametrisation.of_part(parameters, model, solid, void)
    x = rng.uniform(0.2, 0.9, m)

    def compliance(x):
        return model(space.factor(space.density(x))).compliance

    density = space.density(x)
    np.testing.assert_allclose(space.factor(density), 1e-3 + density**3 * (1.0 - 1e-3))
    energy = model(space.factor(density)).energy
    gradient = space.gradient(density, energy)
    step = 1e-5
    for cell in rng.choice(m, 8, replace=False):
        move = step * (np.arange(m) == cell)
        difference = (compliance(x + move) - compliance(x - move)) / (2 * step)
        assert gradient[cell] == pytest.approx(difference, rel=1e-5, abs=1e-6 * abs(gradient).max())
    volume = space.volume_gradient()
    direction = rng.uniform(-0.1, 0.1, m)
    change = model.volumes @ (space.density(x + direction) - density)
    assert volume @ direction == pytest.approx(change, rel=1e-9)


def test_compliance_falls_and_beats_the_uniform_plate():
    design = Simp(0.5, radius=1.5)(mbb(30, 10))
    uniform = design.compliance[0]
    assert design.compliance[-1] < 0.25 * uniform
    assert design.density.min() >= 0.0
    assert design.density.max() <= 1.0
    assert design.grey < 0.5  # the uniform plate has 1


@pytest.mark.parametrize("filter", ["sensitivity", "density"])
def test_passive_cells_stay(filter):
    problem = mbb(30, 10)
    centre = problem.mesh.centres
    void = np.hypot(centre[:, 0] - 12.0, centre[:, 1] - 5.0) < 2.5
    solid = centre[:, 1] > 9.0
    design = Simp(0.5, radius=1.5, filter=filter, max_iterations=30)(
        problem, solid=solid, void=void
    )
    assert (design.density[solid] == 1.0).all()
    assert (design.density[void] == 0.0).all()
    assert design.volume_fraction == pytest.approx(0.5, abs=1e-6)


def test_load_cases_are_weighted():
    problem = mbb(20, 10)
    other = {"other": (PointForce((20.0, 10.0, 0.0), (0.0, -1.0, 0.0)),)}
    both = replace(problem, loads={**problem.loads, **other})
    first = Simp(0.5, radius=1.5, max_iterations=20)(problem)
    only = Simp(0.5, radius=1.5, max_iterations=20)(both, weights={"load": 1.0, "other": 0.0})
    np.testing.assert_allclose(only.density, first.density, atol=1e-6)
    shared = Simp(0.5, radius=1.5, max_iterations=20)(both)
    again = Simp(0.5, radius=1.5, max_iterations=20)(both, weights={"load": 2.0, "other": 2.0})
    np.testing.assert_allclose(again.density, shared.density, atol=1e-6)
    np.testing.assert_allclose(again.compliance, 2.0 * shared.compliance, rtol=1e-6)
    assert np.abs(shared.density - first.density).max() > 0.5


def test_mirrored_problem_gives_the_mirrored_design():
    problem = mbb(24, 8)
    mesh = problem.mesh
    flipped = replace(mesh, points=mesh.points * [-1.0, 1.0], cells=mesh.cells[:, ::-1])
    loads = {"load": (PointForce((0.0, 8.0, 0.0), (0.0, -1.0, 0.0)),)}
    other = Simp(0.5, radius=1.5, max_iterations=15)(replace(problem, mesh=flipped, loads=loads))
    first = Simp(0.5, radius=1.5, max_iterations=15)(problem)
    np.testing.assert_allclose(other.density, first.density, atol=1e-6)


def test_a_run_goes_on_where_it_stopped():
    problem = mbb(20, 10)
    whole = Simp(0.5, radius=1.5, filter="density", max_iterations=12)(problem)
    part = Simp(0.5, radius=1.5, filter="density", max_iterations=5)(problem)
    rest = Simp(0.5, radius=1.5, filter="density", max_iterations=7)(problem, start=part.variables)
    np.testing.assert_allclose(rest.density, whole.density, atol=1e-9)


def test_it_stops_when_the_objective_stands_still():
    design = Simp(0.5, radius=1.5, tolerance=0.0, objective_tolerance=1e-3)(mbb(30, 10))
    assert design.converged == "objective"
    recent = design.compliance[-11:]
    assert np.ptp(recent) < 2e-3 * recent[-1]


def test_progress_is_told():
    told = []
    Simp(0.5, radius=1.5, max_iterations=4)(mbb(12, 6), progress=lambda *a: told.append(a))
    assert [share for _, share in told] == [0.25, 0.5, 0.75, 1.0]
    assert "compliance" in told[0][0]
    assert "volume 0.5000" in told[0][0]


def test_tetrahedra_get_stiffer_too():
    problem = tets()
    design = Simp(0.5, radius=1.2, max_iterations=25, backend="superlu")(problem)
    assert design.compliance[-1] < 0.6 * design.compliance[0]
    assert design.volume_fraction == pytest.approx(0.5, abs=1e-6)
    fields = solve(design.problem)
    total = sum(2.0 * field.strain_energy for field in fields.values())
    assert total == pytest.approx(design.compliance[-1], rel=1e-6)


def plate_of_tets(nx, ny):
    """Beam of `mbb` in one layer of tetrahedra in plane stress, and the pixel of each cell."""
    mesh = box_mesh((float(nx), float(ny), 1.0), (nx, ny, 1))
    centre = mesh.points[mesh.cells].mean(axis=1)
    column = np.floor(centre[:, 0]) + nx * (ny - 1 - np.floor(centre[:, 1]))
    # The roller is the edge at the corner, given as a facet that is flat.
    edge = np.flatnonzero((mesh.points[:, 0] == nx) & (mesh.points[:, 1] == 0.0))
    mesh = mesh.with_patches({"roller": np.array([[edge[0], edge[1], edge[0]]])})
    stiffness = np.diag([0.0, 0.0, 1.0, 1.0, 1.0, 0.0])
    for i, a in enumerate((0, 1, 5)):
        for j, b in enumerate((0, 1, 5)):
            stiffness[a, b] = UNIT[i, j]
    supports = (
        Support("x_min", "x"),
        Support("roller", "y"),
        Support("z_min", "z"),
        Support("z_max", "z"),
    )
    loads = tuple(PointForce((0.0, ny, z), (0.0, -0.5, 0.0)) for z in (0.0, 1.0))
    cells = np.broadcast_to(stiffness, (len(mesh.cells), 6, 6))
    part = Problem(mesh, isotropic(1.0, 0.3), supports, {"load": loads}, stiffness=cells)
    return part, column.astype(int)


def test_a_plate_of_tetrahedra_by_columns_is_the_plate_of_quadrilaterals():
    part, column = plate_of_tets(30, 10)
    solid = Simp(0.5, radius=1.5, backend="superlu", max_iterations=60)(part, groups=column)
    plane = Simp(0.5, radius=1.5, max_iterations=60)(mbb(30, 10))
    assert np.ptp([solid.density[column == k] for k in range(300)], axis=1).max() == 0.0
    density = np.array([solid.density[column == k][0] for k in range(300)])
    # Linear tetrahedra are stiffer than quadrilaterals, here with ten of them through the depth.
    assert 0.95 < solid.compliance[-1] / plane.compliance[-1] < 1.0
    overlap = np.minimum(density, plane.density).sum() / np.maximum(density, plane.density).sum()
    assert overlap > 0.9
    assert solid.volume_fraction == pytest.approx(0.5, abs=1e-6)


def test_groups_of_one_cell_change_nothing():
    problem = mbb(20, 10)
    alone = Simp(0.5, radius=1.5, max_iterations=10)(problem)
    order = np.random.default_rng(0).permutation(200)
    grouped = Simp(0.5, radius=1.5, max_iterations=10)(problem, groups=7 * order)
    np.testing.assert_allclose(grouped.density, alone.density, atol=1e-9)
    pairs = Simp(0.5, radius=1.5, max_iterations=10)(problem, groups=np.arange(200) // 2)
    np.testing.assert_array_equal(pairs.density[::2], pairs.density[1::2])


def test_filters_prevent_checkerboards():
    def board(design, ny, nx):
        """Mean size of the alternating part of the density of 2 x 2 cells."""
        rho = design.density.reshape(ny, nx)
        return np.abs(rho[1:, 1:] - rho[1:, :-1] - rho[:-1, 1:] + rho[:-1, :-1]).mean() / 4.0

    # Below the distance of the cells nothing is averaged.
    none = Simp(0.5, radius=0.9, max_iterations=40)(mbb(30, 10))
    some = Simp(0.5, radius=1.5, max_iterations=40)(mbb(30, 10))
    assert board(none, 10, 30) > 0.1
    assert board(some, 10, 30) < 0.4 * board(none, 10, 30)
    assert none.grey < 0.2


def test_filled_cells_have_the_volume():
    design = Simp(0.5, radius=1.5, max_iterations=20)(mbb(30, 10))
    filled = design.filled(0.4)
    assert filled.sum() == 120
    assert design.density[filled].min() >= design.density[~filled].max()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            {"volume_fraction": 1.0},
            r"simp\.volume_fraction must be above 0 and below 1; got 1.0: give one in this range",
        ),
        ({"penalty": 0.5}, "penalty must be at least 1; got 0.5"),
        ({"filter": "none"}, "filter must be one of 'sensitivity', 'density'; got 'none'"),
        ({"radius": 0.0}, "radius must be above 0 mm; got 0.0"),
        ({"minimum_stiffness": 0.0}, "minimum_stiffness must be above 0 and below 1; got 0.0"),
        ({"move": 0.0}, "move must be above 0 and at most 1; got 0.0"),
        ({"tolerance": -1.0}, "tolerance must be at least 0; got -1.0"),
        (
            {"objective_tolerance": float("nan")},
            "objective_tolerance must be a finite number, at least 0; got nan",
        ),
        ({"max_iterations": 0}, "max_iterations must be at least 1; got 0"),
    ],
)
def test_bad_parameters_are_refused(more, message):
    with pytest.raises(InputError, match=message):
        Simp(**{"volume_fraction": 0.5, **more})


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"weights": {"other": 1.0}}, "one number >= 0 for each load case"),
        ({"weights": {"load": 0.0}}, "give one a weight"),
        ({"solid": np.ones(60, dtype=bool)}, "cannot be met"),
        ({"solid": np.arange(60) < 2, "void": np.arange(60) < 1}, "both solid and void"),
        ({"void": np.ones(5, dtype=bool)}, r"void must have shape \(60,\), one entry a cell"),
        ({"void": np.zeros(60)}, "void must be a bool array; got float64"),
        ({"start": np.full(60, 2.0)}, r"densities in \[0, 1\]; got 2.0 to 2.0"),
        ({"groups": np.zeros(3, dtype=int)}, "groups must be 60 integers"),
        (
            {"groups": np.arange(60), "start": np.full(5, 0.5)},
            r"start must have shape \(60,\), one entry a cell; got \(5,\)",
        ),
        (
            {"problem": replace(mbb(10, 6), supports=(Support("x_min", "xy", (1.0, 0.0, 0.0)),))},
            "supports at rest",
        ),
        ({"problem": replace(tets(), mesh=tets().mesh.quadratic())}, "linear tetrahedra"),
        ({"problem": replace(tets(), density=np.full(144, 0.5))}, "has a density already"),
    ],
)
def test_bad_data_are_refused(more, message):
    with pytest.raises(InputError, match=message):
        Simp(0.5, radius=1.5)(**{"problem": mbb(10, 6), **more})


def test_a_filter_that_reaches_most_cells_is_refused():
    with pytest.raises(InputError, match="give a smaller one"):
        Simp(0.5, radius=1e9)(mbb(120, 100))
