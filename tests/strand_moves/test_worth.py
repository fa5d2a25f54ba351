import numpy as np
import pytest

from ccfem.elasticity.problem import Force, Problem, Support
from ccfem.elasticity.solve import solve
from ccfem.layers.slicing.planar import Planar
from ccfem.materials import isotropic
from ccfem.mesh.box import box_mesh
from ccfem.strand_moves.local_strain import LocalStrain, StrainThere
from ccfem.strand_moves.worth import worth_of
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.virtual_test import virtual_test


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def test_a_strain_that_is_linear_in_place_is_found_with_its_slope(rng):
    centroids = rng.random((400, 3)) * [10.0, 10.0, 4.0]
    constant, slope = rng.normal(size=3), rng.normal(size=(3, 2))
    strain = constant + centroids[:, :2] @ slope.T
    local = LocalStrain(centroids, 0.5 + rng.random(400))
    points = rng.random((30, 3)) * [6.0, 6.0, 2.0] + [2.0, 2.0, 1.0]
    there = local.at(points, local.near(points), strain)
    np.testing.assert_allclose(there.value, constant + points[:, :2] @ slope.T, atol=0.02)
    np.testing.assert_allclose(there.slope, np.broadcast_to(slope, (30, 3, 2)), atol=0.04)


def test_force_is_the_slope_of_the_worth(rng):
    """Against central differences, in a strain that is linear in place."""
    constant, slope = np.array([1.0, 0.4, 0.3]), 0.1 * rng.normal(size=(3, 2))
    points = np.cumsum(rng.random((12, 2)), axis=0)
    starts = np.array([0, 1, 2, 3, 4, 6, 7, 8, 9, 10])  # two strands
    price = 0.3

    def there(points):
        middle = 0.5 * (points[starts] + points[starts + 1])
        return StrainThere(constant + middle @ slope.T, np.tile(slope, (len(starts), 1, 1)))

    def total(points):
        length = np.linalg.norm(points[starts + 1] - points[starts], axis=1).sum()
        return worth_of(points, starts, there(points), price).value.sum() - price * length

    found = worth_of(points, starts, there(points), price)
    assert (found.value > 0.0).sum() > 6  # most pieces are stretched
    step = 1e-6
    for place in np.ndindex(points.shape):
        more, less = points.copy(), points.copy()
        more[place] += step
        less[place] -= step
        slope_there = (total(more) - total(less)) / (2.0 * step)
        assert found.force[place] == pytest.approx(slope_there, rel=1e-6, abs=1e-8)


def test_moving_a_strand_changes_the_compliance_by_the_force():
    """Against virtual tests of a bent beam, on quadratic cells, before and after the move."""
    mesh = box_mesh((40.0, 12.0, 2.0), (20, 6, 1))
    material = isotropic(3500.0, 0.3)
    loads = {"tip": (Force("x_max", (0.0, 30.0, 0.0)),)}
    problem = Problem(mesh, material, (Support("x_min"),), loads, order=2)
    field = solve(problem, tolerance=1e-10)["tip"]
    layer = Planar(count=1).cut(field.mesh)[0]
    strand = Strand(0.01)

    strain = field.strain
    cells = np.stack([strain[:, 0, 0], strain[:, 1, 1], 2.0 * strain[:, 0, 1]], axis=1)
    corners = field.mesh.points[field.mesh.corners]
    local = LocalStrain(corners.mean(axis=1), field.mesh.volumes)

    x = np.linspace(8.0, 32.0, 41)
    line = np.column_stack([x, 3.0 + 0.02 * x])
    bump = np.exp(-(((x - 18.0) / 5.0) ** 2))
    middle = 0.5 * (line[1:] + line[:-1])
    place = np.column_stack([middle, np.full(40, layer.plane.height)])
    there = local.at(place, local.near(place), cells)
    force = worth_of(line, np.arange(40), there, 0.0).force

    def compliance(way):
        moved = line + np.outer(way * bump, [0.0, 1.0])
        paths = Toolpaths.from_plane([moved], layer)
        return 1.0 / virtual_test(paths, field, strand, span=()).stiffness

    slope = 30.0**2 * (compliance(0.2) - compliance(-0.2)) / 0.4
    assert slope == pytest.approx(-strand.stiffness(3500.0) * (force[:, 1] @ bump), rel=0.05)
