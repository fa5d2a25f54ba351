"""Pruning: the fibre that carries least is removed until a wanted length is left.

Removing a piece of stretched fibre increases the compliance C_i of each load case, to first order,
by ``EA eps_i^2`` per length. The paths are tested with their fibre under every case and the pieces
worth least, by the sum of ``s_i eps_i^2 / C_i``, are removed. The weight s_i of a case grows with
its compliance over the least compliance that any paths could reach in it alone (`Goal.counts`). The
rest is tested again, since it takes over the load.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_number
from ccfem.fem.elasticity import StressField
from ccfem.judging.virtual_testing import Specimen, Strand, Strands
from ccfem.judging.virtual_testing.strands import whole_strands
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.strategies.fibre_aware.judges import Goal, Judged, equilibria, most_merit
from ccfem.strategies.fibre_aware.path_profile import Profile
from ccfem.strategies.fibre_aware.shortening import shorten_bent, tight_share
from ccfem.strategies.fibre_aware.strength_value import Worth, layer_normal, raised

_TOLERANCE, _LARGE_TOLERANCE = 1e-5, 1e-3
"""Relative residual of the tests, and so the error of the strain that says what fibre is worth; the
second on parts that are not factorised, for the stiffness alone."""

_FASTEST = 0.5
"""Share of the excess that a round removes at least where there is one load case."""

_STATION = 1.0
"""Length of path, mm, that is kept or removed as a whole."""

_SAME = 1e-9
"""Distance along a path, mm, within which the middles of two pieces are the same place."""

_WINDOW = 10
"""Stations over which the value is averaged to find the least valuable place of a closed path."""

_TILT = 1e-6
"""Share by which the value of the first piece of the first path is raised, and of later pieces
proportionally less. Of equally good pieces the last go first, independent of rounding."""

_ENOUGH = 0.95
"""Share of the wanted length below which fibre of negative value is kept too."""


def prune(
    toolpaths: Toolpaths,
    part: StressField | Specimen | Goal,
    length: float,
    machine: Machine,
    strand: Strand | None = None,
    rounds: int = 2,
    strength: float = 0.0,
    tight: float = 1.0,
    least: Judged | None = None,
) -> Toolpaths:
    """Remove the least valuable fibre until no more than a wanted length is left.

    Paths are planned too long on purpose and pruned, so that the fibre that helps least is removed.
    Each round tests the part under every load case with fibres that carry tension only, and removes
    half of the excess, the last round all of it. Under several load cases the rounds remove equal
    parts: fibre of one case may be all that goes in a large step.

    Parameters
    ----------
    toolpaths : Toolpaths
        Of any strategy; paths of other kinds than fibre stay as they are.
    part : StressField, Specimen or Goal
        The part without fibres under the load that counts; for several loads the goal.
    length : float, mm
        Largest total length of fibre that remains.
    machine : Machine
        Every remaining stretch has its minimum length; shorter paths stay or go as a whole.
    strand : Strand, optional
        Stiffness of a strand; default rho = EA/E = 4 mm^2.
    rounds : int, default 2
        Virtual tests under every case, at least 1.
    strength : float in [0, 1], default 0
        Weight of the load at first failure, in the case that fails first, against the stiffness
        (`ccfem.strategies.fibre_aware.strength_value`).
    tight : float in [0, 1], default 1
        Largest share of the fibre's length in bends tighter than the machine's radius. Where the
        paths have more, the least valuable bends go, and pieces that are then too short.
    least : Judged, optional
        Other paths that the result has to be stiffer than, to be wanted.

    Returns
    -------
    Toolpaths
        The given paths where they are short enough and not bent too tightly. None where the other
        paths, or a test, show that no part of the given ones is stiffer (`most_merit`).

    Raises
    ------
    InputError
        When the length is not positive, `rounds` is below 1, there is no fibre, or strength
        counts and that of matrix or fibre is not known.
    """
    check_number("length of fibre", length, above=0.0, unit="mm")
    check_number("rounds", rounds, at_least=1)
    check_number("tight", tight, at_least=0.0, at_most=1.0)
    length_now, goal = fibre_length(toolpaths), Goal.of(part)

    def beaten(strands: Strands, displacements: Sequence[FloatArray]) -> bool:
        about = (goal, strands, length, displacements, strand)
        return least is not None and most_merit(*about) <= least.value

    strands = None
    if least is not None:
        strands = whole_strands(toolpaths, goal.mesh)
        if beaten(strands, least.displacements):
            return Toolpaths.empty()
    if length_now <= length and (tight >= 1.0 or tight_share(toolpaths, machine) <= tight):
        return toolpaths
    known = None
    tolerance = _LARGE_TOLERANCE if goal.prepared else _TOLERANCE
    worth = Worth.of(goal.parts, strand, strength) if strength else None
    for k in range(rounds):
        if k or strands is None:
            strands = whole_strands(toolpaths, goal.mesh)
        tested = equilibria(goal, strands, strand, known, tolerance)
        known, counts = tested.displacements, goal.counts(tested.ratios)
        if beaten(strands, known):
            return Toolpaths.empty()
        if worth is not None:
            value = worth(strands, tested.found, layer_normal(toolpaths), counts)
        else:
            value = np.zeros(len(strands.length))
            for share, equilibrium in zip(counts / tested.work, tested.found, strict=True):
                value += share * equilibrium.carried * equilibrium.strain**2
        share = max(1.0 / (rounds - k), _FASTEST if len(goal.parts) == 1 else 0.0)
        wanted = length + (1.0 - share) * max(length_now - length, 0.0)
        toolpaths = taken_off(toolpaths, strands, value, wanted, machine, tight)
        length_now = fibre_length(toolpaths)
        if length_now <= length:
            break
    return toolpaths


def taken_off(
    toolpaths: Toolpaths,
    strands: Strands,
    value: FloatArray,
    length: float,
    machine: Machine,
    tight: float = 1.0,
) -> Toolpaths:
    """Remove the fibre of least value.

    Fibre of negative value is removed too, unless less than 95 % of the wanted length would remain.

    Parameters
    ----------
    strands : Strands
        Of these toolpaths.
    value : (s,) array
        Of each piece of strand, per length.
    length, machine, tight
        As of `prune`.
    """
    shortened = shorten_bent(toolpaths, profiles(toolpaths, strands, value), length, machine, tight)
    if fibre_length(shortened) >= _ENOUGH * length or not value.min(initial=0.0) < 0.0:
        return shortened
    along = profiles(toolpaths, strands, raised(value))
    return shorten_bent(toolpaths, along, length, machine, tight)


def fibre_length(toolpaths: Toolpaths) -> float:
    """Length of all fibre, mm."""
    return float(toolpaths.lengths[toolpaths.kind == FIBRE].sum())


def profiles(toolpaths: Toolpaths, strands: Strands, value: FloatArray) -> list[Profile]:
    """Profiles of the fibre paths.

    Parameters
    ----------
    strands : Strands
        Of these toolpaths.
    value : (s,) array
        Of each piece of strand, per length.
    """
    path, begin, end, work = _work_along_paths(strands, value)
    bounds = np.searchsorted(path, np.arange(len(toolpaths) + 1))
    total = toolpaths.lengths
    result = []
    for k in np.flatnonzero((toolpaths.kind == FIBRE) & (total > 0.0)).tolist():
        count = max(int(np.ceil(total[k] / _STATION)), 1)
        step = float(total[k]) / count
        span = slice(bounds[k], bounds[k + 1])
        done = np.cumsum(work[span])
        along, below = np.zeros((2, 2 * len(done) + 1))
        along[1::2], along[2::2] = begin[span], end[span]
        below[1::2], below[2::2] = done - work[span], done
        reached = np.interp(step * np.arange(count + 1), along, below)
        mean = (reached[1:] - reached[:-1]) / step
        turn = _least_valuable(mean) if toolpaths.closed[k] else 0
        result.append(Profile(k, np.roll(mean, -turn) if turn else mean, step, turn * step))
    return _tilted(result)


def _tilted(along: list[Profile]) -> list[Profile]:
    """Profiles with values raised by a trifle that falls from the first piece to the last."""
    ends = np.cumsum([0, *(len(profile.value) for profile in along)])
    shares = np.split(1.0 + _TILT * (1.0 - np.arange(ends[-1]) / max(ends[-1], 1)), ends[1:-1])
    return [
        replace(profile, value=profile.value * share)
        for profile, share in zip(along, shares, strict=True)
    ]


def _work_along_paths(
    strands: Strands, value: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Path, arc lengths of both ends, mm, and work of every piece, along the paths.

    A piece on a face of the mesh comes once a cell in `Strands`, and once here.
    """
    order = np.lexsort((strands.arc, strands.path))
    path, arc = strands.path[order], strands.arc[order]
    fresh = np.flatnonzero((np.diff(path) > 0) | (np.diff(arc) > _SAME))
    first = np.concatenate([[0], fresh + 1])[: len(path)]
    length, work = (
        np.add.reduceat(part[order], first) if len(first) else np.zeros(0)
        for part in (strands.length, value * strands.length)
    )
    path, arc = path[first], arc[first]
    return path, arc - 0.5 * length, arc + 0.5 * length, work


def _least_valuable(value: FloatArray) -> int:
    """Piece in the middle of the least valuable window of a closed path."""
    window = min(_WINDOW, len(value))
    total = np.cumsum(np.concatenate([[0.0], value, value[:window]]))
    mean = total[window : window + len(value)] - total[: len(value)]
    least = np.flatnonzero(mean <= mean.min() + _TILT * window * value.max())[0]
    return int((least + window // 2) % len(value))
