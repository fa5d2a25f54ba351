"""Layers rebuilt from strands, and the measures of both, on sheets that are known."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.body.mesh.patches import Cylinder
from ccfem.papers.zhang_2025.authors import authors_strands, rebuilt_layers, strands_on
from ccfem.papers.zhang_2025.measures import angles_to_axes
from ccfem.slicing.slicers import Planar

MESH = box_mesh((24.0, 12.0, 10.0), (16, 8, 7))
BEND = 0.008
"""Height of the sheets over x^2, 1/mm."""


def sheet(x, height):
    return height + BEND * (x - 12.0) ** 2


def write(folder, number, height):
    """Strands along x, 1.1 mm apart, on a bent sheet, as the data set has them: pairs of points."""
    x = np.linspace(0.5, 23.5, 40)
    rows = []
    for y in np.arange(0.7, 11.5, 1.1):
        ends = np.stack([x[:-1], x[1:]], axis=1).ravel()
        places = zip(ends, sheet(ends, height), strict=True)
        rows += [f"v {a:.6f} {y:.6f} {b:.6f}" for a, b in places]
    rows += [f"l {k + 1} {k + 2}" for k in range(0, len(rows), 2)]
    (folder / f"{number}_C{number}_M_0.obj").write_text("\n".join(rows) + "\n")


def test_layers_are_rebuilt_from_the_strands_on_them(tmp_path):
    for number, height in ((3, 4.0), (20, 5.0), (4, 4.5)):
        write(tmp_path, number, height)
    strands = authors_strands(tmp_path)
    layers = rebuilt_layers(MESH, strands, 0.5)
    assert len(layers) == 3
    for layer, height in zip(layers, (4.0, 4.5, 5.0), strict=True):
        # A plane over 1.5 mm of a sheet of radius 62 mm lies within hundredths of it.
        away = layer.points[:, 2] - sheet(layer.points[:, 0], height)
        assert np.abs(away).max() < 0.05
        # Length of a parabola of slope s at its ends, 24 mm across, times 12 mm.
        s = 2.0 * BEND * 12.0
        length = 12.0 * (np.hypot(1.0, s) + np.arcsinh(s) / s)
        assert layer.areas.sum() == pytest.approx(12.0 * length, rel=0.01)
        assert layer.normals[:, 2].min() > 0.9  # towards the next layer
    moved = strands_on(layers, strands)
    np.testing.assert_array_equal(np.bincount(moved.layer), [10, 10, 10])
    np.testing.assert_allclose(moved.lengths, strands.lengths, rtol=1e-3)


def test_one_layer_alone_is_refused(tmp_path):
    write(tmp_path, 1, 4.0)
    with pytest.raises(InputError, match="two or more; got 1"):
        rebuilt_layers(MESH, authors_strands(tmp_path), 0.5)


def test_flat_layers_stand_at_the_angle_of_the_axis():
    """Layers across z, and holes along z, along a direction 10 degrees off it, and beside them."""
    layers = Planar(count=2).cut(MESH)
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
