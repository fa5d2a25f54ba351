"""A plate with the fibre as laid: strain energy, stress, and the price of printing it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, freeze, read_only
from ccfem.base.tensor import strongest_in_plane
from ccfem.fem.materials import Material
from ccfem.fem.plates import PlaneField, PlaneProblem, rotate_plane, solve_plane, stack_plane
from ccfem.fem.plates.solve import prepare
from ccfem.judging.evaluation.indices.sinuosity import LONG
from ccfem.judging.evaluation.indices.stiffness_alignment import (
    Reading,
    agreement,
    performance_index,
)
from ccfem.judging.evaluation.plane_paths import PlanePaths
from ccfem.judging.evaluation.sensitivity import plane_compliance
from ccfem.papers.plocher_2022.fibre_map import FibreMap
from ccfem.papers.plocher_2022.sensitivity import ANGLES, Sensitivity
from ccfem.paths.linking.print_order import nearest_end_order

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
    """Solution of a plate with fibre in given directions.

    Attributes
    ----------
    components : (L, m, 3) array, MPa
        s11, s22, s12 at the centre of each cell in the axes of each layer.
    """

    field: PlaneField
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
    """The plate with its fibre along the principal direction everywhere, without paths.

    Attributes
    ----------
    direction : (m,) array, radians
        Of the stress of the largest size, with an isotropic material.
    defined : (m,) bool array
        Where there is such a direction (`strongest`).
    laid : LaidPlate
        With the fibre along `direction`.
    curve : Sensitivity
        Strain energies with the fibre turned from it.
    """

    direction: FloatArray
    defined: BoolArray
    laid: LaidPlate
    curve: Sensitivity

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
    paths: Sequence[PlanePaths],
    maps: Sequence[FibreMap],
    long: FloatArray,
    short: FloatArray,
    limit: float = LONG,
) -> FloatArray:
    """Reduced stiffness (L, m, 3, 3), MPa, of cells by the length of the path in them.

    Paths longer than `limit`, mm, are of the material `long` (continuous fibre), the others and
    cells without a path of `short` (Plocher et al. 2022, figures 4 and 14).
    """
    layers = []
    for layer_paths, fibre in zip(paths, maps, strict=True):
        is_long = np.append(layer_paths.lengths > limit, False)[fibre.path]
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
