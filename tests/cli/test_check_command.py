"""``ccfem check`` and ``ccfem mesh``: what they print and write."""

import re

import pytest
from strip_part import PART


def test_check_says_and_draws(ccfem, tmp_path):
    (tmp_path / "strip.toml").write_text(PART)
    code, out, err = ccfem("check", "strip.toml")
    assert (code, err) == (0, "")
    assert "60 x 20 x 5 mm, 6 cm^3, pla" in out
    assert "nothing keeps this part from being solved" in out
    took = (
        r"compare about [\d.]+ s and 0.\d GB \(a curve over the length [\d.]+ \w+ more\), "
        r"plan --gcode about [\d.]+ s and 0.\d GB"
    )
    for kind in ("linear", "quadratic"):
        assert re.search(f"expected: on {kind} cells and one processor: {took}", out)
    assert {path.name for path in tmp_path.iterdir()} == {
        *("strip.toml", "strip-check.png", "strip-check.html"),
    }


def test_check_and_solve_say_what_quadratic_cells_cost(ccfem, tmp_path):
    """Before they are solved: linear ones lock where the strip bends."""
    bent = PART.replace("[100, 0, 0]", "[0, 0, -10]")
    (tmp_path / "bent.toml").write_text(bent)
    (tmp_path / "linear.toml").write_text(f"order = 1\n{bent}")
    code, out, _ = ccfem("check", "bent.toml")
    (said,) = [line for line in out.splitlines() if line.startswith("remark: solved on quadratic")]
    assert re.search(
        r"[\d,]+ unknowns, about 1 s and 0.4 GB, because linear ones leave an est", said
    )
    solved, _, err = ccfem("solve", "bent.toml", "--out", "bent.vtu")
    assert (code, solved) == (0, 0)
    assert said.removeprefix("remark: solved ") in err
    assert "solved on quadratic" not in ccfem("check", "linear.toml")[1]


def test_check_names_all_mistakes_and_writes_nothing(ccfem, tmp_path):
    wrong = PART.replace('"pla"', '"plaa"').replace("edge_length = 5", 'edge_length = "5 mm"')
    wrong = wrong.replace('patch = "foot"', 'pacth = "foot"', 1)
    (tmp_path / "strip.toml").write_text(wrong)
    code, out, err = ccfem("check", "strip.toml")
    assert (code, out) == (2, "")
    lines = err.splitlines()
    assert all(line.startswith("ccfem: error: strip.toml: ") for line in lines)
    assert any("no material named 'plaa'" in line for line in lines)
    assert any("no key 'pacth'; it has: patch" in line for line in lines)
    assert any("got '5 mm': write 5 without quotes and unit, in mm" in line for line in lines)
    assert [path.name for path in tmp_path.iterdir()] == ["strip.toml"]


def test_check_of_what_cannot_be_solved_ends_in_two(ccfem, tmp_path):
    (tmp_path / "strip.toml").write_text(
        PART.replace('patch = "foot"\n[[l', 'patch = "foot"\ncomponents = "x"\n[[l')
    )
    code, out, err = ccfem("check", "strip.toml", "--out", "strip.png")
    assert code == 2
    assert "276 linear cells" in out
    assert "free to" not in out
    assert err.startswith("ccfem: error: the part is free to")
    assert (tmp_path / "strip.html").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("mesh", "a.stl", "--size", "2", "-o", ""), "must not be empty"),
        (("mesh", "a.stl", "--size", "2", "-o", "a.msh"), "cannot write a mesh to a.msh"),
        (("mesh", "a.txt", "--size", "2", "-o", "a.vtu"), "cannot mesh a.txt"),
        (("mesh", "a.stl", "--size", "-2", "-o", "a.vtu"), "does not exist"),
        (("check", "bar", "--out", "bar.doc"), "a picture is written as"),
        (("compare", "bar", "--layers", "1000000000"), "at most 100000"),
    ],
)
def test_bad_words_are_one_line(ccfem, tmp_path, arguments, message):
    code, out, err = ccfem(*arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


ARMS = "[20, 0], [40, 0], [40, 15], [60, 15], [60, 20], [0, 20], [0, 15], [20, 15]"
TEE = 'build = "y"\nlayers = 3\n' + PART.replace("[0, 0], [60, 0], [60, 20], [0, 20]", ARMS)
FEW = f"layers = 3\n{PART}"
LAID_IN_AIR = "% of the matrix would be laid in air: "
SAME = {
    "sound": (FEW, (), 0, ""),
    "bed": (FEW, ("gcode.bed=[50,50,50]",), 3, "the part needs 59.2 x 19.2 x 6 mm"),
    "cover": (FEW, ("process.cover=2",), 3, "fibre layer do not hold it; at least 2 mm do"),
    "overhang": (TEE, (), 3, LAID_IN_AIR),
    "layers": (PART, ("fibre_height=0.5",), 2, "layers must lie at least 0.5 mm apart"),
}


@pytest.mark.parametrize(("text", "machine", "code", "said"), SAME.values(), ids=SAME)
def test_check_and_plan_say_the_same(ccfem, tmp_path, text, machine, code, said):
    """And end with the same code; a comparison ranks, and names it in what it writes."""
    (tmp_path / "strip.toml").write_text(text)
    machine = [word for value in machine for word in ("--set-machine", value)]
    quick = ("--no-virtual-test", "--out", "out", *machine)
    checked, _, why = ccfem("check", "strip.toml", *machine)
    planned, _, refused = ccfem("plan", "strip.toml", "--strategy", "zigzag", *quick)
    assert (checked, planned) == (code, code)
    (line,) = why.splitlines() or [""]
    assert said in line
    assert line in refused
    compared, *_ = ccfem("compare", "strip.toml", "--strategies", "zigzag", *quick)
    assert compared == (2 if code == 2 else 0)
    if code == 3:
        for name in ("results.csv", "results.json", "report.html"):
            assert said in (tmp_path / "out" / name).read_text(encoding="utf-8")
        gcode, _, wrong = ccfem("plan", "strip.toml", "--strategy", "zigzag", "--gcode", *quick)
        assert (said in wrong, gcode) == (True, 3 if said == LAID_IN_AIR else 2)
        if said == LAID_IN_AIR:
            head = (tmp_path / "out" / "zigzag.gcode").read_text().partition("G21")[0]
            assert "; NOT PRINTABLE as planned: " in head
            assert said in head


def test_check_proposes_a_build_direction_in_which_fibre_can_carry(ccfem, tmp_path):
    (tmp_path / "strip.toml").write_text(PART)
    (tmp_path / "upright.toml").write_text(f'build = "x"\n{PART}')
    code, out, _ = ccfem("check", "upright.toml")
    assert code == 0
    (said,) = [line for line in out.splitlines() if line.startswith("remark: layers along")]
    assert "remark: layers along z would let fibre take" in said
    assert 'build = "z", or --turn ' in said
    code, out, _ = ccfem("check", "upright.toml", "--turn", said.split("--turn ")[1])
    assert code == 0
    assert "remark: layers along" not in out
    assert "remark: layers along" not in ccfem("check", "strip.toml")[1]


def test_check_judges_pins_in_the_plastic_that_is_printed(ccfem, tmp_path):
    """Solid, the sides of the hole hold 50 MPa on 12 x 12 mm^2; with a tenth as infill the wall."""
    lug = PART.replace("height = 5", "height = 12\nholes = [{ centre = [10, 10], radius = 4 }]")
    lug = lug.replace(
        'material = "pla"',
        "heights = [6.0]\nmaterial = { modulus = 3500.0, "
        "poisson = 0.35, tensile_strength = 50.0, compressive_strength = 60.0 }",
    )
    lug = lug.replace('"force"', '"bearing"').replace('patch = "end"', 'patch = "bore"')
    lug = lug.replace("[100, 0, 0]", "[-100, 0, 0]").replace('patch = "foot"', 'patch = "end"')
    lug += '[patches.bore]\nrule = "holes"\nradius = 4.0\n'
    (tmp_path / "lug.toml").write_text(lug)
    sparse = '[plastic]\ninfill = "grid"\ndensity = 0.1\nwalls = 1\nskins = 1\n'
    (tmp_path / "sparse.toml").write_text(lug + sparse)
    holds = [
        float(re.findall(r"net section (?:of 'bore' at )?(\d+)", ccfem("check", file)[1])[0])
        for file in ("lug.toml", "sparse.toml")
    ]
    assert holds[0] == pytest.approx(50.0 * 12.0 * 12.0, rel=1e-3)
    assert 0.2 * holds[0] < holds[1] < 0.6 * holds[0]
