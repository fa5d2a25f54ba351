"""A line field on a flat layer, and curves of equal distance along it.

The field has a direction without a sign. Its stripe pattern is a complex number at every point,
whose phase grows by a turn over the pitch across the field: F. Knoeppel, K. Crane, U. Pinkall, P.
Schroeder, Stripe patterns on surfaces, ACM Transactions on Graphics 34 (2015) 39. Where the field
converges or spreads, curves end or begin.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, repeated
from ccfem.base.tensor import largest_in_plane
from ccfem.geometry.facets import signed_areas
from ccfem.geometry.isocontours import chained, triangle_edges
from ccfem.paths.fields.layer_elements import dissected

_COTANGENT = (0.05, 5.0)
"""Least and largest cotangent of an angle: triangles of level cuts may be slivers."""
_SURE = 3.0
"""Largest weight of the tension at a point, in its mean over the layer."""
_ROUNDING = 1e-9
"""Relative difference of lengths below which rounding must not decide."""
_POWERS = 8
"""Inverse iterations for the pattern."""
_PULL = 0.2
"""How much the border counts in each iteration, over the pattern before."""
_SHIFT = 1e-6
"""Added to the diagonal of the pattern's energy, over its mean: that of a parallel field is 0."""


def refined(
    points: FloatArray, triangles: IntArray, values: FloatArray, longest: float
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Halve the edges of triangles until none is longer than a length.

    Parameters
    ----------
    points : (n, 2) array, mm
    triangles : (t, 3) int array
    values : (n, c) array
        At the points; linear along edges.
    longest : float, mm

    Returns
    -------
    points, triangles, values
        The given points come first.
    """
    while True:
        edges, opposite = triangle_edges(triangles)
        a, b = edges.T
        length = np.linalg.norm(points[a] - points[b], axis=1)
        halved = length > longest * (1.0 + _ROUNDING)
        if not halved.any():
            return points, triangles, values
        middle = np.where(halved, len(points) + np.cumsum(halved) - 1, -1)
        a, b = a[halved], b[halved]
        points = np.concatenate([points, 0.5 * (points[a] + points[b])])
        values = np.concatenate([values, 0.5 * (values[a] + values[b])])
        triangles = _split(points, triangles, middle[opposite])


def _split(points: FloatArray, triangles: IntArray, middle: IntArray) -> IntArray:
    """Split triangles (t, 3) at middles (t, 3) of the sides opposite to corners, -1 for none."""
    count = (middle >= 0).sum(axis=1)
    # Turned so that the only halved side, or the only whole one, is opposite to the first corner.
    first = np.where(count == 1, np.argmax(middle >= 0, axis=1), np.argmax(middle < 0, axis=1))
    turn = (first[:, None] + np.arange(3)) % 3
    corner = np.take_along_axis(triangles, turn, axis=1)
    half = np.take_along_axis(middle, turn, axis=1)
    parts = [triangles[count == 0]]
    (a, b, c), p = corner[count == 1].T, half[count == 1, 0]
    parts += [np.column_stack([a, b, p]), np.column_stack([a, p, c])]
    (a, b, c), (p, q, r) = corner[count == 3].T, half[count == 3].T
    parts += [np.column_stack(three) for three in ((a, r, q), (r, b, p), (q, p, c), (p, q, r))]
    # Of the quadrilateral that two halved sides leave, the shorter diagonal.
    (a, b, c), (_, q, r) = corner[count == 2].T, half[count == 2].T
    to_c = np.linalg.norm(points[r] - points[c], axis=1)
    to_b = np.linalg.norm(points[q] - points[b], axis=1)
    from_r = to_c <= to_b * (1.0 + _ROUNDING)
    parts += [
        np.column_stack([a, r, q]),
        np.column_stack([r, b, np.where(from_r, c, q)]),
        np.column_stack([np.where(from_r, r, b), c, q]),
    ]
    return np.concatenate(parts)


@dataclass(frozen=True)
class Cells:
    """Triangles of a layer in its plane, with the operators that field and pattern need."""

    points: FloatArray  # (n, 2), mm
    triangles: IntArray  # (t, 3): counter-clockwise, or without area

    def __post_init__(self) -> None:
        freeze(self, points=float, triangles=int)

    @cached_property
    def _edges(self) -> tuple[IntArray, IntArray]:
        return triangle_edges(self.triangles)

    @property
    def edges(self) -> IntArray:
        """Ends (e, 2) of each edge, the smaller number first."""
        return self._edges[0]

    @property
    def opposite(self) -> IntArray:
        """Edge (t, 3) opposite to each corner."""
        return self._edges[1]

    @cached_property
    def areas(self) -> FloatArray:
        """A third of the area of the triangles round each point, (n,), mm^2."""
        third = np.repeat(np.abs(signed_areas(self.points, self.triangles)) / 3.0, 3)
        total = np.bincount(self.triangles.ravel(), third, len(self.points))
        return total.astype(np.float64)

    @cached_property
    def weights(self) -> FloatArray:
        """Half the cotangents of the angles opposite to each edge, (e,)."""
        corner = self.points[self.triangles]
        u, v = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
        across = np.abs(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
        cotangent = (u * v).sum(axis=2) / np.maximum(across, 1e-300)
        cotangent = 0.5 * np.clip(cotangent, *_COTANGENT)
        total = np.bincount(self.opposite.ravel(), cotangent.ravel(), len(self.edges))
        return total.astype(np.float64)

    @cached_property
    def border(self) -> BoolArray:
        """Mask (e,) of the edges of a single triangle."""
        return np.bincount(self.opposite.ravel(), minlength=len(self.edges)) == 1


def line_field(
    cells: Cells, stress: FloatArray, rim: BoolArray, smooth: float, along_rim: float
) -> FloatArray:
    """Directions along the largest tension where it is decisive, smooth elsewhere.

    Minimises ``smooth^2 sum w |z_j - z_i|^2 + sum a W |z - t|^2 + along_rim sum l |z - b|^2`` of
    ``z = exp(2 i angle)`` over edges, points and edges of the border, where t is that of the
    largest stress S1 and b of the border. W is the share of the stress that has a direction,
    ``(S1 - S2) / (|S1| + |S2|)``, times S1 over its mean, up to 3.

    Parameters
    ----------
    stress : (n, 3) array, MPa
        At the points, in the plane.
    rim : (e,) bool array
        Edges of the border along which strands shall lie.
    smooth, along_rim : float, mm

    Returns
    -------
    (n,) array, radians
        Angle of the direction, in (-pi/2, pi/2]. Where nothing decides, even along the border, it
        is any.
    """
    largest, smallest, angle = largest_in_plane(stress)
    tension = np.maximum(largest, 0.0)
    mean = float(cells.areas @ tension) / max(float(cells.areas.sum()), 1e-300)
    sure = (largest - smallest) / np.maximum(np.abs(largest) + np.abs(smallest), 1e-300)
    weight = cells.areas * np.minimum(sure, 1.0)
    weight = weight * np.minimum(tension / max(mean, 1e-300), _SURE)
    ends = cells.edges[rim]
    step = cells.points[ends[:, 1]] - cells.points[ends[:, 0]]
    along = (step[:, 0] + 1j * step[:, 1]) ** 2
    length = np.sqrt(np.abs(along))
    along = along / np.maximum(length, 1e-300)  # the length times exp(2 i angle)
    count = len(cells.points)
    held, wanted = weight, weight * np.exp(2j * angle)
    for end in ends.T:
        share = 0.5 * along_rim
        held = held + share * np.bincount(end, length, count)
        wanted = wanted + share * (
            np.bincount(end, along.real, count) + 1j * np.bincount(end, along.imag, count)
        )
    a, b = cells.edges.T
    w = smooth**2 * cells.weights
    full = held + np.bincount(a, w, count) + np.bincount(b, w, count)
    full = full + _SHIFT * float(full.mean())
    rows, columns = (
        np.concatenate([a, b, np.arange(count)]),
        np.concatenate([b, a, np.arange(count)]),
    )
    matrix = sp.coo_array((np.concatenate([-w, -w, full]), (rows, columns)), (count, count))
    z = dissected(matrix, cells.points)(np.column_stack([wanted.real, wanted.imag]))
    return np.asarray(0.5 * np.arctan2(z[:, 1], z[:, 0]))


@dataclass(frozen=True)
class Pattern:
    """Phases of a stripe pattern, by the edges along which they grow."""

    cells: Cells
    phase: FloatArray  # (n,), radians: at the points, each seen with the sign of its own direction
    # (e,), radians: of the phase along each edge, seen with the sign at its first end
    growth: FloatArray
    same: FloatArray  # (e,): 1 where the directions at both ends have the same sign, otherwise -1


def stripe_pattern(
    cells: Cells, angle: FloatArray, pitch: float, seed: int = 0, rim: BoolArray | None = None
) -> Pattern:
    """Find a pattern whose phase grows by a turn over the pitch across the directions.

    Minimises ``sum w |conj^s psi_j - exp(i omega) psi_i|^2`` over the edges, with the growth omega
    that the directions at both ends ask for: inverse iterations from random real numbers, which
    have the same sense whatever the signs of the directions.

    Parameters
    ----------
    angle : (n,) array, radians
        Of the direction at each point.
    pitch : float, mm
    seed : int, default 0
        Of the random numbers: others give branches at other places.
    rim : (e,) bool array, optional
        Edges of the border that draw the pattern so that they lie half way between two curves, as
        far as directions are along them.
    """
    a, b = cells.edges.T
    across = np.column_stack([-np.sin(angle), np.cos(angle)])
    same = np.where(np.cos(angle[b] - angle[a]) >= 0.0, 1.0, -1.0)
    step = cells.points[b] - cells.points[a]
    turned = np.einsum("ed,ed->e", step, across[a] + same[:, None] * across[b])
    omega = np.pi / pitch * turned
    count = len(cells.points)
    w = cells.weights
    full = np.asarray(np.bincount(a, w, count) + np.bincount(b, w, count), dtype=np.float64)
    solve = _factor(cells, omega, same, full + _SHIFT * float(full.mean()))
    x, at_rim = np.zeros((count, 2)), np.zeros((count, 2))
    x[:, 0] = np.random.default_rng(seed).standard_normal(count)
    if rim is not None:
        at_rim[:, 0] = _half_way(cells, angle, rim)
        at_rim *= _PULL / max(float(np.linalg.norm(at_rim)), 1e-300)
    for _ in range(_POWERS):
        x = cells.areas[:, None] * x
        x = solve(x / np.linalg.norm(x) + at_rim)
    psi = x[:, 0] + 1j * x[:, 1]
    other = np.where(same > 0.0, psi[b], np.conj(psi[b]))
    growth = omega + np.angle(other * np.conj(np.exp(1j * omega) * psi[a]))
    return Pattern(cells, np.angle(psi), growth, same)


def _half_way(cells: Cells, angle: FloatArray, rim: BoolArray) -> FloatArray:
    """Minus the length, (n,), of the rim at each point where the direction is along it.

    Numbers of phase pi, which the signs of directions leave alone: half way between two curves.
    """
    ends = cells.edges[rim]
    step = cells.points[ends[:, 1]] - cells.points[ends[:, 0]]
    turned = angle[ends] - np.arctan2(step[:, 1], step[:, 0])[:, None]
    share = np.hypot(*step.T)[:, None] * np.maximum(np.cos(2.0 * turned), 0.0) ** 2
    return -np.bincount(ends.ravel(), share.ravel(), len(cells.points)).astype(np.float64)


def _factor(cells: Cells, omega: FloatArray, same: FloatArray, diagonal: FloatArray) -> Any:
    """Factorise the energy of patterns in real numbers; what is returned solves for (n, 2)."""
    a, b = cells.edges.T
    w, cosine, sine = cells.weights, np.cos(omega), np.sin(omega)
    rows = np.concatenate([2 * b, 2 * b, 2 * b + 1, 2 * b + 1])
    columns = np.concatenate([2 * a, 2 * a + 1, 2 * a, 2 * a + 1])
    values = np.concatenate([-w * cosine, w * sine, -w * same * sine, -w * same * cosine])
    size = 2 * len(diagonal)
    lower = sp.coo_array((values, (rows, columns)), (size, size)).tocsc()
    matrix = lower + lower.T + sp.diags_array(np.repeat(diagonal, 2))
    solve = dissected(matrix, cells.points)
    return lambda rhs: solve(rhs.ravel()).reshape(-1, 2)


def isocurves(pattern: Pattern) -> list[FloatArray]:
    """Curves (k, 2) at phase 0, which the signs of the directions leave alone.

    They end on the border and in triangles round which the phase, or the direction, makes a turn.
    """
    cells, turn = pattern.cells, 2.0 * np.pi
    growth, same = pattern.growth, pattern.same
    begin = pattern.phase[cells.edges[:, 0]] / turn
    end = begin + growth / turn
    # Levels at a point would cross none or all of its edges.
    low = np.ceil(np.minimum(begin, end)).astype(np.int64)
    high = np.floor(np.maximum(begin, end)).astype(np.int64)
    number = np.maximum(high - low + 1, 0)
    start = np.concatenate([[0], np.cumsum(number)])
    # Phases at the corners of each triangle, seen from its first corner.
    a, b, _ = cells.triangles.T
    over_bc, over_ca, over_ab = cells.opposite.T

    def along(first: IntArray, edge: IntArray) -> FloatArray:
        """Growth of the phase along an edge from one of its ends, with the sign there."""
        forth = cells.edges[edge, 0] == first
        return np.where(forth, growth[edge], -same[edge] * growth[edge])

    at_a = pattern.phase[a]
    at_b, at_c = at_a + along(a, over_ab), at_a + along(a, over_ca)
    round_trip = at_b + same[over_ab] * along(b, over_bc) - at_c
    plain = same[over_ab] * same[over_bc] * same[over_ca] > 0.0
    plain &= np.abs(round_trip) < 0.5 * turn
    # Crossings of edges, by triangle and by the level that they have from there.
    t = np.flatnonzero(plain)
    sides = np.column_stack([over_bc, over_ca, over_ab])[t]
    first = cells.edges[sides, 0]
    seen = np.where(first == b[t, None], at_b[t, None], at_c[t, None])
    seen = np.where(first == a[t, None], at_a[t, None], seen)
    sign = np.where(first == b[t, None], same[over_ab][t, None], same[over_ca][t, None])
    sign = np.where(first == a[t, None], 1.0, sign).astype(np.int64)
    shift = np.round(seen / turn - sign * begin[sides]).astype(np.int64)
    owner, nth = repeated(number[sides].ravel())
    level = (sign * low[sides] + shift).ravel()[owner] + sign.ravel()[owner] * nth
    crossing = start[sides].ravel()[owner] + nth
    order = np.lexsort((level, owner // 3))
    pairs = crossing[order].reshape(-1, 2)
    link = _neighbours(pairs, int(start[-1]))
    line, offsets = chained(link)
    edge, nth = repeated(number)
    share = (low[edge] + nth - begin[edge]) / np.where(number > 0, end - begin, 1.0)[edge]
    p, q = cells.points[cells.edges[edge, 0]], cells.points[cells.edges[edge, 1]]
    places = p + share[:, None] * (q - p)
    return np.split(places[line], offsets[1:-1]) if len(offsets) > 1 else []


def _neighbours(pairs: IntArray, count: int) -> IntArray:
    """Neighbours (count, 2) of things that are joined in pairs, at most two each, -1 for none."""
    ends, others = pairs.ravel(), pairs[:, ::-1].ravel()
    order = np.argsort(ends, kind="stable")
    ends, others = ends[order], others[order]
    second = np.append(False, ends[1:] == ends[:-1])
    link = np.full((count, 2), -1)
    link[ends, second.astype(np.int64)] = others
    return link
