import gc
import os
import signal
import subprocess

import numpy as np
import pytest
from forked_children import ForkedChildren

from ccfem.body.isolated import process
from ccfem.body.mesh import TetMesh
from ccfem.cases.bodies import BODIES

CUBE = np.array(
    [[0, 1, 3, 7], [0, 1, 7, 5], [0, 5, 7, 4], [0, 3, 2, 7], [0, 6, 4, 7], [0, 2, 6, 7]]
)


def make_box(counts=(3, 2, 2), lengths=(3.0, 2.0, 1.0)):
    """Box cut into bricks and each brick into six tetrahedra (Kuhn), positively oriented."""
    nx, ny, nz = counts
    grid = np.stack(np.meshgrid(*[np.arange(n + 1) for n in counts], indexing="ij"), axis=-1)
    points = grid.reshape(-1, 3) * np.array(lengths) / np.array(counts)
    index = np.arange(len(points)).reshape(nx + 1, ny + 1, nz + 1)
    corners = np.stack(
        [
            index[i : i + nx, j : j + ny, k : k + nz].ravel()
            for k in (0, 1)
            for j in (0, 1)
            for i in (0, 1)
        ],
        axis=1,
    )
    cells = corners[:, CUBE].reshape(-1, 4)
    a, b, c, d = np.moveaxis(points[cells], 1, 0)
    volume = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)
    cells[volume < 0] = cells[volume < 0][:, [0, 2, 1, 3]]
    mesh = TetMesh(points, cells)
    x = points[mesh.boundary][:, :, 0]
    return mesh.with_patches(
        {
            "left": mesh.boundary[(x < 1e-9).all(axis=1)],
            "right": mesh.boundary[(x > lengths[0] - 1e-9).all(axis=1)],
        }
    )


@pytest.fixture(scope="session")
def box():
    return make_box()


@pytest.fixture(scope="session")
def build_box():
    return make_box


def pytest_configure(config):
    """Give each process of the tests one processor: they share those that there are.

    More threads wait for each other, busily. This runs before the processes are started.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "CCFEM_THREADS"):
        os.environ.setdefault(name, "1")
    # Programs that tests start share what Python compiled, also where it is not to be kept.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    gc.disable()
    config.addinivalue_line("markers", "slow: takes ten seconds or more; CCFEM_SLOW=1 runs it")


COMPILE_NOTHING = {
    "test_tet_part", "test_tets", "test_somp", "test_simp", "test_house", "test_submodules",
    "test_medial_fill", "test_polylines", "test_hatch", "test_named_machines",
}  # fmt: skip
"""Files whose tests call nothing that numba compiles."""

HALF_WAY = {"test_documents", "test_notebooks", "test_site", "test_workbench_browser"}
"""Files of long tests: at the end one process would wait for the other that runs them."""


def pytest_collection_modifyitems(items):
    """Begin with the report in a browser, beside what compiles nothing; long files half way.

    Two processes that begin with the same commands would compile the same at one time, both.
    Slow tests are left out, unless they are asked for.
    """
    half = {item.path: k < len(items) / 2 for k, item in reversed([*enumerate(items)])}
    first = {"test_report_browser": 0} | dict.fromkeys(COMPILE_NOTHING, 1)
    first |= dict.fromkeys(HALF_WAY, 3)
    items.sort(key=lambda item: first.get(item.path.stem, 2 if half[item.path] else 4))
    if not os.environ.get("CCFEM_SLOW"):
        for item in items:
            if item.get_closest_marker("slow"):
                item.add_marker(pytest.mark.skip(reason="slow: set CCFEM_SLOW=1 to run it"))


def pytest_collection_finish():
    """Keep what is imported out of every later search for garbage: it stays to the end.

    While it was imported nothing was searched. Later searches are rare: they find little.
    """
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)
    gc.enable()


def pytest_runtest_setup():
    """Let no closed connection end the process: Gmsh, where it is called here, has it do so."""
    if hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)


@pytest.fixture(scope="session", autouse=True)
def meshes_of_tests(tmp_path_factory):
    """Keep the meshes that tests make apart from the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CCFEM_CACHE", str(tmp_path_factory.mktemp("meshes")))
        yield


@pytest.fixture(scope="session", autouse=True)
def forked_children():
    """Fork the children that read and mesh; those of `started_children` start as for users."""
    children = ForkedChildren()
    with pytest.MonkeyPatch.context() as patch:
        if hasattr(os, "fork"):
            patch.setattr(process, "subprocess", children)
        yield
    children.end()


@pytest.fixture
def started_children(monkeypatch):
    """Start each child of `ccfem.body.isolated` from nothing, as outside of tests."""
    monkeypatch.setattr(process, "subprocess", subprocess)


@pytest.fixture
def coarse_bar(monkeypatch):
    """Give the case `bar` 2.5 times longer cells: examples of pages run on it as they stand."""
    make, _ = BODIES["bar"]
    monkeypatch.setitem(BODIES, "bar", (make, 4.0))


@pytest.fixture(scope="module")
def cluster():
    """Address of a Dask scheduler with one worker of two threads, in this process."""
    distributed = pytest.importorskip("distributed")
    options = {"processes": False, "threads_per_worker": 2, "dashboard_address": None}
    with distributed.LocalCluster(n_workers=1, **options) as local:
        yield local.scheduler_address
