"""Faces of a part that hang over while it is printed."""

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.body.mesh.tet_mesh import TetMesh


def hanging_facets(
    mesh: TetMesh, frame: FloatArray, bed: float, angle: float, reach: float, upright: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Find the boundary facets that lean over by more than an angle, but those on the bed.

    Parameters
    ----------
    frame : (3, 3) array
        Its last row is the build direction.
    bed : float, mm
        Height of the bed along it.
    angle : float, degrees
        From upright.
    reach : float, mm
        Facets no higher than this above the bed lie on it.
    upright : float
        Cosine to the build direction up to which facets count as upright, whatever the angle.

    Returns
    -------
    area : (f,) array, mm^2
    lean : (f,) array
        Cosine of the outer normal to the build direction: -1 looks straight down.
    hanging : (f,) bool array
    """
    area, normal = mesh.facet_areas(mesh.boundary)
    lean = normal @ frame[2]
    on_bed = ((mesh.points @ frame[2])[mesh.boundary] <= bed + reach).all(axis=1)
    return area, lean, (lean < -max(np.sin(np.radians(angle)), upright)) & ~on_bed
