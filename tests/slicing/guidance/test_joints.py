"""Joints: walls of holes, and their axes."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.body.mesh.patches import Cylinder, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.slicing.guidance.joints import joint_of


def test_an_axis_that_the_wall_contradicts_is_not_taken():
    """A plate with a bore along z, turned by 90 degrees about x after its patch was named."""
    outline = shapely.box(0.0, 0.0, 30.0, 30.0).difference(shapely.Point(15, 15).buffer(5.0))
    mesh = patches_from_rules(
        extrude(outline, 4.0, 3.0), {"bore": Cylinder((15.0, 15.0, 0.0), "z", 5.0)}
    )
    assert joint_of(mesh, "bore").direction == pytest.approx([0.0, 0.0, 1.0])
    x, y, z = mesh.points.T
    turned = replace(mesh, points=np.column_stack([x, -z, y]))
    assert np.abs(joint_of(turned, "bore").direction) == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)
