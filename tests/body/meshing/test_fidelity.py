"""How far a mesh is said to lie from the surface that it was made from."""

import numpy as np
import pytest
import shapely

from ccfem.body.files.surface import Surface
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing.planform import extrude
from ccfem.body.meshing.volume import fidelity

HEIGHT = 6.0


def rings(count=80):
    """Hole and border of a plate of 60 x 60 mm, with as many points each."""
    angle = 2.0 * np.pi * np.arange(count) / count
    round_ = np.column_stack([np.cos(angle), np.sin(angle)])
    return 3.0 * round_, 30.0 * round_ / np.abs(round_).max(axis=1)[:, None]


def plate_surface():
    """The plate as a CAD program writes it: walls of the hole are small, all else is long."""
    count = len(rings()[0])
    levels = [np.column_stack([ring, np.full(count, z)]) for z in (0, HEIGHT) for ring in rings()]
    low_hole, low_border, high_hole, high_border = (np.arange(count) + k * count for k in range(4))

    def strip(left, right):
        ahead, across = np.roll(left, -1), np.roll(right, -1)
        return [np.column_stack([left, ahead, right]), np.column_stack([ahead, across, right])]

    triangles = np.concatenate(
        strip(low_hole, low_border)
        + strip(low_border, high_border)
        + strip(high_border, high_hole)
        + strip(high_hole, low_hole)
    )
    return Surface(np.concatenate(levels), triangles)


def plate_mesh(edge_length=2.0):
    hole, border = rings()
    return extrude(shapely.Polygon(border, [hole]), HEIGHT, edge_length)


def test_a_mesh_whose_boundary_is_the_surface_does_not_deviate():
    found = fidelity(plate_surface(), plate_mesh())
    assert found.deviation < 1e-9
    assert found.good
    assert "boundaries within 0.001 mm" in found.about("a mesher")


def test_the_largest_distance_counts():
    mesh = plate_mesh()
    points = mesh.points.copy()
    top = points[:, 2] == HEIGHT
    points[top, 2] += 0.25
    assert fidelity(plate_surface(), TetMesh(points, mesh.cells)).deviation == pytest.approx(0.25)
