"""The stiffness that no fibre paths can exceed, at a given length of fibre and number of layers.

Paths are replaced by a density of fibre m in each cell and direction in the plane of the layers,
free to jump from cell to cell and to cross; at most one strand a width lies in each layer. The
stiffest density is found by an optimality criterion. Whatever it finds, its displacement u proves a
bound by duality: the compliance C of a part with fibre is the largest value over all u of
``2 f.u - u.K u - EA int m eps^2``, so for every u, scaled best,

    C >= (f.u)^2 / (u.K u + EA S(u)),

where S(u) is the most that fibre of that length can gather: the cells of the largest squared
strain, filled until the length is used.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray, freeze, in_brief
from ccfem.checks import check_known, check_number
from ccfem.elasticity.stress_field import StressField
from ccfem.fibre_aware.heights import fibre_capacity
from ccfem.fibre_aware.smeared import SmearedPart, SmearedSolution
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.tensor import largest_in_plane
from ccfem.virtual_testing.equilibrium import MODES, TENSION
from ccfem.virtual_testing.strand import Strand

__all__ = ["UpperBound", "certificate", "criterion_step", "directions", "upper_bound"]

_ANGLES = 12
_LEAST_PROGRESS = 2e-4
_PATIENCE = 3
"""The iterations stop when this many of them have not lowered the bound by this share."""

_BISECTIONS = 60


@dataclass(frozen=True)
class UpperBound:
    """How stiff a part can get with fibre of some length.

    Attributes
    ----------
    ratio : float
        Stiffness over that of the part without fibre that no paths exceed, with strands that keep
        their width on average in every cell.
    reached : float
        Ratio of the best density found: the sharpest bound lies between the two.
    density : (m, k) array, mm/mm^3
        Of that density, in each cell and direction.
    angles : (k,) array, radians
        Of the directions to the first axis of the layers' frame.
    bounds : tuple of float
        Bound of the part without fibre, and of every iteration.
    """

    ratio: float
    reached: float
    density: FloatArray
    angles: FloatArray
    bounds: tuple[float, ...]

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, density=float, angles=float)

    def share(self, ratio: float) -> float:
        """Share of the possible gain that a design with this stiffness ratio reaches."""
        return (ratio - 1.0) / (self.ratio - 1.0)


def upper_bound(
    stress: StressField,
    layers: Sequence[Layer],
    length: float,
    machine: Machine,
    strand: Strand | None = None,
    mode: str = TENSION,
    iterations: int = 30,
) -> UpperBound:
    """Bound the stiffness of a part with fibre.

    Parameters
    ----------
    stress : StressField
        The part without fibre, under the load that counts.
    layers : sequence of Layer
        All flat layers of the part; each carries at most one strand a width.
    length : float, mm
        Total length of fibre.
    machine : Machine
        Its strand width.
    strand : Strand, optional
        Stiffness of a strand; default rho = EA/E = 4 mm^2.
    mode : str, default "tension"
        "tension": fibres in compression carry nothing; "bonded": all fibres carry.
    iterations : int, default 30
        Maximum number of iterations of the optimality criterion, a solve each; at least 1. About 10
        are needed: they stop where the bound no longer falls.

    Raises
    ------
    InputError
        When the length is not positive, there is no layer, or for an unknown mode.
    """
    check_number("length of fibre", length, above=0.0, unit="mm")
    check_number("number of layers", len(layers), at_least=1)
    check_number("iterations", iterations, at_least=1)
    check_known("mode", mode, MODES)
    part = SmearedPart.of(stress, layers[0].plane.frame)
    axial = (Strand() if strand is None else strand).stiffness(part.modulus)
    most = fibre_capacity(part, layers, machine)
    volume = part.mesh.volumes
    length = min(length, float(volume @ most))

    angles, along = directions(_ANGLES)
    outer = (along[:, :, None] * along[:, None, :]).reshape(_ANGLES, 9)
    share = length / float(volume @ most)
    density = np.repeat((share * most / _ANGLES)[:, None], _ANGLES, axis=1)
    solution: SmearedSolution | None = None
    best, reached = density, 0.0
    bounds = [certificate(part, part.unreinforced, axial, most, length, mode)]
    for _ in range(iterations):

        def fibre(strain: FloatArray, density: FloatArray = density) -> FloatArray:
            carried = density
            if mode == TENSION:
                carried = np.where(strain @ along.T > 0.0, density, 0.0)
            return axial * (carried @ outer).reshape(-1, 3, 3)

        solution = part.solve(fibre, solution, tolerance=1e-3)
        bounds.append(certificate(part, solution, axial, most, length, mode))
        ratio = part.ratio(solution.work)
        if ratio > reached:
            best, reached = density, ratio
        if min(bounds[-_PATIENCE:]) > (1.0 - _LEAST_PROGRESS) * min(
            bounds[:-_PATIENCE], default=np.inf
        ):
            break
        strain = solution.strain @ along.T
        stretch = np.maximum(strain, 0.0) if mode == TENSION else np.abs(strain)
        density = criterion_step(density, stretch, volume, most, length)
    return UpperBound(min(bounds), reached, best, angles, tuple(bounds))


def directions(count: int) -> tuple[FloatArray, FloatArray]:
    """Angles (k,), radians, evenly over half a turn, and what strains along them are made of.

    The second (k, 3) times the strains 11, 22 and 12 (engineering shear) is the strain along each.
    """
    angles = np.pi * np.arange(count) / count
    cosine, sine = np.cos(angles), np.sin(angles)
    return angles, np.stack([cosine**2, sine**2, cosine * sine], axis=1)


def certificate(
    part: SmearedPart,
    solution: SmearedSolution,
    axial_stiffness: float,
    most: FloatArray,
    length: float,
    mode: str = TENSION,
) -> float:
    """Bound of the stiffness ratio that a displacement proves, whatever it is.

    Parameters
    ----------
    part : SmearedPart
    solution : SmearedSolution
        Any displacement that respects the supports, with its strain in the plane.
    axial_stiffness : float, N
        EA of a strand.
    most : (m,) array, mm/mm^3
        Largest density of fibre in each cell.
    length : float, mm
        Of fibre.
    mode : str
        "tension" or "bonded".
    """
    specimen = part.specimen
    u = solution.displacement.reshape(-1)
    e1, e2, e12 = solution.strain.T
    largest, smallest, _ = largest_in_plane(np.stack([e1, e2, 0.5 * e12], axis=1))
    square = np.maximum(largest, 0.0) ** 2
    if mode != TENSION:
        square = np.maximum(square, smallest**2)
    order = np.argsort(-square, kind="stable")
    room = (part.mesh.volumes * most)[order]
    used = np.minimum(room, np.maximum(length - (np.cumsum(room) - room), 0.0))
    energy = float(u @ (specimen.matrix @ u)) + axial_stiffness * float(used @ square[order])
    before = part.unreinforced.work
    if not part.forced:
        return energy / before
    return before * energy / float(specimen.forces.reshape(-1) @ u) ** 2


def criterion_step(
    density: FloatArray, stretch: FloatArray, volume: FloatArray, most: FloatArray, length: float
) -> FloatArray:
    """Densities (m, k) after one step of the optimality criterion.

    Parameters
    ----------
    density : (m, k) array, mm/mm^3
    stretch : (m, k) array
        Strain along each direction, not negative.
    volume : (m,) array, mm^3
    most : (m,) array, mm/mm^3
    length : float, mm
    """
    weight = density * (stretch / (float(stretch.max()) or 1.0)) ** 2
    total = weight.sum(axis=1)
    low, high = 1e-12, 1e12
    for _ in range(_BISECTIONS):
        middle = float(np.sqrt(low * high))
        laid = float(volume @ np.minimum(most, total / middle))
        low, high = (middle, high) if laid > length else (low, middle)
    scale = np.minimum(most, total / high) / np.maximum(total, 1e-300)
    # A density of 0 would stay 0: keep a trace.
    return np.maximum(weight * scale[:, None], 1e-9 * most[:, None])
