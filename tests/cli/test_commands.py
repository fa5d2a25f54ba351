"""The command line: what it prints and writes, and one line for everything that is wrong."""

import csv
import dataclasses
import json
import re
import subprocess
import sys
from typing import get_type_hints

import numpy as np
import pytest
import pyvista
from command_line import run_command, without_progress

from ccfem import __version__
from ccfem.base.errors import InputError
from ccfem.body.files import formats, surface, write_mesh
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.body.meshing import cad
from ccfem.cli.arguments import parameters_by_strategy
from ccfem.comparison.plot.part_views import draw_part
from ccfem.printing.export.waypoints import read_waypoints
from ccfem.strategies import named

PART = """
mesh = "body.npz"
layers = 3
[material]
modulus = 3500.0
poisson = 0.35
tensile_strength = 33.0
[machine]
minimum_length = 20.0
[[supports]]
patch = "x_min"
[[loads.pull]]
kind = "force"
patch = "x_max"
vector = [1000, 0, 0]
"""

PICTURES = {
    *(f"{name}_layer_{k:02d}.png" for name in ("isocurve", "zigzag") for k in range(3)),
    *(f"{name}_force.png" for name in ("isocurve", "zigzag")),
    "tension.png",
    "overview.png",
    "part.png",
    "part.html",
}

DRAWINGS = {
    f"{name}_layer_{k:02d}.{kind}"
    for name in ("isocurve", "zigzag")
    for k in range(3)
    for kind in ("svg", "dxf")
}

FILES = {
    *(f"{name}_waypoints.txt" for name in ("isocurve", "zigzag")),
    "results.csv",
    "results.json",
    "paths.vtp",
    "report.html",
    ".ccfem.json",
}

CUBE = "v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nv 0 0 9\nv 9 0 9\nv 9 9 9\nv 0 9 9\n" + "".join(
    f"f {face}\n"
    for face in ("1 4 3 2", "1 2 6 5", "2 3 7 6", "3 4 8 7", "4 1 5 8")  # the top is missing
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with a strip, and with files that are wrong in one way each."""
    folder = tmp_path_factory.mktemp("cli")
    mesh = box_mesh((60.0, 24.0, 4.0), (20, 8, 2))
    write_mesh(mesh, folder / "body.npz")
    tetrahedron = "0 0 0\n9 0 0\n0 nan 0\n0 0 9\n4 0 1 2 3\n"
    (folder / "nan.tet").write_text(f"4 vertices\n1 tets\n{tetrahedron}")
    (folder / "part.toml").write_text(PART)
    (folder / "junk.msh").write_text("this is no mesh\n")
    (folder / "open.obj").write_text(CUBE)
    return folder


@pytest.fixture
def ccfem(monkeypatch, capsys, folder):
    """Call the command line in the folder: exit code, lines of stdout, lines of stderr."""

    def call(*arguments):
        code, out, err = run_command(monkeypatch, capsys, folder, *arguments)
        return code, out, without_progress(err)

    return call


def test_compare_writes_everything(ccfem, folder):
    code, out, err = ccfem("compare", "part.toml", "--strategies", "isocurve,zigzag",
                           "--pictures", "--drawings", "svg,dxf",
                           "--out", "results/new")  # fmt: skip
    assert (code, err) == (0, "")
    assert "isocurve" in out
    where = folder / "results" / "new"
    written = {path.name for path in where.iterdir()}
    assert written == FILES | PICTURES | DRAWINGS
    assert [p.name for p in folder.rglob(".ccfem-*")] == []

    about = json.loads((where / "results.json").read_text())
    assert about["ccfem"] == __version__
    assert about["command"].startswith("ccfem compare part.toml")
    assert about["case"]["layers"] == 3
    assert about["case"]["load"] == pytest.approx([1000.0, 0.0, 0.0], rel=1e-5)
    assert "load case “pull”, in all (1000, 0, 0) N" in (where / "report.html").read_text()
    assert about["solver"]["residual"] < 1e-8
    assert about["versions"]["numpy"] == np.__version__
    assert {"start", "mesh", "solve", "slice", "pictures", "files"} <= set(about["seconds"])
    runs = {run["name"]: run for run in about["strategies"]}
    for run in runs.values():
        assert set(run["seconds"]) == {"plan", "evaluate", "virtual test"}
        assert run["total"]["stiffness_ratio_tension"] > 1.0
        assert run["length_per_layer"] <= about["fibre_per_layer"] * (1.0 + 1e-9)

    with (where / "results.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["strategy"], row["layer"]) for row in rows] == [
        (name, layer) for name in ("isocurve", "zigzag") for layer in ("0", "1", "2", "total")
    ]
    for row in rows:
        if row["layer"] == "total":
            total = runs[row["strategy"]]["total"]
            for column in ("fibre_length", "efficiency", "stiffness_ratio_bonded"):
                assert float(row[column]) == pytest.approx(total[column], rel=1e-12)

    for name, run in runs.items():
        waypoints = read_waypoints(where / f"{name}_waypoints.txt", np.eye(3))
        assert len(waypoints) == run["total"]["paths"]
        assert waypoints.lengths.sum() == pytest.approx(run["total"]["fibre_length"], rel=1e-5)

    import pyvista

    paths = pyvista.read(where / "paths.vtp")
    for number, name in enumerate(runs):
        length = paths.cell_data["length"][paths.cell_data["strategy"] == number].sum()
        assert length == pytest.approx(runs[name]["total"]["fibre_length"], rel=1e-9)


def test_the_report_needs_no_other_file(ccfem, folder):
    ccfem("plan", "part.toml", "--strategy", "zigzag", "--set", "angle=0", "--layers", 1,
          "--no-virtual-test", "--out", "one")  # fmt: skip
    page = (folder / "one" / "report.html").read_text()
    shown = re.sub(r'(<script type="application/octet-stream"[^>]*>)[^<]*', r"\1", page)
    assert not re.findall(r"""(?:src|href)\s*=\s*["'](?!data:)|@import|url\(""", shown)
    assert "angle = 0" in page
    assert "ccfem plan part.toml --strategy zigzag --set angle=0" in page
    assert PART.strip() in shown.replace("&#34;", '"')
    assert {p.name for p in (folder / "one").iterdir()} == {
        *("report.html", "results.csv", "results.json", "paths.vtp", ".ccfem.json"),
        "zigzag_waypoints.txt",
    }


def test_paths_of_other_programs_stand_beside_the_strategies(ccfem, folder):
    line = "".join(f"{x},{y},{z},{path},{layer}\n" for path, (y, z, layer) in enumerate(
        [(4, 1.0, 0), (9, 1.0, 0), (15, 1.0, 0), (12, 3.0, 1)]) for x in (1, 59))  # fmt: skip
    (folder / "mine.csv").write_text("x,y,z,path,layer\n" + line)
    (folder / "piled.csv").write_text("x,y,z,path,layer\n" + "".join(
        f"{x},12,{z},{k + 9 * z:.0f},0\n" for z in (1.0, 3.0) for k in range(9) for x in (1, 59)
    ))  # fmt: skip
    code, out, err = ccfem("compare", "part.toml", "--strategies", "zigzag",
                           "--paths", "mine.csv,piled.csv", "--out", "given")  # fmt: skip
    assert (code, err) == (0, "")
    about = json.loads((folder / "given" / "results.json").read_text())
    assert about["case"]["heights"] == [1.0, 3.0]
    runs = {run["name"]: run for run in about["strategies"]}
    assert runs["mine"]["total"]["fibre_length"] == pytest.approx(4 * 58.0)
    assert about["fibre_per_layer"] == pytest.approx(2 * 58.0)
    assert (runs["mine"]["printable"], runs["mine"]["why_not"]) == (True, "")
    assert runs["piled"]["why_not"].startswith("89% of the fibre lies on other fibre")
    assert "piled: not printable as planned: 89% of the fibre" in " ".join(out.split())
    refused(ccfem, folder, "'zigzag' is the name of two runs",
            "compare", "part.toml", "--strategies", "zigzag", "--paths", "zigzag.csv")  # fmt: skip
    refused(ccfem, folder, r"mine.csv: path 3 lies at 3 mm .*, on none of the 2 layers",
            "compare", "part.toml", "--strategies", "zigzag", "--paths", "mine.csv",
            "--heights", "1,1.4")  # fmt: skip
    refused(ccfem, folder, "got no --paths",
            "compare", "part.toml", "--paths-frame", "tool")  # fmt: skip


@pytest.mark.parametrize("name", ["angle", "zigzag.angle"])
def test_plan_takes_a_parameter_with_and_without_its_strategy(ccfem, folder, name):
    code, _, err = ccfem("plan", "part.toml", "--strategy", "zigzag", "--set", f"{name}=30",
                         "--layers", 1, "--no-virtual-test", "--out", "prefix")  # fmt: skip
    assert (code, err) == (0, "")
    (run,) = json.loads((folder / "prefix" / "results.json").read_text())["strategies"]
    assert run["parameters"]["angle"] == 30.0


def test_plan_refuses_a_parameter_of_another_strategy(ccfem, folder):
    message = r"parameter of zigzag.*; got 'grid\.angle=30': write angle=VALUE or zigzag\.angle="
    refused(ccfem, folder, message,
            "plan", "part.toml", "--strategy", "zigzag", "--set", "grid.angle=30")  # fmt: skip


def test_a_second_run_leaves_nothing_of_the_first(ccfem, folder):
    plan = ("plan", "part.toml", "--set", "angle=0", "--no-virtual-test", "--pictures",
            "--out", "twice")  # fmt: skip
    ccfem(*plan, "--strategy", "zigzag", "--layers", 2)
    where = folder / "twice"
    assert (where / "zigzag_layer_01.png").exists()
    (where / "zigzag.gcode").write_text("; not of this program\n")
    assert ccfem(*plan, "--strategy", "contour_zigzag", "--layers", 1)[0] == 0
    names = {path.name for path in where.iterdir()}
    assert names >= {"contour_zigzag_layer_00.png", "report.html", "results.json", "zigzag.gcode"}
    assert not [name for name in names - {"zigzag.gcode"} if name.startswith("zigzag")]
    files = json.loads((where / "results.json").read_text())["files"]
    assert set(files) == names - {"zigzag.gcode", ".ccfem.json"}


def test_files_of_others_are_replaced_by_force_alone(ccfem, folder):
    where = folder / "others"
    where.mkdir()
    (where / "report.html").write_text("mine")
    (where / "thesis.docx").write_text("three years")
    plan = ("plan", "part.toml", "--strategy", "zigzag", "--layers", 1, "--no-virtual-test",
            "--out", "others")  # fmt: skip
    code, _, err = ccfem(*plan)
    assert code == 2
    assert "did not write, such as report.html" in err
    assert (where / "report.html").read_text() == "mine"
    assert ccfem(*plan, "--force")[0] == 0
    assert "ccfem" in (where / "report.html").read_text()
    assert (where / "thesis.docx").read_text() == "three years"


def test_a_name_that_is_no_folder_is_refused(ccfem, folder):
    for name in ("../../X", "[/red]", "x" * 300, "\\u001b[31m"):
        (folder / "named.toml").write_text(f'name = "{name}"\n' + PART)
        code, _, err = ccfem("plan", "named.toml", "--strategy", "zigzag")
        assert (code, err.count("\n")) == (2, 1)
        assert "the name of a case must have letters" in err
    assert not (folder.parent.parent / "X").exists()


def test_a_failed_strategy_is_shown(ccfem, folder):
    (folder / "push.toml").write_text(PUSH)
    code, out, _ = ccfem("compare", "push.toml", "--strategies", "isocurve,zigzag", "--layers", 1)
    assert code == 0
    assert "isocurve: failed: expected tension" in " ".join(out.split())
    page = (folder / "results" / "push" / "report.html").read_text()
    assert "failed: expected tension" in page
    rows = list(csv.DictReader((folder / "results" / "push" / "results.csv").open()))
    assert rows[0]["strategy"] == "isocurve"
    assert rows[0]["failure"].startswith("expected tension")
    assert rows[0]["fibre_length"] == ""


def test_what_was_found_in_the_mesh_is_printed(ccfem, folder):
    mesh = box_mesh((60.0, 24.0, 4.0), (10, 4, 2))
    write_mesh(TetMesh(mesh.points, mesh.cells[:, [1, 0, 2, 3]], mesh.patches), folder / "in.npz")
    (folder / "inside.toml").write_text(PART.replace("body.npz", "in.npz"))
    _, out, _ = ccfem("plan", "inside.toml", "--strategy", "zigzag", "--no-virtual-test")
    assert f"mesh: {len(mesh.cells)} cells were inside out: turned" in out


def test_a_face_has_its_number_on_the_side_from_which_it_is_seen(ccfem, monkeypatch):
    """A box is drawn from two opposite corners: three of its faces on each side."""
    figures = []
    monkeypatch.setitem(draw_part.__globals__, "save", lambda figure, path: figures.append(figure))
    assert ccfem("faces", "body.npz", "--out", "faces.png")[0] == 0
    shown = [{text.get_text() for text in axes.texts} for axes in figures[0].axes]
    assert [len(numbers) for numbers in shown] == [3, 3]
    assert set.union(*shown) == {"1", "2", "3", "4", "5", "6"}


def test_faces_are_listed_and_drawn(ccfem, folder):
    code, out, err = ccfem("faces", "body.npz", "--out", "faces.png")
    assert (code, err) == (0, "")
    assert "6 faces at a feature angle of 30 degrees" in out
    assert re.search(r"1440  \[30, 12, 0\]  plane, normal -z", out)
    assert (folder / "faces.png").stat().st_size > 10_000
    for options, message in (
        (("body.npz", "--out", "faces.txt"), "a picture is written as .png"),
        (("bar", "--scale", "nan"), "--scale is for surface and mesh files"),
        (("body.npz", "--scale", "0"), "mesh scale must be above 0"),
    ):
        code, out, err = ccfem("faces", *options)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert message in err


def test_lists(ccfem):
    code, out, _ = ccfem("cases")
    assert code == 0
    for name in ("loop", "bar", "open_hole"):
        assert name in out
    code, out, _ = ccfem("strategies")
    assert code == 0
    for name in ("isocurve", "concentric", "zigzag", "contour_zigzag", "spacing", "cap"):
        assert name in out
    assert "one of 'polyline', 'raster'" in " ".join(out.split())
    code, out, _ = ccfem()
    assert code == 0
    assert "compare" in out


@pytest.mark.parametrize("name", sorted(named()))
def test_every_parameter_of_a_strategy_is_explained(ccfem, monkeypatch, name):
    monkeypatch.setenv("COLUMNS", "1000")
    code, out, _ = ccfem("strategies", name)
    assert code == 0
    rows = [[cell.strip() for cell in re.split(r" {2,}", line.strip())] for line in out.split("\n")]
    found = {row[0]: row[1:] for row in rows if len(row) == 4}
    for field in dataclasses.fields(named()[name]):
        default, kind, meaning = found[field.name]
        made = field.default_factory is not dataclasses.MISSING
        assert default == repr(field.default_factory() if made else field.default)
        assert kind
        assert len(meaning) > 15
        assert not meaning.startswith("As in")


def test_slicers_are_listed_and_explained(ccfem, monkeypatch, folder):
    monkeypatch.setenv("COLUMNS", "1000")
    code, out, _ = ccfem("slicers")
    assert code == 0
    assert "planar  Flat layers across the build direction" in out
    code, out, _ = ccfem("slicers", "planar")
    assert code == 0
    assert "Height of a slab. As many slabs as fit are stacked from the bottom up." in out
    refused(ccfem, folder, "no slicer named 'planr'; there are: .*'planar'", "slicers", "planr")


def test_a_parameter_is_explained_in_the_words_of_its_class(ccfem, monkeypatch, folder):
    monkeypatch.setenv("COLUMNS", "1000")
    _, out, _ = ccfem("strategies", "contour_zigzag")
    assert "Direction of the lines on layer 0 to the first axis of the layer." in out
    assert "float, degrees" in out
    assert "It sets the amount of fibre: 1 lays the most, 20 the least." in out
    refused(ccfem, folder, "did you mean 'zigzag'", "strategies", "zigzga")


def test_it_is_a_module_too():
    done = subprocess.run(
        [sys.executable, "-m", "ccfem", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"ccfem {__version__}\n"


ROLLERS = """
[[supports]]
patch = "x_min"
components = "x"
[[supports]]
patch = "y_min"
components = "y"
[[supports]]
patch = "z_min"
components = "z"
"""
SUPPORT = '[[supports]]\npatch = "x_min"\n'
PUSH = PART.replace(SUPPORT, ROLLERS).replace("[1000, 0, 0]", "[-1000, 0, 0]")
HOLE = '[patches.pin]\nrule = "cylinder"\npoint = [30, 12, 0]\naxis = "z"\nradius = 3.0\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (PART.replace("body.npz", "gone.npz"), "gone.npz does not exist: check its name"),
        (PART.replace("body.npz", "junk.msh"), "junk.msh is not a Gmsh mesh"),
        (
            PART.replace("body.npz", "part.toml"),
            "cannot tell the format of mesh file part.toml: its name must end in",
        ),
        (
            PART.replace('mesh = "body.npz"', 'surface = "open.obj"\nedge_length = 3'),
            "open.obj: the surface is open: .*close the holes",
        ),
        (PART.replace(SUPPORT, ""), "support"),
        (PART.replace('patch = "x_min"', 'patch = "x_min"\ncomponents = "x"'), "free"),
        (PART + HOLE, "nearest"),
        (PART.replace('"x_max"', '"end"'), "no patch named 'end'; there are: x_max, x_min"),
        (PART.replace("body.npz", "nan.tet"), "NaN"),
        (PART.replace("[1000,", "[nan,"), "nan"),
        (PART.replace("[1000,", "[0,"), "zero"),
        (PUSH, "expected tension.*the largest tensile stress found is"),
        (PART + "[strategies.isocurf]\na = 1\n", "no strategy named 'isocurf'; there are: "),
        (PART.replace("layers = 3", "layer = 3"), "no key 'layer'; .*did you mean 'layers'"),
        (PART + "[strategies.isocurve]\nkap = 1\n", "no parameter 'kap'; it has: .*cap"),
        (
            PART.replace("layers = 3", "layers = 0"),
            "layers must be at least 1 and at most 100000; got 0",
        ),
        (PART.replace("poisson = 0.35", "poisson = 0.5"), "poisson"),
        ("mesh = ", "is not a TOML file"),
    ],
)
def test_bad_parts_end_in_one_line(ccfem, folder, text, message):
    (folder / "bad.toml").write_text(text)
    refused(ccfem, folder, message, "plan", "bad.toml", "--strategy", "isocurve", "--out", "bad")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["gone.toml"], "part file gone.toml does not exist: check its name and folder"),
        (["lop"], "no case named 'lop'; there are: arm_bracket, bar, bracket, bridge, cantilever"),
        (["part.toml", "--strategies", "zigzag,spiral"], "no strategy named 'spiral'; there are:"),
        (["lop"], r"two_pull_loop: did you mean 'loop'\? \(or name a part file"),
        (["part.toml", "--strategies", "isocurv"], "zigzag: did you mean 'isocurve'"),
        (["part.toml", "--set", "zigzag.spacin=2"], "turns: did you mean 'spacing'"),
        (["part.toml", "--set", "zigzga.turn=2"], "contour_zigzag, zigzag: did you mean 'zigzag'"),
        (["bar", "--set-case", "element_siz=1"], "did you mean 'element_size'"),
        (["part.toml", "--strategies", ","], "at least one strategy"),
        (["part.toml", "--set", "zigzag.pitch=2"], "'zigzag' has no parameter 'pitch'; it has:"),
        (["part.toml", "--set", "zigzag.spacing=wide"], "must be a number; got 'wide'"),
        (["part.toml", "--set", "zigzag.spacing=0.5"], "at least 1 fibre width; got 0.5"),
        (["part.toml", "--set", "spacing=2"], "expects STRATEGY.NAME=VALUE; got 'spacing=2'"),
        (["part.toml", "--set", "zigzag.spacing"], "expected NAME=VALUE"),
        (["part.toml", "--set-case", "force=1"], "'part.toml' is a part file"),
        (["bar", "--set-case", "length=1"], "case 'bar' has no parameter 'length'; it has:"),
        (
            ["part.toml", "--layers", "0"],
            "number of layers must be at least 1 and at most 100000; got",
        ),
        (["part.toml", "--layers", "many"], "--layers"),
        (["part.toml", "--heights", "1,2,9"], "height 9 mm lies outside the part.* from 0 to 4 mm"),
        (["part.toml", "--heights", "1,x"], "expected numbers"),
        (["part.toml", "--layers", "2", "--heights", "1"], "got --layers and --heights"),
        # Words that make no sense are refused before a part is read, which may take minutes.
        (["gone.toml", "--layers", "2", "--heights", "1"], "got --layers and --heights"),
        (["gone.toml", "--stress-unit", "MPa"], "got no file: name it"),
        (["gone.toml", "--stress-step", "2"], "--stress-step belongs to --stress; got no file"),
        (["gone.toml", "--stress-array", "S"], "--stress-array belongs to --stress; got no file"),
        (["gone.toml", "--set", "zigzag.spacing"], "expected NAME=VALUE"),
        (["gone.toml", "--slicings", "planar:z", "--drawings", "svg"], "one slicing only"),
        (
            ["bar", "--slicings", "planar:z", "--layers", "3"],
            "over several slicings there are no lay",
        ),
        (["bar", "--slicings", "planar:w"], "axis must be one of"),
        (
            ["bar", "--fibre", "9", "--fibre-per-layer", "9"],
            r"\(--fibre-per-layer\) and fibre \(--fibre\): drop one",
        ),
        (["bar", "--fibre", "-3"], "fibre in all must be above 0 mm; got -3"),
        (
            ["part.toml", "--slicing", "planer"],
            "no slicer named 'planer'; there are: load_oriented",
        ),
        (["part.toml", "--slicing", "planar:height=1"], "has no parameter 'height'; it has:"),
        (["part.toml", "--slicing", "planar:count=0"], "number of layers must be at least 1"),
        (["part.toml", "--fibre-per-layer", "-3"], "above 0 mm; got -3"),
        (["part.toml", "--fibre-per-layer", "9", "--natural"], "not both"),
        (["part.toml", "--load-case", "twist"], "no load case named 'twist'; there are: pull"),
        (["part.toml", "--backend", "magic"], "magic"),
        (["part.toml", "--out", "part.toml/results"], "cannot write results to part.toml/results"),
        (["part.toml", "--ouput", "x"], "No such option"),
        ([], "Missing argument"),
    ],
)
def test_bad_arguments_end_in_one_line(ccfem, folder, arguments, message):
    refused(ccfem, folder, message, "compare", *arguments)


def refused(ccfem, folder, message, *arguments):
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}
    code, out, err = ccfem(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("ccfem: error: ")
    assert err.count("\n") == 1
    assert re.search(message, err), err
    after = {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}
    assert after == before
    assert not list(folder.rglob(".ccfem-*"))


def test_a_parameter_that_is_a_table_takes_its_entries_one_by_one():
    texts = ["pruned.of=zigzag", "pruned.base.angle=30", "pruned.base.turn=0", "zigzag.turn=1.5"]
    assert parameters_by_strategy(texts) == {
        "pruned": {"of": "zigzag", "base": {"angle": 30, "turn": 0}},
        "zigzag": {"turn": 1.5},
    }
    only = parameters_by_strategy(["coverage=0.3", "pruned.base.angle=30"], "pruned")
    assert only == {"pruned": {"coverage": 0.3, "base": {"angle": 30}}}
    with pytest.raises(InputError, match=r"pruned.base has a value already"):
        parameters_by_strategy(["pruned.base=3", "pruned.base.angle=30"])
    with pytest.raises(InputError, match="expects STRATEGY"):
        parameters_by_strategy(["angle=30"])


@pytest.mark.parametrize("command", ["compare", "plan", "front"])
def test_what_plans_for_all_load_cases_offers_it(ccfem, command):
    assert '"all" plans for all at once' in " ".join(ccfem(command, "--help")[1].split())


@pytest.mark.parametrize("command", ["support", "calibrate"])
def test_what_takes_one_load_case_does_not_offer_all(ccfem, command):
    said = " ".join(ccfem(command, "--help")[1].split())
    assert "Load case to take; default the first." in said
    assert "plans for all at once" not in said


def test_the_help_of_mesh_names_every_format(ccfem, monkeypatch):
    """Also one that another package adds."""
    known = [*surface.SUFFIXES, *cad.SUFFIXES, *formats.suffixes(writable=True), ".new"]
    monkeypatch.setattr(formats, "suffixes", lambda writable: tuple(known[-4:]))
    said = " ".join(ccfem("mesh", "--help")[1].split())
    assert all(re.search(rf"[( ]\{suffix}[,)]", said) for suffix in known)


def test_a_plan_that_cannot_be_printed_says_so_and_ends_with_three(ccfem, folder):
    tight = ("--set-machine", "limits.tight=0.0", "--set-machine", "minimum_radius=1000")
    plan = ("plan", "part.toml", "--strategy", "concentric", "--layers", 1, "--no-virtual-test",
            "--gcode", *tight, "--out", "done")  # fmt: skip
    code, out, err = ccfem(*plan)
    assert code == 3
    (line,) = (line for line in err.splitlines() if "not printable" in line)
    assert line.startswith("ccfem: not printable as planned: ")
    assert line.endswith(" (--force accepts the plan as it is)")
    reason = line.removeprefix("ccfem: not printable as planned: ").partition(" (--force")[0]
    text = (folder / "done" / "concentric.gcode").read_text()
    assert f"; NOT PRINTABLE as planned: {reason}\n" in text
    with (folder / "done" / "results.csv").open() as file:
        total = next(row for row in csv.DictReader(file) if row["layer"] == "total")
    assert (total["printable"], total["why_not"]) == ("False", reason)
    # Where the file is, its time and its mass, as its head states them.
    (said,) = (line for line in out.splitlines() if "concentric.gcode" in line)
    clock = re.search(r"normal mode\) = (.+)", text)[1]
    grams = [float(g) for g in re.search(r"filament used \[g\] = (.+)", text)[1].split(",")]
    assert f"{clock} of printing, {grams[0]:.2f} g of matrix, {grams[1]:.2f} g of fibre" in said
    code, _, err = ccfem(*plan, "--force")
    assert code == 0
    assert f"not printable as planned: {reason}\n" in err


def test_help_names_the_limits_that_hold():
    """Options are read before the engine is imported, so its numbers stand in their texts."""
    from ccfem.cli import options
    from ccfem.comparison import request

    every_layer = get_type_hints(options.SolveOptions, include_extras=True)["every_layer"]
    tested, layers = (kind.__metadata__[0].help for kind in (options.TestOrNot, every_layer))
    assert f"up to {request.LONGEST_TEST / 1e6:g} km" in tested
    assert f"on {request.MOST_LAYERS}, evenly" in layers


LEANING = """\
material = "pla"
build = "y"
layers = 2
[planform]
outline = [[0, 0], [10, 0], [10, 20], [30, 20], [30, 30], [0, 30]]
height = 8.0
edge_length = 5.0
[patches.low]
rule = "plane"
normal = "y"
offset = "min"
[patches.high]
rule = "plane"
normal = "y"
offset = "max"
[[supports]]
patch = "low"
[[loads.press]]
kind = "force"
patch = "high"
vector = [0, -10, 0]
"""


def test_support_is_written_as_a_body(ccfem, folder):
    """Below an arm of 20 x 8 mm, 20 mm above the bed."""
    (folder / "leaning.toml").write_text(LEANING)
    code, out, err = ccfem("support", "leaning.toml", "--out", "under.stl")
    assert (code, err) == (0, "")
    body = pyvista.read(folder / "under.stl")
    assert body.is_manifold
    assert body.volume == pytest.approx(20.0 * 8.0 * 20.0, rel=1e-6)
    np.testing.assert_allclose(np.reshape(body.bounds, (3, 2)), [[10, 30], [0, 20], [0, 8]])
    assert "under.stl: the support as a body of " in out
