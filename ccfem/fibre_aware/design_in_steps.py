"""Fields for much fibre, designed for less of it first.

A field that starts as dense as much fibre asks for has strands everywhere, also where nothing is
stretched, and they hold on to each other: no small change of the field turns or thins them, and it
ends up softer than one for less fibre. Where that one has settled there is room for the rest.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.fibre_aware.stream_design import StreamDesign, StreamProblem, design

__all__ = ["designed_in_steps"]

_USUAL = 0.45 * (1.0 + 1e-9)
"""Coverage up to which a field is designed in one step."""

_FIRST = 0.5
"""Share of the room for fibre that is designed for first: that coverage, and a tenth over."""

_THEN = 0.6
"""Evaluations of the second step over those of the first."""


def designed_in_steps(
    problem: StreamProblem,
    start: Callable[[StreamProblem], FloatArray],
    evaluations: int,
    coverage: float,
) -> StreamDesign:
    """Design a field for half of the room, and on from there for much fibre.

    Parameters
    ----------
    problem : StreamProblem
    start : callable
        Coefficients (c,) of the first field for a problem.
    evaluations : int
        Most evaluations of the objective in the first step; where there is another it has 0.6 times
        as many.
    coverage : float
        Share of the layers that is to be covered; the budget is for more, of which some is cut off.
    """
    most = _FIRST * float(problem.room.sum())
    if coverage <= _USUAL or problem.budget <= most:
        return design(problem, start(problem), evaluations)
    less = replace(problem, budget=most)
    first = design(less, start(less), evaluations)
    found = design(problem, first.field, int(np.ceil(_THEN * evaluations)))
    return replace(found, ratios=first.ratios + found.ratios)
