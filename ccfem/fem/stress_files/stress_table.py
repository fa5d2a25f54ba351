"""Stress of each element or node from tables (CSV)."""

import csv
import re
from pathlib import Path

import numpy as np

from ccfem.base.errors import InputError, shown
from ccfem.base.whole import text_of
from ccfem.fem.stress_files.stress_data import StressData, component_of, component_order


def table_stress(path: Path) -> StressData:
    """Read a table of stress with one line for each element, or for each node.

    The first line names the columns: ``element`` or ``node``, the number in the mesh, from 0 or
    from 1, every one once in any order; and the six components as ``Sxx [MPa]``, ``S12`` or ``xy``,
    all with the same unit or none. Other columns are left out. Columns are separated by commas,
    semicolons or tabs; lines that start with ``#`` are left out.

    Raises
    ------
    InputError
        When the file cannot be read, a column or a line is missing, or a value is no number.
    """
    lines = {
        number: line
        for number, line in enumerate(text_of(path, "table of stress").splitlines(), 1)
        if line.strip() and not line.startswith("#")
    }
    if len(lines) < 2:
        raise InputError(f"{path}: expected a line of column names and lines of numbers; got none")
    heading = next(iter(lines.values()))
    delimiter = max(";\t,", key=heading.count)
    try:
        titles, *rows = (next(csv.reader([line], delimiter=delimiter)) for line in lines.values())
    except csv.Error as error:
        raise InputError(f"{path} is not a table of comma-separated values: {error}") from None
    names, units = zip(*(_name_and_unit(cell) for cell in titles), strict=True)
    kinds = [name.lower() for name in names if name.lower() in ("element", "node")]
    if len(kinds) != 1:
        raise InputError(f"{path}: expected one column named element or node; got {titles}")
    stressed = [k for k, name in enumerate(names) if component_of(name) >= 0]
    order = component_order([names[k] for k in stressed], f"{path}: the columns")
    given = sorted({units[k] for k in stressed})
    if len(given) > 1:
        raise InputError(f"{path}: the components have units {', '.join(given)}: give them one")
    at = [name.lower() for name in names].index(kinds[0])
    values, numbers = np.empty((len(rows), 6)), np.empty(len(rows), dtype=np.int64)
    for k, (number, row) in enumerate(zip(list(lines)[1:], rows, strict=True)):
        try:
            values[k] = [float(row[stressed[column]]) for column in order]
            numbers[k] = int(row[at])
        except (ValueError, IndexError, OverflowError):
            raise InputError(
                f"{path}, line {number}: expected a whole number and six numbers; got "
                f"{shown(lines[number])}: correct or delete it"
            ) from None
    first = int(numbers.min())
    if first not in (0, 1) or not np.array_equal(np.sort(numbers), first + np.arange(len(numbers))):
        raise InputError(
            f"{path}: expected every {kinds[0]} from 0 or from 1 on, each once; got "
            f"{len(numbers)} lines from {first} to {numbers.max()}: number them as the mesh does"
        )
    values, numbers = values[np.argsort(numbers, kind="stable")], np.sort(numbers)
    if kinds[0] == "node":
        return StressData(None, None, values, None, given[0], nodes=numbers)
    return StressData(None, None, None, values, given[0], cells=numbers)


def _name_and_unit(cell: str) -> tuple[str, str]:
    """Name of a column, and the unit in brackets behind it."""
    found = re.fullmatch(r"\s*(.*?)\s*(?:\[\s*(.*?)\s*\])?\s*", cell)
    assert found is not None
    return found[1], found[2] or ""
