"""Count what a reader of the code has to hold in the head: lines, rooms, arrows, twins, words.

Run ``python benchmarks/house.py``, or ``python benchmarks/house.py REVISION`` for the same beside
the counts of another commit.
"""

import ast
import io
import re
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def modules(root: Path) -> dict[str, ast.Module]:
    """Syntax tree of every module of the package, by its dotted name."""
    trees = {}
    for path in sorted((root / "ccfem").rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        trees[name] = ast.parse(path.read_text(encoding="utf-8"))
    return trees


def imported(tree: ast.Module, known: dict[str, ast.Module]) -> Iterator[str]:
    """Modules of the package that a module imports, in functions too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom) and node.module in known:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in known else node.module


def faces(tree: ast.Module) -> list[str]:
    """Names that a package imports from modules of these names, which they hide."""
    taken = {
        alias.asname or alias.name: node.module
        for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }  # fmt: skip
    return [name for name, source in taken.items() if str(source).endswith(f".{name}")]


def counts(root: Path) -> dict[str, int]:
    """Return the counts of one checkout."""
    trees = modules(root)
    text = {
        name: path.read_text(encoding="utf-8")
        for name, path in ((p.as_posix(), p) for p in (root / "ccfem").rglob("*.py"))
    }
    whole = "\n".join(text.values())
    arrows, users = set(), dict.fromkeys(trees, 0)
    for name, tree in trees.items():
        wanted = set(imported(tree, trees)) - {name}
        for other in wanted:
            users[other] += 1
            rooms = [module.split(".")[1] for module in (name, other) if "." in module]
            if len(set(rooms)) == 2:
                arrows.add(tuple(rooms))
    functions = [
        node for tree in trees.values() for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
    ]  # fmt: skip
    parameters = [
        len(f.args.args) + len(f.args.kwonlyargs)
        for f in functions
        if not any("Annotated" in ast.unparse(a.annotation) for a in f.args.args if a.annotation)
    ]
    return {
        "lines of ccfem": whole.count("\n"),
        "files": len(text),
        "rooms": len({name.split(".")[1] for name in trees if "." in name}),
        "arrows between rooms": len(arrows),
        "modules that one other imports": sum(n == 1 for n in users.values()),
        "functions of more than ten parameters": sum(n > 10 for n in parameters),
        "compiled functions of more than eight": sum(
            len(f.args.args) > 8 and any("compiled" in ast.unparse(d) for d in f.decorator_list)
            for f in functions
        ),
        "tests of `cases is None`": len(re.findall(r"\bcases is (?:not )?None", whole)),
        "tests of `flat is None`": len(re.findall(r"\bflat is (?:not )?None", whole)),
        "dict[str, Any] in signatures": sum(
            bool(re.match(r"(dict|Mapping)\[str, Any\]", ast.unparse(a.annotation)))
            for f in functions for a in (*f.args.args, *f.args.kwonlyargs) if a.annotation
        ),
        "modules hidden by a function": sum(
            f"{name}.{given}" in trees
            for name, tree in trees.items() for given in faces(tree)
        ),
        "words of the README": len((root / "README.md").read_text(encoding="utf-8").split()),
        "words of the changelog": len((root / "CHANGELOG.md").read_text(encoding="utf-8").split()),
    }  # fmt: skip


def of_revision(revision: str) -> dict[str, int]:
    """Return the counts of a commit."""
    packed = subprocess.run(
        ["git", "archive", revision], cwd=ROOT, capture_output=True, check=True
    ).stdout
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
            archive.extractall(folder, filter="data")
        return counts(Path(folder))


def main() -> None:
    """Print the counts, beside those of a revision where one is named."""
    now = counts(ROOT)
    before = of_revision(sys.argv[1]) if len(sys.argv) > 1 else {}
    for name, count in now.items():
        print(f"{name:40}{before.get(name, ''):>10}{count:>10}")


if __name__ == "__main__":
    main()
