"""How far a mesh is said to lie from the surface that it was made from."""

import numpy as np
import pytest
import shapely

from ccfem.body.files.surface import Surface
from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing.planform import extrude
from ccfem.body.meshing.volume import fidelity, fill, overlap_of

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
    mesh = plate_mesh()
    found = fidelity(Surface(mesh.points, mesh.boundary), mesh)
    assert found.deviation < 1e-9
    assert found.good
    assert "boundaries within 0.001 mm" in found.about("a mesher")


def test_chords_of_a_hole_deviate_by_their_height():
    """The mesh has 24 chords on a hole of radius 3 mm, and the surface 80: its corners alone lie
    on the top and the bottom of the mesh."""
    found = fidelity(plate_surface(), plate_mesh())
    assert found.deviation == pytest.approx(3.0 * (1.0 - np.cos(np.pi / 24)), abs=3e-3)


def test_the_largest_distance_counts():
    mesh = plate_mesh()
    points = mesh.points.copy()
    top = points[:, 2] == HEIGHT
    points[top, 2] += 0.25
    assert fidelity(plate_surface(), TetMesh(points, mesh.cells)).deviation == pytest.approx(0.25)


def boxes(*bounds):
    """Surface of boxes by least and largest coordinates and a sense, which is -1 for a cavity."""
    points, triangles = [], []
    for low, high, sense in bounds:
        box = box_mesh(np.subtract(high, low), (1, 1, 1))
        triangles.append(box.boundary[:, ::sense] + sum(map(len, points)))
        points.append(box.points + low)
    return Surface(np.concatenate(points), np.concatenate(triangles))


LONG = ((0, 0, 0), (20, 10, 4), 1)


@pytest.mark.parametrize(
    ("other", "twice"),
    [
        (((10, 0, 0), (30, 10, 4), 1), 400.0),
        (((10, -3, 1), (30, 13, 3), 1), 200.0),
        (LONG, 800.0),
        (((5, 3, 1), (15, 7, 3), 1), 80.0),
        (((5, 3, 1), (15, 7, 3), -1), 0.0),
        (((20, 0, 0), (30, 10, 4), 1), 0.0),
        (((25, 0, 0), (30, 10, 4), 1), 0.0),
    ],
)
def test_what_shells_hold_twice_is_counted(other, twice):
    surface = boxes(LONG, other)
    assert overlap_of(surface) * surface.volume == pytest.approx(twice, abs=0.02 * surface.volume)
    assert (overlap_of(surface) > 0.0) == (twice > 0.0)
    assert overlap_of(plate_surface()) == 0.0


def test_overlapping_shells_are_united():
    mesh, fit, _ = fill(boxes(LONG, ((10, 0, 0), (30, 10, 4), 1)), 3.0, "ftetwild")
    assert mesh.volumes.sum() == pytest.approx(1200.0, rel=1e-3)
    assert abs(fit.volume) < 0.01
    assert fit.deviation < 0.05
    (said,) = fit.doubts
    assert said.startswith("shells of the surface overlap in 24.7% of their volume and are united")


def test_a_slit_that_is_closed_is_said():
    """0.1 mm is less than twice the envelope of 0.17 mm, and the middle of its walls is far."""
    slit = shapely.box(0, 0, 160, 60).difference(shapely.box(79.95, 20, 80.05, 60))
    source = extrude(slit, 4.0, 6.0)
    surface = Surface(source.points, source.boundary)
    _, fit, _ = fill(surface, 6.0, "ftetwild")
    assert 4.0 * fit.envelope < fit.deviation < 2.1
    (said,) = fit.doubts
    assert said.endswith("thinner than 0.34 mm may be lost: widen them, or take mesher = 'gmsh'")
    pytest.importorskip("gmsh")
    mesh, fit, who = fill(surface, 6.0)
    assert (who, fit.doubts) == ("Gmsh", ())
    assert mesh.volumes.sum() == pytest.approx(surface.volume)
