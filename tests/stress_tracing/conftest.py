import numpy as np
import pytest

from ccfem.elasticity.stress_field import LayerStress
from ccfem.layers import slice_planar
from ccfem.meshing import extrude


def _stressed(section, tensor):
    layer = slice_planar(extrude(section, 1.0, 3.0, 1), count=1)[0]
    stress = np.zeros((3, 3))
    stress[:2, :2] = tensor
    nodal = np.broadcast_to(stress, (len(layer.points), 3, 3))
    return LayerStress(layer, np.broadcast_to(stress, (len(layer.triangles), 3, 3)), nodal, None)


@pytest.fixture(scope="session")
def stressed():
    """Stress on a layer of a section, the same tensor (2, 2) in MPa all over it."""
    return _stressed
