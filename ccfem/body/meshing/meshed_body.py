"""A surface or a CAD file to a mesh with its faces as patches, made once and kept."""

import hashlib
import json
import os
import re
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.base.whole import existing_file, whole_file
from ccfem.body.files.layer_files import layer_files, median_gap, read_layer, stack_surface
from ccfem.body.files.surface import Surface, read_surface
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.patches import face_name
from ccfem.body.mesh.round_walls import RoundWall
from ccfem.body.mesh.smooth_faces import FEATURE_ANGLE, given_faces, smooth_faces
from ccfem.body.meshing.cad import Joined, is_cad, mesh_cad, read_cad
from ccfem.body.meshing.volume import Mesher, fill


def mesh_body(
    path: str | os.PathLike[str],
    edge_length: float,
    scale: float = 1.0,
    mesher: Mesher = "auto",
    before: Callable[[Surface], None] | None = None,
    angle: float = FEATURE_ANGLE,
    joined: Joined = "glued",
) -> tuple[TetMesh, tuple[str, ...]]:
    """Mesh a file of a closed surface (STL, OBJ, PLY) or of solids (STEP, IGES, BREP), or layers.

    Parameters
    ----------
    path : path
        A folder holds the curved layers of a part, OBJ files from the first to the last by the
        numbers in their names: see `ccfem.body.files.layer_files`. The mesh then has no patches,
        and is made by fTetWild by default.
    edge_length : float, mm
    scale : float, default 1
        Factor on the coordinates, to make them mm.
    mesher : {"auto", "gmsh", "ftetwild"}, default "auto"
        For surfaces: see `ccfem.body.meshing.tetrahedralise`. CAD files are meshed by Gmsh.
    before : callable, optional
        Called with the surface before it is meshed, to complain early.
    angle : float, degrees
        Feature angle between the faces of a surface.
    joined : {"glued", "separate"}, default "glued"
        What becomes of solids of a CAD file that touch.

    Returns
    -------
    mesh : TetMesh
        With the faces as patches ``face_1``, ``face_2``, ...; by Gmsh the same for equal input on
        any number of cores. It is kept in the user's cache (the variable CCFEM_CACHE names another
        folder, or none where it is empty), and not made again.
    findings : tuple of str
        Who made it, its volume and its distance from the surface.
    """
    path, folder = Path(path), Path(path).is_dir()
    if not folder:
        path = existing_file(path, "CAD file" if is_cad(path) else "surface file")
    elif mesher == "auto":
        mesher = "ftetwild"
    files = layer_files(path) if folder else (path,)
    check_number("edge length", edge_length, above=0.0, unit="mm")
    check_number("scale", scale, above=0.0)

    def make() -> tuple[TetMesh, tuple[str, ...]]:
        if is_cad(path):
            return mesh_cad(path, edge_length, scale, joined)
        surface, *remarks = _solid(files, scale) if folder else (read_surface(path, scale),)
        if before is not None:
            before(surface)
        mesh, fit, who = fill(surface, edge_length, mesher)
        about = fit.about(who)
        if who != "Gmsh":  # it takes its random numbers from the hardware
            about += (
                "; fTetWild gives a different mesh each time, so this one is stored on this "
                "machine for reuse"
            )
        named = mesh if folder else with_faces_of(surface, mesh, angle)
        return named, (*remarks, about, *fit.doubts)

    asked: dict[str, object] = {
        "edge_length": float(edge_length),
        "scale": float(scale),
        "mesher": mesher,
        "angle": float(angle),
        "joined": joined,
        "suffix": "layers" if folder else path.suffix.lower(),
    }
    return kept(b"\0".join(file.read_bytes() for file in files), asked, make)


def _solid(files: Sequence[Path], scale: float) -> tuple[Surface, str]:
    """Surface of the solid that layers fill, and what is to be said of it."""
    layers = [(scale * points, triangles) for points, triangles in map(read_layer, files)]
    gap = median_gap(layers)
    surface = Surface(*stack_surface(layers))
    return surface, (
        f"{len(files)} layers, {gap:.3g} mm apart, fill {surface.volume:.5g} mm^3: faces of the "
        "part are known to about half of that, and its edges are rounded by as much"
    )


# Meshes that were made before, kept by what they were made of.


_FORMAT = 6
"""Raised when meshing changes, or what is said of it: meshes of before are made anew."""
_MOST = 100
"""Meshes that are kept; the ones not used for longest go."""
_PATCH = "patch:"
_NAME = re.compile(r"[0-9a-f]{64}\.npz")


def cache_folder() -> Path | None:
    """Folder of the meshes: CCFEM_CACHE where that is set (empty for none), else the user's."""
    named = os.environ.get("CCFEM_CACHE")
    if named is not None:
        return Path(named) if named else None
    from platformdirs import user_cache_path

    return user_cache_path("ccfem", appauthor=False) / "meshes"


def kept(
    content: bytes, asked: dict[str, object], make: Callable[[], tuple[TetMesh, tuple[str, ...]]]
) -> tuple[TetMesh, tuple[str, ...]]:
    """Return the mesh made of some content before, or make it and keep it.

    `content` is that of the file, `asked` all else that the mesh depends on; `make` returns the
    mesh and what is to be said of it.
    """
    folder = cache_folder()
    if folder is None:
        return make()
    about = {**asked, "format": _FORMAT, **{name: _version(name) for name in ("gmsh", "pytetwild")}}
    key = hashlib.sha256(json.dumps(about, sort_keys=True).encode() + b"\0" + content).hexdigest()
    path = folder / f"{key}.npz"
    known = _read(path)
    if known is not None:
        return known
    mesh, findings = make()
    _write(path, mesh, findings)
    return mesh, findings


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _read(path: Path) -> tuple[TetMesh, tuple[str, ...]] | None:
    """Mesh of a file of the cache; None where it is not there, or broken."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        os.utime(path, follow_symlinks=os.utime not in os.supports_follow_symlinks)
        findings = tuple(arrays.pop("findings").tolist())
        points, cells = arrays.pop("points"), arrays.pop("cells")
        walls = tuple(map(RoundWall.from_row, arrays.pop("walls")))
        patches = {name.removeprefix(_PATCH): facets for name, facets in arrays.items()}
        return TetMesh(points, cells, patches, walls=walls), findings
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
        return None


def _write(path: Path, mesh: TetMesh, findings: tuple[str, ...]) -> None:
    """Keep a mesh; where the folder cannot be written to, do without."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        named: dict[str, Any] = {_PATCH + name: facets for name, facets in mesh.patches.items()}
        named["walls"] = np.array([wall.row for wall in mesh.walls or ()]).reshape(-1, 13)
        named |= {"points": mesh.points, "cells": mesh.cells, "findings": np.array(findings, "U")}
        with whole_file(path) as temporary:
            np.savez(temporary, **named)
        # The folder may hold other files, and even meshes of other names.
        files = [file for file in path.parent.iterdir() if _NAME.fullmatch(file.name)]
        for old in sorted(files, key=lambda file: file.lstat().st_mtime)[:-_MOST]:
            old.unlink(missing_ok=True)
    except (OSError, InputError):
        return


# Faces of a surface or a CAD file, and of a surface on the mesh that was made from it.


def faces_of_body(
    path: str | os.PathLike[str],
    scale: float = 1.0,
    angle: float = FEATURE_ANGLE,
    joined: Joined = "glued",
) -> BodyFaces:
    """Faces of a closed surface, or of a CAD file as it has them, numbered before any meshing.

    Parameters
    ----------
    path : path
        STL, OBJ, PLY, STEP, IGES or BREP.
    scale : float, default 1
        Factor on the coordinates.
    angle : float, degrees
        Feature angle, of a surface.
    joined : {"glued", "separate"}, default "glued"
        As in `mesh_body`.
    """
    if not is_cad(path):
        surface = read_surface(path, scale)
        faces = smooth_faces(surface.points, surface.triangles, angle)
        return BodyFaces(surface.points, surface.triangles, faces)
    cad = read_cad(path, scale, joined=joined)
    points, triangles = cad.surface.points, cad.surface.triangles
    rows = {k: np.flatnonzero(cad.face == k) for k in np.unique(cad.face).tolist()}
    names = tuple(cad.names[k - 1] for k in rows)
    faces = given_faces(points, triangles, rows.values())
    return BodyFaces(points, triangles, faces, names, tuple(rows))


def with_faces_of(surface: Surface, mesh: TetMesh, angle: float = FEATURE_ANGLE) -> TetMesh:
    """Mesh with the smooth faces of its surface as groups ``face_1``, ``face_2``, ...

    So the numbers that ``ccfem faces`` gives for a surface hold whatever mesh is made of it. Each
    boundary facet belongs to the face of the triangle that its centre is nearest to; faces so small
    that no facet lies on them are no groups.
    """
    import pyvista

    faces = smooth_faces(surface.points, surface.triangles, angle)
    number = np.zeros(len(surface.triangles), dtype=np.int64)
    for k, face in enumerate(faces, 1):
        number[face.facets] = k
    shell = pyvista.PolyData.from_regular_faces(surface.points, surface.triangles)
    centres = mesh.points[mesh.boundary].mean(axis=1)
    of = number[np.asarray(shell.find_closest_cell(centres))]
    groups = {face_name(k): mesh.boundary[of == k] for k in np.unique(of).tolist()}
    return replace(mesh, patches={**mesh.patches, **groups})
