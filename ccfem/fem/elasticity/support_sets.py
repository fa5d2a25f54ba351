"""Problems whose load cases have different supports, split by set of supports."""

from dataclasses import replace

from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.support_kinds import AnySupport


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
