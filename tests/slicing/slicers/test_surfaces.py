"""Layers that another program made: a slanted plane in a box, and files that are none."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import GivenStress
from ccfem.machine import Machine
from ccfem.slicing.layers import stress_on
from ccfem.slicing.slicers import create, surfaces

MESH = box_mesh((20.0, 10.0, 10.0), (10, 5, 5))
UP = (0.0, 0.0, 1.0)


def stress():
    """xx = x + 2 y + 3 z, linear as the nodal stress is."""
    nodal = np.zeros((len(MESH.points), 3, 3))
    nodal[:, 0, 0] = MESH.points @ [1.0, 2.0, 3.0]
    return GivenStress(MESH, nodal[MESH.cells].mean(axis=1), nodal)


def write(folder, name, shift=0.0):
    """A plane z = 2 + x / 4 over the box, of 1 mm squares."""
    x, y = np.meshgrid(np.arange(21.0), np.arange(11.0), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), 2.0 + 0.25 * x.ravel() + shift])
    k = (np.arange(20)[:, None] * 11 + np.arange(10)).ravel()
    triangles = np.concatenate([np.stack([k, k + 11, k + 12], 1), np.stack([k, k + 12, k + 1], 1)])
    lines = [f"v {a:.6f} {b:.6f} {c:.6f}" for a, b, c in points]
    lines += [f"f {a + 1}//{a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
    (folder / name).write_text("# a plane\n" + "\n".join(lines) + "\n")


def test_layers_come_in_the_order_of_their_numbers_with_stress_and_patches(tmp_path):
    write(tmp_path, "20.obj", 1.0)
    write(tmp_path, "3.obj")
    low, high = create("surfaces", {"folder": str(tmp_path)})(stress(), UP, Machine())
    assert (low.index, high.index) == (0, 1)
    assert high.points[:, 2].mean() - low.points[:, 2].mean() == pytest.approx(1.0)
    assert low.flat is None
    assert low.areas.sum() == pytest.approx(20.0 * 10.0 * np.hypot(1.0, 0.25))
    np.testing.assert_allclose(low.normals, np.broadcast_to(low.normals[0], low.normals.shape))
    assert low.normals[0, 2] > 0.9
    assert len(low.loops) == 1
    assert len(low.patches["x_min"]) == 10
    assert len(low.patches["y_max"]) == 20
    found = stress_on(low, stress())
    np.testing.assert_allclose(found.nodal[:, 0, 0], low.points @ [1.0, 2.0, 3.0], atol=1e-9)


def test_layers_face_the_next_one_whichever_way_their_triangles_turn(tmp_path):
    """As those of Fang et al. 2024, whose triangles face the bed and whose waypoints do not."""
    write(tmp_path, "1.obj")
    write(tmp_path, "2.obj", 1.0)
    turned = []
    for line in (tmp_path / "1.obj").read_text().splitlines():
        word, *rest = line.split()
        turned.append(" ".join([word, *(rest[::-1] if word == "f" else rest)]))
    (tmp_path / "1.obj").write_text("\n".join(turned))
    slicer = create("surfaces", {"folder": str(tmp_path)})
    assert all(layer.normals[:, 2].min() > 0.9 for layer in slicer(stress(), UP, Machine()))
    # A layer that is alone faces along the build direction.
    (tmp_path / "2.obj").unlink()
    (alone,) = slicer(stress(), UP, Machine())
    assert alone.normals[:, 2].min() > 0.9


def test_files_are_read_once_for_the_check_and_the_cut_unless_they_change(tmp_path, monkeypatch):
    write(tmp_path, "1.obj")
    read, read_layer = [], surfaces.read_layer
    monkeypatch.setattr(surfaces, "read_layer", lambda file: read.append(file) or read_layer(file))
    slicer = create("surfaces", {"folder": str(tmp_path)})
    slicer.check(MESH, UP, Machine())
    assert len(slicer(stress(), UP, Machine())) == 1
    assert len(read) == 1
    slicer.check(MESH, UP, Machine())
    write(tmp_path, "2.obj", 1.0)
    assert len(slicer(stress(), UP, Machine())) == 2
    assert len(read) == 1 + 1 + 2


def test_points_that_each_triangle_has_of_its_own_are_one(tmp_path):
    write(tmp_path, "1.obj")
    slicer = create("surfaces", {"folder": str(tmp_path)})
    (whole,) = slicer(stress(), UP, Machine())
    apart = whole.points[whole.triangles].reshape(-1, 3)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in apart.tolist()]
    lines += [f"f {k} {k + 1} {k + 2}" for k in range(1, len(apart), 3)]
    lines.append("f 1 1 2")  # no triangle at all
    (tmp_path / "1.obj").write_text("\n".join(lines))
    (layer,) = slicer(stress(), UP, Machine())
    assert len(layer.points) == len(whole.points)
    assert len(layer.loops) == 1
    assert layer.areas.sum() == pytest.approx(whole.areas.sum())


def test_folders_and_files_that_are_none_are_one_line(tmp_path):
    slicer = create("surfaces", {"folder": str(tmp_path)})
    with pytest.raises(InputError, match=r"no \.obj file in the folder"):
        slicer(stress(), UP, Machine())
    write(tmp_path, "1.obj", 50.0)
    with pytest.raises(InputError, match="100 % of the points of layer 0 lie more than 1 mm"):
        slicer(stress(), UP, Machine())
    (tmp_path / "1.obj").write_text("v 1 2\nf 1 2 3\n")
    with pytest.raises(InputError, match="is no OBJ file of triangles"):
        slicer(stress(), UP, Machine())
    corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    (tmp_path / "1.obj").write_text(corners + 3 * "f 1 2 3 4\n")
    with pytest.raises(InputError, match="is no OBJ file of triangles"):
        slicer(stress(), UP, Machine())
    (tmp_path / "1.obj").write_text(corners.replace("v 1 1 0", "v 1 nan 0") + "f 1 2 3\n")
    with pytest.raises(InputError, match="points that are not finite"):
        slicer(stress(), UP, Machine())
    (tmp_path / "1.obj").write_text(corners + "f 1 1 2\n")
    with pytest.raises(InputError, match="has no triangle of three points: export it again"):
        slicer(stress(), UP, Machine())
    (tmp_path / "1.obj").write_text("v 1 2 3\nf 1 2 3\n")
    with pytest.raises(InputError, match="has no triangles, or they name points"):
        slicer(stress(), UP, Machine())
