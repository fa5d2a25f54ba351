"""Strands moved sideways to where they make the part better.

The stiffness that a strand adds grows where it slides towards more stretched fibre. The strain of
one virtual test says in which direction that is; for the load at first failure an adjoint solve
does. A step in this direction is corrected until strands keep their distances again, and is tested.
Only steps that make the part better are kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.linalg import splu

from ccfem.base.arrays import FloatArray, IntArray, freeze, in_brief
from ccfem.base.checks import check_number
from ccfem.base.compiled import compiled
from ccfem.base.errors import InputError
from ccfem.base.tensor import in_plane, strain_from_voigt
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity import cell_gradients
from ccfem.fem.elasticity.recovery import strain_at_nodes
from ccfem.geometry.locate import locate
from ccfem.geometry.polylines import starts_segment
from ccfem.judging.virtual_testing.near_failure import POWER
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer, curved_layers
from ccfem.strategies.fibre_aware.judges import Judge, Judged
from ccfem.strategies.fibre_aware.strain_worth import StrainWorth
from ccfem.strategies.fibre_aware.strand_lines import StrandLines, strand_lines
from ccfem.strategies.fibre_aware.strand_spacing import spacing

_STEP = 0.2
"""First step, in widths: 95 % of the points move by at most this, and none by more than twice."""

_FALL = 0.4
"""Factor on the step after one that did not help."""

_SMALLEST = 0.01
"""Step, in widths, below which the search ends."""

_BETTER = 1e-6
"""Share by which a step has to improve the value."""

_CHEAPEST = 0.1
"""Share of the fibre, that of least strain, whose largest squared strain is the price of length."""

_KEPT = 1.15
"""Radius of bends that slides aim at, over the machine's minimum: they only approach it."""


def moved(
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    judge: Judge,
    moves: int,
    inset: float = 0.5,
    radius: float = 0.0,
) -> Toolpaths:
    """Move fibre sideways, step by step, as long as a test says that it helps.

    Strands keep a width from each other, or their initial distance if that is less, and the
    machine's minimum length. Tight bends, points within two widths of them, marked links and paths
    of other kinds do not move.

    Parameters
    ----------
    toolpaths : Toolpaths
        Of any strategy, on flat layers.
    layers : sequence of Layer
        Those layers.
    mesh : TetMesh
        Of the part.
    judge : callable
        Tests toolpaths: one of `ccfem.strategies.fibre_aware.judges`.
    moves : int
        Number of steps that are tested, at least 0.
    inset : float, default 0.5
        Least distance from the border, in widths. Strands that start nearer come no nearer.
    radius : float, mm, default 0
        Least radius that bends are corrected to; 0 for none.

    Returns
    -------
    Toolpaths
        The given paths if no step helped. Lengths change by some tenths of a per cent.

    Raises
    ------
    InputError
        When a layer is curved, or a number is out of its range.
    """
    check_number("moves", moves, at_least=0)
    check_number("inset", inset, at_least=0.0, unit="fibre widths")
    check_moves(moves, layers)
    fibre = toolpaths.of_kind(FIBRE)
    if not moves or not len(fibre):
        return toolpaths
    lines = strand_lines(fibre, layers, machine)
    width = machine.fibre_width
    apart = spacing(lines, layers, width, inset * width, radius=radius)
    smooth = splu(apart.roughness)
    best, slide = judge(fibre), np.zeros(len(lines.path))
    direction, step, helped = None, _STEP * machine.fibre_width, False
    for _ in range(moves):
        if direction is None:
            direction = _direction(slide, lines, mesh, best, smooth)
        trial = apart.spread(slide + step * direction)
        judged = judge(lines.slid(trial), best.displacements)
        if judged.value > (1.0 + _BETTER) * best.value:
            best, slide, direction, helped = judged, trial, None, True
            continue
        step *= _FALL
        if step < _SMALLEST * machine.fibre_width:
            break
    if not helped:
        return toolpaths
    others = toolpaths.select(toolpaths.kind != FIBRE)
    return Toolpaths.concatenate([lines.slid(slide), others])


def check_moves(moves: int, layers: Sequence[Layer]) -> None:
    """Refuse to move strands on curved layers."""
    if moves and curved_layers(layers):
        raise InputError("strands move on flat layers only; got a curved one: set moves to 0")


def kept_radius(machine: Machine, tight: float) -> float:
    """Radius, mm, that slides keep where only a share of the fibre may turn too tightly, else 0."""
    return _KEPT * machine.minimum_radius if tight < 1.0 else 0.0


def _direction(
    slide: FloatArray, lines: StrandLines, mesh: TetMesh, judged: Judged, smooth: Any
) -> FloatArray:
    """Direction (P,) of slides that increases the worth of fibre less the price of its length.

    95 % of the points move by at most 1, and none by more than 2.
    """
    points = lines.points(slide)
    strain = plane_strain(mesh, judged.strain_worths(), lines.frame)
    energy, length, slope = fibre_energy(points, lines.heights, lines.offsets, strain)
    squared = energy / np.where(length > 0.0, length, 1.0)
    order = np.argsort(squared, kind="stable")
    along = np.cumsum(length[order])
    price = max(float(squared[order][np.searchsorted(along, _CHEAPEST * along[-1])]), 0.0)
    step = np.diff(points, axis=0) * (lines.path[1:] == lines.path[:-1])[:, None]
    size = np.linalg.norm(step, axis=1)
    step *= price / np.where(size > 0.0, size, 1.0)[:, None]
    slope[:-1] += step
    slope[1:] -= step
    direction = smooth.solve(np.einsum("pi,pi->p", slope, lines.normals))
    size = np.abs(direction[~lines.fixed])
    usual = float(np.quantile(size, 0.95)) if len(size) else 0.0
    return np.clip(direction / usual, -2.0, 2.0) if usual > 0.0 else direction


# Sensitivity of the worth of strands to their position: the direction in which to slide them.
#
# Sliding a piece of fibre in a fixed strain field makes the part stiffer, to first order, by the
# increase of the energy of that piece. Where the load at first failure counts too, the worth for
# both replaces the energy (`StrainWorth`). The strain of linear cells jumps between cells and has
# no gradient inside them. It is therefore averaged at the corners of the cells and linear in
# between.


_REACH = 1.0
"""Distance outside the mesh, mm, up to which the strain of the nearest cell is continued."""


@dataclass(frozen=True)
class PlaneStrain:
    """Strain in the planes of the layers, continuous over the mesh.

    Attributes
    ----------
    frame : (3, 3) array
        Axes of the layers: two in their planes, and the normal.
    values : (cases, n, 3) array
        At the nodes, e11, e22 and e12 in the plane, times the square root of the worth of a squared
        strain. Zero at nodes that are no corner of a cell.
    pairs : (k, 2, n, 3) array
        Strains of the displacement and of the adjoint displacement, for cases with strength.
    terms : (k, 3) array
        `StrainWorth.mixed`, `peak` and `most` of these cases.
    slopes : (m, 4, 2) array, 1/mm
        Gradients of the barycentric coordinates of each cell in the plane.
    """

    mesh: TetMesh
    frame: FloatArray
    values: FloatArray
    pairs: FloatArray
    terms: FloatArray
    slopes: FloatArray

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, frame=float, values=float, pairs=float, terms=float, slopes=float)


def plane_strain(mesh: TetMesh, worths: Sequence[StrainWorth], frame: FloatArray) -> PlaneStrain:
    """Average the strain of displacements at the corners of the cells, weighted by volume.

    Each load case has a worth; rows of the frame (3, 3) are the axes of the layers.
    """
    corners, n = mesh.corners, len(mesh.points)
    weight = np.repeat(mesh.volumes, 4)
    total = np.bincount(corners.ravel(), weight, n)

    def at_nodes(displacement: FloatArray, factor: float = 1.0) -> FloatArray:
        tensor = strain_from_voigt(strain_at_nodes(mesh, displacement)[:, :4])
        strain = factor * in_plane(tensor, frame).reshape(-1, 3)
        sums = [np.bincount(corners.ravel(), weight * part, n) for part in strain.T]
        return np.stack(sums, axis=1) / np.where(total > 0.0, total, 1.0)[:, None]

    values = [at_nodes(worth.displacement, float(np.sqrt(worth.squared))) for worth in worths]
    pairs, terms = np.zeros((0, 2, n, 3)), np.zeros((0, 3))
    for worth in worths:
        if worth.adjoint is not None:
            pair = np.stack([at_nodes(worth.displacement), at_nodes(worth.adjoint)])
            pairs = np.concatenate([pairs, pair[None]])
            terms = np.concatenate([terms, [[worth.mixed, worth.peak, worth.most]]])
    slopes = cell_gradients(mesh) @ frame[:2].T
    return PlaneStrain(mesh, frame, np.array(values), pairs, terms, slopes)


def fibre_energy(
    points: FloatArray, heights: FloatArray, offsets: IntArray, strain: PlaneStrain
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Energy of the stretched segments of polylines, and its gradient by their points.

    A segment d has the energy ``max(d . eps d, 0)^2 / |d|^3`` with the strain eps at its middle:
    its length times the square of the strain along it. The energies of all load cases add up. Where
    strength counts, the energy is the length times `StrainWorth.value`.

    Parameters
    ----------
    points : (P, 2) array, mm
        In the frame of the strain.
    heights : (P,) array, mm
        Along its normal.
    offsets : (K + 1,) int array
        As in CSR.

    Returns
    -------
    energy : (s,) array, mm
        Of each segment.
    length : (s,) array, mm
    gradient : (P, 2) array
        Of the sum of the energies.
    """
    first = np.flatnonzero(starts_segment(offsets))
    middle = 0.5 * (points[first] + points[first + 1])
    height = 0.5 * (heights[first] + heights[first + 1])
    places = middle @ strain.frame[:2] + height[:, None] * strain.frame[2]
    cell, weights = locate(strain.mesh.points, strain.mesh.corners, places, _REACH)
    energy, length = np.zeros(len(first)), np.zeros(len(first))
    gradient = np.zeros(points.shape)
    at = _Segments(points, first, cell, weights, strain.mesh.corners, strain.slopes)
    _energy(at, strain.values, energy, length, gradient)
    if len(strain.pairs):
        _strength(at, strain.pairs, strain.terms, energy, gradient)
    return energy, length, gradient


class _Segments(NamedTuple):
    """Segments of lines in the plane, and where their middles lie in a mesh.

    `points` (P, 2), mm; the `first` point (s,) of each segment; the `cell` (s,) of its middle, -1
    outside, and the `weights` (s, 4) of the cell's corners there; `corners` (m, 4) of the cells and
    `slopes` (m, 4, 2) of their barycentric coordinates, 1/mm.
    """

    points: FloatArray
    first: IntArray
    cell: IntArray
    weights: FloatArray
    corners: IntArray
    slopes: FloatArray


@compiled
def _energy(
    segments: _Segments,
    values: FloatArray,
    energy: FloatArray,
    length: FloatArray,
    gradient: FloatArray,
) -> None:  # pragma: no cover
    """Add ``q^2 / |d|^3``, q = d . eps d where that is positive, and its derivatives by the ends.

    d turns with the ends, and eps changes as the middle moves by half of each of them.
    """
    points, first, cell, weights, corners, slopes = segments
    for s in range(len(first)):
        i = first[s]
        dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        size = np.sqrt(dx * dx + dy * dy)
        length[s] = size
        c = cell[s]
        if c < 0 or size == 0.0:
            continue
        for k in range(len(values)):
            e1, e2, e12 = 0.0, 0.0, 0.0
            qx, qy = 0.0, 0.0  # slope of d . eps d with the place
            for a in range(4):
                n = corners[c, a]
                v1, v2, v12 = values[k, n, 0], values[k, n, 1], values[k, n, 2]
                e1 += weights[s, a] * v1
                e2 += weights[s, a] * v2
                e12 += weights[s, a] * v12
                along = v1 * dx * dx + v2 * dy * dy + 2.0 * v12 * dx * dy
                qx += along * slopes[c, a, 0]
                qy += along * slopes[c, a, 1]
            ex, ey = e1 * dx + e12 * dy, e12 * dx + e2 * dy
            q = dx * ex + dy * ey
            if q <= 0.0:
                continue
            cube = size * size * size
            energy[s] += q * q / cube
            turn, fall = 4.0 * q / cube, 3.0 * q * q / (cube * size * size)
            slide = q / cube  # half of 2 q / |d|^3: the middle moves by half of each end
            gradient[i, 0] += slide * qx - turn * ex + fall * dx
            gradient[i, 1] += slide * qy - turn * ey + fall * dy
            gradient[i + 1, 0] += slide * qx + turn * ex - fall * dx
            gradient[i + 1, 1] += slide * qy + turn * ey - fall * dy


@compiled
def _strength(
    segments: _Segments,
    pairs: FloatArray,
    terms: FloatArray,
    energy: FloatArray,
    gradient: FloatArray,
) -> None:  # pragma: no cover
    """Add ``|d| (mixed e a - peak (e / most)^16)`` and its derivatives (`StrainWorth`).

    e and a are the strains along d in a displacement and in its adjoint.
    """
    points, first, cell, weights, corners, slopes = segments
    for s in range(len(first)):
        i, c = first[s], cell[s]
        dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        size = np.sqrt(dx * dx + dy * dy)
        if c < 0 or size == 0.0:
            continue
        square = size * size
        for k in range(len(pairs)):
            # Strain along the segment, and its derivatives by place and by segment, for both.
            strain, px, py, tx, ty = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
            for j in range(2):
                e1, e2, e12 = 0.0, 0.0, 0.0
                for a in range(4):
                    n = corners[c, a]
                    v1, v2, v12 = pairs[k, j, n, 0], pairs[k, j, n, 1], pairs[k, j, n, 2]
                    e1 += weights[s, a] * v1
                    e2 += weights[s, a] * v2
                    e12 += weights[s, a] * v12
                    along = (v1 * dx * dx + v2 * dy * dy + 2.0 * v12 * dx * dy) / square
                    px[j] += along * slopes[c, a, 0]
                    py[j] += along * slopes[c, a, 1]
                ex, ey = e1 * dx + e12 * dy, e12 * dx + e2 * dy
                strain[j] = (dx * ex + dy * ey) / square
                tx[j] = 2.0 * (ex - strain[j] * dx) / square
                ty[j] = 2.0 * (ey - strain[j] * dy) / square
            if strain[0] <= 0.0:
                continue
            mixed, peak, most = terms[k, 0], terms[k, 1], terms[k, 2]
            near = peak * (strain[0] / most) ** POWER
            worth = mixed * strain[0] * strain[1] - near
            by, by_adjoint = mixed * strain[1] - POWER * near / strain[0], mixed * strain[0]
            energy[s] += size * worth
            slide_x = 0.5 * size * (by * px[0] + by_adjoint * px[1])
            slide_y = 0.5 * size * (by * py[0] + by_adjoint * py[1])
            turn_x = size * (by * tx[0] + by_adjoint * tx[1]) + worth * dx / size
            turn_y = size * (by * ty[0] + by_adjoint * ty[1]) + worth * dy / size
            gradient[i, 0] += slide_x - turn_x
            gradient[i, 1] += slide_y - turn_y
            gradient[i + 1, 0] += slide_x + turn_x
            gradient[i + 1, 1] += slide_y + turn_y
