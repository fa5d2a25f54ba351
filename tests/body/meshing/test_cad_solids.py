"""Several solids in a CAD file: said, joined where they touch, faces numbered as in the file."""

import numpy as np
import pytest

from ccfem.body.meshing.cad import mesh_cad, read_cad

gmsh = pytest.importorskip("gmsh")

SIDES = [(axis, end) for axis in range(3) for end in (0, 1)]
"""Faces of a box in the order in which Open CASCADE makes them and writes them."""


@pytest.fixture
def step(tmp_path):
    """Write boxes, each by a corner and its size, to a STEP file."""

    def write(*boxes):
        path = tmp_path / "solids.step"
        gmsh.initialize(interruptible=False)
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            for box in boxes:
                gmsh.model.occ.addBox(*box)
            gmsh.model.occ.synchronize()
            gmsh.write(str(path))
        finally:
            gmsh.finalize()
        return path

    return write


def sides_of(boxes, number):
    """Axis and place of the face with this number in a file of boxes."""
    box = boxes[(number - 1) // 6]
    axis, end = SIDES[(number - 1) % 6]
    return axis, box[axis] + end * box[3 + axis]


@pytest.mark.parametrize(
    ("second", "inside"),
    [
        ((10, 0, 0, 10, 10, 10), {2, 7}),  # face to face
        ((10, 2, 2, 10, 5, 5), {7}),  # on a part of a face
        ((20, 0, 0, 10, 10, 10), set()),
    ],
)
def test_faces_keep_their_numbers_where_solids_touch(step, second, inside):
    boxes = [(0, 0, 0, 10, 10, 10), second]
    path = step(*boxes)
    cad = read_cad(path)
    outside = set(range(1, 13)) - inside
    assert set(cad.face.tolist()) == outside
    mesh, (_, said) = mesh_cad(path, 4.0)
    assert mesh.volumes.sum() == pytest.approx(sum(np.prod(box[3:]) for box in boxes))
    assert said.startswith("2 solids in the file, of one material and joined where they touch: ")
    assert set(mesh.patches) == {f"face_{number}" for number in outside}
    for number in outside:
        axis, place = sides_of(boxes, number)
        for points, facets in (
            (cad.surface.points, cad.surface.triangles[cad.face == number]),
            (mesh.points, mesh.patches[f"face_{number}"]),
        ):
            np.testing.assert_allclose(points[facets][..., axis], place, atol=1e-9)
    covered = sum(mesh.facet_areas(facets)[0].sum() for facets in mesh.patches.values())
    assert covered == pytest.approx(mesh.facet_areas(mesh.boundary)[0].sum())


def test_one_solid_is_no_matter(step):
    mesh, said = mesh_cad(step((0, 0, 0, 10, 10, 10)), 4.0)
    assert len(said) == 1
    assert len(mesh.patches) == 6
