"""Pictures at the head of a file, read back as firmware does."""

import base64
import io
import re

import numpy as np
import pytest
import shapely
from PIL import Image
from scipy.spatial.transform import Rotation

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.machine import Machine, updated
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.gcode import gcode
from ccfem.printing.print_plan import plan_print
from ccfem.slicing.slicers.planar import Planar

SIZE = (60.0, 20.0, 12.0)
PICTURE = re.compile(r"; thumbnail begin[;/\+=\w\s]+?; thumbnail end")
"""As Moonraker finds pictures in files (file_manager/metadata.py)."""


def box_text(thumbnails):
    machine = updated(Machine(), {"gcode": {"thumbnails": thumbnails}})
    mesh = box_mesh(SIZE, (4, 2, 2))
    layers = Planar(heights=(6.0,)).cut(mesh)
    line = Toolpaths.from_plane([np.array([[2.0, 10.0], [58.0, 10.0]])], layers[0])
    return gcode(plan_print(line, layers, mesh, machine), machine)


def pictures(text):
    """Size that is said, and picture, of each."""
    found = []
    for block in PICTURE.findall(text):
        first, *lines, _ = [line.lstrip("; ") for line in block.split("\n")]
        width, height, length = map(int, re.findall(r"\d+", first))
        data = "".join(lines)
        assert len(data) == length
        found.append(((width, height), Image.open(io.BytesIO(base64.b64decode(data)))))
    return found


def test_pictures_show_the_outline_of_the_part_and_change_nothing_else():
    text = box_text(["300x200", "32x32"])
    found = pictures(text)
    assert [size for size, _ in found] == [(300, 200), (32, 32)]
    assert all(picture.size == size and picture.mode == "RGBA" for size, picture in found)
    assert PICTURE.sub("", text).replace("\n\n\n", "\n") == box_text([])
    # A box that is turned by hand: 30 degrees about the vertical, then tilted to the eye.
    corners = np.array(list(np.ndindex(2, 2, 2))) * SIZE
    turned = Rotation.from_euler("zx", [-30.0, -55.0], degrees=True).apply(corners)
    hull = shapely.convex_hull(shapely.MultiPoint(turned[:, :2] * [1.0, -1.0]))
    drawn = np.array(found[0][1])[..., 3] > 127
    rows, columns = np.nonzero(drawn)
    low, high = (np.array([end(columns), end(rows)]) for end in (np.min, np.max))
    left, top, right, bottom = hull.bounds
    scale = (high - low + 1.0) / [right - left, bottom - top]
    assert scale[0] == pytest.approx(scale[1], rel=0.03)
    y, x = np.indices(drawn.shape)
    inside = shapely.contains_xy(
        hull, left + (x - low[0] + 0.5) / scale[0], top + (y - low[1] + 0.5) / scale[1]
    )
    assert (inside != drawn).sum() < 0.03 * inside.sum()


@pytest.mark.parametrize("size", ["300", "8x8", "300x2000", "axb", "300x200x3"])
def test_sizes_that_make_no_sense_are_refused(size):
    with pytest.raises(InputError, match="300x200"):
        updated(Machine(), {"gcode": {"thumbnails": [size]}})
