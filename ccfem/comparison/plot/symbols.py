"""Where symbols stand: of supports spread over what is held, of loads outside, the bed below."""

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.slicing.layers.layer import plane_frame


def spread(points: FloatArray, count: int) -> IntArray:
    """Up to `count` rows of some points (k, 3), each the farthest from those before it."""
    chosen: list[int] = []
    away = np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(np.argmax(np.round(away, 6))))
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen, dtype=np.int64)


def pressing(corners: FloatArray, count: int, length: float) -> FloatArray:
    """Up to some arrows (m, 2, 3), mm, of a length, onto places all over triangles (k, 3, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    rows = spread(corners.mean(axis=1), count)
    normals = np.cross(b - a, c - a)[rows]
    sizes = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    middles = corners[rows].mean(axis=1)
    return np.stack([middles + length * normals / sizes[:, None], middles], axis=1)


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
