"""Plane stress: thin plates of triangles or quadrilaterals, cell by cell of any stiffness."""

from ccfem.fem.plates.field import PlaneField
from ccfem.fem.plates.mesh import PlaneMesh
from ccfem.fem.plates.problem import PlaneProblem
from ccfem.fem.plates.raster_mesh import raster_mesh
from ccfem.fem.plates.solve import solve_plane
from ccfem.fem.plates.stiffness import rotate_plane, stack_plane

__all__ = [
    "PlaneField",
    "PlaneMesh",
    "PlaneProblem",
    "raster_mesh",
    "rotate_plane",
    "solve_plane",
    "stack_plane",
]
