"""Problems whose load cases are held in different ways, each set of supports on its own."""

from dataclasses import replace

from ccfem.elasticity.problem import Problem
from ccfem.elasticity.support_kinds import AnySupport

__all__ = ["support_sets"]


def support_sets(problem: Problem) -> tuple[Problem, ...]:
    """Problems of one set of supports each, which together have the load cases of the given one.

    Parameters
    ----------
    problem : Problem

    Returns
    -------
    tuple of Problem
        The given one alone where its cases share all supports. Otherwise a problem a set, in the
        order of the load cases; the supports of cases have become supports of the problem.
    """
    if not problem.case_supports:
        return (problem,)
    sets: list[tuple[tuple[AnySupport, ...], list[str]]] = []
    for case in problem.loads:
        own = problem.supports_of(case)
        known = next((cases for supports, cases in sets if supports == own), None)
        if known is None:
            sets.append((own, [case]))
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
