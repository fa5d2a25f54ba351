import tomllib
from pathlib import Path

import numpy as np
import pytest

import ccfem.cases.part_file
import ccfem.cases.part_tables
from ccfem.base.errors import InputError
from ccfem.body.files import write_mesh
from ccfem.body.mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.inspection import check
from ccfem.cases.part_file import read_part
from ccfem.fem.elasticity.problem import Bearing, Force, PointForce, Pressure, Support, Traction
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.support_kinds import PressingSupport
from ccfem.slicing.slicers.planar import Planar

EXAMPLE = Path(ccfem.__file__).parent / "cases" / "examples" / "bracket_plate.toml"

PART = """
mesh = "body.npz"
material = "pla"
[patches.foot]
rule = "plane"
normal = "x"
offset = "min"
[[supports]]
patch = "foot"
[[loads.pull]]
kind = "force"
patch = "end"
vector = [10, 0, 0]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a body of 30 x 10 x 5 mm, as a mesh with a patch and as a surface."""
    import shapely

    folder = tmp_path_factory.mktemp("part")
    mesh = extrude(shapely.box(0, 0, 30, 10), 5.0, 2.5)
    x = mesh.points[mesh.boundary][:, :, 0]
    mesh = mesh.with_patches({"end": mesh.boundary[(x == 30).all(axis=1)]})
    write_mesh(mesh, folder / "body.npz")
    turned = TetMesh(mesh.points, mesh.cells[:, [1, 0, 2, 3]], mesh.patches).quadratic()
    write_mesh(turned, folder / "turned.vtu")
    import pyvista

    used, facets = np.unique(mesh.boundary, return_inverse=True)
    pyvista.PolyData.from_regular_faces(
        np.array(mesh.points[used]) / 1000, facets.reshape(-1, 3)
    ).save(folder / "body.stl")
    return folder


def read(folder, text):
    path = folder / "part.toml"
    path.write_text(text)
    return read_part(path)


def test_the_example_reads_and_solves():
    case = read_part(EXAMPLE)
    assert (case.name, case.slicing, case.build) == ("bracket", Planar(count=6), (0.0, 0.0, 1.0))
    assert np.allclose(np.ptp(case.problem.mesh.bounds, axis=0), [90, 60, 6])
    assert case.problem.material.name == "PLA+"
    assert case.parameters["zigzag"]["angle"] == 0.0
    assert case.findings == ()
    field = solve(case.problem)["pull"]
    assert np.allclose(field.reactions.sum(axis=0), [-300, 100, 0], atol=1e-5)


def test_the_documentation_lists_every_key():
    """The described keys are those that are read: both ways, by reading the description."""
    described = ccfem.cases.part_file.ALL_KEYS
    lines = described.splitlines()
    keys = {line.split("=")[0].strip() for line in lines if "=" in line.split("#")[0]}
    keys |= {line.strip("[]# ").split("]")[0].split(".")[0] for line in lines if line[:1] == "["}
    for field in ccfem.cases.part_keys.Part.__dataclass_fields__:
        assert field in keys, field
    for kind in (*ccfem.cases.part_tables.RULES, *ccfem.cases.part_loads.LOADS):
        assert f'"{kind}"' in described


def test_everything_in_one_file(folder):
    case = read(
        folder,
        PART
        + """
[[loads.pull]]
kind = "traction"
patch = "end"
vector = [0, 0.5, 0]
[[loads.press]]
kind = "pressure"
patch = "top"
magnitude = 0.2
[[loads.press]]
kind = "point"
point = [30, 5, 5]
vector = [0, 0, -1]
[[loads.pin]]
kind = "bearing"
patch = "side"
vector = [0, 4, 0]
[patches.top]
rule = "plane"
point = [3, 3, 5]
normal = [0, 0, 2]
tolerance = 0.01
[patches.side]
rule = "box"
lower = [-inf, 10, -inf]
upper = [inf, inf, 2.5]
[patches.tip]
rule = "nearest"
point = [30, 10, 5]
count = 3
[patches.other]
rule = "group"
name = "end"
[[supports]]
patch = "tip"
components = "z"
value = [0, 0, 0.1]
[[supports]]
patch = "other"
kind = "pressing"
normal = [1, 0, 0]
[[alternative_supports]]
patch = "foot"
components = "x"
[[alternative_supports]]
patch = "side"
kind = "pressing"
[machine]
minimum_length = 60
[strategies.isocurve]
cap = 90
rings = [1.5]
""",
    )
    problem = case.problem
    assert problem.supports == (
        Support("foot"),
        Support("tip", components="z", value=(0.0, 0.0, 0.1)),
        PressingSupport("other", (1.0, 0.0, 0.0)),
    )
    assert case.alternative_supports == (Support("foot", "x"), PressingSupport("side"))
    assert dict(problem.loads) == {
        "pull": (Force("end", (10.0, 0.0, 0.0)), Traction("end", (0.0, 0.5, 0.0))),
        "press": (Pressure("top", 0.2), PointForce((30.0, 5.0, 5.0), (0.0, 0.0, -1.0))),
        "pin": (Bearing("side", (0.0, 4.0, 0.0)),),
    }
    mesh = problem.mesh
    areas = {name: mesh.facet_areas(facets)[0].sum() for name, facets in mesh.patches.items()}
    assert areas["foot"] == areas["end"] == areas["other"] == pytest.approx(50.0)
    assert areas["top"] == pytest.approx(300.0)
    assert areas["side"] == pytest.approx(75.0)
    assert len(mesh.patches["tip"]) == 3
    assert (case.name, case.title, case.slicing) == ("part", "part", Planar(count=12))
    assert case.machine.minimum_length == 60.0
    assert case.machine.fibre_width == 1.0
    assert case.parameters["isocurve"]["cap"] == 90


def test_bodies(folder):
    """The same body as mesh, quadratic mesh inside out, surface in metres, and planform."""
    mesh = read(folder, PART).problem.mesh
    turned = read(folder, PART.replace("body.npz", "turned.vtu"))
    assert turned.problem.mesh.order == 2
    assert turned.problem.mesh.volumes.sum() == pytest.approx(1500.0)
    assert turned.findings == (f"{len(mesh.cells)} cells were inside out: turned",)
    linear = read(folder, "order = 1\n" + PART.replace("body.npz", "turned.vtu"))
    assert linear.problem.mesh.order == 1
    assert linear.findings == turned.findings
    assert np.allclose(linear.problem.mesh.volumes, mesh.volumes)
    assert len(linear.problem.mesh.patches["end"]) == len(mesh.patches["end"])
    quadratic = read(folder, "order = 2\nbuild = '-x'\n" + PART)
    assert quadratic.problem.mesh.order == 2
    assert quadratic.build == (-1.0, 0.0, 0.0)
    other = PART.replace('patch = "end"', 'patch = "foot"')
    surface = 'surface = "body.stl"\nedge_length = 2.5\nscale = 1000\n'
    filled = read(folder, other.replace('mesh = "body.npz"\n', surface)).problem.mesh
    assert filled.volumes.sum() == pytest.approx(1500.0, rel=0.01)
    plan = """
[planform]
outline = [[0, 0], [30, 0], [30, 10], [0, 10]]
holes = [{ outline = [[10, 4], [14, 4], [14, 8]] }]
height = 5
edge_length = 2
"""
    prism = read(folder, other.replace('mesh = "body.npz"\n', "") + plan).problem.mesh
    assert prism.volumes.sum() == pytest.approx(5 * (300 - 8))


def test_transverse_isotropy(folder):
    text = (
        PART.replace('material = "pla"\n', "")
        + "[material]\nmodulus_fibre = 60000\nmodulus_transverse = 4100\npoisson_fibre = 0.33\n"
    )
    stiffness = read(folder, text + "shear_fibre = 2200\n").problem.material.stiffness
    compliance = np.linalg.inv(stiffness)
    assert 1 / np.diag(compliance)[[0, 1, 5]] == pytest.approx([60000, 4100, 2200])
    with pytest.raises(InputError, match="material needs the key 'shear_fibre'"):
        read(folder, text)


def without(start, stop=None):
    """Part with the lines from one that starts so to before one that starts otherwise left out."""
    lines = PART.splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith(start))
    rest = [k for k in range(first + 1, len(lines)) if stop and lines[k].startswith(stop)]
    return "\n".join(lines[:first] + lines[rest[0] if rest else len(lines) :])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[patches", "part.toml is not a TOML file: "),
        ("colour = 'red'" + PART, "has no key 'colour'; it has: mesh, surface, planform, "),
        ("layers = 2.5" + PART, "layers must be a whole number; got 2.5"),
        ("layers = true" + PART, "layers must be a whole number; got True"),
        ("layers = 0" + PART, "layers must be at least 1 and at most 100000; got 0"),
        ("name = 3" + PART, "name must be a string; got 3"),
        ("order = 3" + PART, "order must be one of 'auto', 1, 2; got 3"),
        ("build = 'w'" + PART, "build must be 'x', 'y', 'z'"),
        ("build = [1, 2]" + PART, "build must be a string or a list of 3, each a number"),
        ("scale = 0" + PART, "scale must be"),
        ("surface = 'a.stl'" + PART, "one of mesh, surface and planform; got mesh and surface"),
        ("edge_length = 2.0" + PART, "edge_length goes with surface"),
        (PART.replace("body.npz", "none.npz"), "mesh file .*none.npz does not exist"),
        (PART.replace("body.npz", "body.stl"), "is a surface, not a tetrahedral mesh"),
        (PART.replace('mesh = "body.npz"', ""), "one of mesh, surface and planform; got none"),
        (PART.replace('"pla"', '"plaster"'), "no material named 'plaster'; there are: "),
        (PART.replace('"pla"', "{ modulus = 3500 }"), "material needs the key 'poisson'"),
        (
            PART.replace('"pla"', "{ modulus = 1, poisson = 0.6 }"),
            "above -1 and below 0.5",
        ),
        (PART.replace('"plane"', '"plain"'), "patches.foot must be a table with rule one of"),
        (PART.replace('rule = "plane"', ""), "patches.foot must be a table with rule one of"),
        (PART.replace('normal = "x"', ""), "patches.foot needs the key 'normal'"),
        (PART.replace("offset", "ofset"), "patches.foot has no key 'ofset'; it has: normal, offs"),
        (PART.replace('"min"', "nan"), "patches.foot.offset must be a number or a string; got nan"),
        (PART.replace('"min"', "50.0"), "patch 'foot': plane x at 50 mm chooses no boundary"),
        (without("[[supports", "[[loads"), r"a part needs a support: add .*supports"),
        ("supports = []\n" + without("[[supports", "[[loads"), "a part needs a support"),
        (PART.replace('"foot"\n[[l', '"feet"\n[[l'), "no patch named 'feet'; there are: end, f"),
        (PART + "[[supports]]\npatch = 'foot'\ncomponents = 'w'", "components must be letters"),
        (without("[[loads"), r"a part needs a load: add .*loads.NAME"),
        ("loads = {}\n" + without("[[loads"), "a part needs a load"),
        (PART.replace("[[loads.pull]]", "[loads.pull]"), r"write \[\[loads.pull\]\]"),
        (PART.replace('"force"', '"push"'), r"loads.pull\[0\] must be a table with kind one of"),
        (PART.replace("[10, 0, 0]", "[10, 0]"), r"vector must be a list of 3, each a number"),
        (PART.replace("[10, 0, 0]", "[nan, 0, 0]"), r"loads.pull\[0\].vector must be"),
        (PART.replace("[10, 0, 0]", "[inf, 0, 0]"), r"loads.pull\[0\].vector must be"),
        (PART.replace('"end"', '"tip"'), "no patch named 'tip'; there are: end, foot"),
        (PART + "[machine]\nwidth = 1.0", "machine has no key 'width'; it has: fibre_width"),
        (
            PART + "[machine]\nfibre_width = -1.0",
            "fibre_width must be from 0.05 to 50 mm; got -1",
        ),
        (PART + "[strategies.spiral]\na = 1", "no strategy named 'spiral'; there are: "),
        (PART + "[strategies.zigzag]\nspeed = 1", "strategy 'zigzag' has no parameter 'speed'"),
        (PART + "[strategies]\nzigzag = 1", "strategies.zigzag must be a table"),
    ],
)
def test_bad_parts_are_one_line(folder, text, message):
    with pytest.raises(InputError, match=message) as caught:
        read(folder, text)
    assert "\n" not in str(caught.value)
    assert "part.toml" in str(caught.value) or "none.npz" in str(caught.value)


PLAN = """
material = "pla"
[planform]
outline = [[0, 0], [30, 0], [30, 10], [0, 10]]
height = 5
edge_length = 2
[[supports]]
patch = "a"
[[loads.pull]]
kind = "force"
patch = "a"
vector = [10, 0, 0]
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("height = 5", "", "planform needs the key 'height'"),
        ("height = 5", "height = -5", "height must be above 0 mm; got -5"),
        ("[30, 10], [0, 10]]", "]", "outline needs at least 3 points; got 2"),
        ("[30, 0], [30, 10]", "[30, 10], [30, 0]", "not a valid polygon"),
        ("[30, 0]", "[30]", "each item a list of 2, each a number"),
        ("height", "holes = [{ radius = 2 }]\nheight", "needs centre and radius, or outline"),
        (
            "height",
            "holes = [{ centre = [0, 0], radius = 2 }]\nheight",
            r"holes\[0\] must lie inside the outline",
        ),
        ("material", "scale = 2\nmaterial", "scale goes with mesh or surface"),
    ],
)
def test_bad_planforms(folder, old, new, message):
    with pytest.raises(InputError, match=message):
        read(folder, PLAN.replace(old, new, 1))


def test_missing_part_file(tmp_path):
    with pytest.raises(InputError, match=r"part file .*a\.toml does not exist"):
        read_part(tmp_path / "a.toml")
    with pytest.raises(InputError, match="is a folder"):
        read_part(tmp_path)
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="must be text in UTF-8; got UTF-16: save it as UTF-8"):
        read_part(tmp_path / "b.toml")


def test_nothing_is_executed(folder):
    """Text that looks like code stays text."""
    case = read(folder, "title = \"__import__('os').abort()\"\n" + PART)
    assert case.title == "__import__('os').abort()"
    assert tomllib.loads(PART)["mesh"] == "body.npz"


@pytest.mark.parametrize(("height", "said"), [(6.0, False), (2.0, True), (1.5, True)])
def test_cells_longer_than_the_part_is_thick_are_pointed_out(folder, height, said):
    text = EXAMPLE.read_text().replace("height = 6.0", f"height = {height}")
    case = read(folder, text.replace("edge_length = 2.5", "edge_length = 2.0"))
    about = [line for line in check(case).warnings if "one cell across" in line]
    assert len(about) == said
    if said:
        assert about[0].startswith(f"walls of {height:g} mm, as at (")


@pytest.mark.parametrize(("modulus", "said"), [(3500.0, ""), (3.5, "as GPa"), (1e7, "as Pa")])
def test_a_modulus_in_another_unit_is_pointed_out(folder, modulus, said):
    material = f"\n[material]\nmodulus = {modulus}\npoisson = 0.35\n"
    case = read(folder, PART.replace('material = "pla"\n', "") + material)
    about = [line for line in check(case).warnings if "modulus" in line]
    assert len(about) == bool(said)
    if said:
        assert about[0].startswith(f"modulus of material 'isotropic' is {modulus:.6g} MPa, where 5")
        assert f"usual: {said} it would be" in about[0]
