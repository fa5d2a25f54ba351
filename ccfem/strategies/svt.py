"""Stress vector tracing: members of parallel strands that cross in the joints, as one path.

T. Wang, N. Li, G. Link, J. Jelonnek, J. Fleischer, J. Dittus, D. Kupzik, Load-dependent path
planning method for 3D printing of continuous fiber reinforced plastics, Composites Part A 140
(2021) 106181. The tracks and the links are reconstructed: the paper shows them and gives no rule.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
import shapely

from ccfem.arrays import BoolArray, FloatArray
from ccfem.checks import check_fields
from ccfem.geometry.offsets import join_rings, offset_rings, rings
from ccfem.geometry.shapes import Region
from ccfem.layers.layer import Layer
from ccfem.layers.layer_stress import LayerStress
from ccfem.linking.single_path import link_tracks
from ccfem.machine.machine import Machine
from ccfem.planning.infill import SPACING, check_fill, long_enough
from ccfem.planning.strategy import Amount
from ccfem.stress_tracing.band import band
from ccfem.stress_tracing.criterion import Criterion
from ccfem.stress_tracing.frame import frame
from ccfem.stress_tracing.main_paths import main_paths
from ccfem.stress_tracing.tracks import track_count, tracks
from ccfem.stress_tracing.walk import walk
from ccfem.toolpaths import Toolpaths

__all__ = ["Svt"]

_SAMPLING = 0.5
"""Distance of the samples of the border for the medial axis, in fibre widths."""


@dataclass(frozen=True)
class Svt:
    """Parallel strands along the main load paths of a frame, joined to one path.

    Members of the section are those of its medial axis. In every joint two members at a time are
    joined to a main load path, where turn, misalignment with the stress and sense of the stress
    suit best. Strands fill each main path from side to side, their distance following its width;
    they cross those of other main paths in the joints and leave the section there. Links outside
    the section join them to one path for each piece of the section. A section without members (a
    disc, a square) is filled by concentric rings.

    It is meant for frames of slim members. In parts with wide ones, as a plate with a hole, joints
    take most of the section: strands lie there side by side, or over each other, and where links
    would lead through the section for long the path is cut.

    Attributes
    ----------
    mode : "graph" or "points", default "graph"
        Whether members are joined at the joints; or load paths are traced over the points of the
        medial axis, as the paper has it, and are laid themselves, as single strands, whatever the
        parameters below up to `minimum_length`: that skips joints and leaves points over, so that
        no section is filled from them.
    spacing : float, default 1
        Distance of neighbouring strands in fibre widths, at least 1, where the main path is wide;
        strands are closer where it is narrow.
    links : "outside" or "none", default "outside"
        Join all strands of a piece of the section to one path, or lay single strands.
    longest_inside : float, mm, default 6
        Links of which more than that lies inside the section are left out: the path is cut there.
    longest_over_void : float, mm, optional
        Likewise of links over holes, where nothing holds the fibre. By default these stay, for
        strands leave members into windows as they do outside, and turn there.
    crossings : bool, default True
        Whether strands that end in a joint cross it and leave the section on the far side, as in
        the paper; otherwise they stop in its middle.
    aligned : bool, default True
        Whether strands turn to the stress in joints and beside free ends; otherwise they run there
        as the medial axis and a smooth curve across the joint have it.
    turn : float, default 75
        Largest turn, degrees, of a main path in a joint.
    width_ratio : float, default 2
        Most that the widest member of a main path has over its narrowest.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    """

    mode: Literal["graph", "points"] = "graph"
    spacing: float = 1.0
    links: Literal["outside", "none"] = "outside"
    longest_inside: float = 6.0
    longest_over_void: float | None = None
    crossings: bool = True
    aligned: bool = True
    turn: float = 75.0
    width_ratio: float = 2.0
    minimum_length: float | None = None

    amount: ClassVar[Amount] = SPACING
    flat_layers_only: ClassVar[bool] = True
    crosses: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "points": {"mode": "points"},
        "plain": {"links": "none", "crossings": False, "aligned": False},
        "cut": {"longest_inside": 0.0, "longest_over_void": 0.0},
    }

    def __post_init__(self) -> None:
        check_fill(self)
        check_fields(self, "longest_inside", "longest_over_void", at_least=0.0, unit="mm")
        check_fields(self, "turn", above=0.0, below=180.0, unit="degrees")
        check_fields(self, "width_ratio", at_least=1.0)

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer: for each piece of its section one, or as few as can be."""
        lines: list[FloatArray] = []
        link: list[BoolArray] = []
        for piece in shapely.get_parts(layer.plane.polygon):
            for line, mask in self._piece(piece, stress, machine):
                lines.append(line)
                link.append(mask)
        paths = Toolpaths.from_plane(lines, layer, link=link)
        return long_enough(paths, self.minimum_length, machine)

    def groups(
        self, piece: Region, stress: LayerStress, machine: Machine
    ) -> list[list[FloatArray]]:
        """Strands (n_i, 2), mm, of each main path of one piece of the section, not yet joined."""
        members = frame(piece, _SAMPLING * machine.fibre_width)
        criterion = Criterion(turn=self.turn)
        found = []
        for path in main_paths(members, stress, criterion, self.width_ratio):
            strip = band(path, members, self.crossings)
            count = track_count(strip, self.spacing * machine.fibre_width)
            follow = stress if self.aligned else None
            found.append(tracks(strip, count, piece, machine.minimum_radius, follow))
        return found

    def _piece(
        self, piece: Region, stress: LayerStress, machine: Machine
    ) -> list[tuple[FloatArray, BoolArray]]:
        """Paths of one piece of the section, with the mask of their links."""
        if self.mode == "points":
            return _unlinked(walk(piece, stress, _SAMPLING * machine.fibre_width))
        groups = self.groups(piece, stress, machine)
        if not any(groups):
            return _unlinked(self._rings(piece, machine))
        if self.links == "none":
            return _unlinked([line for group in groups for line in group])
        width = self.spacing * machine.fibre_width
        path = link_tracks(groups, piece, machine.minimum_radius, width)
        over_void = np.inf if self.longest_over_void is None else self.longest_over_void
        parts = path.without_long_links(piece, self.longest_inside, over_void)
        return [(part.points, part.link) for part in parts]

    def _rings(self, piece: Region, machine: Machine) -> list[FloatArray]:
        """Concentric rings of a piece that has no members, joined by ramps."""
        width = machine.fibre_width
        levels = offset_rings(piece, 0.5 * width, self.spacing * width, width)
        start = rings(piece)[0][:2].mean(axis=0)
        return join_rings(levels, start, self.spacing * width, width) if levels else []


def _unlinked(lines: list[FloatArray]) -> list[tuple[FloatArray, BoolArray]]:
    return [(line, np.zeros(len(line), dtype=bool)) for line in lines]
