"""A disk that is full, or a limit of file size: one line, and no file is left."""

import os
import resource
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest
from flat_paths import flat_paths

from ccfem.base.errors import InputError
from ccfem.body.files import read_surface, write_mesh
from ccfem.body.files.surface import write_stl
from ccfem.body.mesh import box_mesh
from ccfem.comparison.plot.canvas import new_figure, save
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.printing.export.vtk import write_paths, write_result

MESH = box_mesh((20.0, 10.0, 5.0), (16, 8, 4))


@contextmanager
def largest_file(size):
    """Let the system refuse to write beyond `size` bytes, as it does on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def result(path):
    loads = {"pull": (Force("x_max", (1.0, 0.0, 0.0)),)}
    problem = Problem(MESH, isotropic(3500.0, 0.3), (Support("x_min"),), loads)
    write_result(solve(problem)["pull"], path)


def paths(path):
    write_paths(flat_paths([np.random.default_rng(0).random((500, 3))]), path)


def picture(path):
    figure, (axes,) = new_figure((0.0, 0.0, 1.0, 1.0))
    axes.scatter(*np.random.default_rng(0).random((2, 500)))
    save(figure, path)


WRITERS = {
    "mesh.vtu": lambda path: write_mesh(MESH, path),
    "mesh.npz": lambda path: write_mesh(MESH, path),
    "mesh.tet": lambda path: write_mesh(MESH, path),
    "result.vtu": result,
    "paths.vtp": paths,
    "picture.png": picture,
    "picture.pdf": picture,
    "picture.svg": picture,
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_cannot_be_written_is_one_line(tmp_path, name):
    path = tmp_path / name
    WRITERS[name](path)
    whole = path.read_bytes()
    for share in (0.0, 0.1, 0.5, 0.9, 0.999):
        with largest_file(int(share * len(whole))), pytest.raises(InputError) as refused:
            WRITERS[name](path)
        assert str(refused.value) == (
            f"cannot write {path}: File too large: free some space there, or choose another disk"
        )
        assert path.read_bytes() == whole
        assert os.listdir(tmp_path) == [name]


def test_a_reader_whose_temporary_folder_is_full(tmp_path, started_children):
    write_stl(tmp_path / "box.stl", MESH.points, MESH.boundary)
    assert read_surface(tmp_path / "box.stl").volume == pytest.approx(1000.0)
    with largest_file(4000), pytest.raises(InputError, match="environment variable TMPDIR"):
        read_surface(tmp_path / "box.stl")


@pytest.mark.skipif(os.name != "posix" or os.getuid() != 0, reason="only root mounts a small disk")
def test_solve_on_a_full_disk(tmp_path):
    small = tmp_path / "small"
    small.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=60k", "none", str(small)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("no small disk can be mounted here")
    try:
        command = [sys.executable, "-m", "ccfem", "solve", "bar", "--set-case", "element_size=6"]
        done = subprocess.run(
            [*command, "-o", str(small / "r.vtu")], capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.splitlines()[-1] == (
            f"ccfem: error: cannot write {small / 'r.vtu'}: No space left on device: free some "
            "space there, or choose another disk"
        )
        assert os.listdir(small) == []
    finally:
        subprocess.run(["umount", str(small)], check=True)
