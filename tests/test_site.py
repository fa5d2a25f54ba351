"""The pages of the documentation are true: their commands exist, their examples run."""

import importlib
import re
import shlex
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
import typer

from ccfem import strategies
from ccfem.cases import named_cases
from ccfem.cases.designed import PLATES
from ccfem.cases.part_file import read_part
from ccfem.cases.part_keys import Part
from ccfem.cases.part_loads import LOADS, SUPPORTS
from ccfem.cases.part_tables import RULES
from ccfem.cli.commands import app
from ccfem.judging.evaluation import COLUMNS
from ccfem.judging.virtual_testing.calibration import read_curve
from ccfem.machine import Machine, machine_from
from ccfem.papers.reproduce import named_papers

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs").rglob("*.md"))
ALL = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES]


def fenced(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), flags=re.M | re.S)


@pytest.mark.parametrize("page", ALL, ids=lambda page: page.stem)
def test_every_command_of_a_page_exists(page):
    """Each line `ccfem ...` of a page is read as the command line reads it, and not run."""
    group = typer.main.get_command(app)
    for line in re.findall(r"^(?: {4}|.*&& )ccfem (.*)$", page.read_text(), flags=re.M):
        words = shlex.split(re.split(r"\s{3,}| > ", line)[0])  # what follows explains or writes it
        name, *rest = ["..." if word in ("COMMAND", "CASE") else word for word in words]
        if name != "...":
            group.commands[name].make_context(name, rest, resilient_parsing=False)


@pytest.mark.usefixtures("coarse_bar")
@pytest.mark.parametrize(
    "page", [page for page in PAGES if fenced(page, "python")], ids=lambda page: page.stem
)
def test_python_of_a_page_runs(page, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(PLATES, "cantilever", replace(PLATES["cantilever"], pixel=2.0))  # coarse
    space = {}
    for block in fenced(page, "python"):
        exec(compile(block, str(page), "exec"), space)
    assert capsys.readouterr().out


def test_every_paper_has_a_page_with_all_its_claims():
    """Pages are written by `python -m benchmarks.paper_pages`: a new claim asks for a new run."""
    for paper in named_papers():
        page = (ROOT / "docs" / "papers" / f"{paper}.md").read_text()
        claims = (ROOT / "ccfem" / "papers" / paper / "expected.toml").read_text()
        for claim in tomllib.loads(claims)["claim"]:
            assert f"| {claim['id']} {claim['text']} |" in page, (paper, claim["id"])
            known = [f"| {check['quantity']} | {check['paper']} |" for check in claim["checks"]]
            assert any(row in page for row in known), (paper, claim["id"])


def test_the_curve_of_the_calibration_page_reads(tmp_path):
    (text,) = fenced(ROOT / "docs/how_to/calibration.md", "csv")
    (tmp_path / "none.csv").write_text(text)
    curve = read_curve(tmp_path / "none.csv")
    assert curve.force.max() == 1820.0


def test_the_machine_of_the_printing_page_reads():
    (text,) = fenced(ROOT / "docs/how_to/printing.md", "toml")
    machine = machine_from(tomllib.loads(text)["machine"])
    assert machine.matrix_height == 0.4


def test_groups_of_gmsh_are_patches(tmp_path):
    """The page of Gmsh groups, to the letter: mesh the geometry, read the part."""
    gmsh = pytest.importorskip("gmsh")
    page = ROOT / "docs/how_to/gmsh_groups.md"
    (geometry,), (part,) = fenced(page, "text"), fenced(page, "toml")
    (tmp_path / "beam.geo").write_text(geometry)
    (tmp_path / "beam.toml").write_text(part)
    try:
        gmsh.initialize(["gmsh", "-v", "1"], readConfigFiles=False, interruptible=False)
    except (AttributeError, OSError):
        pytest.skip("the library of Gmsh is missing")
    try:
        gmsh.open(str(tmp_path / "beam.geo"))
        gmsh.model.mesh.generate(3)
        gmsh.write(str(tmp_path / "beam.msh"))
    finally:
        gmsh.finalize()
    mesh = read_part(tmp_path / "beam.toml").problem.mesh
    area = {name: mesh.facet_areas(facets)[0].sum() for name, facets in mesh.patches.items()}
    assert area["wall"] == pytest.approx(20.0 * 6.0)
    assert mesh.points[mesh.patches["end"], 0] == pytest.approx(80.0)


@pytest.fixture
def generated(monkeypatch):
    """The modules that make pages of the code."""
    monkeypatch.syspath_prepend(str(ROOT / "docs/site"))
    return importlib.import_module


def test_generated_pages_leave_nothing_out(generated):
    pages = {
        "members": ("strategies_page", strategies.named()),
        "cases": ("cases_page", named_cases()),
        "commands": ("commands_page", typer.main.get_command(app).commands),
    }
    for module, (function, names) in pages.items():
        page = getattr(generated(module), function)()
        assert sorted(re.findall(r"^## (.*)$", page, flags=re.M)) == sorted(names)
    page = generated("indices").indices_page()
    for column in COLUMNS:
        assert f"| `{column.name}` | {column.unit} | {' '.join(column.formula.split())} |" in page


def test_the_page_of_the_part_file_has_every_key(generated):
    page = generated("part_file").part_file_page()
    for name in (*Part.__dataclass_fields__, *Machine.__dataclass_fields__):
        assert f"| `{name}` |" in page
    for kind in (*LOADS, *SUPPORTS):
        assert f'### `kind = "{kind}"`' in page
    for rule in RULES:
        assert f'### `rule = "{rule}"`' in page
    # What a reader needs to know of each: a type in words, no annotation of Python.
    assert not re.search(r"Literal|typing|dict\[|<class", page)


def test_every_case_has_its_picture():
    for name in named_cases():
        assert (ROOT / f"docs/pictures/cases/{name}.png").stat().st_size > 1000, name
