"""Meshes that were made before, kept by what they were made of."""

import hashlib
import json
import os
import re
import zipfile
import zlib
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.base.errors import InputError
from ccfem.base.whole import whole_file
from ccfem.body.mesh.tet_mesh import TetMesh

_FORMAT = 2
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

    Parameters
    ----------
    content : bytes
        Of the file.
    asked : dict
        Everything else that the mesh depends on.
    make : callable
        Returns the mesh, and what is to be said of it.
    """
    folder = cache_folder()
    if folder is None:
        return make()
    about = {**asked, "format": _FORMAT, **{name: _version(name) for name in ("gmsh", "pytetwild")}}
    key = hashlib.sha256(json.dumps(about, sort_keys=True).encode() + b"\0" + content).hexdigest()
    path = folder / f"{key}.npz"
    found = _read(path)
    if found is not None:
        return found
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
        patches = {name.removeprefix(_PATCH): facets for name, facets in arrays.items()}
        return TetMesh(points, cells, patches), findings
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
        return None


def _write(path: Path, mesh: TetMesh, findings: tuple[str, ...]) -> None:
    """Keep a mesh; where the folder cannot be written to, do without."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        named: dict[str, Any] = {_PATCH + name: facets for name, facets in mesh.patches.items()}
        named |= {"points": mesh.points, "cells": mesh.cells, "findings": np.array(findings, "U")}
        with whole_file(path) as temporary:
            np.savez(temporary, **named)
        # The folder may hold other files, and even meshes of other names.
        files = [file for file in path.parent.iterdir() if _NAME.fullmatch(file.name)]
        for old in sorted(files, key=lambda file: file.lstat().st_mtime)[:-_MOST]:
            old.unlink(missing_ok=True)
    except (OSError, InputError):
        return
