"""Where the symbols of loads and supports stand: spread over what is held, outside of the part."""

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray


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
