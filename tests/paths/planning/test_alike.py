"""Layers that are alike are planned once: as many as the change of the stress with height says."""

import numpy as np
import pytest
import shapely
import shapely.affinity

from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import GivenStress
from ccfem.machine import Machine
from ccfem.paths.placement.fibre_places import cut_layer
from ccfem.paths.planning import plan
from ccfem.paths.planning.alike import ALIKE, alike_layers, equal_sections
from ccfem.slicing.slicers import Planar
from ccfem.strategies import create

MESH = box_mesh((40.0, 16.0, 10.0), (10, 4, 5))
MACHINE = Machine(minimum_length=5.0)


def pulled(slope):
    """Stress along x of 1 MPa at the bottom that grows by a slope, 1/mm, with the height."""

    def tensor(points):
        stress = np.zeros((len(points), 3, 3))
        stress[:, 0, 0] = 1.0 + slope * points[:, 2]
        return stress

    return GivenStress(MESH, tensor(MESH.points[MESH.cells].mean(axis=1)), tensor(MESH.points), ())


@pytest.mark.parametrize("slope", [0.0, 0.004, 0.02])
def test_a_run_ends_where_the_stress_has_changed_by_the_share(slope):
    layers = Planar(count=50).cut(MESH)
    height = np.array([layer.plane.height for layer in layers])
    size = 1.0 + slope * height
    expected, first = np.arange(50), 0
    while first < 50:
        run = int((size <= (1.0 + ALIKE) * size[first] + 1e-12).sum()) - first
        expected[first : first + run] = first + run // 2
        first += run
    np.testing.assert_array_equal(alike_layers(layers, pulled(slope)), expected)


def test_layers_that_are_alike_take_the_paths_of_one_at_their_own_height():
    layers, stress = Planar(count=6).cut(MESH), pulled(0.0)
    strategy, alike = create("isocurve"), alike_layers(layers, stress)
    once, every = (plan(strategy, layers, stress, MACHINE, shared) for shared in (alike, None))
    assert set(alike.tolist()) == {3}
    planned = every.on_layer(3).points
    for layer in layers:
        paths = once.on_layer(layer.index).points
        np.testing.assert_allclose(paths[:, :2], planned[:, :2], atol=1e-12)
        np.testing.assert_allclose(paths[:, 2], layer.plane.height, atol=1e-12)
        # The stress is uniform: planned by itself, each layer gets as much fibre.
        own = every.on_layer(layer.index).lengths.sum()
        assert once.on_layer(layer.index).lengths.sum() == pytest.approx(own, rel=1e-6)


def test_regions_with_a_slanted_border_are_alike():
    """Their borders cross other cells at every height, and leave out specks there."""
    region = shapely.affinity.rotate(shapely.box(5.0, 4.0, 31.0, 12.0), 23.0)
    parts = [cut_layer(layer, region, MESH) for layer in Planar(count=100).cut(MESH)[:20]]
    assert not all(equal_sections(parts[0], part) for part in parts)
    assert set(alike_layers(parts, pulled(0.0)).tolist()) == {10}


def test_strategies_that_turn_from_layer_to_layer_plan_every_layer():
    layers, stress = Planar(count=2).cut(MESH), pulled(0.0)
    strategy = create("zigzag", {"turn": 90.0})
    once = plan(strategy, layers, stress, MACHINE, np.array([1, 1]))
    np.testing.assert_array_equal(once.points, plan(strategy, layers, stress, MACHINE).points)


def test_a_wider_section_is_not_alike():
    lower, upper = Planar(count=2).cut(MESH)
    wide = box_mesh((44.0, 16.0, 10.0), (10, 4, 5))
    other = Planar(count=2).cut(wide)[1]
    stress = pulled(0.0)
    assert alike_layers([lower, upper], stress).tolist() == [1, 1]
    assert alike_layers([lower, other], stress).tolist() == [0, 1]
