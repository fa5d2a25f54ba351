"""Places of a section without fibre: gaps narrower than a strand, and wider places."""

from typing import NamedTuple

import numpy as np
import shapely

from ccfem.geometry.shapes import bands
from ccfem.judging.evaluation.layer_paths import PlanePaths

_FINE = 0.01
"""Deviation, in fibre widths, to which paths are simplified before their area is taken."""


class OpenPlace(NamedTuple):
    """A place that a disc as wide as a strand fits into: its middle and its area, mm and mm^2."""

    x: float
    y: float
    area: float


class OpenPlaces(NamedTuple):
    """The parts of a section that fibre leaves open.

    Attributes
    ----------
    narrow : float
        Share of the section in gaps that no strand fits into.
    wide : float
        Share of the section in places.
    places : tuple of OpenPlace
        The largest first.
    """

    narrow: float
    wide: float
    places: tuple[OpenPlace, ...]


def open_places(paths: PlanePaths, width: float) -> OpenPlaces:
    """Find what the fibre of a layer leaves open.

    Parameters
    ----------
    width : float, mm
        Fibre width W. Strands cover half of it to both sides, and nothing beyond their ends.
    """
    section, in_part = paths.layer.plane.polygon, paths.in_part
    lines = [
        shapely.LineString(in_part.points[a:b])
        for a, b in zip(in_part.offsets[:-1], in_part.offsets[1:], strict=True)
        if b - a > 1
    ]
    lines = [shapely.simplify(line, _FINE * width) for line in lines]
    covered = shapely.union_all(bands(lines, 0.5 * width, cap_style="flat"))
    rest = shapely.difference(shapely.force_2d(section), covered)
    # Slightly less than half a width, so that a place exactly as wide as a strand counts as wide.
    disc = 0.499 * width
    wide = shapely.intersection(shapely.buffer(shapely.buffer(rest, -disc), disc), rest)
    parts = [part for part in shapely.get_parts(wide) if part.area > 0.0]
    inside = [shapely.get_coordinates(shapely.point_on_surface(part))[0] for part in parts]
    places = [
        OpenPlace(float(x), float(y), float(part.area))
        for (x, y), part in zip(inside, parts, strict=True)
    ]
    share = float(sum(place.area for place in places)) / float(section.area)
    return OpenPlaces(
        float(np.maximum(rest.area / section.area - share, 0.0)),
        share,
        tuple(sorted(places, key=lambda place: -place.area)),
    )
