"""Strands moved sideways to where they make the part stiffer.

Beyond the papers: the part is tested virtually with its fibre, every point of a strand is drawn to
where the fibre is stretched more (`ccfem.strand_moves.worth`), and the strands are pushed apart
again until they keep their distance (`ccfem.strand_moves.spacing`); and so on, in ever shorter
steps. No strand is cut, joined, or led past another.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from ccfem.arrays import BoolArray, FloatArray, IntArray
from ccfem.checks import check_number
from ccfem.elasticity.stress_field import StressField
from ccfem.fibre_aware.smeared import SmearedPart
from ccfem.geometry.polylines import arc_lengths, resample, sample_at, starts_segment
from ccfem.geometry.shapes import Region
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.strand_moves.local_strain import LocalStrain
from ccfem.strand_moves.smoothing import Smoothing, across
from ccfem.strand_moves.spacing import Room, apart, pairs_of, walls_of
from ccfem.strand_moves.worth import worth_of
from ccfem.toolpaths import FIBRE, Toolpaths
from ccfem.virtual_testing.equilibrium import equilibrium
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.strands import cut_strands

__all__ = ["moved"]

_PIECE = 0.6
"""Distance of the points of a strand, in widths. They are set once: points that are set anew in
every round cut corners, and shrink paths by half a percent each time."""

_FAR, _NEAR = 0.1, 0.02
"""Reach of the first and the last move, in widths: 95 % of the points move no further."""

_CHEAP = 0.1
"""Share of the fibre that is worth less than its price."""

_ONLY_APART = 3
"""Last rounds without a force."""

_SWEEPS, _MORE_SWEEPS = 10, 40
"""To push strands apart, in the first and in the second half of the rounds."""

_CLEAR = 1.004
"""Distance of the strands, in widths."""

_WIDER = 1.05
"""Radius of the turns that are left, over the machine's."""

_TIGHT = 1.2
"""Curvature, over the machine's, from which on a turn is held: a link that is moved breaks."""

_TOLERANCE = 1e-4
_SAME_CELLS = 4
"""Rounds for which the cells round a point are taken for the nearest."""


def moved(
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    stress: StressField,
    machine: Machine,
    strand: Strand | None = None,
    rounds: int = 16,
    inset: float = 0.5,
) -> Toolpaths:
    """Move the strands of paths sideways, so that the part gets stiffer.

    Parameters
    ----------
    toolpaths : Toolpaths
        Of any strategy on flat layers; paths of other kinds than fibre stay as they are.
    layers : sequence of Layer
        All layers that the paths lie on.
    stress : StressField
        The part without fibres, under the load that counts.
    machine : Machine
        Strands keep its width apart and, where they did before, its radius.
    strand : Strand, optional
        Stiffness of a strand; default rho = EA/E = 4 mm^2.
    rounds : int, default 16
        At least 0; all but the last three with a virtual test each, of fibres in tension only.
    inset : float >= 0, default 0.5
        Least distance from the boundary of the layers, in strand widths.

    Returns
    -------
    Toolpaths
        The same paths in the same order, in points 0.6 widths apart. They are shorter or longer by
        a little.

    Raises
    ------
    InputError
        When `rounds` or `inset` is negative, or a layer is curved.
    """
    check_number("rounds", rounds, at_least=0)
    check_number("inset", inset, at_least=0.0, unit="strand widths")
    fibre = toolpaths.kind == FIBRE
    if not rounds or not fibre.any():
        return toolpaths
    if not fibre.all():
        parts = (toolpaths.select(fibre), toolpaths.select(~fibre))
        strands = moved(parts[0], layers, stress, machine, strand, rounds, inset)
        return _in_order(strands, parts[1], fibre)
    part = SmearedPart.of(stress, layers[0].plane.frame)
    axial = (Strand() if strand is None else strand).stiffness(part.modulus)
    planes = {
        layer.index: shapely.buffer(layer.plane.polygon, -inset * machine.fibre_width)
        for layer in layers
    }
    paths = _sampled(toolpaths, machine.fibre_width)
    return _Moving(part, axial, machine, planes, paths).run(rounds)


def _in_order(fibre: Toolpaths, others: Toolpaths, mask: BoolArray) -> Toolpaths:
    """Fibre paths and others, back in the order of a mask (K,)."""
    both = Toolpaths.concatenate([fibre, others])
    order = np.argsort(np.concatenate([np.flatnonzero(mask), np.flatnonzero(~mask)]))
    one_each = [both.select(np.arange(len(both)) == k) for k in order.tolist()]
    return Toolpaths.concatenate(one_each)


def _sampled(toolpaths: Toolpaths, width: float) -> Toolpaths:
    """Paths of points 0.6 widths apart."""
    points, offsets = resample(toolpaths.points, toolpaths.offsets, _PIECE * width)
    along = arc_lengths(points, offsets)
    line = np.repeat(np.arange(len(toolpaths)), np.diff(offsets))
    share = toolpaths.lengths / np.maximum(along[offsets[1:] - 1], 1e-300)
    starts = np.flatnonzero(starts_segment(offsets))
    middle = (0.5 * (along[starts] + along[starts + 1])) * share[line[starts]]
    _, segment = sample_at(toolpaths.points, toolpaths.offsets, line[starts], middle)
    link = np.zeros(len(points), dtype=bool)
    link[starts] = toolpaths.link[segment]
    normals = toolpaths.normals[toolpaths.offsets[:-1]][line]
    return replace(toolpaths, points=points, normals=normals, offsets=offsets, link=link)


@dataclass(frozen=True)
class _Moving:
    """Paths on the move."""

    part: SmearedPart
    axial: float
    machine: Machine
    planes: Mapping[int, Region]
    paths: Toolpaths

    def run(self, rounds: int) -> Toolpaths:
        """Move the strands in a number of rounds."""
        part, width, paths = self.part, self.machine.fibre_width, self.paths
        points, height = paths.points @ part.frame[:2].T, paths.points @ part.frame[2]
        starts = np.flatnonzero(starts_segment(paths.offsets))
        layer = np.repeat(paths.layer, np.diff(paths.offsets))
        held = self.held(points)
        smoothing = Smoothing(paths.offsets, held)
        radius = _WIDER * self.machine.minimum_radius
        room = Room(paths.offsets, paths.layer, paths.closed, held, _CLEAR * width, radius)
        local = LocalStrain(part.centroids @ part.frame.T, part.mesh.volumes)
        known: tuple[FloatArray, ...] = ()
        near: IntArray | None = None
        forced = max(rounds - _ONLY_APART, 1)
        for k in range(rounds):
            if k < forced:
                strands = cut_strands(self.at(points, height), part.mesh)
                found = equilibrium(
                    part.specimen, strands, self.axial, known=known, tolerance=_TOLERANCE
                )
                known = (found.displacement,)
                middle = 0.5 * (points[starts] + points[starts + 1])
                place = np.column_stack([middle, height[starts]])
                if near is None or k % _SAME_CELLS == 0:
                    near = local.near(place)
                there = local.at(place, near, part.strain(found.displacement))
                length = np.linalg.norm(points[starts + 1] - points[starts], axis=1)
                value = worth_of(points, starts, there, 0.0).value / np.maximum(length, 1e-300)
                price = np.quantile(value, _CHEAP, weights=length, method="inverted_cdf")
                force = worth_of(points, starts, there, float(price)).force
                reach = width * (_FAR + (_NEAR - _FAR) * k / max(forced - 1, 1))
                points = points + _stride(smoothing(across(points, paths.offsets, force)), reach)
            walls = walls_of(points, layer, self.planes, 2.0 * width)
            sweeps = _MORE_SWEEPS if 2 * k >= rounds else _SWEEPS
            points = apart(points, room, pairs_of(points, room), walls, sweeps)
        return self.at(points, height)

    def at(self, points: FloatArray, height: FloatArray) -> Toolpaths:
        """Paths whose points are at places (P, 2) in the plane."""
        frame = self.part.frame
        return replace(self.paths, points=points @ frame[:2] + height[:, None] * frame[2])

    def held(self, points: FloatArray) -> BoolArray:
        """Points (P,) that stay: on links, in tight turns, and where rings close."""
        offsets, closed = self.paths.offsets, self.paths.closed
        bend = np.zeros(len(points))
        second = points[:-2] - 2.0 * points[1:-1] + points[2:]
        chord = np.maximum(np.linalg.norm(points[2:] - points[:-2], axis=1), 1e-12)
        bend[1:-1] = 4.0 * np.linalg.norm(second, axis=1) / chord**2
        bend[offsets[:-1]] = bend[offsets[1:] - 1] = 0.0
        tight = self.paths.link | (bend * self.machine.minimum_radius > _TIGHT)
        held = tight.copy()
        held[1:] |= tight[:-1]
        held[:-1] |= tight[1:]
        held[offsets[:-1][closed]] = held[offsets[1:][closed] - 1] = True
        return held


def _stride(force: FloatArray, reach: float) -> FloatArray:
    """Scale forces (P, 2) to moves: 95 % reach no further than `reach`, none more than twice."""
    size = np.linalg.norm(force, axis=1)
    most = float(np.quantile(size, 0.95))
    if not most > 0.0:
        return np.zeros_like(force)
    move = reach / most * force
    return move * np.minimum(1.0, 2.0 * most / np.maximum(size, 1e-300))[:, None]
