"""Solids made of stacks of layers, beside those that the layers were cut from."""

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.files.layer_files import stack_surface
from ccfem.body.files.surface import Surface
from ccfem.body.mesh import TetMesh
from ccfem.body.meshing.planform import extrude
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.slicing.layers.level_surfaces import level_surfaces

HEIGHT, GAP = 4.0, 0.5


def plate():
    """Plate of 18 x 12 x 4 mm with a round hole of radius 3 mm."""
    hole = shapely.Point(2.0, 0.0).buffer(3.0, quad_segs=12)
    return extrude(shapely.box(-9.0, -6.0, 9.0, 6.0) - hole, HEIGHT, 2.0)


def layers_of(mesh, level, count):
    """Cut a solid at even levels of a field, the first and last half a step inside its range."""
    values = level(mesh.points)
    low, step = values.min(), np.ptp(values) / count
    levels = low + (np.arange(count) + 0.5) * step
    found = level_surfaces(mesh, values, levels, step, shortest=0.05 * GAP, least_area=0.0)
    return [(layer.points, layer.triangles) for layer in found.layers]


def deviations(mesh: TetMesh, surface: Surface):
    """Distances of the nodes of either boundary from the other."""
    nodes = mesh.points[np.unique(mesh.boundary)]
    return (
        nearest_on_triangles(mesh.points, mesh.boundary, surface.points).distance,
        nearest_on_triangles(surface.points, surface.triangles, nodes).distance,
    )


@pytest.mark.parametrize(
    "level",
    [
        pytest.param(lambda p: p[:, 2], id="flat"),
        pytest.param(lambda p: p[:, 2] + 0.15 * p[:, 0] + 0.01 * p[:, 1] ** 2, id="running out"),
    ],
)
def test_layers_of_a_solid_give_the_solid(level):
    """Also where they end in its faces, at slopes of 1 in 7."""
    mesh = plate()
    layers = layers_of(mesh, level, round(np.ptp(level(mesh.points)) / GAP))
    surface = Surface(*stack_surface(layers))  # which is closed, or it raises
    there, back = deviations(mesh, surface)
    assert surface.volume == pytest.approx(mesh.volumes.sum(), rel=0.01)
    assert np.quantile(there, 0.95) < 0.5 * GAP
    assert max(there.max(), back.max()) < GAP


def test_turned_layers_and_pieces_of_them_give_the_same_solid():
    """A layer of another program may look down; here every other one does."""
    mesh = plate()
    layers = layers_of(mesh, lambda p: p[:, 2], 6)
    turned = [
        (points, triangles[:, ::-1] if k % 2 else triangles)
        for k, (points, triangles) in enumerate(layers)
    ]
    points, triangles = stack_surface(layers)
    again, others = stack_surface(turned)
    np.testing.assert_array_equal(others, triangles)
    np.testing.assert_allclose(again, points, atol=1e-6)


def test_stacks_that_are_none_are_one_line():
    (points, triangles), *_ = layers_of(plate(), lambda p: p[:, 2], 2)
    with pytest.raises(InputError, match="at least two layers; got 1"):
        stack_surface([(points, triangles)])
    with pytest.raises(InputError, match="layers lie on one another"):
        stack_surface([(points, triangles)] * 2)
    near = [(points, triangles), (points + np.array([0.0, 0.0, 1e-3]), triangles)]
    with pytest.raises(InputError, match=r"layers 0\.001 mm apart over 18 mm: are they in mm"):
        stack_surface(near)
    mesh = plate()
    with pytest.raises(InputError, match="layer 0 is closed, without a border"):
        stack_surface([(mesh.points, mesh.boundary), (mesh.points + 0.5, mesh.boundary)])
