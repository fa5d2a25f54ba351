"""Which tests reach a function: a plugin of pytest that writes it, and what reads it.

Run ``REACHED=FOLDER python -m pytest -p benchmarks.reached``: every process writes a file of rows,
``test: [seconds, ["ccfem/geometry/offsets.py:inset", ...]]``, of the tests that pass. Compiled
functions are not seen, nor what runs in a process of its own: `Reach` finds those that name them.
"""

import ast
import collections
import functools
import inspect
import json
import os
import sys
import threading
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TESTS, SECONDS = 100, 120.0
"""Most tests of a mutation, and most seconds that they took while they were traced."""
SCOPES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)

_reached: set = set()
_of_fixture: dict[str, set] = collections.defaultdict(set)
_of_test: dict[str, tuple[float, set]] = {}
_not_passed: set[str] = set()


def _note(frame, event, argument):
    _reached.add(frame.f_code)


def pytest_sessionstart():
    threading.settrace(_note)


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef):
    """Count what a fixture reaches for every test that asks for it, not for the first alone."""
    before = set(_reached)
    _reached.clear()
    try:
        return (yield)
    finally:
        _of_fixture[fixturedef.argname] |= _reached
        _reached.update(before)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    _reached.clear()
    start = time.perf_counter()
    sys.settrace(_note)
    try:
        return (yield)
    finally:
        sys.settrace(None)
        codes = _reached.union(*(_of_fixture[name] for name in getattr(item, "fixturenames", ())))
        _of_test[item.nodeid] = time.perf_counter() - start, codes


def pytest_runtest_logreport(report):
    if report.outcome != "passed":
        _not_passed.add(report.nodeid)


def pytest_sessionfinish(session):
    root = f"{session.config.rootpath}/"

    @functools.cache
    def key(code):
        """Name of a function, an inner one under its outermost one's; None if it is not ours."""
        inside = code.co_filename.startswith(root) and code.co_flags & inspect.CO_OPTIMIZED
        name = code.co_qualname.split(".<locals>")[0]
        return f"{code.co_filename.removeprefix(root)}:{name}" if inside else None

    rows = {
        test: [seconds, sorted({key(code) for code in codes} - {None})]
        for test, (seconds, codes) in _of_test.items()
        if test not in _not_passed
    }
    file = Path(os.environ["REACHED"], f"reached-{time.time_ns()}-{os.getpid()}.json")
    file.write_text(json.dumps(rows), encoding="utf-8")


@functools.cache
def text_of(file: Path) -> str:
    return file.read_text(encoding="utf-8")


def owner_of(parent: ast.AST, child: ast.AST, owner: str) -> str:
    """Dotted name of the outermost function, or class, or constant, that a node belongs to."""
    if isinstance(parent, ast.Module) and isinstance(child, ast.Assign | ast.AnnAssign):
        return ast.unparse(child.targets[0] if isinstance(child, ast.Assign) else child.target)
    if isinstance(parent, ast.Module | ast.ClassDef) and isinstance(child, SCOPES):
        return f"{owner}.{child.name}".lstrip(".")
    return owner


class Reach:
    """Which tests reach a function; a compiled function or a constant: by those that name it."""

    def __init__(self, folder: Path) -> None:
        rows: dict[str, tuple[float, list[str]]] = {}
        for file in sorted(folder.glob("reached-*.json")):
            rows |= json.loads(text_of(file))
        self.seconds = {test: seconds for test, (seconds, _) in rows.items()}
        self.width = {test: len(functions) for test, (_, functions) in rows.items()}
        self.tests: dict[str, set[str]] = collections.defaultdict(set)
        for test, (_, functions) in rows.items():
            for function in functions:
                self.tests[function].add(test)
        self.named_by: dict[str, set[str]] = collections.defaultdict(set)
        for file in [*(ROOT / "ccfem").rglob("*.py"), *(ROOT / "tests").rglob("*.py")]:
            self._names(ast.parse(text_of(file)), str(file.relative_to(ROOT)), "")

    def _names(self, node: ast.AST, file: str, owner: str) -> None:
        for child in ast.iter_child_nodes(node):
            name = getattr(child, "id", getattr(child, "attr", None))
            if owner and isinstance(name, str):
                self.named_by[name].add(f"{file}:{owner}")
            self._names(child, file, owner_of(node, child, owner))

    def of(self, function: str) -> set[str]:
        """Find the tests of ``file:name``; names with _ are looked for in their file alone."""
        near, seen = {function}, {function}
        while near:
            tests = set().union(*(self.tests[f] for f in near if f in self.tests))
            if tests:
                return tests
            callers = set()
            for file, _, owner in (f.partition(":") for f in near):
                owner = owner.removesuffix(".__init__").removesuffix(".__post_init__")
                name = owner.rpartition(".")[2]
                by = self.named_by[name]
                callers |= {f for f in by if name[:1] != "_" or f.startswith(f"{file}:")}
            near = callers - seen
            seen |= near
        return set()

    def chosen(self, function: str) -> list[str]:
        """Choose tests: those that reach least else first, a test's further parameters last."""
        often = collections.Counter[str]()
        ranked: list[tuple[int, int, str]] = []
        for test in sorted(self.of(function), key=lambda test: (self.width[test], test)):
            often[test.partition("[")[0]] += 1
            ranked.append((often[test.partition("[")[0]], len(ranked), test))
        chosen: list[str] = []
        left = SECONDS
        for _, _, test in sorted(ranked)[:TESTS]:
            if not chosen or self.seconds[test] < left:
                chosen.append(test)
                left -= self.seconds[test]
        return chosen
