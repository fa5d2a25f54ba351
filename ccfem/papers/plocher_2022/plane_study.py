"""A plate with the fibre as laid: strain energy, stress, and the price of printing it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, read_only
from ccfem.base.errors import InputError
from ccfem.base.tensor import strongest_in_plane
from ccfem.fem.materials import Material
from ccfem.fem.plates import PlaneField, PlaneProblem, rotate_plane, solve_plane, stack_plane
from ccfem.fem.plates.solve import prepare
from ccfem.geometry.polylines import arc_lengths, sample_at
from ccfem.judging.evaluation.indices.sinuosity import LONG
from ccfem.judging.evaluation.indices.stiffness_alignment import (
    Reading,
    agreement,
    performance_index,
)
from ccfem.judging.evaluation.layer_paths import PlanePaths
from ccfem.judging.evaluation.sensitivity import acute, plane_compliance
from ccfem.paths.linking.print_order import nearest_end_order

# Which fibre lies in which cell of a plate, and at what angle.


_REACH = 2.0
"""Half length, in bead widths, of the chord that gives the angle."""
_STEP = 0.25
"""Distance of samples along a path, in bead widths."""
_NEAR = 0.75
"""Cells farther than this from every path, in bead widths, take the angle of their neighbours."""


@dataclass(frozen=True)
class FibreMap:
    """Fibre of one layer in the cells of a plate."""

    # (m,), radians: from axis x to the fibre; a line, so its half turn means nothing
    angle: FloatArray
    # (m,): path that lies in the cell; -1 where none passes within 0.75 bead widths of its centre
    path: IntArray

    def __post_init__(self) -> None:
        freeze(self, angle=float, path=int)


def fibre_map(paths: PlanePaths, centres: FloatArray, bead: float) -> FibreMap:
    """Angle and path of the fibre in every cell of a layer.

    The angle of a cell is that of the path nearest to its centre, by the chord from two bead
    widths before to two behind the nearest point; ends of open paths cut the chord short. Cells
    without a path near take the mean of the 3 x 3 cells round them, in double-angle form, again
    and again until none is left.

    Parameters
    ----------
    centres : (m, 2) array, mm
        Of square cells one bead wide.
    bead : float, mm
    """
    if not len(paths):
        raise ValueError("a fibre map needs at least one path")
    points, angle, line = _tangents(paths, bead)
    distance, nearest = cKDTree(points).query(centres)
    known = distance <= _NEAR * bead
    if not known.any():
        known = distance <= distance.min()
    double = np.exp(2.0j * angle[nearest])
    double[~known] = 0.0
    near = cKDTree(centres).query_pairs(1.5 * bead, output_type="ndarray")
    while not known.all():
        total = np.zeros(len(centres), dtype=complex)
        count = np.zeros(len(centres))
        for a, b in (near.T, near.T[::-1]):
            np.add.at(total, a, double[b])
            np.add.at(count, a, known[b].astype(float))
        # A part of the plate that no path reaches takes the angle of the nearest path.
        fresh = ~known & (count > 0.0)
        if not fresh.any():
            fresh, total = ~known, np.exp(2.0j * angle[nearest])
        size = np.abs(total[fresh])
        double[fresh] = np.where(size > 1e-12, total[fresh] / np.maximum(size, 1e-12), 1.0)
        known |= fresh
    path = np.where(distance <= _NEAR * bead, line[nearest], -1)
    return FibreMap(0.5 * np.angle(double), path)


def _tangents(paths: PlanePaths, bead: float) -> tuple[FloatArray, FloatArray, IntArray]:
    """Points along the paths with the angle of the chord round each, and their path."""
    points, offsets, total = paths.points, paths.offsets, paths.lengths
    parts = np.maximum(1, np.ceil(total / (_STEP * bead) - 1e-9)).astype(np.int64)
    line = np.repeat(np.arange(len(total)), parts + 1)
    first = np.cumsum(parts + 1) - (parts + 1)
    position = (np.arange(len(line)) - first[line]) * (total / parts)[line]
    # The given points too: paths on a raster pass through the centres of its cells.
    line_of_point = np.repeat(np.arange(len(total)), np.diff(offsets))
    line = np.concatenate([line, line_of_point])
    position = np.concatenate([position, arc_lengths(points, offsets)])
    ends = []
    for shift in (-_REACH * bead, _REACH * bead):
        at = position + shift
        ring = paths.closed[line]
        at[ring] %= total[line][ring]
        ends.append(sample_at(points, offsets, line, at)[0])
    chord = ends[1] - ends[0]
    # A closed path no longer than the chord closes on itself: there the step counts.
    short = np.linalg.norm(chord, axis=1) < 1e-9 * bead
    here, segment = sample_at(points, offsets, line, position)
    following = np.minimum(segment + 1, len(points) - 1)
    chord[short] = (points[following] - points[segment])[short]
    return here, np.arctan2(chord[:, 1], chord[:, 0]), line


# How the stiffness of a plate falls when all its fibre turns: f(theta) through solved angles.


ANGLES = (0.0, 5.0, *(10.0 * n for n in range(1, 10)))
"""Angles, degrees, at which the plate is solved (equation 1 of the paper, and 0)."""


@dataclass(frozen=True)
class Sensitivity:
    """f(theta) = min S / S(theta) through the strain energies of turned fibre.

    Equation 2 of the paper prints the reciprocal; its figures and the range 0 to 1
    stated in table 2 are those of this form.
    """

    angles: FloatArray  # (k,), degrees: rising, from 0 to 90
    # (k,), N mm: strain energy S with the fibre of every cell turned by that angle
    energies: FloatArray

    def __post_init__(self) -> None:
        freeze(self, angles=float, energies=float)
        if self.angles.shape != self.energies.shape or not (np.diff(self.angles) > 0.0).all():
            raise InputError(
                "a sensitivity curve needs rising angles with an energy each; got "
                f"{self.angles.tolist()} and {self.energies.shape[0]} energies"
            )
        if self.angles[0] != 0.0 or self.angles[-1] != 90.0 or not self.energies.min() > 0.0:
            raise InputError(
                "a sensitivity curve runs from 0 to 90 degrees with energies above 0; got "
                f"{self.angles[0]:g} to {self.angles[-1]:g} and {self.energies.min():g} N mm"
            )

    @cached_property
    def values(self) -> FloatArray:
        """Curve f at `angles`, in (0, 1]."""
        return read_only(self.energies.min() / self.energies)

    @cached_property
    def _curve(self) -> PchipInterpolator:
        # Mirrored at both ends, where the curve of an orthotropic sheet is level.
        angles, values = np.radians(self.angles), self.values
        before, after = -angles[1:3][::-1], np.pi - angles[-3:-1][::-1]
        return PchipInterpolator(
            np.concatenate([before, angles, after]),
            np.concatenate([values[1:3][::-1], values, values[-3:-1][::-1]]),
        )

    def __call__(self, angle: FloatArray) -> FloatArray:
        """Curve f at any angle (...,), radians, by monotone cubic interpolation (PCHIP)."""
        return np.asarray(self._curve(np.minimum(acute(angle), 0.5 * np.pi)))


PRINT_SPEED, TRAVEL_SPEED = 8.3, 91.6
"""Speeds, mm/s, of the printer of Plocher et al. (2022), table 4."""

_STRAIGHT = 0.005
"""Bends of beads smaller than this, in bead widths, do not change the area that they cover."""
_HEADLINE = 99.9
"""Percentile of the largest stress component over cells and layers that stands for the maximum."""


def reduced_stiffness(material: Material) -> FloatArray:
    """Reduced stiffness (3, 3), MPa, of a sheet of a material in plane stress."""
    return np.asarray(np.linalg.inv(plane_compliance(material)), dtype=np.float64)


@dataclass(frozen=True)
class LaidPlate:
    """Solution of a plate with fibre in given directions."""

    field: PlaneField
    # (L, m, 3), MPa: s11, s22, s12 at the centre of each cell in the axes of each layer
    components: FloatArray

    def __post_init__(self) -> None:
        freeze(self, components=float)

    @property
    def strain_energy(self) -> float:
        """Total strain energy, N mm: half the compliance."""
        return self.field.strain_energy

    @property
    def density_sum(self) -> float:
        """Sum of the strain energy densities of the cells, MPa: the index of the paper."""
        return float(self.field.energy_density.sum())

    @cached_property
    def largest(self) -> FloatArray:
        """Largest absolute component in each layer and cell, (L, m), MPa."""
        return read_only(np.abs(self.components).max(axis=2))

    @property
    def stress(self) -> float:
        """Largest stress, MPa, as the 99.9th percentile over layers and cells."""
        return float(np.percentile(self.largest, _HEADLINE))

    @property
    def mean_stress(self) -> float:
        """Mean over layers and cells of the largest stress there, MPa."""
        return float(self.largest.mean())

    @property
    def raw_stress(self) -> float:
        """Largest stress of all, MPa; it grows as the cells shrink."""
        return float(self.largest.max())

    def energy_in(self, cells: BoolArray) -> float:
        """Strain energy of some cells, a (m,) mask, N mm."""
        return float(self.field.cell_energy[cells].sum())


def laid_plate(problem: PlaneProblem, angles: FloatArray, stiffness: FloatArray) -> LaidPlate:
    """Solve a plate with the fibre at given angles.

    Parameters
    ----------
    problem : PlaneProblem
        With one load case; its stiffness is not used.
    angles : (L, m) array, radians
        Of the fibre in each of L layers of equal thickness, bonded to each other.
    stiffness : (3, 3) or (L, m, 3, 3) array, MPa
        Reduced stiffness along the fibre.
    """
    angles = np.atleast_2d(angles)
    turned = rotate_plane(stiffness, angles)
    solved = solve_plane(replace(problem, stiffness=stack_plane(turned)))
    (field,) = solved.values()
    per_layer = np.broadcast_to(stiffness, (*angles.shape, 3, 3))
    parts = [field.stress_in(a, along) for a, along in zip(angles, per_layer, strict=True)]
    return LaidPlate(field, np.stack(parts))


def turned_energies(
    problem: PlaneProblem,
    direction: FloatArray,
    stiffness: FloatArray,
    side: FloatArray | float = 1.0,
    angles: Sequence[float] = ANGLES,
) -> Sensitivity:
    """Solve a plate with the fibre of every cell turned away from a direction.

    Parameters
    ----------
    problem : PlaneProblem
        With one load case; its stiffness is not used.
    direction : (m,) array, radians
    stiffness : (3, 3) array, MPa
        Reduced stiffness along the fibre.
    side : (m,) array or float, default 1
        Sense of the turn, 1 or -1: Plocher et al. (2022), figure 8, turn the halves of a
        symmetric plate in mirrored senses.
    angles : sequence of floats, degrees
    """
    elements = prepare(problem).elements
    energies = []
    for angle in angles:
        turned = rotate_plane(stiffness, direction + np.radians(angle) * side)
        (field,) = solve_plane(replace(problem, stiffness=turned), elements=elements).values()
        energies.append(field.strain_energy)
    return Sensitivity(np.array(angles), np.array(energies))


@dataclass(frozen=True)
class Benchmark:
    """The plate with its fibre along the principal direction everywhere, without paths."""

    # (m,), radians: of the stress of the largest size, with an isotropic material
    direction: FloatArray
    defined: BoolArray  # (m,): where there is such a direction (`strongest`)
    laid: LaidPlate  # with the fibre along `direction`
    curve: Sensitivity  # strain energies with the fibre turned from it

    def agreement(self, maps: Sequence[FibreMap]) -> float:
        """Mean agreement of the fibre with `direction` over cells and layers, in [0, 1]."""
        return float(np.mean([agreement(m.angle - self.direction)[self.defined] for m in maps]))

    def index(self, maps: Sequence[FibreMap], reading: Reading = "weighted") -> float:
        """Stiffness-alignment index PI of the fibre: see `performance_index`."""
        factor = np.mean([self.curve(m.angle - self.direction) for m in maps], axis=0)
        energy = self.laid.field.cell_energy
        return performance_index(factor[self.defined], energy[self.defined], reading)


def benchmark(
    isotropic: PlaneField,
    stiffness: FloatArray,
    side: FloatArray | float = 1.0,
    angles: Sequence[float] = ANGLES,
) -> Benchmark:
    """Solve the benchmark of a plate and its sensitivity to turned fibre.

    Parameters
    ----------
    isotropic : PlaneField
        The plate with an isotropic material.
    stiffness : (3, 3) array, MPa
        Reduced stiffness along the fibre.
    side, angles
        See `turned_energies`.
    """
    _, direction, defined = strongest_in_plane(isotropic.stress)
    solved = laid_plate(isotropic.problem, direction, stiffness)
    curve = turned_energies(isotropic.problem, direction, stiffness, side, angles)
    return Benchmark(direction, defined, solved, curve)


def mixed_stiffness(
    paths: Sequence[PlanePaths], maps: Sequence[FibreMap], long: FloatArray, short: FloatArray
) -> FloatArray:
    """Reduced stiffness (L, m, 3, 3), MPa, of cells by the length of the path in them.

    Paths longer than 40 mm are of the material `long` (continuous fibre), the others and
    cells without a path of `short` (Plocher et al. 2022, figures 4 and 14).
    """
    layers = []
    for layer_paths, fibre in zip(paths, maps, strict=True):
        is_long = np.append(layer_paths.lengths > LONG, False)[fibre.path]
        layers.append(np.where(is_long[:, None, None], long, short))
    return np.stack(layers)


def print_seconds(paths: PlanePaths) -> float:
    """Time, s, to print a layer: paths at 8.3 mm/s, ways between them at 91.6 mm/s."""
    if not len(paths):
        return 0.0
    starts, ends = paths.points[paths.offsets[:-1]], paths.points[paths.offsets[1:] - 1]
    _, _, travel = nearest_end_order(starts, ends)
    return float(paths.lengths.sum()) / PRINT_SPEED + travel / TRAVEL_SPEED


def bead_area(paths: PlanePaths, bead: float) -> tuple[float, float]:
    """Shares of the area of a layer that beads cover twice, and that none covers.

    Beads of every pattern end square: length times width is what is extruded, or cut from the
    roll, so the two shares differ by no more than length times width over area less 1. Round ends
    would add half a disc at each end that nobody has paid for, and hide gaps.

    Parameters
    ----------
    bead : float, mm
        Width of a bead; its ends are cut square, its corners round.

    Returns
    -------
    overlap, gaps : float
        Length times width of the beads less the area that they cover, and the area of the section
        that they do not cover, both over the area of the section.
    """
    section = paths.layer.plane.polygon
    index = np.repeat(np.arange(len(paths)), np.diff(paths.offsets))
    lines = shapely.linestrings(paths.points, indices=index)
    points, index = shapely.get_coordinates(
        shapely.simplify(lines, _STRAIGHT * bead), return_index=True
    )
    joined = index[1:] == index[:-1]
    # Strip by strip: the outline of a long winding bead as a whole may cross itself.
    steps = shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1)[joined])
    strips = shapely.buffer(steps, 0.5 * bead, cap_style="flat")
    begins, ends = np.append(True, ~joined), np.append(~joined, True)
    inner = ~(begins | ends) | paths.closed[index]
    discs = shapely.buffer(shapely.points(points[inner]), 0.5 * bead, quad_segs=6)
    covered = shapely.union_all(np.concatenate([strips, discs]))
    overlap = (float(paths.lengths.sum()) * bead - covered.area) / section.area
    return overlap, section.difference(covered).area / section.area
