"""Solve a problem of `problem_out.py` by DOLFINx under MPI, and write the stress of its cells.

    mpirun -n 2 /usr/bin/python3 benchmarks/large/dolfinx_solve.py problem.npz stress.csv

The mesh is shared out among the processes; only the first reads and writes files. Written for
Debian's python3-dolfinx 0.5.
"""

import sys

import numpy as np
import ufl
from dolfinx import fem, mesh as meshes
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc

OPTIONS = {
    "ksp_type": "cg",
    "ksp_rtol": 1e-10,
    "pc_type": "gamg",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_pc_type": "jacobi",
    "mg_levels_ksp_chebyshev_esteig_steps": 10,
}
"""As in DOLFINx's own demo of elasticity."""


def read(path, communicator):
    """Problem from its file, the mesh on the first process alone."""
    data = dict(np.load(path)) if communicator.rank == 0 else None
    data = communicator.bcast(data)
    cells = data["cells"].astype(np.int64)
    return data, cells if communicator.rank == 0 else cells[:0]


def nodes_of(space, domain):
    """Return the number in the file of each node of a space that this process knows."""
    nodes = np.zeros(
        space.dofmap.index_map.size_local + space.dofmap.index_map.num_ghosts, dtype=np.int64
    )
    geometry = domain.geometry
    number = np.asarray(geometry.input_global_indices)
    count = domain.topology.index_map(3).size_local + domain.topology.index_map(3).num_ghosts
    for cell in range(count):
        nodes[space.dofmap.cell_dofs(cell)] = number[geometry.dofmap.links(cell)]
    return nodes


def rigid_motions(places, matrix):
    """Return translations and rotations of all nodes here, orthonormal over all processes."""
    null: list = []
    for k in range(6):
        values = np.zeros_like(places)
        if k < 3:
            values[:, k] = 1.0
        else:
            i, j = [(1, 2), (2, 0), (0, 1)][k - 3]
            values[:, i], values[:, j] = -places[:, j], places[:, i]
        vector = matrix.createVecRight()
        vector.setArray(values.reshape(-1))
        for known in null:
            vector.axpy(-vector.dot(known), known)
        vector.normalize()
        null.append(vector)
    return PETSc.NullSpace().create(vectors=null)


def main(problem, output):
    communicator = MPI.COMM_WORLD
    data, cells = read(problem, communicator)
    points = data["points"] if communicator.rank == 0 else data["points"][:0]
    element = ufl.VectorElement("Lagrange", "tetrahedron", 1)
    domain = meshes.create_mesh(communicator, cells, points, ufl.Mesh(element))
    space = fem.VectorFunctionSpace(domain, ("Lagrange", 1))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    lame, shear = data["lame"]

    def stress(w):
        strain = ufl.sym(ufl.grad(w))
        return 2.0 * shear * strain + lame * ufl.tr(strain) * ufl.Identity(3)

    node, owned = nodes_of(space, domain), space.dofmap.index_map.size_local
    form = fem.form(ufl.inner(stress(u), ufl.sym(ufl.grad(v))) * ufl.dx)
    matrix = petsc.assemble_matrix(form)
    matrix.assemble()
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    matrix.setNearNullSpace(rigid_motions(space.tabulate_dof_coordinates()[:owned], matrix))

    # Each process gives the forces and the held components of the nodes that it owns.
    load, moved = matrix.createVecRight(), fem.Function(space)
    load.setArray(data["forces"][node[:owned]].reshape(-1))
    moved.vector.setArray(data["value"][node[:owned]].reshape(-1))
    rows = 3 * space.dofmap.index_map.local_range[0] + np.flatnonzero(data["held"][node[:owned]])
    matrix.zeroRowsColumns(rows.astype(np.int32), 1.0, moved.vector, load)
    options = PETSc.Options()
    for name, value in OPTIONS.items():
        options[name] = value
    krylov = PETSc.KSP().create(communicator)
    krylov.setOperators(matrix)
    krylov.setFromOptions()
    krylov.solve(load, moved.vector)
    if krylov.getConvergedReason() < 0:
        raise SystemExit("dolfinx: the solve has not converged")
    moved.x.scatter_forward()

    # Stress of each cell, sent to the first process and put in the order of the file.
    tensors = fem.TensorFunctionSpace(domain, ("DG", 0))
    result = fem.Function(tensors)
    points_of = tensors.element.interpolation_points()
    result.interpolate(fem.Expression(stress(moved), points_of))
    count = domain.topology.index_map(3).size_local
    own = result.x.array.reshape(-1, 9)[:count]
    sent = communicator.gather((np.asarray(domain.topology.original_cell_index)[:count], own))
    if communicator.rank == 0:
        number = np.concatenate([one for one, _ in sent])
        values = np.concatenate([one for _, one in sent])[np.argsort(number)]
        six = values[:, [0, 4, 8, 1, 5, 2]]
        rows = np.column_stack([np.arange(len(six)), six])
        names = ";".join(f"S{name} [MPa]" for name in ("xx", "yy", "zz", "xy", "yz", "xz"))
        style = ["%d"] + 6 * ["%.9g"]
        np.savetxt(output, rows, style, ";", header=f"element;{names}", comments="")


main(*sys.argv[1:])
