"""Meshes from and to files, by the file's suffix."""

import os
import warnings
from pathlib import Path

import numpy as np

from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.base.whole import existing_file, whole_file
from ccfem.body.files.formats import format_of, suffixes
from ccfem.body.files.surface import is_surface
from ccfem.body.mesh import TetMesh, check_mesh


def read_mesh(path: str | os.PathLike[str], scale: float = 1.0, check: bool = True) -> TetMesh:
    """Read a tetrahedral mesh with the patches that its file names.

    Parameters
    ----------
    path : path
        One of the formats in `ccfem.body.files.formats`: ``.tet``, Gmsh ``.msh`` 2.2 or 4.1
        (physical groups of triangles become patches), ``.vtu`` or legacy ``.vtk``, ``.xdmf`` (tags
        of triangles do, the first step of a series counts), Abaqus ``.inp`` (instances where they
        are placed; surfaces, node sets and sets of triangles become patches), ``.unv`` (groups of
        triangles or nodes become patches), ``.npz``, and what Gmsh reads: ``.med`` (groups of
        triangles become patches), ``.bdf``, ``.nas`` and ``.mesh`` (numbered properties and regions
        do). Linear or quadratic.
    scale : float, default 1
        Factor on the coordinates, to make them mm: 1000 for a file in metres.
    check : bool, default True
        Normalise and mend the mesh with `ccfem.body.mesh.check.check_mesh`; a `UserWarning` says, a
        line each, what it found and mended. Without it the mesh comes as it stands in the file.
    """
    path = existing_file(path, "mesh file")
    suffix = path.suffix.lower()
    if is_surface(path):
        raise InputError(
            f"{path} is a surface, not a tetrahedral mesh: read it with read_surface and fill it "
            "with tetrahedralise, or name it as surface in the part file"
        )
    if suffix not in suffixes():
        raise InputError(
            f"cannot tell the format of mesh file {path}: its name must end in "
            f"{', '.join(suffixes())}"
        )
    check_number("mesh scale", scale, above=0.0)
    try:
        mesh = format_of(suffix).read(path)
        if scale != 1.0:
            with np.errstate(over="ignore"):  # what overflows is refused as infinite
                points = mesh.points * scale
            mesh = TetMesh(points, mesh.cells, mesh.patches, mesh.axes)
        if not check:
            return mesh
        mesh, report = check_mesh(mesh)
    except InputError as error:
        message = str(error)
        raise InputError(message if str(path) in message else f"{path}: {message}") from None
    for line in report.findings:
        warnings.warn(f"{path}: {line}", UserWarning, stacklevel=2)
    return mesh


def write_mesh(mesh: TetMesh, path: str | os.PathLike[str]) -> None:
    """Write a mesh, whole or not at all.

    Parameters
    ----------
    path : path
        ``.vtu`` or ``.npz`` (patches kept) or ``.tet`` (linear meshes only, patches left out: the
        format has no place for them).
    """
    path = Path(path)
    suffix = check_mesh_name(path)
    if not np.isfinite(mesh.points).all():
        raise InputError(f"cannot write {path}: the mesh has NaN or infinite coordinates")
    with whole_file(path) as temporary:
        format_of(suffix).write(mesh, temporary)


def check_mesh_name(path: Path) -> str:
    """Return the suffix of a mesh file that can be written."""
    suffix = path.suffix.lower()
    known = suffixes(writable=True)
    if suffix not in known:
        raise InputError(f"cannot write a mesh to {path}: its name must end in {', '.join(known)}")
    return suffix
