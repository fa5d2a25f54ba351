"""A surface or a CAD file to a mesh with its faces as patches, made once and kept."""

import os
from collections.abc import Callable
from pathlib import Path

from ccfem.base.checks import check_number
from ccfem.base.whole import existing_file
from ccfem.body.files.surface import Surface, read_surface
from ccfem.body.mesh.smooth_faces import FEATURE_ANGLE
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing.cache import kept
from ccfem.body.meshing.cad import is_cad, mesh_cad
from ccfem.body.meshing.face_groups import with_faces_of
from ccfem.body.meshing.volume import Mesher, fill


def mesh_body(
    path: str | os.PathLike[str],
    edge_length: float,
    scale: float = 1.0,
    mesher: Mesher = "auto",
    before: Callable[[Surface], None] | None = None,
    angle: float = FEATURE_ANGLE,
) -> tuple[TetMesh, tuple[str, ...]]:
    """Mesh a file of a closed surface (STL, OBJ, PLY) or of solids (STEP, IGES, BREP).

    Parameters
    ----------
    path : path
    edge_length : float, mm
    scale : float, default 1
        Factor on the coordinates, to make them mm.
    mesher : {"auto", "gmsh", "ftetwild"}, default "auto"
        For surfaces: see `ccfem.body.meshing.tetrahedralise`. CAD files are meshed by Gmsh.
    before : callable, optional
        Called with the surface before it is meshed, to complain early.
    angle : float, degrees
        Feature angle between the faces of a surface.

    Returns
    -------
    mesh : TetMesh
        With the faces as patches ``face_1``, ``face_2``, ...; by Gmsh the same for equal input on
        any number of cores. It is kept in the user's cache (the variable CCFEM_CACHE names another
        folder, or none where it is empty), and not made again.
    findings : tuple of str
        Who made it, its volume and its distance from the surface.

    Raises
    ------
    InputError
    """
    path = existing_file(path, "CAD file" if is_cad(path) else "surface file")
    check_number("edge length", edge_length, above=0.0, unit="mm")
    check_number("scale", scale, above=0.0)

    def make() -> tuple[TetMesh, tuple[str, ...]]:
        if is_cad(path):
            mesh, about = mesh_cad(path, edge_length, scale)
            return mesh, (about,)
        surface = read_surface(path, scale)
        if before is not None:
            before(surface)
        mesh, fit, who = fill(surface, edge_length, mesher)
        about = fit.about(who)
        if who != "Gmsh":  # it takes its random numbers from the hardware
            about += (
                "; fTetWild gives a different mesh each time, so this one is stored on this "
                "machine for reuse"
            )
        return with_faces_of(surface, mesh, angle), (about,)

    asked: dict[str, object] = {
        "edge_length": float(edge_length),
        "scale": float(scale),
        "mesher": mesher,
        "angle": float(angle),
        "suffix": Path(path).suffix.lower(),
    }
    return kept(path.read_bytes(), asked, make)
