"""Waypoint files as published with Chen et al. 2021: ``X.. Y.. Z..`` lines between ``S`` and ``E``.

A line ``;Layer_CCF: i`` starts layer i. Coordinates are those of the tool: X and Y along the two
in-plane axes of a layer's frame, Z along the build direction. (For the authors' meshes, built along
y, the tool's X, Y, Z are x, -z, y of the mesh.) The format cannot mark links (`Toolpaths.link`):
paths that are read back have none. A first line ``;Turns back by design: NAME`` names a published
pattern whose turns are meant.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.whole import text_of, whole_file
from ccfem.body.files.strand_files import check_near
from ccfem.geometry.polylines import pack
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer

CLOSED = 1e-3
"""Largest distance, mm, between the ends of a closed path: the files round to 6 digits."""
LARGEST_NUMBER = 1e15
"""Of paths and layers: larger ones are not told apart from their neighbours."""
_MARK = ";Layer_CCF:"
_PATTERN = ";Turns back by design: "


def read_waypoints(path: str | Path, frame: FloatArray) -> Toolpaths:
    """Read fibre paths from a waypoint file.

    Parameters
    ----------
    frame : (3, 3) array
        Frame of the layers (`Layer.frame`); its rows are the tool's axes in the frame of the mesh.

    Returns
    -------
    Toolpaths
        In the frame of the mesh, layers numbered as in the file. A path is closed when its ends lie
        within 0.001 mm of each other, which are then made equal.
    """
    lines, layers = _parse(text_of(path, "waypoint file"), str(path))
    if not lines:
        return Toolpaths.empty()
    check_near(np.concatenate(lines), str(path))
    closed = close_rings(lines)
    points, offsets = pack(lines)
    return Toolpaths(
        points=points @ frame,
        normals=np.broadcast_to(frame[2], points.shape),
        offsets=offsets,
        layer=np.array(layers),
        kind=np.full(len(lines), FIBRE),
        closed=np.array(closed),
    )


def pattern_of(path: str | Path) -> str:
    """Name of the published pattern whose turns a file of paths says that it means; else empty."""
    if Path(path).is_dir():
        return ""
    first, *_ = text_of(path, "paths").splitlines() or [""]
    return first.removeprefix(_PATTERN).strip() if first.startswith(_PATTERN) else ""


def _parse(text: str, name: str) -> tuple[list[FloatArray], list[int]]:
    """Paths in tool coordinates (n_i, 3), and the layer of each."""
    lines: list[FloatArray] = []
    layers: list[int] = []
    layer = -1
    current: list[list[float]] | None = None
    for number, raw in enumerate(text.splitlines(), start=1):
        word = raw.strip()
        if not word:
            continue
        try:
            if word.startswith(_MARK):
                layer = int(word[len(_MARK) :])
                if layer > LARGEST_NUMBER:
                    raise ValueError(word)
            elif word == "S" and current is None and layer >= 0:
                current = []
            elif word == "E" and current is not None and len(current) > 1:
                lines.append(np.array(current))
                layers.append(layer)
                current = None
            elif current is not None and word.startswith("X"):
                current.append(_coordinates(word))
            elif not word.startswith(";"):
                raise ValueError
        except ValueError:
            raise InputError(
                f"{name}, line {number}: expected ';Layer_CCF: i', then paths of at least two "
                f"'X.. Y.. Z..' lines between 'S' and 'E'; got '{word[:40]}'"
            ) from None
    if current is not None:
        raise InputError(f"{name}: the last path has no 'E'; the file is cut short")
    return lines, layers


def _coordinates(word: str) -> list[float]:
    """Three finite numbers of an ``X.. Y.. Z..`` line; ValueError otherwise."""
    parts = word.split()
    if [part[0] for part in parts] != ["X", "Y", "Z"]:
        raise ValueError(word)
    values = [float(part[1:]) for part in parts]
    if not np.isfinite(values).all():
        raise ValueError(word)
    return values


def close_rings(lines: Sequence[FloatArray]) -> list[bool]:
    """Close lines (k, 3) whose ends meet, in place; which are closed."""
    closed = [len(a) > 3 and float(np.linalg.norm(a[0] - a[-1])) <= CLOSED for a in lines]
    for line, ring in zip(lines, closed, strict=True):
        if ring:
            line[-1] = line[0]
    return closed


def write_waypoints(
    path: str | Path, toolpaths: Toolpaths, layers: Sequence[Layer], pattern: str = ""
) -> None:
    """Write fibre paths to a waypoint file, whole or not at all, rounded to 0.0001 mm.

    Parameters
    ----------
    toolpaths : Toolpaths
        Paths of other kinds than fibre are left out.
    layers : sequence of Layer
        Layers that the paths lie on; every one of them gets its line in the file.
    pattern : str, default ""
        Name of a published pattern that turns back by design, for the first line.
    """
    fibre = toolpaths.of_kind(FIBRE)
    missing = set(fibre.layer.tolist()) - {layer.index for layer in layers}
    if missing:
        raise InputError(f"paths lie on layer {min(missing)}, which is not among the layers given")
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        if pattern:
            file.write(f"{_PATTERN}{pattern}\n")
        for layer in layers:
            out = [f"{_MARK} {layer.index}"]
            for line in fibre.on_layer(layer.index):
                rows = (line @ layer.plane.frame.T).round(4) + 0.0
                out += ["S", *(f"X{x:.10g} Y{y:.10g} Z{z:.10g}" for x, y, z in rows.tolist()), "E"]
            file.write("\n".join(out) + "\n")
