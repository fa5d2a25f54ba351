"""CAD files: their outside as triangles, and tetrahedra with their faces as patches."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ccfem.base.arrays import IntArray
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.base.whole import existing_file
from ccfem.body.files.surface import Surface
from ccfem.body.isolated.process import ChildError, in_own_process
from ccfem.body.mesh import TetMesh, check_mesh
from ccfem.body.mesh.patches import face_name, match_boundary
from ccfem.body.mesh.smooth_faces import given_faces, round_walls
from ccfem.body.meshing.volume import check_edge_length, fidelity

Joined = Literal["glued", "separate"]
"""What becomes of solids that touch: one, or pieces that pass no force there."""
SUFFIXES = (".brep", ".iges", ".igs", ".step", ".stp")
_NO_NAME = "Open CASCADE STEP translator"
"""Beginning of the names that Open CASCADE gives to solids that have none."""
_LISTED = 8
"""Solids that a message lists."""


@dataclass(frozen=True)
class CadSurface:
    """The outside of the solids of a CAD file.

    Attributes
    ----------
    face : (t,) int array
        Number of the face of each triangle, from 1.
    names : tuple of str
        Of the faces; empty where the file has none.
    solids : tuple of str
        Names of the solids; empty where the file has none.
    """

    surface: Surface
    face: IntArray
    names: tuple[str, ...]
    solids: tuple[str, ...] = ("",)


def is_cad(path: str | os.PathLike[str]) -> bool:
    """Whether the name of a file is that of a CAD file."""
    return Path(path).suffix.lower() in SUFFIXES


def read_cad(
    path: str | os.PathLike[str], scale: float = 1.0, size: float = 0.0, joined: Joined = "glued"
) -> CadSurface:
    """Read the outside of a CAD file as triangles.

    Parameters
    ----------
    path : path
        STEP, IGES or BREP; lengths come as mm whatever the unit in the file.
    scale : float, default 1
        Factor on the coordinates.
    size : float, mm, default 0
        Of the triangles; 0 for a thirtieth of the part.
    joined : {"glued", "separate"}, default "glued"
        Whether solids that touch become one, or keep faces of their own there.

    Raises
    ------
    InputError
        When the file is missing or holds no solid, or Gmsh is not installed.
    """
    made = _made("cad_surface", path, size, scale, joined)
    names = tuple(str(name) for name in made["names"])
    surface = Surface(*_used(made["points"], made["triangles"]))
    solids = tuple(str(name) for name in made["solids"])
    return CadSurface(surface, made["face"], names, solids)


def mesh_cad(
    path: str | os.PathLike[str], edge_length: float, scale: float = 1.0, joined: Joined = "glued"
) -> tuple[TetMesh, tuple[str, ...]]:
    """Fill the solids of a CAD file with tetrahedra.

    Returns
    -------
    mesh : TetMesh
        With the faces as patches: ``face_1``, ``face_2``, ... in the order of the file, and under
        their names where they have some. Faces between solids that are glued are none.
    about : tuple of str
        How well it fits, and whether several solids are joined.
    """
    fine = read_cad(path, scale, joined=joined)
    check_edge_length(fine.surface, edge_length)
    made = _made("cad_volume", path, edge_length, scale, joined)
    if not len(made["cells"]):
        raise InputError(f"{path}: Gmsh left no cells in its solids: shorten edge_length")
    faces = given_faces(
        fine.surface.points,
        fine.surface.triangles,
        [np.flatnonzero(fine.face == k) for k in np.unique(fine.face)],
    )
    walls = round_walls(fine.surface.points, fine.surface.triangles, faces)
    mesh = TetMesh(made["points"], made["cells"], walls=walls)
    groups: dict[str, list[IntArray]] = {}
    for k, name in enumerate(made["names"].tolist(), 1):
        facets = match_boundary(mesh, made["triangles"][made["face"] == k])
        if not len(facets):
            continue
        for label in filter(None, (face_name(k), name)):
            groups.setdefault(label, []).append(facets)
    mesh = mesh.with_patches({name: np.concatenate(parts) for name, parts in groups.items()})
    mesh = check_mesh(mesh)[0]
    return mesh, (fidelity(fine.surface, mesh).about("Gmsh"), *_about_solids(fine.solids, joined))


def _about_solids(names: tuple[str, ...], joined: Joined) -> tuple[str, ...]:
    """Say what became of several solids."""
    if len(names) == 1:
        return ()
    known = [name for name in dict.fromkeys(names) if name and not name.startswith(_NO_NAME)]
    listed = ", ".join(known[:_LISTED]) + (", ..." if len(known) > _LISTED else "")
    if joined == "glued":
        remark = (
            "of one material and joined where they touch: set joined = 'separate' for pieces that "
            "pass no force there"
        )
    else:
        remark = "each a piece of its own that passes no force where they touch: hold each of them"
    return (f"{len(names)} solids in the file{f' ({listed})' if listed else ''}, {remark}",)


def _made(
    function: str, path: str | os.PathLike[str], size: float, scale: float, joined: Joined
) -> dict[str, Any]:
    """Call Gmsh with a CAD file."""
    path = existing_file(path, "CAD file")
    if not is_cad(path):
        raise InputError(
            f"cannot tell the format of CAD file {path}: its name must end in {', '.join(SUFFIXES)}"
        )
    check_number("CAD scale", scale, above=0.0)
    check_number("edge length", size, at_least=0.0, unit="mm")
    full = str(path.absolute())
    try:
        return in_own_process(
            f"gmsh_meshing:{function}",
            path=full,
            size=float(size),
            scale=float(scale),
            joined=joined,
        )
    except ChildError as error:
        if "gmsh" in str(error) and "module" in str(error):
            raise InputError(
                f"{path}: CAD files are read by Gmsh, which is not installed: pip install "
                "'ccfem[cad]'"
            ) from None
        raise InputError(
            f"{path} cannot be meshed by Gmsh: {error}: repair it in the program that made it, or "
            "give it as STL"
        ) from None
    except InputError as error:
        raise InputError(str(error).replace(full, str(path))) from None


def _used(points: Any, triangles: Any) -> tuple[Any, Any]:
    used, rows = np.unique(triangles, return_inverse=True)
    return points[used], rows.reshape(-1, 3)
