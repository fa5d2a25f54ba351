"""Load cases that a part is planned for together, solved and weighted."""

from collections.abc import Mapping

from ccfem.base.errors import InputError
from ccfem.cases.case import Case
from ccfem.fem.elasticity.stress_field import StressField, WeightedCases

ALL_CASES = "all"
"""Text that asks for all load cases instead of one."""


def asks_for_all(case: Case, load_case: str | None) -> bool:
    """Whether all load cases are asked for; a case with this name takes precedence."""
    return load_case == ALL_CASES and ALL_CASES not in case.problem.cases


def weighted_cases(case: Case, fields: Mapping[str, StressField]) -> WeightedCases:
    """Cases named in `Case.weights`, with these weights; by default all but combinations equally.

    Parameters
    ----------
    fields : mapping of name to StressField
        Of all its load cases.

    Raises
    ------
    InputError
        When there is only one.
    """
    weights = dict(case.weights) or dict.fromkeys(case.problem.loads, 1.0)
    if len(weights) < 2:
        known = ", ".join(weights) or "none"
        what = "weights name" if case.weights else "it has"
        raise InputError(
            f"all load cases of '{case.name}' were asked for and {what} one ({known}): leave out "
            "--load-case all, or give it another load case"
        )
    return WeightedCases.of(fields, weights)
