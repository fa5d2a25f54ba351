"""Sections without room for a path of the minimum length, unless it turns."""

from collections.abc import Sequence

import numpy as np
import shapely

from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import Layer

_WORTH_A_WORD = 0.1


def short_share(layers: Sequence[Layer], machine: Machine) -> float:
    """Share of the sections in pieces that are shorter than the minimum path length.

    The pieces are the region that the middle of a strand can reach inside the section. Their length
    is the longer side of their smallest bounding rectangle. Curved layers do not count.
    """
    half, whole, short = 0.5 * machine.fibre_width, 0.0, 0.0
    for layer in layers:
        if layer.flat is None:
            continue
        section = layer.plane.polygon
        whole += section.area
        for piece in shapely.get_parts(shapely.buffer(section, -half)):
            if _extent(piece) < machine.shortest_strand:
                short += shapely.intersection(section, shapely.buffer(piece, half)).area
    return short / whole if whole else 0.0


def about_short_pieces(layers: Sequence[Layer], machine: Machine) -> str:
    """Words, starting with a semicolon, on a part that is short of room; empty if it is not."""
    share = short_share(layers, machine)
    if share < _WORTH_A_WORD:
        return ""
    return (
        f"; {share:.0%} of the section lies in pieces less than {machine.shortest_strand:.0f} mm "
        "across, the least length of a path"
    )


def _extent(piece: shapely.Polygon) -> float:
    """Longer side of the smallest bounding rectangle of a piece, mm."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(piece))
    return float(np.linalg.norm(np.diff(corners, axis=0), axis=1).max(initial=0.0))
