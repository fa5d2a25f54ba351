"""Two kernels compiled by numba, and the same in C++.

    python -m benchmarks.speed.native

Builds ``native.cpp`` with the compiler of the system (``c++``, or that of the environment variable
CXX), checks that both give the same on the case `loop`, and prints the processor seconds of the
build and of the first call, the milliseconds of later ones (best of twenty), and the lines. With an
empty cache of numba (NUMBA_CACHE_DIR) the first call compiles, with a full one it loads.
"""

import ctypes
import inspect
import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ccfem.cases import create_case
from ccfem.fem.elasticity import assembly, direct, prepare

SOURCE = Path(__file__).with_suffix(".cpp")

_OF_ASSEMBLY = ("_gradients", "_times_gradient", "_against", "_mark", "_mirror", "_gather_linear")
_OF_SOLVES = ("_subtract", "_add_four", "_product", "_four_products", "_substitute_blocks")


def built(folder: str) -> tuple[ctypes.CDLL, float]:
    """Build the extension; return it and the processor seconds."""
    library = Path(folder) / "native.so"
    flags = ["-O3", "-march=native", "-ffast-math", "-shared", "-fPIC", "-o", str(library)]
    before = sum(os.times()[2:4])
    subprocess.run([os.environ.get("CXX", "c++"), *flags, str(SOURCE)], check=True)
    return ctypes.CDLL(str(library)), sum(os.times()[2:4]) - before


def _native(function: object, *arguments: Any) -> None:
    """Call a function of the extension with arrays and whole numbers."""
    given = [
        one.ctypes.data_as(ctypes.c_void_p) if isinstance(one, np.ndarray) else ctypes.c_int64(one)
        for one in arguments
    ]
    function(*given)  # type: ignore[operator]


def _seconds(work: Callable[[], np.ndarray]) -> tuple[np.ndarray, float, float]:
    """Return a result, the processor seconds of the first call, and the least of twenty more."""
    start = time.process_time()
    result, first = work(), time.process_time() - start
    later = []
    for _ in range(20):
        start = time.process_time()
        work()
        later.append(time.process_time() - start)
    return result, first, min(later)


def _lines(module: object, names: tuple[str, ...]) -> int:
    return sum(len(inspect.getsourcelines(getattr(module, n).py_func)[0]) for n in names)


def _compared(
    what: str, lines: int, numba: Callable[[], np.ndarray], native: Callable[[], np.ndarray]
) -> None:
    """Print a row, once both are seen to give the same."""
    (one, first, later), (other, first_native, later_native) = _seconds(numba), _seconds(native)
    np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-12 * float(np.abs(one).max()))
    print(
        f"{what:10s} first call {first:.2f} and {first_native:.3f} s, later {1e3 * later:.2f} and "
        f"{1e3 * later_native:.2f} ms; {lines} lines in numba"
    )


def main() -> None:
    """Print the build and both kernels."""
    problem = create_case("loop").problem
    mesh, stiffness = problem.mesh, np.ascontiguousarray(problem.material.stiffness)
    where = assembly.pattern(mesh)
    cells = np.ascontiguousarray(mesh.cells[where.order])
    rows = (where.indptr, where.indices, where.start, where.touching)

    def room() -> tuple[np.ndarray, ...]:
        blocks = np.zeros((len(where.indices), 3, 3))
        return np.empty((len(cells), 4, 3)), np.empty(len(cells)), blocks

    def by_numba() -> np.ndarray:
        slopes, volume, blocks = room()
        assembly._gradients(mesh.points, cells, slopes, volume)
        which = np.zeros_like(where.order)
        laws = stiffness.reshape(1, 6, 6)
        assembly._gather_linear(rows, cells, which, slopes, volume, laws, blocks)
        return blocks

    with tempfile.TemporaryDirectory() as folder:
        library, build = built(folder)
        lines = len(SOURCE.read_text(encoding="utf-8").splitlines())
        print(f"numba and C++; the build of {lines} lines of C++ takes {build:.1f} s")

        def by_native() -> np.ndarray:
            slopes, volume, blocks = room()
            _native(library.gradients, mesh.points, cells, len(cells), slopes, volume)
            about = (len(mesh.points), cells, slopes, volume, stiffness)
            _native(library.gather_linear, *rows, *about, blocks)
            return blocks

        _compared("assembly", _lines(assembly, _OF_ASSEMBLY), by_numba, by_native)

        system = prepare(problem)
        held = system.held_in(problem.cases[0])
        matrix = sp.csc_array(held.reduce(system.assemble()).tocsr())
        options = {"SymmetricMode": True}
        factor = splu(matrix, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        stored = direct.supernodes(factor)
        assert stored is not None
        blocks = (stored.first, stored.starts, stored.row_starts, stored.values, stored.rows)
        load = np.random.default_rng(0).normal(size=len(stored.order))

        def solved_by_numba() -> np.ndarray:
            x = load.copy()
            direct._substitute_blocks(*blocks, stored.pivots, x)
            return x

        def solved_by_native() -> np.ndarray:
            x = load.copy()
            sizes = (len(stored.first) - 1, len(x))
            _native(library.substitute_blocks, *blocks, stored.pivots, *sizes, x)
            return x

        _compared("solve", _lines(direct, _OF_SOLVES), solved_by_numba, solved_by_native)


if __name__ == "__main__":
    main()
