"""One solve by dolfinx, for `peers.py`: run by the system's own interpreter, prints JSON.

    /usr/bin/python3 benchmarks/speed/dolfinx_peer.py PART.npz {mumps,gamg} {1,2}

Written for Debian's python3-dolfinx 0.5. Times are of this process; forms are compiled before.
"""

import json
import sys
from time import perf_counter, process_time

import numpy as np
import ufl
from dolfinx import fem, mesh as meshes
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc

GAMG = {
    "ksp_type": "cg",
    "ksp_rtol": 1e-8,
    "pc_type": "gamg",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_pc_type": "jacobi",
    "mg_levels_ksp_chebyshev_esteig_steps": 10,
}
"""As in dolfinx's own demo of elasticity."""
MUMPS = {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"}


def blas():
    """Name the files of the BLAS that this process has loaded: a reference one makes MUMPS slow."""
    with open("/proc/self/maps") as file:
        loaded = {line.split()[-1] for line in file if "/" in line}
    names = {"/".join(path.split("/")[-2:]) for path in loaded}
    return sorted(name for name in names if any(k in name for k in ("blas", "mkl", "blis")))


def clock():
    return np.array([perf_counter(), process_time()])


def rigid_motions(space, matrix):
    """Return the translations and rotations of all nodes, orthonormal."""
    places, vectors = space.tabulate_dof_coordinates(), []
    for k in range(6):
        values = np.zeros_like(places)
        if k < 3:
            values[:, k] = 1.0
        else:
            i, j = [(1, 2), (2, 0), (0, 1)][k - 3]
            values[:, i], values[:, j] = -places[:, j], places[:, i]
        vectors.append(values.reshape(-1))
    orthonormal = np.linalg.qr(np.stack(vectors, axis=1))[0]
    basis = []
    for column in orthonormal.T:
        vector = matrix.createVecRight()
        vector.setArray(np.ascontiguousarray(column))
        basis.append(vector)
    return PETSc.NullSpace().create(vectors=basis)


def main(path, solver, order):
    data = np.load(path)
    element = ufl.VectorElement("Lagrange", "tetrahedron", 1)
    domain = meshes.create_mesh(
        MPI.COMM_WORLD, data["cells"].astype(np.int64), data["points"], ufl.Mesh(element)
    )
    space = fem.VectorFunctionSpace(domain, ("Lagrange", order))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    young, poisson = data["material"]
    shear = young / (2.0 + 2.0 * poisson)
    lame = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))

    def strain(w):
        return ufl.sym(ufl.grad(w))

    def stress(w):
        return 2.0 * shear * strain(w) + lame * ufl.tr(strain(w)) * ufl.Identity(3)

    form = fem.form(ufl.inner(stress(u), strain(v)) * ufl.dx)
    places = space.tabulate_dof_coordinates()
    axis, low, high = int(data["axis"]), float(data["low"]), float(data["high"])
    along = (places[:, axis] - low) / (high - low)
    fixed = np.flatnonzero(along <= 0.03).astype(np.int32)
    loaded = along >= 0.97
    held = fem.dirichletbc(np.zeros(3), fixed, space)
    petsc.assemble_matrix(form, bcs=[held]).destroy()  # compiled, and memory touched once

    started = clock()
    matrix = petsc.assemble_matrix(form, bcs=[held])
    matrix.assemble()
    assembled = clock()
    load = fem.Function(space)
    force = np.zeros_like(places)
    force[loaded, 0] = 100.0 / loaded.sum()
    load.vector.setArray(force.reshape(-1))
    found = fem.Function(space)
    options = PETSc.Options()
    for name, value in (GAMG if solver == "gamg" else MUMPS).items():
        options[name] = value
    if solver == "gamg":
        matrix.setNearNullSpace(rigid_motions(space, matrix))
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    krylov = PETSc.KSP().create(MPI.COMM_WORLD)
    krylov.setOperators(matrix)
    krylov.setFromOptions()
    krylov.solve(load.vector, found.vector)
    done = clock()
    largest = float(np.linalg.norm(found.x.array.reshape(-1, 3), axis=1).max())
    print(
        json.dumps(
            {
                "assembly": list(assembled - started),
                "solve": list(done - assembled),
                "largest": largest,
                "blas": blas(),
                "record": f"{krylov.getIterationNumber()} iterations" if solver == "gamg" else "",
            }
        )
    )


main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
