from dataclasses import replace

import numpy as np
import pytest

from benchmarks.studies.strand_losses import along_one_direction, tension_of
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.mesh.patches import Box, patches_from_rules
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.paths.planning.layer_plans import plan_layers
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers import Planar
from ccfem.strategies.fibre_aware.heights import room_for_fibre
from ccfem.strategies.fibre_aware.plain_plans import StraightRows
from ccfem.strategies.fibre_aware.smeared import SmearedPart, SmearedSolution, smeared_cases
from ccfem.strategies.fibre_aware.upper_bound import (
    LARGEST_GAP,
    LEAST,
    LOOSE,
    SUM,
    WORST,
    DensityAscent,
    certificate,
    largest_gathered,
    upper_bound,
)
from ccfem.strategies.isocurve import Isocurve
from ccfem.strategies.zigzag import Zigzag

MACHINE = Machine()
RHO = 4.0
bound_of = upper_bound


def straight(layers, spacing):
    """Strands along x over the whole length of the bar."""
    lines = [np.array([[0.0, y], [60.0, y]]) for y in np.arange(0.5 * spacing, 20.0, spacing)]
    return Toolpaths.concatenate(Toolpaths.from_plane(lines, layer) for layer in layers)


def test_straight_fibre_reaches_the_bound_of_a_pulled_bar(pulled_bar):
    # Uniform tension: the optimum is 1 + rho L / V whatever the arrangement along x.
    stress, layers = pulled_bar
    paths = straight(layers, 2.0)
    length = paths.lengths.sum()
    found = upper_bound(stress, layers, length, MACHINE)
    exact = 1.0 + 4.0 * length / (60.0 * 20.0 * 4.0)
    assert found.ratio == pytest.approx(exact, rel=1e-3)
    assert found.ratio >= exact * (1.0 - 1e-9)
    assert virtual_test(paths, stress, span=()).ratio == pytest.approx(found.ratio, rel=0.01)


@pytest.mark.parametrize("mode", ["tension", "bonded"])
def test_no_paths_exceed_the_bound(bent_beam, mode):
    stress, layers = bent_beam
    for strategy in (Isocurve(), Zigzag()):
        paths = plan(strategy, layers, stress, MACHINE)
        found = upper_bound(stress, layers, paths.lengths.sum(), MACHINE, mode=mode)
        reached = virtual_test(paths, stress, mode=mode, span=()).ratio
        assert 1.0 < reached <= found.ratio
        assert 0.0 < found.share(reached) <= 1.0


def test_a_mean_of_densities_is_near_the_best_of_the_mean_length(bent_beam):
    # The least compliance is convex in the length, and the compliance in the densities.
    stress, layers = bent_beam
    ends = [upper_bound(stress, layers, length, MACHINE, gap=0.002) for length in (400.0, 800.0)]
    mean = 0.5 * (ends[0].density + ends[1].density)
    found = upper_bound(stress, layers, 600.0, MACHINE, gap=LOOSE, start=mean)
    assert 1.0 / found.reached <= np.mean([1.0 / end.reached for end in ends]) * (1.0 + 1e-5)
    assert 1.0 / found.ratio <= np.mean([1.0 / end.reached for end in ends])
    assert found.duality_gap <= LOOSE
    even = upper_bound(stress, layers, 600.0, MACHINE, gap=LOOSE)
    assert found.iterations < even.iterations
    assert even.ratio / (1.0 + LOOSE) <= found.reached <= even.ratio


@pytest.mark.parametrize("heights", [(0.5, 1.5, 2.5, 3.2), (1.0, 2.0, 3.0), (0.7, 2.0)])
def test_room_for_fibre_is_a_strand_a_width_on_every_layer(pulled_bar, heights):
    # On a layer along facets, too; and a cell has the room of what its layers cut off it.
    stress, _ = pulled_bar
    layers = Planar(heights=heights).cut(stress.mesh)
    room = room_for_fibre(SmearedPart.of(stress, layers[0].plane.frame), layers, MACHINE)
    assert stress.mesh.volumes @ room == pytest.approx(len(heights) * 60.0 * 20.0)
    off = Planar(heights=(0.7,)).cut(stress.mesh)
    cut = np.bincount(off[0].cell, off[0].areas, len(room)) / stress.mesh.volumes
    own = room_for_fibre(SmearedPart.of(stress, off[0].plane.frame), off, MACHINE)
    np.testing.assert_allclose(own, cut, atol=1e-9)


def test_a_layer_close_above_a_ledge_has_all_its_room():
    # A portal, bent: the fibre that counts lies on the one layer close above its opening. By the
    # layer nearest to each cell half of that room was missing, and plans lay above the bound.
    block = box_mesh((60.0, 12.0, 30.0), (12, 3, 10))
    x, _, z = block.centres.T
    kept, cells = np.unique(
        block.cells[(np.abs(x - 30.0) > 15.0) | (z > 18.0)], return_inverse=True
    )
    portal = TetMesh(block.points[kept], cells.reshape(-1, 4))
    problem = Problem(
        patches_from_rules(
            portal,
            {
                "left": Box((-1.0, -1.0, -1.0), (14.0, 13.0, 0.1)),
                "right": Box((46.0, -1.0, -1.0), (61.0, 13.0, 0.1)),
                "top": Box((22.0, -1.0, 29.9), (38.0, 13.0, 31.0)),
            },
        ),
        isotropic(3500.0, 0.3),
        (Support("left"), Support("right", components="z")),
        {"down": (Force("top", (0.0, 0.0, -100.0)),)},
        order=1,
    )
    stress = solve(problem)["down"]
    layers = Planar(heights=(2.0, 6.0, 10.0, 14.0, 18.2, 22.0, 26.0, 29.0)).cut(portal)
    rows = plan_layers(StraightRows(), layers[4:5], layers[4:5], stress, MACHINE)
    reached = virtual_test(rows, stress, span=()).ratio
    for some in (layers, [replace(layer, flat=None) for layer in layers]):
        found = upper_bound(stress, some, rows.lengths.sum(), MACHINE, iterations=10)
        assert 1.1 < reached < found.ratio


def test_density_along_one_direction_of_a_pulled_bar_is_exact(pulled_bar):
    stress, layers = pulled_bar
    part, length = SmearedPart.of(stress, layers[0].plane.frame), 2000.0
    found = upper_bound(stress, layers, length, MACHINE)
    exact = 1.0 + 4.0 * length / (60.0 * 20.0 * 4.0)
    # The bound's own density has a trace in every direction.
    assert along_one_direction(part, found, 4.0 * part.modulus) == pytest.approx(exact, rel=2e-3)
    room = room_for_fibre(part, layers, MACHINE)
    tension = tension_of(found, room, layers[0])
    # Layers cut cells in unequal parts: the strain is not quite the same in all.
    along = np.abs(tension.direction @ layers[0].plane.frame[:2] @ [1.0, 0.0, 0.0])
    assert along == pytest.approx(1.0, abs=1e-5)
    even = length / (60.0 * 20.0 * 4.0) / room.mean()  # strands a width, the same everywhere
    assert np.average(tension.stress, weights=layers[0].areas) == pytest.approx(even, rel=0.01)
    assert np.median(tension.stress) == pytest.approx(even, rel=0.01)
    assert tension.defined.all()


def test_any_displacement_proves_a_bound_of_one_case(bent_beam, rng):
    # Valid for every displacement, and the sharper the nearer it is to the optimum.
    stress, layers = bent_beam
    length = 3000.0
    best = upper_bound(stress, layers, length, MACHINE)
    part = SmearedPart.of(stress, layers[0].plane.frame)
    most = room_for_fibre(part, layers, MACHINE)
    axial = 4.0 * part.modulus
    free = part.specimen.system.held.free
    u = part.unreinforced.displacement
    for size in (0.0, 1e-3, 1e-2, 1e-1):
        moved = u + size * np.abs(u).max() * np.where(free, rng.standard_normal(u.shape), 0.0)
        other = SmearedSolution(moved, part.strain(moved), 0.0, 0.0, 0)
        least = certificate([part], [other], np.ones(1), axial, most, length)
        assert part.unreinforced.work / least >= best.reached


def test_scale_of_the_displacement_does_not_matter(bent_beam):
    stress, layers = bent_beam
    part = SmearedPart.of(stress, layers[0].plane.frame)
    most = room_for_fibre(part, layers, MACHINE)
    values = []
    for scale in (1.0, 2.5):
        u = scale * part.unreinforced.displacement
        other = SmearedSolution(u, part.strain(u), 0.0, 0.0, 0)
        values.append(certificate([part], [other], np.ones(1), 14000.0, most, 2000.0))
    assert values[0] == pytest.approx(values[1], rel=1e-12)


def test_more_fibre_and_more_layers_allow_more(bent_beam):
    stress, layers = bent_beam

    def upper_bound(*args, **options):
        return bound_of(*args, **options, gap=0.03)

    ratios = [upper_bound(stress, layers, length, MACHINE).ratio for length in (500, 1500, 4500)]
    assert 1.0 < ratios[0] < ratios[1] < ratios[2]
    thicker = [replace(layer, thickness=2.0) for layer in layers[::2]]
    assert upper_bound(stress, thicker, 1500, MACHINE).ratio < ratios[1]
    bonded = upper_bound(stress, layers, 1500, MACHINE, mode="bonded")
    assert bonded.ratio > ratios[1]
    weaker = upper_bound(stress, layers, 1500, MACHINE, Strand(rho=2.0))
    assert weaker.ratio < ratios[1]


def test_density_found_keeps_length_and_width(bent_beam):
    stress, layers = bent_beam
    found = upper_bound(stress, layers, 2000.0, MACHINE)
    part = SmearedPart.of(stress, layers[0].plane.frame)
    total = found.density.sum(axis=1)
    assert total.max() <= room_for_fibre(part, layers, MACHINE).max() * (1.0 + 1e-6)
    assert part.mesh.volumes @ total == pytest.approx(2000.0, rel=1e-3)
    assert found.reached <= found.ratio <= 1.1 * found.reached


@pytest.mark.parametrize("length", [0.0, -1.0, np.nan])
def test_length_must_be_positive(bent_beam, length):
    stress, layers = bent_beam
    with pytest.raises(InputError, match=r"length of fibre must be .*above 0 mm; got"):
        upper_bound(stress, layers, length, MACHINE)


def test_unknown_mode_is_refused(bent_beam):
    stress, layers = bent_beam
    with pytest.raises(InputError, match="tension, bonded"):
        upper_bound(stress, layers, 100.0, MACHINE, mode="glued")


def test_iterations_stop_where_bound_and_density_meet(bent_beam):
    stress, layers = bent_beam
    found = upper_bound(stress, layers, 2000.0, MACHINE)
    assert 0.0 <= found.duality_gap <= LARGEST_GAP
    # The stop is by the gap: one iteration earlier it was not met.
    before = upper_bound(stress, layers, 2000.0, MACHINE, iterations=found.iterations - 1)
    assert before.duality_gap > LARGEST_GAP
    assert upper_bound(stress, layers, 2000.0, MACHINE, gap=0.05).duality_gap <= 0.05


def test_no_other_density_is_stiffer(bent_beam, rng):
    # The density that is found, moved towards others of the same length within the room: the
    # stiffness may rise by no more than the gap, and never above the bound.
    stress, layers = bent_beam
    length = 2000.0
    found = upper_bound(stress, layers, length, MACHINE)
    part = SmearedPart.of(stress, layers[0].plane.frame)
    most, axial = room_for_fibre(part, layers, MACHINE), 4.0 * part.modulus
    a = np.stack([np.cos(found.angles) ** 2, np.sin(found.angles) ** 2], axis=1)
    along = np.column_stack([a, np.sqrt(a[:, 0] * a[:, 1]) * np.sign(np.cos(found.angles))])
    outer = axial * along[:, :, None] * along[:, None, :]

    def ratio(density):
        def fibre(strain):
            return np.einsum("ck,kij->cij", density * (strain @ along.T > 0.0), outer)

        return part.ratio(part.solve(fibre, tolerance=1e-8).work)

    assert ratio(found.density) == pytest.approx(found.reached, rel=1e-3)
    for kind in range(4):
        other = rng.random(found.density.shape) ** (1 + 8 * (kind % 2))
        room = np.minimum(1.0, rng.random(len(most)) + 0.5)
        other *= (room * most / other.sum(axis=1))[:, None]
        other *= length / (part.mesh.volumes @ other.sum(axis=1))
        other *= np.minimum(1.0, most / other.sum(axis=1))[:, None]
        for share in (0.02, 1.0):
            mixed = (1.0 - share) * found.density + share * other
            assert part.mesh.volumes @ mixed.sum(axis=1) <= length * (1.0 + 1e-4)
            assert 1.0 < ratio(mixed) < found.ratio


def test_density_of_a_pulled_bar_runs_along_the_pull(pulled_bar):
    stress, layers = pulled_bar
    found = upper_bound(stress, layers, 1200.0, MACHINE)
    m = 1200.0 / (60.0 * 20.0 * 4.0)
    mean = np.average(found.tensor, axis=0, weights=stress.mesh.volumes)
    np.testing.assert_allclose(mean, [m, 0.0, 0.0], atol=0.02 * m)
    np.testing.assert_allclose(found.tensor[:, :2].sum(axis=1), found.density.sum(axis=1))


@pytest.mark.parametrize("objective", [WORST, SUM])
def test_plate_pulled_along_x_or_y_is_best_with_half_the_fibre_each_way(two_pulls, objective):
    # Uniform stress and no Poisson effect: a density m along x makes 1 + rho m of one case and
    # nothing of the other. Alone 1 + rho m, together at most 1 + rho m / 2 each.
    cases, layers = two_pulls
    length = 600.0
    m = length / (24.0 * 24.0 * 4.0)
    found = upper_bound(cases, layers, length, MACHINE, objective=objective)
    np.testing.assert_allclose(found.singles, 1.0 + RHO * m, rtol=1e-3)
    exact = (1.0 + RHO * m) / (1.0 + RHO * m / 2.0)
    assert found.least == pytest.approx(exact, rel=2e-3)
    assert found.least <= found.attained * (1.0 + 1e-9)
    np.testing.assert_allclose(found.factors, 0.5, atol=0.01)
    ratios = np.full(2, 1.0 + RHO * m / 2.0)
    assert found.gap(ratios) == pytest.approx(0.0, abs=2e-3)
    np.testing.assert_allclose(found.shares(ratios), 1.0 / exact, rtol=1e-3)


def test_the_least_ratio_of_a_plate_is_bounded_by_half_the_fibre_each_way(two_pulls):
    cases, layers = two_pulls
    m = 600.0 / (24.0 * 24.0 * 4.0)
    found = upper_bound(cases, layers, 600.0, MACHINE, objective=LEAST)
    np.testing.assert_array_equal(found.singles, 1.0)
    assert 1.0 / found.least == pytest.approx(1.0 + RHO * m / 2.0, rel=2e-3)
    assert 1.0 / found.least >= (1.0 + RHO * m / 2.0) * (1.0 - 1e-9)
    assert found.value([1.5, 2.0]) == 1.0 / 1.5


@pytest.mark.parametrize("mode", ["tension", "bonded"])
def test_one_case_is_the_same_in_a_list_and_by_every_objective(bent_beam, mode):
    stress, layers = bent_beam
    alone = upper_bound(stress, layers, 2000.0, MACHINE, mode=mode, iterations=4)
    cases = WeightedCases.of({"tip": stress})
    for objective in (WORST, SUM, LEAST):
        found = upper_bound(
            cases, layers, 2000.0, MACHINE, mode=mode, iterations=4, objective=objective
        )
        assert found.ratio == pytest.approx(alone.ratio, rel=1e-12)
        assert found.reached == pytest.approx(alone.reached, rel=1e-12)
        assert found.duality_gap == pytest.approx(alone.duality_gap, rel=1e-9)
        # Measured by its own bound, a part reaches all of it; by the bare part, that ratio.
        assert found.least == pytest.approx(1.0 / alone.ratio if objective == LEAST else 1.0)
        assert found.shares([alone.ratio]) == pytest.approx(found.singles**-1 * alone.ratio)


def test_no_feasible_density_goes_below_the_bound(two_bends, rng):
    # Any density and direction in each cell, at most one strand a width, of the given length.
    cases, layers = two_bends
    length = 2500.0
    bounds = {
        each: upper_bound(cases, layers, length, MACHINE, objective=each, iterations=12)
        for each in (WORST, SUM, LEAST)
    }
    parts = smeared_cases(cases.fields, layers[0].plane.frame)
    most, axial = room_for_fibre(parts[0], layers, MACHINE), RHO * parts[0].modulus
    volume = parts[0].mesh.volumes
    tops = [largest_gathered(part.unreinforced.strain[None], np.ones(1)) for part in parts]
    for kind in range(6):
        angle = rng.uniform(0.0, np.pi, len(volume)) if kind % 2 else np.zeros(len(volume))
        wanted = rng.random(len(volume)) + 3.0 * (kind > 2) * (tops[0] / tops[0].max())
        low, high = 0.0, 1e3
        for _ in range(60):
            middle = 0.5 * (low + high)
            laid = volume @ np.minimum(most, middle * wanted)
            low, high = (low, middle) if laid > length else (middle, high)
        density = np.minimum(most, low * wanted)
        a = np.stack([np.cos(angle) ** 2, np.sin(angle) ** 2, np.cos(angle) * np.sin(angle)], 1)
        outer = axial * density[:, None, None] * a[:, :, None] * a[:, None, :]

        def fibre(strain, a=a, outer=outer):
            return outer * ((a * strain).sum(axis=1) > 0.0)[:, None, None]

        ratios = [part.ratio(part.solve(fibre, tolerance=1e-7).work) for part in parts]
        for bound in bounds.values():
            assert bound.gap(ratios) > -1e-9
            assert (bound.shares(ratios) <= 1.0).all() or bound.objective == LEAST
    for bound in bounds.values():
        assert bound.least <= bound.attained <= 1.05 * bound.least
        assert bound.least > 1.02 or bound.objective == LEAST  # the cases want different fibre


def test_any_displacements_prove_a_bound(two_bends, rng):
    cases, layers = two_bends
    found = upper_bound(cases, layers, 2500.0, MACHINE, objective=SUM)
    parts = smeared_cases(cases.fields, layers[0].plane.frame)
    most, axial = room_for_fibre(parts[0], layers, MACHINE), RHO * parts[0].modulus
    factors = cases.weights * found.singles / [part.unreinforced.work for part in parts]
    for size in (0.0, 1e-2):
        moved = []
        for part in parts:
            u, free = part.unreinforced.displacement, part.specimen.held.free
            u = u + size * np.abs(u).max() * np.where(free, rng.standard_normal(u.shape), 0.0)
            moved.append(SmearedSolution(u, part.strain(u), 0.0, 0.0, 0))
        least = certificate(parts, moved, factors, axial, most, 2500.0)
        assert 0.0 < least <= found.attained


@pytest.mark.parametrize("mode", ["tension", "bonded"])
def test_what_fibre_gathers_is_bounded_between_the_angles_too(rng, mode):
    strains = rng.standard_normal((3, 200, 3))
    factors = np.array([0.2, 1.0, 0.5])
    angles = np.linspace(0.0, np.pi, 20001)
    a = np.stack([np.cos(angles) ** 2, np.sin(angles) ** 2, np.cos(angles) * np.sin(angles)])
    along = strains @ a
    along = np.maximum(along, 0.0) if mode == "tension" else along
    for count in (1, 3):
        found = largest_gathered(strains[:count], factors[:count], mode)
        exact = np.einsum("i,ica->ca", factors[:count], along[:count] ** 2).max(axis=1)
        assert (found >= exact * (1.0 - 1e-12)).all()
        # One strain has principal directions: nothing is added for what lies between.
        np.testing.assert_allclose(found, exact, rtol=5e-4 if count > 1 else 1e-7, atol=1e-3)


def test_cases_may_have_supports_of_their_own(two_bends):
    cases, layers = two_bends
    first, second = cases.fields
    held = replace(
        first.problem,
        supports=(Support("x_max"),),
        loads={"other": (Force("x_min", (-300.0, 40.0, 0.0)),)},
    )
    mixed = WeightedCases((first, solve(held)["other"]), np.array([2.0, 1.0]))
    parts = smeared_cases(mixed.fields, layers[0].plane.frame)
    assert (parts[0].specimen.held.free != parts[1].specimen.held.free).any()
    shared = smeared_cases(cases.fields, layers[0].plane.frame)
    assert shared[0].specimen.solver is shared[1].specimen.solver
    np.testing.assert_allclose(
        shared[1].unreinforced.displacement, second.displacement, rtol=1e-6, atol=1e-9
    )
    found = upper_bound(mixed, layers, 2500.0, MACHINE, iterations=8)
    assert 1.0 < found.least <= found.attained


def test_a_field_is_a_list_of_one_case(two_bends):
    cases, _ = two_bends
    one = WeightedCases.of(cases.fields[0])
    assert one.fields == cases.fields[:1]
    np.testing.assert_array_equal(one.weights, [1.0])
    assert WeightedCases.of(cases) is cases
    assert WeightedCases.of(cases, {"slant": 3.0}).names == ("slant",)


def test_what_makes_no_sense_is_refused(two_bends):
    cases, layers = two_bends
    fields = {field.case: field for field in cases.fields}
    for weight in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="weight of load case 'tip' must be"):
            WeightedCases.of(fields, {"tip": weight, "slant": 1.0})
    with pytest.raises(InputError, match="no load case named 'tap'"):
        WeightedCases.of(fields, {"tap": 1.0})
    with pytest.raises(InputError, match="2 cases and 1 weights"):
        WeightedCases(cases.fields, np.ones(1))
    with pytest.raises(InputError, match="two load cases are named 'tip'"):
        WeightedCases((cases.fields[0],) * 2, np.ones(2))
    with pytest.raises(InputError, match="worst, sum"):
        upper_bound(cases, layers, 100.0, MACHINE, objective="best")


@pytest.mark.parametrize("objective", [WORST, SUM])
def test_a_support_that_moves_counts_as_a_force_does(pulled_and_moved, objective):
    # As for two forces: the stiffness of the plate does not depend on what pulls it.
    cases, layers = pulled_and_moved
    m = 600.0 / (24.0 * 24.0 * 4.0)
    parts = smeared_cases(cases.fields, layers[0].plane.frame)
    assert [part.forced for part in parts] == [True, False]
    assert parts[1].unreinforced.work == pytest.approx(3500.0 * 96.0 / 24.0 * 0.01, rel=1e-9)
    found = upper_bound(cases, layers, 600.0, MACHINE, objective=objective)
    np.testing.assert_allclose(found.singles, 1.0 + RHO * m, rtol=1e-3)
    exact = (1.0 + RHO * m) / (1.0 + RHO * m / 2.0)
    assert found.least == pytest.approx(exact, rel=2e-3)
    assert found.least <= found.attained * (1.0 + 1e-9)
    # Whatever the scale of the displacement and the work that is told: it stays a bound.
    scale = found.singles / [part.unreinforced.work for part in parts]
    most = room_for_fibre(parts[0], layers, MACHINE)
    axial = RHO * parts[0].modulus
    for factor in (0.5, 1.0, 3.0):
        told = [parts[0].unreinforced, replace(parts[1].unreinforced, work=factor * 14.0)]
        least = certificate(parts, told, cases.weights * scale, axial, most, 600.0)
        assert least <= exact * (1.0 + 1e-9)


def test_densities_have_the_length_and_are_proportional_where_there_is_room(rng):
    volume, most = rng.uniform(0.5, 2.0, 40), rng.uniform(0.1, 1.0, 40)
    most[:3] = 0.0
    weight = rng.uniform(0.0, 3.0, (40, 5))
    weight[2:6] = 0.0
    for share in (0.01, 0.5, 0.85):
        length = share * float(volume @ most)
        ascent = DensityAscent.even(volume, most, length, 5)
        density = ascent.step(weight / ascent.density.max(), 1.0).density
        total = density.sum(axis=1)
        assert volume @ total == pytest.approx(length, rel=1e-6)
        assert (total <= most * (1.0 + 1e-6)).all()
        inner = (total > 1e-6) & (total < 0.999 * most)
        power = (weight / weight.max()) ** 1.4 * most[:, None]
        factor = density[inner] / power[inner]
        np.testing.assert_allclose(factor, factor.flat[0], rtol=1e-6)
