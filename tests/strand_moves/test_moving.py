from itertools import pairwise

import numpy as np
import pytest
import shapely

from ccfem.elasticity.problem import Force, Problem, Support
from ccfem.elasticity.solve import solve
from ccfem.errors import InputError
from ccfem.layers.slicing.planar import Planar
from ccfem.machine import Machine
from ccfem.materials import isotropic
from ccfem.mesh.box import box_mesh
from ccfem.strand_moves import moved
from ccfem.toolpaths import MATRIX, Toolpaths
from ccfem.virtual_testing.virtual_test import virtual_test

MACHINE = Machine(minimum_length=20.0)


@pytest.fixture(scope="module")
def beam():
    """A beam clamped at x = 0 and pushed up at the other end: stretched at the bottom, y = 0."""
    mesh = box_mesh((60.0, 20.0, 3.0), (24, 10, 2))
    loads = {"tip": (Force("x_max", (0.0, 50.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("x_min"),), loads, order=1)
    field, layers = solve(problem, tolerance=1e-10)["tip"], Planar(count=2).cut(mesh)
    lines = [np.array([[3.0, y], [57.0, y]]) for y in (0.9, 2.6, 4.6)]
    paths = Toolpaths.concatenate([Toolpaths.from_plane(lines, layer) for layer in layers])
    return field, layers, paths


@pytest.fixture(scope="module")
def found(beam):
    field, layers, paths = beam
    return moved(paths, layers, field, MACHINE, rounds=12)


def test_strands_move_to_the_stretched_side_and_stay_apart(beam, found):
    field, layers, paths = beam
    before, after = (virtual_test(one, field, span=()).ratio for one in (paths, found))
    assert after - 1.0 > 1.06 * (before - 1.0)
    np.testing.assert_allclose(found.lengths, paths.lengths, rtol=0.01)
    for layer in layers:
        lines = [shapely.LineString(layer.plane.project(p)) for p in found.on_layer(layer.index)]
        assert all(a.distance(b) > 0.98 * MACHINE.fibre_width for a, b in pairwise(lines))
        inner = shapely.buffer(layer.plane.polygon, -0.5 * MACHINE.fibre_width + 1e-6)
        assert shapely.covers(inner, lines).all()
    # The lowest reaches the inset near the clamp, where the beam is bent most.
    assert found.points[:, 1].min() == pytest.approx(0.5, abs=0.05)


def test_the_paths_keep_order_kind_marks_and_height(beam, found):
    field, layers, paths = beam
    np.testing.assert_array_equal(found.layer, paths.layer)
    heights = [np.unique(np.round(path[:, 2], 9)) for path in found]
    assert [len(h) for h in heights] == 6 * [1]
    matrix = np.zeros(6, dtype=bool)
    matrix[2] = True
    link = np.zeros(len(paths.points), dtype=bool)
    link[0] = True
    mixed = Toolpaths(
        paths.points, paths.normals, paths.offsets, paths.layer,
        np.where(matrix, MATRIX, paths.kind), paths.closed, link,
    )  # fmt: skip
    some = moved(mixed, layers, field, MACHINE, rounds=2)
    np.testing.assert_array_equal(some.kind, mixed.kind)
    np.testing.assert_array_equal(list(some)[2], list(paths)[2])
    first = some.select(np.arange(6) == 0)
    assert first.link[:-1].all()
    np.testing.assert_allclose(first.points[:, 1], 0.9)  # a link stays
    assert np.ptp(list(some)[1][:, 1]) > 0.01


def test_no_round_leaves_the_paths_as_they_are(beam):
    field, layers, paths = beam
    assert moved(paths, layers, field, MACHINE, rounds=0) is paths
    with pytest.raises(InputError, match="rounds"):
        moved(paths, layers, field, MACHINE, rounds=-1)
