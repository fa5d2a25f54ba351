"""Sections that the reports of comparisons share, over one slicing and over several."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from ccfem.comparison.headline import (
    HEADLINE,
    TEST_COLUMNS,
    Headline,
    cell_text,
    headline_values,
)
from ccfem.comparison.html import number
from ccfem.comparison.ranking import best_values, stiffness_ratios
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Wanted
from ccfem.comparison.slicings import SlicingComparison
from ccfem.elasticity.stress_field import about_cells
from ccfem.evaluation import COLUMNS, Column
from ccfem.virtual_testing.stiffer import HONEST_PROMISE

__all__ = [
    "against_each_other",
    "all_indices",
    "computation",
    "glossary",
    "header",
    "headline_section",
    "page",
    "parameters_section",
    "reproduce",
]

Table = Comparison | SlicingComparison
"""What is shown: runs with their order."""

STYLE = """
:root { --ink: #1d2430; --soft: #5d6878; --line: #dfe4ea; --mark: #e8f4ec; --good: #1b7f4b; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1240px; padding: 32px 24px 64px; color: var(--ink);
  font: 15px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
h1 { font-size: 27px; line-height: 1.25; margin: 0 0 4px; }
h2 { font-size: 19px; margin: 40px 0 10px; padding-top: 14px; border-top: 1px solid var(--line); }
h3 { font-size: 15px; margin: 18px 0 6px; }
p.sub { color: var(--soft); margin: 0 0 18px; }
p.verdict { font-size: 17px; background: var(--mark); border-left: 4px solid var(--good);
  padding: 10px 14px; margin: 18px 0; }
p.note { color: var(--soft); font-size: 13.5px; max-width: 900px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { padding: 6px 10px; text-align: right; border-bottom: 1px solid var(--line);
  vertical-align: top; }
th { font-weight: 600; font-size: 13px; color: var(--soft); vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; }
tr.first td:first-child { font-weight: 700; }
td.best { background: var(--mark); color: var(--good); font-weight: 700; }
td small { display: block; color: var(--soft); font-weight: 400; font-size: 11.5px; }
ul.note { color: var(--soft); font-size: 13.5px; max-width: 900px; padding-left: 18px; }
td.failed { text-align: left; color: #a02c2c; }
td.text { text-align: left; }
table.narrow { width: auto; min-width: 50%; font-size: 13.5px; }
.pictures { display: grid; gap: 12px; margin: 8px 0 4px; }
figure { margin: 0; }
figure img { width: 100%; display: block; border: 1px solid var(--line); border-radius: 4px; }
figcaption { font-size: 13px; color: var(--soft); padding-top: 3px; }
details { margin: 10px 0; }
summary { cursor: pointer; font-weight: 600; padding: 4px 0; }
code, pre { font: 13px/1.45 ui-monospace, "SF Mono", Menlo, Consolas, monospace; }
pre { background: #f5f7f9; padding: 10px 12px; border-radius: 4px; overflow-x: auto; }
dt { font-weight: 600; margin-top: 8px; }
dd { margin: 0 0 0 20px; color: var(--soft); font-size: 13.5px; }
footer { margin-top: 48px; color: var(--soft); font-size: 13px; }
@media (max-width: 760px) { .pictures { grid-template-columns: repeat(2, 1fr) !important; } }
@media print { details > * { display: block; } body { max-width: none; } }
"""


def page(title: str, sections: Sequence[str]) -> str:
    """One HTML text that needs no other file."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n"
        f"<body>\n{''.join(sections)}\n</body>\n</html>\n"
    )


def header(comparison: Table, record: Mapping[str, Any], facts: Sequence[str]) -> str:
    """Title of the part, what was done with it, and what was found in its mesh."""
    case, about = comparison.case, record["case"]
    load = ""
    if about["load"] is not None:
        load = f", in all ({', '.join(f'{part:.4g}' for part in about['load'])}) N"
    facts = [
        f"load case “{about['load_case']}”{load}",
        f"{about['cells']:,} tetrahedra of order {about['order']}",
        *facts,
        f"fibre width W {case.machine.fibre_width:g} mm",
    ]
    source = f"<br>Source: {escape(case.source)}." if case.source else ""
    findings = (*case.findings, *comparison.stress.findings)
    source += "".join(f"<br>Mesh: {escape(found)}." for found in findings)
    return (
        f"<h1>{escape(case.title)}</h1>\n"
        f'<p class="sub">{escape(" · ".join(facts))}{source}<br>Units: mm, N, MPa.</p>\n'
    )


def headline_section(
    comparison: Table, wanted: Wanted, said: Sequence[str], columns: Sequence[Headline] = HEADLINE
) -> str:
    """Verdicts, the table of the headline, and what has to stand next to it."""
    best, runs = best_values(comparison.runs, wanted), comparison.ranking
    values = {run.name: headline_values(run) for run in runs}
    heads = [h for h in columns if any(h.column in found for found in values.values())]
    rows = []
    for run in runs:
        if run.evaluation is None:
            reason = f'<td class="failed" colspan="{len(heads)}">failed: {escape(run.failure)}</td>'
            rows.append(f"<tr><td>{escape(run.name)}</td>{reason}</tr>")
            continue
        cells = "".join(
            _cell(
                *cell_text(run, h),
                run.printable and values[run.name].get(h.column) == best.get(h.column, np.nan),
            )
            for h in heads
        )
        first = ' class="first"' if not rows else ""
        rows.append(f"<tr{first}><td>{escape(run.name)}</td>{cells}</tr>")
    titles = "".join(f"<th>{escape(h.title)}</th>" for h in heads)
    notes = "".join(f"<li>{escape(line)}.</li>" for line in comparison.remarks)
    notes = f'<ul class="note">{notes}</ul>' if notes else ""
    if any(run.tested is not None for run in runs):
        notes += f'<p class="note"><b>{escape(HONEST_PROMISE)}</b></p>'
    return (
        "".join(f'<p class="verdict">{escape(line)}</p>\n' for line in said)
        + f'<div class="scroll"><table><tr><th>strategy</th>{titles}</tr>\n'
        + "\n".join(rows)
        + f"</table></div>\n{notes}"
        '<p class="note">Best values are marked where they really are: of runs that can be '
        "printed, of stiffnesses that the test tells apart. Alignment and efficiency are of the "
        "stress that a strategy may itself have followed: they say how well the paths do what they "
        "set out to do, not how strong the printed part is.</p>\n"
    )


def _cell(text: str, extra: str, best: bool) -> str:
    mark = ' class="best"' if best else ""
    small = f"<small>{escape(extra)}</small>" if extra else ""
    return f"<td{mark}>{escape(text)}{small}</td>"


def against_each_other(comparison: Table) -> str:
    """Return the table of stiffness of each strategy over that of each other."""
    runs = [run for run in comparison.ranking if run.tested is not None]
    if len(runs) < 2:
        return ""
    head = "".join(f"<th>over {escape(run.name)}</th>" for run in runs)
    rows = []
    for run in runs:
        cells = []
        for other in runs:
            tension, bonded = stiffness_ratios(run, other)
            text = "–" if run is other else f"{tension:.2f} ({bonded:.2f})"
            cells.append(f"<td>{text}</td>")
        rows.append(f"<tr><td>{escape(run.name)}</td>{''.join(cells)}</tr>")
    return (
        "<h2>Stiffness against each other</h2>\n"
        '<p class="note">Stiffness of the part by the strategy of the row over that of the column, '
        "fibres carrying tension only, in brackets bonded.</p>\n"
        f'<table class="narrow"><tr><th>strategy</th>{head}</tr>{"".join(rows)}</table>\n'
    )


def all_indices(comparison: Table) -> str:
    """Table of every index of every run."""
    runs = [run for run in comparison.ranking if run.evaluation is not None]
    head = "".join(f"<th>{escape(run.name)}</th>" for run in runs)
    rows = []
    values = [headline_values(run) for run in runs]
    for column in (*TEST_COLUMNS, *COLUMNS):
        cells = "".join(f"<td>{number(found.get(column.name, np.nan))}</td>" for found in values)
        unit = "" if column.unit == "1" else f" ({escape(column.unit)})"
        rows.append(
            f'<tr><td title="{escape(column.formula)}">{escape(column.name)}{unit}</td>{cells}</tr>'
        )
    return (
        "<h2>All indices</h2>\n<details><summary>Totals over all layers; per layer in "
        f'results.csv</summary><div class="scroll"><table class="narrow"><tr><th>index</th>{head}'
        f"</tr>\n{''.join(rows)}</table></div></details>\n"
    )


def parameters_section(comparison: Table) -> str:
    """Return what every strategy and the machine were set to."""
    rows = []
    for run in comparison.runs:
        amount = run.strategy.amount.parameter
        text = ", ".join(
            f"<b>{escape(key)} = {escape(_short(value))}</b>"
            if key == amount
            else f"{escape(key)} = {escape(_short(value))}"
            for key, value in run.parameters.items()
        )
        rows.append(f'<tr><td>{escape(run.name)}</td><td class="text">{text}</td></tr>')
    machine = ", ".join(
        f"{key} = {_short(value)}"
        for key, value in vars(comparison.case.machine).items()
        if value is not None and key != "gcode"
    )
    rows.append(f'<tr><td>machine</td><td class="text">{escape(machine)}</td></tr>')
    return (
        '<h2>Parameters</h2>\n<p class="note">The parameter that sets how much fibre a strategy '
        f"lays is in bold.</p>\n<table>{''.join(rows)}</table>\n"
    )


def _short(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def computation(comparison: Table, record: Mapping[str, Any]) -> str:
    """Say what was computed how, and in what time."""
    solver = record["solver"]
    lines = [
        f"Solve: {solver['backend']}, {solver['unknowns']:,} unknowns, "
        + (f"{solver['iterations']} iterations, " if solver["iterations"] else "direct, ")
        + f"relative residual {solver['residual']:.1e}, assembly "
        f"{solver['assembly_seconds']:.2f} s, solve {solver['solve_seconds']:.2f} s.",
        f"{about_cells(comparison.stress)}; backward error of the equations "
        f"{solver['backward_error']:.1e}.",
        f"Material: {record['case']['material']}. Strain energy "
        f"{record['strain_energy']:.4g} N mm.",
    ]
    stages = dict(record["seconds"])
    heads = list(dict.fromkeys(stage for run in comparison.runs for stage in run.seconds))
    rows = "".join(
        f"<tr><td>{escape(run.name)}</td>"
        + "".join(f"<td>{_seconds(run.seconds.get(stage))}</td>" for stage in heads)
        + "</tr>"
        for run in comparison.runs
    )
    once = ", ".join(f"{stage} {_seconds(value)}" for stage, value in stages.items())
    titles = "".join(f"<th>{escape(stage)}, s</th>" for stage in heads)
    body = "".join(f"<p>{escape(line)}</p>\n" for line in lines)
    return (
        f"<h2>Computation</h2>\n{body}<p>Seconds: {escape(once)}.</p>\n"
        f'<table class="narrow"><tr><th>strategy</th>{titles}</tr>{rows}</table>\n'
    )


def _seconds(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def glossary() -> str:
    """Say what each index is."""
    entries = "".join(_entry(column) for column in (*TEST_COLUMNS, *COLUMNS))
    return (
        "<h2>Glossary</h2>\n<details><summary>What each index is</summary>\n"
        f"<dl>{entries}</dl></details>\n"
    )


def _entry(column: Column) -> str:
    unit = "" if column.unit == "1" else f", {escape(column.unit)}"
    return (
        f"<dt><code>{escape(column.name)}</code>{unit}</dt>"
        f"<dd>{escape(column.formula)}<br>Range: {escape(column.range)}.</dd>"
    )


def reproduce(record: Mapping[str, Any]) -> str:
    """Say what to type for the same again, and which versions ran."""
    versions = ", ".join(f"{key} {value}" for key, value in record["versions"].items())
    return (
        f"<h2>Repeat it</h2>\n<pre>{escape(record['command'])}</pre>\n"
        f"<footer>ccfem {escape(record['ccfem'])} · {escape(record['made'])} · "
        f"{escape(versions)}</footer>\n"
    )
