"""What an index is: name, unit, formula and range, for tables and their glossaries."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Column:
    """One index of the evaluation.

    Attributes
    ----------
    name : str
        Key in `Evaluation` and header of tables.
    unit : str
        "1" for a pure number.
    formula : str
        What is computed, in one or two sentences.
    range : str
        Values that it can take, which of them are good, and when it is NaN.
    """

    name: str
    unit: str
    formula: str
    range: str
