"""Comparison of strategies over several ways to cut a part, all with the same fibre in all."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import count
from typing import NamedTuple

import numpy as np

from ccfem.cases.case import Case
from ccfem.checks import member_name
from ccfem.comparison.judging import Solved, judged
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.slicings import SlicingComparison
from ccfem.comparison.stages import Part, Tell, counted, natural, planned, timed, to_length
from ccfem.errors import InputError
from ccfem.layers.layer import Layer
from ccfem.layers.slicer import Slicer
from ccfem.layers.slicing import from_text
from ccfem.layers.slicing.planar import Planar
from ccfem.planning.strategy import Strategy
from ccfem.progress import Progress
from ccfem.toolpaths import Toolpaths

__all__ = ["Named", "named_slicers", "over_slicings"]

_OWN = ("count", "thickness", "heights")
"""Parameters of flat layers that say how many there are."""


def over_slicings(
    solved: Solved,
    strategies: Mapping[str, Strategy],
    slicings: "Mapping[str, Named]",
    fibre: float | None,
    natural_amounts: bool,
    seconds: dict[str, float],
    progress: Progress,
) -> SlicingComparison:
    """Plan, evaluate and test strategies on several slicings.

    Parameters
    ----------
    solved : Solved
    strategies : mapping of name to Strategy
    slicings : mapping of name to Named
        From `named_slicers`.
    fibre : float, mm, optional
        Length in all; by default the shortest natural one of any run.
    natural_amounts : bool
        Let every strategy lay its own amount instead.
    seconds : dict of stage to float
        Of the stages before.
    progress : callable

    Raises
    ------
    InputError
        Where no slicing can cut the part.
    """
    case = solved.case
    with timed(seconds, "slice"):
        slicers = _as_thick(solved, slicings)
        stacks, refused = _stacks(solved, slicers)
    parts = {name: solved.part(layers, slicer=slicers[name]) for name, layers in stacks.items()}
    tell = counted(progress, 0.1, 4 * len(strategies) * len(parts) + 1)
    bare = [Run(name, each, Toolpaths.empty(), None) for name, each in strategies.items()]
    planned_runs, length = _planned(bare, parts, fibre, natural_amounts, tell)
    found: dict[str, Comparison] = {}
    for name, part in parts.items():
        wanted = None if length is None else length / len(part.layers)
        found[name] = judged(
            solved, part, planned_runs[name], bare, wanted, tell, curve=False, bounded=False
        )
    return SlicingComparison(case, solved.field, found, length, refused, seconds)


class Named(NamedTuple):
    """A slicer, and whether its flat layers are to be as thick as those of the part's own."""

    slicer: Slicer
    as_thick: bool = False


def named_slicers(
    slicings: Mapping[str, Slicer] | Sequence[str | Slicer],
) -> dict[str, Named]:
    """Slicers by name: as they were written, or the name of their module.

    Flat layers named by a text that says nothing of their number are as thick as the layers of the
    part's own slicing are in the mean: one printer lays them all.

    Raises
    ------
    InputError
        For an unknown slicer or parameter, none at all, or one named twice.
    """
    if isinstance(slicings, str) or not slicings:
        raise InputError(
            f"slicings must be a list of at least one, as ['planar:z', 'spatial']; got {slicings!r}"
        )
    if isinstance(slicings, Mapping):
        return {name: Named(slicer) for name, slicer in slicings.items()}
    found: dict[str, Named] = {}
    for each in slicings:
        if isinstance(each, str):
            name, slicer = each.strip(), from_text(each)
            if name in found:
                raise InputError(f"name each slicing once; got '{name}' more than once")
            said = any(f"{own}=" in name for own in _OWN)
            found[name] = Named(slicer, isinstance(slicer, Planar) and not said)
        else:
            name = member_name(each)
            numbers = (f"{name}_{k}" for k in count(2))
            free = name if name not in found else next(n for n in numbers if n not in found)
            found[free] = Named(each)
    return found


def _as_thick(solved: Solved, slicings: Mapping[str, Named]) -> dict[str, Slicer]:
    """Slicers with the thickness of the part's own layers where they take that."""
    if not any(each.as_thick for each in slicings.values()):
        return {name: each.slicer for name, each in slicings.items()}
    own = _own_thickness(solved)
    return {
        name: replace(each.slicer, count=None, thickness=own)  # type: ignore[type-var]
        if each.as_thick
        else each.slicer
        for name, each in slicings.items()
    }


def _own_thickness(solved: Solved) -> float:
    """Mean thickness of the layers of the part's own slicing, mm."""
    case = solved.case
    layers = case.slicing(solved.planned_on, case.build, case.machine)
    return float(np.mean([layer.thickness for layer in layers]))


def _stacks(
    solved: Solved, slicers: Mapping[str, Slicer]
) -> tuple[dict[str, tuple[Layer, ...]], dict[str, str]]:
    """Layers of each slicing, and why others could not cut the part."""
    case: Case = solved.case
    stacks: dict[str, tuple[Layer, ...]] = {}
    refused: dict[str, str] = {}
    for name, slicer in slicers.items():
        try:
            stacks[name] = case.fibre_layers(solved.planned_on, slicer)
        except InputError as error:
            refused[name] = str(error)
    if not any(stacks.values()):
        reasons = "; ".join(f"{name}: {why}" for name, why in refused.items())
        raise InputError(f"no slicing could cut '{case.name}': {reasons}")
    empty = [name for name, layers in stacks.items() if not layers]
    refused |= dict.fromkeys(empty, "it has no layer")
    return {name: layers for name, layers in stacks.items() if layers}, refused


def _planned(
    bare: Sequence[Run],
    parts: Mapping[str, Part],
    fibre: float | None,
    natural_amounts: bool,
    tell: Tell,
) -> tuple[dict[str, list[Run]], float | None]:
    """Plan the runs of each slicing; with them the length in all, mm, that they are held to."""
    if natural_amounts or fibre is not None:
        found = {}
        for name, part in parts.items():
            wanted = None if fibre is None else fibre / len(part.layers)
            found[name] = [planned(run, part, wanted, tell) for run in bare]
        return found, fibre
    own = {name: natural(bare, part, tell) for name, part in parts.items()}
    least = {
        name: runs[setter].length_per_layer * len(parts[name].layers)
        for name, (runs, setter) in own.items()
        if setter is not None
    }
    if not least:
        return {name: list(runs.values()) for name, (runs, _) in own.items()}, None
    first = min(least, key=least.__getitem__)
    found = {}
    for name, (runs, setter) in own.items():
        length = least[first] / len(parts[name].layers)
        found[name] = to_length(runs, setter if name == first else None, length, parts[name], tell)
    return found, least[first]
