"""Taking fibre off where it carries least in all of several load cases.

As `ccfem.fibre_aware.prune`: the paths are tested under every case, and what a piece is worth is
the sum over the cases of ``s_i eps_i^2 / C_i``, the first-order change of the objective. How much a
case counts, s_i, grows with its compliance over the least that any paths could make of it alone:
where the worst case matters, with the twentieth power.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.checks import check_known, check_number
from ccfem.fibre_aware.cases_bound import OBJECTIVES, WORST
from ccfem.fibre_aware.prune import fibre_length, profiles
from ccfem.fibre_aware.shortening import shorten_bent, tight_share
from ccfem.fibre_aware.strand_moves import Judged, kept_radius, moved, stiffest
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.equilibrium import Equilibrium, equilibrium
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.strands import Strands, cut_strands

__all__ = ["case_counts", "cases_judge", "prune_and_move_cases", "prune_cases"]

_POWERS = {WORST: 20.0, "sum": 1.0}
_TOLERANCE = 1e-5


def case_counts(
    weights: FloatArray, bounds: FloatArray, ratios: FloatArray, objective: str
) -> FloatArray:
    """How much each case counts, (n,): the sum is 1.

    Parameters
    ----------
    weights : (n,) array
        Of the cases.
    bounds, ratios : (n,) array
        Stiffness ratio that no paths exceed in each case alone, and that of the paths.
    objective : {"worst", "sum"}
    """
    terms = np.asarray(bounds) / np.asarray(ratios)
    counts = weights * (terms / terms.max()) ** _POWERS[objective]
    return np.asarray(counts / counts.sum())


def prune_cases(
    toolpaths: Toolpaths,
    parts: Sequence[Specimen],
    weights: FloatArray,
    bounds: FloatArray,
    length: float,
    machine: Machine,
    strand: Strand | None = None,
    objective: str = WORST,
    rounds: int = 3,
    tight: float = 1.0,
) -> Toolpaths:
    """Take off the fibre that is least worth in all load cases, until a wanted length is left.

    Each round tests the part under every case, with fibres that carry tension only, and takes off
    an equal part of the excess.

    Parameters
    ----------
    toolpaths : Toolpaths
    parts : sequence of Specimen
        The part without fibre under each case.
    weights : (n,) array
        Of the cases.
    bounds : (n,) array
        Stiffness ratio of each case that no paths exceed.
    length : float, mm
        Largest total length of fibre that remains.
    machine, strand
        As in `prune`.
    objective : {"worst", "sum"}
    rounds : int, default 3
        Tests under every case, at least 1.
    tight : float in [0, 1], default 1
        Largest share of the fibre's length in bends tighter than the machine's radius, as in
        `prune`.

    Returns
    -------
    Toolpaths
        The given ones where they are short enough, and not bent too tightly.

    Raises
    ------
    InputError
        When the length is not positive, `rounds` is below 1, or for an unknown objective.
    """
    check_number("length of fibre", length, above=0.0, unit="mm")
    check_number("rounds", rounds, at_least=1)
    check_known("objective", objective, OBJECTIVES)
    check_number("tight", tight, at_least=0.0, at_most=1.0)
    excess = max(fibre_length(toolpaths) - length, 0.0)
    if not excess and (tight >= 1.0 or tight_share(toolpaths, machine) <= tight):
        return toolpaths
    test = _tests(parts, weights, bounds, strand, objective)
    for k in range(rounds):
        strands = cut_strands(toolpaths, parts[0].unreinforced.mesh)
        tested = test(strands)
        value = np.zeros(len(strands.length))
        for worth, one in zip(tested.worth, tested.found, strict=True):
            value += worth * np.where(one.carries, one.strain, 0.0) ** 2
        wanted = length + excess * (1.0 - (k + 1) / rounds)
        along = profiles(toolpaths, strands, value)
        toolpaths = shorten_bent(toolpaths, along, wanted, machine, tight)
    return toolpaths


def prune_and_move_cases(
    candidates: Sequence[Toolpaths],
    layers: Sequence[Layer],
    parts: Sequence[Specimen],
    weights: FloatArray,
    bounds: FloatArray,
    length: float,
    machine: Machine,
    strand: Strand,
    objective: str = WORST,
    rounds: int = 3,
    moves: int = 0,
    tight: float = 1.0,
) -> Toolpaths:
    """Cut fibre to a length, mm in all, move what is left, and cut what has become longer.

    Of several candidates each is cut, and the one of most value moved. Parameters as of
    `prune_cases` and `ccfem.fibre_aware.strand_moves.moved`.
    """
    alike = (parts, weights, bounds, length, machine, strand, objective)
    judge = cases_judge(parts, weights, bounds, machine, strand, objective)
    kept = stiffest([prune_cases(one, *alike, rounds, tight) for one in candidates], judge)
    radius = kept_radius(machine, tight)
    mesh = parts[0].unreinforced.mesh
    found = moved(kept, layers, mesh, machine, judge, moves, radius=radius)
    return found if found is kept else prune_cases(found, *alike, 1, tight)


def cases_judge(
    parts: Sequence[Specimen],
    weights: FloatArray,
    bounds: FloatArray,
    machine: Machine,
    strand: Strand | None = None,
    objective: str = WORST,
) -> Callable[[Toolpaths], Judged]:
    """Judge of paths by the stiffness in all load cases, with the room that strands need.

    Parameters as of `prune_cases`. The value is the mean of ratio over bound that counts each case
    as `case_counts` does: with the objective "worst" it is near to the worst.
    """
    test = _tests(parts, weights, bounds, strand, objective)
    power = _POWERS[objective]

    def judge(toolpaths: Toolpaths) -> Judged:
        tested = test(cut_strands(toolpaths, parts[0].unreinforced.mesh, machine=machine))
        shares = np.asarray(weights) / np.sum(weights)
        mean = float(shares @ (np.asarray(bounds) / tested.ratios) ** power)
        strains = [one.displacement for one in tested.found]
        return Judged(
            mean ** (-1.0 / power), tuple(zip(tested.worth.tolist(), strains, strict=True))
        )

    return judge


@dataclass(frozen=True)
class _Tested:
    """Tests under all load cases: equilibrium, stiffness ratio, worth of a squared strain."""

    found: tuple[Equilibrium, ...]
    ratios: FloatArray
    worth: FloatArray


def _tests(
    parts: Sequence[Specimen],
    weights: FloatArray,
    bounds: FloatArray,
    strand: Strand | None,
    objective: str,
) -> Callable[[Strands], _Tested]:
    """Test of strands under all load cases, each from where the last one ended."""
    axial = (Strand() if strand is None else strand).stiffness(parts[0].modulus)
    before = np.array([2.0 * part.unreinforced.strain_energy for part in parts])
    pulled = np.array([part.forces.any() for part in parts])
    known: list[tuple[FloatArray, ...]] = [()] * len(parts)

    def test(strands: Strands) -> _Tested:
        found = [
            equilibrium(part, strands, axial, known=near, tolerance=_TOLERANCE)
            for part, near in zip(parts, known, strict=True)
        ]
        known[:] = [(one.displacement,) for one in found]
        work = np.array([_work(part, one) for part, one in zip(parts, found, strict=True)])
        ratios = np.where(pulled, before / work, work / before)
        return _Tested(tuple(found), ratios, case_counts(weights, bounds, ratios, objective) / work)

    return test


def _work(part: Specimen, found: Equilibrium) -> float:
    """Work of the forces, or of the supports that move, N mm: twice the strain energy."""
    u = found.displacement
    if part.forces.any():
        return float(np.vdot(part.forces, u))
    return float(u.reshape(-1) @ (found.matrix @ u.reshape(-1)))
