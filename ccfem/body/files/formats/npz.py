"""Meshes as NumPy archives: small, exact and quick to read.

``points`` (n, 3) float64, ``cells`` (m, 4 or 10) integers, a (k, 3) array of boundary facets named
``patch:NAME`` for each patch, and the axis (3,) of round ones, ``axis:NAME``. Nothing in the
archive is unpickled.
"""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.base.errors import InputError, shown
from ccfem.body.files.cells import is_axis
from ccfem.body.mesh import TetMesh

_PATCH, _AXIS = "patch:", "axis:"
_SMALL, _PACKED = 10_000_000, 200
"""Bytes that any archive may unpack to, and how many times its size more."""


def read(path: Path) -> TetMesh:
    """Read a mesh from a NumPy archive."""
    try:
        _check_sizes(path)
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except InputError:
        raise
    except Exception as error:  # numpy, zipfile and zlib raise a dozen kinds on broken files
        reason = shown(str(error).partition("\n")[0] or type(error).__name__)
        raise InputError(
            f"{path} is not a mesh in a NumPy archive ({reason}): write it with write_mesh"
        ) from None
    wrong = sorted(name for name, array in arrays.items() if not isinstance(array, np.ndarray))
    if wrong:
        raise InputError(f"{path} holds {shown(wrong[0])}, no array: write it with write_mesh")
    if "points" not in arrays or "cells" not in arrays:
        raise InputError(
            f"{path} must hold the arrays points and cells; it has: "
            f"{', '.join(sorted(arrays)) or 'none'}: write it with write_mesh"
        )
    for name, array in arrays.items():
        wanted = "fiu" if name == "points" or name.startswith(_AXIS) else "iu"
        if array.dtype.kind not in wanted:
            raise InputError(f"{path}: array {name} must be numbers; got {array.dtype}")
    patches = {
        name.removeprefix(_PATCH): facets
        for name, facets in arrays.items()
        if name.startswith(_PATCH)
    }
    axes = {
        name.removeprefix(_AXIS): axis.reshape(-1)
        for name, axis in arrays.items()
        if name.startswith(_AXIS)
    }
    wrong = [name for name, axis in axes.items() if name not in patches or not is_axis(axis)]
    if wrong:
        raise InputError(
            f"{path}: {_AXIS}{wrong[0]} must be three numbers, the axis of a patch that is there: "
            "write it with write_mesh"
        )
    return TetMesh(arrays["points"], arrays["cells"], patches, axes)


def _check_sizes(path: Path) -> None:
    """Raise on an archive that says it unpacks to far more than any mesh does."""
    size = path.stat().st_size
    if not zipfile.is_zipfile(path):
        raise InputError(f"{path} is not a mesh in a NumPy archive: write it with write_mesh")
    with zipfile.ZipFile(path) as archive:
        unpacked = sum(entry.file_size for entry in archive.infolist())
    if unpacked > _SMALL + _PACKED * size:
        raise InputError(
            f"{path} unpacks from {size:.3g} to {unpacked:.3g} bytes, as no mesh does: write it "
            "with write_mesh"
        )


def write(mesh: TetMesh, path: Path) -> None:
    """Write a mesh with its patches to a compressed NumPy archive; equal meshes, equal bytes."""
    arrays: dict[str, Any] = {"points": mesh.points, "cells": mesh.cells.astype(np.int32)}
    for name in sorted(mesh.patches):
        arrays[_PATCH + name] = mesh.patches[name].astype(np.int32)
    for name in sorted(mesh.axes):
        arrays[_AXIS + name] = mesh.axes[name]
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)
