from dataclasses import replace

import numpy as np
import pytest

from benchmarks.studies.strand_losses import along_one_direction, tension_of
from ccfem.errors import InputError
from ccfem.fibre_aware.heights import fibre_capacity
from ccfem.fibre_aware.smeared import SmearedPart, SmearedSolution
from ccfem.fibre_aware.upper_bound import LARGEST_GAP, certificate, upper_bound
from ccfem.machine import Machine
from ccfem.planning import plan
from ccfem.strategies.isocurve import Isocurve
from ccfem.strategies.zigzag import Zigzag
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.virtual_test import virtual_test

MACHINE = Machine()
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


def test_density_along_one_direction_of_a_pulled_bar_is_exact(pulled_bar):
    stress, layers = pulled_bar
    part, length = SmearedPart.of(stress, layers[0].plane.frame), 2000.0
    found = upper_bound(stress, layers, length, MACHINE)
    exact = 1.0 + 4.0 * length / (60.0 * 20.0 * 4.0)
    # The bound's own density has a trace in every direction.
    assert along_one_direction(part, found, 4.0 * part.modulus) == pytest.approx(exact, rel=2e-3)
    capacity = fibre_capacity(part, layers, MACHINE)
    tension = tension_of(found, capacity, layers[0])
    assert np.abs(tension.direction @ layers[0].plane.frame[:2] @ [1.0, 0.0, 0.0]) == pytest.approx(
        1
    )
    even = length / (60.0 * 20.0 * 4.0) / capacity.mean()  # strands a width, the same everywhere
    assert tension.stress == pytest.approx(even, rel=0.02)
    assert tension.defined.all()


def test_any_displacement_proves_a_bound(bent_beam, rng):
    # Valid for every displacement, and the sharper the nearer it is to the optimum.
    stress, layers = bent_beam
    length = 3000.0
    best = upper_bound(stress, layers, length, MACHINE)
    part = SmearedPart.of(stress, layers[0].plane.frame)
    most = fibre_capacity(part, layers, MACHINE)
    axial = 4.0 * part.modulus
    free = part.specimen.system.held.free
    u = part.unreinforced.displacement
    for size in (0.0, 1e-3, 1e-2, 1e-1):
        moved = u + size * np.abs(u).max() * np.where(free, rng.standard_normal(u.shape), 0.0)
        other = SmearedSolution(moved, part.strain(moved), 0.0, 0.0, 0)
        assert certificate(part, other, axial, most, length) >= best.reached


def test_scale_of_the_displacement_does_not_matter(bent_beam):
    stress, layers = bent_beam
    part = SmearedPart.of(stress, layers[0].plane.frame)
    most = fibre_capacity(part, layers, MACHINE)
    values = []
    for scale in (1.0, 2.5):
        u = scale * part.unreinforced.displacement
        other = SmearedSolution(u, part.strain(u), 0.0, 0.0, 0)
        values.append(certificate(part, other, 14000.0, most, 2000.0))
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
    assert total.max() <= fibre_capacity(part, layers, MACHINE).max() * (1.0 + 1e-6)
    assert part.mesh.volumes @ total == pytest.approx(2000.0, rel=1e-3)
    assert found.reached <= found.ratio <= 1.1 * found.reached


@pytest.mark.parametrize("length", [0.0, -1.0, np.nan])
def test_length_must_be_positive(bent_beam, length):
    stress, layers = bent_beam
    with pytest.raises(InputError, match=r"length of fibre must be .*above 0 mm; got"):
        upper_bound(stress, layers, length, MACHINE)


def test_unknown_mode_is_refused(bent_beam):
    stress, layers = bent_beam
    with pytest.raises(InputError, match="bonded, tension"):
        upper_bound(stress, layers, 100.0, MACHINE, mode="glued")


def test_iterations_stop_where_bound_and_density_meet(bent_beam):
    stress, layers = bent_beam
    found = upper_bound(stress, layers, 2000.0, MACHINE)
    assert 0.0 <= found.gap <= LARGEST_GAP
    # The stop is by the gap: one iteration earlier it was not met.
    before = upper_bound(stress, layers, 2000.0, MACHINE, iterations=len(found.bounds) - 2)
    assert before.gap > LARGEST_GAP
    assert upper_bound(stress, layers, 2000.0, MACHINE, gap=0.05).gap <= 0.05


def test_no_other_density_is_stiffer(bent_beam, rng):
    # The density that is found, moved towards others of the same length within the room: the
    # stiffness may rise by no more than the gap, and never above the bound.
    stress, layers = bent_beam
    length = 2000.0
    found = upper_bound(stress, layers, length, MACHINE)
    part = SmearedPart.of(stress, layers[0].plane.frame)
    most, axial = fibre_capacity(part, layers, MACHINE), 4.0 * part.modulus
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
