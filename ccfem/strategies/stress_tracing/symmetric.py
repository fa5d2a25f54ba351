"""Tracks of a symmetric section made exactly symmetric, if they nearly are."""

from collections.abc import Sequence

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import along_line, points_along
from ccfem.geometry.shapes import Region
from ccfem.geometry.symmetry import mirror_lines, reflected

_LOST = 0.5
"""Length, mm, by which the ends of a track may lie beyond the border."""


def made_symmetric(
    groups: Sequence[Sequence[FloatArray]], section: Region, near: float
) -> list[list[FloatArray]]:
    """Make tracks mirror images of each other where the section is symmetric.

    The medial axis, the mesh and the stress on it are only approximately symmetric, and tracks
    follow them, so that strands differ visibly. A group whose mirror image is not near another
    group, or itself, is not changed.

    Parameters
    ----------
    groups : sequence of sequences of (n_i, 2) arrays, mm
        Tracks of each main path.
    section : shapely (Multi)Polygon, mm
    near : float, mm
        Largest distance of a track from the mirror image of its partner.
    """
    found = [list(group) for group in groups]
    for mirror in mirror_lines(section):
        images = [[reflected(line, mirror) for line in group] for group in found]
        done: set[int] = set()
        for k, group in enumerate(images):
            for other in range(k, len(found)):
                partners = _partners(group, found[other], near)
                if other in done or k in done or partners is None:
                    continue
                done |= {k, other}
                for image, partner in enumerate(partners):
                    line = found[other][partner]
                    if k == other and partner == image:
                        found[k][image] = _within(_between(line, group[image]), line, section)
                    elif k != other or partner > image:
                        found[other][partner] = _within(_along(group[image], line), line, section)
    return found


def _partners(
    images: Sequence[FloatArray], lines: Sequence[FloatArray], near: float
) -> list[int] | None:
    """Line that each image lies on, each used once; None if some images have no line."""
    if len(images) != len(lines) or not lines:
        return None
    curves = [shapely.LineString(line) for line in lines]
    found: list[int] = []
    for image in images:
        along = along_line(image)
        middle = points_along(image, along, 0.5 * along[-1:])[0]
        apart = shapely.distance(curves, shapely.points(middle))
        for k in np.argsort(apart, kind="stable")[:2].tolist():
            if k not in found and curves[k].hausdorff_distance(shapely.LineString(image)) <= near:
                found.append(k)
                break
        else:
            return None
    return found


def _within(image: FloatArray, line: FloatArray, section: Region) -> FloatArray:
    """Image of a line, if within a nearly symmetric section; otherwise the line.

    Links begin where strands leave the section, so strands must not leave it elsewhere.
    """
    curve = shapely.LineString(image)
    if shapely.covers(section, curve):
        return image
    pieces = shapely.get_parts(shapely.intersection(curve, section))
    pieces = [piece for piece in pieces if piece.geom_type == "LineString"]
    longest = max(pieces, key=lambda piece: piece.length, default=curve)
    if not pieces or curve.length - longest.length > _LOST or shapely.is_closed(curve):
        return line
    return _along(shapely.get_coordinates(longest), line)


def _along(image: FloatArray, line: FloatArray) -> FloatArray:
    """Image walked the way that a line goes."""
    straight = np.linalg.norm(image[0] - line[0]) + np.linalg.norm(image[-1] - line[-1])
    crossed = np.linalg.norm(image[0] - line[-1]) + np.linalg.norm(image[-1] - line[0])
    return image if straight <= crossed else image[::-1]


def _between(line: FloatArray, image: FloatArray) -> FloatArray:
    """Line half way between one and its own mirror image."""
    if np.array_equal(line[0], line[-1]):
        return line
    image = _along(image, line)
    along, other = along_line(line), along_line(image)
    share = along / along[-1]
    both = 0.5 * (share + (1.0 - share)[::-1])
    one, two = (points_along(p, s, s[-1] * both) for p, s in ((line, along), (image, other)))
    return 0.5 * (one + two)
