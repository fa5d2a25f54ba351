"""Break the code in one place at a time, and see whether its tests notice.

    REACHED=FOLDER python -m pytest -p benchmarks.reached
    python -m benchmarks.mutations COUNT FOLDER [SEED]

The first writes which tests reach which functions; run the tests before, so that compiling does not
count as theirs, and again for files that change. The second breaks COUNT places, spread over all
wings, each in a copy of the project, and runs the tests that reach it: one line a mutation, at last
the share that was caught. Lines also go to FOLDER/log.txt: a run that was cut off goes on, and a
later one tries again all that was not caught. What survives is judged by eye: some mutations change
nothing.
"""

import ast
import collections
import itertools
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from benchmarks.reached import ROOT, Reach, owner_of, text_of

PROCESSES = 2
APART = (".git", ".venv", "venv", "results")
"""What is not copied with the project."""
START, COMPILATION = 60.0, 240.0
"""Seconds that a run may take to start, and to compile what a broken compiled function is in."""

TWINS = (
    (ast.Lt, ast.LtE),
    (ast.Gt, ast.GtE),
    (ast.Eq, ast.NotEq),
    (ast.Add, ast.Sub),
    (ast.Mult, ast.Div),
    (ast.And, ast.Or),
)
SWAPS: dict[type, type] = {old: new for a, b in TWINS for old, new in ((a, b), (b, a))}


def places(node: ast.AST, owner: str = "") -> Iterator[tuple[str, Any, str]]:
    """Owner, node and field of what can be broken; what is only printed (f-strings) is left out."""
    if isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in SWAPS:
        yield owner, node, "op"
    elif isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPS:
        yield owner, node, "ops"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield owner, node, "operand"
    elif isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value != 0.0:
        yield owner, node, "value"
    elif isinstance(node, ast.Raise):
        yield owner, node, "exc"
    for child in () if isinstance(node, ast.JoinedStr) else ast.iter_child_nodes(node):
        yield from places(child, owner_of(node, child, owner))


def broken(source: str, number: int) -> tuple[str, str, str]:
    """Source with one place broken, its owner, and its line with what was done there."""
    tree = ast.parse(source)
    owner, node, field = list(places(tree))[number]
    before, new = ast.unparse(node), node
    if field == "op":
        node.op = SWAPS[type(node.op)]()
    elif field == "ops":
        node.ops[0] = SWAPS[type(node.ops[0])]()
    elif field == "value":
        node.value *= 1.5
    else:
        new = ast.Pass() if field == "exc" else node.operand
        for parent in ast.walk(tree):
            for name, value in ast.iter_fields(parent):
                if value is node:
                    setattr(parent, name, new)
                elif isinstance(value, list):
                    value[:] = [new if item is node else item for item in value]
    what = f"{node.lineno}: {before[:80]} -> {ast.unparse(new)[:80]}"
    return ast.unparse(ast.fix_missing_locations(tree)), owner, " ".join(what.split())


def stale_modules(module: Path) -> set[str]:
    """Compiled modules that stand on a module: their cached code still holds what it was."""
    compiled = [file for file in (ROOT / "ccfem").rglob("*.py") if "@compiled" in text_of(file)]
    files, size = {module}, 0
    while size < len(files):
        size = len(files)
        dotted = [".".join(f.relative_to(ROOT).with_suffix("").parts) for f in files]
        files |= {
            f for f in compiled if any(f"from {name} import" in text_of(f) for name in dotted)
        }
    return {file.stem for file in files if "@compiled" in text_of(file)}


def fate(module: Path, text: str, tests: list[str], seconds: float) -> str:
    """Break a module in a copy of the project, and run tests there."""
    stale = stale_modules(module)
    ignored = shutil.ignore_patterns(*APART, *(f"{name}.*.nb[ic]" for name in stale))
    with tempfile.TemporaryDirectory() as copy:
        shutil.copytree(ROOT, copy, ignore=ignored, dirs_exist_ok=True)
        Path(copy, module.relative_to(ROOT)).write_text(text, encoding="utf-8")
        words = [sys.executable, "-m", "pytest", "-x", "-n", "0", "-p", "no:cacheprovider", *tests]
        environment = os.environ | {"PYTHONPATH": copy}
        limit = START + 3.0 * seconds + COMPILATION * bool(stale)
        try:
            run = subprocess.run(
                words, cwd=copy, env=environment, capture_output=True, timeout=limit
            )
        except subprocess.TimeoutExpired:
            return "time out"
    old = text_of(module)
    if run.returncode > 1 and text != old and fate(module, old, tests, seconds) != "SURVIVED":
        raise RuntimeError(f"the tests of {module} do not run: {run.stdout.decode()[-2000:]}")
    return "caught" if run.returncode else "SURVIVED"


def drawn(count: int, seed: int) -> list[tuple[Path, int]]:
    """Modules and numbers of places, in turn from every wing, none twice."""
    dice = random.Random(seed)
    wings: dict[str, list[tuple[Path, int]]] = collections.defaultdict(list)
    for module in sorted((ROOT / "ccfem").glob("*/**/*.py")):
        wing = wings[module.relative_to(ROOT / "ccfem").parts[0]]
        wing += [(module, number) for number, _ in enumerate(places(ast.parse(text_of(module))))]
    turns = [dice.sample(wing, min(count, len(wing))) for wing in wings.values()]
    rounds = itertools.chain(*itertools.zip_longest(*turns))
    return [place for place in rounds if place is not None][:count]


def main() -> None:
    """Break and test."""
    folder = Path(sys.argv[2])
    chosen = drawn(int(sys.argv[1]), int(sys.argv[3]) if len(sys.argv) > 3 else 0)
    reach, log = Reach(folder), folder / "log.txt"
    lines = log.read_text(encoding="utf-8").splitlines() if log.exists() else []
    became = {line[9:]: line[:9].strip() for line in lines}

    def judged(module: Path, number: int) -> bool:
        text, owner, what = broken(text_of(module), number)
        name = module.relative_to(ROOT)
        where = f"{name}:{what}"
        if became.get(where) != "caught":
            tests = reach.chosen(f"{name}:{owner}")
            seconds = sum(reach.seconds[test] for test in tests)
            became[where] = fate(module, text, tests, seconds) if tests else "no test"
            with log.open("a", encoding="utf-8") as file:
                file.write(f"{became[where]:8} {where}\n")
        print(f"{became[where]:8} {where}", flush=True)
        return became[where] in ("caught", "time out")

    with ThreadPoolExecutor(PROCESSES) as pool:
        caught = sum(pool.map(judged, *zip(*chosen, strict=True)))
    print(f"{caught} of {len(chosen)} mutations were caught, {caught / len(chosen):.0%}")


if __name__ == "__main__":
    main()
