"""Faces of a body and the borders between them, as a page draws them, before it is meshed."""

from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.smooth_faces import Face

_MANY = 64
"""Triangles from which on a plane is drawn by its outline."""
_MOST = 10_000
"""Triangles of another face that are drawn: more are neither seen nor quickly clicked."""


@dataclass(frozen=True)
class FaceMesh:
    """A face as it is drawn: points (n, 3), mm, and triangles (t, 3) of them, outward."""

    number: int
    points: FloatArray
    triangles: IntArray


def face_meshes(listing: BodyFaces) -> list[FaceMesh]:
    """Meshes of all faces, each of few triangles: they are clicked and turned without a GPU.

    A plane of many has only those that its outline needs; another face keeps the largest number
    that may stay, and its border as it is.
    """
    meshes = []
    for number, face in zip(listing.numbers, listing.faces, strict=True):
        used, triangles = np.unique(listing.triangles[face.facets], return_inverse=True)
        points, triangles = listing.points[used], triangles.reshape(-1, 3)
        fewer = None
        if face.kind == "plane" and len(triangles) > _MANY:
            fewer = _outlined(points, triangles, face)
        elif len(triangles) > _MOST:
            fewer = _thinned(points, triangles)
        meshes.append(FaceMesh(number, *(fewer or (points, triangles))))
    return meshes


def _outlined(
    points: FloatArray, triangles: IntArray, face: Face
) -> tuple[FloatArray, IntArray] | None:
    """Fewest triangles of a plane; None where they do not cover it."""
    across = np.eye(3)[np.argmin(np.abs(face.direction))]
    first = np.cross(across, face.direction)
    first /= np.linalg.norm(first)
    frame = np.stack([first, np.cross(face.direction, first)])
    plane = points @ frame.T
    outline = shapely.build_area(shapely.multilinestrings(plane[_rim(triangles)]))
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(outline))
    corners = shapely.get_coordinates(shapely.orient_polygons(parts)).reshape(-1, 4, 2)[:, :3]
    if abs(shapely.area(parts).sum() - face.area) > 1e-3 * face.area:
        return None
    unique, rows = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    height = float(np.mean(points @ face.direction))
    return unique @ frame + height * face.direction, rows.reshape(-1, 3)


def _thinned(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Join neighbours (Schroeder et al., Decimation of triangle meshes, 1992)."""
    import pyvista

    surface = pyvista.PolyData.from_regular_faces(points, triangles).decimate_pro(
        1.0 - _MOST / len(triangles), preserve_topology=True, boundary_vertex_deletion=False
    )
    return np.asarray(surface.points, dtype=np.float64), np.asarray(surface.regular_faces)


def _rim(triangles: IntArray) -> IntArray:
    """Edges (k, 2) that one triangle alone has."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(unique[count == 1])


def borders(listing: BodyFaces) -> FloatArray:
    """Borders between faces, (k, 2, 3), mm."""
    rims = [_rim(listing.triangles[face.facets]) for face in listing.faces]
    if not rims:
        return np.zeros((0, 2, 3))
    return np.asarray(listing.points[np.unique(np.concatenate(rims), axis=0)])
