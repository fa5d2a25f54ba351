"""The solve: from a problem to the stress field of every load case."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import Protocol, TypeVar

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import KnownNames, check_number
from ccfem.base.errors import InputError, SolveError
from ccfem.base.parallel import one_blas_thread
from ccfem.base.progress import Progress, silent
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.bisection import bisected
from ccfem.fem.elasticity.conjugate_gradient import Solution
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.load_kinds import kind_of, points_of
from ccfem.fem.elasticity.nodes import nearest_nodes
from ccfem.fem.elasticity.plausibility import (
    LARGEST_ERROR,
    MOST_CELLS,
    about_conditioning,
    check_size_of_motion,
    on_quadratic,
    why_quadratic,
)
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.solve_cost import about_quadratic
from ccfem.fem.elasticity.solvers import LARGEST_DIRECT, Solver, check_backend, direct_backend
from ccfem.fem.elasticity.stress_field import SolveRecord, StressField
from ccfem.fem.elasticity.support_kinds import AnySupport
from ccfem.fem.elasticity.system import prepare

# Equilibrium of a part on supports that only press, with the contact that results.


EXPECTED = 8
"""Number of solves expected until a contact has converged."""

_ROUGH = 1e-4
"""Relative residual of the solves until the contact has converged."""

_ROUNDS = 200
"""Largest number of changes of the contact: a slender part lifts off cell by cell."""

_SLOW = 40
"""Iterations above which a factorisation with the present contact pays off."""

_CARRIED = 1e-4
"""Share of the load that may be carried by what keeps a loose part in place."""


@dataclass(frozen=True)
class Contact:
    """Solution on supports that only press.

    Attributes
    ----------
    held : Held
        The supports with the converged contact.
    solver : Solver
        For the matrix with this contact, for further load cases.
    right : (n,) array
        Right-hand side.
    iterations : int
        Of conjugate gradients, over all rounds.
    """

    held: Held
    solver: Solver
    right: FloatArray
    solution: Solution
    iterations: int


def find_contact(
    matrix: sp.bsr_array, held: Held, forces: FloatArray, solver: Solver, tolerance: float
) -> Contact:
    """Solve, release components that pull and hold those that sink in, until nothing changes.

    The first round is solved with all components in contact. A direct backend then renews its
    factorisation with the same ordering. With multigrid, the following rounds use conjugate
    gradients with the preconditioner of the first round, which is renewed where they are slow.

    Parameters
    ----------
    matrix : bsr_array (3n, 3n), N/mm
    held : Held
        With all components in contact.
    forces : (n, 3) array, N
    solver : Solver
        For the matrix with these supports, in any contact; it may be invalidated.
    tolerance : float
        Relative residual of the solution.

    Raises
    ------
    InputError
        Where the load lifts the part off its supports.
    SolveError
        Where a solve fails, or the contact does not converge.
    """
    start, slow, total, goal = None, False, 0, max(tolerance, _ROUGH)
    for _ in range(_ROUNDS):
        rhs = held.right_hand_side(matrix, forces)
        reduced = held.reduce(matrix)
        if not np.array_equal(reduced.data, solver.matrix.data):
            renewed = slow or solver.exact
            solver = solver.refactorise(reduced) if renewed else replace(solver, matrix=reduced)
        solution = solver.solve(rhs, start, goal)
        total += solution.iterations
        slow = solution.iterations > _SLOW
        displacement = held.expand(solution.values)
        internal = (matrix @ displacement.reshape(-1)).reshape(forces.shape)
        following = held.following(displacement, internal - forces)
        # The contact is found with a rough residual, then kept where it stays with the wanted one.
        if following is held and goal > tolerance:
            goal = tolerance
        elif following is held:
            check_pressed(held, internal - forces, forces)
            return Contact(held, solver, rhs, solution, total)
        held = following
        start = held.restrict(displacement)
    raise SolveError(
        f"contact did not converge in {_ROUNDS} iterations; the part barely touches its pressing "
        "supports: add a support, or use a finer mesh"
    )


def check_pressed(held: Held, reactions: FloatArray, forces: FloatArray) -> None:
    """Refuse a part that the forces (n, 3), N, of the load lift off its supports.

    The reactions are those of all supports, and of what keeps a loose part in place.
    """
    if held.presses is None:
        return
    carried = float(np.abs(held.along_pressing(reactions)[~held.contact]).sum())
    if carried > _CARRIED * float(np.linalg.norm(forces, axis=1).sum()):
        raise InputError(
            "the load lifts the part off its supports that only press, so nothing holds it: hold "
            "it by another support, or turn the load round"
        )


EQUATIONS = "equations"
"""Where a field keeps the system, matrix and solver that it was solved by, if it is to be tested:
on many quadratic cells it takes long to set them up."""

FieldT = TypeVar("FieldT", covariant=True)

_ENERGY = 1e-4
"""Energy of the error, over that of the displacement, above which a solution is refused: a
hundredth of the discretisation error of the cells themselves."""


@one_blas_thread
def solve(
    problem: Problem,
    backend: str = "auto",
    tolerance: float = 1e-8,
    progress: Progress = silent,
    keep: bool = False,
) -> dict[str, StressField]:
    """Solve a problem for all its load cases, with one factorisation for each set of supports.

    Parameters
    ----------
    problem : Problem
        With ``order = "auto"`` a mesh of linear cells is solved on quadratic ones if linear ones
        lock or leave too large an error (`ccfem.fem.elasticity.plausibility`). The nodes of the
        mesh then stay the first ones, and the cells keep their order. The problem of each field is
        the one that was solved.
    backend : str, default "auto"
        One of `ccfem.fem.elasticity.BACKENDS`. "auto" chooses by size and by what is installed, and
        falls back to a direct backend if an iterative one fails. The record names the backend that
        solved.
    tolerance : float, default 1e-8
        Relative residual at which iterations stop. A solution is accepted if its residual is below
        this, or its backward error is rounding (`ccfem.fem.elasticity.conjugate_gradient`), and if
        the energy of its error is below 1e-4 of that of the displacement.
    progress : callable, optional
        Receives what quadratic cells that "auto" takes cost, and why, before they are solved.
    keep : bool, default False
        Whether virtual tests follow. Fields on many quadratic cells under one set of supports then
        keep matrix and solver until the first test takes them over: some 4 kB a node.

    Returns
    -------
    dict of load case name to StressField
        An unknown name raises `InputError` with the known ones.
        Combinations of load cases come last. With supports that only press they are solved as load
        cases of their own, since their contact differs. The time of the factorisation counts in the
        record of the first load case. If cases have supports of their own, the problem of each
        field is that of its set of supports, and all are on one mesh.

    Raises
    ------
    InputError
        For an invalid mesh, support, load or backend, load cases without effect, and displacements
        far larger than the part (`ccfem.fem.elasticity.plausibility`).
    SolveError
        When a solution is not accepted; the message names what makes the equations ill-conditioned.
        Also when reactions do not balance the loads.
    """
    check_backend(backend)
    fields: dict[str, StressField] = {}
    sets = support_sets(problem)
    for subproblem in sets:
        try:
            fields |= _solved(subproblem, backend, tolerance, progress, keep and len(sets) == 1)
        except InputError as error:
            if len(sets) == 1:
                raise
            case = next(iter(subproblem.loads))
            raise InputError(*(f"load case '{case}': {line}" for line in error.mistakes)) from None
    if len({len(field.mesh.points) for field in fields.values()}) > 1:
        for subproblem in sets:
            if fields[next(iter(subproblem.loads))].mesh.order == 1:
                why = "load cases with other supports need them"
                fields |= _solved_as_it_is(on_quadratic(subproblem), backend, tolerance, why)
    return KnownNames("load case", {case: fields[case] for case in problem.cases})


def _solved(
    problem: Problem, backend: str, tolerance: float, progress: Progress, keep: bool
) -> dict[str, StressField]:
    """Solve a problem with one set of supports."""
    if problem.order != "auto" or problem.mesh.order == 2:
        wanted = on_quadratic(problem) if problem.order == 2 else problem
        return _solved_as_it_is(wanted, backend, tolerance, "", keep)
    if len(problem.mesh.cells) > MOST_CELLS:
        why = f"more than {MOST_CELLS:,} cells"
        return _solved_as_it_is(replace(problem, order=1), backend, tolerance, why)
    why = why_quadratic(problem)
    if not why:
        why = f"estimated error at most {LARGEST_ERROR:.0%}"
        fields = _solved_as_it_is(replace(problem, order=1), backend, tolerance, why)
        why = why_quadratic(problem, max(field.record.error for field in fields.values()))
        if not why:
            return fields
    progress(f"solving on {about_quadratic(problem, why)}", 0.0)
    return _solved_as_it_is(on_quadratic(problem), backend, tolerance, why, keep)


def _solved_as_it_is(
    problem: Problem, backend: str, tolerance: float, why: str, keep: bool = False
) -> dict[str, StressField]:
    """Solve a problem on its own cells."""
    try:
        fields = solve_system(partial(prepare, problem), backend, tolerance, keep)
    except SolveError as error:
        raise SolveError(f"{error}; {about_conditioning(problem)}") from error
    for case, field in fields.items():
        check_size_of_motion(problem, case, field.displacement)
    return {case: _with_error(field, why) for case, field in fields.items()}


def _with_error(field: StressField, why: str) -> StressField:
    """Field with its estimated error in the record."""
    record = replace(field.record, error=field.error.relative, order_because=why)
    result = replace(field, record=record)
    result.__dict__["error"] = field.error
    if EQUATIONS in field.__dict__:
        result.__dict__[EQUATIONS] = field.__dict__[EQUATIONS]
    return result


class _Equations(Protocol[FieldT]):
    """What `solve_system` asks of the equations of a problem, in space or in the plane."""

    @property
    def held(self) -> Held: ...

    @property
    def forces(self) -> dict[str, FloatArray]: ...

    @property
    def combinations(self) -> Mapping[str, Mapping[str, float]]: ...

    def held_in(self, case: str) -> Held: ...

    def forces_in(self, case: str) -> FloatArray: ...

    def assemble(self) -> sp.bsr_array: ...

    def factorise(self, matrix: sp.bsr_array, backend: str, solves: int = 1) -> Solver: ...

    def field(
        self, case: str, displacement: FloatArray, matrix: sp.bsr_array, record: SolveRecord
    ) -> FieldT: ...


def solve_system(
    prepare: Callable[[], _Equations[FieldT]], backend: str, tolerance: float, keep: bool = False
) -> dict[str, FieldT]:
    """Prepare a problem and solve it for all its load cases: see `solve`."""
    started = perf_counter()
    system = prepare()
    matrix = system.assemble()
    assembled = perf_counter()
    # Where supports only press, loads can be added but solutions cannot.
    linear = system.held.presses is None
    sums = system.combinations if linear else {}
    alone = (*system.forces, *(name for name in system.combinations if name not in sums))
    solves = 1 if linear else EXPECTED
    solver = system.factorise(matrix, backend, solves * len(alone))
    record = SolveRecord(solver.backend, 0, 0.0, assembled - started, 0.0, system.held.unknowns)
    because = solver.because
    fields, displacement = {}, {}
    started = assembled
    for case in alone:
        work = partial(_solution, matrix, system.held_in(case), system.forces_in(case), tolerance)
        # Where the quick solver fails and nobody named it, the exact one takes its place.
        try:
            contact, energy = work(solver)
        except SolveError:
            if backend != "auto" or solver.exact or record.unknowns > LARGEST_DIRECT:
                raise
            because = f"{solver.backend} failed"
            solver = system.factorise(matrix, direct_backend())
            contact, energy = work(solver)
        solution, solver = contact.solution, contact.solver
        displacement[case] = contact.held.expand(solution.values)
        now = perf_counter()
        record = replace(
            record,
            backend=solver.backend,
            backend_because=because,
            iterations=contact.iterations,
            residual=solution.residual,
            backward_error=solution.backward_error,
            energy_error=energy,
            solve_seconds=now - started,
        )
        fields[case] = system.field(case, displacement[case], matrix, record)
        if keep and linear and solver.backend == "two-level":
            vars(fields[case])[EQUATIONS] = (system, matrix, solver)
        started = perf_counter()
    # Superposition: combinations of linear load cases need no solve.
    for name, factors in sums.items():
        total = sum(
            (k * displacement[case] for case, k in factors.items()),
            np.zeros_like(displacement[case]),
        )
        fields[name] = system.field(name, total, matrix, replace(record, iterations=0))
    return fields


def _solution(
    matrix: sp.bsr_array, held: Held, forces: FloatArray, tolerance: float, solver: Solver
) -> tuple[Contact, float]:
    """Solution for forces (n, 3), N, and the bound of the energy of its error."""
    if held.presses is None:
        rhs = held.right_hand_side(matrix, forces)
        solution = solver.solve(rhs, tolerance=tolerance)
        contact = Contact(held, solver, rhs, solution, solution.iterations)
    else:
        contact = find_contact(matrix, held, forces, solver, tolerance)
    energy = contact.solver.energy_error(contact.right, contact.solution)
    if not energy <= _ENERGY:
        raise SolveError(
            f"{solver.backend}: the energy of the error may be {energy:.1e} of that of the "
            f"displacement, above {_ENERGY:.0e}, at a relative residual of "
            f"{contact.solution.residual:.1e}"
        )
    return contact, energy


# Problems whose load cases have different supports, split by set of supports.


def support_sets(problem: Problem) -> tuple[Problem, ...]:
    """Split a problem into problems of one set of supports each, which share out its load cases.

    Returns
    -------
    tuple of Problem
        Only the given problem if its cases share all supports. Otherwise one problem for each set,
        in the order of the load cases, with supports of cases turned into supports of the problem.
    """
    if not problem.case_supports:
        return (problem,)
    sets: list[tuple[tuple[AnySupport, ...], list[str]]] = []
    for case in problem.loads:
        in_case = problem.supports_of(case)
        known = next((cases for supports, cases in sets if supports == in_case), None)
        if known is None:
            sets.append((in_case, [case]))
        else:
            known.append(case)
    return tuple(
        replace(
            problem,
            supports=supports,
            case_supports={},
            loads={case: problem.loads[case] for case in cases},
            combinations={
                name: factors
                for name, factors in problem.combinations.items()
                if next(iter(factors)) in cases
            },
        )
        for supports, cases in sets
    )


# Refinement of the cells where the estimated error of a solution is large.


_SHARE = 0.7
"""Share of the squared error in the cells that a round refines (Doerfler 1996)."""

_HALVINGS = 3
"""Largest number of times that a cell is halved in a round: its edges are then half as long."""

_REFINEMENT_ROUNDS = 8
"""Largest number of rounds."""


def refine(
    problem: Problem, error: float = LARGEST_ERROR, most_cells: int = MOST_CELLS // 3
) -> Problem:
    """Refine the cells of a problem until their estimated error is small enough.

    In every round the cells with most of the error (Doerfler, SIAM J. Numer. Anal. 33, 1996,
    1106-1124) are halved up to three times. The surface does not change: a curved wall gets more
    facets but is no rounder.

    Parameters
    ----------
    problem : Problem
        On quadratic cells, the corners are refined and the cells made quadratic again.
    error : float, default 0.1
        Estimated error, in energy norm, of the worst load case.
    most_cells : int, default 100,000
        Limit that no round exceeds. The error may then stay above what was asked for, and every
        solve says so.

    Returns
    -------
    Problem
        The same part, supports, loads and materials on the finer mesh.

    Raises
    ------
    InputError
        Where cells would be refined about single nodes that carry force: the displacement there
        grows without end as cells get smaller.
    """
    check_number("error to refine to", error, above=0.0, below=1.0)
    if problem.mesh.order == 2:
        order = 2 if problem.order == "auto" else problem.order
        problem = replace(problem, mesh=problem.mesh.linear(), order=order)
    for _ in range(_REFINEMENT_ROUNDS):
        fields = solve(problem)
        worst = max(fields.values(), key=lambda field: field.record.error)
        if worst.record.error <= error:
            break
        for field in fields.values():
            _check_points(field)
        # The error scales with edge length to the power of the order; three halvings halve an edge.
        wanted = 3.0 * np.log2(worst.record.error / error) / worst.mesh.order
        finer, chosen = problem, _worst(fields, error)
        for _ in range(int(np.clip(np.ceil(wanted), 1, _HALVINGS))):
            mesh, parent = bisected(finer.mesh, chosen)
            finer, chosen = _on(finer, mesh, parent), chosen[parent]
            if len(mesh.cells) > most_cells:
                return problem
        problem = finer
    return problem


_IDLE = 1e-3
"""Share of all forces below which supports at points only keep the part in place."""


def _check_points(field: StressField) -> None:
    """Refuse to refine about nodes that carry force by themselves."""
    problem = field.problem
    loads = [kind_of(load) for load in problem.loads_of(field.case) if points_of(load)]
    acting = (field.reactions, prepare(problem).forces_in(field.case))
    size = sum(np.linalg.norm(forces, axis=1).sum() for forces in acting)
    for support in problem.supports:
        if points := points_of(support):
            nodes = nearest_nodes(field.mesh, points, "a support")
            carried = np.linalg.norm(field.reactions[nodes], axis=1).sum()
            loads += [kind_of(support)] * bool(carried > _IDLE * size)
    if loads:
        raise InputError(
            f"refinement needs loads and supports on patches; got {loads[0]} in load case "
            f"'{field.case}', and a node that carries force moves without end as cells get "
            "smaller: spread it over a patch, or do not refine"
        )


def _worst(fields: dict[str, StressField], error: float) -> BoolArray:
    """Cells (m,) with most of the error of any load case whose error is above the wanted one."""
    chosen = np.zeros(len(next(iter(fields.values())).mesh.cells), dtype=bool)
    for field in fields.values():
        if field.record.error <= error:
            continue
        cells = field.error.cells
        order = np.argsort(-cells, kind="stable")
        held = np.cumsum(cells[order])
        chosen[order[: 1 + int(np.searchsorted(held, _SHARE * held[-1]))]] = True
    return chosen


def _on(problem: Problem, mesh: TetMesh, parent: IntArray) -> Problem:
    """Return a problem on finer cells, each of which is a piece of a previous one."""
    arrays = {
        name: value[parent]
        for name in ("axes", "density", "stiffness", "fill", "strength")
        if (value := getattr(problem, name)) is not None
    }
    regions = tuple(
        replace(region, cells=np.flatnonzero(np.isin(parent, region.cells)))
        for region in problem.regions
    )
    return replace(problem, mesh=mesh, regions=regions, **arrays)
