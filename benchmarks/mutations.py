"""Break the code in one place at a time, and see whether its tests notice.

Run ``python benchmarks/mutations.py COUNT [SEED]``: one line a mutation, at last the share that was
caught. Mutations are spread over all wings; each runs the tests that name its module, in a copy of
the project, for at most two minutes a mutation.
"""

import ast
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SECONDS = 120.0
TESTS = 4
"""Most test files that are run for a mutation."""

SWAPS: dict[type, type] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.And: ast.Or,
    ast.Or: ast.And,
}


def places(tree: ast.Module) -> Iterator[tuple[ast.AST, str]]:
    """Nodes that can be broken, and the field to break; docstrings and annotations are none."""
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in SWAPS:
            yield node, "op"
        elif isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPS:
            yield node, "ops"
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
            yield node, "operand"
        elif isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value != 0.0:
            yield node, "value"
        elif isinstance(node, ast.Raise):
            yield node, "exc"


def broken(source: str, number: int) -> tuple[str, int, str]:
    """Source with one place broken, its line, and what was done there."""
    tree = ast.parse(source)
    node, field = list(places(tree))[number]
    before = ast.unparse(node)
    if field == "op":
        node.op = SWAPS[type(node.op)]()  # type: ignore[attr-defined]
    elif field == "ops":
        node.ops[0] = SWAPS[type(node.ops[0])]()  # type: ignore[attr-defined]
    elif field == "value":
        node.value *= 1.5  # type: ignore[attr-defined]
    elif field == "exc":
        node = _replaced(tree, node, ast.Pass())
    else:
        node = _replaced(tree, node, node.operand)  # type: ignore[attr-defined]
    line = getattr(node, "lineno", 0)
    return ast.unparse(ast.fix_missing_locations(tree)), line, f"{before[:60]} -> {field}"


def _replaced(tree: ast.Module, old: ast.AST, new: ast.AST) -> ast.AST:
    """Put another node in the place of one."""
    for parent in ast.walk(tree):
        for name, value in ast.iter_fields(parent):
            if value is old:
                setattr(parent, name, new)
            elif isinstance(value, list) and any(item is old for item in value):
                setattr(parent, name, [new if item is old else item for item in value])
    return ast.copy_location(new, old)


def tests_of(module: Path) -> list[Path]:
    """Test files that name a module, those that mirror it first."""
    dotted = ".".join(module.relative_to(ROOT).with_suffix("").parts)
    package, _, name = dotted.rpartition(".")
    direct = re.compile(
        rf"\b{re.escape(dotted)}\b|from {re.escape(package)} import [^\n]*\b{name}\b"
    )
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    named = [file for file in files if direct.search(file.read_text(encoding="utf-8"))]
    mirror = ROOT / "tests" / module.relative_to(ROOT / "ccfem").parent
    named.sort(key=lambda file: (file.stem != f"test_{name}", file.parent != mirror))
    return named[:TESTS]


def main() -> None:
    """Break and test."""
    count, seed = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    dice = random.Random(seed)
    wings: dict[str, list[Path]] = {}
    for module in sorted((ROOT / "ccfem").rglob("*.py")):
        wing = module.relative_to(ROOT / "ccfem").parts[0]
        if module.name != "__init__.py" and list(places(ast.parse(module.read_text("utf-8")))):
            wings.setdefault(wing, []).append(module)
    caught = tried = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "project"
        ignored = shutil.ignore_patterns(".git", "results")
        shutil.copytree(ROOT, copy, ignore=ignored)
        while tried < count:
            module = dice.choice(wings[sorted(wings)[tried % len(wings)]])
            tests = tests_of(module)
            source = module.read_text("utf-8")
            number = dice.randrange(len(list(places(ast.parse(source)))))
            text, line, what = broken(source, number)
            tried += 1
            where = f"{module.relative_to(ROOT)}:{line}: {what}"
            if not tests:
                print(f"no test  {where}", flush=True)
                continue
            changed = copy / module.relative_to(ROOT)
            changed.write_text(text, encoding="utf-8")
            command = [
                sys.executable,
                "-m",
                "pytest",
                "-q",
                "-x",
                "-n",
                "0",
                "-p",
                "no:cacheprovider",
            ]
            command += [str(test.relative_to(ROOT)) for test in tests]
            try:
                done = subprocess.run(
                    command, cwd=copy, capture_output=True, timeout=SECONDS, check=False
                )
                noticed = done.returncode != 0
            except subprocess.TimeoutExpired:
                noticed = True
            changed.write_text(source, encoding="utf-8")
            caught += noticed
            print(f"{'caught' if noticed else 'SURVIVED':8} {where}", flush=True)
    print(f"{caught} of {tried} mutations were caught, {caught / tried:.0%}")


if __name__ == "__main__":
    main()
