"""Meshed support below parts whose hollow is known, and its layers, flat or tilted."""

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.meshing import extrude
from ccfem.machine import Machine
from ccfem.printing.support import column_mesh, support_field, support_layers, support_paths
from ccfem.slicing.slicers import Planar

UP = (0.0, 1.0, 0.0)
"""Outlines in x and y are extruded along z and printed along y."""


def extruded(outline):
    return extrude(shapely.Polygon(outline), 6.0, 3.0)


@pytest.fixture(scope="module")
def bridge():
    """Piers 5 mm wide, 10 mm high, 20 mm apart, 6 mm deep."""
    outline = shapely.box(0.0, 0.0, 30.0, 14.0).difference(shapely.box(5.0, 0.0, 25.0, 10.0))
    return extruded(outline.exterior.coords)


@pytest.mark.parametrize(("lift", "volume"), [(0.0, 1200.0), (2.0, 1560.0)])
def test_the_space_below_a_bridge(bridge, lift, volume):
    """20 x 10 x 6 mm, and lifted 30 x 2 x 6 mm more."""
    found = column_mesh(bridge, UP, lift=lift)
    assert found.volume == pytest.approx(volume, rel=1e-9)
    assert found.contact == pytest.approx(180.0 if lift else 120.0, rel=1e-9)
    assert found.standing == 0.0
    assert found.mesh.flaw == ""
    if not lift:
        # Conforming: no face but those round the block is of one cell alone.
        border, _ = found.mesh.facet_areas(found.mesh.boundary)
        assert border.sum() == pytest.approx(2.0 * (200.0 + 120.0 + 60.0), rel=1e-9)
    # It shares the part's faces, node by node.
    shared = found.mesh.patches["part"]
    np.testing.assert_allclose(
        found.mesh.points[shared], bridge.points[found.node[shared]], atol=1e-9
    )


@pytest.mark.parametrize(("drop", "count"), [(12.0, 5), (0.5, 2)])
def test_cells_of_a_column_grow_downwards(drop, count):
    """Each is half as high again as the one above; none of the first is higher than 1 mm."""
    found = column_mesh(box_mesh((4.0, 4.0, 4.0), (2, 2, 2)), lift=drop, size=1.0)
    levels = np.unique(found.mesh.points[:, 2].round(9))[::-1]
    shares = 1.5 ** np.arange(count)
    np.testing.assert_allclose(-np.diff(levels), drop * shares / shares.sum(), rtol=1e-6)


@pytest.mark.parametrize("degrees", [30.0, 60.0])
def test_the_space_below_a_wedge(degrees):
    """A roof that leans over by an angle from upright, 12 mm high."""
    reach = 12.0 * np.tan(np.radians(degrees))
    mesh = extruded([(0.0, 0.0), (4.0, 0.0), (4.0 + reach, 12.0), (0.0, 12.0)])
    found = column_mesh(mesh, UP, angle=degrees - 1.0)
    assert found.volume == pytest.approx(0.5 * 12.0 * reach * 6.0, rel=1e-9)
    assert found.contact == pytest.approx(np.hypot(12.0, reach) * 6.0, rel=1e-9)
    with pytest.raises(InputError, match="needs no support"):
        column_mesh(mesh, UP, angle=degrees + 1.0)


def test_a_part_above_a_part_is_propped_on_it():
    """A shelf 6 mm above a foot, both 15 mm long and 6 mm deep, on a wall at their ends."""
    shelf = shapely.box(0.0, 0.0, 20.0, 12.0).difference(shapely.box(5.0, 3.0, 20.0, 9.0))
    mesh = extruded(shelf.exterior.coords)
    found = column_mesh(mesh, UP)
    assert found.volume == pytest.approx(15.0 * 6.0 * 6.0, rel=1e-9)
    assert found.standing == pytest.approx(15.0 * 6.0, rel=1e-9)
    assert not found.on_bed.any()
    # A field of the part is met on both sides.
    height = mesh.points @ np.array([0.3, 1.0, 0.2])
    own = found.mesh.points @ np.array([0.3, 1.0, 0.2])
    ends = (found.node >= 0) | (found.below[:, 0] >= 0)
    np.testing.assert_allclose(
        support_field(found, height, 1.0, 0.5, 0.0).values[ends], own[ends], atol=1e-9
    )


def test_flat_layers_go_on_at_equal_heights(bridge):
    """Layers of 0.5 mm below a bridge, and 2 mm more below all of it."""
    layers = Planar(thickness=0.5).cut(bridge, UP)
    found = support_layers(bridge, layers, UP)
    heights = [layer.points[:, 1] for layer in found.layers]
    assert len(heights) == 20
    for k, height in enumerate(heights):
        np.testing.assert_allclose(height, 0.25 + 0.5 * k, atol=1e-9)
    np.testing.assert_array_equal(found.before, np.arange(20))
    for layer in found.layers:
        assert layer.areas.sum() == pytest.approx(20.0 * 6.0, rel=1e-3)
    assert found.thickness == pytest.approx(0.5, rel=1e-9)
    # Rings of a rectangle, a width apart from half a width inside, while their sides are apart.
    machine = Machine()
    paths = support_paths(found, machine, spacing=1.0)
    off = (np.arange(20) + 0.5) * machine.matrix_width
    off = off[6.0 - 2.0 * off > machine.matrix_width]
    round_ = (2.0 * (20.0 + 6.0 - 4.0 * off)).sum()
    assert paths.lengths.sum() == pytest.approx(20.0 * round_, rel=0.03)  # corners are round
    np.testing.assert_array_equal(np.unique(paths.layer), np.arange(20))
    lifted = support_layers(bridge, layers, UP, angle=0.0, lift=2.0)
    heights = [float(layer.points[:, 1].mean()) for layer in lifted.layers]
    np.testing.assert_allclose(heights, -1.75 + 0.5 * np.arange(24), atol=1e-9)
    np.testing.assert_array_equal(lifted.before, np.maximum(np.arange(24) - 4, 0))
    assert len(lifted.layers_before(0)) == 5


def test_layers_of_a_tilted_field_meet_those_of_the_part_and_end_flat():
    """A block whose layers tilt by 5 degrees, 4 mm above the bed."""
    mesh = box_mesh((20.0, 6.0, 6.0), (10, 3, 3))
    tilt = np.radians(5.0)
    field = mesh.points @ np.array([-np.sin(tilt), 0.0, np.cos(tilt)])
    layers = Planar(thickness=0.5).cut(mesh)
    with pytest.raises(InputError, match="slice_with_support"):
        support_layers(mesh, [Tilted(layer) for layer in layers], field=None)
    found = support_layers(mesh, layers, field=field, step=0.5, angle=0.0, lift=4.0)
    columns = found.columns
    shared = columns.node >= 0
    np.testing.assert_allclose(found.field.values[shared], field[columns.node[shared]], atol=0.0)
    assert found.field.inverted == 0.0
    bed = columns.mesh.points[:, 2] < -4.0 + 1e-9
    np.testing.assert_allclose(found.field.values[bed], found.field.bed, atol=1e-12)
    # The bed lies whole steps below the part's first layer, whose lower side is half a step down.
    first = float(np.median(layers[0].interpolate(field))) - 0.25
    assert (first - found.field.bed) / 0.5 == pytest.approx(round((first - found.field.bed) / 0.5))
    # Maximum principle: a harmonic field has no extremes but on its border.
    inner = ~shared & ~bed
    assert found.field.values[inner].max() < field.max()
    assert found.field.values[inner].min() > found.field.bed
    with pytest.raises(InputError, match="upside down"):
        support_layers(mesh, layers, field=field, step=0.5, angle=0.0, lift=0.2)


class Tilted:
    """A layer that is said to be curved."""

    flat = None

    def __init__(self, layer):
        self.thickness = layer.thickness


def test_a_roof_whose_edge_stands_on_the_bed():
    """Rounding holds that edge 1e-12 mm above the bed: no cells without volume below it."""
    mesh = extruded([(0.0, 0.0), (4.0, 0.0), (24.0, 12.0), (0.0, 12.0)])
    points = np.array(mesh.points)
    points[(points[:, 1] == 0.0) & (points[:, 0] == 4.0), 1] = 1e-12
    found = column_mesh(TetMesh(points, mesh.cells), UP)
    assert found.volume == pytest.approx(0.5 * 20.0 * 12.0 * 6.0, rel=1e-9)
    assert found.mesh.volumes.min() > 1e-3
