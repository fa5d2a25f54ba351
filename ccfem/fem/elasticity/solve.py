"""The solve: from a problem to the stress field of every load case."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Protocol, TypeVar

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import KnownNames
from ccfem.base.errors import InputError, SolveError
from ccfem.fem.elasticity.conditioning import about_conditioning
from ccfem.fem.elasticity.contact import EXPECTED, Contact, find_contact
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.order import LARGEST_ERROR, MOST_CELLS, linear_locks, on_quadratic
from ccfem.fem.elasticity.plausibility import check_size_of_motion
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.solvers import LARGEST_DIRECT, Solver, direct_backend
from ccfem.fem.elasticity.stress_field import SolveRecord, StressField
from ccfem.fem.elasticity.support_sets import support_sets
from ccfem.fem.elasticity.system import prepare

FieldT = TypeVar("FieldT", covariant=True)

_ENERGY = 1e-4
"""Energy of the error, over that of the displacement, above which a solution is refused: a
hundredth of the discretisation error of the cells themselves."""


def solve(
    problem: Problem, backend: str = "auto", tolerance: float = 1e-8
) -> dict[str, StressField]:
    """Solve a problem for all its load cases, with one factorisation for each set of supports.

    Parameters
    ----------
    problem : Problem
        With ``order = "auto"`` a mesh of linear cells is solved on quadratic ones if linear ones
        lock or leave too large an error: see `ccfem.fem.elasticity.order`. The nodes of the mesh
        then stay the first ones, and the cells keep their order. The problem of each field is the
        one that was solved.
    backend : str, default "auto"
        One of `ccfem.fem.elasticity.BACKENDS`. "auto" chooses by size and by what is installed, and
        falls back to a direct backend if an iterative one fails. The record names the backend that
        solved.
    tolerance : float, default 1e-8
        Relative residual at which iterations stop. A solution is accepted if its residual is below
        this, or its backward error is rounding (`ccfem.fem.elasticity.solution`), and if the energy
        of its error is below 1e-4 of that of the displacement.

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
    fields: dict[str, StressField] = {}
    sets = support_sets(problem)
    for subproblem in sets:
        try:
            fields |= _solved(subproblem, backend, tolerance)
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


def _solved(problem: Problem, backend: str, tolerance: float) -> dict[str, StressField]:
    """Solve a problem with one set of supports."""
    if problem.order != "auto" or problem.mesh.order == 2:
        wanted = on_quadratic(problem) if problem.order == 2 else problem
        return _solved_as_it_is(wanted, backend, tolerance, "")
    if len(problem.mesh.cells) > MOST_CELLS:
        why = f"more than {MOST_CELLS:,} cells"
        return _solved_as_it_is(replace(problem, order=1), backend, tolerance, why)
    if linear_locks(problem):
        why = "the material hardly changes its volume, where linear cells lock"
        return _solved_as_it_is(on_quadratic(problem), backend, tolerance, why)
    why = f"estimated error at most {LARGEST_ERROR:.0%}"
    fields = _solved_as_it_is(replace(problem, order=1), backend, tolerance, why)
    worst = max(field.record.error for field in fields.values())
    if worst <= LARGEST_ERROR:
        return fields
    why = f"linear ones leave an estimated error of {worst:.0%}"
    return _solved_as_it_is(on_quadratic(problem), backend, tolerance, why)


def _solved_as_it_is(
    problem: Problem, backend: str, tolerance: float, why: str
) -> dict[str, StressField]:
    """Solve a problem on its own cells."""
    try:
        fields = solve_system(partial(prepare, problem), backend, tolerance)
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
    prepare: Callable[[], _Equations[FieldT]], backend: str, tolerance: float
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
