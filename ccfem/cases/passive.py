"""Places that an optimisation leaves full or empty: round and square areas, and boxes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.errors import InputError

Place = Sequence[float]
"""3 numbers: x, y and radius of a disc; 4: corners of a rectangle; 6: corners of a box; mm."""


def check_places(what: str, places: Sequence[Place]) -> None:
    """Refuse places that are none.

    Raises
    ------
    InputError
    """
    for place in places:
        count = len(place)
        low, high = np.array(place[: count // 2]), np.array(place[-(count // 2) :])
        right = place[2] > 0.0 if count == 3 else count in (4, 6) and bool((low < high).all())
        if not right or not np.isfinite(place).all():
            raise InputError(
                f"a {what} place is X,Y,RADIUS, or the corners X,Y,X,Y of a rectangle or "
                f"X,Y,Z,X,Y,Z of a box, the lower one first, mm; got {list(place)}: give one of "
                "these three"
            )


def area_of(places: Sequence[Place]) -> Any:
    """Area of places seen from above: a shapely geometry, mm."""
    found = []
    for place in places:
        if len(place) == 3:
            found.append(shapely.Point(place[:2]).buffer(place[2], quad_segs=32))
        else:
            half = len(place) // 2
            found.append(shapely.box(*place[:2], *place[half : half + 2]))
    return shapely.union_all(found) if found else shapely.Polygon()


def cells_in(places: Sequence[Place], centres: FloatArray) -> BoolArray:
    """Which of some centres (m, 3), mm, lie in one of the places: an (m,) mask."""
    found = np.zeros(len(centres), dtype=bool)
    for place in places:
        if len(place) == 3:
            found |= np.linalg.norm(centres[:, :2] - np.array(place[:2]), axis=1) <= place[2]
        else:
            half = len(place) // 2
            low, high = np.array(place[:half]), np.array(place[half:])
            found |= ((centres[:, :half] >= low) & (centres[:, :half] <= high)).all(axis=1)
    return found
