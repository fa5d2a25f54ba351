"""Support below parts whose hollow is known: a bridge, a wedge, a part above a part."""

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.body.meshing import extrude
from ccfem.printing.support import support_columns

UP = (0.0, 1.0, 0.0)
"""Outlines in x and y are extruded along z and printed along y."""


def extruded(outline):
    return extrude(shapely.Polygon(outline), 6.0, 3.0)


def test_a_bridge():
    """Piers 5 mm wide, 10 mm high, 20 mm apart, 6 mm deep."""
    bridge = shapely.box(0.0, 0.0, 30.0, 14.0).difference(shapely.box(5.0, 0.0, 25.0, 10.0))
    mesh = extruded(bridge.exterior.coords)
    found = support_columns(mesh, UP, angle=45.0)
    assert found.volume == pytest.approx(20.0 * 10.0 * 6.0, rel=0.02)
    assert found.contact == pytest.approx(20.0 * 6.0, rel=1e-9)
    assert found.standing == 0.0
    assert support_columns(mesh, UP).volume == pytest.approx(found.volume)
    lifted = support_columns(mesh, UP, lift=2.0)
    # 2 mm more below all of it, the piers too.
    assert lifted.volume == pytest.approx(found.volume + 2.0 * 30.0 * 6.0, rel=0.02)
    assert lifted.contact == pytest.approx(30.0 * 6.0, rel=1e-9)
    # Upside down it stands on its deck, and nothing hangs over.
    down = support_columns(mesh, (0.0, -1.0, 0.0))
    assert (down.volume, down.contact) == (0.0, 0.0)


@pytest.mark.parametrize("degrees", [30.0, 60.0])
def test_a_wedge_is_carried_from_its_angle_on(degrees):
    """A roof that leans over by an angle from upright, 12 mm high."""
    reach = 12.0 * np.tan(np.radians(degrees))
    mesh = extruded([(0.0, 0.0), (4.0, 0.0), (4.0 + reach, 12.0), (0.0, 12.0)])
    found = support_columns(mesh, UP, angle=degrees - 1.0, pitch=0.1)
    assert found.volume == pytest.approx(0.5 * 12.0 * reach * 6.0, rel=0.02)
    assert found.contact == pytest.approx(np.hypot(12.0, reach) * 6.0, rel=1e-6)
    assert support_columns(mesh, UP, angle=degrees + 1.0).volume == 0.0


def test_a_part_above_a_part_stands_on_it():
    """A shelf 6 mm above a foot, both 15 mm long and 6 mm deep, on a wall at their ends."""
    shelf = shapely.box(0.0, 0.0, 20.0, 12.0).difference(shapely.box(5.0, 3.0, 20.0, 9.0))
    found = support_columns(extruded(shelf.exterior.coords), UP)
    assert found.volume == pytest.approx(15.0 * 6.0 * 6.0, rel=0.02)
    assert found.contact == pytest.approx(15.0 * 6.0, rel=1e-9)
    assert found.standing == pytest.approx(15.0 * 6.0, rel=0.03)
    assert found.on_part.all()


def test_a_block_on_edge():
    """Turned by 45 degrees a bar of 6 x 6 mm needs two prisms below: 6^2 / 2 in section."""
    mesh = box_mesh((10.0, 6.0, 6.0), (5, 3, 3))
    found = support_columns(mesh, (0.0, 1.0, 1.0), pitch=0.1)
    assert found.volume == pytest.approx(10.0 * 18.0, rel=0.02)
    assert found.contact == pytest.approx(2.0 * 60.0, rel=1e-9)


def test_what_cannot_be_is_said():
    mesh = box_mesh((10.0, 6.0, 6.0), (1, 1, 1))
    with pytest.raises(InputError, match="angle must be"):
        support_columns(mesh, angle=90.0)
    with pytest.raises(InputError, match="give a larger pitch"):
        support_columns(mesh, pitch=1e-4)
