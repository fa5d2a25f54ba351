"""Pruning for several load cases: the fibre that carries least in all of them is removed.

As `ccfem.fibre_aware.prune`, but the paths are tested under every case. The worth of a piece is the
sum over the cases of ``s_i eps_i^2 / C_i``, the first-order change of the objective. The weight s_i
of a case grows with its compliance over the least compliance that any paths could reach in it
alone; where the worst case matters, with the twentieth power of that.
"""

import numpy as np

from ccfem.checks import check_number
from ccfem.fibre_aware.cases_judges import CasesGoal, cases_tests
from ccfem.fibre_aware.prune import fibre_length, taken_off
from ccfem.fibre_aware.shortening import tight_share
from ccfem.fibre_aware.strength_value import Worth, layer_normal
from ccfem.machine.machine import Machine
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.strands import cut_strands

__all__ = ["prune_cases"]


def prune_cases(
    toolpaths: Toolpaths,
    goal: CasesGoal,
    length: float,
    machine: Machine,
    strand: Strand | None = None,
    rounds: int = 3,
    strength: float = 0.0,
    tight: float = 1.0,
) -> Toolpaths:
    """Remove the fibre of least worth in all load cases, until a wanted length is left.

    Each round tests the part under every case, with fibres that carry tension only, and removes an
    equal part of the excess.

    Parameters
    ----------
    toolpaths : Toolpaths
    goal : CasesGoal
    length : float, mm
        Largest total length of fibre that remains.
    machine, strand
        As in `prune`.
    rounds : int, default 3
        Tests under every case, at least 1.
    strength : float in [0, 1], default 0
        Weight of the load at first failure, in the case that fails first
        (`ccfem.fibre_aware.strength_value`).
    tight : float in [0, 1], default 1
        Largest share of the fibre's length in bends tighter than the machine's radius, as in
        `prune`.

    Returns
    -------
    Toolpaths
        The given paths where they are short enough and not bent too tightly.

    Raises
    ------
    InputError
        When the length is not positive, `rounds` is below 1, or strength counts and that of matrix
        or fibre is not known.
    """
    check_number("length of fibre", length, above=0.0, unit="mm")
    check_number("rounds", rounds, at_least=1)
    check_number("tight", tight, at_least=0.0, at_most=1.0)
    excess = max(fibre_length(toolpaths) - length, 0.0)
    if not excess and (tight >= 1.0 or tight_share(toolpaths, machine) <= tight):
        return toolpaths
    test = cases_tests(goal, strand)
    worth = Worth.of(goal.parts, strand, strength) if strength else None
    for k in range(rounds):
        strands = cut_strands(toolpaths, goal.parts[0].unreinforced.mesh)
        tested = test(strands)
        counts = goal.counts(tested.ratios)
        value = np.zeros(len(strands.length))
        for share, one in zip(counts / tested.work, tested.found, strict=True):
            value += share * np.where(one.carries, one.strain, 0.0) ** 2
        if worth is not None:
            value = worth(strands, tested.found, layer_normal(toolpaths), counts)
        wanted = length + excess * (1.0 - (k + 1) / rounds)
        toolpaths = taken_off(toolpaths, strands, value, wanted, machine, tight)
    return toolpaths
