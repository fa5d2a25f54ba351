"""Plane stress: thin plates of triangles or quadrilaterals, cell by cell of any stiffness."""

from ccfem.plates.plane_mesh import PlaneMesh, raster_mesh
from ccfem.plates.problem import PlaneProblem
from ccfem.plates.solve import PlaneField, solve_plane
from ccfem.plates.stiffness import rotate_plane, stack_plane

__all__ = [
    "PlaneField",
    "PlaneMesh",
    "PlaneProblem",
    "raster_mesh",
    "rotate_plane",
    "solve_plane",
    "stack_plane",
]
