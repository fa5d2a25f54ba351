"""First failure: indices against brute force, the lower of two limits, refusals."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from flat_paths import flat_paths

from ccfem.base.errors import InputError
from ccfem.base.tensor import von_mises
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, PointForce, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing import failure_laws
from ccfem.judging.virtual_testing.failure_laws import fibre, matrix
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Failure, Strand
from ccfem.judging.virtual_testing.strands import Strands, Windows
from ccfem.judging.virtual_testing.strength import fibre_peak, first_failure, matrix_peak

SIZE = (20.0, 4.0, 4.0)


def problem(load, strength=30.0):
    """Bar held at x = 0, free to narrow."""
    return Problem(
        box_mesh(SIZE, (15, 3, 3)),
        isotropic(2000.0, 0.3, tensile_strength=strength),
        (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z")),
        {"load": load},
    )


def clamped(load, strength=30.0):
    """Cantilever clamped at x = 0."""
    return dataclasses.replace(problem(load, strength), supports=(Support("x_min"),))


LINES = flat_paths([np.array([[1.0, y, z], [19.0, y, z]]) for y in (1.0, 3.0) for z in (1.0, 3.0)])
BEND = (Force("x_max", (0.0, 0.0, 10.0)),)


def test_matrix_peak_is_the_largest_ball_average_away_from_the_patches():
    field = solve(clamped(BEND))["load"]
    mesh = field.mesh
    centre = mesh.points[mesh.corners].mean(axis=1)
    mises = von_mises(field.stress)
    best, place = -1.0, None
    for point in centre[(centre[:, 0] > 3.0) & (centre[:, 0] < 17.0)]:
        near = np.linalg.norm(centre - point, axis=1) <= 2.0
        average = np.average(mises[near], weights=mesh.volumes[near])
        if average > best:
            best, place = average, point
    index, where = matrix_peak(field)
    assert index == pytest.approx(best, rel=1e-12)
    np.testing.assert_allclose(where, place)
    assert index < mises.max()


def test_a_point_force_has_its_zone_too(monkeypatch):
    monkeypatch.setattr("ccfem.fem.elasticity.zone.BALL", 0.1)
    node = np.array([12.0, 4.0 / 3.0, 4.0])
    field = solve(clamped((PointForce(tuple(node), (50.0, 0.0, 0.0)),)))["load"]
    _, far = matrix_peak(field)
    monkeypatch.setattr("ccfem.fem.elasticity.zone.ZONE", 0.5)
    _, near = matrix_peak(field)
    assert np.linalg.norm(near - node) < 3.0 < np.linalg.norm(far - node)


def test_uniform_stress_fails_where_stress_reaches_strength():
    # Held across at two lines only, so that the sides are no support patches.
    mesh = box_mesh(SIZE, (15, 3, 3))
    corner = mesh.patch("x_min")[:1]
    mesh = mesh.with_patches({"corner": corner})
    pulled = Problem(
        mesh,
        isotropic(2000.0, 0.0, tensile_strength=30.0),
        (Support("x_min", "x"), Support("corner", "yz")),
        {"load": (Force("x_max", (80.0, 0.0, 0.0)),)},
    )
    test = virtual_test(LINES, solve(pulled)["load"], Strand(rho=1e-6 / 2000.0), span=())
    index, _ = matrix_peak(test.solution)
    assert index == pytest.approx(80.0 / 16.0, rel=1e-6)
    failure = first_failure(test)
    assert (failure.what, failure.load) == ("matrix", pytest.approx(30.0 * 16.0, rel=1e-6))
    # A strand that breaks at the same strain as the matrix at 15 MPa.
    weak = first_failure(test, Strand(strength=1e-6 * 15.0 / 2000.0))
    assert (weak.what, weak.load) == ("fibre", pytest.approx(15.0 * 16.0, rel=1e-6))
    assert weak.fibre_load == weak.load < weak.matrix_load


def strands_of(length, path, share=None):
    """Pieces along x, path after path."""
    count = len(length)
    arc = np.concatenate(
        [np.cumsum(length[path == p]) - 0.5 * length[path == p] for p in set(path)]
    )
    return Strands(
        cell=np.zeros(count),
        length=length,
        tangent=np.tile([1.0, 0.0, 0.0], (count, 1)),
        path=path,
        arc=arc,
        middle=np.column_stack([arc, path, np.zeros(count)]),
        outside=0.0,
        share=np.ones(count) if share is None else share,
    )


def test_highest_mean_over_a_length_against_brute_force():
    rng = np.random.default_rng(5)
    length, path = rng.uniform(0.1, 2.0, 60), np.repeat([0, 1, 2], [40, 17, 3])
    force = rng.uniform(0.0, 100.0, 60)
    best = (-1.0, np.zeros(2))
    for p in range(3):
        # A hundredth of a millimetre each; the third path is shorter than 5 mm and counts whole.
        of_path = path == p
        fine = np.repeat(force[of_path], np.round(1000 * length[of_path]).astype(int))
        size = min(5000, len(fine))
        means = np.convolve(fine, np.ones(size) / size, mode="valid")
        best = max(best, (means.max(), (1e-3 * (means.argmax() + 0.5 * size), p)))
    highest, where = Windows(strands_of(length, path), 5.0).highest(force)
    assert highest == pytest.approx(best[0], rel=1e-3)
    np.testing.assert_allclose(where[:2], best[1], atol=1.0)


def test_mean_counts_the_fibre_that_carries():
    force, whole = np.array([90.0, 1e6, 60.0]), np.array([2.0, 4.0, 3.0])
    pieces = strands_of(whole, np.zeros(3, dtype=int), np.array([1.0, 0.0, 1.0]))
    assert Windows(pieces, 5.0).highest(force)[0] == pytest.approx((2 * 90 + 3 * 60) / 5)


def test_force_of_the_fibre_depends_little_on_the_cells():
    """Beam theory: a strand at a height z carries EA M z / (E I), most where 5 mm are nearest."""
    line = flat_paths([np.array([[0.5, 2.0, 0.4], [19.5, 2.0, 0.4]])])
    highest = []
    for divisions in ((15, 3, 3), (30, 6, 6)):
        mesh = box_mesh(SIZE, divisions)
        beam = dataclasses.replace(clamped(BEND), mesh=mesh.quadratic(), order=2)
        test = virtual_test(line, solve(beam)["load"], Strand(rho=1e-3), span=())
        highest.append(fibre_peak(test)[0])
    beam = 1e-3 * 10.0 * (20.0 - 3.0) * 1.6 / (4.0**4 / 12.0)
    assert highest[1] == pytest.approx(highest[0], rel=0.02)
    assert highest[1] == pytest.approx(beam, rel=0.05)


def test_failure_load_does_not_depend_on_the_load_of_the_test():
    once = first_failure(virtual_test(LINES, solve(clamped(BEND))["load"], span=()))
    thrice = (Force("x_max", (0.0, 0.0, 30.0)),)
    again = first_failure(virtual_test(LINES, solve(clamped(thrice))["load"], span=()))
    assert again.load == pytest.approx(once.load, rel=1e-6)
    assert again.matrix_index == pytest.approx(3.0 * once.matrix_index, rel=1e-6)
    np.testing.assert_allclose(again.where, once.where)


def test_no_stretched_fibre_never_breaks():
    pushed = solve(problem((Force("x_max", (-80.0, 0.0, 0.0)),)))["load"]
    test = virtual_test(LINES, pushed, span=())
    assert fibre_peak(test)[0] == 0.0
    failure = first_failure(test)
    assert (failure.what, failure.fibre_load) == ("matrix", np.inf)


@pytest.mark.parametrize(
    ("failure", "said"),
    [
        (Failure(), "law of failure 'creep' did not judge the part, and gave no reason"),
        (Failure(np.nan, note="no creep data"), "no creep data"),
        (Failure(1e9, note="creep of another grade"), "creep of another grade"),
        (Failure(1e9), ""),
    ],
)
def test_a_law_that_does_not_judge_the_part_is_named(monkeypatch, failure, said):
    creep = SimpleNamespace(fails=lambda test, limits, layers: failure)
    laws = {"matrix": matrix, "fibre": fibre, "creep": creep}
    monkeypatch.setattr(failure_laws, "named", lambda: laws)
    result = first_failure(virtual_test(LINES, solve(clamped(BEND))["load"], span=()))
    assert result.note == said
    assert ("creep" in result.loads) == (failure.load == 1e9)


def test_a_part_within_the_zones_is_refused(monkeypatch):
    for module in ("fem.elasticity.zone", "judging.virtual_testing.failure_laws.matrix"):
        monkeypatch.setattr(f"ccfem.{module}.ZONE", 12.0)
    with pytest.raises(InputError, match=r"farther than 12 mm .* too small for this index"):
        matrix_peak(solve(clamped(BEND))["load"])


def test_missing_strengths_are_refused():
    test = virtual_test(LINES, solve(clamped(BEND, strength=None))["load"], span=())
    with pytest.raises(InputError, match="strength of a strand, N; the fibre material has none"):
        first_failure(test, Strand(strength=None), 30.0)
    with pytest.raises(InputError, match="material 'isotropic' has none: give tensile_strength"):
        first_failure(test)
    assert first_failure(test, matrix_strength=30.0).load > 0.0


def test_a_face_that_slides_in_its_plane_is_judged_too():
    """Even tension in a bar 2 mm thick: F / A everywhere but at the load."""
    mesh = box_mesh((20.0, 4.0, 2.0), (15, 3, 2))
    pulled = {"load": (Force("x_max", (80.0, 0.0, 0.0)),)}
    faces = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
    field = solve(Problem(mesh, isotropic(2000.0, 0.3), faces, pulled))["load"]
    peak, place = matrix_peak(field)
    assert peak == pytest.approx(10.0)
    assert place[0] < 17.0
    # Part of the face, or what holds it in its plane too, counts as a support.
    bottom = mesh.patch("z_min")
    part = mesh.with_patches({"z_min": bottom[:-1]})
    for mesh_, last in ((part, Support("z_min", "z")), (mesh, Support("z_min", "xyz"))):
        field = solve(Problem(mesh_, isotropic(2000.0, 0.3), (*faces[:2], last), pulled))["load"]
        with pytest.raises(InputError, match="no cell lies farther than 3 mm"):
            matrix_peak(field)
