"""Part files to start from: cells that fit the walls, and something to hold and to pull."""

import numpy as np
import pytest
import pyvista

import ccfem
from ccfem.base.toml import read_toml
from ccfem.cases.inspection.beginning import new_part


def part_of(shell, folder):
    shell.triangulate().save(folder / "body.stl")
    return new_part(folder / "body.stl", folder / "part.toml")


@pytest.mark.parametrize(
    ("size", "edge"),
    [
        # 2 V / A of the plates, or what fills them with 100,000 cells; a 25th of the diagonal.
        ((100.0, 60.0, 3.2), 2.95),
        ((400.0, 300.0, 1.0), 2.17),
        ((20.0, 20.0, 20.0), 1.39),
    ],
)
def test_cells_are_no_longer_than_walls_are_thick(tmp_path, size, edge):
    x, y, z = size
    path = part_of(pyvista.Box((0.0, x, 0.0, y, 0.0, z)), tmp_path)
    assert read_toml(path, "part file")["edge_length"] == edge


def test_a_body_of_one_face_is_held_and_pulled_at_its_ends(tmp_path):
    path = part_of(pyvista.Icosphere(radius=30.0, nsub=3), tmp_path)
    case = ccfem.read(path)
    mesh = case.problem.mesh
    # A cap of a sphere that is 15 % of its height has 15 % of its area (Archimedes).
    sides = mesh.points[mesh.boundary]
    areas = np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1)
    for name, up in (("held", -1.0), ("pulled", 1.0)):
        corners = mesh.points[mesh.patch(name)]
        own = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert np.linalg.norm(own, axis=1).sum() == pytest.approx(0.15 * areas.sum(), rel=0.25)
        assert (up * own[:, 2]).min() > 0.0
    assert case.problem.loads["pull"][0].vector == (0.0, 0.0, 100.0)
    assert not ccfem.check(case).mistakes
