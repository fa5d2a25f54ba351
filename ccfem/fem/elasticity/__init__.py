"""Linear elasticity on tetrahedra: problem, assembly, solvers, recovery."""

from ccfem.fem.elasticity.assembly import add_blocks, assemble, cell_gradients, pattern
from ccfem.fem.elasticity.load_kinds import (
    Bearing,
    BodyForce,
    Centrifugal,
    Displacement,
    Force,
    Gravity,
    Load,
    NodeForces,
    PointForce,
    Pressure,
    Temperature,
    Traction,
)
from ccfem.fem.elasticity.problem import Problem, Region
from ccfem.fem.elasticity.recovery import cell_stress, nodal_stress
from ccfem.fem.elasticity.solve import refine, solve
from ccfem.fem.elasticity.solvers import BACKENDS, Solver, factorise, preconditioned_cg
from ccfem.fem.elasticity.stress_field import GivenStress, PartStress, SolveRecord, StressField
from ccfem.fem.elasticity.support_kinds import (
    EdgeSupport,
    Foundation,
    NodeSupport,
    Pin,
    PointSpring,
    PointSupport,
    PressingSupport,
    RigidPatch,
    SlidingSupport,
    Spring,
    Support,
)
from ccfem.fem.elasticity.system import System, prepare

__all__ = [
    "BACKENDS",
    "Bearing",
    "BodyForce",
    "Centrifugal",
    "Displacement",
    "EdgeSupport",
    "Force",
    "Foundation",
    "GivenStress",
    "Gravity",
    "Load",
    "NodeForces",
    "NodeSupport",
    "PartStress",
    "Pin",
    "PointForce",
    "PointSpring",
    "PointSupport",
    "PressingSupport",
    "Pressure",
    "Problem",
    "Region",
    "RigidPatch",
    "SlidingSupport",
    "SolveRecord",
    "Solver",
    "Spring",
    "StressField",
    "Support",
    "System",
    "Temperature",
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
    "refine",
    "solve",
]
