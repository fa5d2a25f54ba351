"""Plane stress: thin plates of triangles or quadrilaterals, cell by cell of any stiffness."""

from ccfem.plates.field import PlaneField
from ccfem.plates.mesh import PlaneMesh
from ccfem.plates.problem import PlaneProblem
from ccfem.plates.raster_mesh import raster_mesh
from ccfem.plates.solve import solve_plane
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
