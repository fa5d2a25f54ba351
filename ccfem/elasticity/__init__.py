"""Linear elasticity on tetrahedra: problem, assembly, solvers, recovery."""

from ccfem.elasticity.assembly import add_blocks, assemble, cell_gradients, pattern
from ccfem.elasticity.part_stress import GivenStress, PartStress
from ccfem.elasticity.problem import (
    Bearing,
    Force,
    Load,
    PointForce,
    Pressure,
    Problem,
    Support,
    Traction,
)
from ccfem.elasticity.recovery import cell_stress, nodal_stress
from ccfem.elasticity.solve import solve
from ccfem.elasticity.solvers import BACKENDS, Solver, factorise, preconditioned_cg
from ccfem.elasticity.stress_field import SolveRecord, StressField
from ccfem.elasticity.system import System, prepare

__all__ = [
    "BACKENDS",
    "Bearing",
    "Force",
    "GivenStress",
    "Load",
    "PartStress",
    "PointForce",
    "Pressure",
    "Problem",
    "SolveRecord",
    "Solver",
    "StressField",
    "Support",
    "System",
    "Traction",
    "add_blocks",
    "assemble",
    "cell_gradients",
    "cell_stress",
    "factorise",
    "nodal_stress",
    "pattern",
    "preconditioned_cg",
    "prepare",
    "solve",
]
