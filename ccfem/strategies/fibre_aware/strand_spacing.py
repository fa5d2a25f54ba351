"""Strands moved apart until they keep a distance from each other and the border, and a radius.

The smallest smooth slides that remove all violations are found. This is a sparse least-squares
problem, which is solved again for the violations that remain, so that a whole pack of strands gives
way at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
import shapely
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray, freeze, in_brief
from ccfem.base.compiled import compiled
from ccfem.fem.elasticity.direct import skyline_within
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.strand_lines import StrandLines

_REACH = 2.0
"""Distance, in widths, within which points are compared."""

_OWN = 5.0
"""Arc length, in widths, beyond which a strand keeps its distance from itself."""

_STIFF = 300.0
"""Weight of a missing distance against a slide of the same size."""

_STRAIGHT = 1000.0
"""Weight of a bend that is too tight, by the offset of its middle, against a slide of that size."""

_CHORD = 2
"""Number of points from an end of a bend to its middle."""

_SHARPEST = 0.6
"""Turn, radians, above which a bend is a corner, which no slide rounds off."""

_ROUNDS = 5
"""Number of times that violations are searched for."""

_NARROW = 2e9
"""Multiplications up to which a band is eliminated directly, not in minimum-degree order."""

_FACING = 0.35
"""Least cosine of the angle between the normals of strand and border at which points slide off the
border. Ends that run onto the border do not slide."""

_BORDER_STEP = 0.5
"""Longest piece of the border, in widths."""

_NEAREST = 3
"""Nearest pieces of the border that are checked for a point."""

_FAR = 1e6
"""Distance, mm, put between layers in the search for near points."""


@dataclass(frozen=True)
class Spacing:
    """Distances that strands keep.

    Attributes
    ----------
    width : float, mm
        Distance that strands keep from each other.
    inset : (P,) array, mm
        Least depth of each point inside the section; negative outside.
    border : (b, 2, 2) array, mm
        Pieces of the borders of all layers, the section on their left.
    inward : (b, 3, 2) array
        Vectors into the section at the start, along, and at the end of each piece.
    tree : cKDTree
        Of the middles of the pieces, with their layers.
    roughness : csc_array (P, P)
        What slides cost (`StrandLines.roughness`).
    radius : float, mm
        Radius of the tightest bends that are left as they are; 0 leaves all.
    """

    lines: StrandLines
    width: float
    inset: FloatArray
    border: FloatArray
    inward: FloatArray
    tree: cKDTree
    roughness: Any
    radius: float

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, inset=float, border=float, inward=float)

    def for_lines(self, lines: StrandLines, inset: float) -> "Spacing":
        """Return the same for strands that have slid on, all of which come in to an inset, mm."""
        depth = np.full(len(lines.path), inset)
        return replace(self, lines=lines, inset=depth, roughness=lines.roughness)

    def spread(self, slide: FloatArray, rounds: int = _ROUNDS) -> FloatArray:
        """Slides (P,), mm, close to the given ones, after which strands keep their distances."""
        lines, count = self.lines, len(self.lines.path)
        points = lines.points(slide)
        pairs = self._pairs(points)
        _, near = self.tree.query(_lifted(points, lines.layer), k=_NEAREST)
        for _ in range(rounds):
            points = lines.start + slide[:, None] * lines.normals
            column, value = np.empty((len(pairs), 3), dtype=np.int64), np.empty((len(pairs), 3))
            missing = np.empty(len(pairs))
            about = (points, lines.normals, pairs, self.width)
            used = _too_near(*about, column, value, missing)
            column, value, missing = column[:used], value[:used], missing[:used]
            off, wanted = _outside(
                points, near, self.border, self.inward, self.inset, lines.normals
            )
            # What comes in from the border is a row of its own, below those of pairs.
            out = np.flatnonzero(off)
            sizes = np.repeat([3, 1], [len(missing), len(out)])
            starts = np.concatenate([[0], np.cumsum(sizes)])
            entries = np.concatenate([value.ravel(), off[out]])
            columns = np.concatenate([column.ravel(), out])
            apart = sp.csr_array((entries, columns, starts), shape=(len(sizes), count))
            matrix = self.roughness + _STIFF * (apart.T @ apart)
            right = _STIFF * (apart.T @ np.concatenate([missing, wanted[out]]))
            if self.radius:
                column, value, over = _too_bent(points, lines.normals, lines.path, self.radius)
                rows = np.repeat(np.arange(len(over)), 3)
                bent = sp.csr_array((value.ravel(), (rows, column.ravel())), (len(over), count))
                matrix = matrix + _STRAIGHT * (bent.T @ bent)
                right = right + _STRAIGHT * (bent.T @ over)
            slide = slide + _solve(matrix, right)
        return slide

    def _pairs(self, points: FloatArray) -> IntArray:
        """Pairs (n, 2): points, and first points of segments that may come too near to them."""
        lines, width = self.lines, self.width
        tree = cKDTree(_lifted(points, lines.layer))
        pairs = tree.query_pairs(_REACH * width, output_type="ndarray")
        # Along a path, the shorter way round a closed one, points may be close to each other.
        path = lines.path[pairs]
        whole = np.where(lines.toolpaths.closed, lines.toolpaths.lengths, np.inf)[path[:, 0]]
        along = np.abs(np.diff(lines.arc[pairs], axis=1)[:, 0])
        far = np.minimum(along, whole - along) > _OWN * width
        pairs = pairs[(path[:, 0] != path[:, 1]) | far]
        pairs = np.concatenate([pairs, pairs[:, ::-1]])
        goes_on = np.append(lines.path[1:] == lines.path[:-1], False)
        return pairs[goes_on[pairs[:, 1]]]


def spacing(
    lines: StrandLines,
    layers: Sequence[Layer],
    width: float,
    inset: float,
    come_in: bool = False,
    radius: float = 0.0,
) -> Spacing:
    """Distances that strands keep on their layers.

    Parameters
    ----------
    layers : sequence of Layer
        All on which there are strands.
    width : float, mm
        Distance that strands keep from each other.
    inset : float, mm
        Least distance from the border. Points that start nearer come no nearer.
    come_in : bool, default False
        Whether such points have to come in to the full distance.
    radius : float, mm, default 0
        Least radius that bends are corrected to; 0 for none. Corners stay: no small slide rounds
        them off.
    """
    pieces, inward, owner = [], [], []
    for layer in layers:
        section = shapely.orient_polygons(layer.plane.polygon)
        for ring in shapely.get_rings(shapely.get_parts(section)):
            longest = _BORDER_STEP * width
            line = shapely.get_coordinates(shapely.segmentize(ring, longest))
            line = line[np.append(True, (np.diff(line, axis=0) != 0.0).any(axis=1))]
            step = np.diff(line, axis=0)
            left = np.stack([-step[:, 1], step[:, 0]], axis=1)
            left /= np.linalg.norm(left, axis=1)[:, None]
            corner = left + np.roll(left, 1, axis=0)
            pieces.append(np.stack([line[:-1], line[1:]], axis=1))
            inward.append(np.stack([corner, left, np.roll(corner, -1, axis=0)], axis=1))
            owner.append(np.full(len(step), layer.index))
    border, normals = np.concatenate(pieces), np.concatenate(inward)
    tree = cKDTree(_lifted(border.mean(axis=1), np.concatenate(owner)))
    depth = np.full(len(lines.path), inset)
    if not come_in:
        _, near = tree.query(_lifted(lines.start, lines.layer), k=_NEAREST)
        depth = np.minimum(_from_border(lines.start, near, border, normals)[0], inset)
    return Spacing(lines, width, depth, border, normals, tree, lines.roughness, radius)


def _lifted(points: FloatArray, layer: IntArray) -> FloatArray:
    """Points (n, 3) of which those on different layers are far from each other."""
    return np.column_stack([points, _FAR * layer])


def _solve(matrix: Any, right: FloatArray) -> FloatArray:
    """Solve a sparse symmetric positive definite system: a narrow band along packs of strands."""
    band = skyline_within(sp.bsr_array(matrix, blocksize=(1, 1)), _NARROW)
    if band is not None:
        return band(right)
    options = {"SymmetricMode": True}
    factor = splu(
        matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
    )
    return np.asarray(factor.solve(right))


@compiled
def _too_near(
    points: FloatArray,
    normals: FloatArray,
    pairs: IntArray,
    least: float,
    column: IntArray,
    value: FloatArray,
    missing: FloatArray,
) -> int:  # pragma: no cover
    """Write of pairs that are too near: points, how slides part them, what is missing; how many."""
    count = 0
    for k in range(len(pairs)):
        p, q = pairs[k, 0], pairs[k, 1]
        ex, ey = points[q + 1, 0] - points[q, 0], points[q + 1, 1] - points[q, 1]
        rx, ry = points[p, 0] - points[q, 0], points[p, 1] - points[q, 1]
        square = ex * ex + ey * ey
        s = min(max((rx * ex + ry * ey) / square, 0.0), 1.0) if square > 0.0 else 0.0
        gx, gy = rx - s * ex, ry - s * ey
        distance = np.sqrt(gx * gx + gy * gy)
        if distance >= least or distance < 1e-9:
            continue
        gx, gy = gx / distance, gy / distance
        column[count, 0], column[count, 1], column[count, 2] = p, q, q + 1
        value[count, 0] = gx * normals[p, 0] + gy * normals[p, 1]
        value[count, 1] = -(1.0 - s) * (gx * normals[q, 0] + gy * normals[q, 1])
        value[count, 2] = -s * (gx * normals[q + 1, 0] + gy * normals[q + 1, 1])
        missing[count] = least - distance
        count += 1
    return count


def _from_border(
    points: FloatArray, near: IntArray, border: FloatArray, inward: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Signed depth (n,) of points in the section, and unit vectors (n, 2) that lead farther in."""
    # The nearest of the pieces (n, k) near each point.
    pieces = np.concatenate([border[:, 0].T, (border[:, 1] - border[:, 0]).T])
    x, y, ex, ey = pieces.take(near, axis=1)
    rx, ry = points[:, :1] - x, points[:, 1:] - y
    s = np.minimum(np.maximum((rx * ex + ry * ey) / (ex * ex + ey * ey), 0.0), 1.0)
    hx, hy = rx - s * ex, ry - s * ey
    square = hx * hx + hy * hy
    at = np.arange(len(points)) * near.shape[1] + square.argmin(axis=1)
    s, hx, hy, square = (one.take(at) for one in (s, hx, hy, square))
    side = np.where(s == 0.0, 0, np.where(s == 1.0, 2, 1))
    nx, ny = inward.reshape(-1, 2).take(3 * near.take(at) + side, axis=0).T
    distance = np.sqrt(square)
    # Points on the border have no depth, and take the vector of their piece.
    on = distance < 1e-9
    sign = np.where(hx * nx + hy * ny >= 0.0, 1.0, -1.0)
    size = np.where(on, np.maximum(np.sqrt(nx * nx + ny * ny), 1e-9), distance)
    inside = [np.where(on, n, sign * h) / size for n, h in ((nx, hx), (ny, hy))]
    return np.where(on, 0.0, sign * distance), np.column_stack(inside)


def _outside(
    points: FloatArray,
    near: IntArray,
    border: FloatArray,
    inward: FloatArray,
    inset: FloatArray,
    normals: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """How far in a unit slide leads, and how much farther in points should be; 0 if they are in."""
    depth, farther = _from_border(points, near, border, inward)
    across = farther[:, 0] * normals[:, 0] + farther[:, 1] * normals[:, 1]
    out = (depth < inset) & (np.abs(across) > _FACING)
    return np.where(out, across, 0.0), np.where(out, inset - depth, 0.0)


def _too_bent(
    points: FloatArray, normals: FloatArray, path: IntArray, radius: float
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Bends that are too tight: their three points, the effect of slides, and what is missing."""
    begin = np.flatnonzero(path[: -2 * _CHORD] == path[2 * _CHORD :])
    column = begin[:, None] + _CHORD * np.arange(3)
    (ax, cx), (ay, cy) = (np.diff(values[column], axis=1).T for values in points.T)
    into, out = np.sqrt(ax * ax + ay * ay), np.sqrt(cx * cx + cy * cy)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = cx / out - ax / into, cy / out - ay / into
    turn, step = np.sqrt(x * x + y * y), 0.5 * (into + out)
    long = (into >= 1e-9) & (out >= 1e-9)
    bent = np.flatnonzero(long & (turn * radius > step) & (turn <= _SHARPEST))
    column = column[bent]
    x, y, into, out, turn, step = (one[bent] for one in (x, y, into, out, turn, step))
    x, y = step * x / turn, step * y / turn
    along = x[:, None] * normals[column, 0] + y[:, None] * normals[column, 1]
    a, b, c = along.T
    value = np.column_stack([a / into, -b * (1.0 / into + 1.0 / out), c / out])
    return column, value, step * (step / radius - turn)
