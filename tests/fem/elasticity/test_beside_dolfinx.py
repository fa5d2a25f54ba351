"""Stress of a part that DOLFINx solves under MPI, by the committed scripts, beside our own."""

import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ccfem
from benchmarks.large.problem_out import write_problem
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import Gravity
from ccfem.fem.stress_files.stress_file import read_stress

SCRIPT = Path(__file__).parents[3] / "benchmarks" / "large" / "dolfinx_solve.py"
SYSTEM = "/usr/bin/python3"
"""Interpreter of the system's python3-dolfinx."""


def part():
    problem = ccfem.cases.create_case("bar", element_size=8.0).problem
    loads = (*problem.loads["pull"], Gravity((2e4, -3e3, 1e3), mass_density=1.2))
    return replace(problem, loads={"pull": loads}, order=1)


@pytest.mark.parametrize("processes", [1, 2])
def test_stress_comes_back_from_dolfinx(tmp_path, processes):
    known = subprocess.run([SYSTEM, "-c", "import dolfinx"], capture_output=True, check=False)
    if known.returncode or shutil.which("mpirun") is None:
        pytest.skip("needs python3-dolfinx and mpirun")
    problem, out = part(), tmp_path / "stress.csv"
    write_problem(problem, "pull", tmp_path / "problem.npz")
    command = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", str(processes)]
    files = [str(SCRIPT), str(tmp_path / "problem.npz"), str(out)]
    # OpenMPI refuses to start within the environment of another run, and of the tests' Python.
    environment = {"PATH": os.environ["PATH"], "HOME": os.environ["HOME"], "OMP_NUM_THREADS": "1"}
    subprocess.run([*command, SYSTEM, *files], check=True, capture_output=True, env=environment)
    ours = ccfem.solve(problem)["pull"].stress
    theirs = read_stress(out, problem.mesh).stress
    assert np.abs(theirs - ours).max() <= 1e-6 * np.abs(ours).max()


def test_what_dolfinx_is_not_told_is_refused(tmp_path):
    problem = part()
    density = np.full(len(problem.mesh.cells), 0.5)
    path = tmp_path / "problem.npz"
    with pytest.raises(InputError, match="cells of their own stiffness"):
        write_problem(replace(problem, density=density), "pull", path)
    assert not path.exists()
