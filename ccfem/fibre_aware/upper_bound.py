"""The stiffness that no fibre paths can exceed, for a given length of fibre and number of layers.

Paths are replaced by a density of fibre m in each cell and direction in the plane of the layers. It
may jump from cell to cell and cross itself, with at most one strand a width in each layer.
`ccfem.fibre_aware.density_ascent` approaches the stiffest density, until its stiffness and the
bound are close. Any displacement u proves a bound by duality: the compliance C of a part with fibre
is the largest value over all u of ``2 f.u - u.K u - EA int m eps^2``, so for every u, with the best
scale,

    C >= (f.u)^2 / (u.K u + EA S(u)),

where S(u) is the largest integral that fibre of that length can collect: cells are filled in the
order of their squared strain, largest first, until the length is used up.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray, freeze, in_brief
from ccfem.checks import check_known, check_number
from ccfem.elasticity.stress_field import StressField
from ccfem.fibre_aware.density_ascent import DensityAscent
from ccfem.fibre_aware.heights import fibre_capacity
from ccfem.fibre_aware.smeared import SmearedPart, SmearedSolution
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.tensor import largest_in_plane
from ccfem.virtual_testing.equilibrium import MODES, TENSION
from ccfem.virtual_testing.strand import Strand

__all__ = [
    "LARGEST_GAP",
    "LOOSE",
    "UpperBound",
    "affordable_iterations",
    "certificate",
    "directions",
    "upper_bound",
]

LARGEST_GAP = 0.005
"""Share by which the bound may lie above `reached`: the iterations stop there."""

LOOSE = 0.01
"""Share by which a bound may lie above `reached` before a remark is made."""

_ANGLES = 24
_CELL_ITERATIONS = 1_500_000


@dataclass(frozen=True)
class UpperBound:
    """How stiff a part can get with fibre of some length.

    Attributes
    ----------
    ratio : float
        Stiffness over that of the part without fibre that no paths exceed, if strands keep their
        width on average in every cell.
    reached : float
        Ratio of the best density found. The sharpest bound lies between this and `ratio`.
    density : (m, k) array, mm/mm^3
        That density, in each cell and direction.
    angles : (k,) array, radians
        Directions, from the first axis of the layers' frame.
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

    @property
    def gap(self) -> float:
        """Share by which the bound lies above `reached`."""
        return self.ratio / self.reached - 1.0

    @property
    def tensor(self) -> FloatArray:
        """Sum of ``m t t^T`` over the directions: 11, 22 and 12 in the plane, (m, 3), mm/mm^3.

        Its trace is the density in all directions. Most of the fibre runs along its principal
        direction of largest value.
        """
        return self.density @ directions(len(self.angles))[1]

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
    iterations: int | None = None,
    gap: float = LARGEST_GAP,
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
    iterations : int, optional
        Maximum number of iterations, with one solve each; at least 1. About 10 bring the bound
        within 1 % of the sharpest, 15 to 40 reach the default gap. Default 60, and fewer for more
        than 25,000 cells: `affordable_iterations`.
    gap : float, default 0.005
        Iterations stop where the bound lies no farther than this share above `reached`.

    Raises
    ------
    InputError
        When the length is not positive, there is no layer, or for an unknown mode.
    """
    check_number("length of fibre", length, above=0.0, unit="mm")
    check_number("number of layers", len(layers), at_least=1)
    if iterations is None:
        iterations = affordable_iterations(len(stress.mesh.cells))
    check_number("iterations", iterations, at_least=1)
    check_number("gap", gap, at_least=0.0)
    check_known("mode", mode, MODES)
    part = SmearedPart.of(stress, layers[0].plane.frame)
    axial = (Strand() if strand is None else strand).stiffness(part.modulus)
    most = fibre_capacity(part, layers, machine)
    volume = part.mesh.volumes
    length = min(length, float(volume @ most))

    angles, along = directions(_ANGLES)
    outer = (along[:, :, None] * along[:, None, :]).reshape(_ANGLES, 9)
    ascent = DensityAscent.even(volume, most, length, _ANGLES)
    solution: SmearedSolution | None = None
    best, reached = ascent.density, 0.0
    bounds = [certificate(part, part.unreinforced, axial, most, length, mode)]
    for _ in range(iterations):

        def fibre(strain: FloatArray, density: FloatArray = ascent.density) -> FloatArray:
            carried = density
            if mode == TENSION:
                carried = np.where(strain @ along.T > 0.0, density, 0.0)
            return axial * (carried @ outer).reshape(-1, 3, 3)

        solution = part.solve(fibre, solution, tolerance=1e-3)
        bounds.append(certificate(part, solution, axial, most, length, mode))
        ratio = part.ratio(solution.work)
        if ratio > reached:
            best, reached = ascent.density, ratio
        if min(bounds) <= (1.0 + gap) * reached:
            break
        strain = solution.strain @ along.T
        stretch = np.maximum(strain, 0.0) if mode == TENSION else np.abs(strain)
        ascent = ascent.step(stretch, ratio)
    return UpperBound(min(bounds), reached, best, angles, tuple(bounds))


def affordable_iterations(cells: int) -> int:
    """Return how many iterations take about as long as 60 with 25,000 cells; at least 10."""
    return max(10, min(60, _CELL_ITERATIONS // cells))


def directions(count: int) -> tuple[FloatArray, FloatArray]:
    """Angles (k,), radians, evenly over half a turn, and coefficients of the strains along them.

    The coefficients (k, 3) times strains 11, 22 and 12 (engineering shear) give the strain along
    each angle.
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
    """Bound of the stiffness ratio that any displacement proves.

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
