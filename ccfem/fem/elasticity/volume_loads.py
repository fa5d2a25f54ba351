"""Loads in the volume of a part: body forces, weight, and heat."""

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import strain_to_voigt
from ccfem.body.mesh.curved_cells import gradient_integrals, integrals
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.assembly import cell_gradients
from ccfem.fem.elasticity.load_kinds import BodyForce, Gravity, Temperature
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.recovery import times
from ccfem.geometry.measures import signed_volumes

_TONNES = 1e-9
"""Tonnes per mm^3 in a gram per cm^3; a tonne times a mm/s^2 is a newton."""


def volume_forces(problem: Problem, load: BodyForce | Gravity) -> FloatArray:
    """Find the forces at the nodes (n, 3), N, that do the same work as a body force or a weight.

    Raises
    ------
    InputError
        For a weight where a material has no mass density and none is given.
    """
    mesh = problem.mesh
    if isinstance(load, BodyForce):
        force = np.tile(np.asarray(load.vector, dtype=np.float64), (len(mesh.cells), 1))
    else:
        density = _mass_density(problem, load)
        force = density[:, None] * (_TONNES * 1e3 * np.asarray(load.acceleration))
    shares = np.full(4, 0.25) if mesh.order == 1 else np.array([-0.05] * 4 + [0.2] * 6)
    volumes = mesh.volumes[:, None] * shares
    if len(mesh.curved):
        volumes[mesh.curved] = integrals(mesh.points[mesh.cells[mesh.curved]])
    result = np.zeros(mesh.points.shape)
    for k in range(3):
        weights = force[:, k, None] * volumes
        result[:, k] = np.bincount(mesh.cells.reshape(-1), weights.reshape(-1), len(result))
    return result


def _mass_density(problem: Problem, load: Gravity) -> FloatArray:
    """Mass density (m,), g/cm^3; the density of a cell, where the part has one, scales it."""
    factor = np.ones(len(problem.mesh.cells)) if problem.density is None else problem.density
    if load.mass_density is not None:
        return factor * load.mass_density
    result = np.empty(len(factor))
    for material, cells in problem.materials:
        if material.mass_density is None:
            raise InputError(
                f"gravity needs the mass density of material '{material.name}', g/cm^3, which has "
                "none: give mass_density to the load or to the material"
            )
        result[cells] = material.mass_density
    return factor * result


def free_strain(problem: Problem, case: str) -> FloatArray | None:
    """Free thermal strain (m, 6) of each cell; None without heat.

    Voigt, with engineering shear, in the global frame; of a load case or a combination.

    Raises
    ------
    InputError
        When a material has no expansion.
    """
    change = sum(
        factor * load.change
        for name, factor in problem.factors(case).items()
        for load in problem.loads.get(name, ())
        if isinstance(load, Temperature)
    )
    if not change:
        return None
    result = np.empty((len(problem.mesh.cells), 6))
    for material, cells in problem.materials:
        if material.expansion is None:
            raise InputError(
                f"a change of temperature needs the expansion of material '{material.name}', 1/K, "
                "which has none: give it one"
            )
        strain = change * np.diag(material.expansion)
        if problem.axes is not None:
            axes = problem.axes[cells]
            strain = axes @ strain @ np.swapaxes(axes, 1, 2)
        result[cells] = strain_to_voigt(strain)
    return result


def heat_forces(problem: Problem, case: str) -> FloatArray:
    """Find the nodal forces (n, 3), N, of thermal expansion."""
    free = free_strain(problem, case)
    if free is None:
        return np.zeros(problem.mesh.points.shape)
    stress = times(problem.cell_stiffness, free)
    if problem.density is not None:
        stress = stress * problem.density[:, None]
    return strain_forces(problem.mesh, stress)


def strain_forces(mesh: TetMesh, stress: FloatArray) -> FloatArray:
    """Find the forces at the nodes (n, 3), N, of a constant stress (m, 6), MPa, in each cell.

    They are ``int B^T s dV``: the effect of an initial stress -s on the part.
    """
    s = stress[:, [0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(-1, 3, 3)
    gradients = cell_gradients(mesh)
    volumes = signed_volumes(mesh.points, mesh.corners)[:, None, None]
    nodes, forces = mesh.cells, volumes * (gradients @ s)
    if mesh.order == 2:
        # Gradients of corner functions have mean zero, those of a midpoint that of its corners.
        i, j = mesh.edges.T
        forces = np.concatenate([np.zeros_like(forces), forces[:, i] + forces[:, j]], axis=1)
        curved = gradient_integrals(mesh.points[mesh.cells[mesh.curved]])
        forces[mesh.curved] = curved @ s[mesh.curved]
    result = np.zeros(mesh.points.shape)
    for k in range(3):
        result[:, k] = np.bincount(nodes.reshape(-1), forces[..., k].reshape(-1), len(result))
    return result
