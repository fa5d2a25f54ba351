"""The outline of a design on a raster: contour, smoothing, cleaning."""

from functools import reduce
from typing import Any

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.fem.topopt.design import FALLS_APART
from ccfem.geometry.isocontours import isocontours
from ccfem.geometry.polylines import along_line, points_along

_PASSES = 10
"""Of the smoothing."""
_RINGS = 4
"""Rings of pixels that the density is carried on outside its domain before it falls to zero."""


def _over_nodes(density: FloatArray, inside: BoolArray) -> FloatArray:
    """Density at the nodes (H + 1, W + 1) of an image: mean over the pixels that exist.

    Outside the domain it is carried on for some pixels, so that the contour crosses the border of
    the domain squarely and is rounded outside it only.
    """
    weight = _squares(np.pad(inside.astype(np.float64), 1))
    value = _squares(np.pad(np.where(inside, density, 0.0), 1)) / np.maximum(weight, 1.0)
    known = weight > 0.0
    for _ in range(_RINGS):
        near = np.pad(known, 1).astype(np.float64)
        sums = np.pad(np.where(known, value, 0.0), 1)
        weight, spread = (_around(image) for image in (near, sums))
        value = np.where(known, value, spread / np.maximum(weight, 1.0))
        known = known | (weight > 0.0)
    return np.where(known, value, 0.0)


def _squares(image: FloatArray) -> FloatArray:
    """Sum over the entries of every square of 2 x 2."""
    return image[:-1, :-1] + image[1:, :-1] + image[:-1, 1:] + image[1:, 1:]


def _around(image: FloatArray) -> FloatArray:
    """Sum over the 3 x 3 entries round each inner entry."""
    rows = image[:-2] + image[1:-1] + image[2:]
    return rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]


def _contour(nodes: FloatArray, threshold: float, size: float) -> list[FloatArray]:
    """Find the closed contours (k, 2) of values at nodes; the last row lies at y = 0."""
    height, width = nodes.shape
    x, y = np.meshgrid(np.arange(width), np.arange(height)[::-1])
    corners = np.stack([x, y], axis=-1).reshape(-1, 2).astype(np.float64)
    inner = _squares(nodes)
    middles = np.stack([x[1:, :-1] + 0.5, y[1:, :-1] + 0.5], axis=-1).reshape(-1, 2)
    number = np.arange(height * width).reshape(height, width)
    ring = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    centre = height * width + np.arange(inner.size)
    triangles = [
        np.stack([ring[k].reshape(-1), ring[(k + 1) % 4].reshape(-1), centre], axis=1)
        for k in range(4)
    ]
    values = np.concatenate([nodes.reshape(-1), 0.25 * inner.reshape(-1)])
    # One level only: the next lies far outside the range of densities.
    contours = isocontours(
        size * np.concatenate([corners, middles]), np.concatenate(triangles), values, threshold, 9.0
    )
    return contours.lines()


def _taubin_smoothed(ring: FloatArray, step: float) -> FloatArray:
    """Resample a closed ring and smooth it by Taubin's passes 0.5 and -0.53, which keep its area.

    Taubin, Curve and surface smoothing without shrinkage, ICCV 1995.
    """
    along = along_line(ring)
    count = max(8, round(along[-1] / step))
    points = points_along(ring, along, along[-1] * np.arange(count) / count)
    for _ in range(_PASSES):
        for factor in (0.5, -0.53):
            mean = 0.5 * (np.roll(points, 1, axis=0) + np.roll(points, -1, axis=0))
            points = points + factor * (mean - points)
    return points


def _even_odd_region(rings: list[FloatArray]) -> Any:
    """Even-odd region of closed rings."""
    parts = [shapely.make_valid(shapely.Polygon(ring)) for ring in rings if len(ring) > 3]
    if not parts:
        return shapely.Polygon()
    return reduce(shapely.symmetric_difference, parts)


def _cleaned(region: Any, size: float, domain: Any, least_hole: float) -> Any:
    """Open hairs, round re-entrant corners, close small holes.

    The region still reaches out of the domain, so that corners of the domain stay sharp.
    """
    region = region.buffer(-0.6 * size).buffer(1.6 * size).buffer(-1.0 * size)
    parts = [
        shapely.Polygon(
            part.exterior,
            [hole for hole in part.interiors if shapely.Polygon(hole).area >= least_hole],
        )
        for part in shapely.get_parts(region)
        if part.geom_type == "Polygon"
    ]
    joined = shapely.union_all(parts).simplify(0.02 * size)
    return shapely.MultiPolygon(
        [part for part in shapely.get_parts(joined.intersection(domain)) if part.area > 0.0]
    )


def outline(
    density: FloatArray,
    size: float = 1.0,
    volume_fraction: float | None = None,
    threshold: float | None = None,
    domain: Any = None,
    inside: BoolArray | None = None,
    keep: FloatArray | None = None,
    least_hole: float = 4.0,
    apart: str = FALLS_APART,
) -> Any:
    """Outline of a design on a raster.

    Parameters
    ----------
    density : (H, W) array in [0, 1]
        Row 0 is the top; the lower left corner of the image is the origin.
    size : float, mm
        Side of a pixel.
    volume_fraction : float in (0, 1), optional
        Share of the domain that the outline is to hold before it is cleaned; default that of the
        densities.
    threshold : float in (0, 1), optional
        Density of the contour, in place of the share.
    domain : shapely Polygon, optional
        Exact design domain; default the rectangle of the image, or the pixels of `inside`.
    inside : (H, W) bool array, optional
        Pixels of the domain; default all.
    keep : (k, 2) array, mm, optional
        Points, such as loads and supports, that must be joined; by default the largest piece is
        the part.
    least_hole : float, default 4
        Holes below this many pixels are closed.
    apart : str, optional
        What to say where the points to keep lie on different pieces.

    Returns
    -------
    shapely Polygon, mm
        One piece, holes where the design has them.

    Raises
    ------
    InputError
        For a share or threshold out of its range, when nothing is left, and when the points to
        keep lie on different pieces.
    """
    density = np.asarray(density, dtype=np.float64)
    known = np.ones(density.shape, dtype=bool) if inside is None else np.asarray(inside, dtype=bool)
    if density.ndim != 2 or known.shape != density.shape or not size > 0.0:
        raise InputError(
            f"an outline needs an (H, W) image of densities and a pixel size > 0; got shape "
            f"{density.shape} and size {size}"
        )
    if volume_fraction is not None:
        check_number("volume_fraction", volume_fraction, above=0.0, at_most=1.0)
    if threshold is not None:
        check_number("threshold", threshold, above=0.0, below=1.0)
    if domain is None:
        domain = _domain(known, size)
    nodes = np.pad(_over_nodes(np.pad(density, _RINGS + 1), np.pad(known, _RINGS + 1)), 1)
    shift = size * (_RINGS + 2)

    def region(level: float) -> Any:
        rings = [ring - shift for ring in _contour(nodes, level, size)]
        return _even_odd_region([_taubin_smoothed(ring, 0.5 * size) for ring in rings])

    if threshold is None:
        share = float(density[known].mean()) if volume_fraction is None else volume_fraction
        chosen = _with_area(region, domain, share * domain.area)
    else:
        chosen = region(threshold)
    pieces = shapely.get_parts(_cleaned(chosen, size, domain, least_hole * size**2))
    if not len(pieces):
        raise InputError("the outline is empty: lower the threshold or raise the volume fraction")
    if keep is None:
        return max(pieces, key=lambda piece: piece.area)
    return _piece_at(shapely.points(np.asarray(keep, dtype=np.float64)), pieces, size, apart)


def _piece_at(points: Any, pieces: Any, size: float, apart: str) -> Any:
    """Piece that all of some points lie on, or within a pixel and a half of; else an error."""
    for piece in pieces:
        if (shapely.distance(piece, points) <= 1.5 * size).all():
            return piece
    raise InputError(apart)


def _domain(inside: BoolArray, size: float) -> Any:
    """Union of the pixels of an image."""
    height, width = inside.shape
    if inside.all():
        return shapely.box(0.0, 0.0, width * size, height * size)
    rows, columns = np.nonzero(inside)
    low = height - 1 - rows
    return shapely.union_all(
        shapely.box(columns * size, low * size, (columns + 1) * size, (low + 1) * size)
    )


def _with_area(region: Any, domain: Any, area: float) -> Any:
    """Region with nearly a wanted area in the domain, by bisection on the threshold."""
    low, high = 0.0, 1.0
    chosen = region(0.5)
    for _ in range(14):
        middle = 0.5 * (low + high)
        chosen = region(middle)
        excess = chosen.intersection(domain).area - area
        if abs(excess) <= 1e-3 * area:
            break
        low, high = (middle, high) if excess > 0.0 else (low, middle)
    return chosen
