"""Several solids in a CAD file: said, joined where they touch, faces numbered as in the file."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.meshing.cad import mesh_cad, read_cad
from ccfem.cases.inspection import check
from ccfem.cases.part_keys import Body
from ccfem.fem.elasticity import solve

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


def test_separate_solids_keep_their_faces_and_pass_no_force(step, tmp_path):
    path = step((0, 0, 0, 10, 10, 10), (10, 0, 0, 10, 10, 10))
    part = f'''
surface = "{path.name}"
edge_length = 5.0
joined = "separate"
order = 2
material = {{ modulus = 1000.0, poisson = 0.0 }}
[[supports]]
patch = "face_1"
[[supports]]
patch = "face_8"
[[loads.pull]]
kind = "force"
patch = "face_2"
vector = [200, 0, 0]
'''
    (tmp_path / "part.toml").write_text(part)
    checked = check(tmp_path / "part.toml")
    assert "2 pieces" in checked.known
    assert any("each a piece of its own that passes no force" in line for line in checked.warnings)
    case = checked.case
    assert set(case.body.numbers) == set(range(1, 13))
    # The first box is stretched by F L / E A; the second one stays as it is. Glued, half as much.
    field = solve(case.problem)["pull"]
    end = np.isclose(field.mesh.points[:, 0], 20.0)
    assert field.on("face_2").displacement[:, 0] == pytest.approx(200.0 * 10.0 / (1000.0 * 100.0))
    np.testing.assert_allclose(field.displacement[end], 0.0, atol=1e-12)
    with pytest.raises(InputError, match="joined goes with a CAD file"):
        Body(mesh="a.msh", joined="separate").check(tmp_path)
