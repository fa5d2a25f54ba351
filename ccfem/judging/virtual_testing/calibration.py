"""Calibration: modulus, strength and strand stiffness from force-displacement curves.

A test of the part printed without fibre gives Young's modulus and the strength of the matrix; one
more, of the same part printed with known fibre paths, gives rho = EA/E of a strand. Handbook
values are far off for printed parts, which deflect a lot and are not solid.
"""

import csv
import json
import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.optimize import brentq
from scipy.stats import theilslopes

from ccfem.base.arrays import FloatArray, IntArray, freeze, read_only
from ccfem.base.checks import MODULUS, STRENGTH
from ccfem.base.errors import InputError
from ccfem.base.toml import from_table, read_toml
from ccfem.base.whole import existing_file, text_of, whole_file
from ccfem.fem.elasticity import Problem, StressField, solve
from ccfem.fem.materials import Material, isotropic
from ccfem.judging.virtual_testing.equilibrium import TENSION
from ccfem.judging.virtual_testing.failure_laws.matrix import matrix_peak
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.paths.toolpaths import Toolpaths

# Force-displacement curves of physical tests.


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


_RANGE = (1e-3, 1e3)
"""Values of rho, mm^2, that are tried."""


@dataclass(frozen=True)
class Calibration:
    """What the tests of one part say about matrix and strand.

    Attributes
    ----------
    modulus : float, MPa
        Young's modulus of the printed matrix.
    poisson : float
        As assumed for the calibration.
    tensile_strength : float, MPa
        Of the matrix: von Mises stress, averaged over a ball, at which the part without fibre
        failed.
    rho : float or None, mm^2
        EA of a strand over the modulus; None without a reinforced test.
    source : str
        Which tests the numbers come from.
    """

    name: str
    modulus: float
    poisson: float
    tensile_strength: float
    rho: float | None = None
    source: str = ""

    @property
    def material(self) -> Material:
        """The matrix."""
        return isotropic(
            self.modulus, self.poisson, self.name, self.tensile_strength, source=self.source
        )

    def strand(self, default: Strand | None = None) -> Strand:
        """Return the strand: `default` (rho = 4) with the calibrated rho, where there is one."""
        default = default or Strand()
        return default if self.rho is None else replace(default, rho=self.rho)

    def write(self, path: str | Path) -> None:
        """Write a material file (TOML) that `read_calibration` reads."""
        lines = ["# Material calibrated on printed parts. Units: mm, N, MPa."]
        for key, value in vars(self).items():
            if value is not None:
                # JSON writes strings and numbers as TOML does, but for the delete character.
                text = json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
                lines.append(f"{key} = {text}")
        with whole_file(path) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def calibrate(
    problem: Problem,
    unreinforced: Curve,
    reinforced: Curve | None = None,
    toolpaths: Toolpaths | None = None,
    case: str | None = None,
    name: str = "calibrated",
) -> Calibration:
    """Fit matrix and strand to tests of one part, with fibres that carry tension only.

    Parameters
    ----------
    problem : Problem
        The part as tested; its modulus is only a starting point, its Poisson's ratio is kept. The
        material must be isotropic and the same everywhere.
    unreinforced : Curve
        Of the part without fibre. The displacement is taken as that of the load.
    reinforced : Curve, optional
        Of the same part with fibres.
    toolpaths : Toolpaths, optional
        Fibres in the reinforced part.
    case : str, optional
        Load case that stands for the test; needed where there are several.
    name : str
        Name of the material.

    Raises
    ------
    InputError
        For curves that do not suit each other or the part, rows that leave their curve, and values
        that no printed material has.
    """
    if (reinforced is None) != (toolpaths is None):
        raise InputError(
            "a reinforced test needs both its curve and its toolpaths; got only one of them"
        )
    slope = unreinforced.slope()
    stiffer = None if reinforced is None else reinforced.slope()
    field = _field(problem, case)
    specimen = Specimen.of(field)
    poisson = _poisson(problem)
    computed = specimen.stiffness(field.displacement, field.strain_energy)
    index, _ = matrix_peak(field)
    source = f"{unreinforced.name}: {slope:.4g} N/mm, peak {unreinforced.peak:.4g} N"
    result = Calibration(
        name=name,
        modulus=specimen.modulus * slope / computed,
        poisson=poisson,
        tensile_strength=index * unreinforced.peak / specimen.force(field.reactions),
        source=source,
    )
    for what, value, sizes in (
        ("modulus", result.modulus, MODULUS),
        ("strength", result.tensile_strength, STRENGTH),
    ):
        doubt = sizes.about(f"the {what} that follows", value)
        if doubt:
            raise InputError(
                f"{unreinforced.name}: {doubt.partition(': ')[0]}: check the units of the curve, "
                "mm and N unless its first line names others, and that the part is the tested one"
            )
    if reinforced is None or toolpaths is None or stiffer is None:
        return result
    rho = _fit_rho(specimen, toolpaths, stiffer / slope, reinforced.name)
    return replace(result, rho=rho, source=f"{source}; {reinforced.name}: {stiffer:.4g} N/mm")


def _field(problem: Problem, case: str | None) -> StressField:
    """Solution of the load case that stands for the test."""
    if case is None and len(problem.loads) == 1:
        case = next(iter(problem.loads))
    if case is None or case not in problem.loads:
        raise InputError(
            f"expected the load case of the test; got {case}: name one of "
            f"{', '.join(problem.loads)}"
        )
    alone = replace(problem, loads={case: problem.loads[case]}, combinations={})
    return solve(alone)[case]


def _poisson(problem: Problem) -> float:
    """Poisson's ratio of an isotropic part."""
    stiffness = problem.material.stiffness
    compliance = np.linalg.inv(stiffness)
    poisson = float(-compliance[0, 1] / compliance[0, 0])
    expected = isotropic(1.0 / compliance[0, 0], poisson).stiffness
    if (
        problem.stiffness is not None
        or problem.density is not None
        or not np.allclose(stiffness, expected, rtol=1e-6, atol=1e-6 * expected.max())
    ):
        raise InputError(
            "calibration fits one isotropic modulus; the part has an anisotropic or varying "
            "material: calibrate with an isotropic one"
        )
    return round(poisson, 12)


def _fit_rho(specimen: Specimen, toolpaths: Toolpaths, wanted: float, name: str) -> float:
    """Value of rho, mm^2, at which the virtual test gives the wanted stiffness ratio."""
    if not wanted > 1.0:
        raise InputError(
            f"{name}: the part with fibre is not stiffer than the one without ({wanted:.3g} times "
            "as stiff): check that the curves are not swapped and were measured alike"
        )
    strands = cut_strands(toolpaths, specimen.unreinforced.mesh)

    def excess(logarithm: float) -> float:
        strand = Strand(rho=math.exp(logarithm))
        return math.log(virtual_test(strands, specimen, strand, TENSION, span=()).ratio / wanted)

    # The ratio rises with rho: half of the range drops out by one test at the usual value.
    low, high = (math.log(rho) for rho in _RANGE)
    at = math.log(4.0)
    if excess(at) > 0.0:
        high = at
    else:
        low = at
    ends = excess(low), excess(high)
    if not ends[0] <= 0.0 <= ends[1]:
        raise InputError(
            f"{name}: no strand between rho = {_RANGE[0]:g} and {_RANGE[1]:g} mm^2 makes the part "
            f"{wanted:.3g} times as stiff: check that the toolpaths are those of the print"
        )
    return float(math.exp(brentq(excess, low, high, xtol=1e-4)))


def read_calibration(path: str | Path) -> Calibration:
    """Read a material file that `Calibration.write` wrote.

    Raises
    ------
    InputError
        When the file cannot be read, or its values are not those of a calibration.
    """
    path = existing_file(path, "material file")
    try:
        values = {"name": path.stem, **read_toml(path, "material file")}
        return from_table(Calibration, values, "material")
    except InputError as error:
        raise InputError(
            f"expected a material file at {path}; it cannot be read: {error}: write it by ccfem "
            "calibrate"
        ) from None
