import io

import numpy as np
import pytest
from PIL import Image

from ccfem.errors import InputError
from ccfem.mesh.box import box_mesh
from ccfem.plot.shape import shape_picture


def test_the_shape_is_rendered_from_every_side():
    mesh = box_mesh((30.0, 10.0, 4.0), (3, 1, 1))
    sides = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    try:
        picture = shape_picture(mesh, sides, size=(200, 150))
    except InputError as refused:
        pytest.skip(str(refused))
    image = np.asarray(Image.open(io.BytesIO(picture))).astype(int)
    assert image.shape == (150, 400, 3)
    inked = image.min(axis=2) < 250
    for part, (width, height) in ((inked[:, :200], (30, 10)), (inked[:, 200:], (4, 10))):
        rows, columns = np.nonzero(part)
        assert np.ptp(columns) / np.ptp(rows) == pytest.approx(width / height, rel=0.15)
