"""Sparse plastic in a solve: moduli by voxels of the lines, sandwich beams by theory, mass."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.studies.infill_moduli import POISSON, cell_of, homogenised, moduli
from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.elasticity.load_kinds import Gravity
from ccfem.fem.materials import isotropic, transversely_isotropic
from ccfem.judging.virtual_testing.failure_laws.matrix import matrix_peak
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.machine import Machine
from ccfem.paths.plastic import Plastic
from ccfem.paths.plastic.as_printed import infill_stiffness, infill_strength
from ccfem.slicing.slicers.planar import Planar

PLA = replace(isotropic(3000.0, 0.35), tensile_strength=50.0, mass_density=1.24)


@pytest.mark.parametrize(
    ("infill", "density"), [("lines", 0.2), ("lines", 0.3), ("grid", 0.2), ("gyroid", 0.3)]
)
def test_the_laws_are_those_of_the_lines_as_they_are_laid(infill, density):
    """Layers half as high as lines are wide."""
    size = (4, 2) if infill == "gyroid" else (6, 3)
    found = moduli(homogenised(cell_of(infill, density, *size)))
    law = moduli(infill_stiffness(infill, density, 1.0, POISSON))
    for value, expected in zip(found[0], law[0], strict=True):
        assert value == pytest.approx(expected, rel=0.2)
    for value, expected in zip(found[1], law[1], strict=True):
        assert value == pytest.approx(expected, rel=0.45)


@pytest.mark.parametrize("infill", ["lines", "grid", "gyroid"])
@pytest.mark.parametrize("density", [0.05, 0.2, 0.6])
@pytest.mark.parametrize("poisson", [0.0, 0.35, 0.45])
def test_no_infill_is_stiffer_than_its_plastic_allows(infill, density, poisson):
    """Voigt's bound on all strains; without shear, that of the mixture along each direction."""
    solid = isotropic(1.0, poisson).stiffness
    stiffness = infill_stiffness(infill, density, 1.0, poisson)
    assert np.linalg.eigvalsh(stiffness).min() > 0.0
    assert np.linalg.eigvalsh(density * solid - stiffness).min() > -1e-12
    strength = infill_strength(stiffness, density, 1.0)
    # No more than the lines' share of a section.
    assert 0.0 < strength <= density


def test_the_plain_cell_of_voxels_is_the_material():
    """The voxels themselves: a full cell, and a laminate of plates by the rule of mixtures."""
    full = homogenised(np.ones((3, 4, 5), dtype=bool))
    np.testing.assert_allclose(full, isotropic(1.0, POISSON).stiffness, atol=1e-12)
    plates = np.zeros((4, 3, 3), dtype=bool)
    plates[0] = True
    # The plates do not touch: along them a quarter, in plane stress.
    expected = 0.25 / (1.0 - POISSON**2)
    assert homogenised(plates)[1, 1] == pytest.approx(expected, rel=1e-6)


def test_voxels_of_an_even_gyroid_are_as_published():
    """Poisson's ratio 0.34, to 0.06, in all directions, and a modulus towards the upper bound.

    DeValk and Lakes, Physica Status Solidi B 258 (2021); the bound is that of Hashin and Shtrikman.
    """
    poisson, count = 0.3, 32
    x, y, z = np.meshgrid(*[2.0 * np.pi * (np.arange(count) + 0.5) / count] * 3, indexing="ij")
    field = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    slope = np.sqrt(
        (np.cos(x) * np.cos(y) - np.sin(z) * np.sin(x)) ** 2
        + (np.cos(y) * np.cos(z) - np.sin(x) * np.sin(y)) ** 2
        + (np.cos(z) * np.cos(x) - np.sin(y) * np.sin(z)) ** 2
    )
    voxels = np.abs(field) < 0.3 * slope
    young, _, ratios = moduli(homogenised(voxels, poisson))
    np.testing.assert_allclose(young, young[0], rtol=1e-3)
    np.testing.assert_allclose(ratios, 0.34, atol=0.06)
    rho, bulk, shear = voxels.mean(), 1.0 / (3.0 * (1.0 - 2.0 * poisson)), 0.5 / (1.0 + poisson)
    k = bulk + (1.0 - rho) / (-1.0 / bulk + 3.0 * rho / (3.0 * bulk + 4.0 * shear))
    g = shear + (1.0 - rho) / (
        -1.0 / shear + 6.0 * rho * (bulk + 2.0 * shear) / (5.0 * shear * (3.0 * bulk + 4.0 * shear))
    )
    most = 9.0 * k * g / (3.0 * k + g)
    assert 0.55 * most < young[0] < most


SIZE = (120.0, 16.0, 16.0)
FIBRE = 0.1075
LOWER, UPPER = (7.8 - 0.5 * FIBRE) / 10.0, (8.0 - 0.5 * FIBRE) / 12.0
"""Heights of the layers of matrix below and above the fibre, but for the first one of 0.2 mm: as
few as 0.8 mm allow, and above the fibre what is left of that."""
CORES = ((0.2 + LOWER, 8.0 - 0.5 * FIBRE - LOWER), (8.0 + 0.5 * FIBRE + UPPER, 16.0 - 2.0 * UPPER))
"""Heights from and to which the infill is sparse: two skins, and one beside the fibre."""


def _beam(infill, cells=(20, 8, 8), density=0.2):
    """A beam along x with one wall and two skins, and a layer of fibre in the middle."""
    loads = {"tip": (Force("x_max", (0.0, 0.0, -10.0)),)}
    problem = Problem(box_mesh(SIZE, cells), PLA, (Support("x_min"),), loads, order=1)
    machine = replace(Machine(), gcode=replace(Machine().gcode, matrix_angle=0.0))
    plastic, slicing = Plastic(infill, density, 1, 2), Planar(heights=(8.0,))
    return Case("beam", "beam", problem, slicing=slicing, machine=machine, plastic=plastic)


@pytest.mark.parametrize("infill", ["grid", "gyroid"])
def test_a_sandwich_bends_as_its_skins_and_walls_do(infill):
    """Beam theory with the moduli of the parts of the section: bending, and shear of the walls."""
    case = _beam(infill, (12, 16, 16))
    solid = solve(case.problem)["tip"].strain_energy
    sparse = solve(case.printed_problem())["tip"].strain_energy
    length, width, high = SIZE
    law = np.linalg.inv(infill_stiffness(infill, 0.2, 3000.0, 0.35))
    young, shear, line = 1.0 / law[0, 0], 1.0 / law[4, 4], 0.8
    full = 3000.0 * width * high**3 / 12.0
    moment = full
    for low, top in CORES:
        lost = (3000.0 - young) * (width - 2.0 * line)
        moment -= lost * ((top - 8.0) ** 3 - (low - 8.0) ** 3) / 3.0
    solid_shear = 3000.0 / 2.7
    # Webs carry the shear of a thin-walled section evenly, all of a solid one 5/6 of its area.
    webs = high * (2.0 * line * solid_shear + (width - 2.0 * line) * shear)
    expected = length**3 / (3.0 * moment) + length / webs
    expected /= length**3 / (3.0 * full) + 1.2 * length / (width * high * solid_shear)
    assert expected > 1.5
    # Both meshes lock alike in bending, so that ratios are compared.
    assert sparse / solid == pytest.approx(expected, rel=0.05)


def test_solid_plastic_leaves_the_problem_as_it_is():
    case = _beam("solid")
    case = replace(case, plastic=replace(case.plastic, walls=3))
    assert case.printed_problem() is case.problem


def test_mass_is_that_of_what_is_there():
    case = _beam("grid", density=0.3)
    problem = replace(case.printed_problem(), loads={"weight": (Gravity((0.0, 0.0, -9.81)),)})
    reaction = solve(problem)["weight"].reactions.sum(axis=0)
    sparse = problem.mesh.volumes @ (1.0 - problem.fill) / 0.7
    core = 120.0 * 16.0 * 16.0 - sparse
    assert reaction[2] == pytest.approx(1.24e-6 * 9.81 * (core + 0.3 * sparse), rel=1e-9)
    inner = (120.0 - 1.6) * (16.0 - 1.6)
    assert sparse == pytest.approx(inner * sum(top - low for low, top in CORES), rel=0.02)
    assert problem.filled == pytest.approx(1.0 - 0.7 * sparse / 30720.0)


def test_a_weak_cell_is_judged_by_its_own_strength():
    """Everywhere half as strong: twice the stress in the material, half the load at failure."""
    case = _beam("solid")
    whole = solve(case.problem)["tip"]
    count = len(case.problem.mesh.cells)
    weak = replace(case.problem, strength=np.full(count, 0.5))
    assert matrix_peak(solve(weak)["tip"])[0] == pytest.approx(2.0 * matrix_peak(whole)[0])


def test_the_virtual_test_stands_on_the_printed_part():
    case = _beam("gyroid")
    field = solve(case.printed_problem())["tip"]
    solid = Specimen.of(solve(case.problem)["tip"])
    sparse = Specimen.of(field)
    assert sparse.modulus == pytest.approx(3000.0)
    ratio = sparse.stiffness(field.displacement, field.strain_energy) / solid.stiffness(
        solid.unreinforced.displacement, solid.unreinforced.strain_energy
    )
    assert ratio == pytest.approx(solid.unreinforced.strain_energy / field.strain_energy, rel=1e-6)
    assert ratio < 0.9


def test_material_with_a_direction_has_no_law():
    case = _beam("grid")
    carbon = transversely_isotropic(60000.0, 4100.0, 0.33, 2200.0)
    with pytest.raises(InputError, match="isotropic"):
        replace(case, problem=replace(case.problem, material=carbon)).printed_problem()


def test_infill_keeps_its_direction_on_the_bed_below_a_part_that_is_turned():
    """Turned by 45 degrees below lines at 45 degrees, a part has its grid along its own axes."""
    case = _beam("grid", (6, 4, 4))
    slanted = replace(case.machine, gcode=replace(case.machine.gcode, matrix_angle=45.0))
    turned = replace(case, machine=slanted).on_bed({"turn": "z=45"})
    straight, found = case.printed_problem(), turned.printed_problem()
    np.testing.assert_allclose(found.stiffness, straight.stiffness, atol=1e-9)
    other = replace(case, machine=slanted).printed_problem()
    assert np.abs(other.stiffness - straight.stiffness).max() > 50.0
