"""Strands of another program, a file a layer, as Fang et al. 2024 and Zhang et al. 2025 publish.

An OBJ file has points and lines of two points, which are chained where their ends are the same. Any
other has a row a point: x, y, z in mm, further numbers are not read; a strand ends where two rows
are more than 3 mm apart.
"""

import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.display import by_number
from ccfem.base.errors import InputError
from ccfem.base.whole import existing_file, text_of

_SUFFIXES = (".obj", ".txt")
_JUMP = 3.0
"""Distance, mm, between two rows of a table of numbers from which the strand ends: rows are 0.7 to
1.1 mm apart, and pieces are tens of millimetres from each other."""
_APART = 1e-4
"""Distance, mm, of two points that are one: files round to six digits."""
_FARTHEST = 1e5
"""Coordinate, mm, beyond which a unit is wrong."""


def holds_strands(path: Path) -> bool:
    """Whether a folder or a file holds strands: OBJ lines, or rows of numbers alone."""
    if path.is_dir() or path.suffix.lower() == ".obj":
        return True
    if path.suffix.lower() != ".txt" or not path.is_file():
        return False
    with path.open(encoding="utf-8-sig", errors="replace") as lines:
        first = next((line for line in lines if line.strip()), "")
    return re.match(r"\s*[-+.\d]", first) is not None


def read_strand_files(path: str | Path) -> list[list[FloatArray]]:
    """Strands (k, 3), mm, of each layer: of a file, or of all such files (.obj, .txt) of a folder.

    Files of a folder are layers in the order of the numbers in their names.
    """
    path = Path(path)
    if not path.is_dir():
        files = [existing_file(path, "path file")]
    else:
        files = [file for file in path.iterdir() if file.suffix.lower() in _SUFFIXES]
        files.sort(key=lambda file: by_number(file.name))
    if not files:
        raise InputError(f"{path} holds no files of strands (.obj, .txt): check its name")
    return [(_chained if file.suffix.lower() == ".obj" else _rows)(file) for file in files]


def check_near(points: FloatArray, name: str) -> None:
    """Raise on points (n, 3), mm, that no printer reaches; the error begins with their `name`."""
    farthest = float(np.abs(points).max())
    if farthest > _FARTHEST:
        raise InputError(
            f"{name}: the points of paths must lie within {_FARTHEST:g} mm; got a coordinate of "
            f"{farthest:.3g} mm: repair the file, or give it in mm"
        )


def _rows(path: Path) -> list[FloatArray]:
    """Strands (k, 3) of a file of rows of numbers."""
    points = []
    for number, line in enumerate(text_of(path, "path file").splitlines(), 1):
        try:
            if line.strip():
                points.append([float(word) for word in line.split()[:3]])
                if len(points[-1]) < 3 or not np.isfinite(points[-1]).all():
                    raise ValueError
        except ValueError:
            raise InputError(
                f"{path}, line {number}: expected x, y and z, mm; got '{line[:40]}': repair the "
                "file"
            ) from None
    places = np.array(points, dtype=np.float64).reshape(-1, 3)
    if len(places):
        check_near(places, str(path))
    ends = np.flatnonzero(np.linalg.norm(np.diff(places, axis=0), axis=1) > _JUMP) + 1
    return [strand for strand in np.split(places, ends) if len(strand) > 1]


def _chained(path: Path) -> list[FloatArray]:
    """Strands (k, 3) of the two-point lines of an OBJ file, cut where more than two meet."""
    points, pairs = [], []
    for number, line in enumerate(text_of(path, "path file").splitlines(), 1):
        word, *rest = line.split()[:4] or [""]
        try:
            if word == "v":
                x, y, z = map(float, rest)
                points.append((x, y, z))
            elif word == "l":
                numbers = [int(item.partition("/")[0]) for item in line.split()[1:]]
                pairs += list(pairwise(numbers))
        except ValueError:
            raise InputError(
                f"{path}, line {number}: expected 'v x y z' or 'l a b'; got '{line[:40]}': repair "
                "the file"
            ) from None
    places = np.array(points, dtype=np.float64).reshape(-1, 3)
    ends = np.array(pairs, dtype=object).reshape(-1, 2)
    known = all(0 < end <= len(places) for end in ends.reshape(-1))
    if not len(ends) or not known or not np.isfinite(places).all():
        raise InputError(
            f"{path} has no lines, or they name points that it has not: export strands as lines of "
            "two points (v, l)"
        )
    check_near(places, str(path))
    _, first, same = np.unique(
        np.round(places / _APART), axis=0, return_index=True, return_inverse=True
    )
    edges = np.unique(np.sort(same.reshape(-1)[ends.astype(np.int64) - 1], axis=1), axis=0)
    edges = edges[edges[:, 0] != edges[:, 1]]
    beside: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    strands, left = [], {tuple(edge) for edge in edges.tolist()}
    # First from ends and branches, then round what is closed.
    starts = [node for node, others in beside.items() if len(others) != 2]
    for start in (*starts, *beside):
        for following in beside[start]:
            strand, node = [start], following
            while (min(strand[-1], node), max(strand[-1], node)) in left:
                left.remove((min(strand[-1], node), max(strand[-1], node)))
                strand.append(node)
                if len(beside[node]) == 2 and node != start:
                    node = sum(beside[node]) - strand[-2]
            if len(strand) > 1:
                strands.append(places[first[strand]])
    return strands
