"""Linear elasticity on tetrahedra and of plates: problem, assembly, solvers, recovery."""

from ccfem.elasticity.assembly import add_blocks, assemble, cell_gradients, pattern
from ccfem.elasticity.plane import (
    PlaneField,
    PlaneMesh,
    PlaneProblem,
    raster_mesh,
    rotate_plane,
    solve_plane,
    stack_plane,
)
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
from ccfem.elasticity.solve import System, prepare, solve
from ccfem.elasticity.solvers import BACKENDS, Solver, factorise, preconditioned_cg
from ccfem.elasticity.stress_field import LayerStress, SolveRecord, StressField

__all__ = [
    "BACKENDS",
    "Bearing",
    "Force",
    "LayerStress",
    "Load",
    "PlaneField",
    "PlaneMesh",
    "PlaneProblem",
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
    "raster_mesh",
    "rotate_plane",
    "solve",
    "solve_plane",
    "stack_plane",
]
