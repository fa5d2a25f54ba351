"""Equilibrium of a part with fibre smeared over its cells, without assembling the fibre.

Fibre of density m (mm of strand per mm^3) along the unit vector t in a cell of volume V adds the
energy ``EA V m eps^2 / 2``, with the strain eps along t. Fibre lies in the planes of the layers, so
its stiffness acts on the three in-plane strains only: on curved layers those in the tangent plane
of the layer nearest to each cell.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray, freeze, in_brief, read_only
from ccfem.base.compiled import compiled
from ccfem.base.errors import SolveError
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity import StressField, cell_gradients, preconditioned_cg, solve
from ccfem.fem.elasticity.block_product import times
from ccfem.fem.elasticity.conjugate_gradient import conjugate_gradient
from ccfem.judging.virtual_testing import Specimen
from ccfem.strategies.fibre_aware.layer_axes import LayerAxes

_UPDATES = 40
"""Updates of the displacement after which to give up."""

_PROGRESS = 1e-3
"""Factor by which one solve reduces the residual: the set of fibre in tension may then change."""

DIRECT_UNKNOWNS = 25_000
"""Largest system that is factorised: solves are then as fast as with multigrid, and rotate with the
part to the last digits."""

UPPER = np.array([0, 0, 0, 1, 1, 2]), np.array([0, 1, 2, 1, 2, 2])
"""Rows and columns of the upper triangle of a symmetric 3 x 3 matrix, in their order."""


@dataclass(frozen=True)
class SmearedSolution:
    """Equilibrium of a part with smeared fibre.

    Attributes
    ----------
    displacement : (n, 3) array, mm
    strain : (m, 3) array
        Strains 11, 22 and 12 (engineering shear) in the plane of the layers.
    work : float, N mm
        Twice the strain energy of matrix and fibre: the compliance under forces.
    residual : float
        Relative, for the fibre that is in tension under this displacement.
    iterations : int
        Of conjugate gradients.
    """

    displacement: FloatArray
    strain: FloatArray
    work: float
    residual: float
    iterations: int

    def __post_init__(self) -> None:
        freeze(self, displacement=float, strain=float)


Fibre = Callable[[FloatArray], FloatArray]
"""Stiffness, MPa, of the fibre in each cell at strains (m, 3) in the plane: symmetric (m, 3, 3), or
the upper triangles of that (m, 6), in the order of `UPPER`."""


@dataclass(frozen=True)
class SmearedPart:
    """A part without fibre, prepared for any number of solves with smeared fibre.

    Attributes
    ----------
    specimen : Specimen
        On linear cells.
    frame : (3, 3) or (m, 3, 3) array
        Of the layers: two unit vectors in their plane, and their normal; of curved ones in each
        cell.
    """

    specimen: Specimen
    frame: FloatArray

    __repr__ = in_brief

    @cached_property
    def axes(self) -> LayerAxes:
        """Axes of the layers."""
        return LayerAxes(self.frame)

    @classmethod
    def of(
        cls, stress: StressField, frame: FloatArray, backend: str | None = None
    ) -> "SmearedPart":
        """Part of a solved problem; quadratic cells are replaced by linear ones.

        The field stores it, so that planning and bounds on the field share one factorisation.

        Parameters
        ----------
        frame : (3, 3) or (m, 3, 3) array
        backend : str, optional
            Preconditioner; default "superlu" for small systems, else "amg". Both are always
            installed, so that paths do not depend on optional packages.
        """
        if backend is None:
            backend = _backend(stress)
        known = stress.__dict__.setdefault("smeared", {})
        key = _key(backend, frame)
        if key not in known:
            # What other layers of the part have factorised serves these too.
            same = [part.specimen for (name, _), part in known.items() if name == backend]
            specimen = same[0] if same else Specimen.of(on_linear_cells(stress, backend), backend)
            known[key] = cls(specimen, read_only(frame))
        part: SmearedPart = known[key]
        return part

    @property
    def mesh(self) -> TetMesh:
        """Mesh of linear cells."""
        return self.specimen.system.problem.mesh

    @property
    def modulus(self) -> float:
        """Young's modulus of the matrix, MPa."""
        return self.specimen.modulus

    @property
    def centroids(self) -> FloatArray:
        """Centroids of the cells, (m, 3), mm."""
        return self.mesh.centres

    @cached_property
    def unreinforced(self) -> SmearedSolution:
        """Solution without fibre."""
        field = self.specimen.unreinforced
        strain = self.strain(field.displacement)
        work = 2.0 * field.strain_energy
        return SmearedSolution(field.displacement, strain, work, field.record.residual, 0)

    @property
    def forced(self) -> bool:
        """Whether forces load the part; otherwise supports move."""
        return self.specimen.forced

    def ratio(self, work: float) -> float:
        """Stiffness over that of the part without fibre, if the load does this work."""
        before = self.unreinforced.work
        return before / work if self.forced else work / before

    def compliance(self, work: float) -> float:
        """Work without fibre over the stiffness ratio, N mm: under forces the compliance."""
        return self.unreinforced.work / self.ratio(work)

    def pull(self, solution: SmearedSolution) -> tuple[float, float]:
        """Return the factor and work that give the best bound ``C >= 2 w - e`` for a displacement.

        Returns
        -------
        float
            Factor s on the displacement u, so that ``e = s^2 u.K u`` with fibre.
        float
            Work w, N mm, of the load on that: f.u under forces, and s times the work W_0 without
            fibre where supports move, since ``W_0^2 / W >= 2 s W_0 - s^2 W`` for any s.
        """
        if self.forced:
            forces = self.specimen.forces
            return 1.0, float(np.vdot(forces, solution.displacement))
        before = self.unreinforced.work
        factor = before / solution.work
        return factor, factor * before

    @cached_property
    def _slopes(self) -> FloatArray:
        """Gradients (m, 4, 2) of the barycentric coordinates in the plane, 1/mm."""
        return np.ascontiguousarray(self.axes.along(cell_gradients(self.mesh)))

    @cached_property
    def _cells(self) -> IntArray:
        """Rows (m, 4) of `_in_plane` for the corners of each cell."""
        corners = np.ascontiguousarray(self.mesh.corners)
        return np.arange(corners.size).reshape(-1, 4) if self.axes.curved else corners

    @cached_property
    def _gathered(self) -> Any:
        """Matrix (n, 4 m) that adds up what the corners of all cells have at the nodes."""
        corners = self.mesh.corners.ravel()
        entries = (np.ones(len(corners)), (corners, np.arange(len(corners))))
        return sp.csr_array(entries, shape=(len(self.mesh.points), len(corners)))

    def _in_plane(self, displacement: FloatArray) -> FloatArray:
        """Displacements along the layers: (n, 2), on curved ones (4 m, 2) of corners of cells."""
        if not self.axes.curved:
            return np.ascontiguousarray(displacement @ self.frame[:2].T)
        corners = displacement[self.mesh.corners]
        return np.matmul(corners, self._turned).reshape(-1, 2)

    @cached_property
    def _turned(self) -> FloatArray:
        """Axes (m, 3, 2) along curved layers, as columns."""
        return np.ascontiguousarray(np.swapaxes(self.frame[:, :2], 1, 2))

    @cached_property
    def _reduced(self) -> Any:
        return self.specimen.held.reduce(self.specimen.matrix)

    def strain(self, displacement: FloatArray) -> FloatArray:
        """Strains (m, 3) in the plane: 11, 22 and 12 (engineering shear)."""
        plane = self._in_plane(displacement)
        result = np.empty((len(self._cells), 3))
        _strains(self._cells, self._slopes, plane, result)
        return result

    def _force(self, packed: FloatArray, displacement: FloatArray) -> FloatArray:
        """Nodal forces (n, 3) of fibre with packed stiffness (m, 6) times volume."""
        plane = self._in_plane(displacement)
        result = np.zeros_like(plane)
        _forces(self._cells, self._slopes, packed, plane, result)
        if not self.axes.curved:
            return result @ self.frame[:2]
        of_cells = np.matmul(result.reshape(-1, 4, 2), self.frame[:, :2])
        return np.asarray(self._gathered @ of_cells.reshape(-1, 3))

    def pack(self, stiffness: FloatArray) -> FloatArray:
        """Upper triangles (m, 6) of stiffnesses as of `Fibre`, times the volumes of the cells."""
        rows, columns = UPPER
        whole = stiffness.ndim == 3
        upper = stiffness.reshape(-1, 9).take(3 * rows + columns, axis=1) if whole else stiffness
        return upper * self.mesh.volumes[:, None]

    def with_fibre(self, fibre: Fibre, strain: FloatArray) -> "SmearedPart":
        """Return the part with a preconditioner that knows some fibre at strains (m, 3).

        Solves with such fibre then take a third of the iterations. One that is factorised stays as
        it is.
        """
        specimen = self.specimen
        if specimen.solver.backend != "amg":
            return self
        along = fibre(strain)
        if along.ndim == 2:  # upper triangles
            rows, columns = UPPER
            packed, along = along, np.empty((len(along), 3, 3))
            along[:, rows, columns] = along[:, columns, rows] = packed
        added = self.axes.stiffness_in_space(along)
        return replace(self, specimen=specimen.for_fibre(added))

    def solve(
        self, fibre: Fibre, start: SmearedSolution | None = None, tolerance: float = 1e-5
    ) -> SmearedSolution:
        """Find the equilibrium with fibre whose stiffness may depend on the strain.

        Newton's method on the convex energy: with the fibre at the last strains, conjugate
        gradients reduce the residual, until the residual with the fibre at the new strains meets
        the tolerance.

        Parameters
        ----------
        fibre : callable
            Stiffness at strains (m, 3).
        start : SmearedSolution, optional
            Where to start; default the part without fibre.
        tolerance : float
            Largest relative residual.

        Raises
        ------
        SolveError
            When the residual stays above the tolerance.
        """
        specimen, held = self.specimen, self.specimen.held
        begin = self.unreinforced if start is None else start
        u, strain = begin.displacement, begin.strain
        matrix, solver = specimen.matrix, specimen.solver
        # Size of the load. Where a support moves, it is the force that holds the part back.
        size = self._load_size
        iterations, residual = 0, np.inf
        for _ in range(_UPDATES):
            packed = self.pack(fibre(strain))
            internal = times(matrix, u.reshape(-1)).reshape(-1, 3) + self._force(packed, u)
            rest = held.project(specimen.forces - internal)
            residual = float(np.linalg.norm(rest)) / size
            if residual <= tolerance:
                work = float(np.vdot(u, internal))
                return SmearedSolution(u, strain, work, residual, iterations)
            operator = _Operator(self, packed)
            goal = max(0.5 * tolerance / residual, _PROGRESS)
            # What is left is seen above, with the fibre that is then in tension.
            goal = 0.5 * min(goal, 0.3)
            step, count, _ = conjugate_gradient(operator, rest, solver.apply, tolerance=goal)
            iterations += count
            u = u + operator.expand(step)
            strain = self.strain(u)
        raise SolveError(
            f"smeared fibre: relative residual {residual:.1e} after {_UPDATES} updates of the "
            f"fibre in tension, above the tolerance {tolerance:.1e}"
        )

    def respond(
        self, stiffness: FloatArray, forces: FloatArray, tolerance: float = 1e-3
    ) -> FloatArray:
        """Strains (m, 3) under forces (n, 3), N, of the part with fibre of a stiffness.

        This is the adjoint solve, with supports at rest, to a relative residual `tolerance`.
        """
        operator = _Operator(self, self.pack(stiffness))
        held, solver = self.specimen.held, self.specimen.solver
        solution = preconditioned_cg(operator, held.project(forces), solver, tolerance=tolerance)
        return self.strain(operator.expand(solution.values))

    @cached_property
    def _load_size(self) -> float:
        held = self.specimen.held
        rhs = held.right_hand_side(self.specimen.matrix, self.specimen.forces)
        return float(np.linalg.norm(rhs))


@dataclass(frozen=True)
class _Operator:
    """Stiffness of part and fibre on the free components, applied by ``@`` only."""

    part: SmearedPart
    packed: FloatArray

    def expand(self, x: FloatArray) -> FloatArray:
        return self.part.specimen.held.motion(x)

    def __matmul__(self, x: FloatArray) -> FloatArray:
        held = self.part.specimen.held
        fibre = self.part._force(self.packed, self.expand(x))
        return times(self.part._reduced, x) + held.project(fibre)


def smeared_cases(fields: Sequence[StressField], frame: FloatArray) -> tuple[SmearedPart, ...]:
    """Parts of several load cases of a mesh; those of one problem share one factorisation."""
    leaders: dict[int, SmearedPart] = {}
    for field in fields:
        backend, leader = _backend(field), leaders.get(id(field.problem))
        known = field.__dict__.setdefault("smeared", {})
        if leader is not None and _key(backend, frame) not in known:
            linear = on_linear_cells(field, backend)
            specimen = leader.specimen.under(linear)
            known[_key(backend, frame)] = SmearedPart(specimen, read_only(frame))
        leaders.setdefault(id(field.problem), SmearedPart.of(field, frame, backend))
    return tuple(SmearedPart.of(field, frame) for field in fields)


def _backend(stress: StressField) -> str:
    """Preconditioner by the size of the part."""
    return "superlu" if 3 * len(stress.mesh.points) <= DIRECT_UNKNOWNS else "amg"


def _key(backend: str, frame: FloatArray) -> tuple[str, bytes]:
    return backend, np.asarray(frame, dtype=np.float64).tobytes()


def on_linear_cells(stress: StressField, backend: str = "auto") -> StressField:
    """Solution of the same problem on linear cells; the given one if its cells are linear."""
    problem = stress.problem
    mesh = problem.mesh
    if mesh.order == 1:
        return stress
    case = stress.case
    loads = {name: problem.loads[name] for name in problem.factors(case)}
    sums = {case: problem.factors(case)} if case in problem.combinations else {}
    on_corners = replace(problem, mesh=mesh.linear(), order=1, loads=loads, combinations=sums)
    return solve(on_corners, backend)[case]


# One loop each, without slices, which would double the time.
@compiled
def _strains(
    cells: IntArray, slopes: FloatArray, plane: FloatArray, result: FloatArray
) -> None:  # pragma: no cover
    """Strain e11, e22 and twice e12 in the plane of each cell."""
    for c in range(len(cells)):
        e1, e2, e12 = 0.0, 0.0, 0.0
        for a in range(4):
            i = cells[c, a]
            x, y = slopes[c, a, 0], slopes[c, a, 1]
            e1 += plane[i, 0] * x
            e2 += plane[i, 1] * y
            e12 += plane[i, 0] * y + plane[i, 1] * x
        result[c, 0], result[c, 1], result[c, 2] = e1, e2, e12


@compiled
def _forces(
    cells: IntArray, slopes: FloatArray, packed: FloatArray, plane: FloatArray, result: FloatArray
) -> None:  # pragma: no cover
    for c in range(len(cells)):
        e1, e2, e12 = 0.0, 0.0, 0.0
        for a in range(4):
            i = cells[c, a]
            x, y = slopes[c, a, 0], slopes[c, a, 1]
            e1 += plane[i, 0] * x
            e2 += plane[i, 1] * y
            e12 += plane[i, 0] * y + plane[i, 1] * x
        s1 = packed[c, 0] * e1 + packed[c, 1] * e2 + packed[c, 2] * e12
        s2 = packed[c, 1] * e1 + packed[c, 3] * e2 + packed[c, 4] * e12
        s12 = packed[c, 2] * e1 + packed[c, 4] * e2 + packed[c, 5] * e12
        for a in range(4):
            i = cells[c, a]
            x, y = slopes[c, a, 0], slopes[c, a, 1]
            result[i, 0] += s1 * x + s12 * y
            result[i, 1] += s2 * y + s12 * x
