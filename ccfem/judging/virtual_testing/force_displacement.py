"""Force-displacement curves of physical tests."""

import csv
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.stats import theilslopes

from ccfem.base.arrays import FloatArray, IntArray, freeze, read_only
from ccfem.base.errors import InputError
from ccfem.base.whole import text_of

_LOW, _HIGH = 0.1, 0.4
"""Shares of the peak force between which the stiffness is taken (ISO 6891)."""
_OFF = 0.25
"""Distance of a row from the line of the others, over the length of the line, that is a mistake:
slack, noise and yield leave a few hundredths."""
_HIGH_PEAK, _STIFF = 2.0, 0.5
"""A peak is a mistake that is so many times any other force, at such a share of the displacement
that the line of the others has there: parts soften, they do not harden."""

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
    lines : (k,) int array
        Lines of the file that the rows come from, for messages; default 1, 2, ...
    """

    displacement: FloatArray
    force: FloatArray
    name: str = "curve"
    lines: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __post_init__(self) -> None:
        freeze(self, displacement=float, force=float)
        given = self.lines if len(self.lines) else np.arange(1, len(self.force) + 1)
        object.__setattr__(self, "lines", read_only(given, int))
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
            For fewer than three points in that range, a row that leaves the curve, or a slope that
            is not positive.
        """
        self._check_peak()
        rising = np.arange(len(self.force)) <= self.force.argmax()
        used = rising & (self.force >= _LOW * self.peak) & (self.force <= _HIGH * self.peak)
        if used.sum() < 3 or not np.ptp(self.displacement[used]) > 0.0:
            raise InputError(
                f"{self.name}: expected at least 3 rising points between {100 * _LOW:g} and "
                f"{100 * _HIGH:g} % of the peak force; got {used.sum()}: record more points"
            )
        rows = np.flatnonzero(used)
        ease, start = _robust_line(self.force[rows], self.displacement[rows])
        gap = np.abs(self.displacement[rows] - start - ease * self.force[rows])
        # Measured by the whole range, since rows may crowd at one of its ends.
        if gap.max() > _OFF * abs(ease) * (_HIGH - _LOW) * self.peak:
            raise InputError(self._off(int(rows[gap.argmax()])))
        slope = float(np.polyfit(self.displacement[used], self.force[used], 1)[0])
        if not slope > 0.0:
            raise InputError(
                f"{self.name}: the force falls with displacement ({slope:.3g} N/mm): check the "
                "sign of the displacement and the order of the points"
            )
        return slope

    def _check_peak(self) -> None:
        """Refuse a peak that lies far above the line of the other rows."""
        row = int(self.force.argmax())
        others = np.delete(np.arange(len(self.force)), row)
        if len(others) < 3 or not self.peak > _HIGH_PEAK * self.force[others].max() > 0.0:
            return
        before = others[: max(int(self.force[others].argmax()) + 1, 3)]
        ease, start = _robust_line(self.force[before], self.displacement[before])
        if self.displacement[row] - start < _STIFF * ease * self.peak:
            raise InputError(self._off(row))

    def _off(self, row: int) -> str:
        """Say that a row leaves the curve."""
        return (
            f"{self.name}, line {self.lines[row]}: {self.displacement[row]:.6g} mm at "
            f"{self.force[row]:.6g} N lies far off the line of the other rows: correct or delete "
            "the line"
        )


def _robust_line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Slope and start of a line that up to a quarter of the points may miss (Theil and Sen)."""
    fitted = theilslopes(y, x) if np.ptp(x) > 0.0 else (0.0, float(np.median(y)))
    return float(fitted[0]), float(fitted[1])


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
    return Curve(displacement, force, path.name, np.array([number for number, _ in lines[1:]]))


def _column(names: list[str], kind: str, path: Path) -> tuple[int, float]:
    """Index of the column of a kind, and the factor from its unit to mm or N."""
    columns = [k for k, name in enumerate(names) if name.strip().lower().startswith(kind)]
    if len(columns) != 1:
        raise InputError(
            f"{path}: expected one column named {kind}; got {', '.join(names)}: name the columns "
            "displacement and force, with a unit if not mm and N"
        )
    unit = names[columns[0]].strip().lower()[len(kind) :].strip(" _[]()/")
    if unit not in _UNITS[kind]:
        known = ", ".join(u for u in _UNITS[kind] if u)
        raise InputError(f"{path}: {kind} has unit '{unit}'; known are {known}: convert it")
    return columns[0], _UNITS[kind][unit]
