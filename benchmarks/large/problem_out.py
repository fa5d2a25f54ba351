"""A part beyond the memory of one machine: its problem out to DOLFINx, for `dolfinx_solve.py`.

    python -m benchmarks.large.problem_out PART.toml problem.npz
    mpirun -n 2 /usr/bin/python3 benchmarks/large/dolfinx_solve.py problem.npz stress.csv
    ccfem compare PART.toml --stress stress.csv

It takes linear cells of one isotropic material, and nodes that are held along x, y and z.
"""

import sys
from pathlib import Path

import numpy as np

from ccfem.base.errors import InputError
from ccfem.cases import read
from ccfem.fem.elasticity.loads import load_case
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.supports import held, held_in, soft_supports


def write_problem(problem: Problem, case: str, path: Path) -> None:
    """Write what a solve of one load case needs.

    Parameters
    ----------
    path : Path
        ``.npz`` with points (n, 3) in mm, cells (m, 4), lame (2,) in MPa (first constant and shear
        modulus), forces (n, 3) in N, held (n, 3), and its displacement value (n, 3) in mm.

    Raises
    ------
    InputError
        For what DOLFINx would have to be told otherwise.
    """
    restraint = held_in(problem, case, held(problem))
    reasons = {
        "quadratic cells": problem.mesh.order != 1,
        "several materials, or cells of their own stiffness": bool(problem.regions)
        or problem.axes is not None
        or problem.density is not None
        or problem.stiffness is not None,
        "supports along other axes, rigid ones, springs, or supports of one load case": (
            restraint.ties is not None or bool(soft_supports(problem) or problem.case_supports)
        ),
    }
    if hindering := [reason for reason, holds in reasons.items() if holds]:
        raise InputError(
            f"expected linear cells of one isotropic material, held along x, y and z; got "
            f"{' and '.join(hindering)}: solve it by ccfem solve"
        )
    stiffness = problem.material.stiffness
    lame = np.array([stiffness[0, 1], stiffness[3, 3]])
    isotropic = lame[0] * np.pad(np.ones((3, 3)), (0, 3)) + lame[1] * np.diag([2, 2, 2, 1, 1, 1])
    if not np.allclose(stiffness, isotropic, rtol=1e-9):
        raise InputError("expected an isotropic material; got another: solve it by ccfem solve")
    np.savez(
        path,
        points=problem.mesh.points,
        cells=problem.mesh.cells,
        lame=lame,
        forces=load_case(problem, case),
        held=~restraint.free,
        value=restraint.value,
    )


if __name__ == "__main__":
    part, path = sys.argv[1:]
    problem = read(part).problem
    write_problem(problem, problem.cases[0], Path(path))
