"""Which of two designs is stiffer, and how far the virtual test may be believed."""

from ccfem.errors import InputError
from ccfem.virtual_testing.virtual_test import Bracket

__all__ = ["FIRST", "HONEST_PROMISE", "SECOND", "UNDECIDED", "stiffer"]

FIRST, SECOND, UNDECIDED = "first", "second", "undecided"

HONEST_PROMISE = (
    "Virtual test: the order of two designs holds and the ratio of their stiffnesses is right to "
    "about 10 %, or the verdict is 'undecided'; reinforced over unreinforced stiffness is right to "
    "25 %, to 10 % after calibration with one reinforced print; first-failure load to 30 % after "
    "calibration, while the size of its gain is not reliable. Measured on three published parts "
    "with one specimen each: an indication, not a validation. Linear elastic, fibres as bars; "
    "delamination is not predicted."
)
"""What may be expected of the numbers; to be shown wherever they are."""

_TIE = 1e-6
"""Relative difference of stiffness that means nothing."""


def stiffer(first: Bracket, second: Bracket) -> str:
    """Say which design is stiffer: "first", "second" or "undecided".

    Undecided where bonded and tension-only tests disagree on the order, or neither finds a
    difference.

    Parameters
    ----------
    first, second : Bracket
        Tests of two designs of the same part under the same load case.

    Raises
    ------
    InputError
        When the parts or the load cases differ.
    """
    parts = [bracket.tension.unreinforced for bracket in (first, second)]
    if parts[0].problem is not parts[1].problem or parts[0].case != parts[1].case:
        raise InputError(
            "expected two designs of one part under one load case; got different parts or cases: "
            "test both with the stress field of the same solve"
        )
    gains = (
        first.tension.stiffness / second.tension.stiffness - 1.0,
        first.bonded.stiffness / second.bonded.stiffness - 1.0,
    )
    ahead, behind = max(gains) > _TIE, min(gains) < -_TIE
    if ahead == behind:
        return UNDECIDED
    return FIRST if ahead else SECOND
