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

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.errors import InputError
from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.geometry.isocontours import isocontours
from ccfem.geometry.nearest_on_triangles import nearest_on_triangles
from ccfem.machine.machine import Machine
from ccfem.paths.fields.layer_elements import Surface
from ccfem.paths.planning.infill import SPACING, Turns, check_fill, long_enough, with_turns
from ccfem.paths.planning.strategy import Amount, LayerPlanner
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.guidance.joint_lines import joint_lines
from ccfem.slicing.guidance.joints import joints_of
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress
from ccfem.slicing.principal_lines.critical import Keep
from ccfem.slicing.principal_lines.strongest import strongest_stress
from ccfem.strategies.winding_curves.annulus import annulus_field
from ccfem.strategies.winding_curves.bends import limit_bends
from ccfem.strategies.winding_curves.even_levels import evened, steep
from ccfem.strategies.winding_curves.joining_curves import border_tree
from ccfem.strategies.winding_curves.paper_field import PaperWeights, paper_field
from ccfem.strategies.winding_curves.piece import Piece, pieces_with_joints
from ccfem.strategies.winding_curves.spaced import CLOSEST, kept_apart

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
    """The strategy once it has seen the whole part.

    Attributes
    ----------
    strategy : Winding
    names : tuple of str
        Patches of the joints.
    direction : (m, 3) array
        Direction of the strongest stress of each cell.
    weight : (m,) array
    least : int
        Joints that a piece must hold.
    """

    strategy: Winding
    names: tuple[str, ...]
    direction: FloatArray
    weight: FloatArray
    least: int

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        lines: list[FloatArray] = []
        for one in self.fields(layer):
            lines += self.strands(one, machine)
        lines = with_turns(self.strategy, lines, machine).lines
        normals = []
        for k, line in enumerate(lines):
            found = nearest_on_triangles(layer.points, layer.triangles, line)
            corners = layer.point_normals[layer.triangles[found.triangle]]
            normal = np.einsum("qk,qkd->qd", found.weights, corners)
            size = np.linalg.norm(normal, axis=1, keepdims=True)
            normals.append(normal / np.maximum(size, 1e-300))
            lines[k] = found.points
        paths = Toolpaths.in_space(lines, normals, layer)
        return long_enough(paths, self.strategy.minimum_length, machine)

    def fields(self, layer: Layer) -> "list[_Wound]":
        """Fields of the pieces of a layer, stored on the layer for reuse at another spacing."""
        same = replace(self.strategy, spacing=1.0, even=False, minimum_length=None, turns="tight")
        known: tuple[_Planner, list[_Wound]] | None = vars(layer).get(_KNOWN)
        if known is not None:
            last, found = known
            given = (last.strategy, last.names, last.least) == (same, self.names, self.least)
            if given and last.direction is self.direction and last.weight is self.weight:
                return found
        pieces = pieces_with_joints(layer, self.names)
        found = [self.field(piece) for piece in pieces if len(piece.loops) >= self.least]
        vars(layer)[_KNOWN] = (replace(self, strategy=same), found)
        return found

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

    def strands(self, one: "_Wound", machine: Machine) -> list[FloatArray]:
        """Level lines of the field on a piece of a layer, near its surface."""
        s, spacing = self.strategy, self.strategy.spacing * machine.fibre_width
        step = spacing * one.steep
        if s.energy == "annulus":
            step = 1.0 / max(1, round(1.0 / step))
        lines = self.lines(one, 0.5 * step, step, 0.0)
        if not s.even:
            return lines
        between = [
            line for shift in _BETWEEN for line in self.lines(one, shift * step, step, -np.inf)
        ]
        border = border_tree(one.piece.mesh.points, [*one.piece.outer, *one.piece.loops])
        least = machine.minimum_length if s.minimum_length is None else s.minimum_length
        apart = CLOSEST * spacing
        lines = kept_apart(lines, apart, least)
        return lines + kept_apart(between, apart, least, lines, border)

    def lines(self, one: "_Wound", first: float, step: float, least: float) -> list[FloatArray]:
        """Level lines at or above `least`: closed ones, smoothed; open ones only with "paper"."""
        s, mesh = self.strategy, one.piece.mesh
        found = isocontours(mesh.points, mesh.triangles, one.field, first, step)
        open_too = s.energy == "paper"
        most = np.inf if open_too else 1.0 - 1e-9
        lines = []
        for line, level in zip(found.lines(), found.level.tolist(), strict=True):
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
