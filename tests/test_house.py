"""The house: no import circle, a room stands above all that it imports, few and short files."""

import ast
import importlib
import inspect
import re
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "ccfem"

TWICE = {
    "problem": "in space and in the plane",
}
"""Names of modules that occur twice, since they are the same idea for two kinds of thing."""


@cache
def modules() -> dict[str, Path]:
    """File of every module by its dotted name."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def nodes() -> dict[str, list[ast.AST]]:
    """All nodes of the text of every module: parsed once, for all that look at them."""
    return {
        name: list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        for name, path in modules().items()
    }


@cache
def imports() -> dict[str, set[str]]:
    """Modules of ccfem that each imports, anywhere in its text: in functions and for types too."""
    known = modules()
    found: dict[str, set[str]] = {name: set() for name in known}
    for name in known:
        for node in nodes()[name]:
            if isinstance(node, ast.Import):
                found[name] |= {alias.name for alias in node.names if alias.name in known}
            elif isinstance(node, ast.ImportFrom) and node.module in known:
                inner = (f"{node.module}.{alias.name}" for alias in node.names)
                found[name] |= {one if one in known else node.module for one in inner}
    return found


WINGS = (
    *("base", "geometry", "body", "fem", "machine", "slicing", "paths", "judging", "strategies"),
    *("printing", "cases", "comparison", "workbench", "papers", "cli"),
)
"""The packages below ccfem, each above all that it imports.

Geometry is of points and triangles alone, so it stands below bodies; strategies that plan by tests
stand above the judge.
"""


def room(module: str) -> str:
    """First package below ccfem, or the loose module."""
    return module.split(".")[1] if "." in module else module


def circle(graph: dict[str, set[str]]) -> list[str]:
    """A circle of a graph, or nothing."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_a_circle_is_found():
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}})
    assert not circle({"a": {"b", "c"}, "b": {"c"}})


def test_no_file_imports_in_a_circle():
    # Without this the walk below might see nothing at all.
    assert "ccfem.base.tensor" in imports()["ccfem.paths.fields.tensile"]
    assert not circle(imports())


def test_wings_stand_in_their_order():
    packages = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").exists()}
    assert packages == set(WINGS)
    wrong = [
        (name, other)
        for name, wanted in imports().items()
        for other in wanted
        if {room(name), room(other)} <= packages
        and WINGS.index(room(other)) > WINGS.index(room(name))
    ]
    assert not wrong


def test_the_core_does_not_draw():
    drawing = {"comparison", "workbench", "cli", "papers"}
    plot = "ccfem.comparison.plot"
    wanted = {name for name, those in imports().items() if any(o.startswith(plot) for o in those)}
    assert {room(name) for name in wanted} <= drawing


def test_tetrahedra_know_nothing_of_plates():
    for name, wanted in imports().items():
        if name.startswith("ccfem.fem.elasticity"):
            assert not {one for one in wanted if one.startswith("ccfem.fem.plates")}, name


def test_no_loose_modules():
    assert sorted(path.stem for path in PACKAGE.glob("*.py")) == ["__init__", "__main__"]


def test_no_file_above_seven_hundred_lines():
    long = {name for name, path in modules().items() if len(path.read_text().splitlines()) > 700}
    assert not long


def test_no_name_twice_for_two_ideas():
    named = defaultdict(list)
    for name, path in modules().items():
        if name.startswith("ccfem.body.files.formats."):  # named as files end
            continue
        if path.stem != "__init__" and room(name) != "papers":  # each paper has the same shape
            named[path.stem].append(name)
    assert {stem for stem, those in named.items() if len(those) > 1} == set(TWICE)


def test_no_module_is_hidden_by_a_function_of_its_name():
    """``ccfem.fem.elasticity.solve`` is a function: no one would find a module of that name."""
    for name, path in modules().items():
        if path.stem == "__init__":
            face = importlib.import_module(name)
            inside = {module.removeprefix(f"{name}.") for module in modules()}
            known = inside & {*vars(face), *getattr(face, "__all__", ())}
            hidden = {stem for stem in known if not inspect.ismodule(getattr(face, stem))}
            assert not hidden, name


def test_only_pickles_of_processes_of_its_own_are_read():
    """What comes through pipes of its own, or from the cluster named; nothing from a folder."""
    loading = {"pickle", "cloudpickle", "dill", "joblib", "shelve", "marshal"}
    known = []
    for name, path in modules().items():
        text = path.read_text(encoding="utf-8")
        for node in nodes()[name]:
            if isinstance(node, ast.Import | ast.ImportFrom):
                wanted = [alias.name for alias in node.names] + [getattr(node, "module", "") or ""]
                if loading.intersection(word.partition(".")[0] for word in wanted):
                    known.append(name)
        assert "allow_pickle=True" not in text, name
        assert "read_pickle" not in text, name
    cluster, pipes = "ccfem.base.cluster", "ccfem.base.parallel"
    assert set(known) == {cluster, pipes, "ccfem.comparison.studies.transport"}


def test_tables_with_text_are_written_in_one_place():
    """Where no name is taken for a formula; other CSV files hold numbers and fixed words."""
    writing = {
        name
        for name, path in modules().items()
        if {"writer(", "DictWriter(", "to_csv("} & set(re.findall(r"\w+\(", path.read_text()))
    }
    assert writing == {"ccfem.base.csv_table"}


REDUCTIONS = ("sum", "min", "max", "any", "all", "argmin", "argmax", "mean")


def slow_to_compile(function):
    """What a compiled function does that takes long to compile."""
    for node in ast.walk(function):
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        if isinstance(node, ast.Assign | ast.AugAssign) and any(
            isinstance(part, ast.Slice) for target in targets for part in ast.walk(target)
        ):
            yield f"assigns to a slice: {ast.unparse(node)}"
        called = node.func if isinstance(node, ast.Call) else None
        if isinstance(called, ast.Attribute) and called.attr in REDUCTIONS:
            yield f"reduces an array: {ast.unparse(node)}"


def test_slow_to_compile_is_found():
    text = "def f(a):\n    a[:] = 0.0\n    return a.max() + np.argmin(a)"
    assert len(list(slow_to_compile(ast.parse(text)))) == 3


def compiled():
    """Compiled functions, by their dotted names."""
    for name, those in nodes().items():
        for node in those:
            if isinstance(node, ast.FunctionDef) and any(
                "compiled" in ast.unparse(decorator) for decorator in node.decorator_list
            ):
                yield f"{name}.{node.name}", node


def test_compiled_functions_work_number_by_number():
    """Error messages for shapes that do not fit, say, are compiled too: that takes seconds."""
    slow = [f"{name} {what}" for name, node in compiled() for what in slow_to_compile(node)]
    assert not slow


def test_compiled_functions_have_few_parameters_of_known_types():
    """More than eight are a value: a `NamedTuple`, which compiled functions take as it is."""
    functions = dict(compiled())
    assert len(functions) > 100
    texts = {name: path.read_text(encoding="utf-8") for name, path in modules().items()}
    numba = [name for name, text in texts.items() if "njit" in text]
    assert numba == ["ccfem.base.compiled"]  # all are compiled by one decorator
    assert not [name for name, node in functions.items() if len(node.args.args) > 8]
    untyped = [
        name
        for name, node in functions.items()
        if node.returns is None or any(a.annotation is None for a in node.args.args)
    ]
    assert not untyped


def unstable_sorts(those):
    """Where nodes put equal values in an order that the processor decides."""
    for node in those:
        called = node.func if isinstance(node, ast.Call) else None
        if isinstance(called, ast.Attribute) and called.attr in ("argsort", "argpartition"):
            kind = [ast.unparse(word.value) for word in node.keywords if word.arg == "kind"]
            if kind != ["'stable'"]:
                yield ast.unparse(node)


def test_unstable_sort_is_found():
    text = "a = np.argsort(b)\nc = np.argsort(b, kind='stable')\nd = np.argpartition(b, 3)"
    unstable = list(unstable_sorts(ast.walk(ast.parse(text))))
    assert unstable == ["np.argsort(b)", "np.argpartition(b, 3)"]


def test_equal_values_keep_their_order_on_every_processor():
    """NumPy sorts otherwise with and without AVX-512: a mesh once differed from one to the other.

    SciPy's reverse Cuthill-McKee sorts so inside; `ccfem.body.mesh.numbering` stands in for it.
    """
    found = []
    for name, those in nodes().items():
        found += [f"{name}: {what}" for what in unstable_sorts(those)]
        if name != "ccfem.body.mesh.numbering":
            found += [
                f"{name} imports SciPy's reverse_cuthill_mckee"
                for node in those
                if isinstance(node, ast.ImportFrom)
                and str(node.module).startswith("scipy")
                and "reverse_cuthill_mckee" in [alias.name for alias in node.names]
            ]
    assert not found


CLOCKS = {
    "ccfem.cli.run",
    "ccfem.comparison.effort",
    "ccfem.comparison.expected",
    "ccfem.comparison.files",
    "ccfem.comparison.stages",
    "ccfem.fem.elasticity.statics",
    "ccfem.base.progress",
    "ccfem.comparison.studies.running",
    "ccfem.judging.virtual_testing.stiffness_test",
}
"""Modules that read a clock: to record the seconds of a stage, or to say how long it will take."""


def test_no_result_depends_on_the_clock():
    readers = set()
    for name, those in nodes().items():
        for node in those:
            named = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if "time" in named or (isinstance(node, ast.ImportFrom) and node.module == "time"):
                readers.add(name)
    assert {name for name in readers if room(name) != "papers"} <= CLOCKS
