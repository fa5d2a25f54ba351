"""Design of fields for much fibre, which starts from a design for less.

A field that starts at high density has strands everywhere, even where nothing is stretched. They
block each other: no small change of the field turns them or thins them out, and the result is
softer than a design for less fibre. Once that design has converged there is room for the rest.
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
"""Share of the room for fibre that is designed for first, with a tenth more as budget."""

_THEN = 0.6
"""Evaluations of the second step, over those of the first."""


def designed_in_steps(
    problem: StreamProblem,
    start: Callable[[StreamProblem], FloatArray],
    evaluations: int,
    coverage: float,
) -> StreamDesign:
    """Design a field for half of the room first, and for much fibre from there.

    Parameters
    ----------
    problem : StreamProblem
    start : callable
        Coefficients (c,) of the first field for a problem.
    evaluations : int
        Largest number of evaluations of the objective in the first step. A second step has 0.6
        times as many.
    coverage : float
        Share of the layers to be covered. The budget is larger, since some fibre is cut off later.
    """
    most = _FIRST * float(problem.room.sum())
    if coverage <= _USUAL or problem.budget <= most:
        return design(problem, start(problem), evaluations)
    less = replace(problem, budget=most)
    first = design(less, start(less), evaluations)
    found = design(problem, first.field, int(np.ceil(_THEN * evaluations)))
    return replace(found, ratios=first.ratios + found.ratios)
