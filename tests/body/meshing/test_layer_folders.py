"""A folder of layers becomes the surface of the solid that they fill, for a mesher."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.body.meshing import mesh_body
from ccfem.body.meshing.volume import fidelity
from ccfem.cli.part_commands import _mesh as mesh_file
from ccfem.slicing.slicers import Planar

BOX = box_mesh((12.0, 8.0, 4.0), (4, 3, 2))


def test_layers_of_a_box_are_meshed_as_the_box(tmp_path, monkeypatch, capsys):
    """fTetWild, which takes seconds, is replaced by the mesh of the box."""

    def fill(surface, edge_length, mesher):
        assert (edge_length, mesher) == (3.0, "ftetwild")
        np.testing.assert_allclose(np.ptp(surface.points, axis=0), [12.0, 8.0, 4.0], atol=0.2)
        return BOX, fidelity(surface, BOX), "fTetWild"

    monkeypatch.setenv("CCFEM_CACHE", "")
    monkeypatch.setattr("ccfem.body.meshing.meshed_body.fill", fill)
    for layer in Planar(count=5).cut(BOX):
        lines = [f"v {x} {y} {z}" for x, y, z in 0.1 * layer.points]
        lines += [f"f {a} {b} {c}" for a, b, c in layer.triangles + 1]
        (tmp_path / f"{100 * layer.index}.obj").write_text("\n".join(lines))
    mesh_file(tmp_path, 3.0, tmp_path / "box.npz", 10.0, "auto")  # given in cm
    said = capsys.readouterr().out
    assert "5 layers, 0.8 mm apart, fill 38" in said  # of 384 mm^3
    assert "meshed by fTetWild: volume 0." in said
    assert (tmp_path / "box.npz").exists()


def test_folders_without_layers_are_one_line(tmp_path):
    with pytest.raises(InputError, match=r"no \.obj file in the folder"):
        mesh_body(tmp_path, 3.0)
