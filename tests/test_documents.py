"""README and CONTRIBUTING are true: their examples run, their lists are complete."""

import hashlib
import json
import operator
import os
import re
import shutil
import subprocess
import sys
import textwrap
import types
import typing
from pathlib import Path

import pandas as pd
import pytest

import ccfem
from ccfem.base.errors import InputError
from ccfem.cases.part_file import read_part
from ccfem.comparison import bounds, engine, request, stages
from ccfem.strategies import named

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text()


def blocks(text, language):
    """Fenced blocks of a language, without the indent of the list that they stand in."""
    found = re.findall(rf"^( *)```{language}\n(.*?)^ *```$", text, flags=re.M | re.S)
    return [textwrap.dedent(body) for _, body in found]


def test_the_two_commands_are_there():
    assert "    pip install -e . && ccfem compare loop\n" in README
    assert '    pip install -e ".[test]" && pytest\n' in README


@pytest.mark.usefixtures("coarse_bar")
def test_python_of_the_readme_runs(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for block in blocks(README, "python"):
        exec(compile(block, "README.md", "exec"), {})
    said = capsys.readouterr().out
    assert "stiffness ratio" in said
    assert "isocurve makes the stiffest part" in said


def test_the_readme_is_short():
    assert len(README.split()) <= 900


@pytest.mark.usefixtures("coarse_bar")
def test_the_flow_is_drawn_as_it_is(capsys):
    """Every word of the drawing is a name of the engine, and its code runs."""
    page = (ROOT / "docs/concepts/flow.md").read_text()
    second = blocks(page, "python")[1]
    space: dict = {}
    exec(compile(second, "flow.md", "exec"), space)
    assert len(space["comparison"].runs) == 1
    steps = {
        engine: ("solved", "Solved.cut", "Request", "Comparison", "planned", "judged", "bounds_of"),
        stages: ("evaluated", "with_print", "with_test"),
        bounds: ("upper_bound",),
    }
    for module, names in steps.items():
        for name in names:
            assert name in page
            assert operator.attrgetter(name)(module)
    drawn = set(re.findall(r"`(\w+)`", page.partition("| `amount` |")[2].partition("|")[0]))
    known = {kind.__name__ for kind in typing.get_args(request.Amount)}
    assert drawn == known


def test_part_file_of_the_readme_lacks_nothing_but_its_mesh(tmp_path):
    (block,) = blocks(README, "toml")
    (tmp_path / "hook.toml").write_text(block)
    with pytest.raises(InputError, match=r"hook.msh does not exist"):
        read_part(tmp_path / "hook.toml")


def test_every_strategy_is_in_the_table():
    page = (ROOT / "docs/concepts/strategies.md").read_text()
    for name in named():
        assert f"| `{name}` |" in page


def test_links_lead_somewhere():
    for text in (README, CONTRIBUTING):
        for target in re.findall(r"\]\(([^)]+)\)", text):
            assert target.startswith("http") or (ROOT / target).exists(), target


def compiled(folder):
    """Where numba keeps what it compiles of a folder of the project."""
    if "NUMBA_CACHE_DIR" not in os.environ:
        return folder / "__pycache__"
    digest = hashlib.sha1(str(folder).encode()).hexdigest()
    return Path(os.environ["NUMBA_CACHE_DIR"]) / f"{folder.name}_{digest}"


RUNNING = """
import contextlib, io, json, runpy, sys
from ccfem.cli.main import main

said = {}
for command in json.load(sys.stdin):
    sys.argv, text = command.split(), io.StringIO()
    with contextlib.redirect_stdout(text):
        if sys.argv[0] == "ccfem":
            try:
                main()
            except SystemExit as end:
                assert not end.code, command
        else:
            runpy.run_path(sys.argv[0])
    said[command] = text.getvalue()
json.dump(said, sys.stdout)
"""
"""Runs commands and programs one after the other, and says what each of them printed."""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the project, and what runs Python in it."""
    root = tmp_path_factory.mktemp("copy")
    for folder in ("ccfem", "data", "tests/laws", "tests/strategies"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / folder, root / folder, ignore=ignored)
    # What is compiled is shared with the project, whoever compiles it first.
    for folder in {path.parent for path in (ROOT / "ccfem").rglob("*.py")}:
        kept = compiled(folder)
        kept.mkdir(parents=True, exist_ok=True)
        if kept.name != "__pycache__":  # so is what Python compiled
            for file in (folder / "__pycache__").glob("*.pyc"):
                shutil.copy2(file, kept)
        (root / folder.relative_to(ROOT) / "__pycache__").symlink_to(kept)
    shutil.copy(ROOT / "pyproject.toml", root)
    others = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}

    def run(*words, given=None):
        done = subprocess.run(
            [sys.executable, *words],
            cwd=root,
            input=given,
            capture_output=True,
            text=True,
            check=False,
            env={**others, "PYTHONDONTWRITEBYTECODE": "1"},
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return root, run


def section(title):
    """Text of a section of CONTRIBUTING.md."""
    return CONTRIBUTING.partition(f"## {title}\n")[2].partition("\n## ")[0]


def commands(title):
    """Commands of a section: `ccfem ...`, each in a line."""
    return re.findall(r"^ +(ccfem .*)$", section(title), flags=re.M)


BOTH_WAYS = """
from ccfem.body.files import read_mesh, write_mesh
from ccfem.body.files.formats import suffixes
from ccfem.body.mesh import box_mesh
mesh = box_mesh((2.0, 3.0, 4.0), (1, 1, 1))
write_mesh(mesh, 'box.nodes')
again = read_mesh('box.nodes')
print(again.volumes.sum(), len(again.cells), '.nodes' in suffixes())
"""
PULLED = """
from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing import Strand, virtual_test
from ccfem.judging.virtual_testing.strength import first_failure
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers import Planar
mesh = box_mesh((20.0, 4.0, 4.0), (15, 3, 3))
mesh = mesh.with_patches({'corner': mesh.patch('x_min')[:1]})
supports = (Support('x_min', 'x'), Support('corner', 'yz'))
loads = {'pull': (Force('x_max', (80.0, 0.0, 0.0)),)}
material = isotropic(2000.0, 0.0, tensile_strength=30.0)
stress = solve(Problem(mesh, material, supports, loads))['pull']
(layer,) = Planar(count=1).cut(mesh)
line = Toolpaths.from_plane([[[1.0, 2.0], [19.0, 2.0]]], layer)
test = virtual_test(line, stress, Strand(rho=5e-10), span=())
print(*(first_failure(test).loads[law] for law in ('brittle_matrix', 'matrix')))
"""
QUICK = {
    "ccfem compare": " --set-case element_size=4",
    "--slicing graded": " --natural --no-virtual-test --out graded",
}
"""What is added to commands of CONTRIBUTING.md that hold these words, to make them quick."""


@pytest.fixture(scope="module")
def extended(copy):
    """The copy with a file of every kind that CONTRIBUTING.md adds, and what is said in it.

    All commands are run in one program, which takes seconds to start.
    """
    root, run = copy
    (root / "ccfem/slicing/slicers/graded.py").write_text(blocks(CONTRIBUTING, "python")[2])
    wanted = ["ccfem machines"]
    for title in ("Add an index", "Add a mesh format", "Add a law of failure", "Add a machine"):
        text = section(title)
        (name,) = re.findall(r"`(ccfem/\S+\.(?:py|toml))`:\n", text)
        (block,) = blocks(text, "toml" if name.endswith("toml") else "python")
        (root / name).write_text(block)
    for title in ("Add a slicer", "Add an index", "Add a law of failure", "Add a machine"):
        for command in commands(title):
            more = [more for words, more in QUICK.items() if words in command]
            wanted.append(command + "".join(more))
    for name, program in (("both_ways.py", BOTH_WAYS), ("pulled.py", PULLED)):
        (root / name).write_text(program)
        wanted.append(name)
    return root, json.loads(run("-c", RUNNING, given=json.dumps(wanted)))


def test_adding_a_strategy_works_as_told(copy):
    """Do what CONTRIBUTING.md says, to the letter, in a copy of the project."""
    root, run = copy
    module, test, *_ = blocks(CONTRIBUTING, "python")
    (root / "ccfem/strategies/mean_tension.py").write_text(module)
    (root / "tests/strategies/test_mean_tension.py").write_text(test)
    (command,) = re.findall(r"^ +(pytest -n 0 .*mean_tension)$", CONTRIBUTING, flags=re.M)
    assert re.search(r"\d+ passed", run("-m", *command.split()))


@pytest.mark.usefixtures("coarse_bar")
def test_a_slicer_of_a_notebook_works_as_printed(capsys):
    """What the page defines is compared as it stands there, without a file in the package."""
    module = types.ModuleType("notebook")
    sys.modules["notebook"] = module
    try:
        for block in blocks(CONTRIBUTING, "python")[2:4]:
            exec(compile(block, "CONTRIBUTING.md", "exec"), vars(module))
    finally:
        del sys.modules["notebook"]
    heights = [layer.plane.height for layer in module.comparison.layers]
    assert heights == pytest.approx([5.0 * (k / 6.0) ** 2 for k in (1, 3, 5)])
    assert "[0.14, 1.25, 3.47]" in capsys.readouterr().out
    with pytest.raises(InputError, match=r"got the class Graded: write Graded\(\)"):
        ccfem.compare("bar", ["zigzag"], layers=module.Graded)


def test_adding_a_slicer_works_as_told(extended):
    root, said = extended
    assert "Number of layers, at least 1." in said["ccfem slicers graded"]
    heights = json.loads((root / "graded/results.json").read_text())["case"]["heights"]
    # A bar 5 mm high: the middles of three steps of the unit interval, squared.
    assert heights == pytest.approx([5.0 * (k / 6.0) ** 2 for k in (1, 3, 5)])


def table_of(folder):
    return pd.read_csv(folder / "results.csv").set_index("layer")


def test_adding_an_index_works_as_told(extended):
    """One file: its column is in the table; a bar 5 mm high has middles at 1.25 and 3.75 mm."""
    table = table_of(extended[0] / "levels")["mean_level"]
    assert table[["0", "1", "total"]].tolist() == pytest.approx([1.25, 3.75, 2.5], abs=0.02)


def test_adding_a_mesh_format_works_as_told(extended):
    """One file: a mesh written and read again is the same, and messages name the suffix."""
    volume, cells, known = extended[1]["both_ways.py"].split()
    assert (float(volume), int(cells), known) == (pytest.approx(24.0), 6, "True")


def test_adding_a_law_of_failure_works_as_told(extended):
    """One file: a bar without Poisson's effect, 4 x 4 mm, breaks at 30 MPa times its section."""
    root, said = extended
    loads = [float(load) for load in said["pulled.py"].split()]
    assert loads == pytest.approx([480.0] * 2, rel=1e-5)
    table = table_of(root / "brittle").loc["total"]
    assert 0.0 < table["first_failure_load"] <= table["brittle_matrix_load"]


def test_adding_a_machine_works_as_told(extended):
    """One file: it is listed, printed and used, and builds on the machine that it names."""
    root, said = extended
    assert "fibre_width = 0.8\n" in said["ccfem machines narrow"]
    assert "A head for narrow strands" in said["ccfem machines"]
    machine = json.loads((root / "narrow/results.json").read_text())["machine"]
    assert (machine["fibre_width"], machine["minimum_length"]) == (0.8, 30.0)
