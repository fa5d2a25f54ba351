"""Force-displacement curves of physical tests."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ccfem.arrays import FloatArray, freeze
from ccfem.errors import InputError
from ccfem.io.whole import text_of

__all__ = ["Curve", "read_curve"]

_LOW, _HIGH = 0.1, 0.4
"""Shares of the peak force between which the stiffness is taken (ISO 6891)."""

_UNITS = {
    "displacement": {"": 1.0, "mm": 1.0, "m": 1e3, "um": 1e-3},
    "force": {"": 1.0, "n": 1.0, "kn": 1e3},
}


@dataclass(frozen=True)
class Curve:
    """A force-displacement curve.

    Attributes
    ----------
    displacement : (k,) array, mm
    force : (k,) array, N
    name : str
        For messages.
    """

    displacement: FloatArray
    force: FloatArray
    name: str = "curve"

    def __post_init__(self) -> None:
        freeze(self, displacement=float, force=float)
        if self.displacement.shape != self.force.shape or self.force.ndim != 1:
            raise InputError(f"{self.name}: expected as many forces as displacements")
        if not (np.isfinite(self.force).all() and np.isfinite(self.displacement).all()):
            raise InputError(f"{self.name}: forces and displacements must be finite numbers")
        if not len(self.force) or not self.force.max() > 0.0:
            raise InputError(
                f"{self.name}: the force never rises above 0; give the loading positive forces"
            )

    @property
    def peak(self) -> float:
        """Largest force, N."""
        return float(self.force.max())

    def slope(self) -> float:
        """Stiffness, N/mm: line through the rising points between 10 and 40 % of the peak.

        These shares, as in ISO 6891, exclude the slack at the start and the yield.

        Raises
        ------
        InputError
            For fewer than three points in that range, or a slope that is not positive.
        """
        rising = np.arange(len(self.force)) <= self.force.argmax()
        used = rising & (self.force >= _LOW * self.peak) & (self.force <= _HIGH * self.peak)
        if used.sum() < 3 or not np.ptp(self.displacement[used]) > 0.0:
            raise InputError(
                f"{self.name}: expected at least 3 rising points between {100 * _LOW:g} and "
                f"{100 * _HIGH:g} % of the peak force; got {used.sum()}: record more points"
            )
        slope = float(np.polyfit(self.displacement[used], self.force[used], 1)[0])
        if not slope > 0.0:
            raise InputError(
                f"{self.name}: the force falls with displacement ({slope:.3g} N/mm): check the "
                "sign of the displacement and the order of the points"
            )
        return slope


def read_curve(path: str | Path) -> Curve:
    """Read a force-displacement curve from a CSV file.

    The first line names the columns: one starts with ``displacement``, one with ``force``; a unit
    may follow (``force [kN]``, ``displacement_mm``): mm, m, um and N, kN; default mm and N. Columns
    are separated by commas, semicolons or tabs; lines that start with ``#`` are left out.

    Raises
    ------
    InputError
        When the file cannot be read, a column is missing, or a value is not a number.
    """
    path = Path(path)
    text = text_of(path, "CSV file")
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if len(lines) < 2:
        raise InputError(f"{path}: expected a line of column names and lines of numbers; got none")
    header = lines[0][1]
    delimiter = max(";\t,", key=header.count)
    rows = list(csv.reader([line for _, line in lines], delimiter=delimiter))
    columns = [_column(rows[0], kind, path) for kind in ("displacement", "force")]
    values = []
    for (number, _), row in zip(lines[1:], rows[1:], strict=True):
        try:
            values.append([scale * float(row[column]) for column, scale in columns])
        except (ValueError, IndexError):
            raise InputError(
                f"{path}, line {number}: expected numbers for displacement and force; got "
                f"'{delimiter.join(row)}': correct or delete the line"
            ) from None
    displacement, force = np.array(values).T
    return Curve(displacement, force, path.name)


def _column(names: list[str], kind: str, path: Path) -> tuple[int, float]:
    """Index of the column of a kind, and the factor from its unit to mm or N."""
    found = [k for k, name in enumerate(names) if name.strip().lower().startswith(kind)]
    if len(found) != 1:
        raise InputError(
            f"{path}: expected one column named {kind}; got {', '.join(names)}: name the columns "
            "displacement and force, with a unit if not mm and N"
        )
    unit = names[found[0]].strip().lower()[len(kind) :].strip(" _[]()/")
    if unit not in _UNITS[kind]:
        known = ", ".join(u for u in _UNITS[kind] if u)
        raise InputError(f"{path}: {kind} has unit '{unit}'; known are {known}: convert it")
    return found[0], _UNITS[kind][unit]
