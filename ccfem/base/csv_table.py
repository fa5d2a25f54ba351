"""Tables as CSV, in which no text is taken for a formula by a spreadsheet."""

import csv
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

_FORMULA = re.compile(r"(^|[;\t\r\n])(?=\s*[=+\-@\uff1d\uff0b\uff0d\uff20])|^(?=[\t\r\n])")
"""Where a formula may begin: at the start of a cell, or behind what may separate cells too."""


def write_csv(file: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table with a line of names; what is None or not a number is an empty cell.

    Rows are as long as `columns`; texts go through `as_text`.
    """
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        for row in ([*columns], *rows):
            writer.writerow([_cell(value) for value in row])


def _cell(value: Any) -> Any:
    if value is None or value != value:
        return ""
    return as_text(value) if isinstance(value, str) else value


def as_text(text: str) -> str:
    r"""Text of a cell with an apostrophe wherever a spreadsheet would begin a formula.

    As OWASP advises against "CSV injection"; texts that are numbers stay as they are.

    Examples
    --------
    >>> as_text("=cmd|calc!A0"), as_text("@SUM(1)"), as_text("\tx"), as_text("a;=1")
    ("'=cmd|calc!A0", "'@SUM(1)", "'\tx", "a;'=1")
    >>> as_text("-1.5"), as_text("zigzag"), as_text("+2e3"), as_text("-inf")
    ('-1.5', 'zigzag', '+2e3', '-inf')
    """
    try:
        float(text)
    except ValueError:
        return _FORMULA.sub(lambda match: match[0] + "'", text)
    return text
