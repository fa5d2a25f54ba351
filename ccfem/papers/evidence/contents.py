"""Table, figure and summary of every published test beside its prediction."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.base.csv_table import write_csv
from ccfem.base.progress import Progress, silent
from ccfem.judging.virtual_testing.strand import STRENGTH
from ccfem.judging.virtual_testing.strands import AVERAGING_LENGTH
from ccfem.papers.contents import (
    Contents,
    claim_table,
    drawn_of,
    judged,
    table,
    write_claims,
    write_figures,
    write_report,
)
from ccfem.papers.evidence import rows
from ccfem.papers.evidence.prints import PARTS, parts_tested

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXPECTED = Path(__file__).with_name("expected.toml")
"""What the table was to reach, and figures of an independent program that it has to meet."""

BAND = 10.0
"""Half the band about the measured value that the figure shows, %."""


@dataclass(frozen=True)
class Study:
    """Parts, each tested when it is first asked for."""

    tests: Mapping[str, rows.PartResult]

    @staticmethod
    def missing(row: rows.Row) -> tuple[str, ...]:
        """Environment variables that a row needs and that are not set."""
        needed = [PARTS[part].missing for part in rows.parts_of(row) if part in PARTS]
        return tuple(dict.fromkeys(name for names in needed for name in names))

    @cached_property
    def predictions(self) -> Mapping[rows.Row, rows.Prediction]:
        """Predictions of all rows that can be computed here."""
        return {
            row: rows.predicted(row, self.tests)
            for row in rows.rows()
            if not row.why and not self.missing(row)
        }

    @cached_property
    def summary(self) -> rows.Summary:
        """Errors and orders of all."""
        return rows.summary(self.predictions)

    def status(self, row: rows.Row) -> str:
        """How a row came about, or why it is empty."""
        if row.why:
            return f"not computed: {row.why}"
        if self.missing(row):
            return f"not run: set {', '.join(self.missing(row))}"
        if row.specimen == rows.NONE:
            return "no fibre"
        rebuilt = "rebuilt" if row.published == "a drawing" else "theirs"
        paths = "ours" if row.ours else rebuilt
        return paths if row.counted else f"{paths}, not counted"


# Tables.


_COLUMNS = (
    *("part", "quantity", "kind", "paper", "source", "specimens", "published", "measured"),
    *("predicted", "low", "high", "error %", "rho fitted to the other solid", "order"),
    *("status", "rests on", "remark"),
)


def write_evidence(study: Study, file: Path) -> None:
    """Write all rows, those that are not computed too, as CSV."""
    lines = []
    for row in rows.rows():
        made = study.predictions.get(row)
        about = (row.part, row.quantity, row.kind, row.paper, row.source, row.tests, row.published)
        values: tuple[Any, ...] = (None,) * 6
        if made is not None:
            off = rows.error(row, made.value)
            values = (made.value, made.low, made.high, off, made.left_out, rows.order(row, made))
        lines.append((*about, row.measured, *values, study.status(row), row.rests_on, row.remark))
    write_csv(file, _COLUMNS, lines)


def _number(value: float) -> str:
    return "" if np.isnan(value) else f"{value:#.3g}"


def _predicted_cell(made: rows.Prediction) -> str:
    """Predicted value, with its interval where it has one."""
    text = _number(made.value)
    if made.high - made.low < 0.005 * made.value:
        return text
    return f"{text} ({_number(made.low)} to {_number(made.high)})"


def pairs_table(study: Study) -> str:
    """Rows that are predicted, or would be with their data: for the screen and the page."""
    head = ("part", "quantity", "measured", "predicted", "error %", "order", "paths")
    lines = []
    for row in rows.rows():
        if row.why:
            continue
        made = study.predictions.get(row)
        measured = "more" if row.kind == rows.ORDER else _number(row.measured)
        if made is None:
            lines.append((row.part, row.quantity, measured, "", "", "", study.status(row)))
            continue
        off = "" if row.kind == rows.ORDER else f"{rows.error(row, made.value):+.0f}"
        cells = (_predicted_cell(made), off, rows.order(row, made), study.status(row))
        lines.append((row.part, row.quantity, measured, *cells))
    return _aligned(head, lines)


def _aligned(head: tuple[str, ...], lines: Sequence[tuple[str, ...]]) -> str:
    """Table in Markdown that reads well on the screen too."""
    widths = [max(len(line[k]) for line in (head, *lines)) for k in range(len(head))]

    def padded(line: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(cell.ljust(width) for cell, width in zip(line, widths, strict=True))

    return table(padded(head), [padded(line) for line in lines])


def absent_table() -> str:
    """Write what was measured and cannot be predicted."""
    head = ("paper", "part", "measured", "source", "why not")
    lines = []
    for row in rows.rows():
        if row.why:
            number = "" if np.isnan(row.measured) else f": {row.measured:.3g}"
            lines.append((row.paper, row.part, row.quantity + number, row.source, row.why))
    return table(head, lines)


def basis_table() -> str:
    """Write the source, specimens, what is published and what was taken from where, row by row."""
    head = ("part", "quantity", "paper", "source", "specimens", "published", "rests on", "remark")
    lines = []
    for row in rows.rows():
        if not row.why:
            about = (row.part, row.quantity, row.paper, row.source, str(row.tests), row.published)
            lines.append((*about, row.rests_on, row.remark))
    return table(head, lines)


def left_out_table(study: Study) -> str:
    """Ratios of the solids by which rho can be fitted, at a rho fitted without them."""
    lines = []
    for row, made in study.predictions.items():
        if np.isnan(made.left_out):
            continue
        lines.append(
            (
                row.part,
                row.quantity,
                f"{row.measured:.3g}",
                f"{made.value:.3g} ({rows.error(row, made.value):+.0f} %)",
                f"{made.left_out:.3g} ({rows.error(row, made.left_out):+.0f} %)",
            )
        )
    return table(("part", "quantity", "measured", "rho 4", "rho of the other solid"), lines)


def calibrated_table(study: Study) -> str:
    """Gain of the authors' paths, with rho fitted to the zigzag of the same part."""
    lines = []
    for part in rows.FITTED:
        paths = next(
            r for r in rows.rows() if (r.part, r.specimen, r.kind) == (part, "authors", rows.SLOPE)
        )
        if paths.ours or study.missing(paths):
            continue
        rho, ratio = rows.calibrated(part, study.tests)
        measured = paths.measured / rows.measured_of(part, rows.NONE, rows.SLOPE)
        off = 100.0 * (ratio / measured - 1.0)
        lines.append((part, f"{rho:.2f}", f"{measured:.3g}", f"{ratio:.3g} ({off:+.0f} %)"))
    head = ("part", "rho, mm^2", "stiffness, authors' / no fibre, measured", "predicted")
    return table(head, lines)


def force_table(study: Study) -> str:
    """Averaged force in a strand at the load at which each print of Chen et al. broke."""
    lines = []
    for part in rows.FITTED:
        if PARTS[part].missing:
            continue
        for name, force in (study.tests[part].strand_force or {}).items():
            load = 1000.0 * rows.measured_of(part, name, rows.LOAD)
            lines.append((part, name, f"{1e-3 * load:.3f}", f"{force * load:.0f}"))
    shown = table(("part", "print", "broke at, kN", "highest strand force then, N"), lines)
    return f"""{shown}
Averaged over {AVERAGING_LENGTH:g} mm of strand. On cells with midside nodes these figures change by
3 % at most, those of single pieces by 23 %. The strength of a strand in the virtual test,
{STRENGTH:g} N, is the highest of them. Parts in which something else fails first stay below it:
layers of the Loop's zigzag came apart, and the pushed Shell hardly stretches fibre.
"""


def quantities(study: Study) -> dict[str, float]:
    """Figures that `EXPECTED` names."""
    values: dict[str, float] = {
        f"{row.part}, {row.quantity}": made.value
        for row, made in study.predictions.items()
        if row.kind == rows.STIFFNESS
    }
    if any(study.missing(row) for row in rows.rows()):
        return values
    values["published pairs that are predicted"] = len(study.predictions)
    named = {row.part.split(",")[0] for row in study.predictions}
    values["solids"] = len(named)
    for kind in (rows.STIFFNESS, rows.BREAKING):
        for name in (kind, kind + rows.ALSO_OURS):
            values[f"median error of {name}, %"] = study.summary.median(name)
        values[f"median error of {kind}, rho of the other solid, %"] = (
            study.summary.median_left_out(kind)
        )
    orders = study.summary.orders
    values["orders wrong or tied"] = len(orders["wrong"]) + len(orders["tie"])
    for solid in ("Loop", "Shell"):
        others = [part for part in rows.FITTED if rows.SOLIDS[part] != solid]
        values[f"rho without the {solid}"] = rows.fitted_rho(others, study.tests)
    return values


_PLURAL = {
    rows.STIFFNESS: "stiffness ratios",
    rows.BREAKING: "ratios of breaking loads",
    rows.SLOPE: "slopes",
    rows.LOAD: "breaking loads",
}


def summary_lines(study: Study) -> str:
    """Medians and orders in words, as a list."""
    whole = study.summary
    lines = []
    wanted = {rows.STIFFNESS: ", wanted at most 8", rows.BREAKING: ", wanted at most 10"}
    for kind in (rows.STIFFNESS, rows.BREAKING, rows.SLOPE, rows.LOAD):
        errors = whole.errors.get(kind, ())
        every = whole.errors.get(kind + rows.ALSO_OURS, ())
        if not errors:
            continue
        sentence = f"{whole.median(kind):.1f} %{wanted.get(kind, '')} ({len(errors)} values"
        sentence += f", {min(errors):+.0f} to {max(errors):+.0f} %)"
        if len(every) > len(errors):
            sentence += (
                f"; with our paths {whole.median(kind + rows.ALSO_OURS):.1f} % ({len(every)})"
            )
        if kind in whole.left_out:
            sentence += f"; rho fitted to the other solid {whole.median_left_out(kind):.1f} %"
            sentence += f" ({len(whole.left_out[kind])})"
        if kind == rows.BREAKING:
            sentence += f"; by the stiffness alone {rows.median_size(whole.stiffness):.1f} %"
            sentence += f" ({min(whole.stiffness):+.0f} to {max(whole.stiffness):+.0f} %)"
        lines.append(f"median error of {_PLURAL[kind]}: {sentence}")
    counts = {name: len(pairs) for name, pairs in whole.orders.items()}
    total = sum(counts.values())
    if total:
        theirs = [name for name, pairs in whole.orders.items() for row in pairs if not row.ours]
        sentence = f"orders of two designs: {counts['right']} of {total} right"
        lines.append(f"{sentence}; of published paths {theirs.count('right')} of {len(theirs)}")
    for name in ("wrong", "tie"):
        lines += [f"order {name}: {row.part}, {row.quantity}" for row in whole.orders[name]]
    return "".join(f"- {line}\n" for line in lines)


# The figure: predicted over measured.


_KINDS = {
    rows.STIFFNESS: "#0072b2",
    rows.BREAKING: "#d55e00",
    rows.SLOPE: "#56b4e9",
    rows.LOAD: "#e69f00",
}
_MARKS = {
    "Loop": "o",
    "Shell, pulled": "s",
    "Shell, pushed": "D",
    "cuboid, pushed": "v",
    "bending beam": "^",
    "T-bracket": "P",
    "T-bracket, dense": "X",
}


def _scatter(study: Study) -> "Figure | None":
    """Draw predicted over measured ratios, and absolute values, each with its interval."""
    from ccfem.comparison.plot.canvas import canvas

    drawn = [row for row in study.predictions if row.kind != rows.ORDER]
    if not drawn:
        return None
    figure = canvas(11.0, 5.6, layout="constrained", dpi=130.0)
    grid = figure.subplots(1, 2)
    for axes, kinds, unit in (
        (grid[0], (rows.STIFFNESS, rows.BREAKING), "ratio of two prints"),
        (grid[1], (rows.SLOPE, rows.LOAD), "slope, kN/mm, or breaking load, kN"),
    ):
        rows_here = [row for row in drawn if row.kind in kinds]
        values = [row.measured for row in rows_here]
        made = [study.predictions[row] for row in rows_here]
        ends = [*values, *(m.low for m in made), *(m.high for m in made), 1.0]
        span = np.array([0.9 * min(ends), 1.1 * max(ends)])
        share = 1.0 + BAND / 100.0
        axes.fill_between(span, span / share, span * share, color="#e4e7ea", lw=0.0)
        axes.plot(span, span, color="#5d6878", lw=0.8)
        for row, prediction in zip(rows_here, made, strict=True):
            colour = _KINDS[row.kind]
            face = colour if row.counted and not row.ours else "none"
            axes.plot([row.measured] * 2, [prediction.low, prediction.high], color=colour, lw=1.0)
            axes.plot(
                *(row.measured, prediction.value), _MARKS[row.part], ms=6.5, mec=colour, mfc=face
            )
        axes.set(xscale="log", yscale="log", xlim=span, ylim=span, aspect="equal")
        axes.set_xlabel(f"measured: {unit}")
        axes.set_ylabel(f"predicted: {unit}")
        _plain_ticks(axes, span)
    _legend(grid[0], {row.part for row in drawn}, (rows.STIFFNESS, rows.BREAKING))
    _legend(grid[1], set(), (rows.SLOPE, rows.LOAD))
    return figure


def _plain_ticks(axes: Any, span: Any) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    steps = np.array([0.4, 0.5, 0.7, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0])
    inside = steps[(steps > span[0]) & (steps < span[1])]
    if len(inside) > 9:
        inside = inside[inside != 1.25]
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(FixedLocator(inside.tolist()))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _legend(axes: Any, parts: set[str], kinds: tuple[str, ...]) -> None:
    """Name kinds by colour and parts by mark; hollow marks and band in words."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=_KINDS[kind], lw=4.0, label=kind) for kind in kinds]
    for part, mark in _MARKS.items():
        if part in parts:
            handles.append(Line2D([], [], marker=mark, color="#1d2430", lw=0.0, label=part))
    if parts:
        handles.append(
            Line2D([], [], marker="o", mfc="none", color="#1d2430", lw=0.0, label=_HOLLOW)
        )
    axes.legend(handles=handles, fontsize=7.5, loc="upper left", framealpha=0.9)


_HOLLOW = "hollow: our paths, or not counted"


def _figures(study: Study) -> Mapping[str, "Callable[[], Figure | None]"]:
    return {"figure_01_predicted_over_measured": lambda: _scatter(study)}


# The whole.


def introduction(study: Study) -> str:
    """Say what the table shows, in words that its figures bear out."""
    return f"""\
# Predicted beside measured

Every stiffness, breaking load and ratio that five papers and Zhang et al. 2025 measured on printed
parts, beside what the virtual test predicts, with one set of parameters for all: EA/E = 4 mm^2 and
strands that carry tension only. The intervals reach to strands with a fifth of their stiffness in
compression. Breaking loads are taken to grow as the stiffness does, until a strand carries the
highest force that strands of the other solid carried when its prints broke (a table below); these
forces are taken in tension only, and intervals leave out the spread of that strength.

{summary_lines(study)}
What these figures are worth:

- They come from one specimen a print (three of the cuboid and the bars), so a single error may be
  off by scatter that nobody published. Of the three ratios of a part two are independent.
- No value is fitted on a print that it predicts. Modulus and strength of the matrix come from the
  print without fibre of another part. EA/E = 4 was chosen when the tests of the Loop and of the
  pulled Shell were known; a table below predicts these with EA/E fitted to the other solid alone.
- Strands that break are an old law of the virtual test, but they came into this table when all its
  loads were known. They lower the load of the Loop's authors' paths by 9 %, those of the pulled
  Shell by up to 1 %, and no other. Forces in strands are those at EA/E = 4 mm^2 throughout. A
  part that is not in the table has to confirm it.
- Absolute slopes are off by as much as the matrix of two prints differs: without a print of the
  part itself, or a coupon, only ratios mean something.
- Where layers come apart, which the papers saw in the Loop's zigzag and in the T-bracket with
  layers across z, the stiffness says nothing about the breaking load.
- `authors'` are the stress-oriented paths of Chen et al. "Theirs" are published paths, "ours" plans
  of ccfem for the published load and length of fibre, "rebuilt" is what was made from a drawing.
  Rows that are not counted are left out of medians and orders; the last table says why.
"""


def write_all(folder: Path, progress: Progress = silent) -> None:
    """Test all parts whose data is named, and write table, figure and summary."""
    study = Study(parts_tested(progress))
    write_evidence(study, folder / "evidence.csv")
    names = write_figures(drawn_of(_figures(study), None), folder)
    pairs, lines = pairs_table(study), summary_lines(study)
    (folder / "pairs.md").write_text(f"{pairs}\n{lines}", encoding="utf-8")
    sections = {
        "Measured and predicted": pairs,
        "With EA/E fitted to the other solid": left_out_table(study),
        "With EA/E fitted to one print with fibre of the same part": calibrated_table(study),
        "Highest force in a strand at the measured breaking load": force_table(study),
        "Measured, and not predicted": absent_table(),
        "What each row rests on": basis_table(),
    }
    write_claims(folder, quantities(study), EXPECTED)
    write_report(folder, introduction(study), sections, names)


CONTENTS = Contents(
    title="Predicted beside measured: every published test of a printed part",
    seconds=200.0,
    whole=write_all,
    run=lambda progress: Study(parts_tested(progress)),
    tables={
        "pairs": lambda study: pairs_table(study()),
        "absent": lambda study: absent_table(),
        "basis": lambda study: basis_table(),
        "left_out": lambda study: left_out_table(study()),
        "claims": lambda study: claim_table(judged(quantities(study()), EXPECTED)),
    },
    figures=lambda study, number: drawn_of(_figures(study), number),
    numbers=(1,),
    shown="pairs.md",
)
