"""The problem of a part whose plastic is printed as walls, skins and infill."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import rotate_stiffness
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.infill_moduli import infill_stiffness, infill_strength
from ccfem.fem.materials import Material, isotropic
from ccfem.machine.machine import Machine
from ccfem.paths.plastic.plastic import Plastic
from ccfem.paths.plastic.sparse_regions import matrix_sections, sparse_share
from ccfem.paths.splitting.slabs import slabs_of
from ccfem.slicing.layers.layer import Layer

_PLACES = 5
"""Places along an edge of a cell at which it is asked what is printed there: 35 in a cell."""


def as_printed(
    problem: Problem, fibre: Sequence[Layer], plastic: Plastic, machine: Machine
) -> Problem:
    """Give each cell the mean stiffness, strength and mass of what is printed in it.

    The share of a cell that lies in sparse infill (`matrix_sections`) is found at 35 places. Solid
    plastic and infill in one cell share its strain.

    Parameters
    ----------
    problem : Problem
        Of solid plastic.
    fibre : sequence of Layer
        Flat layers that may get fibre; at least one.

    Raises
    ------
    InputError
        For a material that is not isotropic.
    """
    share, frame = infill_share(problem.mesh, fibre, plastic, machine)
    stiffness = np.array(np.broadcast_to(problem.cell_stiffness, (len(share), 6, 6)))
    strength, rho = np.ones(len(share)), plastic.density
    turn = np.radians(machine.gcode.matrix_angle) if plastic.infill != "gyroid" else 0.0
    along = np.cos(turn) * frame[0] + np.sin(turn) * frame[1]
    axes = np.column_stack([along, np.cross(frame[2], along), frame[2]])
    for material, cells in problem.materials:
        modulus, poisson = _isotropic(material, problem)
        infill = infill_stiffness(plastic.infill, rho, modulus, poisson)
        turned, part = rotate_stiffness(infill, axes), share[cells]
        sparse = cells[part > 0.0]
        part = part[part > 0.0]
        stiffness[sparse] += part[:, None, None] * (turned - material.stiffness)
        strength[sparse] += part * (infill_strength(infill, rho, modulus) - 1.0)
    fill = 1.0 - (1.0 - rho) * share
    return replace(problem, stiffness=stiffness, fill=fill, strength=strength)


def infill_share(
    mesh: TetMesh, fibre: Sequence[Layer], plastic: Plastic, machine: Machine
) -> tuple[FloatArray, FloatArray]:
    """Share (m,) of each cell that lies in sparse infill, and the frame (3, 3) of the layers."""
    frame = fibre[0].plane.frame
    level = mesh.points[np.unique(mesh.corners)] @ frame[2]
    slabs = slabs_of(fibre, float(level.min()), float(level.max()), machine)
    plane, sections = matrix_sections(slabs, fibre, mesh, frame[2], plastic, machine)
    share = np.zeros(len(mesh.cells))
    if plane is not None:
        corners = mesh.points[mesh.corners]
        weights = _weights()
        for weight in weights:
            places = np.einsum("a,maj->mj", weight, corners)
            share += sparse_share(places, plane, list(sections.values())) / len(weights)
    return share, frame


def _weights() -> FloatArray:
    """Barycentric coordinates (k, 4) of places that are spread evenly over a tetrahedron."""
    numbers = np.indices((_PLACES,) * 4).reshape(4, -1).T
    numbers = numbers[numbers.sum(axis=1) == _PLACES - 1]
    return np.asarray((numbers + 0.25) / _PLACES)


def _isotropic(material: Material, problem: Problem) -> tuple[float, float]:
    """Young's modulus, MPa, and Poisson's ratio of a material; an error if it has more."""
    compliance = np.linalg.inv(material.stiffness)
    modulus = float(1.0 / compliance[0, 0])
    poisson = float(-compliance[0, 1] * modulus)
    expected = isotropic(modulus, poisson).stiffness
    alike = np.allclose(material.stiffness, expected, rtol=1e-6, atol=1e-6 * expected.max())
    if not alike or problem.stiffness is not None or problem.density is not None:
        raise InputError(
            f"plastic.infill needs an isotropic material; got '{material.name}': give one modulus, "
            "or infill = 'solid'"
        )
    return modulus, poisson
