"""Strands that are moved to where they make the part stiffer."""

from dataclasses import replace

import numpy as np
import osqp
import pytest
import scipy.sparse as sp
import shapely

from ccfem.base.errors import InputError
from ccfem.judging.virtual_testing.equilibrium import bars
from ccfem.judging.virtual_testing.several_cases import specimens
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, TRAVEL, Toolpaths
from ccfem.strategies import create
from ccfem.strategies.fibre_aware import cut_and_move
from ccfem.strategies.fibre_aware.judges import Goal, stiffness_judge
from ccfem.strategies.fibre_aware.strain_worth import StrainWorth
from ccfem.strategies.fibre_aware.strand_lines import strand_lines
from ccfem.strategies.fibre_aware.strand_moves import fibre_energy, moved, plane_strain
from ccfem.strategies.fibre_aware.strand_spacing import spacing

MACHINE = Machine()


def laid(lines, layers):
    """Lay the same lines on all layers."""
    return Toolpaths.concatenate([Toolpaths.from_plane(lines, layer) for layer in layers])


def in_plane_of(layer, line):
    """Points in the axes of a layer from points (x, y) of the part."""
    line = np.asarray(line, dtype=float)
    return np.column_stack([line, np.zeros(len(line))]) @ layer.plane.frame[:2].T


def straight(layers, *heights):
    """Straight strands along the beam at some heights."""
    along = np.linspace(3.0, 57.0, 60)
    lines = [np.column_stack([along, np.full(60, y)]) for y in heights]
    return laid([in_plane_of(layers[0], line) for line in lines], layers)


def test_energy_of_even_strain_is_length_times_strain_squared(bent_beam):
    stress, layers = bent_beam
    mesh, frame = stress.mesh, layers[0].plane.frame
    slope = np.array([[2e-3, 1e-3, 0.0], [4e-4, -1e-3, 0.0], [0.0, 0.0, 5e-4]])
    strain = plane_strain(mesh, [StrainWorth(2.0, mesh.points @ slope.T)], frame)
    points = np.array([[10.0, 3.0], [25.0, 7.0]]) @ frame[:2, :2].T
    energy, length, _ = fibre_energy(points, np.full(2, 1.5), np.array([0, 2]), strain)
    direction = np.array([15.0, 4.0, 0.0]) / np.hypot(15.0, 4.0)
    along = direction @ (0.5 * (slope + slope.T)) @ direction
    assert length[0] == pytest.approx(np.hypot(15.0, 4.0))
    assert energy[0] == pytest.approx(2.0 * along**2 * length[0], rel=1e-9)


def test_energy_of_even_strain_with_strength_is_length_times_its_worth(bent_beam):
    stress, layers = bent_beam
    mesh, frame = stress.mesh, layers[0].plane.frame
    slope = np.array([[2e-3, 1e-3, 0.0], [4e-4, -1e-3, 0.0], [0.0, 0.0, 5e-4]])
    adjoint = np.array([[-3e-3, 0.0, 0.0], [0.0, 5e-4, 0.0], [0.0, 0.0, 0.0]])
    points = np.array([[10.0, 3.0], [25.0, 7.0]]) @ frame[:2, :2].T
    direction = np.array([15.0, 4.0, 0.0]) / np.hypot(15.0, 4.0)
    along, other = direction @ slope @ direction, direction @ adjoint @ direction
    one = StrainWorth(2.0, mesh.points @ slope.T, 3.0, mesh.points @ adjoint.T, 1e-6, 1.1 * along)
    strain = plane_strain(mesh, [one], frame)
    energy, length, _ = fibre_energy(points, np.full(2, 1.5), np.array([0, 2]), strain)
    worth = 2.0 * along**2 + 3.0 * along * other - 1e-6 / 1.1**16
    assert energy[0] == pytest.approx(worth * length[0], rel=1e-9)
    assert one.value(np.array([along]), np.array([other]))[0] == pytest.approx(worth, rel=1e-9)
    assert one.value(np.array([-along]), np.array([other]))[0] == 0.0


@pytest.mark.parametrize("strength", [False, True])
def test_slope_of_the_energy_is_its_difference(bent_beam, strength):
    stress, layers = bent_beam
    mesh, frame = stress.mesh, layers[0].plane.frame
    rng = np.random.default_rng(3)
    # Several load cases add; shortened segments have no energy and no slope.
    one, other, adjoint = rng.normal(size=(3, *mesh.points.shape))
    cases = [StrainWorth(1.5, one), StrainWorth(0.5, stress.displacement)]
    if strength:
        cases += [StrainWorth(0.7, other, 2.0, adjoint, 0.3, 1.5), StrainWorth(0.0, one, 0.0, one)]
    strain = plane_strain(mesh, cases, frame)
    points = np.column_stack([np.linspace(5.0, 55.0, 40), rng.uniform(2.0, 22.0, 40)])
    heights, offsets = np.full(40, 1.3), np.array([0, 17, 40])
    energy, _, slope = fibre_energy(points, heights, offsets, strain)
    assert 0 < (energy != 0.0).sum() <= 38
    step = 1e-6
    for p, axis in [(0, 0), (5, 1), (16, 0), (17, 1), (30, 0), (39, 1)]:
        values = []
        for sign in (1.0, -1.0):
            other = points.copy()
            other[p, axis] += sign * step
            values.append(fibre_energy(other, heights, offsets, strain)[0].sum())
        difference = (values[0] - values[1]) / (2.0 * step)
        assert slope[p, axis] == pytest.approx(difference, rel=1e-5, abs=1e-6 * abs(slope).max())


def test_a_pack_of_strands_gives_way_at_once_and_keeps_off_the_border(bent_beam):
    _, layers = bent_beam
    paths = straight(layers, 1.0, 1.7, 2.4, 3.1, 3.8, 4.5)
    lines = strand_lines(paths, layers, MACHINE)
    apart = spacing(lines, layers, 1.0, 0.5)
    slide = apart.spread(np.zeros(len(lines.path)))
    for layer in layers:
        section = layer.plane.polygon
        strands = [
            shapely.linestrings(path @ layer.plane.frame[:2].T)
            for path in lines.slid(slide).on_layer(layer.index)
        ]
        for k, strand in enumerate(strands):
            assert strand.distance(section.boundary) > 0.49
            for other in strands[k + 1 :]:
                assert strand.distance(other) > 0.98
            assert shapely.hausdorff_distance(strand, strand.simplify(0.05)) < 0.05


@pytest.mark.parametrize(
    "heights",
    [
        (1.0, 1.7, 2.4, 3.1, 3.8, 4.5),
        (8.0, 8.7, 9.4, 10.1),
        (8.0, 8.5, 9.7, 10.2, 11.0, 12.5),
        (0.7, 1.2, 3.0, 3.4),
    ],
)
def test_a_pack_of_strands_goes_where_a_quadratic_programme_says(bent_beam, heights):
    """Straight strands: the least squared slides after which all distances are kept, by OSQP."""
    layers = bent_beam[1][:1]
    lines = strand_lines(straight(layers, *heights), layers, MACHINE)
    slide = spacing(lines, layers, 1.0, 0.5).spread(np.zeros(len(lines.path)))
    found = lines.slid(slide)
    means = [path[:, 1].mean() for path in found]
    count = len(heights)
    # Each strand is a width above the one below it, and the first one half a width above the edge.
    above = sp.eye(count, format="csc") - sp.eye(count, k=-1, format="csc")
    low = np.r_[0.5, np.ones(count - 1)]
    model = osqp.OSQP()
    options = {"eps_abs": 1e-9, "eps_rel": 1e-9, "verbose": False}
    square = sp.eye(count, format="csc")
    model.setup(square, -np.array(heights), above, low, np.full(count, np.inf), **options)
    solved = model.solve()
    assert solved.info.status == "solved"
    np.testing.assert_allclose(means, solved.x, atol=0.01)


def test_strands_across_the_beam_keep_off_between_their_points_too(bent_beam):
    """Points of neighbours stand at half steps, so that the nearest places are no points."""
    _, layers = bent_beam
    up = np.linspace(2.0, 10.0, 9)
    across = [
        np.column_stack([np.full(9, 20.0 + 0.8 * k), up + 0.25 * (-1) ** k]) for k in range(5)
    ]
    paths = laid([in_plane_of(layers[0], line) for line in across], layers)
    lines = strand_lines(paths, layers, MACHINE)
    slide = spacing(lines, layers, 1.0, 0.5).spread(np.zeros(len(lines.path)))
    for layer in layers:
        strands = [
            shapely.linestrings(path @ layer.plane.frame[:2].T)
            for path in lines.slid(slide).on_layer(layer.index)
        ]
        for k, strand in enumerate(strands):
            assert all(strand.distance(other) > 0.998 for other in strands[k + 1 :])


def test_what_is_far_enough_apart_stays(bent_beam):
    _, layers = bent_beam
    lines = strand_lines(straight(layers, 2.0, 3.1, 6.0), layers, MACHINE)
    slide = spacing(lines, layers, 1.0, 0.5).spread(np.zeros(len(lines.path)))
    assert np.array_equal(slide, np.zeros(len(lines.path)))


def test_strands_of_a_bent_beam_move_to_its_stretched_side(bent_beam):
    stress, layers = bent_beam
    paths = straight(layers, 8.0, 9.2, 10.4)
    judge = stiffness_judge(Specimen.of(stress), MACHINE)
    found = moved(paths, layers, stress.mesh, MACHINE, judge, 6)
    before, after = (
        virtual_test(each, stress, machine=MACHINE, span=()).ratio for each in (paths, found)
    )
    assert after > 1.01 * before
    assert found.points[:, 1].mean() < paths.points[:, 1].mean() - 0.2
    assert (found.lengths >= MACHINE.minimum_length).all()


def test_paths_that_no_step_helps_are_returned(bent_beam):
    stress, layers = bent_beam
    paths = straight(layers, 20.0, 22.0)  # shortened: they carry nothing wherever they lie
    judge = stiffness_judge(Specimen.of(stress), MACHINE)
    assert moved(paths, layers, stress.mesh, MACHINE, judge, 2) is paths
    assert moved(paths, layers, stress.mesh, MACHINE, judge, 0) is paths


def test_half_a_strand_outside_counts_half(bent_beam):
    """The strand on the border gains as much as two of half the stiffness: one, tested as such."""
    stress, layers = bent_beam
    paths = straight(layers, 0.0)
    inside = stiffness_judge(stress, MACHINE, Strand(4.0), layers)(paths).value
    half = virtual_test(paths, stress, Strand(2.0), span=()).ratio
    assert inside == pytest.approx(half, rel=1e-6)
    assert stiffness_judge(stress, MACHINE, Strand(4.0))(paths).value > 1.02 * inside


@pytest.mark.parametrize("heights", [(0.0, 1.0), (0.5, 24.0), (0.5,)])
def test_moves_that_make_paths_worse_or_shorter_are_not_taken(bent_beam, monkeypatch, heights):
    """Onto the border, half of a strand outside; to the other side; and one strand less."""
    stress, layers = bent_beam
    paths, goal = straight(layers, 0.5, 1.5), Goal.of(stress)
    monkeypatch.setattr(cut_and_move, "moved", lambda *_, **__: straight(layers, *heights))
    kept = cut_and_move.prune_and_move(
        [paths],
        layers,
        goal,
        float(paths.lengths.sum()),
        MACHINE,
        Strand(),
        cut_and_move.Cutting(1, moves=6),
    )
    assert kept is paths


def test_links_turns_and_other_kinds_stay(bent_beam):
    stress, layers = bent_beam
    low = np.column_stack([np.linspace(5.0, 55.0, 40), np.full(40, 7.0)])
    high = low[::-1] + np.array([0.0, 1.2])
    line = in_plane_of(layers[0], np.concatenate([low, high]))
    link = np.zeros(80, dtype=bool)
    link[39] = True
    fibre = Toolpaths.concatenate(
        [Toolpaths.from_plane([line], layer, link=[link]) for layer in layers]
    )
    travel = replace(straight(layers, 3.0), kind=np.full(len(layers), TRAVEL))
    judge = stiffness_judge(Specimen.of(stress), MACHINE)
    paths = Toolpaths.concatenate([fibre, travel])
    found = moved(paths, layers, stress.mesh, MACHINE, judge, 3)
    assert found is not paths
    assert np.array_equal(found.of_kind(TRAVEL).points, travel.points)
    after = found.of_kind(FIBRE)
    assert after.link.sum() == np.ceil(1.2 / 0.6) * len(layers)
    turn = np.abs(after.points[:, 0] - 55.0) < 0.3
    assert np.isin(np.round(after.points[turn, 1], 6), [7.0, 7.6, 8.2]).all()


def test_paths_keep_the_least_length(bent_beam):
    _, layers = bent_beam
    angle = np.linspace(0.0, np.pi, 60)
    arc = np.column_stack([30.0 + 14.0 * np.cos(angle), 20.0 - 14.0 * np.sin(angle)])
    paths = laid([in_plane_of(layers[0], arc)], layers)
    length = paths.lengths[0]
    lines = strand_lines(paths, layers, replace(MACHINE, minimum_length=length - 1e-6))
    lengths = [lines.slid(np.full(len(lines.path), s)).lengths for s in (-0.5, 0.5)]
    # An arc of radius 14 that is 0.5 wider is longer by pi / 2; the other one is drawn out.
    assert np.min(lengths) == pytest.approx(length - 1e-6, rel=1e-9)
    assert np.max(lengths) == pytest.approx(length + 0.5 * np.pi, rel=1e-3)


def test_rings_that_could_become_too_short_stay(bent_beam):
    _, layers = bent_beam
    angle = np.linspace(0.0, 2.0 * np.pi, 120)
    angle[-1] = 0.0
    rings = [
        np.column_stack([30.0 + r * np.cos(angle), 12.0 + r * np.sin(angle)]) for r in (7.0, 9.0)
    ]
    paths = laid([in_plane_of(layers[0], ring) for ring in rings], layers)
    lines = strand_lines(paths, layers, MACHINE)
    before, after = lines.toolpaths.lengths, lines.slid(np.full(len(lines.path), 0.3)).lengths
    assert np.array_equal(after[before < 50.0], before[before < 50.0])
    assert (np.abs(after - before)[before > 50.0] > 1.0).all()


@pytest.mark.parametrize("strategy", ["pruned", "stream_function"])
def test_moves_are_no_less_than_none(strategy):
    with pytest.raises(InputError, match="moves"):
        create(strategy, {"moves": -1})


def test_all_load_cases_move_strands_together(two_bends):
    cases, layers = two_bends
    parts = specimens(cases)
    bounds = np.array([2.0, 2.0])
    paths = straight(layers, 6.0, 8.0, 16.0, 18.0)
    judge = stiffness_judge(Goal(parts, cases.weights, bounds), MACHINE)
    found = moved(paths, layers, parts[0].unreinforced.mesh, MACHINE, judge, 3)

    def worst(each):
        tests = [virtual_test(each, part, machine=MACHINE, span=()) for part in parts]
        return min(test.ratio for test in tests)

    assert worst(found) > worst(paths)
    assert judge(found).value == pytest.approx(0.5 * worst(found), rel=0.05)


def test_worth_of_strain_in_several_cases_is_the_slope_of_the_value(two_bends):
    cases, layers = two_bends
    parts, bounds = specimens(cases), np.array([2.0, 1.5])
    paths = straight(layers, 4.0, 12.0)
    values = []
    for rho in (4.0, 4.001):
        judge = stiffness_judge(Goal(parts, cases.weights, bounds, "sum"), MACHINE, Strand(rho))
        values.append(judge(paths))
    strands = cut_strands(paths, parts[0].unreinforced.mesh)
    pieces = bars(strands, parts[0].unreinforced.mesh)
    energy = sum(
        one.squared * (strands.length @ np.maximum(pieces.strain(one.displacement), 0.0) ** 2)
        for one in values[0].strain_worths()
    )
    slope = (np.log(values[1].value) - np.log(values[0].value)) / (0.001 * parts[0].modulus)
    assert slope == pytest.approx(energy, rel=1e-3)


@pytest.mark.parametrize("objective", ["worst", "sum", "least"])
def test_value_of_one_case_is_its_stiffness_ratio(bent_beam, objective):
    stress, layers = bent_beam
    paths = straight(layers, 4.0, 12.0)
    ratio = virtual_test(paths, stress, machine=MACHINE, span=()).ratio
    goal = replace(Goal.of(stress), objective=objective)
    assert stiffness_judge(goal, MACHINE)(paths).value == pytest.approx(ratio, rel=1e-7)
    assert goal.counts(np.array([ratio])) == pytest.approx(1.0)
