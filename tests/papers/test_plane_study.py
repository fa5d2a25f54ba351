"""Plates with the fibre as laid: sensitivity, agreement, energies, printing."""

from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from ccfem.fem.elasticity.problem import Force, Support
from ccfem.fem.materials import isotropic, named_material, plane_stress
from ccfem.fem.plates import PlaneProblem, raster_mesh, solve_plane
from ccfem.geometry.polylines import pack
from ccfem.judging.evaluation.layer_paths import PlanePaths
from ccfem.judging.evaluation.sensitivity import OffAxis
from ccfem.papers.plocher_2022.plane_study import (
    ANGLES,
    FibreMap,
    bead_area,
    benchmark,
    fibre_map,
    laid_plate,
    mixed_stiffness,
    print_seconds,
    reduced_stiffness,
    turned_energies,
)
from ccfem.paths.linking.print_order import nearest_end_order

TABLE_5 = {
    "c_fram": (73200.0, 4100.0, 0.33, 2200.0),
    "s_fram": (1900.0, 1100.0, 0.41, 700.0),
}


def plate(mask=None, stiffness=None):
    """Plate of unit pixels, sliding on its left side, pulled with 1 N at its right one."""
    mesh = raster_mesh(np.ones((8, 20), dtype=bool) if mask is None else mask)
    mesh = mesh.with_patches({"pin": mesh.nearest_nodes([[0.0, 4.0]])[:, None]})
    stiffness = plane_stress(1000.0, 1000.0, 0.3, 1000.0 / 2.6) if stiffness is None else stiffness
    supports = (Support("x_min", "x"), Support("pin", "y"))
    return PlaneProblem(mesh, stiffness, 1.0, supports, {"pull": (Force("x_max", (1, 0, 0)),)})


def holed():
    mask = np.ones((16, 40), dtype=bool)
    mask[6:10, 18:22] = False
    return plate(mask)


def paths(*lines, section=None, closed=None):
    """Paths on a section, without a layer behind it."""

    layer = SimpleNamespace(plane=SimpleNamespace(polygon=section))

    packed = pack([np.array(line, dtype=float) for line in lines])
    return PlanePaths(layer, *packed, np.array(closed or [False] * len(lines)))


@pytest.mark.parametrize("name", TABLE_5)
def test_reduced_stiffness_is_that_of_the_engineering_constants(name):
    np.testing.assert_allclose(
        reduced_stiffness(named_material(name)), plane_stress(*TABLE_5[name]), rtol=1e-9
    )


@pytest.mark.parametrize("name", TABLE_5)
def test_sensitivity_under_uniform_tension_is_the_off_axis_curve(name):
    # The sliding end leaves the stress uniform at any angle.
    problem = plate()
    found = turned_energies(
        problem, np.zeros(len(problem.mesh.cells)), reduced_stiffness(named_material(name))
    )
    e1, e2, nu, g = TABLE_5[name]
    c, s = np.cos(np.radians(ANGLES)), np.sin(np.radians(ANGLES))
    modulus = 1.0 / (c**4 / e1 + (1.0 / g - 2.0 * nu / e1) * s**2 * c**2 + s**4 / e2)
    np.testing.assert_allclose(found.values, modulus / modulus.max(), rtol=1e-6)
    angle = np.radians(np.linspace(0.0, 90.0, 91))
    assert np.abs(found(angle) - OffAxis(named_material(name))(angle)).max() < 0.015
    # 1 N over 8 mm^2 along 20 mm: W = s^2 V / (2 E).
    assert found.energies[0] == pytest.approx(0.5 * (1.0 / 8.0) ** 2 * 160.0 / e1)


def test_benchmark_agrees_with_itself_and_turned_fibre_keeps_f():
    problem = holed()
    (field,) = solve_plane(problem).values()
    found = benchmark(field, reduced_stiffness(named_material("c_fram")), angles=(0.0, 45.0, 90.0))
    none = np.full(len(field.mesh.cells), -1)

    def turned(degrees):
        return [FibreMap(found.direction + np.radians(degrees), none)]

    assert found.agreement(turned(0.0)) == pytest.approx(1.0)
    assert found.agreement(turned(180.0)) == pytest.approx(1.0)
    assert found.agreement(turned(30.0)) == pytest.approx(2.0 / 3.0)
    assert found.agreement([*turned(0.0), *turned(90.0)]) == pytest.approx(0.5)
    for reading in ("weighted", "harmonic"):
        assert found.index(turned(0.0), reading) == pytest.approx(found.curve.values[0])
        assert found.index(turned(90.0), reading) == pytest.approx(found.curve.values[-1])
    assert found.laid.strain_energy == pytest.approx(found.curve.energies[0])
    assert found.index(turned(0.0), "literal") > found.index(turned(90.0), "literal") > 1.0


def test_fibre_along_the_stress_is_stiffer_than_across_and_the_compliance_agrees():
    problem = holed()
    (field,) = solve_plane(problem).values()
    stiffness = reduced_stiffness(named_material("c_fram"))
    along = laid_plate(problem, np.zeros(len(field.mesh.cells)), stiffness)
    across = laid_plate(problem, np.full(len(field.mesh.cells), 0.5 * np.pi), stiffness)
    assert along.strain_energy < 0.2 * across.strain_energy
    # Half the work of the load.
    right = problem.mesh.points[:, 0] > 39.5
    assert along.strain_energy == pytest.approx(
        0.5 * along.field.displacement[right, 0].mean(), rel=0.02
    )
    # Unit cells: the sum of densities is the energy over the volume of one cell.
    assert along.density_sum == pytest.approx(along.strain_energy)
    everything = np.ones(len(field.mesh.cells), dtype=bool)
    assert along.energy_in(everything) == pytest.approx(along.strain_energy)


def test_angle_of_an_isotropic_sheet_does_not_matter():
    problem = holed()
    stiffness = reduced_stiffness(isotropic(1000.0, 0.3))
    (field,) = solve_plane(problem).values()
    angles = np.random.default_rng(3).uniform(0.0, np.pi, (2, len(field.mesh.cells)))
    laid = laid_plate(problem, angles, stiffness)
    assert laid.strain_energy == pytest.approx(field.strain_energy)


def test_layers_share_strain_and_each_has_its_own_stress():
    problem = plate()
    m = len(problem.mesh.cells)
    stiffness = reduced_stiffness(named_material("c_fram"))
    laid = laid_plate(problem, np.stack([np.zeros(m), np.full(m, 0.5 * np.pi)]), stiffness)
    # Cross-ply laminate in tension by hand: mean stiffness, free to contract.
    q = stiffness
    mean = np.array([[0.5 * (q[0, 0] + q[1, 1]), q[0, 1]], [q[0, 1], 0.5 * (q[0, 0] + q[1, 1])]])
    strain = np.linalg.solve(mean, [1.0 / 8.0, 0.0])
    np.testing.assert_allclose(laid.components[0, :, 0], q[0] @ [*strain, 0.0], rtol=1e-6)
    np.testing.assert_allclose(laid.components[1, :, 1], q[1] @ [strain[1], strain[0], 0.0])
    assert laid.raw_stress == pytest.approx(float(q[0] @ [*strain, 0.0]))
    assert laid.stress == pytest.approx(laid.raw_stress)


def test_fibre_map_of_straight_lines():
    centres = raster_mesh(np.ones((6, 10), dtype=bool)).centres
    slope = np.array([1.0, 0.5]) / np.hypot(1.0, 0.5)
    normal = np.array([-slope[1], slope[0]])
    lines = [
        np.array([5.0, 3.0]) + d * normal + np.outer([-12.0, 12.0], slope) for d in range(-8, 9)
    ]
    found = fibre_map(paths(*lines), centres, 1.0)
    np.testing.assert_allclose(found.angle, np.arctan2(0.5, 1.0))
    offset = (centres - [5.0, 3.0]) @ normal
    assert (np.abs(found.path - 8 - offset) <= 0.5 + 1e-9).all()


def test_cells_without_fibre_take_the_mean_of_their_neighbours():
    centres = raster_mesh(np.ones((3, 9), dtype=bool)).centres
    low = [[0.0, 0.5], [9.0, 0.5]]
    high = [[0.0, 2.5], [9.0, 2.5]]
    found = fibre_map(paths(low, high), centres, 1.0)
    middle = np.isclose(centres[:, 1], 1.5)
    assert (found.path[middle] == -1).all()
    assert (found.path[~middle] >= 0).all()
    np.testing.assert_allclose(np.sin(found.angle), 0.0, atol=1e-12)


def test_fibre_map_of_a_ring_is_tangential():
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    ring = 10.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    ring[-1] = ring[0]
    centres = 10.0 * np.stack([np.cos(turn[:-1:7]), np.sin(turn[:-1:7])], axis=1)
    found = fibre_map(paths(ring, closed=[True]), centres, 1.0)
    off = np.sin(found.angle - turn[:-1:7] - 0.5 * np.pi)
    assert np.abs(off).max() < 0.02


def test_long_paths_are_of_the_one_material_short_ones_of_the_other():
    laid = paths([[0, 0], [41, 0]], [[0, 1], [39, 1]])
    found = FibreMap(np.zeros(3), np.array([0, 1, -1]))
    long, short = np.eye(3), 2.0 * np.eye(3)
    mixed = mixed_stiffness([laid], [found], long, short)
    np.testing.assert_array_equal(mixed[0, :, 0, 0], [1.0, 2.0, 2.0])


def test_order_of_printing_goes_to_the_nearest_end():
    starts = np.array([[0.0, 0.0], [0.0, 5.0], [10.0, 1.0]])
    ends = np.array([[10.0, 0.0], [10.0, 5.0], [0.0, 1.0]])
    order, backward, travel = nearest_end_order(starts, ends)
    assert order.tolist() == [0, 2, 1]
    assert backward.tolist() == [False, False, False]
    assert travel == pytest.approx(1.0 + 4.0)
    order, backward, travel = nearest_end_order(starts[:2], ends[:2])
    assert backward.tolist() == [False, True]
    assert travel == 5.0
    lines = [np.stack([a, b]) for a, b in zip(starts, ends, strict=True)]
    assert print_seconds(paths(*lines)) == pytest.approx(30.0 / 8.3 + 5.0 / 91.6)


def test_overlap_and_gaps_of_beads():
    section = shapely.box(0.0, 0.0, 10.0, 3.0)
    lines = [[[0.0, y], [10.0, y]] for y in (0.5, 1.25)]
    overlap, gaps = bead_area(paths(*lines, section=section), 1.0)
    assert overlap == pytest.approx(0.25 / 3.0, abs=1e-6)
    assert gaps == pytest.approx(1.25 / 3.0, abs=1e-6)
