"""Meshing by Gmsh, on one core, so that equal input gives equal meshes: CAD files and surfaces."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ccfem.base.errors import InputError

_ROUND = 12
"""Edges on a full turn of a round wall, where the size that is asked for would give fewer."""
_FINEST = 0.15
"""Shortest edge there, over that size."""
_GROWTH = 0.4
"""Growth of the edges with the distance from a round wall."""
_SAGITTA = 0.04
"""Distance of the chords from the faces of a CAD file that are neither flat nor round walls, mm.

Round walls are followed exactly whatever their chords are, these faces by their chords alone."""
_KNOWN = ("Plane", "Cylinder", "Cone", "Sphere")
"""Kinds of faces that are flat or round walls."""


def cad_volume(path: str, size: float, scale: float, joined: str) -> dict[str, Any]:
    """Tetrahedra in the solids of a CAD file, "glued" where they touch or "separate".

    Returns ``points``, ``cells``, ``triangles`` of the outside with the number of the face of
    each, ``face`` from 1 in the order of the file, and the ``names`` of all its faces and
    ``solids``, empty where they have none.
    """
    with _model() as gmsh:
        given = _solids(gmsh, path, joined)
        _sizes(gmsh, size / scale)
        _follow_free_forms(gmsh, _SAGITTA / scale)
        gmsh.model.mesh.generate(3)
        return {**_mesh(gmsh, scale), **_faces(gmsh, path, *given, joined)}


def cad_surface(path: str, size: float, scale: float, joined: str) -> dict[str, Any]:
    """Triangles on the outside of the solids of a CAD file; as `cad_volume` without cells.

    A size of 0 takes a thirtieth of the part.
    """
    with _model() as gmsh:
        given = _solids(gmsh, path, joined)
        low, high = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3))
        _sizes(gmsh, size / scale or float(np.linalg.norm(high - low)) / 30.0, turn=2 * _ROUND)
        gmsh.model.mesh.generate(2)
        return {**_mesh(gmsh, scale), **_faces(gmsh, path, *given, joined)}


def fill(
    points: NDArray[Any], triangles: NDArray[Any], size: float, angle: float, walls: NDArray[Any]
) -> dict[str, Any]:
    """Tetrahedra in a closed surface, its smooth faces meshed anew; ``points`` and ``cells``.

    `angle`, degrees, is that from which an edge between triangles stays. `walls` (k, 8) are round
    walls, meshed finer: middle of the axis, its direction, radius and half its length.
    """
    with _model() as gmsh:
        surface = gmsh.model.addDiscreteEntity(2)
        gmsh.model.mesh.addNodes(2, surface, np.arange(1, len(points) + 1), points.reshape(-1))
        count = np.arange(1, len(triangles) + 1)
        gmsh.model.mesh.addElementsByType(surface, 2, count, triangles.reshape(-1) + 1)
        gmsh.model.mesh.classifySurfaces(math.radians(angle), True, True, math.pi)
        gmsh.model.mesh.createGeometry()
        pieces = [tag for _, tag in gmsh.model.getEntities(2)]
        gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(pieces)])
        gmsh.model.geo.synchronize()
        _sizes(gmsh, size, turn=0)
        if len(walls):
            rows = walls.tolist()
            gmsh.model.mesh.setSizeCallback(
                lambda _dim, _tag, x, y, z, _size: _size_at(x, y, z, float(size), rows)
            )
        gmsh.model.mesh.generate(3)
        return _mesh(gmsh, 1.0)


@contextmanager
def _model() -> Iterator[Any]:
    """Gmsh, silent, on one core, with an empty model."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for option, value in (
            ("General.Terminal", 0),
            ("General.NumThreads", 1),
            ("Geometry.OCCImportLabels", 1),
            ("Mesh.Algorithm", 6),
            ("Mesh.Algorithm3D", 1),
            ("Mesh.Optimize", 1),
            ("Mesh.RandomSeed", 1),
        ):
            gmsh.option.setNumber(option, value)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        yield gmsh
    finally:
        gmsh.finalize()


def _solids(gmsh: Any, path: str, joined: str) -> tuple[dict[int, str], list[str]]:
    """Read a CAD file, its solids joined or not: names of their faces by tag, and of the solids."""
    try:
        gmsh.model.occ.importShapes(path, highestDimOnly=False)
        gmsh.model.occ.synchronize()
    except Exception as error:
        raise InputError(
            f"{path} is not a CAD file that Gmsh can read ({error}): it may be cut short; export "
            "it again as STEP, or give STL"
        ) from None
    solids = gmsh.model.getEntities(3)
    if not solids:
        raise InputError(
            f"{path} holds no solid: sew its faces to a solid in the program that made it"
        )
    for entity in [e for e in gmsh.model.getEntities(2) if not len(_above(gmsh, e))]:
        gmsh.model.removeEntities([entity], recursive=True)
    faces = {tag: _name(gmsh, 2, tag) for _, tag in gmsh.model.getEntities(2)}
    names = [_name(gmsh, 3, tag) for _, tag in solids]
    shared = [tag for tag in faces if len(_above(gmsh, (2, tag))) > 1]
    if shared and joined == "separate":
        raise InputError(
            f"{path}: {len(shared)} faces belong to two solids each, so these are one in the file: "
            "export them as solids of their own, or leave out joined"
        )
    if len(solids) > 1 and joined == "glued":  # solids that touch get one mesh
        gmsh.model.occ.fragment(solids[:1], solids[1:])
        gmsh.model.occ.synchronize()
    return faces, names


def _name(gmsh: Any, dimension: int, tag: int) -> str:
    return str(gmsh.model.getEntityName(dimension, tag).rpartition("/")[2])


def _above(gmsh: Any, entity: tuple[int, int]) -> Any:
    """Solids that a face belongs to."""
    return gmsh.model.getAdjacencies(*entity)[0]


def _sizes(gmsh: Any, size: float, turn: int = _ROUND) -> None:
    for option, value in (
        ("MeshSizeMax", size),
        ("MeshSizeMin", _FINEST * size),
        ("MeshSizeFromCurvature", turn),
        ("MeshSizeFromPoints", 0),
        ("MeshSizeExtendFromBoundary", int(turn > 0)),
    ):
        gmsh.option.setNumber(f"Mesh.{option}", value)


def _follow_free_forms(gmsh: Any, sagitta: float) -> None:
    """Make edges on free-form faces so short that their chords lie close to the faces.

    The size by curvature is that of a circle in `_ROUND` edges, which tells its radius.
    """
    faces = [
        tag for _, tag in gmsh.model.getEntities(2) if gmsh.model.getType(2, tag) not in _KNOWN
    ]
    if not faces:
        return
    bounds = {abs(tag) for face in faces for tag in gmsh.model.getAdjacencies(2, face)[1]}
    free = {(2, tag) for tag in faces} | {(1, tag) for tag in bounds}
    share = 8.0 * sagitta * _ROUND / (2.0 * math.pi)
    gmsh.model.mesh.setSizeCallback(
        lambda dim, tag, _x, _y, _z, size: (
            min(size, math.sqrt(share * size)) if (dim, tag) in free else size
        )
    )


def _size_at(x: float, y: float, z: float, size: float, walls: list[list[float]]) -> float:
    """Edge length at a point: shorter on round walls, growing away from them.

    Gmsh asks for it at every point: plain numbers are ten times quicker here than arrays.
    """
    least = size
    for cx, cy, cz, ax, ay, az, radius, half in walls:
        u, v, w = x - cx, y - cy, z - cz
        along = u * ax + v * ay + w * az
        across = math.sqrt(max(u * u + v * v + w * w - along * along, 0.0))
        away = math.hypot(across - radius, max(abs(along) - half, 0.0))
        least = min(least, max(2.0 * math.pi * radius / _ROUND, _FINEST * size) + _GROWTH * away)
    return least


def _mesh(gmsh: Any, scale: float) -> dict[str, Any]:
    """Nodes and tetrahedra of the model."""
    tags, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags, kind="stable")
    _, cells = gmsh.model.mesh.getElementsByType(4)
    return {
        "points": np.reshape(points, (-1, 3))[order] * scale,
        "cells": np.searchsorted(tags[order], cells.astype(np.int64)).reshape(-1, 4),
    }


def _faces(
    gmsh: Any, path: str, faces: dict[int, str], solids: list[str], joined: str
) -> dict[str, Any]:
    """Triangles of the outside, the number in the file of the face of each, and all names."""
    nodes = np.sort(gmsh.model.mesh.getNodes()[0])
    outside = gmsh.model.getBoundary(gmsh.model.getEntities(3), combined=True, oriented=False)
    rows = {}
    for tag in sorted({abs(tag) for _, tag in outside}):
        _, corners = gmsh.model.mesh.getElementsByType(2, tag)
        rows[tag] = np.searchsorted(nodes, corners.astype(np.int64)).reshape(-1, 3)
    number = {tag: k for k, tag in enumerate(faces, 1)}
    if len(solids) > 1 and joined == "glued":
        number = _numbers(gmsh, path, number, [tag for tag in rows if len(rows[tag])])
    return {
        "triangles": np.concatenate(list(rows.values())),
        "face": np.concatenate([np.full(len(rows[tag]), number.get(tag, 0)) for tag in rows]),
        "names": np.array(list(faces.values())),
        "solids": np.array(solids),
    }


def _numbers(gmsh: Any, path: str, known: dict[int, int], tags: list[int]) -> dict[int, int]:
    """Numbers in the file of faces of joined solids, by the numbers of its faces by their tags.

    Joining makes faces anew. Each is a part of that face of the file that a point inside it is on.
    """
    places = []
    for tag in tags:
        _, corners = gmsh.model.mesh.getElementsByType(2, tag)
        middle = np.mean([gmsh.model.mesh.getNode(node)[0] for node in corners[:3]], axis=0)
        places.append(np.array(gmsh.model.getClosestPoint(2, tag, middle)[0]))
    joined = gmsh.model.getCurrent()
    gmsh.model.add("as in the file")
    gmsh.model.occ.importShapes(path, highestDimOnly=False)
    gmsh.model.occ.synchronize()
    boxes = {tag: np.reshape(gmsh.model.getBoundingBox(2, tag), (2, 3)) for tag in known}
    near = 1e-4 * float(np.ptp(np.concatenate(list(boxes.values())), axis=0).max())
    numbers = {}
    for tag, place in zip(tags, places, strict=True):
        off = {}
        for given, (low, high) in boxes.items():
            if (place >= low - near).all() and (place <= high + near).all():
                nearest, at = gmsh.model.getClosestPoint(2, given, place)
                if gmsh.model.isInside(2, given, at, parametric=True):
                    off[given] = float(np.linalg.norm(nearest - place))
        if not off:
            at = ", ".join(f"{x:.4g}" for x in place)
            raise InputError(
                f"{path}: joining its solids made a face at ({at}) that none of them had: join "
                "them in the program that made them"
            )
        numbers[tag] = known[min(off, key=off.__getitem__)]
    gmsh.model.setCurrent(joined)
    return numbers
