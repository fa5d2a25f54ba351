import numpy as np
import pytest

from ccfem.body.meshing import extrude
from ccfem.slicing.layers import LayerStress
from ccfem.slicing.slicers.planar import Planar


def _stressed(section, tensor):
    layer = Planar(count=1).cut(extrude(section, 1.0, 3.0, 1))[0]
    nodal = np.zeros((len(layer.points), 3, 3))
    nodal[:, :2, :2] = tensor(layer.plane.points) if callable(tensor) else tensor
    return LayerStress(layer, nodal[layer.triangles].mean(axis=1), nodal)


@pytest.fixture(scope="session")
def stressed():
    """Stress on a layer of a section, MPa: one tensor (2, 2), or a function of points (n, 2)."""
    return _stressed
