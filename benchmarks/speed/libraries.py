"""Own numerical code beside the libraries that could take its place, in one run.

    python -m benchmarks.speed.libraries [TOOL ...]

For each tool: the processor time of the library as a multiple of ours, both warm (the best of
several calls, by turns); the seconds of the first call in a new process, ours with nothing
compiled, beyond what the first compiled function of any program costs; and how far the results
differ. A library takes the place of own code where it is at most 10 % slower warm, or saves seconds
on the first call for a loss that nobody notices, with the same results.
"""

import os

for _library in ("OMP", "MKL", "OPENBLAS", "NUMBA"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import subprocess  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
import time  # noqa: E402
from collections.abc import Callable  # noqa: E402
from functools import cache  # noqa: E402
from typing import Any, NamedTuple  # noqa: E402

import numpy as np  # noqa: E402
import scipy.sparse as sp  # noqa: E402
import shapely  # noqa: E402
from scipy.linalg import cho_solve_banded, cholesky_banded  # noqa: E402
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree  # noqa: E402
from scipy.sparse.linalg import LinearOperator, cg  # noqa: E402
from scipy.spatial import Delaunay  # noqa: E402

ROUNDS = 7
"""Calls of each, of which the fastest counts."""


class Rivals(NamedTuple):
    """Two functions without arguments that return the same arrays."""

    library: str
    ours: Callable[[], Any]
    theirs: Callable[[], Any]


@cache
def stiffness() -> tuple[sp.bsr_array, np.ndarray, np.ndarray]:
    """Stiffness of a box with 20 k unknowns, the points of its rows, and a load."""
    from ccfem.body.mesh.box import box_mesh
    from ccfem.fem.elasticity import Force, Problem, Support
    from ccfem.fem.elasticity.system import prepare
    from ccfem.fem.materials import isotropic

    mesh = box_mesh((80.0, 30.0, 20.0), (37, 14, 11))
    load = {"pull": (Force("x_max", (1.0, 0.0, 0.0)),)}
    system = prepare(Problem(mesh, isotropic(3500.0, 0.3), (Support("x_min"),), load))
    matrix = system.held.reduce(system.assemble())
    load = np.random.default_rng(0).normal(size=matrix.shape[0])
    return matrix, mesh.points[system.held.nodes], load


@cache
def triangulation(dimension: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random points of a square or cube of 50 mm, their simplices, and places in it."""
    rng = np.random.default_rng(dimension)
    points = 50.0 * rng.random((count, dimension))
    return points, Delaunay(points).simplices.astype(np.int64), 50.0 * rng.random((5000, dimension))


def conjugate_gradient() -> Rivals:
    """With our multigrid. Ours also returns the lowest eigenvalue, which bounds the error."""
    from ccfem.fem.elasticity.conjugate_gradient import conjugate_gradient as ours
    from ccfem.fem.elasticity.multigrid import smoothed_aggregation

    matrix, points, load = stiffness()
    cycle = smoothed_aggregation(matrix, points, frugal=True)
    theirs = LinearOperator(matrix.shape, matvec=cycle)
    return Rivals(
        "scipy cg",
        lambda: ours(matrix, load, cycle, tolerance=1e-8)[0],
        lambda: cg(matrix, load, rtol=1e-8, M=theirs)[0],
    )


def block_product() -> Rivals:
    """Product of a matrix of 3 x 3 blocks and a vector."""
    from ccfem.fem.elasticity.block_product import times

    matrix, _, load = stiffness()
    return Rivals("scipy.sparse", lambda: times(matrix, load), lambda: matrix @ load)


def supernodes() -> Rivals:
    """One solve with a factor of SuperLU, which ours stores in another way once."""
    from ccfem.fem.elasticity.direct import superlu

    matrix, _, load = stiffness()
    plain, again = superlu(matrix), cache(lambda: superlu(matrix, often=True))
    return Rivals("SuperLU solve", lambda: again()(load), lambda: plain(load))


def skyline() -> Rivals:
    """Factorise, and solve, a matrix with the pattern of 100 x 40 cells of a plate."""
    from ccfem.fem.elasticity.direct import skyline as ours

    along, up = (
        sp.diags_array([1.0, 4.0, 1.0], offsets=[-1, 0, 1], shape=(n, n)) for n in (101, 41)
    )
    matrix = sp.kron(sp.kron(along, up), [[2.0, 1.0], [1.0, 2.0]]).tobsr((2, 2))
    matrix.sort_indices()
    load = np.random.default_rng(1).normal(size=matrix.shape[0])

    def banded() -> np.ndarray:
        entries = matrix.tocoo()
        below = entries.row - entries.col
        kept = below >= 0
        band = np.zeros((below.max() + 1, len(load)), order="F")
        band[below[kept], entries.col[kept]] = entries.data[kept]
        factor = cholesky_banded(band, overwrite_ab=True, lower=True, check_finite=False)
        return cho_solve_banded((factor, True), load, check_finite=False)

    return Rivals("LAPACK pbtrf", lambda: ours(matrix)(load), banded)


def locate() -> Rivals:
    """Triangles that hold 5,000 places of the plane."""
    from ccfem.geometry.locate import locate as ours

    points, triangles, places = triangulation(2, 5000)

    def tree() -> np.ndarray:
        searched = shapely.STRtree(shapely.polygons(points[triangles]))
        place, triangle = searched.query(shapely.points(places), predicate="intersects")
        holder = np.full(len(places), -1)
        holder[place] = triangle
        return holder

    return Rivals("shapely STRtree", lambda: ours(points, triangles, places)[0], tree)


def locate_in_space() -> Rivals:
    """Tetrahedra of 5,000 points; VTK also takes neighbours, within a tolerance of its own."""
    from ccfem.geometry.locate import locate as ours

    points, cells, places = triangulation(3, 5000)

    def static_locator() -> np.ndarray:
        import pyvista as pv
        from vtkmodules.vtkCommonDataModel import vtkStaticCellLocator

        searched = vtkStaticCellLocator()
        searched.SetDataSet(pv.UnstructuredGrid({pv.CellType.TETRA: cells}, points))
        searched.BuildLocator()
        return np.array([searched.FindCell(place) for place in places.tolist()])

    return Rivals("VTK locator", lambda: ours(points, cells, places)[0], static_locator)


def find_crossings() -> Rivals:
    """Find crossings of 220 diagonal strands, whose boxes all overlap, and one across them."""
    from ccfem.judging.evaluation.indices.crossings import find_crossings as ours

    lines = [[[0.0, 0.9 * k], [200.0, 0.9 * k + 150.0]] for k in range(220)]
    points = np.concatenate([*lines, [[10.0, 0.0], [15.0, 340.0]]])
    offsets = np.arange(0, len(points) + 1, 2)

    def tree() -> np.ndarray:
        first = np.setdiff1d(np.arange(len(points)), offsets[1:] - 1)
        segments = shapely.linestrings(np.stack([points[first], points[first + 1]], axis=1))
        a, b = shapely.STRtree(segments).query(segments)
        a, b = a[first[b] - first[a] > 1], b[first[b] - first[a] > 1]
        cross = shapely.crosses(segments[a], segments[b])
        return np.stack([first[a[cross]], first[b[cross]]], axis=1)

    open_ends = np.zeros(len(offsets) - 1, dtype=bool)
    return Rivals("shapely STRtree", lambda: ours(points, offsets, open_ends), tree)


def orient() -> Rivals:
    """Give the directions of 10,000 triangles like senses along a minimum spanning tree."""
    from ccfem.paths.fields.tensile import orient as ours

    points, _, _ = triangulation(2, 5000)
    beside = Delaunay(points).neighbors
    pairs = np.stack([np.repeat(np.arange(len(beside)), 3), beside.ravel()], axis=1)
    pairs = pairs[pairs[:, 1] > pairs[:, 0]]
    direction = np.random.default_rng(2).normal(size=(len(beside), 2))
    direction /= np.linalg.norm(direction, axis=1)[:, None]

    def graph() -> np.ndarray:
        """Two copies of each triangle, one of either sense: a side of the tree joins like ones."""
        count = len(direction)
        product = np.einsum("ij,ij->i", *direction[pairs.T])
        order = np.argsort(-np.abs(product), kind="stable")
        ranks = sp.csr_array((np.arange(1.0, len(order) + 1), pairs[order].T), (count, count))
        taken = order[minimum_spanning_tree(ranks).data.astype(int) - 1]
        (a, b), turned = pairs[taken].T, product[taken] < 0.0
        ends = np.concatenate([b + count * turned, b + count * ~turned])
        both = (np.ones(len(ends)), (np.concatenate([a, a + count]), ends))
        _, piece = connected_components(sp.csr_array(both, (2 * count, 2 * count)), directed=False)
        return direction * np.where(piece[:count] < piece[count:], 1.0, -1.0)[:, None]

    return Rivals("scipy csgraph", lambda: ours(direction, pairs), graph)


TOOLS = (
    conjugate_gradient,
    block_product,
    supernodes,
    skyline,
    locate,
    locate_in_space,
    find_crossings,
    orient,
)


def seconds(call: Callable[[], Any]) -> float:
    """Processor time of a call."""
    start = time.process_time()
    call()
    return time.process_time() - start


def first_call(tool: str, side: str) -> float:
    """Processor seconds that a first call in a new process takes longer than a second one."""
    # What numba needs for the first function of all is not laid to the charge of this one.
    child = (
        "import numba, numpy; numba.njit(lambda a: a + 1.0)(numpy.zeros(2))\n"
        "from benchmarks.speed import libraries as own\n"
        f"call = own.{tool}().{side}; print(own.seconds(call) - own.seconds(call))"
    )
    with tempfile.TemporaryDirectory() as empty:
        environment = {**os.environ, "NUMBA_CACHE_DIR": empty}
        run = subprocess.run(
            [sys.executable, "-c", child], env=environment, capture_output=True, text=True
        )
    return float(run.stdout) if run.returncode == 0 else float("nan")


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference as a share of the largest value; of indices, the share that differs."""
    if a.dtype.kind == "i":
        return float((a != b).mean()) if a.size else float(b.size > 0)
    return float(np.abs(a - b).max() / np.abs(a).max())


def main() -> None:
    """Print a row for each tool."""
    print(f"{'tool':24}{'library':18}{'ours, ms':>9}{'ratio':>7}{'first call, s':>16}  difference")
    for tool in TOOLS:
        name = tool.__name__
        if sys.argv[1:] and name not in sys.argv[1:]:
            continue
        rivals = tool()
        apart = difference(np.asarray(rivals.ours()), np.asarray(rivals.theirs()))
        pairs = [(seconds(rivals.ours), seconds(rivals.theirs)) for _ in range(ROUNDS)]
        ours, theirs = (min(side) for side in zip(*pairs, strict=True))
        first = f"{first_call(name, 'ours'):.2f} / {first_call(name, 'theirs'):.2f}"
        print(
            f"{name:24}{rivals.library:18}{1e3 * ours:9.2f}{theirs / ours:7.2f}{first:>16}"
            f"{apart:12.1e}",
            flush=True,
        )


if __name__ == "__main__":
    main()
