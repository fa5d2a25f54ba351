"""Equilibrium of the part with its fibres, which carry all, some or no compression."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, Int32Array, IntArray, freeze, seen_only
from ccfem.base.checks import check_known, check_number
from ccfem.base.compiled import compiled
from ccfem.base.errors import SolveError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.curved_cells import gradients_at
from ccfem.fem.elasticity import cell_gradients
from ccfem.fem.elasticity.block_product import times
from ccfem.fem.elasticity.conjugate_gradient import conjugate_gradient
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.statics import check_pressed
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strands import Strands

# Fibres as axial bars inside the cells: their strain, and the stiffness that they add.
#
# A piece of length l along t adds the energy ``EA l (m . strain)^2 / 2`` with ``m = (tx^2, ty^2,
# tz^2, ty tz, tx tz, tx ty)`` on Voigt strain with engineering shear. With ``b = B^T m`` that is
# the element matrix ``EA l b b^T``. In a linear cell the constant stiffness ``EA l m m^T / V``
# gives the very same matrix. In a quadratic cell b is taken at the middle of the piece. No matrix
# is assembled: the set of carrying pieces changes from solve to solve, and products with b and its
# transpose are cheap.


def bar_stiffness(
    strands: Strands, volumes: FloatArray, share: FloatArray | None = None
) -> FloatArray:
    """Stiffness that strands with the axial stiffness EA = 1 N add to each cell.

    Parameters
    ----------
    volumes : (m,) array, mm^3
        Of the cells.
    share : (s,) array, optional
        How much of its stiffness each piece lends, in [0, 1], or its stiffness EA, N; default 1.

    Returns
    -------
    (m, 6, 6) array, 1/mm^2
        Multiply by EA, N, for MPa, unless it is given.
    """
    weight = strands.length / volumes[strands.cell]
    result = np.zeros((len(volumes), 6, 6))
    _add_bars(strands.cell, weight if share is None else weight * share, strands.tangent, result)
    return result


@compiled
def _add_bars(
    cell: IntArray, weight: FloatArray, tangent: FloatArray, result: FloatArray
) -> None:  # pragma: no cover
    m = np.empty(6)
    for s in range(len(cell)):
        if weight[s] == 0.0:
            continue
        x, y, z = tangent[s, 0], tangent[s, 1], tangent[s, 2]
        m[0], m[1], m[2], m[3], m[4], m[5] = x * x, y * y, z * z, y * z, x * z, x * y
        c = cell[s]
        for i in range(6):
            for j in range(6):
                result[c, i, j] += weight[s] * m[i] * m[j]


@dataclass(frozen=True)
class Bars:
    """Pieces of fibre as axial bars, ready to be applied to displacements."""

    nodes: IntArray  # (s, q): nodes of the cell of each piece
    slope: FloatArray  # (s, q), 1/mm: slopes of its shape functions along the piece
    tangent: FloatArray  # (s, 3)
    length: FloatArray  # (s,), mm

    def __post_init__(self) -> None:
        freeze(self, nodes=np.int32, slope=float, tangent=float, length=float)

    def strain(self, displacement: FloatArray) -> FloatArray:
        """Strain (s,) along the pieces, at their middles, of a displacement (n, 3), mm."""
        result = np.empty(len(self.length))
        _strain(self.nodes, self.slope, self.tangent, seen_only(displacement), result)
        return result

    def forces(self, stiffness: FloatArray, displacement: FloatArray) -> FloatArray:
        """Return the forces (n, 3), N, that hold the pieces in a displacement (n, 3), mm.

        Parameters
        ----------
        stiffness : (s,) array, N
            EA of each piece; those of zero stiffness cost nothing.
        displacement : (n, 3) array, mm
        """
        u = seen_only(displacement)
        result = np.zeros(u.shape)
        _bar_forces(self.nodes, self.slope, self.tangent, stiffness * self.length, u, result)
        return result


# One loop each, without slices, which would double the time.
@compiled
def _strain(
    nodes: Int32Array, slope: FloatArray, tangent: FloatArray, u: FloatArray, result: FloatArray
) -> None:  # pragma: no cover
    for s in range(len(nodes)):
        x, y, z = tangent[s, 0], tangent[s, 1], tangent[s, 2]
        total = 0.0
        for a in range(nodes.shape[1]):
            i = nodes[s, a]
            total += slope[s, a] * (x * u[i, 0] + y * u[i, 1] + z * u[i, 2])
        result[s] = total


@compiled
def _bar_forces(
    nodes: Int32Array,
    slope: FloatArray,
    tangent: FloatArray,
    weight: FloatArray,
    u: FloatArray,
    result: FloatArray,
) -> None:  # pragma: no cover
    for s in range(len(nodes)):
        if weight[s] == 0.0:
            continue
        x, y, z = tangent[s, 0], tangent[s, 1], tangent[s, 2]
        size = 0.0
        for a in range(nodes.shape[1]):
            i = nodes[s, a]
            size += slope[s, a] * (x * u[i, 0] + y * u[i, 1] + z * u[i, 2])
        size *= weight[s]
        for a in range(nodes.shape[1]):
            i, k = nodes[s, a], size * slope[s, a]
            result[i, 0] += k * x
            result[i, 1] += k * y
            result[i, 2] += k * z


def bars(strands: Strands, mesh: TetMesh) -> Bars:
    """Make the pieces of fibre in a mesh ready to be applied to displacements.

    The strands store them for the last mesh.
    """
    known: tuple[TetMesh, Bars] | None = strands.__dict__.get("bars")
    if known is None or known[0] is not mesh:
        nodes = mesh.cells.take(strands.cell, axis=0)
        known = mesh, Bars(nodes, _slopes(strands, mesh), strands.tangent, strands.length)
        strands.__dict__["bars"] = known
    return known[1]


def _slopes(strands: Strands, mesh: TetMesh) -> FloatArray:
    """Slope (s, q) along each piece of the shape functions of its cell, 1/mm."""
    gradients = cell_gradients(mesh).take(strands.cell, axis=0)
    slope = np.einsum("sak,sk->sa", gradients, strands.tangent)
    if mesh.order == 1:
        return slope
    corner = mesh.points[mesh.corners[strands.cell, 0]]
    weight = np.einsum("sak,sk->sa", gradients, strands.middle - corner)
    weight[:, 0] += 1.0
    i, j = mesh.edges.T
    middle = 4.0 * (weight[:, i] * slope[:, j] + weight[:, j] * slope[:, i])
    result = np.hstack([(4.0 * weight - 1.0) * slope, middle])
    # In the few cells with a side on a round wall the shape functions follow that.
    rows = np.flatnonzero(np.isin(strands.cell, mesh.curved))
    at = mesh.local_coordinates(strands.cell[rows], weight[rows])
    curved = gradients_at(mesh.points[mesh.cells[strands.cell[rows]]], at)
    result[rows] = np.einsum("sak,sk->sa", curved, strands.tangent[rows])
    return result


# Stiffness of a part with its carrying fibres, applied without assembling a matrix.


@dataclass(frozen=True)
class Reinforced:
    """Stiffness of a part and its fibres; ``@`` gives the forces of a displacement."""

    part: sp.bsr_array  # (3n, 3n), N/mm: without fibres
    bars: Bars
    stiffness: FloatArray  # (s,), N: EA of each piece of fibre that carries; zero of the others

    def __matmul__(self, displacement: FloatArray) -> FloatArray:
        """Return the forces (3n,), N, of a displacement (3n,), mm."""
        fibres = self.bars.forces(self.stiffness, displacement.reshape(-1, 3))
        fibres += times(self.part, displacement).reshape(-1, 3)
        return fibres.reshape(-1)


@dataclass(frozen=True)
class Reduced:
    """The same stiffness on the components that the supports leave free."""

    part: sp.bsr_array  # (3k, 3k), N/mm: reduced matrix of the part without fibres
    whole: Reinforced
    held: Held

    def __matmul__(self, x: FloatArray) -> FloatArray:
        """Return the forces (3k,), N, of a solution (3k,), mm."""
        fibres = self.whole.bars.forces(self.whole.stiffness, self.held.motion(x))
        return times(self.part, x) + self.held.project(fibres)


TENSION, PARTIAL, BONDED = "tension", "partial", "bonded"

IN_COMPRESSION = {TENSION: 0.0, PARTIAL: 0.2, BONDED: 1.0}
"""Share of its stiffness that fibre has in compression, in each mode of the test.

Of the published prints of Chen et al. 2021, four pairs of two designs each, the order is predicted
by shares of 0 to 0.2, and by none from 0.35 on (EA/E = 4 mm^2): by finite elements that share
nothing with this code.
"""

_UPDATES = 30
"""Updates of the displacement after which to give up."""

_SETTLING = 1e-4
"""Residual below which the contact with supports is checked."""

_PROGRESS = 1e-2
"""Factor by which each update reduces the residual while the set of carrying fibres may change."""

_FAR = 20.0
"""Residual over its goal from which on a preconditioner that knows the fibre pays (measured)."""

_PRESSED = 0.05
"""Share of the energy of strands that those in compression have, above which a preconditioner that
knows the fibre pays on quadratic cells (measured)."""

_MANY_UNKNOWNS = 100_000
"""Unknowns above which it does."""

_PROGRESS_BY_ENERGY = 0.2
"""The same where the energy of the error is judged, in all modes."""


@dataclass(frozen=True)
class Equilibrium:
    """Displacement of the part with its fibres."""

    displacement: FloatArray  # (n, 3), mm
    matrix: Reinforced  # stiffness of part and carrying fibres
    strain: FloatArray  # (s,): along each piece of fibre
    carried: FloatArray  # (s,) in [0, 1]: share of its stiffness that each piece lends
    updates: int  # solves until the set of carrying fibres and the displacement were converged
    iterations: int  # of conjugate gradients, over all updates
    residual: float  # ``|f - K(u) u| / |f|``, with the carrying set of u itself

    def __post_init__(self) -> None:
        freeze(self, displacement=float, strain=float, carried=float)

    @property
    def work(self) -> float:
        """Twice the strain energy of part and fibres, N mm."""
        u = self.displacement.reshape(-1)
        return float(u @ (self.matrix @ u))


def equilibrium(
    specimen: Specimen,
    strands: Strands,
    axial_stiffness: float,
    mode: str = TENSION,
    known: Sequence[FloatArray] = (),
    tolerance: float = 1e-8,
    energy: float = 0.0,
    prepare: bool = False,
) -> Equilibrium:
    """Find the displacement of a part with fibres.

    With fibres that are softer in compression, the energy is convex and piecewise quadratic.
    Newton's method takes the fibres that the last displacement stretches, solves, and repeats
    until the residual with the new set meets the tolerance. Each solve uses conjugate gradients,
    with the factorisation of the part without fibres as preconditioner. The same iterations find
    the contact with supports that only press.

    Parameters
    ----------
    axial_stiffness : float, N
        EA of one strand.
    mode : str
        Of `IN_COMPRESSION`: what fibres carry that are not stretched.
    known : sequence of (n, 3) arrays, mm, optional
        Displacements of the same part with less and more fibre, the nearest last. The start is the
        mixture of them with the least energy. Default: the part without fibres.
    tolerance : float
        Largest relative residual that is accepted.
    energy : float, default 0
        On quadratic cells, largest error in energy norm, over the displacement, that is accepted
        too, by an estimate: the stiffness is then accurate to its square.
    prepare : bool, default False
        On large meshes of linear cells, solves far from their goal then get a preconditioner that
        knows the fibre. They are fewer, and it is set up in the time of some twenty.

    Raises
    ------
    InputError
        For an unknown mode or an impossible stiffness.
    SolveError
        When the residual stays above the tolerance.
    """
    check_known("mode", mode, tuple(IN_COMPRESSION))
    check_number("axial stiffness", axial_stiffness, at_least=0.0, unit="N")
    known = known or (specimen.unreinforced.displacement,)
    u, total = known[-1], 0
    held, forces = specimen.held.touching(u), specimen.forces
    by_energy = energy > 0.0 and specimen.solver.backend == "two-level" and held.presses is None
    most = _UPDATES if held.presses is None and not by_energy else 2 * _UPDATES
    lowest, last = 1.0, np.inf
    pieces = bars(strands, specimen.system.problem.mesh)
    full = axial_stiffness * strands.share
    strain, carried = _state(pieces, u, mode)
    matrix = Reinforced(specimen.matrix, pieces, carried * full)
    if len(known) > 1 and held.presses is None:
        u = _mixed(matrix, forces, known)
        strain, carried = _state(pieces, u, mode)
        matrix = Reinforced(specimen.matrix, pieces, carried * full)
    part, x = _reduced(specimen, held), held.restrict(u)
    prepare = prepare and specimen.solver.backend == "amg"
    for update in range(most):
        reduced, rest, residual = _imbalance(part, matrix, held, x, forces)
        if prepare and residual > _FAR * tolerance:
            fibre = np.maximum(carried, IN_COMPRESSION[PARTIAL]) * strands.share
            specimen = _knowing_fibre(specimen, strands, axial_stiffness * fibre)
            prepare = False
        if residual <= max(tolerance, _SETTLING if held.presses is not None else 0.0):
            # Near enough to say which supports still press; with others the balance is another.
            internal = (matrix @ u.reshape(-1)).reshape(u.shape)
            following = held.following(u, internal - forces)
            if following is not held:
                held = following
                x = held.restrict(u)
                u, part = held.expand(x), _reduced(specimen, held)
                reduced, rest, residual = _imbalance(part, matrix, held, x, forces)
        apply, near = specimen.solver.apply, False
        if by_energy and update > 0:
            corrected = apply(rest)
            # As in `Solver.energy_error`, half of the lowest eigenvalue found is used.
            near = _near(specimen, matrix, u, rest, corrected, 0.5 * lowest * energy**2)
            apply = _knowing(apply, rest, corrected)
        if residual <= tolerance or near:
            check_pressed(held, (matrix @ u.reshape(-1)).reshape(u.shape) - forces, forces)
            return Equilibrium(u, matrix, strain, carried, update, total, residual)
        goal = max(0.5 * tolerance / residual, 0.0 if mode == BONDED else _PROGRESS)
        goal = 0.5 * min(goal, 0.5)
        # Rough steps alone may go round among sets of fibres: what gained nothing is made finer.
        goal = max(goal, _PROGRESS_BY_ENERGY) if by_energy and residual < last else goal
        last = residual
        step, count, least = conjugate_gradient(reduced, rest, apply, tolerance=goal)
        total, lowest = total + count, min(lowest, least)
        x = x + step
        u = held.expand(x)
        before = carried
        strain, carried = _state(pieces, u, mode)
        if (before != carried).any():
            matrix = Reinforced(specimen.matrix, pieces, carried * full)
    raise SolveError(
        f"virtual test: relative residual {residual:.1e} after {most} updates of the fibres "
        f"that carry tension, above the tolerance {tolerance:.1e}"
    )


def knowing_fibre(specimen: Specimen, strands: Strands, axial_stiffness: float) -> Specimen:
    """Return the part with a preconditioner that knows the fibre that it stretches without any.

    Parameters
    ----------
    axial_stiffness : float, N
        EA of one strand.
    """
    carried = _without_fibre(specimen, strands)[1]
    return _knowing_fibre(specimen, strands, axial_stiffness * strands.share * carried)


def knowing_pressed_fibre(specimen: Specimen, strands: Strands, axial_stiffness: float) -> Specimen:
    """Do so where tests in all modes gain by it: on many quadratic cells with much pressed fibre.

    The tests in which that carries then take half of the iterations or more, and start far from
    their goal.
    """
    few = specimen.unreinforced.record.unknowns <= _MANY_UNKNOWNS
    if few or specimen.solver.backend != "two-level":
        return specimen
    strain, _ = _without_fibre(specimen, strands)
    energy = strands.share * strands.length * strain**2
    if energy[strain < 0.0].sum() <= _PRESSED * energy.sum():
        return specimen
    return knowing_fibre(specimen, strands, axial_stiffness)


def _without_fibre(specimen: Specimen, strands: Strands) -> tuple[FloatArray, FloatArray]:
    """Strain (s,) of the bare part along strands, and the share of its stiffness that carries."""
    pieces = bars(strands, specimen.system.problem.mesh)
    return _state(pieces, specimen.unreinforced.displacement, PARTIAL)


def _knowing_fibre(specimen: Specimen, strands: Strands, stiffness: FloatArray) -> Specimen:
    """Return the part with a preconditioner of it with fibre of a stiffness EA (s,), N."""
    volumes = specimen.system.problem.mesh.volumes
    return specimen.for_fibre(bar_stiffness(strands, volumes, stiffness))


def _knowing(
    apply: Callable[[FloatArray], FloatArray], rhs: FloatArray, result: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    """Return a function that is not applied to a right-hand side whose result is known."""
    return lambda other: result if np.array_equal(other, rhs) else apply(other)


def _near(
    specimen: Specimen,
    matrix: Reinforced,
    u: FloatArray,
    rest: FloatArray,
    corrected: FloatArray,
    most: float,
) -> bool:
    """Whether a displacement (n, 3) leaves little energy, and reactions that balance the loads.

    The energy is about as convex as that of the part with the fibre that carries now, K. With M its
    preconditioner it lies above its least value by half of ``r^T K^-1 r``, which is at most half of
    ``r^T M^-1 r`` over the lowest eigenvalue of ``M^-1 K``.

    Parameters
    ----------
    rest, corrected : (k,) arrays, N and mm
        Forces out of balance, r, and ``M^-1 r``.
    most : float
        Largest ``r^T M^-1 r`` over the energy of the displacement.
    """
    # Where forces load the part, the energy is the work of those that balance them.
    if specimen.forced:
        work = float(np.vdot(specimen.forces, u)) - rest @ specimen.held.restrict(u)
        if not rest @ corrected <= most * work:
            return False
    internal = matrix @ u.reshape(-1)
    if not rest @ corrected <= most * (u.reshape(-1) @ internal):
        return False
    try:
        specimen.system.reactions(specimen.unreinforced.case, u, internal.reshape(-1, 3))
    except SolveError:
        return False
    return True


def _imbalance(
    part: sp.bsr_array, matrix: Reinforced, held: Held, x: FloatArray, forces: FloatArray
) -> tuple[Reduced, FloatArray, float]:
    """Stiffness on the free components, the forces out of balance there, and their share."""
    reduced, rhs = Reduced(part, matrix, held), held.right_hand_side(matrix, forces)
    rest = rhs - reduced @ x
    return reduced, rest, float(np.linalg.norm(rest) / np.linalg.norm(rhs))


def _reduced(specimen: Specimen, held: Held) -> sp.bsr_array:
    """Stiffness of the part without fibres on the free components of the given contact."""
    return specimen.solver.matrix if held.presses is None else held.reduce(specimen.matrix)


def _mixed(matrix: Reinforced, forces: FloatArray, known: Sequence[FloatArray]) -> FloatArray:
    """Mixture of displacements (n, 3), by shares that add to 1, of least energy for a matrix."""
    last = known[-1]
    moves = np.array([(state - last).reshape(-1) for state in known[:-1]])
    images = np.array([matrix @ move for move in moves])
    rest = forces.reshape(-1) - matrix @ last.reshape(-1)
    shares = np.linalg.lstsq(moves @ images.T, moves @ rest, rcond=1e-12)[0]
    return last + (shares @ moves).reshape(last.shape)


def _state(pieces: Bars, displacement: FloatArray, mode: str) -> tuple[FloatArray, FloatArray]:
    """Strain (s,) of the pieces, and the share of its stiffness that each lends."""
    strain = pieces.strain(displacement)
    return strain, np.where(strain > 0.0, 1.0, IN_COMPRESSION[mode])
