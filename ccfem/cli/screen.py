"""What the command line prints: lists of cases and strategies, and the table of a comparison."""

import dataclasses
import inspect
import io
import os
import re
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ccfem.base.checks import check_known
from ccfem.base.tensor import von_mises
from ccfem.cli.docstring import about, attributes
from ccfem.comparison.bed_print import BedPrint
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Printed
from ccfem.comparison.shown import file_stem
from ccfem.comparison.table import FIRST_REMARKS, Cell, Row, Table as Values, load_cases_table
from ccfem.fem.elasticity.stress_field import StressField, about_cells
from ccfem.judging.virtual_testing.stiffness_test import HONEST_PROMISE, IN_SHORT
from ccfem.printing.export.gcode import clock

Item = typing.TypeVar("Item")

_TITLES, _NUMBERS = 30, 20
"""Characters that a table is given for its titles and for each strategy, where neither a terminal
nor COLUMNS sets its width."""


def print_cases() -> None:
    """Print the cases, what they are, and their parameters with defaults."""
    from ccfem.cases import named_cases

    console = Console(highlight=False)
    for name, make in sorted(named_cases().items()):
        console.print(f"[bold]{name}[/bold]  {_first_line(make)}")
        parameters = inspect.signature(make).parameters.values()
        given = ", ".join(f"{parameter.name} = {parameter.default!r}" for parameter in parameters)
        console.print(f"    {given}", markup=False)


def print_members(kind: str) -> None:
    """Print strategies or slicers with their parameters, defaults and choices.

    Parameters
    ----------
    kind : {"strategy", "slicer"}
    """
    console = Console(highlight=False)
    for name, member in sorted(_members(kind).items()):
        console.print(f"[bold]{name}[/bold]  {_first_line(member)}")
        table = Table(box=None, show_header=False, padding=(0, 2, 0, 4))
        table.add_column(no_wrap=True)
        hints = typing.get_type_hints(member)
        for field in dataclasses.fields(member):
            note = _amount(member, field.name) or _choices(hints[field.name])
            table.add_row(field.name, _default(field), note)
        console.print(table)


def print_member(kind: str, name: str) -> None:
    """Print what one strategy or slicer does, and what each of its parameters means."""
    known = _members(kind)
    check_known(kind, name, sorted(known))
    member, by_class = known[name], {class_.__name__: class_ for class_ in known.values()}
    console = Console(highlight=False)
    console.print(f"[bold]{name}[/bold]")
    for paragraph in about(member):
        console.print(paragraph, markup=False)
    values = attributes(member)
    rows = []
    for field in dataclasses.fields(member):
        what = values[field.name].kind if field.name in values else ""
        note = _amount(member, field.name)
        meaning = _meaning(member, field.name, by_class)
        text = f"{meaning} {note and f'It {note}.'}".strip()
        rows.append((field.name, _default(field), what, text))
    heads = ("parameter", "default", "type, unit", "meaning")
    table = Table(box=box.SIMPLE_HEAD, header_style="bold")
    for k, head in enumerate(heads):
        width = _longest_word([head, *(row[k] for row in rows)])
        table.add_column(head, no_wrap=not k, min_width=width)
    for row in rows:
        table.add_row(*map(escape, row))
    if not _is_cut(console, table):
        console.print(table)
        return
    for name, default, what, text in rows:
        console.print(f"\n[bold]{escape(name)}[/bold] = {escape(default)}  {escape(what)}")
        console.print(text, markup=False)


def _members(kind: str) -> Mapping[str, typing.Any]:
    if kind == "slicer":
        from ccfem.slicing import slicers as slicing

        return slicing.named()
    from ccfem import strategies

    return strategies.named()


def _meaning(of: type, parameter: str, by_class: Mapping[str, type]) -> str:
    """Say what a parameter means: "As in `Zigzag`" in the words of that class."""
    text = attributes(of)[parameter].meaning if parameter in attributes(of) else ""
    same = re.match(r"As in `(\w+)`", text)
    if same is None or same[1] not in by_class:
        return text
    return _meaning(by_class[same[1]], parameter, by_class).rstrip(".") + text[same.end() :]


def _amount(member: typing.Any, parameter: str) -> str:
    """Say that a parameter of a strategy sets the amount of fibre, where it does."""
    amount = getattr(member, "amount", None)
    if amount is None:
        return ""
    for name, most in amount.beyond:
        if name == parameter:
            return f"changes next, up to {most:g}, where {amount.parameter} alone lays too little"
    if parameter != amount.parameter:
        return ""
    return f"sets the amount of fibre: {amount.most:g} lays the most, {amount.least:g} the least"


def _default(field: "dataclasses.Field[typing.Any]") -> str:
    """Write the default of a parameter."""
    if field.default_factory is not dataclasses.MISSING:
        return repr(field.default_factory())
    return repr(field.default)


def _choices(hint: object) -> str:
    """Words that a parameter takes, where it takes words."""
    if typing.get_origin(hint) is not typing.Literal:
        return ""
    return "one of " + ", ".join(repr(word) for word in typing.get_args(hint))


def _first_line(what: object) -> str:
    return (inspect.getdoc(what) or "").split("\n")[0]


def print_comparison(
    comparison: Comparison, where: Path, seconds: float, details: bool = False
) -> None:
    """Print the headline table, the best of each index in bold, and where the results are.

    Parameters
    ----------
    where : Path
        Folder of the results.
    seconds : float
        That it took.
    details : bool, default False
        Print every index of the headline and every remark, not only the most important ones.
    """
    console = Console(highlight=False, emoji=False)
    runs = [run for run in comparison.ranking if run.evaluation is not None]
    if not console.is_terminal and "COLUMNS" not in os.environ:
        least = 160 if comparison.over_slicings else _TITLES + _NUMBERS * len(runs)
        console.width = max(console.width, least)
    console.print(comparison.case.title, style="bold", markup=False)
    table = comparison.table if details else comparison.table.first
    if comparison.over_slicings:
        _print_rows(console, table)
    else:
        _print_columns(console, table, "")
    load_cases = load_cases_table(runs)
    if load_cases is not None:
        _print_columns(console, load_cases, "load cases")
    lines = comparison.notes
    shown = lines if details else lines[:FIRST_REMARKS]
    if details:
        console.print(about_cells(comparison.stress), style="dim", markup=False)
    for line in shown:
        console.print(line, style="dim", markup=False)
    for verdict in comparison.verdicts if details else comparison.verdicts[:1]:
        console.print(verdict, style="bold", markup=False)
    if any(run.tested is not None for run in runs):
        console.print(HONEST_PROMISE if details else IN_SHORT, style="dim", markup=False)
    if not details:
        left = len(lines) - len(shown)
        more = f"{left} more remark{'s' if left > 1 else ''}, " if left else ""
        console.print(f"--details or the report: {more}every index", style="dim", markup=False)
    for run in runs:
        if run.print_totals is not None:
            _print_file(console, where / f"{file_stem(run.strategy_name)}.gcode", run)
    _print_where(console, where, seconds)


def print_bed(bed: BedPrint, where: Path, seconds: float) -> None:
    """Print what each part of a file takes, what is doubtful, and where the file is.

    Parameters
    ----------
    where : Path
        Folder of the results.
    seconds : float
        That it took.
    """
    console = Console(highlight=False, emoji=False)
    console.print(", ".join(bed.comparisons), style="bold", markup=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = max(console.width, 160)
    _print_rows(console, bed.table)
    for line in bed.print_plan.warnings:
        console.print(line, style="dim", markup=False)
    _print_file(console, where / "bed.gcode", bed)
    _print_where(console, where, seconds)


def _print_file(console: Console, file: Path, run: Printed) -> None:
    """Print where the file of a print is, its time and its mass, of all parts in it."""
    totals, plan = run.print_totals, run.print_plan
    assert totals is not None
    assert plan is not None
    kinds = {spot.name for spot in plan.standing}
    what = "parts" if len(kinds) > 1 else "copies"
    many = f"{plan.copies} {what} in " if plan.copies > 1 else ""
    text = (
        f"{file}  {many}{clock(totals.seconds)} of printing, {totals.matrix_mass:.2f} g of matrix, "
        f"{totals.fibre_mass:.2f} g of fibre"
    )
    console.print(text, markup=False, soft_wrap=True)


def _print_where(console: Console, where: Path, seconds: float) -> None:
    """Print where the report is, or the folder of the results where there is none."""
    report = where / "report.html"
    shown = report if report.exists() else where
    console.print(f"{shown}  ({seconds:.1f} s)", markup=False, soft_wrap=True)


def _print_columns(console: Console, values: Values, corner: str) -> None:
    """Print a table with a column for each of its rows; one below the other where too wide."""
    titles = [corner, *(head.title for head in values.heads)]
    whole = max(map(len, titles)) <= console.width // 2

    def drawn(rows: Sequence[Row]) -> Table:
        table = Table(header_style="bold", box=box.SIMPLE_HEAD)
        table.add_column(corner, no_wrap=whole, min_width=_longest_word(titles))
        for name, *_ in rows:
            table.add_column(escape(name), justify="right", no_wrap=True)
        for k, head in enumerate(values.heads):
            table.add_row(escape(head.title), *(_marked(cells[k]) for _, cells, _ in rows))
        return table

    _print_in_columns(console, [row for row in values.rows if row[1]], drawn)


def _print_rows(console: Console, values: Values) -> None:
    """Print a table row by row, with as many columns as the screen is wide."""

    def drawn(count: int) -> Table:
        table = Table(header_style="bold", box=box.SIMPLE_HEAD)
        table.add_column("", no_wrap=True)
        for head in values.heads[:count]:
            width = _longest_word([head.title])
            table.add_column(escape(head.title), justify="right", min_width=width)
        for name, cells, _ in values.rows:
            texts = map(_marked, cells[:count]) if cells else ["failed"]
            table.add_row(escape(name), *texts)
        return table

    count = len(values.heads)
    while count > 1 and _is_cut(console, drawn(count)):
        count -= 1
    console.print(drawn(count))
    if count < len(values.heads):
        left = ", ".join(head.title for head in values.heads[count:])
        console.print(f"in the report: {left}", style="dim", markup=False)


def _marked(cell: Cell) -> str:
    """Text of a cell, the best in green and what adds to it dim."""
    text = f"[bold green]{escape(cell.text)}[/]" if cell.best else escape(cell.text)
    return f"{text} [dim]({escape(cell.small)})[/]" if cell.small else text


def _print_in_columns(
    console: Console, columns: Sequence[Item], table_of: Callable[[Sequence[Item]], Table]
) -> None:
    """Print a table with a column for each item; one below the other where they do not fit."""
    left = list(columns)
    while left:
        count = len(left)
        while count > 1 and _is_cut(console, table_of(left[:count])):
            count -= 1
        console.print(table_of(left[:count]))
        left = left[count:]


def _longest_word(texts: Iterable[str]) -> int:
    """Width below which a column breaks its words."""
    return max((len(word) for text in texts for word in text.split()), default=1)


def _is_cut(console: Console, table: Table) -> bool:
    """Whether a screen is so narrow that a word or a number of a table is broken or left out."""
    wide, here = (
        _printed(Console(width=width, color_system=None, file=io.StringIO(), emoji=False), table)
        for width in (10000, console.width)
    )
    return not set(wide) <= set(here)


def _printed(console: Console, table: Table) -> list[str]:
    """Words of a table as they are printed; lines between them aside."""
    with console.capture() as capture:
        console.print(table)
    rule = "\N{BOX DRAWINGS LIGHT HORIZONTAL}"
    return [word for word in capture.get().split() if word.strip(rule)]


def print_solution(field: StressField, findings: Sequence[str], where: Path) -> None:
    """Print what a solve found in one load case, and where it is written."""
    console = Console(highlight=False, emoji=False)
    sizes = np.linalg.norm(field.displacement, axis=1)
    at = ", ".join(f"{x:.4g}" for x in field.mesh.points[sizes.argmax()])
    mises, nodal = von_mises(field.stress).max(), von_mises(field.nodal).max()
    record = field.record
    lines = [
        f"largest displacement {sizes.max():.4g} mm at ({at}) mm, strain energy "
        f"{field.strain_energy:.4g} N mm",
        f"von Mises stress up to {mises:.4g} MPa in the cells, {nodal:.4g} MPa at the nodes",
    ]
    for label, force in field.support_forces.items():
        lines.append(f"support {label}: ({', '.join(f'{x:.4g}' for x in force)}) N")
    lines.append(about_cells(field))
    how = f"{record.iterations} iterations" if record.iterations else "direct"
    seconds = record.assembly_seconds + record.solve_seconds
    lines.append(
        f"{record.backend} ({record.backend_because}), {record.unknowns:,} unknowns, {how}, "
        f"backward error {record.backward_error:.1e}, {seconds:.1f} s"
    )
    console.print(f"load case {field.case}", style="bold", markup=False)
    for line in lines:
        console.print(f"  {line}", markup=False, soft_wrap=True)
    for kind, texts in {"mesh": findings, "warning": field.findings}.items():
        for text in texts:
            console.print(f"  {kind}: {text}", style="dim", markup=False, soft_wrap=True)
    console.print(f"  {where}", markup=False, soft_wrap=True)
