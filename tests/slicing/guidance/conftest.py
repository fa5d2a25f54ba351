"""A plate with a hole, and directions across a known gradient."""

import numpy as np
import pytest
import shapely

from ccfem.body.mesh.patches import Cylinder, patches_from_rules
from ccfem.body.meshing import extrude


@pytest.fixture(scope="session")
def plate():
    """60 x 30 x 8 mm with holes of 5 mm radius at x = 15 and 45 along z."""
    outline = shapely.box(0.0, 0.0, 60.0, 30.0)
    for x in (15.0, 45.0):
        outline = outline.difference(shapely.Point(x, 15.0).buffer(5.0, quad_segs=16))
    mesh = extrude(outline, 8.0, 2.5)
    rules = {
        "left": Cylinder((15.0, 15.0, 0.0), "z", 5.0),
        "right": Cylinder((45.0, 15.0, 0.0), "z", 5.0),
        "half": Cylinder((45.0, 15.0, 0.0), "z", 5.0, half="x"),
    }
    return patches_from_rules(mesh, rules)


@pytest.fixture
def square_to():
    """Unit vectors square to given ones, turned about them at random."""

    def make(gradient: np.ndarray) -> np.ndarray:
        rng = np.random.default_rng(3)
        any_ = rng.normal(size=gradient.shape)
        across = np.cross(gradient, any_)
        return across / np.linalg.norm(across, axis=1)[:, None]

    return make
