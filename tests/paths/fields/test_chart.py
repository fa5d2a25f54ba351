"""Charts: a cylinder rolls off exactly; a cap of a sphere cannot; a sphere has none."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import GivenStress
from ccfem.paths.fields.chart import chart_of, flat_view, in_charts
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers import stress_on
from ccfem.slicing.slicers import Planar

MESH = box_mesh((60.0, 20.0, 2.0), (30, 10, 1))
RADIUS = 25.0


def flat_layer():
    return Planar(heights=(1.0,)).cut(MESH)[0]


def rolled(layer):
    x, y, _ = layer.points.T
    angle = (x - 30.0) / RADIUS
    points = np.column_stack([RADIUS * np.sin(angle), y, RADIUS * np.cos(angle)])
    return replace(layer, points=points, flat=None)


def cap(angle):
    """Cap of a sphere, from its pole to an angle, of the triangles of a square's middle."""
    layer = flat_layer()
    u, v = (layer.points[:, :2] - [30.0, 10.0]).T
    inside = (np.hypot(u, v) <= 9.9)[layer.triangles].all(axis=1)
    used, triangles = np.unique(layer.triangles[inside], return_inverse=True)
    size = np.hypot(u, v)[used]
    polar, turn = angle * size / size.max(), np.arctan2(v, u)[used]
    points = RADIUS * np.column_stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)]
    )
    return replace(
        layer,
        points=points,
        triangles=triangles.reshape(-1, 3),
        cell=layer.cell[inside],
        nodes=layer.nodes[used],
        weights=layer.weights[used],
        loops=(),
        patches={},
        flat=None,
        local_thickness=layer.local_thickness[used],
    )


def test_a_cylinder_rolls_off_without_distortion():
    chart = chart_of(rolled(flat_layer()))
    # Chords of 2 mm are shorter than their arcs by (2 / 25)^2 / 24.
    np.testing.assert_allclose(chart.stretches, 1.0, atol=2e-3)
    size = np.ptp(chart.flat.points, axis=0)
    np.testing.assert_allclose(size, [60.0, 20.0, 0.0], rtol=5e-4, atol=1e-9)


def test_a_cap_of_a_sphere_is_stretched_no_less_than_it_must():
    """Milnor, Amer. Math. Monthly 76 (1969) 1101: no map of a cap does better than a / sin a."""
    angle = 0.8
    chart = chart_of(cap(angle))
    found = chart.stretches[:, 0].max() / chart.stretches[:, 1].min()
    least = angle / np.sin(angle)
    # The triangles are those of a polyhedron inside the cap, whose border is a little nearer.
    assert 0.97 * least < found < 1.6 * least
    assert 0.0 < chart.distortion < least - 0.9


def test_paths_come_back_where_they_were():
    layer = rolled(flat_layer())
    angle = np.linspace(-1.0, 1.0, 200)
    line = np.column_stack([RADIUS * np.sin(angle), 10.0 + 8.0 * angle, RADIUS * np.cos(angle)])
    paths = Toolpaths.in_space([line], [np.zeros_like(line)], layer)
    chart = chart_of(layer)
    flat = chart.flattened(paths)
    # A helix is a straight line on the cylinder rolled off.
    ends = flat.points[-1] - flat.points[0]
    assert flat.lengths[0] == pytest.approx(np.linalg.norm(ends), rel=1e-4)
    assert flat.lengths[0] == pytest.approx(2.0 * np.hypot(RADIUS, 8.0), rel=1e-3)
    back = chart.lifted(flat)
    assert np.diff(back.offsets)[0] >= 2.0 * np.hypot(RADIUS, 8.0) / 0.5
    radius = np.hypot(back.points[:, 0], back.points[:, 2])
    np.testing.assert_allclose(radius, RADIUS, atol=0.03)
    across = back.points[:, [0, 2]] / radius[:, None]
    assert (np.einsum("pd,pd->p", back.normals[:, [0, 2]], across) > 0.999).all()
    assert len(in_charts(paths, [layer])) == 1


def test_stress_turns_with_the_chart():
    """Tension round the cylinder runs along the chart's first axis everywhere."""
    layer = rolled(flat_layer())
    angle = (MESH.points[:, 0] - 30.0) / RADIUS
    hoop = np.column_stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)])
    nodal = 5.0 * hoop[:, :, None] * hoop[:, None, :]
    stress = GivenStress(MESH, nodal[MESH.cells].mean(axis=1), nodal)
    found = stress_on(flat_view(layer), stress)
    expected = np.zeros((3, 3))
    expected[0, 0] = 5.0
    middle = (np.abs(layer.points[:, 1] - 10.0) < 9.0) & (np.abs(angle).max() > 1.0)
    inner = middle & (np.abs(layer.points[:, 0]) < 0.8 * RADIUS)
    np.testing.assert_allclose(
        found.nodal[inner], np.broadcast_to(expected, found.nodal[inner].shape), atol=0.25
    )


def test_a_flat_layer_is_its_own_view():
    layer = flat_layer()
    assert flat_view(layer) is layer
    curved = rolled(layer)
    assert chart_of(curved) is chart_of(curved)


def test_a_closed_surface_is_refused_in_one_line():
    layer = flat_layer()
    corners = np.array([[1.0, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]])
    ball = replace(
        layer,
        points=corners,
        triangles=np.array([[0, 1, 3], [0, 2, 1], [0, 3, 2], [1, 2, 3]]),
        cell=layer.cell[:4],
        nodes=layer.nodes[:4],
        weights=layer.weights[:4],
        loops=(),
        patches={},
        flat=None,
        local_thickness=layer.local_thickness[:4],
    )
    with pytest.raises(InputError, match="cannot be laid flat without a fold") as caught:
        chart_of(ball)
    assert "\n" not in str(caught.value)


def test_the_chart_of_a_flat_layer_is_the_layer():
    (layer,) = Planar(count=1).cut(box_mesh((20.0, 10.0, 2.0), (4, 2, 1)))
    chart = chart_of(layer)
    paths = Toolpaths.from_plane([[[1.0, 1.0], [19.0, 9.0]]], layer)
    assert chart.flat is layer
    assert chart.distortion == 0.0
    assert chart.flattened(paths) is chart.lifted(paths) is paths
    middle, tangent, near = chart.pieces(paths.points, paths.normals)
    assert middle is paths.points
    assert tangent is paths.normals
    assert near.all()
