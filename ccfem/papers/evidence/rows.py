"""What was measured, row by row, and what is predicted for it: plain arithmetic on tested parts."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

from ccfem.judging.virtual_testing.stiffness_test import RESOLUTION
from ccfem.judging.virtual_testing.strand import RHO

STIFFNESS, BREAKING = "stiffness ratio", "ratio of breaking loads"
SLOPE, LOAD = "slope, kN/mm", "breaking load, kN"
ORDER = "stiffness and breaking load"
"""Kind of a row of which only the order is known."""

NONE = "none"
"""Print without fibre."""

_DESIGNS = (("zigzag", NONE), ("authors", NONE), ("authors", "zigzag"))
_NAMES = {"authors": "authors'", NONE: "no fibre"}
_MEASURED = {
    STIFFNESS: "stiffness",
    BREAKING: "breaking load",
    SLOPE: SLOPE,
    LOAD: LOAD,
    ORDER: "stiffness and load",
}


@dataclass(frozen=True)
class Row:
    """One measured value of a paper."""

    # What was tested, and which print of it.
    part: str
    specimen: str
    # Print that it is divided by, of that part; "" where the value is absolute.
    over: str
    over_part: str
    # `STIFFNESS`, `BREAKING`, `SLOPE`, `LOAD` or `ORDER`; "" where nothing can be predicted
    kind: str
    measured: float  # NaN where the text gives the order alone, or a sentence (`quantity`)
    # Where it stands, and what else is published.
    paper: str
    source: str
    published: str
    tests: int  # specimens of each print
    ours: bool = False  # whether a plan of ccfem stands for paths that were not published
    # Part whose print without fibre gives the matrix of an absolute value, and whose solid gives
    # the strength of a strand.
    scale: str = ""
    counted: bool = True  # whether medians and orders count it
    why: str = ""  # why it is not predicted
    remark: str = ""
    text: str = ""

    @property
    def quantity(self) -> str:
        """What was measured, in words."""
        if self.text:
            return self.text
        first = _NAMES.get(self.specimen, self.specimen)
        if not self.over:
            return f"{_MEASURED[self.kind]}, {first}"
        if self.over_part != self.part:
            return f"{_MEASURED[self.kind]}, {first} / {self.over_part}"
        return f"{_MEASURED[self.kind]}, {first} / {_NAMES.get(self.over, self.over)}"

    @property
    def rests_on(self) -> str:
        """What the prediction takes from elsewhere."""
        if not self.kind:
            return ""
        if self.part == "bending beam":
            return "moduli of the paper's table 5"
        if self.part == "cuboid, pushed":
            return "the tensile test of the same cuboid"
        if NONE == self.specimen == self.over:
            return "nothing: elasticity alone"
        if not self.scale:
            return f"rho {RHO:g} mm^2"
        matrix = "E" if self.kind == SLOPE else "strength of the matrix"
        given = f"rho {RHO:g} mm^2; {matrix} of {self.scale} without fibre"
        if self.kind == SLOPE or self.specimen == NONE:
            return given
        return f"{given}; strength of a strand of the {SOLIDS[self.scale]}"

    @property
    def two_designs(self) -> bool:
        """Whether two fibre plans of one part are compared, so that their order is a prediction."""
        named = (self.specimen, self.over)
        return bool(self.over) and NONE not in named and "stiffest" not in named


@dataclass(frozen=True)
class _Specimens:
    """Prints of one part, as the file has them: slopes, kN/mm, and breaking loads, kN, by print."""

    part: str
    paper: str
    source: str
    published: str
    tests: int
    slope: Mapping[str, float]
    load: Mapping[str, float]
    ours: Sequence[str] = ()
    scale: str = ""
    why: str = ""

    def rows(self) -> Iterator[Row]:
        """Ratios of slopes and of loads, then slopes and loads themselves."""
        for kind, measured in ((STIFFNESS, self.slope), (BREAKING, self.load)):
            scale = self.scale if kind == BREAKING else ""
            for first, second in _DESIGNS:
                yield self._row(kind, first, measured[first] / measured[second], scale, second)
        for kind, measured in ((SLOPE, self.slope), (LOAD, self.load)):
            for name, value in measured.items():
                yield self._row(kind, name, value, self.scale)

    def _row(self, kind: str, name: str, measured: float, scale: str, over: str = "") -> Row:
        return Row(
            part=self.part,
            specimen=name,
            over=over,
            over_part=self.part if over else "",
            kind=kind,
            measured=measured,
            paper=self.paper,
            source=self.source,
            published=self.published,
            tests=self.tests,
            ours=bool({name, over} & set(self.ours)),
            scale=scale,
            why=self.why,
        )


@cache
def rows() -> tuple[Row, ...]:
    """All rows of ``published.toml``, in its order."""
    text = Path(__file__).with_name("published.toml").read_text(encoding="utf-8")
    groups = tomllib.loads(text)
    made = [row for group in groups["specimens"] for row in _Specimens(**group).rows()]
    for entry in (*groups["ratio"], *groups["order"]):
        given = dict(entry)
        given["specimen"] = given.pop("print")
        given.setdefault("over_part", given["part"])
        made.append(Row(**{"measured": np.nan, **given}))
    for entry in groups["absent"]:
        given = dict(entry)
        given["text"] = given.pop("quantity")
        empty = {"specimen": "", "over": "", "over_part": "", "kind": "", "measured": np.nan}
        empty["published"] = "nothing to compute from"
        made.append(Row(**{**empty, **given}))
    return tuple(made)


def measured_of(part: str, specimen: str, kind: str) -> float:
    """Measured slope, kN/mm, or load, kN, of a print."""
    (value,) = (
        row.measured
        for row in rows()
        if (row.part, row.specimen, row.kind, row.over) == (part, specimen, kind, "")
    )
    return value


@dataclass(frozen=True)
class PartResult:
    """A part under its load, as predicted."""

    # by print, N/mm: stiffness in a matrix of one modulus.
    # The first is the prediction; the others span its interval.
    readings: tuple[Mapping[str, float], ...]
    # by print: ratio to the stiffness without fibre at some rho, mm^2
    by_rho: Mapping[str, Mapping[float, float]] | None = None
    # Peak of the averaged von Mises stress without fibre, MPa a N of load.
    matrix_index: float = np.nan
    # by print: highest force in a strand, averaged over 5 mm, N a N of load
    strand_force: Mapping[str, float] | None = None


@dataclass(frozen=True)
class Prediction:
    """Predicted value of a row, within an interval.

    `left_out` is the value at rho fitted to other parts, `stiffness` a ratio of breaking loads by
    the stiffness alone.
    """

    value: float
    low: float
    high: float
    left_out: float = np.nan
    stiffness: float = np.nan


def predicted(row: Row, tests: Mapping[str, PartResult]) -> Prediction:
    """Predict a row from the parts that it needs (`parts_of`)."""
    tested = tests[row.part]
    values = np.array([_value(row, tests, reading) for reading in tested.readings])
    left_out = stiffness = np.nan
    if row.over_part == row.part and row.part in SOLIDS:
        rho = fitted_rho(_other_solid(row.part), tests)
        names = (NONE, row.specimen, row.over)
        left_out = _value(row, tests, {name: ratio_at(rho, name, tested) for name in names})
    if row.kind == BREAKING:
        stiffness = _stiffness_ratio(row, tests, tested.readings[0])
    return Prediction(
        float(values[0]), float(values.min()), float(values.max()), left_out, stiffness
    )


def _stiffness_ratio(
    row: Row, tests: Mapping[str, PartResult], stiffness: Mapping[str, float]
) -> float:
    """Stiffness of the print of a row over that of the other; `stiffness` of those of its part."""
    same = row.over_part == row.part
    other = stiffness if same else tests[row.over_part].readings[0]
    return stiffness[row.specimen] / other[row.over]


def _value(row: Row, tests: Mapping[str, PartResult], stiffness: Mapping[str, float]) -> float:
    """Predict a row with one of the readings of the stiffness of its part."""
    if row.kind == LOAD:
        return _load(row, row.specimen, tests, stiffness)
    if row.kind == BREAKING and row.scale:
        over = _load(row, row.over, tests, stiffness)
        return _load(row, row.specimen, tests, stiffness) / over
    if row.over:
        return _stiffness_ratio(row, tests, stiffness)
    bare = tests[row.scale].readings[0][NONE]
    return stiffness[row.specimen] * measured_of(row.scale, NONE, SLOPE) / bare


def _load(
    row: Row, specimen: str, tests: Mapping[str, PartResult], stiffness: Mapping[str, float]
) -> float:
    """Predict the breaking load, kN, of a print of the part of a row.

    Without fibre a part breaks at the matrix stress at which the other one did; with fibre the load
    grows as the stiffness does, until a strand carries the force at which those of the other solid
    broke. Both forces are those at the default rho.
    """
    tested, scale = tests[row.part], tests[row.scale]
    bare = measured_of(row.scale, NONE, LOAD) * scale.matrix_index / tested.matrix_index
    grown = bare * stiffness[specimen] / stiffness[NONE]
    force = (tested.strand_force or {}).get(specimen, 0.0)
    return min(grown, 1e-3 * strand_strength(row.part, tests) / force) if force else grown


def strand_strength(part: str, tests: Mapping[str, PartResult]) -> float:
    """Highest force, N, that a strand of the other solid carried in its prints when they broke.

    Only prints whose paths are published count. Infinite where no force is known.
    """
    forces = [
        1e3 * row.measured * (tests[row.part].strand_force or {}).get(row.specimen, 0.0)
        for row in rows()
        if row.part in _other_solid(part) and row.kind == LOAD and not row.ours
    ]
    return max(forces) or np.inf


def _other_solid(part: str) -> list[str]:
    """Parts of the solid that is not that of a part."""
    return [other for other in FITTED if SOLIDS[other] != SOLIDS[part]]


def parts_of(row: Row) -> tuple[str, ...]:
    """Parts that have to be tested for a row."""
    fitted = row.over_part == row.part or row.kind == LOAD
    others = FITTED if fitted and row.part in SOLIDS else ()
    named = (row.part, row.over_part, row.scale, *others)
    return tuple(dict.fromkeys(name for name in named if name))


# The one parameter of the ratios, fitted to all solids but the one that is predicted.


SOLIDS = {"Loop": "Loop", "Shell, pulled": "Shell", "Shell, pushed": "Shell"}
"""Solid of each part by which rho can be fitted."""

FITTED = tuple(SOLIDS)


def ratio_at(rho: float, specimen: str, tested: PartResult) -> float:
    """Stiffness ratio of a print at a rho, mm^2, through those that were tested."""
    if specimen == NONE:
        return 1.0
    assert tested.by_rho is not None
    known = np.array(sorted(tested.by_rho[specimen].items()))
    curve = np.polyfit(np.log(known[:, 0]), np.log(known[:, 1]), len(known) - 1)
    return float(np.exp(np.polyval(curve, np.log(rho))))


def fitted_rho(parts: Sequence[str], tests: Mapping[str, PartResult]) -> float:
    """Fit rho, mm^2, to slopes over those without fibre, by least squares of their logarithms.

    Only prints whose paths are published count.
    """
    return _least_misfit(
        [
            row
            for row in rows()
            if row.part in parts and row.kind == STIFFNESS and row.over == NONE != row.specimen
            if not row.ours
        ],
        tests,
    )


def calibrated(part: str, tests: Mapping[str, PartResult]) -> tuple[float, float]:
    """Fit rho, mm^2, to the zigzag of a part alone; it, and the ratio of the authors' paths."""
    used = [row for row in rows() if (row.part, row.kind) == (part, STIFFNESS)]
    rho = _least_misfit([r for r in used if (r.specimen, r.over) == ("zigzag", NONE)], tests)
    return rho, ratio_at(rho, "authors", tests[part])


def _least_misfit(used: Sequence[Row], tests: Mapping[str, PartResult]) -> float:
    """Rho, mm^2, with which the ratios of some rows are met best."""

    def misfit(rho: float) -> float:
        off = [np.log(ratio_at(rho, r.specimen, tests[r.part]) / r.measured) for r in used]
        return float(np.square(off).sum())

    return float(minimize_scalar(misfit, bounds=(2.0, 8.0), method="bounded").x)


# Errors, orders, medians.


def error(row: Row, value: float) -> float:
    """Predicted over measured, less 1, in %; NaN where no number was measured."""
    return 100.0 * (value / row.measured - 1.0)


def order(row: Row, prediction: Prediction) -> str:
    """Say whether two designs are predicted in the order that was measured; "" for other rows.

    "tie": predicted stiffnesses closer to each other than the resolution of the virtual test.
    """
    if not row.two_designs:
        return ""
    first_ahead = True if np.isnan(row.measured) else row.measured > 1.0
    if abs(prediction.value - 1.0) < RESOLUTION:
        return "tie"
    return "right" if (prediction.value > 1.0) == first_ahead else "wrong"


@dataclass(frozen=True)
class Summary:
    """Errors of all rows that count, in % of the measured value."""

    # By kind; those with paths of ours under the kind and ", ours too"
    errors: Mapping[str, tuple[float, ...]]
    # by verdict: pairs of designs whose order is "right", "wrong" or a "tie"
    orders: Mapping[str, tuple[Row, ...]]
    left_out: Mapping[str, tuple[float, ...]]  # by kind: errors with rho fitted to the other solids
    stiffness: tuple[float, ...]  # errors of ratios of breaking loads by the stiffness alone

    def median(self, kind: str) -> float:
        """Median of the sizes of the errors of a kind, %; NaN without any."""
        return median_size(self.errors.get(kind, ()))

    def median_left_out(self, kind: str) -> float:
        """Median with rho fitted to the other solids, %."""
        return median_size(self.left_out.get(kind, ()))


def median_size(errors: Sequence[float]) -> float:
    """Median of the sizes of errors; NaN without any."""
    return float(np.median(np.abs(errors))) if errors else np.nan


ALSO_OURS = ", ours too"
"""Behind the name of a kind: with prints for which a plan of ccfem stands."""


def summary(judged: Mapping[Row, Prediction]) -> Summary:
    """Sum up the rows that are predicted."""
    errors: dict[str, list[float]] = {}
    left_out: dict[str, list[float]] = {}
    stiffness: list[float] = []
    orders: dict[str, list[Row]] = {"right": [], "wrong": [], "tie": []}
    for row, prediction in judged.items():
        if not row.counted:
            continue
        verdict = order(row, prediction)
        if verdict:
            orders[verdict].append(row)
        if row.kind == ORDER:
            continue
        off = error(row, prediction.value)
        errors.setdefault(row.kind + ALSO_OURS, []).append(off)
        if not row.ours:
            errors.setdefault(row.kind, []).append(off)
            if row.kind == BREAKING:
                stiffness.append(error(row, prediction.stiffness))
            if not np.isnan(prediction.left_out):
                without = error(row, prediction.left_out)
                left_out.setdefault(row.kind, []).append(without)
    return Summary(
        {kind: tuple(values) for kind, values in errors.items()},
        {verdict: tuple(pairs) for verdict, pairs in orders.items()},
        {kind: tuple(values) for kind, values in left_out.items()},
        tuple(stiffness),
    )
