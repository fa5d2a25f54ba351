"""The problem of a part whose plastic is printed as walls, skins and infill.

Lines and grid are thin walls: rules of mixture for what lies along a direction; for shear across
the walls of a grid their bending (Gibson and Ashby, Cellular Solids, 1997, chapter 4: a square
honeycomb). Lines that turn by 90 degrees from layer to layer stand on each other where they cross,
on the square of the density. The gyroid has power laws of the density. They are not those of a
sheet of even thickness, which is up to twice as stiff (DeValk and Lakes, Physica Status Solidi B
258, 2021): a nozzle lays lines of one width, so that walls are thin where they lean, and open where
they lie. All laws were found from, or held against, voxels of the lines as they are laid, by
``benchmarks/studies/infill_moduli.py``.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import rotate_stiffness
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.materials import Material, isotropic
from ccfem.machine.machine import Machine
from ccfem.paths.plastic.plastic import Plastic
from ccfem.paths.plastic.sparse_regions import matrix_sections, sparse_share
from ccfem.paths.splitting.slabs import slabs_of
from ccfem.slicing.layers.layer import Layer


def infill_stiffness(infill: str, density: float, modulus: float, poisson: float) -> FloatArray:
    """Mean stiffness of infill: (6, 6), MPa, axis 3 across the layers, 1 and 2 along its pattern.

    Parameters
    ----------
    infill : {"lines", "grid", "gyroid"}
    density : float
        Share of the volume that is filled, 0.05 to 0.6.
    modulus, poisson : float
        Of the plastic: Young's modulus, MPa, and Poisson's ratio.
    """
    rho, shear = density, 0.5 / (1.0 + poisson)
    if infill == "lines":
        young = (0.5 * rho, 0.5 * rho, rho**2)
        sliding = (0.2 * rho**3, 0.2 * rho**3, 0.28 * rho**3)
        nu12, nu13 = 0.0, 0.5 * poisson
    elif infill == "grid":
        young = (0.5 * rho, 0.5 * rho, rho)
        sliding = (0.5 * rho * shear, 0.5 * rho * shear, rho**3 / 16.0)
        nu12, nu13 = 0.0, 0.5 * poisson
    else:
        young = (0.45 * rho**1.5, 0.45 * rho**1.5, 0.6 * rho**1.25)
        sliding = (0.225 * rho**1.3, 0.225 * rho**1.3, 0.2 * rho**1.45)
        nu12, nu13 = 0.5 - 0.3 * rho, 0.2
    compliance = np.diag([1.0 / x for x in (*young, *sliding)])
    compliance[0, 1] = compliance[1, 0] = -nu12 / young[0]
    compliance[:2, 2] = compliance[2, :2] = -nu13 / young[0]
    stiffness = modulus * np.linalg.inv(compliance)
    return np.asarray(0.5 * (stiffness + stiffness.T))


def infill_strength(stiffness: FloatArray, density: float, modulus: float) -> float:
    """Mean stress that infill bears, over the strength of its plastic.

    Under a mean stress s along an axis with Young's modulus E' infill stores ``s^2 / 2 E'``, all of
    it in the share `density` of its volume. The root mean square of the stress in its lines is
    therefore ``s sqrt(E / (density E'))``: it may not exceed the strength of the plastic, whose
    modulus is E. Of the three axes that of the least modulus counts.
    """
    least = 1.0 / float(np.diag(np.linalg.inv(stiffness))[:3].max())
    return float(np.sqrt(density * least / modulus))


_PLACES = 5
"""Places along an edge of a cell at which it is asked what is printed there: 35 in a cell."""


def as_printed(
    problem: Problem, fibre: Sequence[Layer], plastic: Plastic, machine: Machine
) -> Problem:
    """Give each cell of solid plastic the mean stiffness, strength and mass of what is printed.

    The share of a cell that lies in sparse infill (`matrix_sections`) is found at 35 places. Solid
    plastic and infill in one cell share its strain. `fibre` are flat layers that may get fibre, at
    least one.
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
