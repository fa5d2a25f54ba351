"""Matching rates that are known without the code."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ccfem.base.errors import InputError
from ccfem.judging.evaluation.indices.alignment import alignment_indices, sample_alignment
from ccfem.judging.evaluation.indices.matching import (
    READINGS,
    THRESHOLDS,
    matching_indices,
    matching_rate,
)
from ccfem.slicing.layers.layer import stress_on


def rate(part, paths, reading="path", **options):
    return matching_rate(
        paths, [stress_on(layer, part.stress) for layer in part.layers], reading, **options
    )


def strand(degrees, length=20.0, centre=(30.0, 20.0)):
    half = 0.5 * length * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    return [np.array(centre) - half, np.array(centre) + half]


def hatch(degrees, pitch=1.5):
    """Parallel lines over and beyond the plate."""
    across = np.radians(degrees + 90.0)
    normal = np.array([np.cos(across), np.sin(across)])
    rows = np.arange(-45.0, 45.0, pitch)
    return [strand(degrees, 120.0, [30.0, 20.0] + row * normal) for row in rows]


def turning(points):
    """Uniaxial stress whose direction turns with the place; compression in the left half."""
    x, y = points[:, 0], points[:, 1]
    angle = 0.04 * x + 0.03 * y
    size = np.where(x < 30.0, -1.0, 1.0) * (1.0 + y / 40.0)
    t = np.stack([np.cos(angle), np.sin(angle), 0.0 * x], axis=1)
    return size[:, None, None] * t[:, :, None] * t[:, None, :]


@pytest.mark.parametrize("reading", READINGS)
def test_tracks_made_of_the_stress_vectors_match_them_all(make_part, uniform, reading):
    part = make_part(turning, divisions=(13, 8, 1))
    layer = part.layers[0]
    # The nodal stress of each triangle's middle, by eigenvectors.
    stress = stress_on(layer, part.stress).nodal[layer.triangles].mean(axis=1)[:, :2, :2]
    values, vectors = np.linalg.eigh(stress)
    largest = np.abs(values).argmax(axis=1)
    along = vectors[np.arange(len(vectors)), :, largest]
    middle = layer.plane.points[layer.triangles].mean(axis=1)
    lines = np.stack([middle - 0.1 * along, middle + 0.1 * along], axis=1)
    assert rate(part, part.paths(*lines), reading) == pytest.approx(1.0)


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_lines_at_20_degrees_match_from_20_degrees_on(make_part, uniform, reading, sign):
    part = make_part(uniform(10.0 * sign, 2.0))
    expected = (THRESHOLDS >= 20.0).astype(float)
    for degrees in (20.0, -20.0, 160.0):
        found = rate(part, part.paths(*hatch(degrees)), reading)
        assert found.tolist() == pytest.approx(expected.tolist()), degrees


@pytest.mark.parametrize("reading", ["path", "energy"])
def test_directions_all_round_match_by_chance(pulled, reading):
    # Every direction once: of these, T / 90 lie within T of any.
    lines = [strand(degrees, 2.0) for degrees in np.arange(720.0) / 4.0 + 0.125]
    found = rate(pulled, pulled.paths(*lines), reading)
    assert found == pytest.approx(THRESHOLDS / 90.0)


def test_random_directions_beside_every_vector_match_by_chance(pulled):
    rng = np.random.default_rng(1)
    layer = pulled.layers[0]
    middle = layer.plane.points[layer.triangles].mean(axis=1)
    lines = [strand(rng.uniform(0.0, 180.0), 0.2, place) for place in middle]
    found = rate(pulled, pulled.paths(*lines), "stress_nearest")
    error = np.sqrt(0.25 / len(lines))
    assert found == pytest.approx(THRESHOLDS / 90.0, abs=4.0 * error)


def test_energy_weighs_fibre_with_the_size_of_the_stress(make_part):
    # Along x, from -1 MPa at y = 0 to 1 MPa at y = 40: sizes 0.8 and 0.2.
    def bending(points):
        tensor = np.zeros((len(points), 3, 3))
        tensor[:, 0, 0] = points[:, 1] / 20.0 - 1.0
        return tensor

    part = make_part(bending)
    paths = part.paths([[5, 4], [25, 4]], strand(90.0, 2.0, (40.0, 24.0)))
    assert rate(part, paths, "path")[1] == pytest.approx(20.0 / 22.0)
    assert rate(part, paths, "energy")[1] == pytest.approx(16.0 / (16.0 + 0.4))


def test_in_compression_alone_alignment_and_matching_differ(make_part, uniform):
    part = make_part(uniform(-10.0, 3.0))
    samples = sample_alignment(part.plane(strand(0.0)), stress_on(part.layers[0], part.stress), 1.0)
    assert matching_indices(samples)["matching_path_10"] == 1.0
    assert alignment_indices(samples)["aligned_10"] == 0.0


@pytest.mark.parametrize("stress", [(5.0, 5.0), (0.0, 0.0), (3.0, -3.0), (0.0, 0.0, 4.0)])
@pytest.mark.parametrize("reading", READINGS)
def test_without_a_direction_there_is_no_rate(make_part, uniform, stress, reading):
    part = make_part(uniform(*stress))
    assert np.isnan(rate(part, part.paths(strand(10.0)), reading)).all()


def test_the_best_piece_counts_within_reach_only(pulled):
    # One crossed pair of strands: the nearer at 40 degrees, the other along the stress.
    paths = pulled.paths(*[[[0, y], [60, y]] for y in np.arange(0.25, 40.0, 4.0)], *hatch(40, 0.7))
    nearest, best = (rate(pulled, paths, r) for r in ("stress_nearest", "stress_best"))
    assert (best >= nearest).all()
    assert best[0] == pytest.approx(0.5, abs=0.05)
    assert nearest[0] < 0.4
    # Strands every 4 mm reach half of the plate; where they do not, no angle is enough.
    alone = pulled.paths(*[[[0, y], [60, y]] for y in np.arange(2.0, 40.0, 4.0)])
    for reach in (0.5, 1.0):
        layer = pulled.layers[0]
        y = layer.plane.points[layer.triangles].mean(axis=1)[:, 1]
        near = np.abs(y % 4.0 - 2.0) <= reach
        share = layer.areas[near].sum() / layer.areas.sum()
        found = rate(pulled, alone, "stress_best", reach=reach)
        assert found == pytest.approx(share), reach
    assert rate(pulled, alone, "stress_nearest") == pytest.approx(1.0)
    assert rate(pulled, pulled.paths(), "stress_best") == pytest.approx(0.0)
    assert np.isnan(rate(pulled, pulled.paths())).all()


@pytest.mark.parametrize("reading", ["stress_nearest", "stress_best"])
def test_weak_stress_has_no_say(make_part, reading):
    # Along y and a thousandth of the rest where x < 30, along x where x > 30.
    def halves(points):
        tensor = np.zeros((len(points), 3, 3))
        left = points[:, 0] < 29.9
        tensor[left, 1, 1], tensor[~left, 0, 0] = 1e-3, 1.0
        return tensor

    part = make_part(halves)
    assert rate(part, part.paths(*hatch(0.0)), reading)[0] == pytest.approx(1.0, abs=1e-9)


def test_links_count_in_the_part_alone_and_not_at_all_when_left_out(framed):
    # Along x: 10 mm, a link of 20 mm over the window, 10 mm; a link of 5 mm along y; 10 mm.
    line = [[10, 20], [20, 20], [40, 20], [50, 20], [50, 25], [40, 25]]
    paths = framed.paths(line, links=[[1, 3]])
    assert rate(framed, paths)[0] == pytest.approx(30.0 / 35.0, abs=1e-3)
    assert rate(framed, paths, links=False)[0] == pytest.approx(1.0)
    # A strand across the stress and a link along it.
    paths = framed.paths([[2, 2], [2, 38], [58, 38]], links=[[1]])
    for reading in ("stress_nearest", "stress_best"):
        assert rate(framed, paths, reading)[0] > 0.02
        assert rate(framed, paths, reading, links=False)[:-1].tolist() == [0.0] * 17


@pytest.mark.parametrize("reading", READINGS)
def test_load_and_frame_do_not_matter(make_part, reading):
    rng = np.random.default_rng(7)
    lines = [rng.uniform([0, 0], [60, 40], (6, 2)) for _ in range(5)]
    part = make_part(turning)
    first = rate(part, part.paths(*lines), reading)
    assert 0.01 < first[0] < first[6] < 0.9
    scaled = replace(part.stress, nodal=1e6 * part.stress.nodal)
    again = matching_rate(part.paths(*lines), [stress_on(part.layers[0], scaled)], reading)
    assert again == pytest.approx(first, abs=1e-12)
    turn = Rotation.random(rng=3).as_matrix()
    # The layer is turned, not sliced anew: a slice may cut the same section in other triangles.
    stress, layer, here = stress_on(part.layers[0], part.stress), part.layers[0], part.paths(*lines)
    frame = layer.plane.frame @ turn.T
    frame[:2] = [0.6 * frame[0] + 0.8 * frame[1], 0.6 * frame[1] - 0.8 * frame[0]]
    layer = replace(layer, points=layer.points @ turn.T, flat=replace(layer.flat, frame=frame))
    there = replace(here, points=here.points @ turn.T, normals=here.normals @ turn.T)
    turned = replace(stress, layer=layer, nodal=turn @ stress.nodal @ turn.T)
    assert matching_rate(there, [turned], reading) == pytest.approx(first, abs=1e-9)


@pytest.mark.parametrize("reading", ["path", "stress_nearest"])
def test_layers_count_by_their_fibre_or_by_their_area(make_part, reading):
    rng = np.random.default_rng(11)
    lines = [rng.uniform([0, 0], [60, 40], (6, 2)) for _ in range(4)]
    part = make_part(turning, count=2)
    fibre = [part.paths(*lines[:3], layer=0), part.paths(lines[3], layer=1)]
    paths = type(fibre[0]).concatenate(fibre)
    stresses = [stress_on(layer, part.stress) for layer in part.layers]
    each = [matching_rate(paths, [stress], reading) for stress in stresses]
    weights = [one.lengths.sum() for one in fibre] if reading == "path" else [1.0, 1.0]
    expected = np.average(each, axis=0, weights=weights)
    assert np.abs(each[0] - each[1]).max() > 0.05
    assert matching_rate(paths, stresses, reading) == pytest.approx(expected)


def test_bad_input_is_refused(pulled):
    with pytest.raises(InputError, match="no reading of the rate named 'paths'; there are: path"):
        rate(pulled, pulled.paths(strand(0.0)), "paths")
    with pytest.raises(InputError, match="at least one layer"):
        matching_rate(pulled.paths(strand(0.0)), [])
