"""Measures of layers and strands, on sheets that are known."""

import numpy as np
import pytest

from ccfem.body.mesh import box_mesh
from ccfem.body.mesh.patches import Cylinder
from ccfem.papers.zhang_2025.contents import angles_to_axes
from ccfem.slicing.slicers import Planar


def test_flat_layers_stand_at_the_angle_of_the_axis():
    """Layers across z, and holes along z, along a direction 10 degrees off it, and beside them."""
    layers = Planar(count=2).cut(box_mesh((24.0, 12.0, 10.0), (16, 8, 7)))
    turned = (np.sin(np.radians(10.0)), 0.0, np.cos(np.radians(10.0)))
    # The border of the box stands for a wall: it lies at 6 mm from an axis through its middle.
    holes = {
        "along": Cylinder((12.0, 6.0, 5.0), "z", 6.0),
        "turned": Cylinder((12.0, 6.0, 5.0), turned, 6.0),
        "beside": Cylinder((80.0, 6.0, 5.0), "z", 6.0),
    }
    angles = angles_to_axes(layers, holes, 2.2)
    assert angles["along"] == pytest.approx(0.0, abs=1e-6)
    assert angles["turned"] == pytest.approx(10.0, abs=1e-6)
    assert np.isnan(angles["beside"])
