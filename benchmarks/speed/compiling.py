"""What the first run of a command compiles, and how long that takes.

    python -m benchmarks.speed.compiling [COMMAND ...]

Runs a command of ccfem (default ``compare loop``) on one processor, first with an empty cache of
numba, then with the full one, and prints the processor seconds of both, those spent compiling by
wing, and the functions that take longest. Seconds of functions that are compiled within another one
count for themselves only.
"""

import ast
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from numba.core import event

_SHOWN = 15
"""Functions that are printed."""


class _Compilations(event.Listener):  # type: ignore[misc]
    """Hears of every function that is compiled, and keeps its processor seconds."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.count: dict[str, int] = defaultdict(int)
        self._open: list[list[float]] = []

    def on_start(self, event: Any) -> None:
        """Begin a compilation, within another one or not."""
        self._open.append([time.process_time(), 0.0])

    def on_end(self, event: Any) -> None:
        """Count a compilation, less those within it."""
        start, within = self._open.pop()
        took = time.process_time() - start
        if self._open:
            self._open[-1][1] += took
        function = event.data["dispatcher"].py_func
        name = f"{function.__module__}.{function.__qualname__}"
        self.seconds[name] += took - within
        self.count[name] += 1


def watched(command: Sequence[str], file: Path) -> None:
    """Run a command in this process, and write what it compiled: name, times, seconds."""
    from ccfem.cli.start import start

    heard = _Compilations()
    event.register("numba:compile", heard)
    sys.argv = ["ccfem", *command]
    try:
        start()
    finally:
        lines = [f"{name} {heard.count[name]} {heard.seconds[name]}" for name in heard.seconds]
        file.write_text("\n".join(lines), encoding="utf-8")


def _run(command: Sequence[str], cache: str, file: Path) -> float:
    """Processor seconds of a command in a process of its own."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache, "CCFEM_THREADS": "1"}
    before = sum(os.times()[2:4])
    code = "import sys; from benchmarks.speed.compiling import watched; from pathlib import Path; "
    code += "watched(sys.argv[2:], Path(sys.argv[1]))"
    run = [sys.executable, "-c", code, str(file), *command]
    subprocess.run(run, check=True, env=environment, capture_output=True)
    return sum(os.times()[2:4]) - before


def _wing(name: str) -> str:
    parts = name.split(".")
    return ".".join(parts[:2]) if parts[0] == "ccfem" else parts[0]


def _in_source() -> tuple[int, int]:
    """Count the compiled functions of ccfem, and their lines."""
    import ccfem

    count = lines = 0
    for file in Path(next(iter(ccfem.__path__))).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and "compiled" in map(_name, node.decorator_list):
                count, lines = count + 1, lines + (node.end_lineno or 0) - node.lineno + 1
    return count, lines


def _name(decorator: ast.expr) -> str:
    called = decorator.func if isinstance(decorator, ast.Call) else decorator
    return called.id if isinstance(called, ast.Name) else ""


def _heard(file: Path) -> dict[str, tuple[int, float]]:
    """Read times and seconds of each function from a file of `watched`."""
    rows = [line.split() for line in file.read_text(encoding="utf-8").splitlines()]
    return {name: (int(count), float(seconds)) for name, count, seconds in rows}


def main() -> None:
    """Print both runs, the wings and the slowest functions."""
    with tempfile.TemporaryDirectory() as folder:
        command = sys.argv[1:] or ["compare", "loop", "--force", "--out", f"{folder}/loop"]
        file = Path(folder) / "heard.txt"
        cold, functions = _run(command, folder, file), _heard(file)
        warm = _run(command, folder, file)
    compiling = sum(seconds for _, seconds in functions.values())
    print(f"first run {cold:.1f} CPU s, {compiling:.1f} of them compiling")
    print(f"next run {warm:.1f} CPU s")
    times = sum(count for count, _ in functions.values())
    print(f"{len(functions)} functions for {times} kinds of arguments")
    print("compiled functions in all of ccfem: {}, in {} lines".format(*_in_source()))
    wings: dict[str, float] = defaultdict(float)
    for name, (_, seconds) in functions.items():
        wings[_wing(name)] += seconds
    print("\nwing, CPU s")
    for wing, seconds in sorted(wings.items(), key=lambda item: -item[1]):
        print(f"{seconds:6.2f}  {wing}")
    print("\nfunction, CPU s, kinds of arguments")
    slowest = sorted(functions.items(), key=lambda item: -item[1][1])[:_SHOWN]
    for name, (count, seconds) in slowest:
        print(f"{seconds:6.2f} {count:3d}  {name}")


if __name__ == "__main__":
    main()
