"""Strands that wind round all joints of a layer, flat or curved: Fang et al. 2024, section 2.4.

G. Fang, T. Zhang, Y. Huang, Z. Zhang, K. Masania, C. C. L. Wang, Exceptional mechanical performance
by spatial printing with continuous fiber: Curved slicing, toolpath generation and physical
verification, arXiv:2311.17265. The layer is cut along curves that join its holes. Strands are level
lines of a field between this cut and the outer border. The fixed values on both borders are ours:
with the paper's gradients alone (``energy = "paper"``) the field rises and falls, and its level
lines form islands or end at the border.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.ndimage import gaussian_filter1d

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.compiled import compiled
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.isocontours import isocontours
from ccfem.geometry.polylines import resample
from ccfem.machine.machine import Machine
from ccfem.paths.fields.layer_elements import Surface, positive_definite
from ccfem.paths.planning.infill import SPACING, Turns, check_fill, long_enough, with_turns
from ccfem.paths.planning.strategy import Amount, LayerPlanner
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.guidance.joints import joint_lines, joints_of
from ccfem.slicing.layers.layer import Layer, LayerStress
from ccfem.slicing.principal_lines.critical import Keep, strongest_stress
from ccfem.strategies.winding_curves.joining_curves import border_tree
from ccfem.strategies.winding_curves.piece import Piece, pieces_with_joints
from ccfem.strategies.winding_curves.spaced import CLOSEST, kept_apart

# The field of the paper: Fang et al. 2024, eq. 5 and 6.
#
# The printed equations are incomplete. Here the gradient on triangles with a side on the cut or on
# a hole points away from it, and the field is softly zero there: its level is otherwise undefined.


_EDGES = 3.0
"""Length over which gradients are compatible, in mean edges."""


@dataclass(frozen=True)
class PaperWeights:
    """Weights of eq. 5; the paper does not give them.

    Attributes
    ----------
    stress : float, default 1
        Of level lines along the stress.
    curves : float, default 1
        Of gradients of size 1 away from the cut and the holes.
    compatible : float, default 0.1
        Of equal gradients in neighbouring triangles.
    zero : float, default 1
        Of zero on the cut and the holes, by square mm round their points.
    """

    stress: float = 1.0
    curves: float = 1.0
    compatible: float = 0.1
    zero: float = 1.0

    def __post_init__(self) -> None:
        check_fields(self, "stress", at_least=0.0)
        check_fields(self, "curves", "compatible", "zero", above=0.0)


def paper_field(
    surface: Surface, tension: FloatArray, inner: IntArray, weights: PaperWeights
) -> FloatArray:
    """Solve for the field of the paper on a piece of a layer.

    Minimises ``stress sum_f A w (grad s . t)^2 + curves sum_c A |grad s - d|^2 +
    compatible l^2 sum_e (l_e / h_e) |jump of grad s|^2 + zero sum_v s^2 A_v / l^2`` over all
    triangles f, those c with a side on the curves, inner edges e and points v of the curves; d is
    the unit vector away from the curves, l three mean edges.

    Parameters
    ----------
    surface : Surface
        In space.
    tension : (t, 3, 3) array
        ``w t t^T`` with the direction t of the stress and its weight w.
    inner : (k,) int array
        Points on the holes and on the curves that join them.

    Returns
    -------
    (n,) array
        In mm where its gradient has size 1.
    """
    on = np.zeros(len(surface.points), dtype=bool)
    on[inner] = True
    corners = on[surface.triangles]
    touching = corners.sum(axis=1) == 2
    frames, areas, t = surface.frames, surface.areas, surface.triangles
    # Of a function that is 0 on the curves and 1 at the other corners.
    away = np.einsum("ti,tid->td", np.where(corners, 0.0, 1.0), surface.gradients)
    away = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-300)
    sides = surface.points[t[:, [1, 2, 0]]] - surface.points[t]
    length = _EDGES * float(np.linalg.norm(sides, axis=2).mean())
    metric = weights.stress * np.einsum("tki,tij,tlj->tkl", frames, tension, frames)
    metric = metric + weights.curves * touching[:, None, None] * np.eye(2)
    matrix = surface.energy(areas[:, None, None] * metric).tocsr()
    matrix = matrix + weights.compatible * length**2 * gradient_jumps(surface)
    around = surface.lumped(np.ones(len(t)))
    matrix = matrix + sp.diags_array(np.where(on, weights.zero * around / length**2, 0.0))
    rhs = surface.source((weights.curves * areas * touching)[:, None] * away)
    free = np.flatnonzero(matrix.diagonal() > 0.0)
    field = np.zeros(len(on))
    if len(free):
        rows = sp.csr_array(sp.csr_array(matrix)[free, :])
        field[free] = positive_definite(rows[:, free]).solve(rhs[free])
    return field


# Rescaling of a field so that its level lines are evenly spaced on average.


_BINS = 40


def evened(surface: Surface, field: FloatArray) -> FloatArray:
    """Rescale a field in [0, 1] so that the mean distance between any two levels is the same: (n,).

    The mean distance between two levels is the area between them over the mean length of the levels
    there, which is the integral of the gradient's size over that area (coarea formula). Values
    below 0 are stretched like the lowest ones.

    Parameters
    ----------
    field : (n,) array
    """
    size = np.linalg.norm(surface.gradient(field), axis=1)
    corners = field[surface.triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    edges = np.linspace(0.0, 1.0, _BINS + 1)
    inside = np.minimum(high[:, None], edges[1:]) - np.maximum(low[:, None], edges[:-1])
    share = np.clip(inside, 0.0, None) / np.maximum(high - low, 1e-12)[:, None]
    area = surface.areas @ share
    length = (surface.areas * size) @ share * _BINS
    width = area / np.maximum(length, 1e-9)
    values = np.concatenate([[0.0], np.cumsum(width)]) / width.sum()
    return np.where(field < 0.0, field * values[1] * _BINS, np.interp(field, edges, values))


def steep(surface: Surface, field: FloatArray, share: float) -> float:
    """Size of the gradient, 1/mm, that this share of the level lines' length does not exceed."""
    size = np.linalg.norm(surface.gradient(field), axis=1)
    weight = surface.areas * size * (surface.mean(field) > 0.0)
    order = np.argsort(size, kind="stable")
    below = np.cumsum(weight[order])
    at = min(int(np.searchsorted(below, share * below[-1])), len(size) - 1)
    return float(size[order][at])


_CLIP = 5.0
"""Largest weight of a triangle, in mean weights of its layer."""
_REACH = 4.0
"""Distance along the curves over which the lift of the holes acts, mm."""
_KNOWN = "_wound"
"""Attribute of a layer that stores the fields of its pieces."""
_BETWEEN = (0.0, 0.125, 0.25, 0.375, 0.625, 0.75, 0.875)
"""Levels at which further strands may start, in steps."""
_KEPT = 0.6
"""Share of the strands' length that keeps the spacing asked for."""


@dataclass(frozen=True)
class Winding:
    """Closed strands round all joints of a piece of a layer, along the strongest stress.

    Attributes
    ----------
    joints : tuple of str, default ()
        Patches where bolts sit; by default all that are held or loaded. On a layer, only patches
        that border a hole count.
    spacing : float, default 2.2
        Distance between strands in fibre widths that 60 % of their length keep.
    energy : {"annulus", "paper"}
        What the field minimises: our energy, with given values on both borders; or that of the
        paper (eq. 5 and 6), whose level lines may end at the outer border.
    paper : table
        Weights of the paper's energy: stress, curves, compatible, zero.
    isotropy : float, default 0.003
        Small values make strands follow the stress closely, large ones make their distances even.
    smoothness : float, mm^2, default 0.3
        Penalty on bends of the strands.
    weight : {"lines", "stress", "even"}
        Which cells count most: those crossed by many of the stress lines that join the joints (the
        paper), those of large stress, or all equally.
    lines : {"joining", "touching", "all"}
        Stress lines that count, as in the slicer `spatial`.
    even : bool, default False
        Strands end where they would lie nearer than 0.7 spacings, and more start where there is
        room. More of the length then lies between 0.7 and 1.5 spacings apart, but fewer strands are
        closed.
    cut : bool, default True
        Cut the layer along the curves that join its holes, so that strands wind round all of them.
    repulsion : float, mm^2, default 4
        How strongly these curves are kept away from the outer border.
    lift, rise : float, default 0.1 and 0.4
        How far the field starts below 0. `lift` acts on the holes, so that the innermost strand
        keeps off them; `rise` acts where curves are farther from the border than the holes are, so
        that strands do not spread there.
    sharpest : float, 1/mm, default 0.115
        Largest curvature: strands that bend more sharply are smoothed there.
    joined : int, optional
        Number of joints that a piece must hold to get fibre. By default it is the largest number in
        any piece of the part, which selects the layers that the paper lays fibre on.
    minimum_length : float, mm, optional
        Shorter strands are dropped; by default the shortest that the machine can cut.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`.
    """

    joints: tuple[str, ...] = ()
    spacing: float = 2.2
    energy: Literal["annulus", "paper"] = "annulus"
    paper: PaperWeights = field(default_factory=PaperWeights)
    isotropy: float = 0.003
    smoothness: float = 0.3
    weight: Literal["lines", "stress", "even"] = "lines"
    lines: Keep = "joining"
    even: bool = False
    cut: bool = True
    repulsion: float = 4.0
    lift: float = 0.1
    rise: float = 0.4
    sharpest: float = 0.115
    joined: int | None = None
    minimum_length: float | None = None
    turns: Turns = "tight"

    amount: ClassVar[Amount] = SPACING
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "stress": {"weight": "stress"},
        "even": {"weight": "even", "isotropy": 1.0, "smoothness": 0.0},
        "uncut": {"cut": False},
        "spaced": {"even": True},
        "paper": {"energy": "paper", "weight": "stress"},
        "cut": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        check_fill(self)
        check_choices(self)
        check_fields(self, "isotropy", "sharpest", above=0.0)
        if self.joined is not None:
            check_fields(self, "joined", at_least=1)
        check_fields(self, "smoothness", "repulsion", "lift", "rise", at_least=0.0)

    def for_part(
        self, stress: PartStress, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Find the joints of the layers, and the weight of each cell.

        Raises
        ------
        InputError
            When no layer has a hole at a joint, or no stress line joins the joints.
        """
        names = self.joints or stress.held_or_loaded
        for name in self.joints:
            stress.mesh.patch(name)
        pieces = (piece for layer in layers for piece in pieces_with_joints(layer, names))
        most = max((len(piece.loops) for piece in pieces), default=0)
        if not most:
            raise InputError(
                "winding needs joints, patches around a hole of a layer; none of "
                f"{', '.join(names) or 'no patch'} is one: name others (joints), or choose "
                "another strategy or slicing"
            )
        least = most if self.joined is None else self.joined
        if self.weight == "lines":
            joints = joints_of(stress, names)
            keep = self.lines if len(joints) > 1 or self.lines != "joining" else "touching"
            strongest, region = joint_lines(stress, joints, keep)
            return _Planner(self, tuple(names), strongest.direction, region.weight, least)
        strongest = strongest_stress(stress.stress)
        even = np.ones(len(stress.mesh.cells))
        weight = np.abs(strongest.value) if self.weight == "stress" else even
        return _Planner(self, tuple(names), strongest.direction, weight, least)


class _Wound(NamedTuple):
    """Field on a piece of a layer, and the size of its gradient, 1/mm, that sets the spacing."""

    piece: Piece
    field: FloatArray
    steep: float


@dataclass(frozen=True)
class _Planner:
    """The strategy once it has seen the whole part."""

    strategy: Winding
    names: tuple[str, ...]  # patches of the joints
    direction: FloatArray  # (m, 3): direction of the strongest stress of each cell
    weight: FloatArray  # (m,)
    least: int  # joints that a piece must hold

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        lines: list[FloatArray] = []
        for piece in self.fields(layer):
            lines += self.strands(piece, machine)
        lines = with_turns(self.strategy, lines, machine).lines
        normals = []
        for k, line in enumerate(lines):
            nearest = layer.nearest(line)
            normals.append(layer.normals_at(nearest))
            lines[k] = nearest.points
        paths = Toolpaths.in_space(lines, normals, layer)
        return long_enough(paths, self.strategy.minimum_length, machine)

    def fields(self, layer: Layer) -> "list[_Wound]":
        """Fields of the pieces of a layer, stored on the layer for reuse at another spacing."""
        same = replace(self.strategy, spacing=1.0, even=False, minimum_length=None, turns="tight")
        known: tuple[_Planner, list[_Wound]] | None = vars(layer).get(_KNOWN)
        if known is not None:
            last, wound = known
            given = (last.strategy, last.names, last.least) == (same, self.names, self.least)
            if given and last.direction is self.direction and last.weight is self.weight:
                return wound
        pieces = pieces_with_joints(layer, self.names)
        wound = [self.field(piece) for piece in pieces if len(piece.loops) >= self.least]
        vars(layer)[_KNOWN] = (replace(self, strategy=same), wound)
        return wound

    def field(self, piece: Piece) -> "_Wound":
        """Field of a piece of a layer, cut or not, with its level lines evenly spaced."""
        s = self.strategy
        piece = piece.joined(s.repulsion) if s.cut else piece
        surface = piece.surface
        if s.energy == "paper":
            inner = np.unique(np.concatenate([*piece.loops, *piece.curves]))
            tension = self.tension(piece.layer)[piece.mesh.source]
            field = paper_field(surface, tension, inner, s.paper)
            return _Wound(piece, field, _median_slope(surface, field))
        inner, low = piece.inner_values(s.lift, s.rise, _REACH)
        outer = np.setdiff1d(np.concatenate(piece.outer), inner)
        fixed = np.concatenate([inner, outer])
        values = np.concatenate([low, np.ones(len(outer))])
        tension = self.tension(piece.layer)[piece.mesh.source]
        field = annulus_field(surface, tension, s.isotropy, s.smoothness, fixed, values)
        field = evened(surface, field)
        return _Wound(piece, field, steep(surface, field, _KEPT))

    def strands(self, piece: "_Wound", machine: Machine) -> list[FloatArray]:
        """Level lines of the field on a piece of a layer, near its surface."""
        s, spacing = self.strategy, self.strategy.spacing * machine.fibre_width
        step = spacing * piece.steep
        if s.energy == "annulus":
            step = 1.0 / max(1, round(1.0 / step))
        lines = self.lines(piece, 0.5 * step, step, 0.0)
        if not s.even:
            return lines
        between = [
            line for shift in _BETWEEN for line in self.lines(piece, shift * step, step, -np.inf)
        ]
        border = border_tree(piece.piece.mesh.points, [*piece.piece.outer, *piece.piece.loops])
        least = machine.shortest_strand if s.minimum_length is None else s.minimum_length
        apart = CLOSEST * spacing
        lines = kept_apart(lines, apart, least)
        return lines + kept_apart(between, apart, least, lines, border)

    def lines(self, piece: "_Wound", first: float, step: float, least: float) -> list[FloatArray]:
        """Level lines at or above `least`: closed ones, smoothed; open ones only with "paper"."""
        s, mesh = self.strategy, piece.piece.mesh
        contours = isocontours(mesh.points, mesh.triangles, piece.field, first, step)
        open_too = s.energy == "paper"
        most = np.inf if open_too else 1.0 - 1e-9
        lines = []
        for line, level in zip(contours.lines(), contours.level.tolist(), strict=True):
            closed = np.array_equal(line[0], line[-1])
            if least <= first + level * step <= most and (closed or open_too):
                lines.append(limit_bends(line, s.sharpest) if closed else line)
        return lines

    def tension(self, layer: Layer) -> FloatArray:
        """``w t t^T`` on each triangle, (t, 3, 3), of mean trace 1; t: the stress in its plane."""
        direction, normal = self.direction[layer.cell], layer.normals
        along = direction - np.einsum("td,td->t", direction, normal)[:, None] * normal
        weight = self.weight[layer.cell]
        size = weight * np.einsum("td,td->t", along, along)
        mean = float(np.average(size, weights=layer.areas))
        if not mean > 0.0:
            return np.zeros((len(layer.triangles), 3, 3))
        limited = np.minimum(1.0, _CLIP * mean / np.maximum(size, 1e-300)) / mean
        return np.asarray(np.einsum("t,ti,tj->tij", weight * limited, along, along))


def _median_slope(surface: Surface, field: FloatArray) -> float:
    """Area-weighted median of the size of a field's gradient."""
    size = np.linalg.norm(surface.gradient(field), axis=1)
    order = np.argsort(size, kind="stable")
    below = np.cumsum(surface.areas[order])
    return float(size[order][np.searchsorted(below, 0.5 * below[-1])])


# The field that winds: low on the holes and the curves that join them, 1 on the outer border.


_NEAR = 0.3
"""Least distance between triangles that is used, over the median one."""


def annulus_field(
    surface: Surface,
    tension: FloatArray,
    isotropy: float,
    smoothness: float,
    fixed: IntArray,
    values: FloatArray,
) -> FloatArray:
    """Solve for the field whose level lines run along the tension, round the holes: (n,).

    Minimises ``sum_f A_f [grad s . (T_f + isotropy) grad s] + smoothness J(s)`` with given values
    on the holes, on the curves that join them and on the outer border; J is `gradient_jumps`. No
    level line ends inside, and none closes without going round the low region.

    Parameters
    ----------
    surface : Surface
        In space.
    tension : (t, 3, 3) array
        ``w t t^T`` with the direction t of the tension and its weight w.
    isotropy : float > 0
        Small values follow the tension closely, large ones give even spacing.
    smoothness : float >= 0, mm^2
        Weight of bends of the level lines.
    fixed : (k,) int array
        Points whose values are given.
    values : (k,) array
    """
    frames = surface.frames
    metric = np.einsum("tki,tij,tlj->tkl", frames, tension, frames) + isotropy * np.eye(2)
    matrix = surface.energy(surface.areas[:, None, None] * metric).tocsr()
    if smoothness > 0.0:
        matrix = matrix + smoothness * gradient_jumps(surface)
    field = np.zeros(len(surface.points))
    field[fixed] = values
    free = matrix.diagonal() > 0.0
    free[fixed] = False
    inside = np.flatnonzero(free)
    if len(inside):
        rows = sp.csr_array(matrix[inside])
        field[inside] = positive_definite(rows[:, inside]).solve(-(rows @ field))
    return field


def gradient_jumps(surface: Surface) -> sp.csr_array:
    """Matrix (n, n) of the form ``sum_e l/h (change of ds/dn)^2`` over the inner edges.

    l is the length of an edge and h the distance between the middles of its two triangles. The
    derivative is normal to the edge, with both triangles laid flat.
    """
    triangles, pairs, n = surface.triangles, surface.neighbours, len(surface.points)
    one, other = triangles[pairs[:, 0]], triangles[pairs[:, 1]]
    # The two corners that both triangles have.
    shared = (one[:, :, None] == other[:, None, :]).any(axis=2)
    ends = one[shared].reshape(-1, 2)
    edge = surface.points[ends[:, 1]] - surface.points[ends[:, 0]]
    length = np.linalg.norm(edge, axis=1)
    edge = edge / np.maximum(length, 1e-300)[:, None]
    middle = surface.points[triangles].mean(axis=1)
    apart = np.linalg.norm(middle[pairs[:, 0]] - middle[pairs[:, 1]], axis=1)
    apart = np.maximum(apart, _NEAR * np.median(apart)) if len(apart) else apart
    gradients = np.einsum("tid,tdk->tik", surface.gradients, surface.frames)
    normal = np.cross(surface.frames[:, 0], surface.frames[:, 1])
    weight = np.sqrt(length / apart)[:, None]
    # Slope normal to the edge in the plane of each triangle; the change is their difference.
    sides = [
        weight * np.einsum("fik,fk->fi", gradients[side], np.cross(edge, normal[side]))
        for side in pairs.T
    ]
    row = np.tile(np.repeat(np.arange(len(pairs)), 3), 2)
    column = np.concatenate([one.ravel(), other.ravel()])
    value = np.concatenate([sides[0].ravel(), -sides[1].ravel()])
    jump = sp.coo_array((value, (row, column)), shape=(len(pairs), n)).tocsr()
    return sp.csr_array(jump.T @ jump)


# Smoothing of closed curves, only where they bend too sharply.


_STEP = 0.5
"""Distance between points, mm."""
_ROUNDS = 600
_SLACK, _LEFT = 1.05, 0.01
"""Smoothing stops when at most this share of points bends by more than this times the limit."""
_SPREAD = np.exp(-0.5 * (np.arange(-8, 9) / 2.0) ** 2)
"""Gaussian, a millimetre in standard deviation, over which the movement fades out."""


def limit_bends(curve: FloatArray, largest: float) -> FloatArray:
    """Smooth a closed curve where its curvature is above a limit.

    Points there move against the fourth differences of the curve. This reduces bends and, unlike
    second differences, hardly shortens the curve. A Gaussian filter of half a millimetre in
    standard deviation is applied first, since crossings with triangle edges are unevenly spaced.

    Parameters
    ----------
    curve : (n, 3) array, mm
        Its last point is its first.
    largest : float, 1/mm
        Curvature.

    Returns
    -------
    (m, 3) array
        Closed, in steps of half a millimetre; near the surface, but no longer on it.
    """
    points, _ = resample(curve, np.array([0, len(curve)]), _STEP)
    if len(points) < 12:
        return points
    points = gaussian_filter1d(points[:-1], 0.5 / _STEP, axis=0, mode="wrap")
    points = _straightened(np.ascontiguousarray(points), largest, _SPREAD / _SPREAD.sum(), _ROUNDS)
    return np.vstack([points, points[:1]])


@compiled
def _straightened(
    points: FloatArray, largest: float, spread: FloatArray, rounds: int
) -> FloatArray:  # pragma: no cover
    """Points of a closed curve after a number of rounds, or once its bends are small enough."""
    n, half = len(points), len(spread) // 2
    over, wide, step = np.zeros(n), np.zeros(n + 2 * half), np.zeros((n, 3))
    for _ in range(rounds):
        # Curvature at each point from the chords over two steps, and how far it is over the limit.
        sharp = 0
        for k in range(n):
            before, after, dot = 0.0, 0.0, 0.0
            for i in range(3):
                chord = points[k, i] - points[k - 2, i]
                two = points[(k + 2) % n, i] - points[k, i]
                before += chord * chord
                after += two * two
                dot += chord * two
            before, after = np.sqrt(before), np.sqrt(after)
            square = max((before * after) ** 2 - dot * dot, 0.0)
            bend = np.sqrt(square) / max(before * after, 1e-9) / (0.5 * (before + after))
            over[k] = min(max(bend / largest - 1.0, 0.0), 1.0)
            sharp += bend > _SLACK * largest
        if sharp < _LEFT * n:
            break
        # Neighbours of sharp points move too, the less the farther away: maximum, then a weighted
        # mean.
        for k in range(n):
            wide[half + k] = max(
                over[k - 2], over[k - 1], over[k], over[(k + 1) % n], over[(k + 2) % n]
            )
        for k in range(half):
            wide[k] = wide[n + k]
            wide[half + n + k] = wide[half + k]
        # The bend as a vector: to the middle of both neighbours. Moving by it, less the mean of
        # those of its neighbours, evens bends out without shrinking the curve.
        for k in range(n):
            for i in range(3):
                step[k, i] = 0.5 * (points[k - 1, i] + points[(k + 1) % n, i]) - points[k, i]
        for k in range(n):
            much = 0.0
            for j in range(len(spread)):
                much += spread[j] * wide[k + j]
            over[k] = 0.5 * much
        for i in range(3):
            last, first = step[n - 1, i], step[0, i]
            before = last
            for k in range(n):
                length = step[k, i]
                after = first if k == n - 1 else step[k + 1, i]
                points[k, i] += over[k] * (length - 0.5 * (before + after))
                before = length
    return points
