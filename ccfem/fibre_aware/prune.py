"""Taking fibre off where it carries least, until a wanted length is left.

Where a piece of stretched fibre is taken away the compliance grows, to first order, by ``EA eps^2``
per length. The paths are tested with their fibre, the pieces worth least are taken off, and what is
left is tested again, for it takes over the load.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.arrays import BoolArray, FloatArray, IntArray
from ccfem.checks import check_number
from ccfem.elasticity.stress_field import StressField
from ccfem.fibre_aware.path_profile import Profile, least_price
from ccfem.fibre_aware.strength_value import Worth, layer_normal, raised
from ccfem.geometry.polylines import along_line, points_along, runs
from ccfem.machine.machine import Machine
from ccfem.toolpaths import FIBRE, Toolpaths
from ccfem.virtual_testing.equilibrium import equilibrium
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.strands import Strands, cut_strands

__all__ = ["fibre_length", "profiles", "prune", "shorten"]

_STATION = 1.0
"""Length of path, mm, that is kept or taken off as a whole."""

_SAME = 1e-9
"""Distance along a path, mm, within which the middles of two pieces are one."""

_WINDOW = 10
"""Stations over which the least valuable place of a closed path is looked for."""

_TILT = 1e-6
"""Share by which the first piece of the first path is worth more than its strain says, others in
proportion: of equally good pieces the last go first, whatever rounding makes of their values."""

_ENOUGH = 0.95
"""Share of the wanted length below which fibre that is worth less than nothing is kept, too."""

_LOWER_PRICES = (0.999, 0.99, 0.97, 0.93, 0.85)
"""Shares of the price at which room that is left is used: a path may be worth all or nothing."""


def prune(
    toolpaths: Toolpaths,
    part: StressField | Specimen,
    length: float,
    machine: Machine,
    strand: Strand | None = None,
    rounds: int = 2,
    strength: float = 0.0,
) -> Toolpaths:
    """Take the least valuable fibre off until no more than a wanted length is left.

    Paths are planned too long on purpose and pruned: what goes is the fibre that helps least.
    Each round tests the part with fibres that carry tension only, and takes off half of the
    excess, the last one all of it.

    Parameters
    ----------
    toolpaths : Toolpaths
        Of any strategy; paths of other kinds than fibre stay as they are.
    part : StressField or Specimen
        The part without fibres, under the load that counts.
    length : float, mm
        Largest total length of fibre that remains.
    machine : Machine
        Every stretch that remains has its minimum length; shorter paths stay or go as a whole.
    strand : Strand, optional
        Stiffness of a strand; default rho = EA/E = 4 mm^2.
    rounds : int, default 2
        Virtual tests, at least 1.
    strength : float in [0, 1], default 0
        How much the load at first failure counts beside the stiffness
        (`ccfem.fibre_aware.strength_value`).

    Returns
    -------
    Toolpaths
        The given ones where they are short enough.

    Raises
    ------
    InputError
        When the length is not positive, `rounds` is below 1, there is no fibre, or strength
        counts and that of matrix or fibre is not known.
    """
    check_number("length of fibre", length, above=0.0, unit="mm")
    check_number("rounds", rounds, at_least=1)
    laid = fibre_length(toolpaths)
    if laid <= length:
        return toolpaths
    specimen = Specimen.of(part) if isinstance(part, StressField) else part
    axial = (Strand() if strand is None else strand).stiffness(specimen.modulus)
    worth = Worth.of(specimen, strand, strength) if strength else None
    known: tuple[FloatArray, ...] = ()
    for k in range(rounds):
        strands = cut_strands(toolpaths, specimen.unreinforced.mesh)
        found = equilibrium(specimen, strands, axial, known=known, tolerance=1e-5)
        known = (found.displacement,)
        value = np.where(found.carries, found.strain, 0.0) ** 2
        if worth is not None:
            value = worth(strands, found, layer_normal(toolpaths))
        wanted = length if k == rounds - 1 else length + 0.5 * (laid - length)
        before, least = toolpaths, machine.minimum_length
        toolpaths = shorten(before, profiles(before, strands, value), wanted, least)
        if worth is not None and fibre_length(toolpaths) < _ENOUGH * wanted:
            toolpaths = shorten(before, profiles(before, strands, raised(value)), wanted, least)
        laid = fibre_length(toolpaths)
        if laid <= length:
            break
    return toolpaths


def fibre_length(toolpaths: Toolpaths) -> float:
    """Length of all fibre, mm."""
    return float(toolpaths.lengths[toolpaths.kind == FIBRE].sum())


def profiles(toolpaths: Toolpaths, strands: Strands, value: FloatArray) -> list[Profile]:
    """Profiles of the fibre paths.

    Parameters
    ----------
    toolpaths : Toolpaths
    strands : Strands
        Of these toolpaths.
    value : (s,) array
        Of each piece of strand, per length.
    """
    path, begin, end, work = _pieces(strands, value)
    bounds = np.searchsorted(path, np.arange(len(toolpaths) + 1))
    total = toolpaths.lengths
    result = []
    for k in np.flatnonzero((toolpaths.kind == FIBRE) & (total > 0.0)).tolist():
        count = max(int(np.ceil(total[k] / _STATION)), 1)
        step = float(total[k]) / count
        own = slice(bounds[k], bounds[k + 1])
        done = np.cumsum(work[own])
        along = np.concatenate([[0.0], np.stack([begin[own], end[own]], axis=1).ravel()])
        below = np.concatenate([[0.0], np.stack([done - work[own], done], axis=1).ravel()])
        mean = np.diff(np.interp(step * np.arange(count + 1), along, below)) / step
        turn = _least_valuable(mean) if toolpaths.closed[k] else 0
        result.append(Profile(k, np.roll(mean, -turn), step, turn * step))
    return _tilted(result)


def _tilted(along: list[Profile]) -> list[Profile]:
    """Profiles whose values shrink, all together, by a trifle from the first piece to the last."""
    ends = np.cumsum([0, *(len(one.value) for one in along)])
    shares = np.split(1.0 + _TILT * (1.0 - np.arange(ends[-1]) / max(ends[-1], 1)), ends[1:-1])
    return [replace(one, value=one.value * share) for one, share in zip(along, shares, strict=True)]


def _pieces(
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


def shorten(
    toolpaths: Toolpaths,
    along: Sequence[Profile],
    length: float,
    minimum: float,
    cut_cost: float = 20.0,
) -> Toolpaths:
    """Keep the most valuable stretches of fibre paths, at most a wanted length in total.

    Parameters
    ----------
    toolpaths : Toolpaths
    along : sequence of Profile
        Of its fibre paths, from `profiles`.
    length : float, mm
    minimum : float, mm
        Least length of a stretch.
    cut_cost : float, mm, default 20
        See `Profile.kept`.

    Returns
    -------
    Toolpaths
        The price of fibre is the same for all paths, and the smallest that keeps to the length;
        what room it leaves is used path by path at slightly lower prices, by part of what these
        would keep where all of it is too long.
    """
    price = least_price(along, length, minimum, cut_cost)
    chosen = {one.path: one.kept(price, minimum, cut_cost)[0] for one in along}
    room = length - sum(one.step * float(chosen[one.path].sum()) for one in along)
    for factor in _LOWER_PRICES if price > 0.0 else ():
        for one in along:
            before = chosen[one.path]
            longer = one.kept(factor * price, minimum, cut_cost)[0]
            if one.step * (longer.sum() - before.sum()) > room:
                longer = _grown(before, longer, int(room / one.step))
            more = one.step * float(longer.sum() - before.sum())
            if 0.0 < more <= room:
                chosen[one.path] = longer
                room -= more
    return _cut(toolpaths, along, chosen)


def _grown(kept: BoolArray, longer: BoolArray, count: int) -> BoolArray:
    """Kept pieces (n,), and up to so many of a longer choice that follow on from them."""
    grown = kept.copy()
    while count > 0:
        beside = np.concatenate([[False], grown[:-1]]) | np.concatenate([grown[1:], [False]])
        fresh = np.flatnonzero(longer & ~grown & beside)[:count]
        if not len(fresh):
            break
        grown[fresh] = True
        count -= len(fresh)
    return grown


def _cut(toolpaths: Toolpaths, along: Sequence[Profile], chosen: dict[int, BoolArray]) -> Toolpaths:
    """Toolpaths with each profiled path cut to its stretches."""
    profile = {one.path: one for one in along}
    parts: list[FloatArray] = []
    source, closed = [], []
    for k in range(len(toolpaths)):
        own = slice(toolpaths.offsets[k], toolpaths.offsets[k + 1])
        link = toolpaths.link[own, None]
        line = np.hstack([toolpaths.points[own], toolpaths.normals[own], link])
        whole = k not in chosen or bool(chosen[k].all())
        found = [line] if whole else _stretches(line, profile[k], chosen[k], toolpaths.closed[k])
        parts += found
        source += len(found) * [k]
        closed += len(found) * [bool(toolpaths.closed[k]) and whole]
    if not parts:
        return Toolpaths.empty()
    columns = np.concatenate(parts)
    normals = columns[:, 3:6] / np.linalg.norm(columns[:, 3:6], axis=1)[:, None]
    return Toolpaths(
        points=columns[:, :3],
        normals=normals,
        offsets=np.concatenate([[0], np.cumsum([len(part) for part in parts])]),
        layer=toolpaths.layer[source],
        kind=toolpaths.kind[source],
        closed=np.array(closed),
        link=columns[:, 6] > 0.0,
    )


def _stretches(
    line: FloatArray, profile: Profile, keep: BoolArray, closed: bool
) -> list[FloatArray]:
    """Kept stretches of a line (n, 7); those on both sides of the seam of a ring are one."""
    spans = runs(keep)
    if closed and len(spans) > 1 and keep[0] and keep[-1]:
        spans = np.concatenate([spans[1:-1], [[spans[-1, 0], len(keep) + spans[0, 1]]]])
    step, origin = profile.step, profile.origin
    return [_between(line, origin + a * step, origin + b * step) for a, b in spans]


def _between(line: FloatArray, start: float, end: float) -> FloatArray:
    """Part of a line (n, 7) between two arc lengths, which may go on past the end of a ring.

    Columns are the point, its normal, and whether the step to the next point is a link.
    """
    along = along_line(line[:, :3])
    if end > along[-1] * (1.0 + 1e-12):  # on past the seam, at most once round
        line = np.concatenate([line[:-1], line[:-1], line])
        along = np.concatenate([along, along[-1] + along[1:], 2.0 * along[-1] + along[1:]])
    inside = along[(along > start + 1e-9) & (along < end - 1e-9)]
    wanted = np.concatenate([[start], inside, [end]])
    step = np.searchsorted(along, 0.5 * (wanted[1:] + wanted[:-1]), side="right") - 1
    link = np.append(line[step, 6], 0.0)
    return np.column_stack([points_along(line[:, :6], along, wanted), link])
