"""Stress vector tracing: members of parallel strands that cross in the joints, as a single path.

T. Wang, N. Li, G. Link, J. Jelonnek, J. Fleischer, J. Dittus, D. Kupzik, Load-dependent path
planning method for 3D printing of continuous fiber reinforced plastics, Composites Part A 140
(2021) 106181. The tracks and the links are our reconstruction: the paper shows them but gives no
rule.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Any, ClassVar, Literal

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.checks import check_fields
from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.geometry.offsets import join_rings, offset_rings, rings
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.paths.linking.single_path import link_tracks
from ccfem.paths.planning.infill import SPACING, Turns, check_fill, long_enough, with_turns
from ccfem.paths.planning.strategy import Amount, LayerPlanner
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress, stress_on
from ccfem.strategies.stress_tracing.alike import alike
from ccfem.strategies.stress_tracing.band import band
from ccfem.strategies.stress_tracing.blobs import blobs
from ccfem.strategies.stress_tracing.criterion import Criterion
from ccfem.strategies.stress_tracing.frame import frame
from ccfem.strategies.stress_tracing.main_paths import main_paths
from ccfem.strategies.stress_tracing.stems import with_shared_stems
from ccfem.strategies.stress_tracing.symmetric import made_symmetric
from ccfem.strategies.stress_tracing.tails import tail_turns
from ccfem.strategies.stress_tracing.tracks import tracks
from ccfem.strategies.stress_tracing.walk import walk

_SAMPLING = 0.5
"""Distance between the border samples for the medial axis, in fibre widths."""
_LEAST = 20.0
"""Length of the shortest spiral in an open place, in fibre widths."""

_Marked = tuple[FloatArray, BoolArray]
"""Points (n, 2) of a path, mm, and the mask (n,) of its links."""


@dataclass(frozen=True)
class Svt:
    """Parallel strands along the main load paths of a frame, joined to one path.

    The members are those of the section's medial axis. In every joint, members are joined in pairs
    to main load paths; the best pairs have little turn, little misalignment with the stress and the
    same sense of stress. Parallel strands fill the width of each main path; where it narrows they
    leave through its border. In the joints they cross the strands of other main paths, turning by
    up to 60 degrees to cross more steeply, and leave the section. Two main paths share a member
    that leads to a clamp or a load, or that forks into both. Links outside the section join the
    strands to one path for each piece of the section. A section without members (a disc, a square)
    is filled with concentric rings.

    The strategy is meant for frames of slim members. If members are wide, joints take up most of
    the section: strands fan out or overlap there, and the path is cut where a link would run
    through the section for too long.

    Attributes
    ----------
    mode : "graph" or "points", default "graph"
        "graph" joins members at the joints. "points" traces load paths over the points of the
        medial axis, as in the paper, and lays these as single strands; the parameters below are
        then ignored up to `minimum_length`. It skips joints and leaves points over, so it fills no
        section.
    spacing : float, default 1
        Distance between neighbouring strands in fibre widths, at least 1. Strands may lie
        as near as nine tenths of it where the width of a main path is no multiple of it.
    links : "outside" or "none", default "outside"
        Join all strands of a piece of the section to one path, or lay single strands.
    longest_inside : float, mm, default 6
        Links with more than this length inside the section are left out: the path is cut there.
    longest_over_void : float, mm, optional
        The same for links over holes, where nothing holds the fibre. By default these stay: strands
        leave members and turn in windows as they do outside the part.
    crossings : bool, default True
        Whether strands that end in a joint cross it and leave the section on the far side, as in
        the paper. Otherwise they stop in the middle of the joint.
    aligned : bool, default True
        Whether strands turn towards the stress in joints and near free ends. Otherwise they follow
        the medial axis there, and a smooth curve across the joint.
    filled : bool, default True
        Whether spirals fill the wide places that the main paths leave open.
    turn : float, default 75
        Largest turn, degrees, of a main path in a joint.
    width_ratio : float, default 2
        Largest ratio of the widest to the narrowest member of a main path.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`.
    """

    mode: Literal["graph", "points"] = "graph"
    spacing: float = 1.0
    links: Literal["outside", "none"] = "outside"
    longest_inside: float = 6.0
    longest_over_void: float | None = None
    crossings: bool = True
    aligned: bool = True
    filled: bool = True
    turn: float = 75.0
    width_ratio: float = 2.0
    minimum_length: float | None = None
    turns: Turns = "tight"

    amount: ClassVar[Amount] = SPACING
    flat_layers_only: ClassVar[bool] = True
    crosses: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "points": {"mode": "points"},
        "plain": {"links": "none", "crossings": False, "aligned": False, "filled": False},
        "cut": {"longest_inside": 0.0, "longest_over_void": 0.0},
        "cut_turns": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        check_fill(self)
        check_fields(self, "longest_inside", "longest_over_void", at_least=0.0, unit="mm")
        check_fields(self, "turn", above=0.0, below=180.0, unit="degrees")
        check_fields(self, "width_ratio", at_least=1.0)

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan one layer: one path for each piece of its section, or as few as possible."""
        return self._on(layer, self._lines(layer, stress, machine), machine)

    def for_part(
        self, stress: PartStress, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Plan layers of the same section and the same stress directions only once."""
        return _Alike(self, stress, alike(layers, stress))

    def _on(self, layer: Layer, lines: list[_Marked], machine: Machine) -> Toolpaths:
        """Paths on a layer, without the short ones."""
        points, marks = [each for each, _ in lines], [mask for _, mask in lines]
        cut = with_turns(self, points, machine, marks)
        paths = Toolpaths.from_plane(cut.lines, layer, link=cut.link)
        return long_enough(paths, self.minimum_length, machine)

    def _lines(self, layer: Layer, stress: LayerStress, machine: Machine) -> list[_Marked]:
        """Paths in the plane of a layer, with the masks of their links."""
        pieces = shapely.get_parts(layer.plane.polygon)
        return [each for piece in pieces for each in self._piece(piece, stress, machine)]

    def groups(
        self, piece: Region, stress: LayerStress, machine: Machine
    ) -> list[list[FloatArray]]:
        """Strands (n_i, 2), mm, of each main path of one piece of the section, not yet joined."""
        members = frame(piece, _SAMPLING * machine.fibre_width)
        criterion = Criterion(turn=self.turn)
        found = []
        pitch = self.spacing * machine.fibre_width
        paths = main_paths(members, stress, criterion, self.width_ratio)
        if self.crossings:
            paths = with_shared_stems(paths, members)
        turns = [(0.0, 0.0)] * len(paths)
        if self.crossings:
            turns = tail_turns(paths, members, pitch, piece)
        for path, turn in zip(paths, turns, strict=True):
            strip = band(path, members, self.crossings, turn)
            follow = stress if self.aligned else None
            found.append(tracks(strip, pitch, piece, machine.minimum_radius, follow))
        found = made_symmetric(found, piece, machine.fibre_width)
        laid = [line for group in found for line in group]
        if laid and self.filled:
            width, least = (
                machine.fibre_width,
                max(self._least(machine), _LEAST * machine.fibre_width),
            )
            found += blobs(piece, laid, width, pitch, least)
        return found

    def _least(self, machine: Machine) -> float:
        """Length of the shortest path that is laid, mm."""
        return machine.minimum_length if self.minimum_length is None else self.minimum_length

    def _piece(self, piece: Region, stress: LayerStress, machine: Machine) -> list[_Marked]:
        """Paths of one piece of the section, with the mask of their links."""
        if self.mode == "points":
            return _unlinked(walk(piece, stress, _SAMPLING * machine.fibre_width))
        groups = self.groups(piece, stress, machine)
        if not any(groups):
            return _unlinked(self._rings(piece, machine))
        if self.links == "none":
            return _unlinked([line for group in groups for line in group])
        width = self.spacing * machine.fibre_width
        over_void = np.inf if self.longest_over_void is None else self.longest_over_void
        longest = self.longest_inside, over_void
        path = link_tracks(groups, piece, machine.minimum_radius, width, *longest)
        parts = path.without_long_links(piece, *longest)
        return [(part.points, part.link) for part in parts]

    def _rings(self, piece: Region, machine: Machine) -> list[FloatArray]:
        """Concentric rings of a piece that has no members, joined by ramps."""
        width = machine.fibre_width
        levels = offset_rings(piece, 0.5 * width, self.spacing * width, width)
        start = rings(piece)[0][:2].mean(axis=0)
        return join_rings(levels, start, self.spacing * width, width) if levels else []


class _Alike:
    """Planner of a part that plans identical layers only once."""

    def __init__(self, svt: Svt, stress: PartStress, twins: Mapping[int, Layer]) -> None:
        self._svt, self._stress, self._twins = svt, stress, twins
        self._locks = {twin.index: Lock() for twin in twins.values()}
        self._known: dict[tuple[int, Machine], list[_Marked]] = {}

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan one layer, or take the plan of its twin."""
        twin = self._twins.get(layer.index, layer)
        key = (twin.index, machine)
        with self._locks.setdefault(twin.index, Lock()):
            if key not in self._known:
                own = stress if twin is layer else stress_on(twin, self._stress)
                self._known[key] = self._svt._lines(twin, own, machine)
        return self._svt._on(layer, self._known[key], machine)


def _unlinked(lines: list[FloatArray]) -> list[_Marked]:
    return [(line, np.zeros(len(line), dtype=bool)) for line in lines]
