"""What a command names is read before the part is solved: the solve itself ends every test here."""

import sys

import pytest
from strip_part import PART

from ccfem.fem.elasticity import solve

LINE = "v 1 1 {0}\nv 50 1 {0}\nl 1 2\n"
FOLDERS = {
    "empty": {},
    "spoiled": {"1.obj": "v 1 2\nf 1 2 3\n"},
    "metres": {"1.obj": "v 1000 0 0\nv 1001 0 0\nv 1000 1 0\nf 1 2 3\n"},
    "sheet": {"1.obj": "v 1 1 2\nv 50 1 2\nv 50 19 2\nf 1 2 3\n"},
    "single": {"1.obj": LINE.format(2)},
    "far": {f"{k}.obj": LINE.format(1000 + k) for k in (1, 2)},
    "strands": {f"{k}.obj": LINE.format(k) for k in (1, 2)},
}


@pytest.fixture
def unsolved(ccfem, tmp_path, monkeypatch):
    """The command line where a solve raises, beside a part and the folders of files."""

    def refuse(*_, **__):
        raise NotImplementedError("solved")

    monkeypatch.setattr(sys.modules[solve.__module__], "solve_system", refuse)
    (tmp_path / "strip.toml").write_text(PART)
    (tmp_path / "own.toml").write_text(f'{PART}[slicing]\nmethod = "surfaces"\nfolder = "none"\n')
    (tmp_path / "stress.csv").write_text("element,xx\n1,2\n")
    for folder, files in FOLDERS.items():
        (tmp_path / folder).mkdir()
        for name, text in files.items():
            (tmp_path / folder / name).write_text(text)
    return ccfem


PLAN = ("plan", "strip.toml", "--slicing")
STRESS = ("compare", "strip.toml", "--stress")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("check", "own.toml"), "no .obj file in the folder 'none'"),
        (("bed", "strip.toml", "own.toml"), "no .obj file in the folder 'none'"),
        ((*PLAN, "surfaces:folder=spoiled"), "1.obj is no OBJ file of triangles"),
        ((*PLAN, "surfaces:folder=metres"), "100 % of the points of layer 0 lie more than 1 mm"),
        ((*PLAN, "through_strands:folder=none"), "none does not exist"),
        ((*PLAN, "through_strands:folder=empty"), "empty holds no files of strands"),
        ((*PLAN, "through_strands:folder=single"), "the strands of two or more"),
        ((*PLAN, "through_strands:folder=far"), "no strand of layer 0 lies in the part"),
        ((*PLAN, "surfaces:folder=sheet", "--gcode", "--support"), "without one: leave out"),
        ((*PLAN, "surfaces:folder=sheet", "--strategy", "svt"), "svt plans on flat layers only"),
        (("compare", "strip.toml", "--slicings", "planar:z,surfaces:folder=none"), "no .obj file"),
        (("compare", "strip.toml", "--paths", "empty"), "empty holds no files of strands"),
        ((*STRESS, "none.vtu"), "stress file none.vtu does not exist"),
        ((*STRESS, "stress.csv"), "stress.csv"),
        (("front", "strip.toml", "--backend", "none"), "no backend named 'none'"),
        (("support", "strip.toml", "--out", "a.doc"), "written as .vtp or .stl; got a.doc"),
    ],
)
def test_wrong_input_is_refused_before_the_solve(unsolved, words, message):
    code, out, err = unsolved(*words)
    assert code == 2
    assert message in err
    assert err.count("\n") == 1
    assert words[0] == "check" or not out


@pytest.mark.parametrize("layers", ["surfaces:folder=sheet", "through_strands:folder=strands"])
def test_sound_layers_reach_the_solve(unsolved, layers):
    with pytest.raises(NotImplementedError, match="solved"):
        unsolved(*PLAN, layers)
