"""The table of a comparison: one row a strategy, in order of rank, with every index."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ccfem.comparison.headline import headline_values
from ccfem.comparison.runs import Run

if TYPE_CHECKING:
    import pandas as pd


def frame(ranking: Sequence[Run]) -> "pd.DataFrame":
    """Table of all numbers of runs.

    It is a data frame, like that of an evaluation, to be sorted, joined and written.

    Parameters
    ----------
    ranking : sequence of Run
        From the best to the worst.

    Returns
    -------
    DataFrame
        Columns rank (1 is the best), strategy, printable, why_not, failure, fails_in (matrix, fibre
        or interlayer), empty_layers, and every index of the virtual test and of the evaluator; NaN
        where a run has none.
    """
    import pandas as pd

    values = [headline_values(run) for run in ranking]
    names = list(dict.fromkeys(name for row in values for name in row))
    columns = {
        "rank": np.arange(1, len(ranking) + 1),
        "strategy": [run.name for run in ranking],
        "printable": [run.printable for run in ranking],
        "why_not": [run.why_not for run in ranking],
        "failure": [run.failure for run in ranking],
        "fails_in": [run.fails_in for run in ranking],
        "empty_layers": [run.empty_layers for run in ranking],
    }
    numbers = {name: [row.get(name, np.nan) for row in values] for name in names}
    return pd.DataFrame(numbers | columns)[[*columns, *(n for n in names if n not in columns)]]
