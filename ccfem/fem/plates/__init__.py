"""Plane stress: thin plates of triangles or quadrilaterals, cell by cell of any stiffness."""

from ccfem.fem.plates.mesh import PlaneMesh, raster_mesh
from ccfem.fem.plates.problem import PlaneProblem, rotate_plane, stack_plane
from ccfem.fem.plates.solve import PlaneField, solve_plane

__all__ = [
    "PlaneField",
    "PlaneMesh",
    "PlaneProblem",
    "raster_mesh",
    "rotate_plane",
    "solve_plane",
    "stack_plane",
]
