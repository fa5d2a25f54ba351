"""Part files to start from, and what to cite."""

import numpy as np
import pytest
import shapely

from ccfem.body.files import write_mesh
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.body.meshing import extrude
from ccfem.cases.inspection import check
from ccfem.cases.part_file import read_part


def test_a_body_is_no_part_and_a_new_part_file_is_one(ccfem, tmp_path):
    write_mesh(box_mesh((60.0, 24.0, 4.0), (6, 3, 2)), tmp_path / "lever.npz")
    code, _, err = ccfem("compare", "lever.npz")
    assert (code, err.count("\n")) == (2, 1)
    assert "'ccfem new lever.npz' writes one to fill in" in err
    for body in ("lever.stl", "lever.STEP"):
        assert f"ccfem new {body}" in ccfem("check", body)[2]
    code, out, err = ccfem("new", "lever.npz")
    assert (code, err) == (0, "")
    assert "ccfem check lever.toml" in out
    case = read_part(tmp_path / "lever.toml")
    checked = check(case)
    assert checked.mistakes == ()
    (load,) = checked.loads
    assert np.linalg.norm(load.resultant) == pytest.approx(100.0, rel=1e-3)
    areas = {row.name: row.area for row in checked.patches}
    assert areas["held"] == pytest.approx(60.0 * 24.0)
    text = (tmp_path / "lever.toml").read_text()
    assert text.count("CHANGE") == 6
    assert "6  at [60, 12, 2], plane, normal x" in text
    assert 'at = [30, 12, 0]   # on face 1 of the list above\nnormal = "-z"' in text
    code, _, err = ccfem("new", "lever.npz")
    assert (code, "is there already" in err) == (2, True)
    assert ccfem("new", "lever.npz", "--force")[0] == 0
    assert "name its file" in ccfem("new", "loop")[2]
    assert "does not exist" in ccfem("new", "none.stl")[2]


def test_a_part_on_feet_is_held_by_all_of_them(ccfem, tmp_path):
    """A table of 60 x 40 mm on bars 10, 18 and 20 mm wide."""
    outline = shapely.box(0.0, 0.0, 60.0, 20.0)
    for x in (10.0, 34.0):
        outline = outline.difference(shapely.box(x, -1.0, x + 6.0, 12.0))
    upright = extrude(outline, 40.0, 8.0)
    x, y, z = upright.points.T
    write_mesh(TetMesh(np.column_stack([x, -z, y]), upright.cells), tmp_path / "table.npz")
    assert ccfem("new", "table.npz")[0] == 0
    checked = check(read_part(tmp_path / "table.toml"))
    assert checked.mistakes == ()
    areas = {row.name: row.area for row in checked.patches}
    assert areas["held"] == pytest.approx((10.0 + 18.0 + 20.0) * 40.0)


def test_examples_are_listed_written_and_without_mistake(ccfem, tmp_path):
    names = [line.split()[0] for line in ccfem("example")[1].splitlines()[:-1]]
    assert set(names) >= {"bracket_plate", "loads_and_supports"}
    for name in names:
        code, _, err = ccfem("example", name)
        assert (code, err) == (0, "")
    assert check(read_part(tmp_path / "bracket_plate.toml")).mistakes == ()
    assert "there already" in ccfem("example", names[0])[2]
    assert "no example named 'hook'" in ccfem("example", "hook")[2]


def test_cite_prints_bibtex(ccfem, tmp_path):
    code, out, err = ccfem("cite", "isocurve", "winding")
    assert (code, err) == (0, "")
    assert out.count("\n@") + out.startswith("@") == 3
    assert "doi = {10.1016/j.addma.2021.102470}" in out
    (tmp_path / "results.json").write_text(
        '{"strategies": [{"name": "svt", "methods": ["svt"]}], "solver": {"backend": "amg"}}'
    )
    assert "{wang_2021," in ccfem("cite", ".")[1]
    (tmp_path / "results.json").write_text("[1]")
    assert "is no record of ccfem compare" in ccfem("cite", ".")[2]
    assert "holds no results.json" in ccfem("cite", "none.json")[2]
    assert "no method or folder of results named 'isocurv'" in ccfem("cite", "isocurv")[2]


def test_a_body_in_metres_is_seen_to_be_one(ccfem, tmp_path):
    write_mesh(box_mesh((0.06, 0.024, 0.004), (6, 3, 2)), tmp_path / "lever.npz")
    said = " ".join(ccfem("faces", "lever.npz")[1].split())
    assert "only 0.0647 mm across: if it is in metres, set scale = 1000 (or --scale 1000)" in said
    assert "looks like" not in ccfem("faces", "lever.npz", "--scale", "1000")[1]
    code, out, _ = ccfem("new", "lever.npz")
    assert (code, "look like metres" in out) == (0, True)
    checked = check(read_part(tmp_path / "lever.toml"))
    assert checked.mistakes == ()
    areas = {row.name: row.area for row in checked.patches}
    assert areas["held"] == pytest.approx(60.0 * 24.0)


def test_a_surface_in_metres_is_meshed_with_a_hint(ccfem, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    box = box_mesh((0.06, 0.024, 0.004), (1, 1, 1))
    used, facets = np.unique(box.boundary, return_inverse=True)
    surface = pyvista.PolyData.from_regular_faces(box.points[used], facets.reshape(-1, 3))
    surface.save(tmp_path / "lever.stl")
    hint = "only 0.0647 mm across: if it is in metres, set scale = 1000 (or --scale 1000)"
    code, out, err = ccfem("mesh", "lever.stl", "--size", "6", "-o", "lever.npz")
    assert (code, out, err.count("\n"), hint in err) == (2, "", 1, True)
    assert not (tmp_path / "lever.npz").exists()
    code, out, err = ccfem("mesh", "lever.stl", "--size", "0.006", "-o", "lever.npz")
    assert (code, hint in out, err) == (0, True, "")
    assert "metres" not in "".join(
        ccfem("mesh", "lever.stl", "--size", "6", "--scale", "1000", "-o", "lever.npz")[1:]
    )
    ccfem("new", "lever.stl")
    part = (tmp_path / "lever.toml").read_text()
    (tmp_path / "lever.toml").write_text(part.replace("\nscale = 1000", "\n"))
    assert hint in ccfem("check", "lever.toml")[2]
