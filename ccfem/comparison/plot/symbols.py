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


def bed_under(points: FloatArray, up: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rim (4, 2, 3) of a piece of the bed that a part stands on, and a corner (3,) of it, mm."""
    frame = plane_frame(up.tolist())
    low, high = (points @ frame.T).min(axis=0), (points @ frame.T).max(axis=0)
    margin = 0.2 * float(np.max(high - low))
    x, y = np.stack([low - margin, high + margin], axis=1)[:2]
    plane = np.array([[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]])
    corners = np.insert(plane, 2, low[2], axis=1) @ frame
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), corners[0]


def box_edges(corners: FloatArray) -> FloatArray:
    """Edges (12, 2, 3) of a box."""
    places = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    pairs = [(a, b) for a in range(8) for b in range(a) if abs(places[a] - places[b]).sum() == 1]
    return np.asarray(corners[places[np.array(pairs)], np.arange(3)])
