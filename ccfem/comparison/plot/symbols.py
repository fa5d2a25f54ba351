"""What is drawn of a part before it is meshed: where symbols stand, and faces as few triangles."""

from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.smooth_faces import Face
from ccfem.slicing.layers.layer import plane_frame

_BELOW = np.array([0.0, 0.0, -1.0])
_ROUND, _STEPS = np.radians(270.0), 24
"""Angle of a curved arrow, and its pieces."""


def spread(points: FloatArray, count: int) -> IntArray:
    """Up to `count` rows of some points (k, 3), each the farthest from those before it."""
    chosen: list[int] = []
    away = np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(np.argmax(np.round(away, 6))))
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen, dtype=np.int64)


def pressing(corners: FloatArray, count: int, length: float) -> FloatArray:
    """Up to some arrows (m, 2, 3), mm, of a length, onto places all over triangles (k, 3, 3).

    They stand on points, triangles without an area, from below.
    """
    a, b, c = np.moveaxis(corners, 1, 0)
    rows = spread(corners.mean(axis=1), count)
    normals = np.cross(b - a, c - a)[rows]
    sizes = np.linalg.norm(normals, axis=1)[:, None]
    outward = np.where(sizes > 0.0, normals / np.maximum(sizes, 1e-300), _BELOW)
    middles = corners[rows].mean(axis=1)
    return np.stack([middles + length * outward, middles], axis=1)


def arrow_outside(
    place: FloatArray, force: FloatArray, length: float, body: FloatArray
) -> tuple[FloatArray, bool]:
    """Tail and tip (2, 3), mm, of the arrow of a force at a place of a part.

    It lies outside of the part on the side that is nearer along the force. Also returns whether its
    tail is the free end: where the force presses on the part there.

    Parameters
    ----------
    place : (3,) array, mm
    force : (3,) array
    length : float, mm
        Of the arrow.
    body : (t, 3, 3) array, mm
        Corners of the triangles of the part.
    """
    along = force / max(float(np.linalg.norm(force)), 1e-300)
    ahead, behind = (_way_out(place, way, body) for way in (along, -along))
    presses = behind < ahead - 1e-6 * length
    free, way = (-along, behind) if presses else (along, ahead)
    ends = np.stack([place + way * free, place + (way + length) * free])
    return (ends[::-1] if presses else ends), presses


def turning(ends: FloatArray, radius: float) -> FloatArray:
    """Pieces (k, 2, 3), mm, of an arrow that turns about the middle of a line; its head the last.

    It turns by the right hand about the direction from the first end (3,) to the second.
    """
    right, up, _ = plane_frame((ends[1] - ends[0]).tolist())
    angle = np.linspace(0.0, _ROUND, _STEPS + 1)[:, None]
    ring = ends.mean(axis=0) + radius * (np.cos(angle) * right + np.sin(angle) * up)
    ahead = ring[-1] + 0.8 * radius * (np.cos(_ROUND) * up - np.sin(_ROUND) * right)
    ring = np.concatenate([ring, ahead[None]])
    return np.stack([ring[:-1], ring[1:]], axis=1)


def heat_waves(place: FloatArray, length: float) -> FloatArray:
    """Pieces (k, 2, 3), mm, of three wavy lines that rise by a length above a place (3,)."""
    share = np.linspace(0.0, 1.0, _STEPS + 1)
    aside = 0.08 * length * np.sin(4.0 * np.pi * share)
    lines = [
        place + np.stack([aside + step * length, 0.0 * share, length * share], axis=1)
        for step in (-0.3, 0.0, 0.3)
    ]
    return np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines])


def _way_out(start: FloatArray, along: FloatArray, body: FloatArray) -> float:
    """Distance, mm, along a unit vector beyond which no triangle (t, 3, 3) is met."""
    a, b, c = np.moveaxis(body, 1, 0)
    across = np.cross(along, c - a)
    scale = np.einsum("ij,ij->i", b - a, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        first = np.einsum("ij,ij->i", start - a, across) / scale
        turned = np.cross(start - a, b - a)
        second = turned @ along / scale
        far = np.einsum("ij,ij->i", c - a, turned) / scale
        met = (first >= 0.0) & (second >= 0.0) & (first + second <= 1.0) & (far > 0.0)
    return float(far[met].max(initial=0.0))


def bed_under(points: FloatArray, up: FloatArray) -> FloatArray:
    """Corners (4, 3) of a piece of the bed that a part stands on, mm."""
    frame = plane_frame(up.tolist())
    low, high = (points @ frame.T).min(axis=0), (points @ frame.T).max(axis=0)
    margin = 0.2 * float(np.max(high - low))
    x, y = np.stack([low - margin, high + margin], axis=1)[:2]
    plane = np.array([[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]])
    return np.asarray(np.insert(plane, 2, low[2], axis=1) @ frame)


def swung(up: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Direction (3,) that another one gets where the shortest turn takes a place to a direction.

    Parameters
    ----------
    up : (3,) array
    start, end : (3,) array, mm
        From the middle about which is turned; not opposite.
    """
    start, end = (v / max(float(np.linalg.norm(v)), 1e-300) for v in (start, end))
    axis, cosine = np.cross(start, end), float(start @ end)
    turned = np.cross(axis, up)
    return np.asarray(up + turned + np.cross(axis, turned) / max(1.0 + cosine, 1e-9))


def box_edges(corners: FloatArray) -> FloatArray:
    """Edges (12, 2, 3) of a box."""
    places = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    pairs = [(a, b) for a in range(8) for b in range(a) if abs(places[a] - places[b]).sum() == 1]
    return np.asarray(corners[places[np.array(pairs)], np.arange(3)])


# Faces of a body and the borders between them.


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
