"""The ``.tet`` format of Chen et al. 2021: plain text, linear tetrahedra.

::

    6677 vertices
    32473 tets
    -38.608471 5.163711 31.980261      one line a vertex: x y z
    ...
    4 17 4 3048 512                    one line a tetrahedron: 4 and its nodes, counted from 0
"""

from pathlib import Path

import numpy as np

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh


def read(path: Path) -> TetMesh:
    """Read a ``.tet`` file."""
    content = path.read_bytes().lstrip()
    lines = content.split(b"\n", 2)
    try:
        (n, first), (m, second) = lines[0].split(), lines[1].split()
        points_count, cells_count = int(n), int(m)
    except (IndexError, ValueError):
        raise _not_tet(path, "no such header") from None
    if not first.startswith(b"vert") or not second.startswith(b"tet"):
        raise _not_tet(path, "no such header")
    if cells_count < 1:
        raise InputError(f"{path} holds no tetrahedra: mesh the volume of the part, then write it")
    try:
        values = np.array(lines[2].split() if len(lines) > 2 else [], dtype=np.float64)
    except ValueError as error:
        raise _not_tet(path, str(error)) from None
    if points_count < 1:
        raise _not_tet(path, f"{points_count} vertices")
    expected = 3 * points_count + 5 * cells_count
    if len(values) != expected:
        raise _not_tet(path, f"{len(values)} numbers in place of {expected}")
    points = values[: 3 * points_count].reshape(-1, 3)
    rows = values[3 * points_count :].reshape(-1, 5)
    wrong = np.flatnonzero(
        (rows[:, 0] != 4) | ~((rows == np.floor(rows)) & (np.abs(rows) < 2**53)).all(axis=1)
    )
    if len(wrong):
        raise _not_tet(path, f"tetrahedron {wrong[0]} does not read '4 a b c d'")
    return TetMesh(points, rows[:, 1:].astype(np.int64))


def write(mesh: TetMesh, path: Path) -> None:
    """Write the points, to the last bit, and cells of a linear mesh; patches are left out."""
    if mesh.order != 1:
        raise InputError("the .tet format holds linear tetrahedra only: write .vtu or .npz")
    rows = np.column_stack([np.full(len(mesh.cells), 4), mesh.cells])
    text = [f"{len(mesh.points)} vertices", f"{len(mesh.cells)} tets"]
    text += [f"{x!r} {y!r} {z!r}" for x, y, z in mesh.points.tolist()]
    text += [" ".join(map(str, row)) for row in rows.tolist()]
    path.write_text("\n".join(text) + "\n", encoding="ascii")


def _not_tet(path: Path, why: str) -> InputError:
    return InputError(
        f"{path} is not a .tet mesh ({why}): expected 'N vertices', 'M tets', N lines x y z and M "
        "lines 4 a b c d"
    )
