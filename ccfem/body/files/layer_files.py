"""Curved layers of another program: a folder of OBJ files, one surface a file."""

import os
from pathlib import Path

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.display import by_number
from ccfem.base.errors import InputError


def layer_files(folder: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Files of the layers in a folder, by the numbers in their names."""
    files = sorted(Path(folder).glob("*.obj"), key=lambda file: by_number(file.stem))
    if not files:
        raise InputError(
            f"no .obj file in the folder '{folder}': give the folder of the layers, one surface a "
            "file"
        )
    return tuple(files)


def read_layer(path: Path) -> tuple[FloatArray, IntArray]:
    """Points (n, 3), mm, and triangles (t, 3) of an OBJ file of triangles.

    Points that are the same are one, as where each triangle has its own; triangles of fewer than
    three points are left out.
    """
    points, triangles = [], []
    try:
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            words = line.split()
            if words[:1] == ["v"]:
                points.append([float(word) for word in words[1:4]])
            elif words[:1] == ["f"]:
                a, b, c = (int(word.split("/")[0]) for word in words[1:])
                triangles.append((a, b, c))
        vertices = np.array(points, dtype=np.float64).reshape(-1, 3)
        corners = np.array(triangles, dtype=np.int64).reshape(-1, 3) - 1
    except (ValueError, IndexError, OverflowError):
        raise InputError(f"{path} is no OBJ file of triangles: export it again") from None
    if not len(corners) or corners.min() < 0 or corners.max() >= len(vertices):
        raise InputError(f"{path} has no triangles, or they name points that it has not")
    if not np.isfinite(vertices).all():
        raise InputError(f"{path} has points that are not finite: repair the file")
    _, first, same = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    corners = first[same.reshape(-1)][corners]
    corners = corners[(np.diff(np.sort(corners, axis=1), axis=1) > 0).all(axis=1)]
    if not len(corners):
        raise InputError(f"{path} has no triangle of three points: export it again")
    return vertices, corners
