"""Surfaces in 3MF files, as slicers and CAD programs write them, to plain arrays.

3MF Core Specification 1.3: a ZIP archive with a model in XML, whose objects are meshes, or
components that are other objects, placed; the items of its build are what is printed. Components
may lie in other models of the archive (Production Extension).
"""

import re
import zipfile
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

_UNITS = {
    "micron": 1e-3,
    "millimeter": 1.0,
    "centimeter": 10.0,
    "inch": 25.4,
    "foot": 304.8,
    "meter": 1000.0,
}
"""Lengths, mm."""
_DEEPEST = 16
"""Components of components that are followed."""
_CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
_PATH = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}path"

_Piece = tuple[NDArray[np.float64], NDArray[np.int64]]


def read_surface(path: str) -> dict[str, Any]:
    """Points, mm, and triangles of all that a 3MF file builds."""
    with zipfile.ZipFile(path) as archive:
        first = _start(archive)
        models: dict[str, ElementTree.Element] = {}
        pieces: list[_Piece] = []
        for item in _model(archive, first, models).iterfind(f"{_CORE}build/{_CORE}item"):
            for points, triangles in _object(archive, models, item, first, _DEEPEST):
                pieces.append((_placed(points, item), triangles))
        unit = _UNITS[models[first].get("unit", "millimeter")]
    if not any(len(triangles) for _, triangles in pieces):
        raise ValueError("it builds no object with triangles")
    starts = np.cumsum([0, *(len(points) for points, _ in pieces[:-1])])
    return {
        "points": unit * np.concatenate([points for points, _ in pieces]),
        "triangles": np.concatenate([t + k for (_, t), k in zip(pieces, starts, strict=True)]),
    }


def _start(archive: zipfile.ZipFile) -> str:
    """Name of the model that a file starts with."""
    rows = re.findall(rb"<Relationship\b[^>]*>", archive.read("_rels/.rels"))
    for row in rows:
        target = re.search(rb"""Target\s*=\s*["']/?([^"']+)""", row)
        if b"/3dmodel" in row and target:
            return target[1].decode()
    raise ValueError("it names no model in _rels/.rels")


def _model(
    archive: zipfile.ZipFile, name: str, models: dict[str, ElementTree.Element]
) -> ElementTree.Element:
    """Model of an archive, read once."""
    if name not in models:
        models[name] = ElementTree.fromstring(archive.read(name))
    return models[name]


def _object(
    archive: zipfile.ZipFile,
    models: dict[str, ElementTree.Element],
    user: ElementTree.Element,
    name: str,
    depth: int,
) -> Iterator[_Piece]:
    """Meshes of the object that an item or a component names, in the object's frame."""
    name = user.get(_PATH, name).removeprefix("/")
    wanted = user.get("objectid")
    objects = _model(archive, name, models).iterfind(f"{_CORE}resources/{_CORE}object")
    element = next((one for one in objects if one.get("id") == wanted), None)
    if element is None or depth == 0:
        raise ValueError(f"object {wanted} is not there, or a part of itself")
    for mesh in element.iterfind(f"{_CORE}mesh"):
        vertices = mesh.iterfind(f"{_CORE}vertices/{_CORE}vertex")
        triangles = mesh.iterfind(f"{_CORE}triangles/{_CORE}triangle")
        points = np.array([[float(v.attrib[c]) for c in "xyz"] for v in vertices])
        sides = np.array([[int(t.attrib[c]) for c in ("v1", "v2", "v3")] for t in triangles])
        if sides.size and not 0 <= sides.min() <= sides.max() < len(points):
            raise ValueError("a triangle names a point that is not there")
        yield points.reshape(-1, 3), sides.astype(np.int64).reshape(-1, 3)
    for part in element.iterfind(f"{_CORE}components/{_CORE}component"):
        for points, sides in _object(archive, models, part, name, depth - 1):
            yield _placed(points, part), sides


def _placed(points: NDArray[np.float64], user: ElementTree.Element) -> NDArray[np.float64]:
    """Points (n, 3) where an item or a component places them: rows times its matrix (4, 3)."""
    given = user.get("transform")
    if given is None:
        return points
    matrix = np.array([float(word) for word in given.split()]).reshape(4, 3)
    return points @ matrix[:3] + matrix[3]
