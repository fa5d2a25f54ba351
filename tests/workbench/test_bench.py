"""The bench: what is opened, where it is kept, and that the same comes out as by hand."""

import shutil
import tomllib

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.files import write_mesh
from ccfem.body.files.surface import write_stl
from ccfem.body.isolated.process import ChildError
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.part_editing import History, appended, check_files, edited, patch_of, valued
from ccfem.cases.part_file import read_part
from ccfem.workbench.bench import Bench

BY_HAND = """\
# A bar, by hand.
mesh = "bar.vtu"
material = "pla"

[[supports]]
patch = "plane_minus_x"

[[loads.load]]
kind = "force"
patch = "plane_x"
vector = [100.0, 0.0, 0.0]

[patches.plane_minus_x]
rule = "face"
at = [0.0, 5.0, 2.0]
normal = "-x"

[patches.plane_x]
rule = "face"
at = [40.0, 5.0, 2.0]
normal = "x"
"""


@pytest.fixture
def bench(tmp_path):
    """A folder with a bar of 40 x 10 x 4 mm, and a part file of it by hand."""
    write_mesh(box_mesh((40.0, 10.0, 4.0), (8, 3, 2)), tmp_path / "bar.vtu")
    (tmp_path / "bar.toml").write_text(BY_HAND)
    return Bench(tmp_path)


def set_up(bench):
    """Hold one end of the bar and pull the other, as clicks do."""
    by_direction = {
        face.along: number
        for number, face in zip(bench.listing.numbers, bench.listing.faces, strict=True)
    }
    text, patch = patch_of(bench.text, bench.listing, [by_direction["-x"]])
    bench.edit(edited(text, appended(("supports",), {"patch": patch})))
    text, patch = patch_of(bench.text, bench.listing, [by_direction["x"]])
    load = {"kind": "force", "patch": patch, "vector": [100.0, 0.0, 0.0]}
    bench.edit(edited(text, appended(("loads", "load"), load)))


def test_clicks_and_hands_come_to_the_same_part(bench):
    bench.open("bar.vtu")
    assert bench.check(bench.text)[1][0][0] == "mistake"  # nothing is held yet
    set_up(bench)
    assert tomllib.loads(bench.text) == tomllib.loads(BY_HAND)
    checked, said = bench.check(bench.text)
    assert "mistake" not in {kind for kind, _ in said}
    assert checked.case.name == "bar"
    # The file in results names the same body, and no file of the user's was touched.
    kept = bench.part_file()
    assert kept == bench.results / "bar.toml"
    assert tomllib.loads(kept.read_text())["mesh"] == "../bar.vtu"
    by_page, by_hand = read_part(kept), read_part(bench.folder / "bar.toml")
    assert by_page.problem.loads == by_hand.problem.loads
    assert by_page.problem.supports == by_hand.problem.supports
    assert (by_page.problem.mesh.points == by_hand.problem.mesh.points).all()
    for name, facets in by_hand.problem.mesh.patches.items():
        assert (by_page.problem.mesh.patches[name] == facets).all()
    assert (bench.folder / "bar.toml").read_text() == BY_HAND


def test_a_part_file_opens_as_it_is(bench):
    bench.open("bar.toml")
    assert bench.text == BY_HAND
    assert bench.part_argument() == "bar.toml"
    assert not bench.results.exists()
    bench.edit(valued(("layers",), 3))
    assert bench.part_argument() == "results/bar.toml"
    bench.step(-1)
    assert bench.part_argument() == "bar.toml"
    bench.step(1)
    # Opened again it goes on in its place; another of its name does not replace it.
    other = Bench(bench.folder)
    other.open("results/bar.toml")
    other.edit(valued(("layers",), 4))
    assert other.part_argument() == "results/bar.toml"
    bench.open("bar.vtu")
    set_up(bench)
    assert bench.part_argument() == "results/bar-2.toml"
    assert "results/bar-2.toml" in bench.offered()


def test_a_case_opens_with_its_mesh(tmp_path):
    bench = Bench(tmp_path)
    bench.open("bar")
    assert {path.name for path in bench.results.iterdir()} == {"bar.toml", "bar.npz"}
    assert not [line for kind, line in bench.check(bench.text)[1] if kind == "mistake"]
    Bench(tmp_path).open("bar")
    assert len([*bench.results.iterdir()]) == 2


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("nothing", "no case named 'nothing'"),
        ("nothing.stl", "does not exist"),
        ("../bar.toml", "lies outside"),
        ("/etc/passwd", "lies outside"),
        ("notes.txt", "is no body and no part file"),
        ("empty.stl", "empty.stl"),
        ("text.step", "text.step"),
        ("far.toml", "lies outside"),
        ("bad.toml", "is not a TOML file"),
    ],
)
def test_what_cannot_be_opened_is_one_line_and_changes_nothing(bench, what, said):
    (bench.folder / "empty.stl").write_bytes(b"")
    (bench.folder / "text.step").write_text("no body")
    (bench.folder / "notes.txt").write_text("")
    (bench.folder / "far.toml").write_text(BY_HAND.replace("bar.vtu", "../bar.vtu"))
    (bench.folder / "bad.toml").write_text("mesh = ")
    bench.open("bar.toml")
    with pytest.raises(InputError, match=said) as error:
        bench.open(what)
    assert len(error.value.mistakes) == 1
    assert "\n" not in str(error.value)
    assert bench.text == BY_HAND


def test_an_upload_is_kept_in_results(bench):
    content = (bench.folder / "bar.vtu").read_bytes()
    name = bench.upload("../../x/my bar.vtu", content)
    assert name == "results/uploads/my_bar.vtu"
    bench.open(name)
    assert 'mesh = "results/uploads/my_bar.vtu"' in bench.text
    for wrong in ("x.exe", "../", ".toml/..", "a.html"):
        with pytest.raises(InputError, match="is no body and no part file"):
            bench.upload(wrong, b"")
    shutil.rmtree(bench.results / "uploads")
    (bench.results / "uploads").symlink_to("/tmp")
    with pytest.raises(InputError, match="lies outside"):
        bench.upload("a.stl", b"")


def test_results_that_lead_elsewhere_are_neither_written_nor_shown(bench, tmp_path_factory):
    """By a link, to nowhere, or a file in their place: one line, and the part is as it was."""
    bench.open("bar.toml")
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    for place, said in ((elsewhere, "lies outside"), ("nowhere", "move what is in its place")):
        bench.results.symlink_to(place)
        for act in (
            lambda: bench.edit(valued(("layers",), 3)),
            lambda: bench.upload("a.stl", b""),
            lambda: bench.make(bench.results),
        ):
            with pytest.raises(InputError, match=said):
                act()
        bench.results.unlink()
    bench.results.write_text("a file")
    with pytest.raises(InputError, match="move what is in its place"):
        bench.edit(valued(("layers",), 3))
    assert bench.text == BY_HAND
    assert not any(elsewhere.iterdir())


def test_an_edit_that_would_read_elsewhere_is_said(bench):
    bench.open("bar.toml")
    text = bench.text.replace("bar.vtu", "/etc/x.vtu")
    assert bench.check(text)[1][0] == (
        "mistake",
        f"/etc/x.vtu lies outside {bench.folder}: start ccfem open in a folder that holds it",
    )


def test_undo_and_redo_are_other_texts():
    history = History(("a",)).after("b").after("c", "force").after("d", "force")
    assert history.texts == ("a", "b", "d")  # a number that is typed is one step
    assert history.moved(-1).text == "b"
    assert history.moved(-9).text == "a"
    assert history.moved(-1).moved(1).text == "d"
    assert history.moved(-2).after("e").texts == ("a", "e")
    assert history.moved(-1).after("f", "force").texts == ("a", "b", "f")
    assert history.after("d") is history


def test_files_outside_the_folder_are_refused(tmp_path):
    for name in ("../bar.vtu", "/etc/bar.vtu", "a/../../bar.vtu"):
        text = BY_HAND.replace("bar.vtu", name)
        with pytest.raises(InputError, match=r"lies outside .*: start ccfem open in a folder"):
            check_files(text, tmp_path, [tmp_path])
    (tmp_path / "link.vtu").symlink_to("/etc/passwd")
    with pytest.raises(InputError, match="lies outside"):
        check_files(BY_HAND.replace("bar.vtu", "link.vtu"), tmp_path, [tmp_path])
    check_files(BY_HAND, tmp_path, [tmp_path])
    layers = '\n[slicing]\nmethod = "surfaces"\nfolder = "../layers"\n'
    with pytest.raises(InputError, match="lies outside"):
        check_files(BY_HAND + layers, tmp_path, [tmp_path])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("bar.inp", "*NODE, INPUT=../nodes.txt\n"),
        ("bar.inp", "*HEADING\nbar\n*Include, input = /etc/passwd\n"),
        ("bar.xdmf", "<DataItem Format='HDF'>\n ../mesh.h5:/Mesh/points </DataItem>"),
    ],
)
def test_what_a_body_has_read_lies_in_the_folder_too(bench, name, text):
    (bench.folder / name).write_text(text)
    with pytest.raises(InputError, match="lies outside"):
        bench.open(name)
    with pytest.raises(InputError, match="lies outside"):
        check_files(BY_HAND.replace("bar.vtu", name), bench.folder, [bench.folder])


def test_a_file_that_is_uploaded_replaces_no_other(bench):
    assert bench.upload("b.stl", b"one") == "results/uploads/b.stl"
    assert bench.upload("b.stl", b"one") == "results/uploads/b.stl"
    assert bench.upload("b.stl", b"two") == "results/uploads/b-2.stl"
    assert (bench.results / "uploads/b.stl").read_bytes() == b"one"


def test_what_is_offered_is_as_the_folder_is_now(bench):
    (bench.folder / "link.toml").symlink_to("nowhere.toml")
    (bench.folder / "other.toml").write_text("a = 1")
    assert bench.offered() == ["bar.vtu", "bar.toml"]
    (bench.folder / "other.toml").write_text(BY_HAND)
    assert bench.offered() == ["bar.vtu", "bar.toml", "other.toml"]


def test_a_run_is_of_the_text_that_it_has_read(bench):
    bench.open("bar.toml")
    assert bench.is_of(BY_HAND)
    bench.edit(valued(("layers",), 3))
    ran = bench.part_file().read_text()
    assert bench.is_of(ran)
    bench.edit(valued(("layers",), 4))
    assert not bench.is_of(ran)
    bench.step(-1)
    assert bench.is_of(ran)


def test_a_body_in_metres_is_opened_in_millimetres(bench):
    """A plate of 60 x 20 x 4 mm whose file has metres, its walls turned inside out."""
    mesh = box_mesh((0.06, 0.02, 0.004), (1, 1, 1))
    write_stl(bench.folder / "small.stl", mesh.points, mesh.boundary[:, ::-1])
    bench.open("small.stl")
    assert bench.content["scale"] == 1000
    assert bench.listing.size == pytest.approx(np.sqrt(60.0**2 + 20.0**2 + 4.0**2))
    assert 1.0 < bench.content["edge_length"] < 4.0
    corners = bench.listing.points[bench.listing.triangles]
    volume = np.einsum("ij,ij->", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2]) / 6.0
    assert volume == pytest.approx(60.0 * 20.0 * 4.0)  # outward, as they are drawn


def test_a_body_that_crashes_the_mesher_is_one_line(tmp_path, monkeypatch):
    mesh = box_mesh((57.0, 19.0, 4.0), (1, 1, 1))  # no other test has meshed it
    write_stl(tmp_path / "bar.stl", mesh.points, mesh.boundary)
    bench = Bench(tmp_path)
    bench.open("bar.stl")
    set_up(bench)

    def crash(*_, **__):
        raise ChildError("the library crashed (SIGSEGV)")

    monkeypatch.setattr("ccfem.body.meshing.volume.in_own_process", crash)
    checked, ((kind, line),) = bench.check(bench.text)
    assert (checked, kind) == (None, "mistake")
    assert "the library crashed (SIGSEGV)" in line
    assert "\n" not in line
    # Whatever else goes wrong in a check is one line, too, and ends nothing.
    monkeypatch.setattr("ccfem.workbench.bench.part_case", {}.__getitem__)
    assert bench.check(bench.text)[1][0][1].startswith("TypeError: ")
