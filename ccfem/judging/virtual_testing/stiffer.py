"""Which of two designs is stiffer, and how far the virtual test may be believed."""

from ccfem.base.errors import InputError
from ccfem.judging.virtual_testing.virtual_test import Bracket

FIRST, SECOND, SAME, UNDECIDED = "first", "second", "no difference", "undecided"

HONEST_PROMISE = (
    "Virtual test: it ranks two designs correctly and gives the ratio of their stiffnesses to "
    "about 10 %, or says 'undecided'; the ratio to the unreinforced stiffness is accurate to 25 "
    "%, or 10 % after calibration with one reinforced print; first-failure load to 30 % after "
    "calibration, but the size of its gain is not reliable. Based on one published part, printed "
    "without fibre and with two plans, one specimen each: an indication, not a validation. Linear "
    "elastic, fibres as bars. "
    "Delamination: use it only to rank slicings of one part, where fixed and pressing supports "
    "give the same order; a published load of 0.87 kN was not reproduced."
)
"""What may be expected of the numbers; to be shown wherever they are."""

IN_SHORT = (
    "Predicted by a virtual test that was held against one published part: an indication, not a "
    "validation."
)
"""The same in one sentence, where the report says the rest."""

RESOLUTION = 0.02
"""Relative difference of stiffness below which two designs are not told apart.

Found by ``benchmarks/studies/resolution.py`` with the paths of five strategies on bar, loop,
open_hole and bracket: from one to another of eight meshes a part (two edge lengths, two rotations,
two seeds) the ratio of the stiffnesses of two designs changes by up to 0.6 %, and by less than
0.4 % in 95 of 100 cases. Those meshes are as fine as the cases are by default, or a quarter
coarser. The rest is for coarser ones: on the bar with edges of 3, 2.2 and 1.7 mm, ratios changed by
up to 1.8 % from one mesh to the next."""


def stiffer(first: Bracket, second: Bracket) -> str:
    """Say which design is stiffer: "first", "second", "no difference" or "undecided".

    Stiffnesses that differ by less than `RESOLUTION` are no different. Undecided where bonded and
    tension-only tests disagree on the order by more than that.

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
    ahead, behind = max(gains) > RESOLUTION, min(gains) < -RESOLUTION
    if ahead == behind:
        return UNDECIDED if ahead else SAME
    return FIRST if ahead else SECOND
