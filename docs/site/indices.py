"""Page of the indices: formula and range of every column of a comparison."""

from table import table

from ccfem.comparison.headline import TEST_COLUMNS
from ccfem.judging.evaluation import COLUMNS

__all__ = ["indices_page"]

_HEAD = """# Indices

Every column of `results.csv` and of `Comparison.frame`: unit, formula, range. "1" stands for a pure
number.

"""


def indices_page() -> str:
    """Write the tables of the evaluation and of the virtual test."""
    return (
        f"{_HEAD}## Of the paths\n\n{_table(COLUMNS)}## Of the virtual test\n\n"
        f"{_table(TEST_COLUMNS)}"
    )


def _table(columns: tuple) -> str:
    rows = [(f"`{each.name}`", each.unit, each.formula, each.range) for each in columns]
    return table(("column", "unit", "formula", "range"), rows)
